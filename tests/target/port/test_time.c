/*
 * test_time.c - the clock and the timers of the port.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "SysLock.h"
#include "SysTime.h"
#include "SysTimer.h"
#include "check.h"
#include "reference_clock.h"

static void wait_ms(RTS_UI32 ms)
{
    RTS_UI32 start = SysTimeGetMs();
    while (SysTimeGetMs() - start < ms)
        ;
}

/* The same, quickly: QEMU skips sleep. It does not sleep while an interrupt waits that is locked out; then each look at
 * the clock costs it more than thousands of instructions. */
static void sleep_ms(RTS_UI32 ms)
{
    RTS_UI32 start = SysTimeGetMs();
    while (SysTimeGetMs() - start < ms) {
        CpuSleep();
        for (int i = 0; i < 2000; i++)
            __asm__ volatile("");
    }
}

static void clock_never_goes_back(void)
{
    RTS_I64 last = SysTimeGetNs();
    RTS_I64 end = last + 5000000;
    int back = 0;
    while (last < end) {
        RTS_I64 now = SysTimeGetNs();
        back += now < last;
        last = now;
    }
    CHECK_EQUAL(back, 0);
}

static void clock_never_goes_back_with_interrupts_masked(void)
{
    for (int round = 0; round < 20; round++) {
        RTS_UI32 mask = CpuMask();
        RTS_I64 start = SysTimeGetNs(), last = start;
        int back = 0;
        while (last < start + 900000) { /* crosses one tick in most rounds */
            RTS_I64 now = SysTimeGetNs();
            back += now < last;
            last = now;
        }
        CpuRestore(mask);
        back += SysTimeGetNs() < last;
        CHECK_EQUAL(back, 0);
    }
}

static void clock_keeps_the_rate_of_another_one(void)
{
    ReferenceStart();
    RTS_UI32 reference = ReferenceNs();
    RTS_I64 start = SysTimeGetNs();
    wait_ms(20);
    RTS_I64 difference = (RTS_I64)(ReferenceNs() - reference) - (SysTimeGetNs() - start);
    CHECK(difference > -10000 && difference < 10000);
}

static void milliseconds_follow_nanoseconds(void)
{
    RTS_UI32 before = (RTS_UI32)(SysTimeGetNs() / 1000000);
    RTS_UI32 ms = SysTimeGetMs();
    RTS_UI32 after = (RTS_UI32)(SysTimeGetNs() / 1000000);
    CHECK(before <= ms && ms <= after);
}

/* ---- timers ---- */

static struct {
    volatile RTS_UI32 calls;
    RTS_I64 first_due, last_due, latest;
    volatile RTS_UI32 work_ms; /* the callback takes that long, once */
    volatile RTS_UI32 others;  /* calls of the other timer while this one ran */
} slow, fast;

static void on_fast(void *param, RTS_I64 due)
{
    RTS_I64 late = SysTimeGetNs() - due;
    CHECK_EQUAL(param == &fast, 1);
    if (fast.calls++ == 0)
        fast.first_due = due;
    fast.last_due = due;
    if (late > fast.latest)
        fast.latest = late;
    CHECK(late >= 0);
}

static void on_slow(void *param, RTS_I64 due)
{
    RTS_UNUSED(param);
    if (slow.calls++ == 0)
        slow.first_due = due;
    slow.last_due = due;
    if (slow.work_ms) {
        RTS_UI32 before = fast.calls;
        wait_ms(slow.work_ms);
        slow.others = fast.calls - before;
        slow.work_ms = 0;
    }
}

static void reset_counters(void)
{
    slow.calls = slow.work_ms = slow.others = 0;
    fast.calls = 0;
    fast.latest = 0;
}

static void timer_calls_every_interval_without_drift(void)
{
    RTS_HANDLE timer;
    reset_counters();
    CHECK_EQUAL(SysTimerCreate(on_fast, &fast, 500, 3, &timer), ERR_OK);
    RTS_I64 start = SysTimeGetNs();
    CHECK_EQUAL(SysTimerStart(timer), ERR_OK);
    while (fast.calls < 40)
        CHECK(SysTimeGetNs() - start < 25000000);
    CHECK_EQUAL(SysTimerGetOverruns(timer), 0);
    CHECK_EQUAL(SysTimerDelete(timer), ERR_OK);
    CHECK_EQUAL(fast.last_due - fast.first_due, 39 * 500000);
    CHECK(fast.first_due - start < 10000); /* the first call is due at once */
    CHECK(fast.latest < 20000);
}

