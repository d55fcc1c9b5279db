/*
 * SysTime.c - the clock: SysTick counts the milliseconds, its counter what lies between.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysTime.h"

#include "CortexM.h"

enum { NS_PER_MS = 1000000, TICKS_PER_MS = BOARD_CLOCK_HZ / 1000 };
enum { SYST_ENABLE_IRQ_CORECLOCK = 7, ICSR_PENDSTSET = 1 << 26 };

RTS_STATIC_ASSERT(BOARD_CLOCK_HZ % 1000 == 0, a_millisecond_is_a_whole_number_of_ticks);
RTS_STATIC_ASSERT(BOARD_CLOCK_HZ >= 4000000, ns_per_tick_fits);

/* The time at the last tick that was counted. In two halves, because the tick may come while it is read. */
static struct {
    volatile RTS_UI32 ns_low, ns_high, ms;
    void (*on_tick)(RTS_I64 now_ns);
} counted;

void ClockInit(void)
{
    counted.ns_low = counted.ns_high = counted.ms = 0;
    counted.on_tick = NULL;
    SYST_RVR = TICKS_PER_MS - 1;
    SYST_CVR = 0;
    SYST_CSR = SYST_ENABLE_IRQ_CORECLOCK;
}

void SysTickHandler(void);
void SysTickHandler(void)
{
    RTS_UI32 low = counted.ns_low + NS_PER_MS;
    counted.ns_high += low < NS_PER_MS;
    counted.ns_low = low;
    counted.ms++;
    if (counted.on_tick != NULL)
        counted.on_tick((RTS_I64)(((RTS_UI64)counted.ns_high << 32) | low));
}

void ClockSetCallback(void (*callback)(RTS_I64 now_ns))
{
    counted.on_tick = callback;
}

/* The time `count` says has passed since the last tick; the interrupt comes when it reaches 0. */
static inline RTS_UI32 since_tick(RTS_UI32 count)
{
    RTS_UI32 ticks = count == 0 ? 0 : TICKS_PER_MS - count;
#if 1000000000 % BOARD_CLOCK_HZ == 0
    return ticks * (1000000000 / BOARD_CLOCK_HZ);
#else
    return (RTS_UI32)(((RTS_UI64)ticks * (RTS_UI32)((1000000000ULL << 24) / BOARD_CLOCK_HZ)) >> 24);
#endif
}

/* Three of these are in each task cycle. In a context above the tick it may be pending and not counted. */
RTS_I64 SysTimeGetNs(void)
{
    RTS_UI32 low, high, count;
    do {
        low = counted.ns_low;
        high = counted.ns_high;
        count = SYST_CVR;
    } while (low != counted.ns_low);
    RTS_I64 tick = (RTS_I64)(((RTS_UI64)high << 32) | low);
    if (SCB_ICSR & ICSR_PENDSTSET)
        return tick + NS_PER_MS + since_tick(SYST_CVR);
    return tick + since_tick(count);
}

RTS_UI32 SysTimeGetMs(void)
{
    RTS_UI32 ms = counted.ms;
    return ms + ((SCB_ICSR & ICSR_PENDSTSET) != 0 && ms == counted.ms);
}
