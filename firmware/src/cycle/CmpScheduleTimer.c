/*
 * CmpScheduleTimer.c - when IEC tasks run: in timers, as far as the port has them for their kind, the others in main.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpScheduleTimer.h"

#include <string.h>

#include "IecCycle.h"
#include "SettingValues.h"
#include "SysAtomic.h"
#include "SysExcept.h"
#include "SysTime.h"
#include "SysTimer.h"
#include "TaskTrigger.h"
#include "rts_config.h"

/* Tasks interrupt each other: without copies they would undo each other's outputs. */
/* Tasks that interrupt each other have copies of outputs. */
RTS_STATIC_ASSERT(APP_IMAGE_SIZE > 0 || APP_MAX_TASKS == 1,
                  set_APP_IMAGE_SIZE_or_compile_CmpScheduleEmbedded_c_and_NoTimers_c_instead_of_this_and_SysTimer_c);

static struct {
    RTS_UI32 count;
    RTS_UI32 background_count; /* tasks that run in main */
    bool started;
    RTS_HANDLE timer[APP_MAX_TASKS];
    RTS_I64 checked_ns;                  /* when the last check of the watchdog was */
    RTS_I64 since_ns[APP_MAX_TASKS + 1]; /* by guard: when what its cycle is charged with began */
} schedule;

static RTS_UI32 serials[APP_MAX_TASKS + 1]; /* of the cycles that were seen last, where SCHED_PROCESSOR_TIME */

enum { NS_PER_US = 1000 };

/* ---- tasks in timers ---- */

static void run_cyclic(void *param, RTS_I64 due_ns)
{
    (void)IecTaskCycle((RTS_UI32)(uintptr_t)param, due_ns);
}

/* One event, one cycle. */
static void run_events(void *param, RTS_I64 due_ns)
{
    RTS_UI32 task = (RTS_UI32)(uintptr_t)param;

    RTS_UNUSED(due_ns);
    while (TriggerTake(task) && IecTaskCycle(task, SysTimeGetNs()))
        ;
}

/* Manual 3.5: after its cycle a freewheeling task leaves the processor to others, a fifth of the time that it took, or as
 * long as keeps it below MaxProcessorLoad. */
static RTS_I64 pause_after(RTS_I64 cycle_ns)
{
    enum { PAUSE_DIVISOR = 5, WHOLE = 100 /* percent */ };
    const RTS_I64 shortest_ns = (RTS_I64)SCHED_FREEWHEELING_PAUSE_US * NS_PER_US;
    RTS_I64 pause_ns = cycle_ns / PAUSE_DIVISOR;

#if TASK_LOAD && SETTINGS
    if (SETTING(MaxLoad) > 0 && SETTING(MaxLoad) < WHOLE)
        pause_ns = cycle_ns * (WHOLE - SETTING(MaxLoad)) / SETTING(MaxLoad);
#endif
    return pause_ns > shortest_ns ? pause_ns : shortest_ns;
}

static void run_freewheeling(void *param, RTS_I64 due_ns)
{
    RTS_UI32 task = (RTS_UI32)(uintptr_t)param;
    RTS_I64 start_ns = SysTimeGetNs();
    RTS_I64 end_ns;

    RTS_UNUSED(due_ns);
    if (!IecTaskCycle(task, start_ns))
        return;
    end_ns = SysTimeGetNs();
    SysTimerTrigger(schedule.timer[task], end_ns + pause_after(end_ns - start_ns));
}

#if SCHED_PROCESSOR_TIME
RTS_I64 SchedGetUsedNs(RTS_UI32 task)
{
    return SysTimerGetUsedNs(schedule.timer[task]);
}
#endif

/* As long as its variable is TRUE; what wakes it is that it rises. */
static void run_level(void *param, RTS_I64 due_ns)
{
    if (TriggerTake((RTS_UI32)(uintptr_t)param))
        run_freewheeling(param, due_ns);
}

/* What the timer of a task calls; NULL when it runs in main. */
static SYS_TIMER_CALLBACK callback_of(RTS_UI32 kind)
{
    if (kind == KIND_CYCLIC)
        return run_cyclic;
    if (kind == KIND_FREEWHEELING)
        return SCHED_FREEWHEELING_IN_TIMERS ? run_freewheeling : NULL;
    if (SCHED_LEVEL_EVENTS && kind == KIND_LEVEL)
        return SCHED_FREEWHEELING_IN_TIMERS && SCHED_EVENTS_IN_TIMERS ? run_level : NULL;
    return SCHED_EVENTS_IN_TIMERS ? run_events : NULL;
}

RTS_UI32 SchedGetOverruns(RTS_UI32 task)
{
    return SysTimerGetOverruns(schedule.timer[task]) + TriggerGetLost(task);
}

/* ---- tasks in main ---- */

