/*
 * SysExcept.c - what goes wrong in application code. Contract: SysExcept.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysExcept.h"

/*
 * Write here: remember where to come back to, call fn, and fill *exception when a fault, SysExceptRaise or
 * SysExceptBreak left it. The fault handlers redirect the interrupted program to that place. All registers that a
 * function must keep have to be as before: the task that was interrupted below needs its own.
 */
bool SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    fn(arg);
    exception->code = RTSEXCPT_NOEXCEPTION;
    exception->address = 0;
    return true;
}

/* Write here: leave the SysExceptTry of this context, after a call of SysExceptTrace, as from the fault handlers, for
 * the calls that led there. Outside of a SysExceptTry: reset, with the reason kept for the log. */
void SysExceptRaise(RTS_UI32 code, uintptr_t address, const void *stack)
{
    RTS_UNUSED(code);
    RTS_UNUSED(address);
    RTS_UNUSED(stack);
    for (;;)
        ;
}

/* Write here: make the SysExceptTry that was called with `arg` leave as soon as its context goes on. We run above it.
 * And let an interrupt above all tasks call SchedWatchdogCheck every millisecond, else nothing ends an endless loop. */
void SysExceptBreak(const void *arg, RTS_UI32 code)
{
    RTS_UNUSED(arg);
    RTS_UNUSED(code);
}

/* Nothing to give back on bare metal. */
void SysExceptShutdown(void)
{
}
