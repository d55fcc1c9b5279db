/*
 * privileges.h - what of a RISC-V itself a program must not change; for test_rights.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define WRITES(name)                                                  \
    static void write_##name(void *arg)                               \
    {                                                                 \
        RTS_UNUSED(arg);                                              \
        __asm__ volatile("li t0, -1\n\tcsrw " #name ", t0" ::: "t0"); \
        in_bss[0] = 1;                                                \
    }

WRITES(mstatus)
WRITES(mtvec)
WRITES(mie)
WRITES(mscratch)
WRITES(mepc)
WRITES(pmpcfg0)
WRITES(pmpaddr2)

static void return_to_machine_mode(void *arg)
{
    RTS_UNUSED(arg);
    __asm__ volatile("mret");
    in_bss[0] = 1;
}

static void rights_cannot_be_taken(void)
{
    static void (*const attempts[])(void *) = {
        write_mstatus, write_mtvec,   write_mie,      write_mscratch,
        write_mepc,    write_pmpcfg0, write_pmpaddr2, return_to_machine_mode,
    };
    in_bss[0] = 0;
    for (RTS_UI32 i = 0; i < RTS_COUNT(attempts); i++) {
        RTS_EXCEPTION exception;
        CHECK_EQUAL(SysExceptTry(attempts[i], NULL, &exception), false);
        CHECK_EQUAL(exception.code, RTSEXCPT_ILLEGAL_INSTRUCTION);
        CHECK_EQUAL(in_bss[0], 0);
    }
    CHECK(CSR_READ("mstatus") & MSTATUS_MIE);
}

#define RUN_PRIVILEGE_TESTS() TEST_RUN(rights_cannot_be_taken)
