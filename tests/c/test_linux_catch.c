/*
 * test_linux_catch.c - rts_try of components on Linux: in main, in threads, in functions that a program calls.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "../../firmware/port/linux/IecStack.h"
#include "SysExcept.h"
#include "SysExceptCatch.h"
#include "test.h"

#include <pthread.h>
#include <signal.h>

static int *volatile null_pointer;
static volatile int sink;

static void fail(void) __attribute__((no_sanitize("undefined"), noinline));

static void fail(void)
{
    sink = *null_pointer;
}

static void raise_bounds(void)
{
    SysExceptRaise(RTSEXCPT_ARRAYBOUNDS, 0x1234, NULL);
}

static void trap(void)
{
    __builtin_trap();
}

static void nothing(void)
{
}

static volatile int finals;

/* The code that is caught of `failing`; 0: none. */
static RTS_UI32 code_of(void (*failing)(void))
{
    volatile RTS_UI32 code = 0;
    rts_try
    {
        failing();
    }
    rts_catch
    {
        code = EXCPT_GET_CODE();
    }
    rts_finally
    {
        finals++;
    }
    rts_try_end return code;
}

static void main_catches_faults_and_raises(void)
{
    finals = 0;
    CHECK_EQUAL(code_of(nothing), 0);
    CHECK_EQUAL(code_of(fail), RTSEXCPT_ACCESS_VIOLATION);
    CHECK_EQUAL(code_of(trap), RTSEXCPT_ILLEGAL_INSTRUCTION);
    CHECK_EQUAL(code_of(raise_bounds), RTSEXCPT_ARRAYBOUNDS);
    CHECK_EQUAL(finals, 4);
}

static void a_thousand_in_a_row_are_caught(void)
{
    for (int i = 0; i < 1000; i++) {
        CHECK_EQUAL(code_of(fail), RTSEXCPT_ACCESS_VIOLATION);
    }
}

static void catch_knows_the_place(void)
{
    volatile uintptr_t place = 0;
    rts_try
    {
        fail();
    }
    rts_catch
    {
        place = EXCPT_GET_CONTEXT()->IP;
    }
    rts_try_end CHECK(place - (uintptr_t)fail < 128);
}

static void rts_try_nests(void)
{
    volatile RTS_UI32 inner = 0, outer = 0;
    rts_try{rts_try{fail();
}
rts_catch
{
    inner = EXCPT_GET_CODE();
    raise_bounds();
}
rts_try_end
}
rts_catch
{
    outer = EXCPT_GET_CODE();
}
rts_try_end CHECK_EQUAL(inner, RTSEXCPT_ACCESS_VIOLATION);
CHECK_EQUAL(outer, RTSEXCPT_ARRAYBOUNDS);
}

static int return_out_of_it(void)
{
    rts_try
    {
        return 5;
    }
    rts_catch
    {
        return 6;
    }
    rts_try_end
}

static void a_block_may_be_left_by_return(void)
{
    volatile RTS_UI32 code = 0;
    rts_try
    {
        CHECK_EQUAL(return_out_of_it(), 5);
        fail();
    }
    rts_catch
    {
        code = EXCPT_GET_CODE();
    }
    rts_try_end CHECK_EQUAL(code, RTSEXCPT_ACCESS_VIOLATION);
}

/* ---- in functions that a program calls ---- */

static void fail_in_a_program(void *arg)
{
    RTS_UNUSED(arg);
    fail();
}

static void an_exception_of_the_program_is_not_caught_outside(void)
{
    RTS_EXCEPTION exception = {0, 0};
    volatile bool ended = true;
    volatile RTS_UI32 caught = 0;
    rts_try
    {
        ended = SysExceptTry(fail_in_a_program, NULL, &exception);
        fail();
    }
    rts_catch
    {
        caught = EXCPT_GET_CODE();
    }
    rts_try_end CHECK_EQUAL(ended, false);
    CHECK_EQUAL(exception.code, RTSEXCPT_ACCESS_VIOLATION);
    CHECK_EQUAL(caught, RTSEXCPT_ACCESS_VIOLATION);
}

static void catch_in_a_program(void *arg)
{
    RTS_UI32 *codes = arg;
    codes[0] = code_of(fail);
    codes[1] = code_of(raise_bounds);
}