static void fast_timer_interrupts_slow_one(void)
{
    RTS_HANDLE low, high;
    reset_counters();
    CHECK_EQUAL(SysTimerCreate(on_slow, NULL, 10000, 20, &low), ERR_OK);
    CHECK_EQUAL(SysTimerCreate(on_fast, &fast, 1000, 1, &high), ERR_OK);
    slow.work_ms = 5;
    SysTimerStart(high);
    SysTimerStart(low);
    while (slow.calls < 2)
        ;
    CHECK_EQUAL(SysTimerGetOverruns(high), 0);
    SysTimerDelete(low);
    SysTimerDelete(high);
    CHECK(slow.others >= 4 && slow.others <= 6);
    CHECK(fast.latest < 20000);
}

static void slow_timer_waits_for_fast_one(void)
{
    RTS_HANDLE low, high;
    reset_counters();
    CHECK_EQUAL(SysTimerCreate(on_fast, &fast, 1000, 20, &low), ERR_OK);
    CHECK_EQUAL(SysTimerCreate(on_slow, NULL, 10000, 1, &high), ERR_OK);
    slow.work_ms = 5;
    SysTimerStart(low);
    SysTimerStart(high);
    while (slow.calls < 2)
        ;
    RTS_UI32 overruns = SysTimerGetOverruns(low);
    SysTimerDelete(low);
    SysTimerDelete(high);
    CHECK_EQUAL(slow.others, 0);
    CHECK(overruns >= 3 && overruns <= 5);
}

static void overrun_skips_due_times_and_counts_them(void)
{
    RTS_HANDLE timer;
    reset_counters();
    CHECK_EQUAL(SysTimerCreate(on_slow, NULL, 2000, 5, &timer), ERR_OK);
    slow.work_ms = 5;
    SysTimerStart(timer);
    while (slow.calls < 2)
        ;
    CHECK_EQUAL(SysTimerGetOverruns(timer), 2);
    SysTimerDelete(timer);
    CHECK_EQUAL(SysTimerGetOverruns(timer), 0);
    CHECK_EQUAL(slow.last_due - slow.first_due, 3 * 2000000);
}

static void stopped_timer_is_silent(void)
{
    RTS_HANDLE timer;
    reset_counters();
    CHECK_EQUAL(SysTimerCreate(on_fast, &fast, 500, 5, &timer), ERR_OK);
    SysTimerStart(timer);
    wait_ms(3);
    SysTimerStop(timer);
    RTS_UI32 calls = fast.calls;
    wait_ms(3);
    CHECK(calls >= 4);
    CHECK_EQUAL(fast.calls, calls);
    SysTimerDelete(timer);
    CHECK_EQUAL(SysTimerStart(timer), ERR_INVALID_HANDLE);
}

/* Puts the alarm off for seconds. One that was on its way puts itself back. */
static void silence_alarm(void)
{
    RTS_UI32 calls;
    do {
        calls = fast.calls;
        BoardAlarmSet(4000000000u);
        wait_ms(2);
    } while (fast.calls != calls);
}

/* The board's alarm is silent, or the tasks are locked out: the call does not come. */
static void call_that_does_not_come_is_noticed(void)
{
    RTS_HANDLE timer;
    CHECK_EQUAL(SysTimerCreate(on_fast, &fast, 500, 5, &timer), ERR_OK);
    CHECK_EQUAL(SysTimersWork(), 1); /* a stopped timer is not waited for */
    SysTimerStart(timer);
    wait_ms(3);
    CHECK_EQUAL(SysTimersWork(), 1);
    silence_alarm();
    sleep_ms(980);
    CHECK_EQUAL(SysTimersWork(), 1);
    sleep_ms(20);
    CHECK_EQUAL(SysTimersWork(), 0);
    BoardAlarmSet(0);
    while (SysTimeGetNs() - fast.last_due > 1000000)
        ;
    CHECK_EQUAL(SysTimersWork(), 1);
    RTS_UI32 lock = SysLockEnter();
    sleep_ms(1010);
    CHECK_EQUAL(SysTimersWork(), 0);
    SysTimerDelete(timer);
    CHECK_EQUAL(SysTimersWork(), 1);
    SysLockLeave(lock);
}

