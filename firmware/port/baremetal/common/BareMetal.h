/*
 * BareMetal.h - what controllers of all processor families share, and what it asks of a family and of a board.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * This directory has start-up, main loop, timers, reset cause, compiler calls. A family (cortexm/, riscv/) adds the clock,
 * the interrupts of tasks, exceptions, the lock, and Cpu.h; a board adds board.h and the Board* functions.
 *
 * Priorities, highest first: level 0 faults; level 1 clock, alarm and board interrupts (short, never foreign code); from
 * level 2 one level per timer, so that tasks pre-empt each other; then main: the communication loop. Application code
 * runs at the level of its timer, on a stack of its own, without privileges (SysExcept.c of the family).
 */
#ifndef BAREMETAL_H
#define BAREMETAL_H

#include "CmpStd.h"
#include "board.h"
#include "rts_config.h"

/* Timers: one per task. */
enum { SYSTIMER_COUNT = APP_MAX_TASKS };

enum { LEVEL_FAULT = 0, LEVEL_DEVICE = 1, LEVEL_TIMER = 2 };

/* At the end of a stack, protected. RTS_MAIN_STACK_SIZE is with one of the least size. */
#ifndef BOARD_STACK_GUARD_LOG2
#define BOARD_STACK_GUARD_LOG2 5
#endif
enum { STACK_GUARD_LEAST = 32, STACK_GUARD_LOG2 = BOARD_STACK_GUARD_LOG2, STACK_GUARD = 1 << STACK_GUARD_LOG2 };

#define REG32(address) (*(volatile RTS_UI32 *)(uintptr_t)(address))

/*
 * A family defines, inline where it is short:
 *   CpuMask, CpuRestore      masks all interrupts but faults, and undoes it; 0 is for CpuRestore "not masked"
 *   CpuBarrier               all stores have arrived, and what they changed is fetched again
 *   CpuSleep                 until an interrupt is pending, also a masked one
 *   CpuNoise                 a number that changes with each instruction
 *   CpuInit                  vectors, faults; at start-up, when variables have their values
 *   CpuReset                 resets the controller; may return before it happens
 *   CpuFaultStatus           what the processor says of the last fault; CPU_FAULT_STATUS is its name
 *   CPU_CONTEXTS_SIZE        bytes of main stack beyond RTS_MAIN_STACK_SIZE
 *   CpuTaskEnable            a timer's interrupt is possible from now on, at a level
 *   CpuTaskSetLevel          and at another one; no task runs
 *   CpuTaskTrigger           makes it pending; while it is active, it comes again
 *   CpuTaskForget            makes it not pending
 */
#include "Cpu.h"

/* ---- for families and boards ---- */

void ClockInit(void);

/* Calls back every millisecond, above all tasks. */
void ClockSetCallback(void (*callback)(RTS_I64 now_ns));

/* For a board whose processor stands still at times, as while it erases the flash it runs from: `ms` ticks were missed. With
 * interrupts masked. Cortex-M only: RISC-V has a counter that goes on. */
void ClockSkip(RTS_UI32 ms);

void SysTimerInit(void);
void SysExceptInit(void);

/* To be called by the alarm interrupt after it has silenced its timer. */
void SysTimerAlarm(void);

/* The interrupt of a timer. */
void SysTimerRun(RTS_UI32 timer);

/* Whether no timer's call is overdue by more than a second, asked by main, which all of them interrupt. */
bool SysTimersWork(void);

/* The beginning: a family jumps here, on the main stack and with interrupts masked. */
void ResetHandler(void);

/* ---- reset ---- */

typedef enum {
    RESET_POWER_ON,
    RESET_PIN,
    RESET_SOFTWARE,
    RESET_START, /* the start-up failed (CM_LEAVES_OUT); says nothing against the program */
    RESET_FATAL,
    RESET_WATCHDOG,
    RESET_CAUSE_COUNT
} RESET_CAUSE;

/* Why the controller started, and for the last two where it was, for RESET_START which component failed. In RAM that no start-up clears. */
typedef struct {
    RTS_UI32 magic;
    RTS_UI32 cause; /* RESET_CAUSE */
    RTS_UI32 pc;
    RTS_UI32 status; /* CpuFaultStatus */
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
 * fine, early too. With interrupts masked. On RISC-V the family has it. */
void BoardAlarmSet(RTS_UI32 ns);

/* board.h: 1 where masked interrupts keep the watchdog away. */
#ifndef BOARD_WATCHDOG_IS_MASKED
#define BOARD_WATCHDOG_IS_MASKED 0
#endif

/* The hardware watchdog resets the controller unless the main loop kicks it more often than every `ms`. Started once,
 * before CMInit, never stopped. One that cannot wait so long: docs/porting.md, step 8. */
void BoardWatchdogStart(RTS_UI32 ms);
void BoardWatchdogKick(void);

/* The lamp that shows whether the program runs (RunLamp.c, the full configuration); empty for a board without one. */
void BoardRunLamp(bool on);

/* Whether interrupts have brought the main loop something to do since the last call (received bytes, room to send):
 * else it sleeps until the next interrupt. With interrupts masked, so that none comes between answer and sleep.
 * OneUart.c has it for a board with one serial line. */
bool BoardHasWork(void);

#endif
