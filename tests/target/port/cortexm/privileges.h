/*
 * privileges.h - what of an Armv7-M itself a program must not change; for test_rights.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
/* Of SysTick, NVIC, SCB and MPU. They are no matter of the MPU: the bus refuses, of which there is no exception in QEMU's
 * model of one chip (test_wild_writes.py has the others). */
static void store_into_registers_of_the_processor_changes_nothing(void)
{
    static const uintptr_t registers[] = {0xE000E014, 0xE000E100, 0xE000ED08, 0xE000ED14, 0xE000ED94, 0xE000EDA0};
    for (RTS_UI32 i = 0; i < RTS_COUNT(registers); i++) {
        RTS_UI32 before = REG32(registers[i]);
        (void)may_store(registers[i], ~before);
        CHECK_EQUAL(REG32(registers[i]), before);
    }
}

static void take_all_rights(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("mov r0, #0\n\tmsr control, r0\n\tisb\n\tcpsid i\n\tmov r0, #32\n\tmsr basepri, r0" ::: "r0");
    in_bss[0] = 1;
}

static void rights_cannot_be_taken(void)
{
    RTS_EXCEPTION exception;
    RTS_UI32 primask, basepri;
    in_bss[0] = 0;
    CHECK_EQUAL(SysExceptTry(take_all_rights, NULL, &exception), false);
    CHECK_EQUAL(exception.code, RTSEXCPT_ACCESS_VIOLATION);
    CHECK_EQUAL(in_bss[0], 0);
    __asm__ volatile("mrs %0, primask\n\tmrs %1, basepri" : "=r"(primask), "=r"(basepri));
    CHECK_EQUAL(primask | basepri, 0);
}

#define RUN_PRIVILEGE_TESTS()                                            \
    do {                                                                 \
        TEST_RUN(store_into_registers_of_the_processor_changes_nothing); \
        TEST_RUN(rights_cannot_be_taken);                                \
    } while (0)