static void a_function_of_a_program_catches_its_fault(void)
{
    RTS_EXCEPTION exception;
    for (int i = 0; i < 100; i++) {
        RTS_UI32 codes[2] = {0, 0};
        CHECK(SysExceptTry(catch_in_a_program, codes, &exception));
        CHECK_EQUAL(codes[0], RTSEXCPT_ACCESS_VIOLATION);
        CHECK_EQUAL(codes[1], RTSEXCPT_ARRAYBOUNDS);
    }
}

static void call_outside(void *arg)
{
    (void)IecStackCallOutside(IecStackOfThread, catch_in_a_program, arg);
}

static void a_call_outside_catches_its_fault(void)
{
    RTS_UI32 codes[2] = {0, 0};
    RTS_EXCEPTION exception;
    CHECK(SysExceptTry(call_outside, codes, &exception));
    CHECK_EQUAL(codes[0], RTSEXCPT_ACCESS_VIOLATION);
    CHECK_EQUAL(codes[1], RTSEXCPT_ARRAYBOUNDS);
}

/* Not the blocks of code that is left: they stay registered when it ends. */
static void fail_around(void *arg)
{
    RTS_TRY own;
    RTS_UNUSED(arg);
    if (RTS_SETJMP(own.buffer) == 0) {
        CHECK_EQUAL(SysExceptRegisterJmpBuf(&own), ERR_OK);
    }
}

static void what_stays_registered_in_a_try_ends_with_it(void)
{
    RTS_EXCEPTION exception;
    CHECK(SysExceptTry(fail_around, NULL, &exception));
    CHECK(!SysExceptTry(fail_in_a_program, NULL, &exception));
    CHECK_EQUAL(code_of(fail), RTSEXCPT_ACCESS_VIOLATION);
}

/* ---- the watchdog, and threads ---- */

static volatile bool caught_the_watchdog;

static void loop_and_catch(void *arg)
{
    RTS_UNUSED(arg);
    rts_try
    {
        for (;;) {
            sink++;
        }
    }
    rts_catch
    {
        caught_the_watchdog = true;
    }
    rts_try_end
}

static volatile bool loop_ended;

static void *break_the_loop(void *arg)
{
    while (!loop_ended) {
        SysExceptBreak(arg, RTSEXCPT_WATCHDOG);
    }
    return NULL;
}

static void a_watchdog_is_not_caught(void)
{
    int arg;
    pthread_t thread;
    RTS_EXCEPTION exception;
    pthread_create(&thread, NULL, break_the_loop, &arg);
    CHECK(!SysExceptTry(loop_and_catch, &arg, &exception));
    loop_ended = true;
    pthread_join(thread, NULL);
    CHECK_EQUAL(exception.code, RTSEXCPT_WATCHDOG);
    CHECK(!caught_the_watchdog);
    CHECK_EQUAL(code_of(fail), RTSEXCPT_ACCESS_VIOLATION);
}

static void *fail_often(void *arg)
{
    RTS_UI32 *caught = arg;
    for (int i = 0; i < 500; i++) {
        *caught += code_of(fail) == RTSEXCPT_ACCESS_VIOLATION;
    }
    return NULL;
}

static void threads_catch_their_own(void)
{
    pthread_t threads[4];
    RTS_UI32 caught[4] = {0};
    for (int i = 0; i < 4; i++) {
        pthread_create(&threads[i], NULL, fail_often, &caught[i]);
    }
    for (int i = 0; i < 4; i++) {
        pthread_join(threads[i], NULL);
        CHECK_EQUAL(caught[i], 500);
    }
}

int main(void)
{
    RUN(main_catches_faults_and_raises);
    RUN(a_thousand_in_a_row_are_caught);
    RUN(catch_knows_the_place);
    RUN(rts_try_nests);
    RUN(a_block_may_be_left_by_return);
    RUN(an_exception_of_the_program_is_not_caught_outside);
    RUN(a_function_of_a_program_catches_its_fault);
    RUN(a_call_outside_catches_its_fault);
    RUN(what_stays_registered_in_a_try_ends_with_it);
    RUN(a_watchdog_is_not_caught);
    RUN(threads_catch_their_own);
    return test_result();
}
