/*
 * SysWatchdog.c - the thread that supervises IEC code: a timer above all tasks.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpScheduleTimer.h"
#include "SysTime.h"
#include "port.h"
#include "rts_config.h"

static struct {
    RTS_HANDLE timer;
} state;

static void check(void *param, RTS_I64 due_ns)
{
    RTS_UNUSED(param);
    RTS_UNUSED(due_ns);
    SchedWatchdogCheck(SysTimeGetNs());
}

/* It runs before the boot application is initialised and until the last task has been stopped. */
RTS_RESULT SysWatchdog_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT_SYSTEM_TASKS) {
        RTS_RESULT result = PortTimerCreate(check, NULL, PORT_WATCHDOG_US, PORT_PRIORITY_WATCHDOG, &state.timer);
        return result == ERR_OK ? SysTimerStart(state.timer) : result;
    }
    if (hook == CH_EXIT_SYSTEM_TASKS) {
        (void)SysTimerDelete(state.timer);
    }
    return ERR_OK;
}
