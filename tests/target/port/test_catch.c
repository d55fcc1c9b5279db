/*
 * test_catch.c - rts_try of components: in main, in the interrupt of a task, through a gate, and what it leaves as it is.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "SysExcept.h"
#include "SysExceptCatch.h"
#include "SysTime.h"
#include "SysTimer.h"
#include "check.h"

typedef struct {
    volatile RTS_I32 result, step;
} VARIABLES;
typedef struct {
    VARIABLES all;
} APP_AREAS_ALIGNED(sizeof(VARIABLES)) PLACED;
static PLACED areas APP_AREAS_SECTION;

static volatile RTS_UI32 zero;
static volatile RTS_UI32 sink;

/* ---- ways to fail ---- */

/* What is in registers there must not matter after it. */
static void __attribute__((noinline)) fail(void)
{
    sink = REG32(NOWHERE);
}

static void __attribute__((noinline)) raise(void)
{
    SysExceptRaise(RTSEXCPT_ARRAYBOUNDS, 0x1234, NULL);
}

static void __attribute__((noinline)) recurse(volatile RTS_UI32 *above)
{
    volatile RTS_UI32 here[4] = {above[0] + 1, 0, 0, 0};
    if (!zero)
        recurse(here);
    sink = here[0];
}

static void __attribute__((noinline)) overflow(void)
{
    volatile RTS_UI32 start[4] = {0, 0, 0, 0};
    recurse(start);
}

/* The code that is caught of `failing`; 0: none. Keeps many registers over it. */
static RTS_UI32 __attribute__((noinline)) code_of(void (*failing)(void))
{
    volatile RTS_UI32 code = 0, finals = 0;
    RTS_UI32 kept[8];
    for (RTS_UI32 i = 0; i < RTS_COUNT(kept); i++)
        kept[i] = zero + i * 3;
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
    rts_try_end for (RTS_UI32 i = 0; i < RTS_COUNT(kept); i++) CHECK_EQUAL(kept[i], i * 3);
    CHECK_EQUAL(finals, 1);
    return code;
}

static void nothing(void)
{
}

/* ---- in main ---- */

static void main_catches_a_fault(void)
{
    CHECK_EQUAL(code_of(nothing), 0);
    CHECK_EQUAL(code_of(fail), RTSEXCPT_ACCESS_VIOLATION);
    CHECK_EQUAL(code_of(raise), RTSEXCPT_ARRAYBOUNDS);
}

static void main_catches_a_thousand(void)
{
    for (RTS_UI32 i = 0; i < 1000; i++)
        CHECK_EQUAL(code_of(fail), RTSEXCPT_ACCESS_VIOLATION);
}

static void main_catches_the_end_of_its_stack(void)
{
    for (RTS_UI32 i = 0; i < 3; i++)
        CHECK(code_of(overflow) != 0);
    CHECK_EQUAL(code_of(fail), RTSEXCPT_ACCESS_VIOLATION);
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
    rts_try_end CHECK((place & ~(uintptr_t)1) - ((uintptr_t)fail & ~(uintptr_t)1) < 32);
}

