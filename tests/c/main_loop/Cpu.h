/*
 * Cpu.h - the processor that test_main_loop.c is.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CPU_H
#define CPU_H

#define CPU_FAULT_STATUS "status"

static inline RTS_UI32 CpuMask(void)
{
    return 0;
}

static inline void CpuRestore(RTS_UI32 mask)
{
    (void)mask;
}

void CpuSleep(void);

#endif
