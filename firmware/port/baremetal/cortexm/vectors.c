/*
 * vectors.c - the vectors, and what they need: priorities and faults of the core.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"

enum { CCR_NONBASETHRDENA = 1 << 0, CCR_DIV_0_TRP = 1 << 4, CCR_STKALIGN = 1 << 9 };
enum { SHCSR_MEM_BUS_USAGE = 7 << 16 };

/* Of the linker script. */
extern RTS_UI8 stack_top[];

/* Every timer's interrupt; the number of the running exception says which. */
static void TimerIrq(void)
{
    SysTimerRun(CpuExceptionNumber() - VECTOR_IRQ - BOARD_TASK_IRQ);
}

void NmiHandler(void);
void FaultHandler(void);
void SvcHandler(void);
void SysTickHandler(void);

#define TIMER_VECTOR(n) [IRQ_VECTOR(BOARD_TASK_IRQ + (n))] = {TimerIrq}

/* An unexpected interrupt has no handler, which is a fault of the runtime. */
__attribute__((section(".vectors"), used)) static const VECTOR vectors[VECTOR_IRQ + BOARD_IRQ_COUNT] = {
    [0] = {.stack = stack_top},
    [1] = {ResetHandler},
    [2] = {NmiHandler},
    [3] = {FaultHandler}, /* HardFault, MemManage, BusFault, UsageFault */
    [4] = {FaultHandler},
    [5] = {FaultHandler},
    [6] = {FaultHandler},
    [VECTOR_SVCALL] = {SvcHandler},
    [VECTOR_SYSTICK] = {SysTickHandler},
    BOARD_VECTORS TIMER_VECTOR(0),
#if APP_MAX_TASKS > 1
    TIMER_VECTOR(1),
#endif
#if APP_MAX_TASKS > 2
    TIMER_VECTOR(2),
#endif
#if APP_MAX_TASKS > 3
    TIMER_VECTOR(3),
#endif
#if APP_MAX_TASKS > 4
    TIMER_VECTOR(4),
#endif
};
RTS_STATIC_ASSERT(SYSTIMER_COUNT <= 5, add_timer_vectors_above);
RTS_STATIC_ASSERT(LEVEL_TIMER + SYSTIMER_COUNT <= 1 << BOARD_PRIORITY_BITS, one_priority_level_per_timer);
RTS_STATIC_ASSERT(BOARD_TASK_IRQ + SYSTIMER_COUNT <= BOARD_IRQ_COUNT, enough_lines_for_timers);

void CpuInit(void)
{
#ifdef __ARM_FP
    SCB_CPACR |= 0xFu << 20; /* lazy stacking of the FPU context is the reset state */
    CpuBarrier();
#endif
    SCB_CCR |= CCR_NONBASETHRDENA | CCR_DIV_0_TRP | CCR_STKALIGN;
    SCB_SHCSR |= SHCSR_MEM_BUS_USAGE;
    for (RTS_UI32 vector = 4; vector <= VECTOR_SVCALL; vector++)
        SCB_SHPR(vector) = CpuPriority(LEVEL_FAULT);
    SCB_SHPR(VECTOR_SYSTICK) = CpuPriority(LEVEL_DEVICE);
}
