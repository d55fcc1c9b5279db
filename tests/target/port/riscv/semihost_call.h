/*
 * semihost_call.h - a call of the debugger, in which QEMU runs the program: RISC-V.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SEMIHOST_CALL_H
#define SEMIHOST_CALL_H

#include <stdint.h>

/* The three instructions have to be in one page, and of 4 bytes each. */
static inline void semihost(uint32_t operation, const void *argument)
{
    register uint32_t a0 __asm__("a0") = operation;
    register const void *a1 __asm__("a1") = argument;
    __asm__ volatile(".option push\n\t.option norvc\n\t.balign 16\n\t"
                     "slli zero, zero, 0x1f\n\tebreak\n\tsrai zero, zero, 7\n\t.option pop"
                     : "+r"(a0)
                     : "r"(a1)
                     : "memory");
}

#endif
