/*
 * TryRights.c - what the MPU lets a program read and write.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Try.h"

/* A task that interrupts it moves a region too. */
RTS_NOINLINE void MpuProtect(RTS_UI32 region, uintptr_t base, RTS_UI32 log2_size, RTS_UI32 attributes)
{
    enum { RASR_ENABLE = 1, RASR_NORMAL_MEMORY = 3 << 16 };
    if (region >= ((MPU_TYPE >> 8) & 0xFFu))
        return;
    RTS_UI32 mask = RTS_IEC_UNPRIVILEGED ? CpuMask() : 0;
    MPU_RBAR = base | MPU_RBAR_VALID | region;
    MPU_RASR = attributes | RASR_NORMAL_MEMORY | (log2_size - 1) << 1 | RASR_ENABLE;
    CpuBarrier();
    if (RTS_IEC_UNPRIVILEGED)
        CpuRestore(mask);
}

#if RTS_IEC_UNPRIVILEGED

/* Eighths of the first GiB without memory. Where they read as zeros, a wild jump would execute all of them. */
#ifndef BOARD_MEMORY_HOLES
#define BOARD_MEMORY_HOLES 0
#endif

/* Of the linker script. Where the areas begin and end is a multiple of an eighth of their size, rounded up to a power
 * of 2 (APP_AREAS_ALIGNED): so two regions of that size next to each other hold them. */
extern RTS_UI8 areas_start[], areas_end[];

static void allow_areas(void)
{
    uintptr_t start = (uintptr_t)areas_start;
    RTS_UI32 size = (RTS_UI32)(areas_end - areas_start);
    RTS_UI32 log2 = 32u - (RTS_UI32)__builtin_clz((size - 1) | 0xFF);
    uintptr_t region = start >> log2;
    RTS_UI32 others = ~(((1u << (size >> (log2 - 3))) - 1) << (start >> (log2 - 3) & 7));
    for (RTS_UI32 i = 0; i < 2; i++, others >>= 8)
        MpuProtect(MPU_AREAS + i, (region + i) << log2, log2, MPU_DATA | MPU_WITHOUT_EIGHTHS(others));
}

void TryProtectRuntime(uintptr_t stack)
{
    enum { CODE_AND_RAM_LOG2 = 30, STACK_LOG2 = RTS_LOG2(RTS_IEC_STACK_SIZE) };
    MpuProtect(MPU_MEMORY, 0, CODE_AND_RAM_LOG2, MPU_WRITE_PRIVILEGED | MPU_WITHOUT_EIGHTHS(BOARD_MEMORY_HOLES));
    MpuProtect(MPU_IEC_STACK, stack, STACK_LOG2, MPU_DATA);
    allow_areas();
}

/* The region's size stays. */
void TryAllowStack(uintptr_t slot)
{
    MPU_RBAR = slot | MPU_RBAR_VALID | MPU_IEC_STACK;
}

static RTS_UI32 get_control(void)
{
    RTS_UI32 control;
    __asm__ volatile("mrs %0, control" : "=r"(control));
    return control;
}

void TrySetControl(RTS_UI32 control)
{
    __asm__ volatile("msr control, %0" ::"r"(control) : "memory");
}

void TryTakeRights(TRY *try)
{
    try->outer_control = get_control();
    try->gate = 0;
    TrySetControl(CONTROL_NPRIV);
    TryAllowStack(TryStackSlot(try));
}

/* FPU registers of the function that is left may still wait to be saved on its stack, with its rights. Another interrupt
 * may come before the exception return that gives them up: it would save them where these rights do not reach any more.
 * Those that wait for privileged code are of the frame that is returned to. */
void TryDropFpuContext(void)
{
#ifdef __ARM_FP
    enum { FPCCR_LSPACT = 1, FPCCR_USER = 2 };
    RTS_UI32 control = FPU_FPCCR;
    if ((control & (FPCCR_LSPACT | FPCCR_USER)) == (FPCCR_LSPACT | FPCCR_USER))
        FPU_FPCCR = control & ~(RTS_UI32)FPCCR_LSPACT;
#endif
}

/* The slot of the depth below is above; of main, which has all rights, none does, but no task runs then. */
void TryGiveBackRights(const TRY *try)
{
    TryDropFpuContext();
    TrySetControl(try->outer_control);
    TryAllowStack((uintptr_t)(try->first + 1));
}

#endif
