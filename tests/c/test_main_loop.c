/*
 * test_main_loop.c - the main loop of a bare-metal controller kicks the hardware watchdog while all goes on, and only
 * then.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Each sleep of the loop is a step of the test, which leaves it after as many as it wants.
 */
#define main main_loop
#include "../../firmware/port/baremetal/common/main.c"
#undef main

#include <setjmp.h>

#include "test.h"

enum { PASSES = 1000 };

static jmp_buf end;
static RTS_UI32 ms = 1, passes, kicks;
static bool clock_runs, tick_is_pending_at_times, timers_work;

RTS_UI32 SysTimeGetMs(void)
{
    return ms + (tick_is_pending_at_times ? passes % 2 : 0);
}

bool SysTimersWork(void)
{
    return timers_work;
}

void BoardWatchdogStart(RTS_UI32 period_ms)
{
    CHECK_EQUAL(period_ms, MAIN_WATCHDOG_MS);
}

void BoardWatchdogKick(void)
{
    kicks++;
}

bool BoardHasWork(void)
{
    return false;
}

void CpuSleep(void)
{
    ms += clock_runs;
    if (++passes == PASSES)
        longjmp(end, 1);
}

RTS_RESULT CMInit(void)
{
    return ERR_OK;
}

RTS_RESULT CMCallHook(CMP_HOOK hook)
{
    CHECK_EQUAL(hook, CH_COMM_CYCLE);
    return ERR_OK;
}

void ResetNow(RESET_CAUSE cause, RTS_UI32 pc)
{
    (void)cause;
    (void)pc;
    abort();
}

const RESET_RECORD *ResetGet(void)
{
    static const RESET_RECORD record;
    return &record;
}

void LogAddEntry(RTS_UI32 component, RTS_UI32 log_class, RTS_UI32 error, const char *format, ...)
{
    (void)component;
    (void)log_class;
    (void)error;
    (void)format;
}

/* The time goes on from test to test, as that of the loop does. */
static RTS_UI32 kicks_in_all_passes(bool clock, bool pending, bool timers)
{
    clock_runs = clock;
    tick_is_pending_at_times = pending;
    timers_work = timers;
    passes = kicks = 0;
    if (!setjmp(end))
        (void)main_loop();
    return kicks;
}

static void each_millisecond_kicks(void)
{
    CHECK_EQUAL(kicks_in_all_passes(true, false, true), PASSES);
}

static void timers_that_stand_still_are_no_kick(void)
{
    CHECK_EQUAL(kicks_in_all_passes(true, false, false), 0);
}

static void a_clock_that_stands_still_is_no_kick(void)
{
    CHECK(kicks_in_all_passes(false, false, true) <= 1);
}

/* Between the tick and its interrupt the time is one more already. */
static void a_clock_that_stands_still_is_no_kick_with_a_pending_tick(void)
{
    CHECK(kicks_in_all_passes(false, true, true) <= 1);
}

static void kicks_go_on_when_the_count_of_milliseconds_wraps(void)
{
    static const RTS_UI32 times[] = {0x70000000u, 0xE0000000u, 0u - PASSES / 2};
    for (size_t i = 0; i < RTS_COUNT(times); i++) {
        ms = times[i];
        CHECK_EQUAL(kicks_in_all_passes(true, false, true), PASSES);
    }
}

int main(void)
{
    RUN(each_millisecond_kicks);
    RUN(timers_that_stand_still_are_no_kick);
    RUN(a_clock_that_stands_still_is_no_kick);
    RUN(a_clock_that_stands_still_is_no_kick_with_a_pending_tick);
    RUN(kicks_go_on_when_the_count_of_milliseconds_wraps);
    return test_result();
}
