/*
 * SysWatchdog.c - looks every millisecond whether application code runs for too long, from above all tasks.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpItf.h"
#include "CmpScheduleTimer.h"
#include "BareMetal.h"

RTS_RESULT SysWatchdog_Hook(CMP_HOOK hook);

RTS_RESULT SysWatchdog_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT_SYSTEM_TASKS)
        ClockSetCallback(SchedWatchdogCheck);
    if (hook == CH_EXIT_SYSTEM_TASKS)
        ClockSetCallback(NULL);
    return ERR_OK;
}
