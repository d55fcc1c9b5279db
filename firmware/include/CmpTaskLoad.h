/*
 * CmpTaskLoad.h - how much of the processor each task takes, and the limit of it. Manual 3.6, 10.2.4.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Loads are percent of one processor in the last TASK_LOAD_WINDOW_MS: each task is charged for the time it had the
 * processor, not for that of tasks that interrupted it. With the setting MaxProcessorLoad a program whose tasks together
 * stay above it for TASK_LOAD_PATIENCE windows ends with RTSEXCPT_PROCESSORLOAD_WATCHDOG in the task with the largest
 * load. Freewheeling tasks do not count for that: they pause instead.
 */
#ifndef CMPTASKLOAD_H
#define CMPTASKLOAD_H

#include "CmpStd.h"

enum { TASK_LOAD_WINDOW_MS = 500, TASK_LOAD_PATIENCE = 4 };

/* Of a cyclic task in the last window (MK905 4.2.5). Others are TASK_IDLE. */
enum {
    TASK_IDLE = 0,     /* it does not run */
    TASK_IN_TIME = 1,  /* each cycle ended before the next one was due */
    TASK_LATE = 2,     /* some did not */
    TASK_TOO_LATE = 3, /* none did */
};

/* Percent of one processor; of task IecTaskGetCount() all together. 0 while the program is stopped. From any context. */
RTS_UI32 TaskLoadGet(RTS_UI32 task);

/* TASK_* of 16 tasks, the first in the lowest two bits; `word` 0: tasks 1 to 16. From any context. */
RTS_UI32 TaskLoadGetStatus(RTS_UI32 word);

#ifndef RTS_CFFI
#include "CmpItf.h"
#include "rts_config.h"

#if TASK_LOAD
RTS_RESULT CmpTaskLoad_Hook(CMP_HOOK hook);
#endif
#endif

#endif
