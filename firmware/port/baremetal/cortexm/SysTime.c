/*
 * SysTime.c - the clock: SysTick counts the milliseconds, its counter what is between.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysTime.h"

#include "BareMetal.h"

enum { NS_PER_MS = 1000000, TICKS_PER_MS = BOARD_CLOCK_HZ / 1000 };
enum { SYST_ENABLE_IRQ_CORECLOCK = 7, ICSR_PENDSTSET = 1 << 26 };

RTS_STATIC_ASSERT(BOARD_CLOCK_HZ % 1000 == 0, a_millisecond_is_a_whole_number_of_ticks);
RTS_STATIC_ASSERT(BOARD_CLOCK_HZ >= 4000000, ns_per_tick_fits);

/* With interrupts masked, or by the tick itself. */
static struct {
    RTS_I64 next_ns; /* when the tick after the last one that was counted comes */
    RTS_UI32 ms;
    void (*on_tick)(RTS_I64 now_ns);
} counted;

void ClockInit(void)
{
    counted.next_ns = NS_PER_MS;
    counted.ms = 0;
    counted.on_tick = NULL;
    SYST_RVR = TICKS_PER_MS - 1;
    SYST_CVR = 0;
    SYST_CSR = SYST_ENABLE_IRQ_CORECLOCK;
}

void SysTickHandler(void);
void SysTickHandler(void)
{
    RTS_I64 now_ns = counted.next_ns;
    counted.next_ns = now_ns + NS_PER_MS;
    counted.ms++;
    if (counted.on_tick != NULL)
        counted.on_tick(now_ns);
}

void ClockSetCallback(void (*callback)(RTS_I64 now_ns))
{
    counted.on_tick = callback;
}

void ClockSkip(RTS_UI32 ms)
{
    counted.next_ns += (RTS_I64)ms * NS_PER_MS;
    counted.ms += ms;
}

/* The time from `count` to the next tick, which comes when the counter reaches 0. */
static inline RTS_UI32 until_tick(RTS_UI32 count)
{
    if (count == 0)
        return NS_PER_MS;
#if 1000000000 % BOARD_CLOCK_HZ == 0
    return count * (1000000000 / BOARD_CLOCK_HZ);
#else
    return (RTS_UI32)(((RTS_UI64)count * (RTS_UI32)((1000000000ULL << 24) / BOARD_CLOCK_HZ)) >> 24);
#endif
}

/* A tick that is pending has not been counted. Three calls are in each task cycle. */
RTS_I64 SysTimeGetNs(void)
{
    RTS_UI32 mask = CpuMask();
    RTS_I64 next_ns = counted.next_ns;
    RTS_UI32 count = SYST_CVR;
    if (SCB_ICSR & ICSR_PENDSTSET) {
        next_ns += NS_PER_MS;
        count = SYST_CVR;
    }
    CpuRestore(mask);
    return next_ns - until_tick(count);
}

RTS_UI32 SysTimeGetMs(void)
{
    RTS_UI32 mask = CpuMask();
    RTS_UI32 ms = counted.ms + ((SCB_ICSR & ICSR_PENDSTSET) != 0);
    CpuRestore(mask);
    return ms;
}

/* The tick wakes main every millisecond. */
void SysTimeWantPass(RTS_UI32 ms)
{
    RTS_UNUSED(ms);
}
