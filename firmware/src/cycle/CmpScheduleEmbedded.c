/*
 * CmpScheduleEmbedded.c - when IEC tasks run: all in main, one after the other (super loop); in place of
 * CmpScheduleTimer.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Needs no SysTimer. A task waits for those that run and for communication: its delay is its jitter.
 */
#include "CmpScheduleTimer.h"

#include <string.h>

#include "IecCycle.h"
#include "SysExcept.h"
#include "SysTime.h"
#include "TaskTrigger.h"
#include "rts_config.h"

typedef struct {
    RTS_UI32 overruns;
    RTS_I64 due_ns; /* cyclic tasks */
} SCHEDULED;

static struct {
    RTS_UI32 count;
    bool started;
    SCHEDULED task[APP_MAX_TASKS];
    RTS_UI8 order[APP_MAX_TASKS]; /* all tasks, highest priority first */
} schedule;

/* Runs a cyclic task that is due. Due times that have passed meanwhile are skipped. */
static void run_cyclic(RTS_UI32 index)
{
    SCHEDULED *task = &schedule.task[index];
    RTS_I64 interval_ns = (RTS_I64)TriggerGetTask(index)->interval_us * 1000;
    RTS_I64 now_ns;

    if (SysTimeGetNs() < task->due_ns)
        return;
    (void)IecTaskCycle(index, task->due_ns);
    now_ns = SysTimeGetNs();
    for (task->due_ns += interval_ns; task->due_ns < now_ns; task->due_ns += interval_ns)
        task->overruns++;
}

RTS_UI32 SchedGetOverruns(RTS_UI32 task)
{
    return schedule.task[task].overruns + TriggerGetLost(task);
}

void SchedBackgroundCycle(void)
{
    RTS_UI32 i;

    if (schedule.started)
        SchedNoteEvents(); /* of variables that were written from outside */
    for (i = 0; i < schedule.count && schedule.started; i++) {
        RTS_UI32 index = schedule.order[i];
        RTS_UI32 kind = TriggerGetTask(index)->kind;
        if (kind == KIND_CYCLIC)
            run_cyclic(index);
        else if (kind == KIND_FREEWHEELING || TriggerTake(index))
            (void)IecTaskCycle(index, SysTimeGetNs());
    }
}

bool SchedHasBackgroundTasks(void)
{
    return schedule.started && schedule.count > 0;
}

static void add_task(const CDL_TASK *tasks)
{
    RTS_UI32 index = schedule.count++;
    RTS_UI32 place;

    schedule.task[index].overruns = 0;
    for (place = index; place > 0; place--) {
        if (tasks[schedule.order[place - 1]].priority <= tasks[index].priority)
            break;
        schedule.order[place] = schedule.order[place - 1];
    }
    schedule.order[place] = (RTS_UI8)index;
}

RTS_RESULT SchedCreateTasks(const CDL_TASK *tasks, RTS_UI32 count, RTS_UI8 *const *areas)
{
    RTS_UI32 i;

    TriggerCreate(tasks, count, areas, NULL);
    schedule.count = 0;
    for (i = 0; i < count; i++)
        add_task(tasks);
    return ERR_OK;
}

RTS_RESULT SchedStart(void)
{
    RTS_I64 now_ns = SysTimeGetNs();
    RTS_UI32 i;

    TriggerForget();
    for (i = 0; i < schedule.count; i++)
        schedule.task[i].due_ns = now_ns;
    schedule.started = true;
    return ERR_OK;
}

void SchedStop(void)
{
    schedule.started = false;
}

#if ONLINE_CHANGE
/* Main runs the tasks, so none is in its cycle. */
void SchedStopOthers(RTS_UI32 kept)
{
    RTS_UNUSED(kept);
}

void SchedStartOthers(RTS_UI32 kept)
{
    RTS_UNUSED(kept);
}

RTS_RESULT SchedChangeOthers(const CDL_TASK *tasks, RTS_UI32 count, RTS_UI32 kept)
{
    SCHEDULED before[APP_MAX_TASKS];
    RTS_UI32 i;

    memcpy(before, schedule.task, sizeof before);
    schedule.count = 0;
    for (i = 0; i < count; i++) {
        add_task(tasks);
        if ((kept >> i & 1) != 0)
            schedule.task[i] = before[i];
        else
            schedule.task[i].due_ns = SysTimeGetNs();
    }
    return ERR_OK;
}
#endif

/* Main runs the tasks, so none runs when it ends. */
void SchedRequestEnd(void)
{
}

#if TASK_LOAD && RTS_ONE_CORE
static SCHED_SAMPLER sampler;

void SchedSetSampler(SCHED_SAMPLER of)
{
    sampler = of;
}
#endif

/* One cycle runs at a time, or none. */
void SchedWatchdogCheck(RTS_I64 now_ns)
{
    IEC_GUARD guard;
    RTS_UI32 i;

    for (i = 0; i <= IecTaskGetCount(); i++) {
        if (IecTaskReadGuard(i, &guard) && now_ns - guard.start_ns > guard.limit_ns)
            SysExceptBreak(guard.arg, RTSEXCPT_WATCHDOG);
    }
#if TASK_LOAD && RTS_ONE_CORE
    if (sampler != NULL)
        sampler(now_ns);
#endif
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
