/*
 * CmpScheduleTimer.c - when IEC tasks run: cyclic tasks in timers, the others in main.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpScheduleTimer.h"

#include <string.h>

#include "CmpIecTask.h"
#include "SysExcept.h"
#include "SysTime.h"
#include "SysTimer.h"
#include "TaskTrigger.h"
#include "rts_config.h"

/* Tasks interrupt each other: without copies they would undo each other's outputs. */
RTS_STATIC_ASSERT(APP_IMAGE_SIZE > 0 || APP_MAX_TASKS == 1, tasks_that_interrupt_each_other_have_copies_of_outputs);

/* How one task is scheduled. */
typedef struct {
    TRIGGER trigger;
    RTS_HANDLE timer; /* cyclic tasks */
} SCHEDULED;

static struct {
    RTS_UI32 count;
    RTS_UI32 background_count;
    bool started;
    SCHEDULED task[APP_MAX_TASKS];
    RTS_UI8 background[APP_MAX_TASKS]; /* tasks that run in main, highest priority first */
    RTS_I64 checked_ns;                  /* when the last check of the watchdog was */
    RTS_I64 since_ns[APP_MAX_TASKS + 1]; /* by guard: start of its cycle plus the time it was held up */
} schedule;

/* ---- cyclic tasks ---- */

static void on_timer(void *param, RTS_I64 due_ns)
{
    (void)IecTaskCycle((RTS_UI32)(uintptr_t)param, due_ns);
}

RTS_UI32 SchedGetOverruns(RTS_UI32 task)
{
    return SysTimerGetOverruns(schedule.task[task].timer);
}

/* ---- tasks in main ---- */

static void add_background(RTS_UI32 task)
{
    RTS_UI32 place = schedule.background_count++;

    while (place > 0 && schedule.task[schedule.background[place - 1]].trigger.record->priority >
                            schedule.task[task].trigger.record->priority) {
        schedule.background[place] = schedule.background[place - 1];
        place--;
    }
    schedule.background[place] = (RTS_UI8)task;
}

void SchedBackgroundCycle(void)
{
    RTS_UI32 i;

    if (!schedule.started)
        return;
    for (i = 0; i < schedule.background_count; i++) {
        RTS_UI32 task = schedule.background[i];
        if (TriggerFired(&schedule.task[task].trigger))
            (void)IecTaskCycle(task, SysTimeGetNs());
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

    TriggerInit(&task->trigger, record, areas);
    task->timer = (RTS_HANDLE)RTS_INVALID_HANDLE;
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

RTS_RESULT SchedStart(void)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    for (i = 0; i < schedule.count; i++)
        TriggerForget(&schedule.task[i].trigger);
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

/* ---- supervision ---- */

enum { NOTHING_RUNS = -1 };

/* Of the cycles that run; on one core the one that started last is the only one that gets on. */
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
 * to the next. Of several tasks that take too long the one that holds up the others is broken first, and they
 * finish. */
void SchedWatchdogCheck(RTS_I64 now_ns)
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

RTS_RESULT CmpScheduleTimer_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT) {
        CMP_CLEAR(schedule);
        TriggerReset();
    }
    if (hook == CH_COMM_CYCLE)
        SchedBackgroundCycle();
    return ERR_OK;
}
