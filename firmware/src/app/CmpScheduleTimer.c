/*
 * CmpScheduleTimer.c - when IEC tasks run.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpScheduleTimer.h"

#include <string.h>

#include "CmpIecTask.h"
#include "SysAtomic.h"
#include "SysExcept.h"
#include "SysTime.h"
#include "SysTimer.h"
#include "rts_config.h"

/* How one task is scheduled. */
typedef struct {
    const CDL_TASK *record;
    RTS_HANDLE timer;             /* cyclic tasks */
    const volatile RTS_UI8 *flag; /* event tasks: their BOOL */
    RTS_UI8 flag_before;
    RTS_UI32 posts_done;          /* external event tasks: posts of their event that were answered */
} SCHEDULED;

typedef struct {
    const char *name; /* NULL: free */
    RTS_UI32 posts;
} EXTERNAL_EVENT;

static struct {
    RTS_UI32 count;
    RTS_UI32 background_count;
    bool started;
    SCHEDULED task[APP_MAX_TASKS];
    RTS_UI8 background[APP_MAX_TASKS]; /* tasks that run in main, highest priority first */
    EXTERNAL_EVENT event[SCHED_MAX_EXTERNAL_EVENTS];
} schedule;

/* ---- cyclic tasks ---- */

static void on_timer(void *param, RTS_I64 due_ns, RTS_UI32 missed)
{
    RTS_UI32 task = (RTS_UI32)(uintptr_t)param;

    if (missed != 0)
        IecTaskAddOverruns(task, missed);
    IecTaskCycle(task, due_ns, SysTimeGetNs());
}

/* ---- tasks in main ---- */

static void add_background(RTS_UI32 task)
{
    RTS_UI32 place = schedule.background_count++;

    while (place > 0 && schedule.task[schedule.background[place - 1]].record->priority >
                            schedule.task[task].record->priority) {
        schedule.background[place] = schedule.background[place - 1];
        place--;
    }
    schedule.background[place] = (RTS_UI8)task;
}

static EXTERNAL_EVENT *find_event(const char *name)
{
    RTS_UI32 i;

    for (i = 0; i < SCHED_MAX_EXTERNAL_EVENTS; i++) {
        if (schedule.event[i].name != NULL && strcmp(schedule.event[i].name, name) == 0)
            return &schedule.event[i];
    }
    return NULL;
}

static bool has_rising_edge(SCHEDULED *task)
{
    RTS_UI8 now = *task->flag != 0;
    bool rising = now && !task->flag_before;

    task->flag_before = now;
    return rising;
}

/* One post, one cycle; posts that come while the task runs are answered in the next passes. */
static bool has_post(SCHEDULED *task)
{
    const EXTERNAL_EVENT *event = find_event(task->record->name);

    if (event == NULL || SysAtomicLoad(&event->posts) == task->posts_done)
        return false;
    task->posts_done++;
    return true;
}

static bool is_due(SCHEDULED *task)
{
    switch (task->record->kind) {
    case KIND_EVENT:
        return has_rising_edge(task);
    case KIND_EXTERNAL:
        return has_post(task);
    default:
        return true;
    }
}

