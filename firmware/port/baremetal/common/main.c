/*
 * main.c - the communication loop of a bare-metal controller.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpItf.h"
#include "CmpLog.h"
#include "CmpScheduleTimer.h"
#include "BareMetal.h"
#include "SysTime.h"

/* The communication loop may be kept from running for so long, by tasks that leave it no time. */
enum { MAIN_WATCHDOG_MS = 20000 };

static void log_reset_cause(void)
{
    static const char *const names[RESET_CAUSE_COUNT] = {"power on", "reset pin", "software", "fault of the runtime",
                                                         "hardware watchdog"};
    const RESET_RECORD *record = ResetGet();
    if (record->cause < RESET_FATAL)
        LogAdd(CMPID_CmpMgr, LOG_INFO, ERR_OK, "Reset: %s", names[record->cause]);
    else
        LogAdd(CMPID_CmpMgr, LOG_ERROR, ERR_EXCEPTION, "Reset: %s at 0x%X, " CPU_FAULT_STATUS " 0x%X",
               names[record->cause], (unsigned)record->pc, (unsigned)record->status);
}

/* Whatever hangs, the main loop, the clock or the tasks, ends in a reset. Once a millisecond is enough. A tick that is
 * pending is counted already: while the clock stands still, its time is now one more, now one less. */
static void kick_watchdog(void)
{
    static RTS_UI32 kicked_ms;
    RTS_UI32 now_ms = SysTimeGetMs();
    if ((RTS_I32)(now_ms - kicked_ms) <= 0 || !SysTimersWork())
        return;
    kicked_ms = now_ms;
    BoardWatchdogKick();
}

/* Sleeps until the next interrupt, unless one has brought work since the loop looked. A pending interrupt ends the
 * sleep although it is masked, so none is missed between the question and the sleep. */
static void idle(void)
{
    RTS_UI32 mask = CpuMask();
    if (!BoardHasWork())
        CpuSleep();
    CpuRestore(mask);
}

/* Not a part of ResetHandler, which paints the stack right below its own frame. */
RTS_NOINLINE int main(void)
{
    BoardWatchdogStart(MAIN_WATCHDOG_MS);
    if (CMInit() != ERR_OK)
        ResetNow(RESET_FATAL, 0);
    log_reset_cause();
    for (;;) {
        kick_watchdog();
        (void)CMCallHook(CH_COMM_CYCLE);
        idle();
    }
}
