/*
 * test_linux_timer.c - SysTimer: due times, missed ones, and a stop that is synchronous.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The machine may be loaded: nothing here asks for how late a call may be, only for what holds however late it is.
 */
#define _GNU_SOURCE
#include "SysTimer.h"

#include "SysExcept.h"
#include "SysTime.h"
#include "port.h"
#include "rts_config.h"
#include "test.h"

#include <time.h>

enum { MAX_CALLS = 64 };

typedef struct {
    RTS_I64 due_ns;
    RTS_I64 called_ns;
    RTS_UI32 overruns; /* so far */
} CALL;

typedef struct {
    CALL call[MAX_CALLS];
    RTS_HANDLE timer;
    RTS_UI32 count;
    RTS_UI32 sleep_ms; /* how long the callback takes */
    int inside;
} RECORD;

static RECORD record;

static void sleep_ms(RTS_UI32 ms)
{
    struct timespec time = {.tv_sec = ms / 1000, .tv_nsec = (long)(ms % 1000) * 1000000};
    nanosleep(&time, NULL);
}

static void note(void *param, RTS_I64 due_ns)
{
    RECORD *to = param;
    RTS_UI32 count = to->count;
    __atomic_store_n(&to->inside, 1, __ATOMIC_SEQ_CST);
    if (count < MAX_CALLS) {
        to->call[count] = (CALL){due_ns, SysTimeGetNs(), SysTimerGetOverruns(to->timer)};
        __atomic_store_n(&to->count, count + 1, __ATOMIC_SEQ_CST);
    }
    if (to->sleep_ms > 0) {
        sleep_ms(to->sleep_ms);
    }
    __atomic_store_n(&to->inside, 0, __ATOMIC_SEQ_CST);
}

/* Waits for `count` calls, 10 s at most. */
static void wait_for_calls(RTS_UI32 count)
{
    RTS_I64 deadline = SysTimeGetNs() + 10000000000;
    while (__atomic_load_n(&record.count, __ATOMIC_SEQ_CST) < count && SysTimeGetNs() < deadline) {
        sleep_ms(1);
    }
    CHECK(record.count >= count);
}

static RTS_HANDLE create(RTS_UI32 interval_us, RTS_UI32 takes_ms)
{
    RTS_HANDLE timer = RTS_INVALID_HANDLE;
    record = (RECORD){.sleep_ms = takes_ms};
    CHECK_EQUAL(SysTimerCreate(note, &record, interval_us, 5, &timer), ERR_OK);
    record.timer = timer;
    return timer;
}

/* Runs a timer for a number of calls. Returns the time before its start. */
static RTS_I64 run_timer(RTS_UI32 interval_us, RTS_UI32 takes_ms, RTS_UI32 calls)
{
    RTS_HANDLE timer = create(interval_us, takes_ms);
    RTS_I64 start_ns = SysTimeGetNs();
    CHECK_EQUAL(SysTimerStart(timer), ERR_OK);
    wait_for_calls(calls);
    CHECK_EQUAL(SysTimerDelete(timer), ERR_OK);
    return start_ns;
}

/* Due times that were skipped before call `i`. */
static RTS_UI32 missed_before(RTS_UI32 i)
{
    return record.call[i].overruns - record.call[i - 1].overruns;
}

static void check_due_times(RTS_I64 interval_ns)
{
    for (RTS_UI32 i = 0; i < record.count; i++) {
        CHECK(record.call[i].called_ns >= record.call[i].due_ns);
        if (i > 0) {
            RTS_I64 step = record.call[i].due_ns - record.call[i - 1].due_ns;
            CHECK_EQUAL(step, (RTS_I64)(missed_before(i) + 1) * interval_ns);
        }
    }
}

static void calls_come_at_the_start_and_at_multiples_of_the_interval(void)
{
    RTS_I64 start_ns = run_timer(3000, 0, 20);
    CHECK_EQUAL(record.call[0].overruns, 0);
    CHECK(record.call[0].due_ns >= start_ns && record.call[0].due_ns <= record.call[0].called_ns);
    check_due_times(3000000);
}

static void due_times_that_pass_during_a_call_are_skipped_and_counted(void)
{
    (void)run_timer(2000, 7, 8);
    check_due_times(2000000);
    for (RTS_UI32 i = 1; i < record.count; i++) {
        CHECK(missed_before(i) >= 3);
        CHECK(record.call[i].due_ns > record.call[i - 1].called_ns);
    }
}

