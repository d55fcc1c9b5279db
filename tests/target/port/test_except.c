/*
 * test_except.c - what application code can do wrong, in main and in the interrupt of a timer, and who survives it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CortexM.h"
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

#ifdef __ARM_FP
#define USE_FPU "vmov.f32 s0, #1.0\n\t"
#else
#define USE_FPU ""
#endif

static void divide_by_zero(void *arg)
{
    RTS_UNUSED(arg);
    RTS_UI32 result;
    __asm__ volatile("udiv %0, %1, %2" : "=r"(result) : "r"(5), "r"(zero));
    sink = result;
}

static void undefined_instruction(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("udf #1");
}

static void read_from_nowhere(void *arg)
{
    RTS_UNUSED(arg);
    sink = REG32(0x80000000u);
}

#define NOWHERE 0x90000000u

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

static void unaligned_multiple_load(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("ldr r1, =0x20001002\n\tldmia r1, {r2, r3}" ::: "r1", "r2", "r3", "memory");
}

static void call_nowhere(void *arg)
{
    RTS_UNUSED(arg);
    ((void (*)(void))(0xA0000001u + zero))();
    sink = 1; /* not a tail call */
}

static void call_without_thumb_bit(void *arg)
{
    RTS_UNUSED(arg);
    ((void (*)(void))(0x400u + zero))();
    sink = 1;
}

static void hit_a_breakpoint(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("bkpt #1");
}

static void raise(void *arg)
{
    RTS_UNUSED(arg);
    SysExceptRaise(RTSEXCPT_ARRAYBOUNDS, 0x1235, NULL);
}

static void raise_with_everything_clobbered(void *arg)
{
    RTS_UNUSED(arg);
#ifdef __ARM_FP
    __asm__ volatile("vmov.f32 s16, #1.0\n\tvmov.f32 s20, #2.0\n\tvmov.f32 s31, #3.0\n\t"
                     "vmov.f32 s1, #4.0" ::
                         : "memory");
#endif
    __asm__ volatile("movs r4, #99\n\tmov r5, r4\n\tmov r6, r4\n\tmov r8, r4\n\tmov r9, r4\n\tmov r10, r4\n\t"
                     "mov r11, r4\n\tudf #2");
}

static void __attribute__((noinline)) recurse(volatile RTS_UI32 *above)
{
    volatile RTS_UI32 here[4] = {above[0] + 1, 0, 0, 0};
    if (!zero)
        recurse(here);
    sink = here[0];
}

