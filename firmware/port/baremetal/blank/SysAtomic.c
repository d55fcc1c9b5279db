/*
 * SysAtomic.c - what the compiler calls on a core that cannot add or replace in one piece, such as a Cortex-M0. Contract:
 * SysAtomic.h. Other cores do not need it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysAtomic.h"

#ifndef __GCC_HAVE_SYNC_COMPARE_AND_SWAP_4

RTS_UI32 __atomic_fetch_add_4(volatile void *object, RTS_UI32 value, int order);
bool __atomic_compare_exchange_4(volatile void *object, void *expected, RTS_UI32 value, bool weak, int success,
                                 int failure);

/* Write here: mask all interrupts before, and give them back after. */
RTS_UI32 __atomic_fetch_add_4(volatile void *object, RTS_UI32 value, int order)
{
    volatile RTS_UI32 *number = object;
    RTS_UI32 before = *number;
    RTS_UNUSED(order);
    *number = before + value;
    return before;
}

/* Here too. */
bool __atomic_compare_exchange_4(volatile void *object, void *expected, RTS_UI32 value, bool weak, int success,
                                 int failure)
{
    volatile RTS_UI32 *number = object;
    RTS_UI32 *before = expected;
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
