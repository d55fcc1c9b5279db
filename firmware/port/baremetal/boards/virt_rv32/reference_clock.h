/*
 * reference_clock.h - a second clock, for the test of the first one: the real-time clock.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef REFERENCE_CLOCK_H
#define REFERENCE_CLOCK_H

#include "BareMetal.h"

static inline void ReferenceStart(void)
{
}

/* Nanoseconds; wraps. */
static inline RTS_UI32 ReferenceNs(void)
{
    return REG32(0x00101000u);
}

#endif
