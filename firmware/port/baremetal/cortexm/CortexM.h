/*
 * CortexM.h - the part of the port that every Armv7-M controller shares, and what it asks of a board.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Gives SysTime (SysTick), SysTimer (task interrupts), SysExcept (faults, MPU guards), start-up and reset cause. A
 * board adds board.h (constants, see below), its vectors, and the Board* functions.
 *
 * Priorities, highest first: level 0 faults and SVC; level 1 clock, alarm and board interrupts (short, never foreign
 * code); from level 2 one level per timer, so that tasks pre-empt each other; thread mode: the communication loop.
 * Application code runs in thread mode at the level of its timer, without privileges (SysExcept.c).
 */
#ifndef CORTEXM_H
#define CORTEXM_H

#include "CmpStd.h"
#include "board.h"
#include "rts_config.h"

/*
 * board.h defines:
 *   BOARD_CLOCK_HZ       clock of core and SysTick, a multiple of 1000, at least 4 MHz
 *   BOARD_IRQ_COUNT      interrupt lines of the chip
 *   BOARD_PRIORITY_BITS  priority bits of the NVIC, 3 or more
 *   BOARD_TASK_IRQ       first of SYSTIMER_COUNT lines in a row that no peripheral in use drives: software triggers
 * them
 *   BOARD_VECTORS        initialisers [IRQ_VECTOR(n)] = {handler} for its peripherals, each followed by a comma
 */

/* Timers: one per task. */
enum { SYSTIMER_COUNT = APP_MAX_TASKS };

enum { LEVEL_FAULT = 0, LEVEL_DEVICE = 1, LEVEL_TIMER = 2 };

#define REG32(address) (*(volatile RTS_UI32 *)(uintptr_t)(address))

#define SYST_CSR REG32(0xE000E010u)
#define SYST_RVR REG32(0xE000E014u)
#define SYST_CVR REG32(0xE000E018u)
#define NVIC_ISER(n) REG32(0xE000E100u + 4u * (n))
#define NVIC_ICER(n) REG32(0xE000E180u + 4u * (n))
#define NVIC_ICPR(n) REG32(0xE000E280u + 4u * (n))
#define NVIC_IPR(n) (*(volatile RTS_UI8 *)(uintptr_t)(0xE000E400u + (n)))
#define NVIC_STIR REG32(0xE000EF00u) /* an IRQ written here becomes pending */
#define SCB_ICSR REG32(0xE000ED04u)
#define SCB_AIRCR REG32(0xE000ED0Cu)
#define SCB_CCR REG32(0xE000ED14u)
#define SCB_SHPR(n) (*(volatile RTS_UI8 *)(uintptr_t)(0xE000ED18u + (n) - 4u)) /* n: exception number */
#define SCB_SHCSR REG32(0xE000ED24u)
#define SCB_CFSR REG32(0xE000ED28u)
#define SCB_HFSR REG32(0xE000ED2Cu)
#define SCB_MMFAR REG32(0xE000ED34u)
#define SCB_CPACR REG32(0xE000ED88u)
#define FPU_FPCCR REG32(0xE000EF34u)
#define MPU_TYPE REG32(0xE000ED90u)
#define MPU_CTRL REG32(0xE000ED94u)
#define MPU_RBAR REG32(0xE000ED9Cu)
#define MPU_RASR REG32(0xE000EDA0u)
enum { MPU_RBAR_VALID = 1 << 4 };

enum { VECTOR_SVCALL = 11, VECTOR_SYSTICK = 15, VECTOR_IRQ = 16 };
#define IRQ_VECTOR(irq) (VECTOR_IRQ + (irq))

typedef union {
    void (*handler)(void);
    void *stack;
} VECTOR;

/* ---- interrupts ---- */

static inline RTS_UI8 CpuPriority(RTS_UI32 level)
{
    return (RTS_UI8)(level << (8 - BOARD_PRIORITY_BITS));
}

static inline void IrqEnable(RTS_UI32 irq, RTS_UI32 level)
{
    NVIC_IPR(irq) = CpuPriority(level);
    NVIC_ISER(irq / 32) = 1u << (irq % 32);
}

/* Masks all interrupts but faults; returns what CpuRestore needs. */
static inline RTS_UI32 CpuMask(void)
{
    RTS_UI32 primask;
    __asm__ volatile("mrs %0, primask\n\tcpsid i" : "=r"(primask)::"memory");
    return primask;
}

