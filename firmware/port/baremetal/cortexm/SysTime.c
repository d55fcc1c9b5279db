/*
 * SysTime.c - the clock: SysTick counts the milliseconds, its counter what lies between.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysTime.h"

#include "CortexM.h"

enum { TICKS_PER_MS = BOARD_CLOCK_HZ / 1000 };
enum { NS_PER_TICK_Q24 = (RTS_UI32)((1000000000ULL << 24) / BOARD_CLOCK_HZ) };
enum { SYST_ENABLE_IRQ_CORECLOCK = 7, ICSR_PENDSTSET = 1 << 26 };

RTS_STATIC_ASSERT(BOARD_CLOCK_HZ % 1000 == 0, a_millisecond_is_a_whole_number_of_ticks);
RTS_STATIC_ASSERT(BOARD_CLOCK_HZ >= 4000000, ns_per_tick_fits);

static volatile RTS_UI32 ms_low, ms_high;
static void (*on_tick)(RTS_I64 now_ns);

void ClockInit(void)
{
    ms_low = ms_high = 0;
    on_tick = NULL;
    SYST_RVR = TICKS_PER_MS - 1;
    SYST_CVR = 0;
    SYST_CSR = SYST_ENABLE_IRQ_CORECLOCK;
}

void SysTickHandler(void);
void SysTickHandler(void)
{
    if (++ms_low == 0)
        ms_high++;
    if (on_tick != NULL)
        on_tick((RTS_I64)((((RTS_UI64)ms_high << 32) | ms_low) * 1000000u));
}

void ClockSetCallback(void (*callback)(RTS_I64 now_ns))
{
    on_tick = callback;
}

/* Milliseconds, and in *ticks the clock ticks since. Consistent in every context: a wrap that the handler has not counted yet
 * (because we run above it) is seen as pending before and after the counter was read. */
static RTS_UI64 read_clock(RTS_UI32 *ticks)
{
    RTS_UI32 low, high, pending, count;
    do {
        high = ms_high;
        low = ms_low;
        pending = SCB_ICSR & ICSR_PENDSTSET;
        count = SYST_CVR;
    } while (low != ms_low || pending != (SCB_ICSR & ICSR_PENDSTSET));
    *ticks = count == 0 ? 0 : TICKS_PER_MS - count; /* the interrupt comes when the counter reaches 0 */
    return (((RTS_UI64)high << 32) | low) + (pending != 0);
}

RTS_I64 SysTimeGetNs(void)
{
    RTS_UI32 ticks;
    RTS_UI64 ms = read_clock(&ticks);
    return (RTS_I64)(ms * 1000000u + (((RTS_UI64)ticks * NS_PER_TICK_Q24) >> 24));
}

RTS_UI32 SysTimeGetMs(void)
{
    RTS_UI32 ticks;
    return (RTS_UI32)read_clock(&ticks);
}
