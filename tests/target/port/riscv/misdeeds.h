/*
 * misdeeds.h - what only code of a RISC-V can do wrong; for test_except.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
static void undefined_instruction(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile(UNDEFINED);
}

static void hit_a_breakpoint(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("ebreak");
}

static void raise_with_everything_clobbered(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("li s0, 99\n\tli s1, 99\n\tli s2, 99\n\tli s3, 99\n\tli s4, 99\n\tli s5, 99\n\tli s6, 99\n\t"
                     "li s7, 99\n\tli s8, 99\n\tli s9, 99\n\tli s10, 99\n\tli s11, 99\n\tli ra, 99\n\tli gp, 99\n\t"
                     "li tp, 99\n\tli t0, 99\n\tli t6, 99\n\t" UNDEFINED);
}

static void fail_with_interrupts_masked(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("csrci mstatus, 8\n\t" UNDEFINED ::: "memory");
}

/* A stack pointer to nowhere: a trap does not use it. */
static void fail_without_a_stack(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("li sp, -1\n\t" UNDEFINED ::: "memory");
}

/* Moves the stack pointer to the bottom of the stack of this depth (stack slots are as aligned as large). */
#define GO_TO_THE_BOTTOM "addi t0, sp, -1\n\tli t1, %0\n\tand sp, t0, t1\n\t"

/* A frame that is too large by a word. */
static void use_a_frame_that_ends_below(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile(GO_TO_THE_BOTTOM "sw a0, -4(sp)" ::"i"(-RTS_IEC_STACK_SIZE));
}

/* The ECALL that leaves needs no stack. */
static void leave_at_the_end_of_the_stack(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile(GO_TO_THE_BOTTOM "li a0, 0\n\tecall" ::"i"(-RTS_IEC_STACK_SIZE));
}

static void leaving_needs_no_stack(void)
{
    RTS_EXCEPTION exception;
    CHECK_EQUAL(SysExceptTry(leave_at_the_end_of_the_stack, NULL, &exception), true);
    CHECK_EQUAL(SysExceptTry(raise, NULL, &exception), false);
    CHECK_EQUAL(exception.code, RTSEXCPT_ARRAYBOUNDS);
}

#define RUN_MISDEED_TESTS() TEST_RUN(leaving_needs_no_stack)

#define OVERFLOW_OF_ALL overflow_the_stack

/* clang-format off */
#define NAMED_MISDEEDS \
    {undefined_instruction, RTSEXCPT_ILLEGAL_INSTRUCTION}

#define OTHER_MISDEEDS \
    {hit_a_breakpoint, RTSEXCPT_BREAKPOINT}, \
    {raise_with_everything_clobbered, RTSEXCPT_ILLEGAL_INSTRUCTION}, \
    {fail_with_interrupts_masked, RTSEXCPT_ILLEGAL_INSTRUCTION}, \
    {fail_without_a_stack, RTSEXCPT_ILLEGAL_INSTRUCTION}, \
    {use_a_frame_that_ends_below, RTSEXCPT_STACK_OVERFLOW}
/* clang-format on */
