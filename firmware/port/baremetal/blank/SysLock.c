/*
 * SysLock.c - keeps tasks and main out of each other's way. Contract: SysLock.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysLock.h"

/* Write here: mask the interrupts that tasks run in, and return which were masked before. Nothing where tasks do not
 * interrupt each other, nor main. */
RTS_UI32 SysLockEnter(void)
{
    return 0;
}

/* Write here: mask what was masked before. */
void SysLockLeave(RTS_UI32 before)
{
    RTS_UNUSED(before);
}
