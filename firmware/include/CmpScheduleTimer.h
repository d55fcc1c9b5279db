/*
 * CmpScheduleTimer.h - when IEC tasks run. Manual 3.6.2.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A cyclic task runs in the context of its own SysTimer. Event tasks (rising edge of their BOOL), external event tasks
 * and freewheeling tasks run in main, in CH_COMM_CYCLE, in the order of their priority. With CmpScheduleEmbedded.c in
 * place of CmpScheduleTimer.c cyclic tasks do so too: the super loop of a device without a timer to spare.
 */
#ifndef CMPSCHEDULETIMER_H
#define CMPSCHEDULETIMER_H

#include "CmpErrors.h"
#include "CmpItf.h"
#include "CmpStd.h"
#include "CompactDownload.h"

/* Creates what the tasks need, stopped; deletes that of the tasks before. `areas` are the base addresses by APP_AREA_*.
 * Called by CmpIecTask from main. ERR_NOMEMORY when the port has no timer left. */
RTS_RESULT SchedCreateTasks(const CDL_TASK *tasks, RTS_UI32 count, RTS_UI8 *const *areas);

/* Called by CmpIecTask from main. After SchedStop has returned no task is in its cycle. */
RTS_RESULT SchedStart(void);
void SchedStop(void);

/* How many due times of a task were skipped since SchedCreateTasks, because a cycle took too long. From main. */
RTS_UI32 SchedGetOverruns(RTS_UI32 task);

/* One pass over the tasks that run in main; part of CH_COMM_CYCLE. */
void SchedBackgroundCycle(void);
/* Whether there are such tasks. */
bool SchedHasBackgroundTasks(void);

/*
 * External events. A KIND_EXTERNAL task runs once for each post of the event that has the task's name. Register and
 * unregister from main (CH_INIT3, CH_EXIT3); `result` may be NULL. RTS_INVALID_HANDLE with ERR_NOMEMORY or
 * ERR_DUPLICATE.
 */
RTS_HANDLE SchedRegisterExternalEvent(const char *name, RTS_RESULT *result);
RTS_RESULT SchedUnregisterExternalEvent(RTS_HANDLE event);
/* From any context, interrupts too. ERR_INVALID_HANDLE when it is not registered. */
RTS_RESULT SchedPostExternalEvent(RTS_HANDLE event);

/*
 * Breaks IEC code that runs for too long: longer than watchdog time * sensitivity of its task, or than
 * APP_DEFAULT_WATCHDOG_US when it has no watchdog. The port calls it every few milliseconds from a context that
 * preempts every task and main (a timer interrupt above all tasks, a thread); `now_ns` is SysTimeGetNs. A cycle that
 * another one holds up is not charged for that time, as far as these calls can tell.
 */
void SchedWatchdogCheck(RTS_I64 now_ns);

RTS_RESULT CmpScheduleTimer_Hook(CMP_HOOK hook);

#endif
