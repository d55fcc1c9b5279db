/*
 * CmpScheduleTimer.h - when IEC tasks run. Manual 3.6.2.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A cyclic task runs in the context of its own SysTimer. Tasks that wait for an event (the rising edge of a BOOL, or an
 * external event) do so too on ports with SCHED_EVENTS_IN_TIMERS, freewheeling tasks with SCHED_FREEWHEELING_IN_TIMERS;
 * elsewhere these run in main, in CH_COMM_CYCLE, in the order of their priority. With CmpScheduleEmbedded.c in place of
 * CmpScheduleTimer.c cyclic tasks do so too: the super loop of a device without a timer to spare.
 *
 * A variable is looked at when a cycle of any task has ended, when inputs were read, and in each pass of main, which is
 * for what communication wrote. So each change from FALSE to TRUE that a cycle ends with is one run of the task that
 * waits for it, and changes within a cycle do not count. SCHED_MAX_WAITING_EVENTS of them may wait for the task.
 */
#ifndef CMPSCHEDULETIMER_H
#define CMPSCHEDULETIMER_H

#include "CmpErrors.h"
#include "CmpItf.h"
#include "CmpStd.h"
#include "CompactDownload.h"
#include "SchedEvents.h"
#include "rts_config.h"

/* Creates what the tasks need, stopped; deletes that of the previous tasks. `areas` are the base addresses by APP_AREA_*.
 * Called by CmpIecTask from main. ERR_NOMEMORY when the port has no timer left. */
RTS_RESULT SchedCreateTasks(const CDL_TASK *tasks, RTS_UI32 count, RTS_UI8 *const *areas);

/* Called by CmpIecTask from main. After SchedStop has returned no task is in its cycle: one that is in it for longer than
 * SCHED_STOP_US is aborted, with RTSEXCPT_STOP_TIMEOUT. */
RTS_RESULT SchedStart(void);
void SchedStop(void);

#if ONLINE_CHANGE
/* For the tasks that an online change replaces, all but those in `kept`, a bit each. Stop: they begin no cycle any more, and
 * none is in it when it returns. Start: they go on. Change: `tasks` are what runs in place of all. From main. */
void SchedStopOthers(RTS_UI32 kept);
void SchedStartOthers(RTS_UI32 kept);
RTS_RESULT SchedChangeOthers(const CDL_TASK *tasks, RTS_UI32 count, RTS_UI32 kept);
#endif

/* The runtime is about to end: application code that still runs SCHED_STOP_US later, tasks and initialisation, is aborted
 * like that. For good; from any context, signal handlers too. */
void SchedRequestEnd(void);

/* How many due times of a task were skipped since SchedCreateTasks, because a cycle took too long, or events lost,
 * because too many waited. From main. */
RTS_UI32 SchedGetOverruns(RTS_UI32 task);

/* With SCHED_PROCESSOR_TIME: how long a task had the processor since it was started [ns]; 0 while it is stopped. From
 * main. */
RTS_I64 SchedGetUsedNs(RTS_UI32 task);

/* One pass over the tasks that run in main; part of CH_COMM_CYCLE. */
void SchedBackgroundCycle(void);
/* Whether there are such tasks. */
bool SchedHasBackgroundTasks(void);

/*
 * Aborts IEC code that runs for too long: longer than watchdog time * sensitivity of its task, or than
 * APP_DEFAULT_WATCHDOG_US when it has no watchdog; and code that delays a stop. The port calls it every few
 * milliseconds from a context that preempts every task and main (a timer interrupt above all tasks, a thread); `now_ns`
 * is SysTimeGetNs. A cycle that another one delays is not charged for that time, as far as these calls show it; with
 * SCHED_PROCESSOR_TIME only for the time it had a processor.
 */
void SchedWatchdogCheck(RTS_I64 now_ns);

/* With TASK_LOAD on one core: SchedWatchdogCheck calls `sampler` in the end. There is one. From main. */
typedef void (*SCHED_SAMPLER)(RTS_I64 now_ns);
void SchedSetSampler(SCHED_SAMPLER sampler);

RTS_RESULT CmpScheduleTimer_Hook(CMP_HOOK hook);

#endif
