/*
 * reference_clock.h - a second clock, for the test of the first one: CMSDK timer 1, free running at 25 MHz.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef REFERENCE_CLOCK_H
#define REFERENCE_CLOCK_H

#include "BareMetal.h"

static inline void ReferenceStart(void)
{
    REG32(0x40001008u) = 0xFFFFFFFFu; /* RELOAD */
    REG32(0x40001000u) = 1;           /* CTRL */
}

/* Nanoseconds; wraps. */
static inline RTS_UI32 ReferenceNs(void)
{
    return ~REG32(0x40001004u) * 40u; /* VALUE, counted down */
}

#endif
