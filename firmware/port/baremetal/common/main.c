/*
 * main.c - the communication loop of a bare-metal controller.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CMUtils.h"
#include "CmpItf.h"
#include "CmpLog.h"
#include "CmpScheduleTimer.h"
#include "BareMetal.h"
#include "SysCom.h"
#include "SysTime.h"

/* The communication loop may be kept from running for so long, by tasks that leave it no time. */
enum { MAIN_WATCHDOG_MS = 20000 };

static void log_reset_cause(void)
{
    static const char *const names[RESET_CAUSE_COUNT] = {
        "power on", "reset pin", "software", "", "fault of the runtime", "hardware watchdog"};
    const RESET_RECORD *record = ResetGet();
    if (CM_LEAVES_OUT && record->cause == RESET_START)
        LogAdd(CMPID_CmpMgr, LOG_ERROR | LOG_KEPT, ERR_FAILED, "Reset: start of %s failed",
               CMGetComponentName(record->pc));
    else if (record->cause < RESET_FATAL)
        LogAdd(CMPID_CmpMgr, LOG_INFO | LOG_KEPT, ERR_OK, "Reset: %s", names[record->cause]);
    else
        LogAdd(CMPID_CmpMgr, LOG_ERROR | LOG_KEPT, ERR_EXCEPTION, "Reset: %s at 0x%X, " CPU_FAULT_STATUS " 0x%X",
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

/* Names the component that ended the start-up on the first serial line, for a terminal, and in the record of the reset. */
#if CM_LEAVES_OUT
static void fail(void)
{
    enum { LAST_WORDS_MS = 1000 }; /* that they leave, and that a person can read them */
    const CMP_FAILURE *failure = CMGetFailure();
    RTS_UI32 start_ms = SysTimeGetMs();
    char text[64];
    RTS_SIZE size =
        CMUtlsnprintf(text, sizeof text, "\r\nStart of %s failed: 0x%X\r\n", failure->name, (unsigned)failure->error);

    if (SysComGetCount() > 0 && SysComOpen(0) == ERR_OK)
        (void)SysComWrite(0, (const RTS_UI8 *)text, (RTS_UI32)size);
    while (SysTimeGetMs() - start_ms < LAST_WORDS_MS) {
        BoardWatchdogKick();
        CpuSleep(); /* until the next tick */
    }
    ResetNow(RESET_START, failure->id);
}
#else
static void fail(void)
{
    ResetNow(RESET_SOFTWARE, 0);
}
#endif

/* Not a part of ResetHandler, which paints the stack right below its own frame. */
RTS_NOINLINE int main(void)
{
    BoardWatchdogStart(MAIN_WATCHDOG_MS);
    if (CMInit() != ERR_OK)
        fail();
    log_reset_cause();
    for (;;) {
        kick_watchdog();
        (void)CMCallHook(CH_COMM_CYCLE);
        idle();
    }
}
