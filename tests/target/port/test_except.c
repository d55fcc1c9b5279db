/*
 * test_except.c - what application code can do wrong, in main and in the interrupt of a timer, and who survives it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "SysExcept.h"
#include "SysFlash.h"
#include "SysTarget.h"
#include "SysTime.h"
#include "SysTimer.h"
#include "check.h"

/* What guarded code may write. */
typedef struct {
    volatile RTS_UI32 sink, argument, bad, wrong_registers;
} VARIABLES;
typedef struct {
    VARIABLES all;
} APP_AREAS_ALIGNED(sizeof(VARIABLES)) PLACED;
static PLACED areas APP_AREAS_SECTION;
#define sink areas.all.sink

static volatile RTS_UI32 zero;

/* ---- ways to fail ---- */

static void read_from_nowhere(void *arg)
{
    RTS_UNUSED(arg);
    sink = REG32(NOWHERE);
}

static void write_to_nowhere(void *arg)
{
    RTS_UNUSED(arg);
    REG32(NOWHERE) = 1;
}

static void read_from_null(void *arg)
{
    RTS_UNUSED(arg);
    sink = REG32((uintptr_t)zero + 4);
}

static void write_to_flash(void *arg)
{
    RTS_UNUSED(arg);
    const RTS_UI8 *mapped = SysFlashGet()->mapped;
    REG32(mapped != NULL ? (uintptr_t)mapped + 64 : NOWHERE) = 1;
}

static void call_nowhere(void *arg)
{
    RTS_UNUSED(arg);
    ((void (*)(void))((NOWHERE | APP_ENTRY_MODE_BIT) + zero))();
    sink = 1; /* not a tail call */
}

static void raise(void *arg)
{
    RTS_UNUSED(arg);
    SysExceptRaise(RTSEXCPT_ARRAYBOUNDS, 0x1235, NULL);
}

static void __attribute__((noinline)) recurse(volatile RTS_UI32 *above)
{
    volatile RTS_UI32 here[4] = {above[0] + 1, 0, 0, 0};
    if (!zero)
        recurse(here);
    sink = here[0];
}

static void overflow_the_stack(void *arg)
{
    RTS_UNUSED(arg);
    volatile RTS_UI32 start[4] = {0, 0, 0, 0};
    recurse(start);
}

/* Needs more than the guard at once. */
static void overflow_the_stack_with_large_frames(void *arg)
{
    volatile RTS_UI8 large[200];
    for (RTS_UI32 i = 0; i < sizeof(large); i++)
        large[i] = 1;
    if (!zero)
        overflow_the_stack_with_large_frames(arg);
    sink = large[zero];
}

/* Lands on the stack below, which is idle, and ends at that one's guard. */
static void overflow_past_the_guard(void *arg)
{
    volatile RTS_UI32 large[(RTS_IEC_STACK_SIZE + 256) / sizeof(RTS_UI32)];
    RTS_UNUSED(arg);
    large[zero] = 0;
    recurse(large);
    sink = large[zero];
}

static void loop_forever(void *arg)
{
    RTS_UNUSED(arg);
    for (;;)
        sink++;
}

static void end_normally(void *arg)
{
    *(volatile RTS_UI32 *)arg = 77;
}

typedef struct {
    void (*function)(void *arg);
    RTS_UI32 code;
} FAILURE;

#include "misdeeds.h" /* of the processor family */

/* The first ones are those whose address is in the function itself. */
static const FAILURE failures[] = {
    NAMED_MISDEEDS,
    {read_from_nowhere, RTSEXCPT_ACCESS_VIOLATION},
    {write_to_nowhere, RTSEXCPT_ACCESS_VIOLATION},
    {read_from_null, RTSEXCPT_ACCESS_VIOLATION},
    {write_to_flash, RTSEXCPT_ACCESS_VIOLATION},
    {call_nowhere, RTSEXCPT_ACCESS_VIOLATION}, /* the last of them */
    {raise, RTSEXCPT_ARRAYBOUNDS},
    {overflow_the_stack, RTSEXCPT_STACK_OVERFLOW},
    {overflow_the_stack_with_large_frames, RTSEXCPT_STACK_OVERFLOW},
    {overflow_past_the_guard, RTSEXCPT_STACK_OVERFLOW},
    OTHER_MISDEEDS,
};

