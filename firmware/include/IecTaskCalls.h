/*
 * IecTaskCalls.h - what a program asks about its tasks, and the watchdog of one that it disables.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * External functions, called from tasks; a task has a number from 1 (IEC_CONTEXT.task). They take and give values only, so
 * that no address of the program is written:
 *
 *   task_value(UDINT task, UDINT what):UDINT     TASK_VALUE_*; of task 0 those of all tasks; 0 for others
 *   task_name(UDINT task, UDINT part):LWORD      8 characters, the first in the lowest byte
 *   task_watchdog(UDINT task, BOOL on):BOOL      of the task that calls it, for this cycle
 *   task_schedule(UDINT task, BOOL on):BOOL      FALSE: no cycle of the task begins, until TRUE; FALSE if there is no such task
 *
 * stdlib/tasks.st has the functions of CODESYS on top of these.
 */
#ifndef IECTASKCALLS_H
#define IECTASKCALLS_H

#include "CmpItf.h"
#include "rts_config.h"

enum {
    TASK_VALUE_CYCLES = 0,
    TASK_VALUE_LAST_US = 1,
    TASK_VALUE_AVERAGE_US = 2,
    TASK_VALUE_MIN_US = 3,
    TASK_VALUE_MAX_US = 4,
    TASK_VALUE_JITTER_US = 5,
    TASK_VALUE_OVERRUNS = 6,
    TASK_VALUE_KIND = 7, /* KIND_* */
    TASK_VALUE_PRIORITY = 8,
    TASK_VALUE_INTERVAL_US = 9,
    TASK_VALUE_WATCHDOG_US = 10,
    TASK_VALUE_TASK_LOAD = 11, /* [%], CmpTaskLoad.h; 0 without TASK_LOAD, as the status */
};

/* Of task 0. */
enum {
    TASK_VALUE_COUNT = 0,          /* of tasks */
    TASK_VALUE_LOAD = 1,           /* of all tasks [%]: in the last half second with TASK_LOAD, else since the start */
    TASK_VALUE_EXCEPTION = 2,      /* RTSEXCPT_* of the last exception since power on; 0: none */
    TASK_VALUE_EXCEPTION_TASK = 3, /* its task; 0: it was in code outside of tasks */
    TASK_VALUE_STATUS = 4,         /* of tasks 1 to 16, two bits each: TASK_* (CmpTaskLoad.h) */
    TASK_VALUE_STATUS_MORE = 5,    /* of tasks 17 to 32 */
    TASK_VALUE_ALL_CYCLES = 6,     /* of all cyclic tasks */
    TASK_VALUE_ALL_OVERRUNS = 7,
};

/* Notes an exception that a task has just had, for IecGetLastException. From its context. */
void IecTaskCallsNote(RTS_UI32 task, RTS_UI32 code);

RTS_RESULT IecTaskCalls_Hook(CMP_HOOK hook);

#endif
