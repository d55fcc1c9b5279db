/*
 * SysLock.c - the lock on Armv7-M: the interrupts of all tasks are masked.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * By BASEPRI, so that the clock, the alarm and devices go on. On a Cortex-M7 r0p1 (erratum 837070) a write to it takes
 * effect late: mask all interrupts around it there.
 */
#include "SysLock.h"

#include "BareMetal.h"

RTS_UI32 SysLockEnter(void)
{
    RTS_UI32 before;
    __asm__ volatile("mrs %0, basepri" : "=r"(before));
    __asm__ volatile("msr basepri_max, %0\n\tisb" ::"r"((RTS_UI32)CpuPriority(LEVEL_TIMER)) : "memory");
    return before;
}

void SysLockLeave(RTS_UI32 before)
{
    __asm__ volatile("msr basepri, %0" ::"r"(before) : "memory");
}