/* An address in a small function: all ours are. */
static int is_within(uintptr_t address, void (*function)(void *arg))
{
    return address - ((uintptr_t)function & ~(uintptr_t)1) < 64;
}

/* ---- in main ---- */

static void normal_end_is_no_exception(void)
{
    RTS_EXCEPTION exception;
    CHECK_EQUAL(SysExceptTry(end_normally, (void *)&areas.all.argument, &exception), true);
    CHECK_EQUAL(exception.code, RTSEXCPT_NOEXCEPTION);
    CHECK_EQUAL(areas.all.argument, 77);
}

static void raised_exception_brings_code_and_address_without_thumb_bit(void)
{
    RTS_EXCEPTION exception;
    CHECK_EQUAL(SysExceptTry(raise, NULL, &exception), false);
    CHECK_EQUAL(exception.code, RTSEXCPT_ARRAYBOUNDS);
    CHECK_EQUAL(exception.address, 0x1234);
}

static void every_failure_in_main_is_caught_with_its_code(void)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(failures); i++) {
        RTS_EXCEPTION exception = {0, 0};
        SysExceptForgetTrace(); /* so that the stack of each is read */
        CHECK_EQUAL(SysExceptTry(failures[i].function, NULL, &exception), false);
        CHECK_EQUAL(exception.code, failures[i].code);
    }
}

static void address_names_the_function_that_failed(void)
{
    RTS_EXCEPTION exception;
    RTS_UI32 i = 0;
    do {
        SysExceptTry(failures[i].function, NULL, &exception);
        CHECK(is_within(exception.address, failures[i].function));
    } while (failures[i++].function != call_nowhere);
}

static void address_of_a_stack_overflow_names_a_function_on_the_stack(void)
{
    RTS_EXCEPTION exception;
    SysExceptCodeRange((const RTS_UI8 *)((uintptr_t)recurse & ~(uintptr_t)1), 64);
    SysExceptTry(overflow_the_stack, NULL, &exception);
    CHECK(is_within(exception.address, (void (*)(void *))recurse));
    SysExceptCodeRange(NULL, 0);
}

/* Only the frame of the fault may reach below it, on a stack that is idle. */
static void overflow_stops_at_the_guard(void)
{
    enum { BELOW = FAULT_FRAME + 64 };
    RTS_EXCEPTION exception;
    volatile RTS_UI8 *below = (volatile RTS_UI8 *)(IEC_STACKS + (APP_MAX_TASKS - 1) * RTS_IEC_STACK_SIZE - BELOW);
    for (int i = 0; i < BELOW - FAULT_FRAME; i++)
        below[i] = (RTS_UI8)i;
    SysExceptTry(overflow_the_stack, NULL, &exception);
    for (int i = 0; i < BELOW - FAULT_FRAME; i++)
        CHECK_EQUAL(below[i], i);
}

static void many_failures_cost_no_stack(void)
{
    RTS_EXCEPTION exception;
    RTS_UI32 before = SysTargetGetStack().unused;
    for (RTS_UI32 round = 0; round < 100; round++)
        SysExceptTry(failures[round % RTS_COUNT(failures)].function, NULL, &exception);
    CHECK_EQUAL(SysTargetGetStack().unused, before);
    CHECK(before > 100);
}

/* ---- in the interrupt of a timer ---- */

typedef struct {
    void (*function)(void *arg);
    volatile RTS_UI32 calls, caught, passed;
    volatile RTS_UI8 running; /* in the callback */
    RTS_EXCEPTION exception;
} TASK;

static TASK slow, fast;

