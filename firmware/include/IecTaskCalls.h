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
};

/* Of task 0. */
enum {
    TASK_VALUE_COUNT = 0,          /* of tasks */
    TASK_VALUE_LOAD = 1,           /* of all tasks [%] */
    TASK_VALUE_EXCEPTION = 2,      /* RTSEXCPT_* of the last exception since power on; 0: none */
    TASK_VALUE_EXCEPTION_TASK = 3, /* its task; 0: it was in code outside of tasks */
};

RTS_RESULT IecTaskCalls_Hook(CMP_HOOK hook);

#endif