static void timer_without_interval_calls_when_it_is_triggered(void)
{
    RTS_HANDLE timer;
    reset_counters();
    CHECK_EQUAL(SysTimerCreate(on_fast, &fast, 0, 5, &timer), ERR_OK);
    SysTimerTrigger(timer, 0);
    SysTimerTrigger(99, 0);
    CHECK_EQUAL(fast.calls, 0);
    SysTimerStart(timer);
    wait_ms(3);
    CHECK_EQUAL(fast.calls, 1); /* the first comes by itself */
    for (RTS_UI32 i = 2; i < 10; i++) {
        SysTimerTrigger(timer, 0);
        CpuBarrier();
        CHECK_EQUAL(fast.calls, i);
    }
    CHECK_EQUAL(SysTimersWork(), 1);
    SysTimerStop(timer);
    SysTimerTrigger(timer, 0);
    CpuBarrier();
    CHECK_EQUAL(fast.calls, 9);
    SysTimerDelete(timer);
}

static RTS_HANDLE triggered;

/* Triggers itself once more, and a timer of better priority. */
static void on_trigger(void *param, RTS_I64 due)
{
    RTS_UNUSED(due);
    if (slow.calls++ == 1) { /* the call after the first, which comes by itself */
        RTS_UI32 before = fast.calls;
        SysTimerTrigger(*(RTS_HANDLE *)param, 0);
        SysTimerTrigger(triggered, 0);
        CpuBarrier();
        slow.others = fast.calls - before;
    }
}

static void triggered_timer_interrupts_one_below_and_comes_again_after_itself(void)
{
    RTS_HANDLE low;
    reset_counters();
    CHECK_EQUAL(SysTimerCreate(on_trigger, &low, 0, 20, &low), ERR_OK);
    CHECK_EQUAL(SysTimerCreate(on_fast, &fast, 0, 1, &triggered), ERR_OK);
    SysTimerStart(low);
    SysTimerStart(triggered);
    wait_ms(3);
    SysTimerTrigger(low, 0);
    CpuBarrier();
    CHECK_EQUAL(slow.calls, 3);
    CHECK_EQUAL(slow.others, 1);
    CHECK_EQUAL(fast.calls, 2);
    SysTimerDelete(low);
    SysTimerDelete(triggered);
}

static void all_timers_and_no_more_can_be_created(void)
{
    RTS_HANDLE timers[SYSTIMER_COUNT], one_more;
    for (int i = 0; i < SYSTIMER_COUNT; i++)
        CHECK_EQUAL(SysTimerCreate(on_fast, &fast, 1000, 5, &timers[i]), ERR_OK);
    CHECK_EQUAL(SysTimerCreate(on_fast, &fast, 1000, 5, &one_more), ERR_NOMEMORY);
    for (int i = 0; i < SYSTIMER_COUNT; i++)
        CHECK_EQUAL(SysTimerDelete(timers[i]), ERR_OK);
}

static void bad_timer_parameters_are_refused(void)
{
    RTS_HANDLE timer;
    CHECK_EQUAL(SysTimerCreate(NULL, NULL, 1000, 5, &timer), ERR_PARAMETER);
    CHECK_EQUAL(SysTimerCreate(on_fast, NULL, 1000, 32, &timer), ERR_PARAMETER);
    CHECK_EQUAL(SysTimerStop(99), ERR_INVALID_HANDLE);
}

int main(void)
{
    TEST_BEGIN();
    TEST_RUN(clock_never_goes_back);
    TEST_RUN(clock_never_goes_back_with_interrupts_masked);
    TEST_RUN(clock_keeps_the_rate_of_another_one);
    TEST_RUN(milliseconds_follow_nanoseconds);
    TEST_RUN(timer_calls_every_interval_without_drift);
    TEST_RUN(fast_timer_interrupts_slow_one);
    TEST_RUN(slow_timer_waits_for_fast_one);
    TEST_RUN(overrun_skips_due_times_and_counts_them);
    TEST_RUN(stopped_timer_is_silent);
    TEST_RUN(call_that_does_not_come_is_noticed);
    TEST_RUN(timer_without_interval_calls_when_it_is_triggered);
    TEST_RUN(triggered_timer_interrupts_one_below_and_comes_again_after_itself);
    TEST_RUN(all_timers_and_no_more_can_be_created);
    TEST_RUN(bad_timer_parameters_are_refused);
    TEST_END();
}
