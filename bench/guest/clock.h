/*
 * clock.h - counts instructions: the SysTick timer of a Cortex-M in QEMU with `-icount shift=0`.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * One instruction is 1 ns of virtual time, a tick of the 25 MHz clock 40 instructions. The counter has 24 bits, enough
 * for 670 million instructions.
 */
#ifndef CLOCK_H
#define CLOCK_H

#include <stdint.h>

enum { INSTRUCTIONS_PER_TICK = 40 };

static inline void clock_start(void)
{
    *(volatile uint32_t *)0xE000E014 = 0xFFFFFF;
    *(volatile uint32_t *)0xE000E018 = 0;
    *(volatile uint32_t *)0xE000E010 = 5;
}

/* Instructions since clock_start. */
static inline uint64_t clock_instructions(void)
{
    return (uint64_t)((0u - *(volatile uint32_t *)0xE000E018) & 0xFFFFFF) * INSTRUCTIONS_PER_TICK;
}

#endif
