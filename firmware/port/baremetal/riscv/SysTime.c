/*
 * SysTime.c - the clock and the alarm: the counter of the CLINT, and its one compare register for both.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The clock's interrupt counts the milliseconds; the counter says what is between.
 */
#include "SysTime.h"

#include "BareMetal.h"

enum { NS_PER_MS = 1000000, TICKS_PER_MS = BOARD_MTIME_HZ / 1000 };

RTS_STATIC_ASSERT(BOARD_MTIME_HZ % 1000 == 0 && BOARD_MTIME_HZ >= 1000000, a_millisecond_is_a_whole_number_of_ticks);

/* With interrupts masked, or by the interrupt itself. */
static struct {
    RTS_I64 ns; /* at the last tick that was counted */
    RTS_UI32 ms;
    RTS_UI32 at;    /* the counter then */
    RTS_UI32 alarm; /* the counter when it is due */
    bool is_alarm_set;
    void (*on_tick)(RTS_I64 now_ns);
} clock;

static inline RTS_UI32 ticks_of(RTS_UI32 ns)
{
#if 1000000000 % BOARD_MTIME_HZ == 0
    return ns / (1000000000 / BOARD_MTIME_HZ);
#else
    return (RTS_UI32)((RTS_UI64)ns * BOARD_MTIME_HZ / 1000000000u);
#endif
}

static inline RTS_I64 ns_of(RTS_UI32 ticks)
{
#if 1000000000 % BOARD_MTIME_HZ == 0
    return (RTS_I64)ticks * (1000000000 / BOARD_MTIME_HZ);
#else
    return (RTS_I64)(((RTS_UI64)ticks * (RTS_UI32)((1000000000ULL << 22) / BOARD_MTIME_HZ)) >> 22);
#endif
}

/* The interrupt comes at the tick or the alarm, whichever is first. The counter has 64 bits, of which `at` is the lower
 * half: what is compared is never more than a second ahead of it. */
static void set_compare(void)
{
    RTS_UI32 now = CLINT_MTIME, until = clock.at + TICKS_PER_MS - now;
    if ((RTS_I32)until < 0)
        until = 0;
    if (clock.is_alarm_set && (RTS_I32)(clock.alarm - now) < (RTS_I32)until)
        until = (RTS_I32)(clock.alarm - now) > 0 ? clock.alarm - now : 0;
    RTS_UI32 high, again = REG32(BOARD_CLINT + 0xBFFCu);
    do {
        high = again;
        now = CLINT_MTIME;
        again = REG32(BOARD_CLINT + 0xBFFCu);
    } while (high != again);
    CLINT_MTIMECMP = 0xFFFFFFFFu; /* nothing is due while the halves do not belong together */
    CLINT_MTIMECMP_HIGH = high + (now + until < now);
    CLINT_MTIMECMP = now + until;
}

void ClockInit(void)
{
    clock.ns = 0;
    clock.ms = 0;
    clock.at = CLINT_MTIME;
    clock.is_alarm_set = false;
    clock.on_tick = NULL;
    set_compare();
}

static void count_ticks(void)
{
    bool ticked = false;
    while (CLINT_MTIME - clock.at >= TICKS_PER_MS) {
        clock.at += TICKS_PER_MS;
        clock.ns += NS_PER_MS;
        clock.ms++;
        ticked = true;
    }
    if (ticked && clock.on_tick != NULL)
        clock.on_tick(clock.ns);
}

RTS_NOINLINE void ClockInterrupt(void)
{
    count_ticks();
    if (clock.is_alarm_set && (RTS_I32)(CLINT_MTIME - clock.alarm) >= 0) {
        clock.is_alarm_set = false;
        SysTimerAlarm();
    }
    set_compare();
}

void BoardAlarmSet(RTS_UI32 ns)
{
    clock.alarm = CLINT_MTIME + ticks_of(ns) + 1;
    clock.is_alarm_set = true;
    set_compare();
}

void ClockSetCallback(void (*callback)(RTS_I64 now_ns))
{
    clock.on_tick = callback;
}

/* A tick that is pending has not been counted. Three calls are in each task cycle. */
RTS_I64 SysTimeGetNs(void)
{
    RTS_UI32 mask = CpuMask();
    RTS_I64 ns = clock.ns;
    RTS_UI32 ticks = CLINT_MTIME - clock.at;
    CpuRestore(mask);
    return ns + ns_of(ticks);
}

RTS_UI32 SysTimeGetMs(void)
{
    RTS_UI32 mask = CpuMask();
    RTS_UI32 ms = clock.ms + (CLINT_MTIME - clock.at) / TICKS_PER_MS;
    CpuRestore(mask);
    return ms;
}

/* The tick wakes main every millisecond. */
void SysTimeWantPass(RTS_UI32 ms)
{
    RTS_UNUSED(ms);
}