static void run_background(RTS_UI32 task)
{
    if (TriggerGetTask(task)->kind == KIND_FREEWHEELING || TriggerTake(task))
        (void)IecTaskCycle(task, SysTimeGetNs());
}

void SchedBackgroundCycle(void)
{
    RTS_UI32 left = schedule.background_count;
    RTS_UI32 priority;
    RTS_UI32 i;

    if (!schedule.started)
        return;
    SchedNoteEvents(); /* of variables that were written from outside */
    for (priority = 0; left > 0; priority++) {
        for (i = 0; i < schedule.count; i++) {
            if (TriggerGetTask(i)->priority == priority && callback_of(TriggerGetTask(i)->kind) == NULL) {
                run_background(i);
                left--;
            }
        }
    }
}

bool SchedHasBackgroundTasks(void)
{
    return schedule.started && schedule.background_count > 0;
}

/* ---- all tasks ---- */

static void delete_timers(void)
{
    RTS_UI32 i;

    for (i = 0; i < schedule.count; i++)
        (void)SysTimerDelete(schedule.timer[i]);
    schedule.count = 0;
    schedule.background_count = 0;
}

static RTS_RESULT add_task(const CDL_TASK *task)
{
    RTS_UI32 index = schedule.count++;
    SYS_TIMER_CALLBACK callback = callback_of(task->kind);

    schedule.timer[index] = RTS_INVALID_HANDLE;
    if (callback != NULL)
        return SysTimerCreate(callback, (void *)(uintptr_t)index, task->kind == KIND_CYCLIC ? task->interval_us : 0,
                              task->priority, &schedule.timer[index]);
    schedule.background_count++;
    return ERR_OK;
}

RTS_RESULT SchedCreateTasks(const CDL_TASK *tasks, RTS_UI32 count, RTS_UI8 *const *areas)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    delete_timers();
    if (SCHED_PROCESSOR_TIME)
        memset(serials, 0, sizeof serials); /* cycles of other tasks have the same numbers; none has 0 */
    TriggerCreate(tasks, count, areas, schedule.timer);
    for (i = 0; i < count && result == ERR_OK; i++)
        result = add_task(&tasks[i]);
    if (result != ERR_OK)
        delete_timers();
    return result;
}

/* Each timer calls at once: so no event is missed that comes before the timer of its task starts. */
RTS_RESULT SchedStart(void)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    TriggerForget();
    schedule.started = true;
    for (i = 0; i < schedule.count && result == ERR_OK; i++) {
        if (schedule.timer[i] != RTS_INVALID_HANDLE)
            result = SysTimerStart(schedule.timer[i]);
    }
    return result;
}

/* ---- an online change ---- */

#if ONLINE_CHANGE
static bool is_other(RTS_UI32 task, RTS_UI32 kept)
{
    return (kept >> task & 1) == 0;
}

static void for_others(RTS_UI32 kept, RTS_RESULT (*act)(RTS_HANDLE timer))
{
    RTS_UI32 i;

    for (i = 0; i < schedule.count; i++) {
        if (is_other(i, kept))
            (void)act(schedule.timer[i]);
    }
}

/* An event of a task to come has no timer yet. */
void SchedStopOthers(RTS_UI32 kept)
{
    RTS_UI32 i;

    for (i = schedule.count; i < APP_MAX_TASKS; i++)
        schedule.timer[i] = RTS_INVALID_HANDLE;
    for_others(kept, SysTimerStop);
}

void SchedStartOthers(RTS_UI32 kept)
{
    if (schedule.started)
        for_others(kept, SysTimerStart);
}

RTS_RESULT SchedChangeOthers(const CDL_TASK *tasks, RTS_UI32 count, RTS_UI32 kept)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    for_others(kept, SysTimerDelete);
    schedule.count = 0;
    schedule.background_count = 0;
    for (i = 0; i < count; i++) {
        RTS_RESULT added = ERR_OK;
        if (is_other(i, kept)) {
            added = add_task(&tasks[i]);
        } else {
            schedule.count++;
            schedule.background_count += callback_of(tasks[i].kind) == NULL;
        }
        if (added != ERR_OK)
            result = added;
    }
    SchedStartOthers(kept);
    return result;
}
#endif

/* ---- stopping within a time ---- */

/* Not on one core: there no task runs when main stops them. `asked` counts the beginnings and ends of stops, odd: one
 * goes on; the others belong to the watchdog. */
static struct {
    RTS_UI32 asked;
    RTS_UI32 end_asked; /* of the runtime */
    RTS_UI32 seen;
    RTS_I64 since_ns;
} stop;

void SchedStop(void)
{
    RTS_UI32 i;

    schedule.started = false;
    if (!RTS_ONE_CORE)
        SysAtomicStore(&stop.asked, stop.asked + 1);
    for (i = 0; i < schedule.count; i++)
        (void)SysTimerStop(schedule.timer[i]);
    if (!RTS_ONE_CORE)
        SysAtomicStore(&stop.asked, stop.asked + 1);
}