static void stop_waits_for_the_callback_and_none_comes_after(void)
{
    RTS_HANDLE timer = create(1000, 30);
    CHECK_EQUAL(SysTimerStart(timer), ERR_OK);
    wait_for_calls(1);
    CHECK_EQUAL(SysTimerStop(timer), ERR_OK);
    CHECK_EQUAL(__atomic_load_n(&record.inside, __ATOMIC_SEQ_CST), 0);
    RTS_UI32 count = record.count;
    sleep_ms(20);
    CHECK_EQUAL(record.count, count);
    CHECK_EQUAL(SysTimerStop(timer), ERR_OK);
    CHECK_EQUAL(SysTimerDelete(timer), ERR_OK);
}

static void stop_does_not_wait_for_the_next_due_time(void)
{
    RTS_HANDLE timer = create(60000000, 0);
    RTS_I64 start_ns = SysTimeGetNs();
    CHECK_EQUAL(SysTimerStart(timer), ERR_OK);
    wait_for_calls(1);
    CHECK_EQUAL(SysTimerDelete(timer), ERR_OK);
    CHECK(SysTimeGetNs() - start_ns < 30000000000);
    CHECK_EQUAL(record.count, 1);
}

static void a_timer_starts_again_after_a_stop(void)
{
    RTS_HANDLE timer = create(2000, 0);
    for (int i = 0; i < 3; i++) {
        record.count = 0;
        RTS_I64 start_ns = SysTimeGetNs();
        CHECK_EQUAL(SysTimerStart(timer), ERR_OK);
        CHECK_EQUAL(SysTimerStart(timer), ERR_INVALID_STATE);
        wait_for_calls(2);
        CHECK_EQUAL(SysTimerStop(timer), ERR_OK);
        CHECK(record.call[0].due_ns >= start_ns);
    }
    CHECK_EQUAL(SysTimerDelete(timer), ERR_OK);
}

static void there_is_a_timer_for_every_task_and_then_no_more(void)
{
    RTS_HANDLE timers[2 * APP_MAX_TASKS];
    RTS_UI32 count = 0;
    while (count < RTS_COUNT(timers) && SysTimerCreate(note, &record, 1000, 0, &timers[count]) == ERR_OK) {
        count++;
    }
    CHECK(count >= APP_MAX_TASKS);
    CHECK(count < RTS_COUNT(timers));
    CHECK_EQUAL(SysTimerCreate(note, &record, 1000, 0, &timers[count]), ERR_NOMEMORY);
    while (count > 0) {
        CHECK_EQUAL(SysTimerDelete(timers[--count]), ERR_OK);
    }
}

static void without_an_interval_each_trigger_is_one_call(void)
{
    RTS_HANDLE timer = create(0, 0);
    SysTimerTrigger(timer, 0); /* not started: nothing happens */
    CHECK_EQUAL(SysTimerStart(timer), ERR_OK);
    for (RTS_UI32 i = 1; i <= 20; i++) { /* the first comes by itself */
        wait_for_calls(i);
        CHECK_EQUAL(record.count, i);
        SysTimerTrigger(timer, 0);
    }
    wait_for_calls(21);
    CHECK_EQUAL(SysTimerGetOverruns(timer), 0);
    CHECK_EQUAL(SysTimerDelete(timer), ERR_OK);
    SysTimerTrigger(timer, 0);
}

static void a_trigger_may_be_for_later_and_the_earliest_counts(void)
{
    RTS_HANDLE timer = create(0, 0);
    RTS_I64 start_ns = SysTimeGetNs();
    CHECK_EQUAL(SysTimerStart(timer), ERR_OK);
    wait_for_calls(1);
    SysTimerTrigger(timer, start_ns + 3600000000000);
    SysTimerTrigger(timer, start_ns + 30000000);
    SysTimerTrigger(timer, start_ns + 60000000000);
    wait_for_calls(2);
    CHECK(record.call[1].called_ns >= start_ns + 30000000);
    SysTimerTrigger(timer, start_ns + 3600000000000);
    CHECK_EQUAL(SysTimerDelete(timer), ERR_OK);
    CHECK_EQUAL(record.count, 2);
}