static void rts_try_nests(void)
{
    volatile RTS_UI32 inner = 0, outer = 0;
    rts_try{rts_try{fail();
}
rts_catch
{
    inner = EXCPT_GET_CODE();
    raise();
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

static RTS_UI32 __attribute__((noinline)) return_out_of_it(void)
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

static void block_may_be_left_by_return(void)
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

/* ---- a Try within ---- */

static void fail_in_a_try(void *arg)
{
    RTS_UNUSED(arg);
    fail();
}

static void exception_of_guarded_code_stays_its_own(void)
{
    RTS_EXCEPTION exception = {0, 0};
    volatile RTS_UI32 caught = 0;
    volatile bool ended = true;
    rts_try
    {
        ended = SysExceptTry(fail_in_a_try, NULL, &exception);
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

#define IMPORT(function) \
    APP_GATE(function);  \
    static __typeof__(function) *const volatile imported_##function = (__typeof__(function) *)APP_GATED(function)

static RTS_I32 catch_own_fault(void)
{
    sink++; /* with the rights of the runtime */
    return (RTS_I32)code_of(fail);
}
IMPORT(catch_own_fault);

static RTS_I32 catch_a_raise(void)
{
    return (RTS_I32)code_of(raise);
}
IMPORT(catch_a_raise);

static void call_them(void *arg)
{
    VARIABLES *all = (VARIABLES *)arg;
    all->result = imported_catch_own_fault();
    all->step = imported_catch_a_raise();
}

static void function_of_a_program_catches_its_fault(void)
{
    RTS_EXCEPTION exception;
    for (RTS_UI32 i = 0; i < 100; i++) {
        areas.all.result = areas.all.step = 0;
        CHECK_EQUAL(SysExceptTry(call_them, &areas, &exception), true);
        CHECK_EQUAL(areas.all.result, RTSEXCPT_ACCESS_VIOLATION);
        CHECK_EQUAL(areas.all.step, RTSEXCPT_ARRAYBOUNDS);
    }
}

static void fail_after_them(void *arg)
{
    call_them(arg);
    fail();
}

static void failure_of_the_program_after_it_leaves_the_try(void)
{
    RTS_EXCEPTION exception;
    CHECK_EQUAL(SysExceptTry(fail_after_them, &areas, &exception), false);
    CHECK_EQUAL(exception.code, RTSEXCPT_ACCESS_VIOLATION);
    CHECK_EQUAL(code_of(fail), RTSEXCPT_ACCESS_VIOLATION);
}

/* Without a gate there is no right to write the list. */
static void register_without_a_gate(void *arg)
{
    RTS_TRY own;
    if (RTS_SETJMP(own.buffer) == 0)
        ((VARIABLES *)arg)->result = (RTS_I32)SysExceptRegisterJmpBuf(&own);
}

static void function_without_a_gate_is_refused(void)
{
    RTS_EXCEPTION exception;
    CHECK_EQUAL(SysExceptTry(register_without_a_gate, &areas, &exception), true);
    CHECK_EQUAL(areas.all.result, ERR_OPERATION_DENIED);
}

/* A watchdog is stronger than rts_try. */
static RTS_I32 loop_and_catch(void)
{
    volatile RTS_I32 caught = 0;
    rts_try
    {
        for (;;)
            sink++;
    }
    rts_catch
    {
        caught = 1;
    }
    rts_try_end return caught;
}
IMPORT(loop_and_catch);

static void loop(void *arg)
{
    ((VARIABLES *)arg)->step = imported_loop_and_catch();
}

/* ---- in a task ---- */

static volatile RTS_UI32 cycles, caught_in_task, broken;

/* Outside of a Try, as the phases of a cycle are. */
static void cycle_that_catches(void *param, RTS_I64 due)
{
    RTS_UNUSED(param);
    RTS_UNUSED(due);
    cycles++;
    caught_in_task += code_of(fail) == RTSEXCPT_ACCESS_VIOLATION;
}

static void break_it(void *param, RTS_I64 due)
{
    RTS_UNUSED(param);
    RTS_UNUSED(due);
    if (++broken > 5)
        SysExceptBreak(&areas, RTSEXCPT_WATCHDOG);
}

static RTS_HANDLE start(SYS_TIMER_CALLBACK callback, RTS_UI32 us, RTS_UI32 priority)
{
    RTS_HANDLE timer;
    CHECK_EQUAL(SysTimerCreate(callback, NULL, us, priority, &timer), ERR_OK);
    SysTimerStart(timer);
    return timer;
}

static void task_catches_while_main_does(void)
{
    cycles = caught_in_task = 0;
    RTS_HANDLE timer = start(cycle_that_catches, 1000, 3);
    RTS_UI32 from = SysTimeGetMs(), failures = 0;
    while (SysTimeGetMs() - from < 50)
        failures += code_of(fail) != RTSEXCPT_ACCESS_VIOLATION;
    SysTimerDelete(timer);
    CHECK_EQUAL(failures, 0);
    CHECK(cycles > 10);
    CHECK_EQUAL(caught_in_task, cycles);
}

static void watchdog_is_not_caught(void)
{
    RTS_EXCEPTION exception;
    broken = 0;
    areas.all.step = -1;
    RTS_HANDLE timer = start(break_it, 1000, 1);
    CHECK_EQUAL(SysExceptTry(loop, &areas, &exception), false);
    SysTimerDelete(timer);
    CHECK_EQUAL(exception.code, RTSEXCPT_WATCHDOG);
    CHECK_EQUAL(areas.all.step, -1);
    CHECK_EQUAL(code_of(fail), RTSEXCPT_ACCESS_VIOLATION);
    function_of_a_program_catches_its_fault();
}

#ifdef __ARM_FP
static volatile float factor = 1.5f;

static void registers_of_the_fpu_are_kept(void)
{
    volatile float sum = 0;
    for (RTS_UI32 i = 0; i < 100; i++) {
        float kept = factor * (float)i;
        sum += kept;
        CHECK_EQUAL(code_of(fail), RTSEXCPT_ACCESS_VIOLATION);
        CHECK(kept == factor * (float)i);
    }
    CHECK(sum == 1.5f * 4950);
}
#else
#define registers_of_the_fpu_are_kept nothing
#endif

int main(void)
{
    TEST_BEGIN();
    TEST_RUN(main_catches_a_fault);
    TEST_RUN(main_catches_a_thousand);
    TEST_RUN(main_catches_the_end_of_its_stack);
    TEST_RUN(catch_knows_the_place);
    TEST_RUN(rts_try_nests);
    TEST_RUN(block_may_be_left_by_return);
    TEST_RUN(exception_of_guarded_code_stays_its_own);
    TEST_RUN(function_of_a_program_catches_its_fault);
    TEST_RUN(failure_of_the_program_after_it_leaves_the_try);
    TEST_RUN(function_without_a_gate_is_refused);
    TEST_RUN(task_catches_while_main_does);
    TEST_RUN(watchdog_is_not_caught);
    TEST_RUN(registers_of_the_fpu_are_kept);
    TEST_END();
}