void SchedRequestEnd(void)
{
    SysAtomicStore(&stop.end_asked, 1);
}

/* Looks whether a stop waits for tasks, and since when. */
static void look_for_stop(RTS_I64 now_ns)
{
    RTS_UI32 asked = SysAtomicLoad(&stop.asked);

    if (SysAtomicLoad(&stop.end_asked))
        asked = 1; /* that is once and for all */
    if (asked != stop.seen)
        stop.since_ns = now_ns;
    stop.seen = asked;
}

/* Code that begins after that, such as what runs at the end, has as much time again. */
static bool holds_up_stop(const IEC_GUARD *guard, RTS_I64 now_ns)
{
    RTS_I64 since_ns = guard->start_ns > stop.since_ns ? guard->start_ns : stop.since_ns;

    return (stop.seen & 1) != 0 && now_ns - since_ns > (RTS_I64)SCHED_STOP_US * NS_PER_US;
}

/* ---- supervision ---- */

enum { NOTHING_RUNS = -1 };

/* Of the cycles that run; on one core the one that started last is the only one that makes progress. */
static RTS_I64 find_latest_start(void)
{
    RTS_I64 latest_ns = NOTHING_RUNS;
    IEC_GUARD guard;
    RTS_UI32 i;

    for (i = 0; i <= IecTaskGetCount(); i++) {
        if (IecTaskReadGuard(i, &guard) && guard.start_ns > latest_ns)
            latest_ns = guard.start_ns;
    }
    return latest_ns;
}

/* Time stands still for a cycle as long as one that started later, and may have interrupted it, goes on from one check
 * to the next. Of several tasks that take too long the blocking one is aborted first, so that the others can
 * finish. */
static void check_time(RTS_I64 now_ns)
{
    RTS_I64 latest_ns = find_latest_start();
    RTS_I64 held_ns = latest_ns < schedule.checked_ns ? now_ns - schedule.checked_ns : 0;
    IEC_GUARD guard;
    RTS_UI32 i;

    schedule.checked_ns = now_ns;
    for (i = 0; latest_ns != NOTHING_RUNS && i <= IecTaskGetCount(); i++) {
        RTS_I64 *since_ns = &schedule.since_ns[i];
        if (!IecTaskReadGuard(i, &guard))
            continue;
        if (*since_ns < guard.start_ns)
            *since_ns = guard.start_ns; /* a new cycle */
        if (guard.start_ns < latest_ns)
            *since_ns += held_ns;
        if (now_ns - *since_ns > guard.limit_ns)
            SysExceptBreak(guard.arg, RTSEXCPT_WATCHDOG);
    }
}

/* Where the port knows the processor time of each task: what it had used when a check first saw the cycle counts. */
static void check_used_time(RTS_UI32 place, const IEC_GUARD *guard)
{
    RTS_I64 used_ns = SysExceptGetUsedNs(guard->arg);

    if (used_ns < 0)
        return; /* its cycle is over */
    if (serials[place] != guard->serial)
        schedule.since_ns[place] = used_ns;
    serials[place] = guard->serial;
    if (used_ns - schedule.since_ns[place] > guard->limit_ns)
        SysExceptBreak(guard->arg, RTSEXCPT_WATCHDOG);
}

static void check_each(RTS_I64 now_ns)
{
    RTS_UI32 count = IecTaskGetCount();
    IEC_GUARD guard;
    RTS_UI32 i;

    look_for_stop(now_ns);
    for (i = 0; i <= count; i++) {
        if (!IecTaskReadGuard(i, &guard))
            continue;
        if (holds_up_stop(&guard, now_ns))
            SysExceptBreak(guard.arg, RTSEXCPT_STOP_TIMEOUT);
        else if (SCHED_PROCESSOR_TIME)
            check_used_time(i < count ? i : APP_MAX_TASKS, &guard); /* the place of the initialisation does not move */
    }
}

#if TASK_LOAD && RTS_ONE_CORE
static SCHED_SAMPLER sampler;

void SchedSetSampler(SCHED_SAMPLER of)
{
    sampler = of;
}
#endif

void SchedWatchdogCheck(RTS_I64 now_ns)
{
    if (!RTS_ONE_CORE)
        check_each(now_ns);
    if (!SCHED_PROCESSOR_TIME)
        check_time(now_ns);
#if TASK_LOAD && RTS_ONE_CORE
    if (sampler != NULL)
        sampler(now_ns);
#endif
}

RTS_RESULT CmpScheduleTimer_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT) {
        CMP_CLEAR(schedule);
        CMP_CLEAR(stop);
        TriggerReset();
    }
    if (hook == CH_COMM_CYCLE)
        SchedBackgroundCycle();
    return ERR_OK;
}
