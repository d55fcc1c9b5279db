/*
 * TaskTime.h - how long each task has had the processor, where there is one and tasks interrupt each other.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef TASKTIME_H
#define TASKTIME_H

#include "CmpStd.h"
#include "rts_config.h"

#if TASK_LOAD && RTS_ONE_CORE
/* Main, or nothing to do, has the processor. */
void TaskTimeForget(void);

/* `task` has the processor from now on; returns the one that had it, which gets it back by the next call. From the context
 * of the task. */
RTS_UI32 TaskTimeSwitch(RTS_UI32 task);

/* How long a task has had it [ns]; wraps. From above all tasks. */
RTS_UI32 TaskTimeGet(RTS_UI32 task);
#endif

#endif
