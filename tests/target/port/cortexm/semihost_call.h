/*
 * semihost_call.h - a call of the debugger, in which QEMU runs the program: Armv7-M.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SEMIHOST_CALL_H
#define SEMIHOST_CALL_H

#include <stdint.h>

static inline void semihost(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
}

#endif
