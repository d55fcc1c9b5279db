/*
 * startup.c - from reset to main: vectors, memory, core settings.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CortexM.h"
#include "SysTarget.h"

enum { CCR_NONBASETHRDENA = 1 << 0, CCR_DIV_0_TRP = 1 << 4, CCR_STKALIGN = 1 << 9 };
enum { SHCSR_MEM_BUS_USAGE = 7 << 16 };

enum { STACK_PAINT = 0x5A };

/* Of the linker script. */
extern RTS_UI8 data_start[], data_end[], data_load[], bss_start[], bss_end[], stack_bottom[], stack_top[];

/* What an FPU adds to the main stack: main and each task that is interrupted leave a context of 64 bytes that
 * SysExceptTry saves and 72 that the processor does. */
#ifdef __ARM_FP
enum { FPU_CONTEXTS_SIZE = (APP_MAX_TASKS + 1) * (64 + 72) };
#else
enum { FPU_CONTEXTS_SIZE = 0 };
#endif

/* Of main, and of everything that interrupts it but application code. */
__attribute__((section(".noinit.main_stack"), aligned(32),
               used)) static RTS_UI8 main_stack[RTS_MAIN_STACK_SIZE + FPU_CONTEXTS_SIZE];

int main(void);
void ResetHandler(void);
void NmiHandler(void);
void FaultHandler(void);
void SvcHandler(void);
void SysTickHandler(void);
void TimerIrq(void);

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

static void init_core(void)
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

SYS_STACK SysTargetGetStack(void)
{
    SYS_STACK stack = {sizeof(main_stack) - STACK_GUARD, 0};
    while (main_stack[STACK_GUARD + stack.unused] == STACK_PAINT)
        stack.unused++;
    return stack;
}

void ResetHandler(void)
{
    CpuMask();
    memcpy(data_start, data_load, (size_t)(data_end - data_start));
    memset(bss_start, 0, (size_t)(bss_end - bss_start));
    memset(stack_bottom, STACK_PAINT, (size_t)((RTS_UI8 *)__builtin_frame_address(0) - stack_bottom) - 64);
    init_core();
    ResetInit();
    SysExceptInit();
    ClockInit();
    SysTimerInit();
    BoardInit();
    CpuRestore(0);
    main();
    ResetNow(RESET_SOFTWARE, 0);
}