static void on_timer(void *param, RTS_I64 due)
{
    TASK *task = param;
    RTS_UNUSED(due);
    task->calls++;
    task->running = 1;
    if (SysExceptTry(task->function, task, &task->exception))
        task->passed++;
    else
        task->caught++;
    task->running = 0;
}

static RTS_HANDLE start(TASK *task, void (*function)(void *arg), RTS_UI32 interval_us, RTS_UI32 priority)
{
    RTS_HANDLE timer;
    *task = (TASK){.function = function};
    CHECK_EQUAL(SysTimerCreate(on_timer, task, interval_us, priority, &timer), ERR_OK);
    SysTimerStart(timer);
    return timer;
}

/* Waits until *counter reaches `count`, at most 100 ms. */
static void wait_for(volatile RTS_UI32 *counter, RTS_UI32 count)
{
    RTS_UI32 from = SysTimeGetMs();
    while (*counter < count && SysTimeGetMs() - from < 100)
        ;
    CHECK(*counter >= count);
}

static void every_failure_in_a_timer_is_caught_with_its_code(void)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(failures); i++) {
        RTS_HANDLE timer = start(&fast, failures[i].function, 1000, 3);
        wait_for(&fast.caught, 3);
        SysTimerDelete(timer);
        CHECK_EQUAL(fast.exception.code, failures[i].code);
        CHECK_EQUAL(fast.passed, 0);
    }
}

#include "registers.h" /* keep_registers_busy, of the processor family */

static void keep_registers_busy_in_a_task(void *arg)
{
    RTS_UNUSED(arg);
    keep_registers_busy((void *)&areas.all.wrong_registers);
}

static void interrupted_task_finishes_when_a_faster_one_fails(void)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(failures); i++) {
        areas.all.wrong_registers = 0;
        RTS_HANDLE high = start(&fast, failures[i].function, 200, 3);
        RTS_HANDLE low = start(&slow, keep_registers_busy_in_a_task, 2000, 10);
        wait_for(&slow.passed, 1);
        SysTimerDelete(low);
        SysTimerDelete(high);
        CHECK_EQUAL(slow.caught, 0);
        CHECK_EQUAL(areas.all.wrong_registers, 0);
        CHECK(fast.caught >= 5);
        CHECK_EQUAL(fast.exception.code, failures[i].code);
    }
}

static void main_keeps_its_registers_when_tasks_fail(void)
{
    volatile RTS_UI32 bad = 0;
    RTS_HANDLE timer = start(&fast, raise_with_everything_clobbered, 100, 3);
    keep_registers_busy((void *)&bad);
    SysTimerDelete(timer);
    CHECK_EQUAL(bad, 0);
    CHECK(fast.caught > 3);
}

static void guarded_code_in_main_survives_failing_tasks(void)
{
    RTS_EXCEPTION exception;
    areas.all.bad = 0;
    RTS_HANDLE timer = start(&fast, OVERFLOW_OF_ALL, 200, 3);
    CHECK_EQUAL(SysExceptTry(keep_registers_busy, (void *)&areas.all.bad, &exception), true);
    SysTimerDelete(timer);
    CHECK_EQUAL(areas.all.bad, 0);
    CHECK(fast.caught > 3);
}

/* ---- endless loops ---- */

/* Every millisecond: a loop that has run for long is broken. */
static void break_the_slow_task(RTS_I64 now)
{
    static RTS_I64 since;
    if (!slow.running)
        since = now;
    else if (now - since >= 3000000)
        SysExceptBreak(&slow, RTSEXCPT_WATCHDOG);
}

static void endless_loop_is_broken_by_the_clock(void)
{
    ClockSetCallback(break_the_slow_task);
    RTS_HANDLE timer = start(&slow, loop_forever, 2000, 0);
    wait_for(&slow.caught, 3);
    SysTimerDelete(timer);
    ClockSetCallback(NULL);
    CHECK_EQUAL(slow.exception.code, RTSEXCPT_WATCHDOG);
    CHECK(is_within(slow.exception.address, loop_forever));
}

