/*
 * family.h - what the tests of the port have to know of Armv7-M.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef FAMILY_H
#define FAMILY_H

#include "BareMetal.h"

/* Stacks of tasks: the bottom of RAM. */
enum { IEC_STACKS = 0x20000000 };

#define NOWHERE 0x90000000u /* no memory */
#define UNDEFINED "udf #1"
#define ENDLESS_LOOP "1:\tb 1b"

#ifdef __ARM_FP
#define USE_FPU "vmov.f32 s0, #1.0\n\t"
#else
#define USE_FPU ""
#endif

/* Bytes that a fault pushes on the stack of a task. */
enum { FAULT_FRAME = 104 };

#define READ_IMPORT_REGISTER(value) __asm__ volatile("mov %0, r9" : "=r"(value))

/* As plctool emits it: the import table in r9. Tells what it saw through the data area. */
__attribute__((naked, unused)) static void compiled_entry(void)
{
    __asm__ volatile("ldr r2, [r0, #16]\n\tstr r9, [r2]\n\tstr r0, [r2, #4]\n\tstr r1, [r2, #8]\n\tbx lr");
}

/* Pushes three words, so that the frame of an exception is moved to a multiple of 8, with a return address into
 * `program` as the lowest; goes on with `then`. */
#define PUSH_RETURN_ADDRESS(then)                                                                                  \
    __asm__ volatile(USE_FPU "mov r1, %0\n\tpush {r1, r2, lr}\n\t" then ::"r"((uintptr_t)program + RETURN_OFFSET + \
                                                                              APP_ENTRY_MODE_BIT)                  \
                     : "r1", "memory")

/* ---- what the processor says of a fault of the runtime ---- */

enum { STATUS_UNDEFINED = 1 << 16 };
#define IS_STATUS_OF_OVERFLOW(status) (((status) & 0x92) != 0) /* the guard was hit, or the frame found no room */

/* ---- test_rights.c ---- */

/* Whether a test may look there. */
#define IS_READABLE(address) ((address) < 0x22000000u && (address) >= 0x400)

/* Registers of devices, some of them by their bits. */
#define DEVICE_REGISTERS 0x40000000, 0x42000000, 0x22000000 + ((uintptr_t)IEC_STACKS & 0xFFFFF) * 32

/* The registers of the processor are no matter of the MPU: test_rights.c has them apart. */
#define IS_OF_THE_PROCESSOR(address) ((address) >> 20 == 0xE00)

#define RETURN_INSTRUCTION 0x4770 /* bx lr */
#define READ_A_PRIVILEGED_REGISTER() SCB_CCR
#define CALL_OF_A_GATE "movs r0, #0\n\tsvc 1"

#endif
