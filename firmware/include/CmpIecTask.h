/*
 * CmpIecTask.h - the tasks of the application (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * IecCycle.h is what a task does in its cycle, CmpScheduleTimer.h decides when.
 */
#ifndef CMPIECTASK_H
#define CMPIECTASK_H

#include "CmpErrors.h"
#include "CmpIecAbi.h"
#include "CmpStd.h"
#include "IecCycle.h"
#ifndef RTS_CFFI
#include "CmpItf.h"
#endif

/* Replaces all tasks by the `count` given (0 deletes them); called by the loader from main while no task runs. The
 * records have been validated; they stay valid until the next call. ERR_NOMEMORY above APP_MAX_TASKS or without a free
 * timer. */
RTS_RESULT IecTaskCreateAll(const CDL_TASK *tasks, RTS_UI32 count, const IEC_CONTEXT *prototype);

/* Starts and stops the scheduling of all tasks, from main. Stop returns when no task is in its cycle. */
RTS_RESULT IecTaskStartAll(void);
void IecTaskStopAll(void);

/* One cycle of each task in main, while the scheduling is stopped: first those that run by themselves, then those whose
 * event has come meanwhile, the highest priority first. After an exception no other one begins. */
void IecTaskRunOnce(void);

/* ERR_INVALIDID when there is no such task. */
RTS_RESULT IecTaskGetInfo(RTS_UI32 task, IEC_TASK_INFO *info);

#ifndef RTS_CFFI
#if ONLINE_CHANGE
/* As IecCycleExchange; traps of a debugger are taken out before, and put in again as those of the image that is there then.
 * Tasks that are not in `kept`, a bit each, are stopped before it; then those that `begin` has set (IecTaskSetCode) begin.
 * ERR_NOMEMORY: it was done, but there is no timer for each of them. */
RTS_RESULT IecTaskExchange(const CYCLE_EXCHANGE *exchange, RTS_UI32 kept);

/* IecCycleSetCode, and what makes the tasks run. The records stay valid until the next call. */
void IecTaskSetCode(const CDL_TASK *records, RTS_UI32 count, RTS_UI32 kept, const IEC_CONTEXT *prototype);
#endif

/* With BP_MAX: called before tasks are started, and when they are to be stopped, before their cycles are waited for. */
typedef struct {
    void (*will_start)(void);
    void (*stop)(void);
} IEC_TASK_WATCHER;

/* There is one. From main, before tasks are started. */
void IecTaskSetWatcher(const IEC_TASK_WATCHER *watcher);

RTS_RESULT CmpIecTask_Hook(CMP_HOOK hook);
#endif

#endif