static void a_trigger_while_the_callback_runs_has_it_run_again(void)
{
    RTS_HANDLE timer = create(0, 30);
    CHECK_EQUAL(SysTimerStart(timer), ERR_OK);
    wait_for_calls(1);
    while (__atomic_load_n(&record.count, __ATOMIC_SEQ_CST) < 2) {
        SysTimerTrigger(timer, 0);
        sleep_ms(1);
    }
    CHECK_EQUAL(SysTimerDelete(timer), ERR_OK);
    CHECK(record.count <= 3);
}

static void wrong_arguments_are_refused(void)
{
    RTS_HANDLE timer = 7;
    CHECK(SysTimerCreate(NULL, &record, 1000, 0, &timer) == ERR_PARAMETER);
    CHECK_EQUAL(SysTimerCreate(note, &record, 1000, 32, &timer), ERR_PARAMETER);
    CHECK_EQUAL(SysTimerStart(RTS_INVALID_HANDLE), ERR_INVALID_HANDLE);
    CHECK_EQUAL(SysTimerStop(3), ERR_INVALID_HANDLE);
    CHECK_EQUAL(SysTimerDelete(3), ERR_INVALID_HANDLE);
}

static int (*volatile descend_again)(volatile char *above);

static int descend(volatile char *above)
{
    volatile char frame[1024];
    frame[0] = above[0];
    return descend_again(frame) + frame[0];
}

static void overflow(void *arg)
{
    volatile char start = 1;
    descend_again = descend;
    *(volatile int *)arg = descend(&start);
}

/* One frame, whose first access is far below the stack. */
static void overflow_at_once(void *arg)
{
    volatile char frame[12 * 1024 * 1024];
    frame[0] = *(char *)arg;
    *(char *)arg = frame[0];
}

static void overflow_in_callback(void *param, RTS_I64 due_ns)
{
    int result = 0;
    RTS_EXCEPTION exception;
    RTS_UNUSED(due_ns);
    (void)SysExceptTry(overflow, &result, &exception);
    CHECK_EQUAL(exception.code, RTSEXCPT_STACK_OVERFLOW);
    (void)SysExceptTry(overflow_at_once, &result, &exception);
    CHECK_EQUAL(exception.code, RTSEXCPT_STACK_OVERFLOW);
    __atomic_fetch_add(&((RECORD *)param)->count, 1, __ATOMIC_SEQ_CST);
}

static void a_stack_overflow_in_a_task_is_caught(void)
{
    RTS_HANDLE timer;
    record = (RECORD){.count = 0};
    CHECK_EQUAL(SysTimerCreate(overflow_in_callback, &record, 1000, 1, &timer), ERR_OK);
    CHECK_EQUAL(SysTimerStart(timer), ERR_OK);
    wait_for_calls(3);
    CHECK_EQUAL(SysTimerDelete(timer), ERR_OK);
}

static void time_begins_at_zero_and_goes_on(void)
{
    RTS_I64 before = SysTimeGetNs();
    CHECK(before >= 0 && before < 1000000000000);
    CHECK(SysTimeGetNs() >= before);
    CHECK(SysTimeGetMs() - (RTS_UI32)(before / 1000000) < 10000);
}

int main(void)
{
    CHECK_EQUAL(SysTime_Hook(CH_INIT_SYSTEM), ERR_OK);
    CHECK_EQUAL(SysTimer_Hook(CH_INIT_SYSTEM), ERR_OK);
    RUN(time_begins_at_zero_and_goes_on);
    RUN(calls_come_at_the_start_and_at_multiples_of_the_interval);
    RUN(due_times_that_pass_during_a_call_are_skipped_and_counted);
    RUN(stop_waits_for_the_callback_and_none_comes_after);
    RUN(stop_does_not_wait_for_the_next_due_time);
    RUN(a_timer_starts_again_after_a_stop);
    RUN(there_is_a_timer_for_every_task_and_then_no_more);
    RUN(without_an_interval_each_trigger_is_one_call);
    RUN(a_trigger_may_be_for_later_and_the_earliest_counts);
    RUN(a_trigger_while_the_callback_runs_has_it_run_again);
    RUN(wrong_arguments_are_refused);
    RUN(a_stack_overflow_in_a_task_is_caught);
    CHECK_EQUAL(SysTimer_Hook(CH_EXIT_SYSTEM), ERR_OK);
    return test_result();
}