static void fail_with_interrupts_masked(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("cpsid i\n\tudf #1" ::: "memory");
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

static void overflow_the_stack_with_fpu(void *arg)
{
#ifdef __ARM_FP
    __asm__ volatile("vmov.f32 s5, #1.0" ::: "s5");
#endif
    overflow_the_stack(arg);
}

/* Moves the stack pointer to the bottom of the stack of this depth (stack slots are as aligned as large). */
#define GO_TO_THE_BOTTOM "mov r0, sp\n\tsubs r0, #1\n\tldr r1, =%0\n\tbic r0, r0, r1\n\tmov sp, r0\n\t"

enum { IEC_STACK_GUARD = RTS_IEC_UNPRIVILEGED ? 0 : STACK_GUARD };

/* The SVC that leaves finds 16 bytes above the guard. */
static void leave_near_the_end_of_the_stack(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile(GO_TO_THE_BOTTOM "add sp, %1\n\tmov r0, #1\n\tsvc 0" ::"i"(RTS_IEC_STACK_SIZE - 1),
                     "i"(IEC_STACK_GUARD + 16));
}

/* A large frame that ends at the bottom of the guard. What the fault pushes is below, on a stack that is idle. */
static void use_a_frame_that_ends_in_the_guard(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile(USE_FPU GO_TO_THE_BOTTOM "str r0, [sp]" ::"i"(RTS_IEC_STACK_SIZE - 1));
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

static const FAILURE failures[] = {
    {divide_by_zero, RTSEXCPT_DIVIDEBYZERO},
    {undefined_instruction, RTSEXCPT_ILLEGAL_INSTRUCTION},
    {read_from_nowhere, RTSEXCPT_ACCESS_VIOLATION},
    {write_to_nowhere, RTSEXCPT_ACCESS_VIOLATION},
    {read_from_null, RTSEXCPT_ACCESS_VIOLATION},
    {write_to_flash, RTSEXCPT_ACCESS_VIOLATION},
    {unaligned_multiple_load, RTSEXCPT_MISALIGNMENT},
    {call_nowhere, RTSEXCPT_ACCESS_VIOLATION},
    {call_without_thumb_bit, RTSEXCPT_ILLEGAL_INSTRUCTION},
    {hit_a_breakpoint, RTSEXCPT_BREAKPOINT},
    {raise, RTSEXCPT_ARRAYBOUNDS},
    {raise_with_everything_clobbered, RTSEXCPT_ILLEGAL_INSTRUCTION},
    {fail_with_interrupts_masked, RTSEXCPT_ILLEGAL_INSTRUCTION},
    {overflow_the_stack, RTSEXCPT_STACK_OVERFLOW},
    {overflow_the_stack_with_large_frames, RTSEXCPT_STACK_OVERFLOW},
    {overflow_past_the_guard, RTSEXCPT_STACK_OVERFLOW},
    {overflow_the_stack_with_fpu, RTSEXCPT_STACK_OVERFLOW},
    {use_a_frame_that_ends_in_the_guard, RTSEXCPT_STACK_OVERFLOW},
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
    for (RTS_UI32 i = 0; i < 9; i++) {
        SysExceptTry(failures[i].function, NULL, &exception);
        CHECK(is_within(exception.address, failures[i].function));
    }
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
    enum { RAM_START = 0x20000000, FRAME = 104, BELOW = FRAME + 64 };
    RTS_EXCEPTION exception;
    volatile RTS_UI8 *below = (volatile RTS_UI8 *)(RAM_START + (APP_MAX_TASKS - 1) * RTS_IEC_STACK_SIZE - BELOW);
    for (int i = 0; i < BELOW - FRAME; i++)
        below[i] = (RTS_UI8)i;
    SysExceptTry(overflow_the_stack, NULL, &exception);
    for (int i = 0; i < BELOW - FRAME; i++)
        CHECK_EQUAL(below[i], i);
}

static void no_room_for_the_leaving_frame_is_a_stack_overflow(void)
{
    RTS_EXCEPTION exception;
    CHECK_EQUAL(SysExceptTry(leave_near_the_end_of_the_stack, NULL, &exception), false);
    CHECK_EQUAL(exception.code, RTSEXCPT_STACK_OVERFLOW);
    CHECK_EQUAL(SysExceptTry(raise, NULL, &exception), false);
    CHECK_EQUAL(exception.code, RTSEXCPT_ARRAYBOUNDS);
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

/* Holds known values in every register a function may keep, and in some that it may not, for a while. */
static void keep_registers_busy(void *arg)
{
    RTS_UI32 bad = 0;
    for (RTS_UI32 round = 0; round < 200; round++) {
        RTS_UI32 wrong;
        __asm__ volatile("mov %0, #0\n\t"
                         "mov r4, #40\n\tmov r5, #50\n\tmov r6, #60\n\tmov r8, #80\n\tmov r9, #90\n\tmov r10, #100\n\t"
                         "mov r11, #110\n\tmov r12, #120\n\tmov r3, #30\n\t"
#ifdef __ARM_FP
                         "vmov s0, r4\n\tvmov s1, r5\n\tvmov s15, r6\n\tvmov s16, r8\n\tvmov s20, r9\n\t"
                         "vmov s31, r10\n\t"
#endif
                         "mov r2, #1000\n\t1: subs r2, #1\n\tbne 1b\n\t"
                         "cmp r4, #40\n\tit ne\n\taddne %0, #1\n\tcmp r5, #50\n\tit ne\n\taddne %0, #1\n\t"
                         "cmp r6, #60\n\tit ne\n\taddne %0, #1\n\tcmp r8, #80\n\tit ne\n\taddne %0, #1\n\t"
                         "cmp r9, #90\n\tit ne\n\taddne %0, #1\n\tcmp r10, #100\n\tit ne\n\taddne %0, #1\n\t"
                         "cmp r11, #110\n\tit ne\n\taddne %0, #1\n\tcmp r12, #120\n\tit ne\n\taddne %0, #1\n\t"
                         "cmp r3, #30\n\tit ne\n\taddne %0, #1\n\t"
#ifdef __ARM_FP
                         "vmov r2, s0\n\tcmp r2, #40\n\tit ne\n\taddne %0, #1\n\t"
                         "vmov r2, s1\n\tcmp r2, #50\n\tit ne\n\taddne %0, #1\n\t"
                         "vmov r2, s15\n\tcmp r2, #60\n\tit ne\n\taddne %0, #1\n\t"
                         "vmov r2, s16\n\tcmp r2, #80\n\tit ne\n\taddne %0, #1\n\t"
                         "vmov r2, s20\n\tcmp r2, #90\n\tit ne\n\taddne %0, #1\n\t"
                         "vmov r2, s31\n\tcmp r2, #100\n\tit ne\n\taddne %0, #1\n\t"
#endif
                         : "=&r"(wrong)
                         :
                         : "r2", "r3", "r4", "r5", "r6", "r8", "r9", "r10", "r11", "r12", "cc", "memory"
#ifdef __ARM_FP
                           ,
                           "s0", "s1", "s15", "s16", "s20", "s31"
#endif
        );
        bad += wrong;
    }
    *(volatile RTS_UI32 *)arg += bad;
}

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
    RTS_HANDLE timer = start(&fast, overflow_the_stack_with_fpu, 200, 3);
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

/* Pushes three words, so that the frame of an exception is moved to a multiple of 8, with a return address into
 * `program` as the lowest; goes on with `then`. */
#define PUSH_RETURN_ADDRESS(then)                                                                                  \
    __asm__ volatile(USE_FPU "mov r1, %0\n\tpush {r1, r2, lr}\n\t" then ::"r"((uintptr_t)program + RETURN_OFFSET + \
                                                                              APP_ENTRY_MODE_BIT)                  \
                     : "r1", "memory")

static void fail_below_a_return_address(void *arg)
{
    RTS_UNUSED(arg);
    PUSH_RETURN_ADDRESS("udf #1");
}

static void loop_below_a_return_address(void *arg)
{
    RTS_UNUSED(arg);
    PUSH_RETURN_ADDRESS("1:\tb 1b");
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
    __asm__ volatile(USE_FPU); /* the clock's interrupt stacks its registers, too */
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

/* As plctool emits it: the import table in r9. Tells what it saw through the data area. */
__attribute__((naked)) static void compiled_entry(void)
{
    __asm__ volatile("ldr r2, [r0, #16]\n\tstr r9, [r2]\n\tstr r0, [r2, #4]\n\tstr r1, [r2, #8]\n\tbx lr");
}

static void compiled_code_finds_its_import_table_in_r9(void)
{
    static RTS_UI32 seen[3];
    RTS_UI32 before, after;
    CHECK_EQUAL(offsetof(IEC_CONTEXT, area), 16);
    IEC_CONTEXT context = {.imports = imports};
    context.area[0] = (RTS_UI8 *)seen;
    __asm__ volatile("mov %0, r9" : "=r"(before));
    IecCall(&context, 5, (uintptr_t)compiled_entry | APP_ENTRY_MODE_BIT);
    __asm__ volatile("mov %0, r9" : "=r"(after));
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
    TEST_RUN(no_room_for_the_leaving_frame_is_a_stack_overflow);
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
    TEST_RUN(compiled_code_finds_its_import_table_in_r9);
    TEST_END();
}