static inline void CpuRestore(RTS_UI32 primask)
{
    __asm__ volatile("msr primask, %0" ::"r"(primask) : "memory");
}

static inline RTS_UI32 CpuExceptionNumber(void)
{
    RTS_UI32 ipsr;
    __asm__ volatile("mrs %0, ipsr" : "=r"(ipsr));
    return ipsr;
}

static inline void CpuBarrier(void)
{
    __asm__ volatile("dsb\n\tisb" ::: "memory");
}

/* ---- memory protection ---- */

/* Attributes: access, and eighths of the region that are left out of it (bit 0 the lowest). */
enum { MPU_NO_ACCESS = 0, MPU_READ_ONLY = 6 << 24, MPU_WRITE_PRIVILEGED = 2 << 24, MPU_DATA = 1 << 28 | 3 << 24 };
#define MPU_WITHOUT_EIGHTHS(mask) ((RTS_UI32)((mask) & 0xFF) << 8)

/* Regions; a board may use what is left from MPU_BOARD up to 7 (higher ones win over lower ones). Unprivileged code has
 * no access where there is none. */
#if RTS_IEC_UNPRIVILEGED
enum { MPU_MEMORY, MPU_NULL, MPU_STACK, MPU_AREAS, MPU_IEC_STACK = MPU_AREAS + 2, MPU_BOARD };
#else
enum { MPU_NULL, MPU_STACK, MPU_IEC_STACK, MPU_BOARD = MPU_IEC_STACK + APP_MAX_TASKS };
#endif

/* Gives 2^log2_size bytes at `base`, a multiple of that size, these attributes; does nothing on a chip without MPU. */
void MpuProtect(RTS_UI32 region, uintptr_t base, RTS_UI32 log2_size, RTS_UI32 attributes);

/* ---- for boards ---- */

void ClockInit(void);

/* Calls back every millisecond, above all tasks. */
void ClockSetCallback(void (*callback)(RTS_I64 now_ns));

void SysTimerInit(void);
void SysExceptInit(void);

/* To be called by the board's alarm interrupt after it has silenced its timer. */
void SysTimerAlarm(void);

/* Whether no timer's call is overdue by more than a second, asked by main, which all of them interrupt. */
bool SysTimersWork(void);

/* At the end of each stack, protected by the MPU. */
enum { STACK_GUARD_LOG2 = 5, STACK_GUARD = 1 << STACK_GUARD_LOG2 };

/* ---- reset ---- */

typedef enum { RESET_POWER_ON, RESET_PIN, RESET_SOFTWARE, RESET_FATAL, RESET_WATCHDOG, RESET_CAUSE_COUNT } RESET_CAUSE;

/* Why the controller started, and for the last two where it was. In RAM that no start-up clears. */
typedef struct {
    RTS_UI32 magic;
    RTS_UI32 cause; /* RESET_CAUSE */
    RTS_UI32 pc;
    RTS_UI32 status; /* CFSR */
} RESET_RECORD;

void ResetInit(void);
const RESET_RECORD *ResetGet(void);

/* For BoardInit of a chip that has a register for it: why it was reset. The place in the record stays. */
void ResetSetCause(RESET_CAUSE cause);

/* Records the cause and resets the controller. Does not return. */
void ResetNow(RESET_CAUSE cause, RTS_UI32 pc) __attribute__((noreturn));

/* ---- what a board writes ---- */

/* Clocks, pins, peripherals. Interrupts are still masked. */
void BoardInit(void);

/* One call of SysTimerAlarm in `ns` (at most 10^9) from now, in place of the one asked for before; a little late is
 * fine, early too. With interrupts masked. */
void BoardAlarmSet(RTS_UI32 ns);

/* The hardware watchdog resets the controller unless the main loop kicks it more often than every `ms`. Never
 * stopped. */
void BoardWatchdogStart(RTS_UI32 ms);
void BoardWatchdogKick(void);

/* The lamp that shows whether the program runs (RunLamp.c, the full configuration); empty for a board without one. */
void BoardRunLamp(bool on);

/* Whether there is something for the main loop to do since the last call (received bytes), so that it does not sleep. */
bool BoardHasWork(void);

#endif
