/*
 * SysTime.c - the clock. Contract: SysTime.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysTime.h"

/*
 * Write here: a counter that never goes back, in ns. A hardware counter of 32 bits or less is extended by the interrupt
 * of its overflow; read both halves again when the upper one changed meanwhile, and count an overflow that is pending
 * (see cortexm/SysTime.c). Called from every context, several times per task cycle: below 1 us, and without a 64-bit
 * division.
 */
RTS_I64 SysTimeGetNs(void)
{
    return 0;
}

/* Write here: the milliseconds of the same clock. */
RTS_UI32 SysTimeGetMs(void)
{
    return 0;
}

/* Write here: give other tasks some 20 us, if your tasks are threads. With RTS_ONE_CORE 1 it is never called. */
void SysTimePause(void)
{
}

/* Write here, for a field bus: let main end its sleep after so long, if that may take longer than 1 ms. */
void SysTimeWantPass(RTS_UI32 ms)
{
    RTS_UNUSED(ms);
}