static void break_reaches_a_task_below_a_running_one(void)
{
    ClockSetCallback(break_the_slow_task);
    RTS_HANDLE high = start(&fast, keep_registers_busy_in_a_task, 6000, 3);
    RTS_HANDLE low = start(&slow, loop_forever, 2000, 20);
    wait_for(&slow.caught, 3);
    SysTimerDelete(low);
    SysTimerDelete(high);
    ClockSetCallback(NULL);
    CHECK_EQUAL(fast.caught, 0);
    CHECK(fast.passed >= 1);
    CHECK_EQUAL(slow.exception.code, RTSEXCPT_WATCHDOG);
}

static void break_the_slow_task_twice(RTS_I64 now)
{
    break_the_slow_task(now);
    break_the_slow_task(now);
}

static void second_break_does_not_forget_where_the_loop_was(void)
{
    ClockSetCallback(break_the_slow_task_twice);
    RTS_HANDLE timer = start(&slow, loop_forever, 2000, 0);
    wait_for(&slow.caught, 3);
    SysTimerDelete(timer);
    ClockSetCallback(NULL);
    CHECK(is_within(slow.exception.address, loop_forever));
}

static void break_the_slow_task_by_timer(void *param, RTS_I64 due)
{
    RTS_UNUSED(param);
    break_the_slow_task(due);
}

static void endless_loop_is_broken_by_a_timer_above(void)
{
    RTS_HANDLE supervisor;
    SysTimerCreate(break_the_slow_task_by_timer, NULL, 1000, 0, &supervisor);
    SysTimerStart(supervisor);
    RTS_HANDLE timer = start(&slow, loop_forever, 2000, 0); /* the same priority, created later */
    wait_for(&slow.caught, 3);
    SysTimerDelete(supervisor);
    SysTimerDelete(timer);
    CHECK_EQUAL(slow.exception.code, RTSEXCPT_WATCHDOG);
}

static void endless_loop_in_main_is_broken(void)
{
    RTS_EXCEPTION exception;
    slow.running = 1;
    ClockSetCallback(break_the_slow_task);
    CHECK_EQUAL(SysExceptTry(loop_forever, &slow, &exception), false);
    ClockSetCallback(NULL);
    slow.running = 0;
    CHECK_EQUAL(exception.code, RTSEXCPT_WATCHDOG);
}

static void break_something_else(RTS_I64 now)
{
    RTS_UNUSED(now);
    SysExceptBreak(&slow, RTSEXCPT_WATCHDOG);
}

static void break_of_what_does_not_run_does_nothing(void)
{
    RTS_EXCEPTION exception;
    areas.all.bad = 0;
    SysExceptBreak(&slow, RTSEXCPT_WATCHDOG);
    ClockSetCallback(break_something_else);
    CHECK_EQUAL(SysExceptTry(keep_registers_busy, (void *)&areas.all.bad, &exception), true);
    ClockSetCallback(NULL);
    CHECK_EQUAL(areas.all.bad, 0);
}

/* ---- what the stack tells ---- */

static const RTS_UI8 program[64] __attribute__((aligned(16)));
enum { RETURN_OFFSET = 8 };

static void fail_below_a_return_address(void *arg)
{
    RTS_UNUSED(arg);
    PUSH_RETURN_ADDRESS(UNDEFINED);
}

static void loop_below_a_return_address(void *arg)
{
    RTS_UNUSED(arg);
    PUSH_RETURN_ADDRESS(ENDLESS_LOOP);
}

static void expect_return_address(void)
{
    const EXCEPT_TRACE *trace = SysExceptGetTrace();
    CHECK_EQUAL(trace->count, 1);
    CHECK_EQUAL(trace->call[0].target, RETURN_OFFSET);
    CHECK_EQUAL(trace->call[0].distance, 0);
    SysExceptForgetTrace();
    SysExceptCodeRange(NULL, 0);
}

