/*
 * SysAtomic.c - what the compiler calls on a core that cannot add or replace in one piece, such as a Cortex-M0. Contract:
 * SysAtomic.h. Other cores do not need it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysAtomic.h"

#ifndef __GCC_HAVE_SYNC_COMPARE_AND_SWAP_4

/* The compiler's own types: its 32 bits are `unsigned`, whatever RTS_UI32 is. */
unsigned __atomic_fetch_add_4(volatile void *object, unsigned value, int order);
bool __atomic_compare_exchange_4(volatile void *object, void *expected, unsigned value, bool weak, int success,
                                 int failure);

/* Write here: mask all interrupts before, and give them back after. */
unsigned __atomic_fetch_add_4(volatile void *object, unsigned value, int order)
{
    volatile unsigned *number = object;
    unsigned before = *number;
    RTS_UNUSED(order);
    *number = before + value;
    return before;
}

/* Here too. */
bool __atomic_compare_exchange_4(volatile void *object, void *expected, unsigned value, bool weak, int success,
                                 int failure)
{
    volatile unsigned *number = object;
    unsigned *before = expected;
    bool equal = *number == *before;
    RTS_UNUSED(weak);
    RTS_UNUSED(success);
    RTS_UNUSED(failure);
    if (equal)
        *number = value;
    else
        *before = *number;
    return equal;
}

#endif
