/*
 * family.h - what the tests of the port have to know of RISC-V.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef FAMILY_H
#define FAMILY_H

#include "BareMetal.h"

/* Stacks of tasks: the bottom of RAM. */
enum { IEC_STACKS = (int)BOARD_RAM };

#define NOWHERE 0x90000000u /* no memory */
#define UNDEFINED ".half 0"
#define ENDLESS_LOOP "1:\tj 1b"
#define USE_FPU ""

/* Bytes that a fault pushes on the stack of a task. */
enum { FAULT_FRAME = 0 };

#define READ_IMPORT_REGISTER(value) __asm__ volatile("mv %0, s11" : "=r"(value))

/* As plctool emits it: the import table in s11. Tells what it saw through the data area. */
__attribute__((naked, unused)) static void compiled_entry(void)
{
    __asm__ volatile("lw a2, 16(a0)\n\tsw s11, 0(a2)\n\tsw a0, 4(a2)\n\tsw a1, 8(a2)\n\tret");
}

/* Pushes a return address into `program`; goes on with `then`. */
#define PUSH_RETURN_ADDRESS(then)                                                                               \
    __asm__ volatile(                                                                                           \
        "addi sp, sp, -16\n\tsw %0, 0(sp)\n\tsw zero, 4(sp)\n\t" then ::"r"((uintptr_t)program + RETURN_OFFSET) \
        : "memory")

/* ---- what the processor says of a fault of the runtime ---- */

enum { STATUS_UNDEFINED = 2 };
#define IS_STATUS_OF_OVERFLOW(status) ((status) == 7) /* a store */

/* ---- test_rights.c ---- */

/* Whether a test may look there. */
#define IS_READABLE(address) ((address) >= BOARD_CODE)

#define DEVICE_REGISTERS 0x00100000, 0x02000000, 0x0C002000, 0x10000001, 0x22000000

#define IS_OF_THE_PROCESSOR(address) ((void)(address), 0)

#define RETURN_INSTRUCTION 0x8082 /* ret */
#define READ_A_PRIVILEGED_REGISTER() CSR_READ("mtvec")
#define CALL_OF_A_GATE "li a0, 0\n\tecall"

#endif
