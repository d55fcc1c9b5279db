/*
 * test_reset.c - each way to restart, one after the other: what the next start knows about it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "check.h"

static void __attribute__((noinline)) fault_of_the_runtime(void)
{
    __asm__ volatile(UNDEFINED);
}

static void __attribute__((noinline)) fault_in_an_interrupt(RTS_I64 now)
{
    RTS_UNUSED(now);
    __asm__ volatile(UNDEFINED);
}

static void __attribute__((noinline)) overflow_of_the_main_stack(volatile RTS_UI32 *above)
{
    volatile RTS_UI32 here[16] = {above[0] + 1};
    if (here[0])
        overflow_of_the_main_stack(here);
    semihost_print((const char *)above);
}

static void __attribute__((noinline)) wait_for_ever(void)
{
    for (;;)
        ;
}

static int is_within(uintptr_t address, uintptr_t function)
{
    return address - (function & ~(uintptr_t)1) < 32;
}

/* What the start before this one did; counts the starts in RAM that is kept. */
__attribute__((section(".noinit"))) static volatile RTS_UI32 start_number;

static void start_by_start(const RESET_RECORD *reset)
{
    volatile RTS_UI32 zero[1] = {0};

    switch (start_number++) {
    case 1:
        CHECK_EQUAL(reset->cause, RESET_POWER_ON);
        fault_of_the_runtime();
        break;
    case 2:
        CHECK_EQUAL(reset->cause, RESET_FATAL);
        CHECK(is_within(reset->pc, (uintptr_t)fault_of_the_runtime));
        CHECK_EQUAL(reset->status, STATUS_UNDEFINED);
        ClockSetCallback(fault_in_an_interrupt);
        wait_for_ever();
        break;
    case 3:
        CHECK_EQUAL(reset->cause, RESET_FATAL);
        CHECK(is_within(reset->pc, (uintptr_t)fault_in_an_interrupt));
        overflow_of_the_main_stack(zero);
        break;
    case 4:
        CHECK_EQUAL(reset->cause, RESET_FATAL);
        CHECK(IS_STATUS_OF_OVERFLOW(reset->status));
        BoardWatchdogStart(20);
        wait_for_ever();
        break;
    case 5:
        CHECK_EQUAL(reset->cause, RESET_WATCHDOG);
        CHECK(is_within(reset->pc, (uintptr_t)wait_for_ever));
        if (BOARD_WATCHDOG_IS_MASKED)
            ResetNow(RESET_PIN, 0);
        CpuMask();
        BoardWatchdogStart(20);
        wait_for_ever(); /* masked interrupts do not keep it away */
        break;
    case 6:
        /* Only a warning that is an NMI, or a chip that knows why it was reset, can tell. */
        CHECK(reset->cause == RESET_WATCHDOG || reset->cause == RESET_PIN);
        ResetNow(RESET_SOFTWARE, 0);
        break;
    case 7:
        CHECK_EQUAL(reset->cause, RESET_SOFTWARE);
        ResetNow(RESET_CAUSE_COUNT, 0); /* a bit of the record that toppled while the power was low */
        break;
    default:
        CHECK_EQUAL(reset->cause, RESET_POWER_ON);
        CHECK_EQUAL(start_number, 9);
        TEST_END();
    }
}

int main(void)
{
    if (ResetGet()->cause == RESET_POWER_ON && start_number != 8)
        start_number = 1;
    start_by_start(ResetGet());
    CHECK(0); /* the fault before should have ended this start */
    TEST_END();
}
