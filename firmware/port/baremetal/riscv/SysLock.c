/*
 * SysLock.c - the lock on RISC-V: the interrupt that runs tasks is disabled. The clock, the alarm and devices go on.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysLock.h"

#include "BareMetal.h"

RTS_UI32 SysLockEnter(void)
{
    RTS_UI32 before;
    __asm__ volatile("csrrci %0, mie, %1" : "=r"(before) : "i"(1 << INTERRUPT_SOFTWARE) : "memory");
    return before & 1 << INTERRUPT_SOFTWARE;
}

void SysLockLeave(RTS_UI32 before)
{
    CSR_SET("mie", before);
}
