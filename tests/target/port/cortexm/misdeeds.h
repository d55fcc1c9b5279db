/*
 * misdeeds.h - what only code of an Armv7-M can do wrong; for test_except.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
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

static void unaligned_multiple_load(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("ldr r1, =0x20001002\n\tldmia r1, {r2, r3}" ::: "r1", "r2", "r3", "memory");
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

static void fail_with_interrupts_masked(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("cpsid i\n\tudf #1" ::: "memory");
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

static void no_room_for_the_leaving_frame_is_a_stack_overflow(void)
{
    RTS_EXCEPTION exception;
    CHECK_EQUAL(SysExceptTry(leave_near_the_end_of_the_stack, NULL, &exception), false);
    CHECK_EQUAL(exception.code, RTSEXCPT_STACK_OVERFLOW);
    CHECK_EQUAL(SysExceptTry(raise, NULL, &exception), false);
    CHECK_EQUAL(exception.code, RTSEXCPT_ARRAYBOUNDS);
}

#define RUN_MISDEED_TESTS() TEST_RUN(no_room_for_the_leaving_frame_is_a_stack_overflow)

#define OVERFLOW_OF_ALL overflow_the_stack_with_fpu

/* clang-format off */
#define NAMED_MISDEEDS \
    {divide_by_zero, RTSEXCPT_DIVIDEBYZERO}, \
    {undefined_instruction, RTSEXCPT_ILLEGAL_INSTRUCTION}, \
    {unaligned_multiple_load, RTSEXCPT_MISALIGNMENT}, \
    {call_without_thumb_bit, RTSEXCPT_ILLEGAL_INSTRUCTION}

#define OTHER_MISDEEDS \
    {hit_a_breakpoint, RTSEXCPT_BREAKPOINT}, \
    {raise_with_everything_clobbered, RTSEXCPT_ILLEGAL_INSTRUCTION}, \
    {fail_with_interrupts_masked, RTSEXCPT_ILLEGAL_INSTRUCTION}, \
    {overflow_the_stack_with_fpu, RTSEXCPT_STACK_OVERFLOW}, \
    {use_a_frame_that_ends_in_the_guard, RTSEXCPT_STACK_OVERFLOW}
/* clang-format on */
