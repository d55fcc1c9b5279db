/*
 * reference_clock.h - a second clock, for the test of the first one: the counter of the watchdog. (QEMU does not let
 * the timers be read.)
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef REFERENCE_CLOCK_H
#define REFERENCE_CLOCK_H

#include "BareMetal.h"

static inline void ReferenceStart(void)
{
    REG32(0x40000000u) = 0xFFFFFFFFu; /* LOAD */
    REG32(0x40000008u) = 1;           /* CTL: counts, and does not reset */
}

/* Nanoseconds; wraps. */
static inline RTS_UI32 ReferenceNs(void)
{
    return ~REG32(0x40000004u) * 20u; /* VALUE, counted down */
}

#endif