static void trace_of_a_fault_starts_at_its_stack_pointer(void)
{
    RTS_EXCEPTION exception;
    SysExceptForgetTrace();
    SysExceptCodeRange(program, sizeof(program));
    CHECK_EQUAL(SysExceptTry(fail_below_a_return_address, NULL, &exception), false);
    expect_return_address();
}

static void break_after_two_milliseconds(void)
{
    RTS_UI32 from = SysTimeGetMs();
    __asm__ volatile(USE_FPU); /* of a Cortex-M with one: the clock's interrupt stacks its registers, too */
    while (SysTimeGetMs() - from < 2)
        ;
    SysExceptBreak(&slow, RTSEXCPT_WATCHDOG);
}
APP_GATE(break_after_two_milliseconds);

static void break_the_task_below(void *arg)
{
    RTS_UNUSED(arg);
    APP_GATED(break_after_two_milliseconds)();
}

static void trace_of_a_broken_task_below_another_starts_at_its_stack_pointer(void)
{
    SysExceptForgetTrace();
    SysExceptCodeRange(program, sizeof(program));
    RTS_HANDLE high = start(&fast, break_the_task_below, 6000, 3);
    RTS_HANDLE low = start(&slow, loop_below_a_return_address, 20000, 20);
    wait_for(&slow.caught, 1);
    SysTimerDelete(low);
    SysTimerDelete(high);
    expect_return_address();
}

/* ---- entering compiled code ---- */

static RTS_PFN imports[2];

static void compiled_code_finds_its_import_table_in_the_register_for_it(void)
{
    static RTS_UI32 seen[3];
    RTS_UI32 before, after;
    CHECK_EQUAL(offsetof(IEC_CONTEXT, area), 16);
    IEC_CONTEXT context = {.imports = imports};
    context.area[0] = (RTS_UI8 *)seen;
    READ_IMPORT_REGISTER(before);
    IecCall(&context, 5, (uintptr_t)compiled_entry | APP_ENTRY_MODE_BIT);
    READ_IMPORT_REGISTER(after);
    CHECK_EQUAL(seen[0], (uintptr_t)imports);
    CHECK_EQUAL(seen[1], (uintptr_t)&context);
    CHECK_EQUAL(seen[2], 5);
    CHECK_EQUAL(before, after);
}

int main(void)
{
    TEST_BEGIN();
    TEST_RUN(normal_end_is_no_exception);
    TEST_RUN(raised_exception_brings_code_and_address_without_thumb_bit);
    TEST_RUN(every_failure_in_main_is_caught_with_its_code);
    TEST_RUN(address_names_the_function_that_failed);
    TEST_RUN(address_of_a_stack_overflow_names_a_function_on_the_stack);
    TEST_RUN(overflow_stops_at_the_guard);
    RUN_MISDEED_TESTS();
    TEST_RUN(many_failures_cost_no_stack);
    TEST_RUN(every_failure_in_a_timer_is_caught_with_its_code);
    TEST_RUN(interrupted_task_finishes_when_a_faster_one_fails);
    TEST_RUN(main_keeps_its_registers_when_tasks_fail);
    TEST_RUN(guarded_code_in_main_survives_failing_tasks);
    TEST_RUN(endless_loop_is_broken_by_the_clock);
    TEST_RUN(break_reaches_a_task_below_a_running_one);
    TEST_RUN(second_break_does_not_forget_where_the_loop_was);
    TEST_RUN(endless_loop_is_broken_by_a_timer_above);
    TEST_RUN(endless_loop_in_main_is_broken);
    TEST_RUN(break_of_what_does_not_run_does_nothing);
    TEST_RUN(trace_of_a_fault_starts_at_its_stack_pointer);
    TEST_RUN(trace_of_a_broken_task_below_another_starts_at_its_stack_pointer);
    TEST_RUN(compiled_code_finds_its_import_table_in_the_register_for_it);
    TEST_END();
}