void SchedBackgroundCycle(void)
{
    RTS_UI32 i;

    if (!schedule.started)
        return;
    for (i = 0; i < schedule.background_count; i++) {
        RTS_UI32 task = schedule.background[i];
        if (is_due(&schedule.task[task])) {
            RTS_I64 now_ns = SysTimeGetNs();
            IecTaskCycle(task, now_ns, now_ns);
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

    for (i = 0; i < schedule.count; i++) {
        if (schedule.task[i].timer != (RTS_HANDLE)RTS_INVALID_HANDLE)
            (void)SysTimerDelete(schedule.task[i].timer);
    }
    schedule.count = 0;
    schedule.background_count = 0;
}

static RTS_RESULT add_task(const CDL_TASK *record, RTS_UI8 *const *areas)
{
    RTS_UI32 index = schedule.count++;
    SCHEDULED *task = &schedule.task[index];

    memset(task, 0, sizeof *task);
    task->record = record;
    task->timer = (RTS_HANDLE)RTS_INVALID_HANDLE;
    if (record->kind == KIND_EVENT)
        task->flag = areas[record->event_area] + record->event_offset;
    if (record->kind == KIND_CYCLIC)
        return SysTimerCreate(on_timer, (void *)(uintptr_t)index, record->interval_us, record->priority, &task->timer);
    add_background(index);
    return ERR_OK;
}

RTS_RESULT SchedCreateTasks(const CDL_TASK *records, RTS_UI32 count, RTS_UI8 *const *areas)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    delete_timers();
    for (i = 0; i < count && result == ERR_OK; i++)
        result = add_task(&records[i], areas);
    if (result != ERR_OK)
        delete_timers();
    return result;
}

/* Events that happened before the start do not count, nor does a BOOL that is TRUE already. */
static void forget_events(SCHEDULED *task)
{
    const EXTERNAL_EVENT *event;

    if (task->record->kind == KIND_EVENT)
        task->flag_before = *task->flag != 0;
    if (task->record->kind == KIND_EXTERNAL) {
        event = find_event(task->record->name);
        task->posts_done = event != NULL ? SysAtomicLoad(&event->posts) : 0;
    }
}

RTS_RESULT SchedStart(void)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    for (i = 0; i < schedule.count; i++)
        forget_events(&schedule.task[i]);
    schedule.started = true;
    for (i = 0; i < schedule.count && result == ERR_OK; i++) {
        if (schedule.task[i].timer != (RTS_HANDLE)RTS_INVALID_HANDLE)
            result = SysTimerStart(schedule.task[i].timer);
    }
    return result;
}

void SchedStop(void)
{
    RTS_UI32 i;

    schedule.started = false;
    for (i = 0; i < schedule.count; i++) {
        if (schedule.task[i].timer != (RTS_HANDLE)RTS_INVALID_HANDLE)
            (void)SysTimerStop(schedule.task[i].timer);
    }
}

/* ---- external events ---- */

static RTS_HANDLE no_event(RTS_RESULT *result, RTS_RESULT reason)
{
    if (result != NULL)
        *result = reason;
    return (RTS_HANDLE)RTS_INVALID_HANDLE;
}

RTS_HANDLE SchedRegisterExternalEvent(const char *name, RTS_RESULT *result)
{
    RTS_UI32 i;

    if (find_event(name) != NULL)
        return no_event(result, ERR_DUPLICATE);
    for (i = 0; i < SCHED_MAX_EXTERNAL_EVENTS; i++) {
        if (schedule.event[i].name == NULL) {
            schedule.event[i].name = name;
            if (result != NULL)
                *result = ERR_OK;
            return i;
        }
    }
    return no_event(result, ERR_NOMEMORY);
}

static bool is_event(RTS_HANDLE event)
{
    return event < SCHED_MAX_EXTERNAL_EVENTS && schedule.event[event].name != NULL;
}

RTS_RESULT SchedUnregisterExternalEvent(RTS_HANDLE event)
{
    if (!is_event(event))
        return ERR_INVALID_HANDLE;
    schedule.event[event].name = NULL;
    return ERR_OK;
}

RTS_RESULT SchedPostExternalEvent(RTS_HANDLE event)
{
    if (!is_event(event))
        return ERR_INVALID_HANDLE;
    (void)SysAtomicAdd(&schedule.event[event].posts, 1);
    return ERR_OK;
}

/* ---- supervision ---- */

void SchedWatchdogCheck(RTS_I64 now_ns)
{
    RTS_UI32 count = IecTaskGetCount();
    IEC_GUARD guard;
    RTS_UI32 i;

    for (i = 0; i <= count; i++) {
        if (IecTaskReadGuard(i, &guard) && now_ns - guard.start_ns > guard.limit_ns)
            SysExceptBreak(guard.context, RTSEXCPT_WATCHDOG);
    }
}

RTS_RESULT CmpScheduleTimer_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        memset(&schedule, 0, sizeof schedule);
    if (hook == CH_COMM_CYCLE)
        SchedBackgroundCycle();
    return ERR_OK;
}
