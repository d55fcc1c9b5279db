/*
 * Try.h - what runs in SysExceptTry on Armv7-M: its stack, its rights, and how it is left.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * SysExceptTry is called in handler mode (a timer's interrupt) or in main, both on the main stack. It enters the
 * function by SVC in *thread mode on the process stack*, at the priority of the interrupt it came from
 * (CCR.NONBASETHRDENA), and leaves it by another SVC. So whatever goes wrong in it, the frames of faults and interrupts
 * that need to be trusted are on the main stack, and leaving is the same exception return for a normal end, a checked
 * error, a fault, and an aborted loop:
 *
 *   main stack:    ... interrupt | SysExceptTry | frame of the SVC that entered      <- leaving returns to it
 *   process stack: slot of this nesting depth
 *
 * Nested only by pre-emption, last in first out: depth d is interrupted while depth d + 1 runs.
 *
 * Rights (RTS_IEC_UNPRIVILEGED). What runs in a Try is unprivileged. To such code the MPU gives
 *   code and RAM of the architecture (below 1 GiB)  read, execute; writing them takes privileges; without what the
 *                                                   board names as holes
 *   vectors, where NULL points                      nothing, as to all else
 *   areas of the application (AppAreas.c)           read, write
 *   stack slot of the depth that runs               read, write
 * and nothing else: peripherals, the processor's own registers. So a wild store ends in an exception that names
 * it, and has changed nothing but the program's own data. Entering and leaving a Try move one region, that of the
 * stack, and set CONTROL.nPRIV, which is the privilege of thread mode; handlers are always privileged.
 *
 * C functions that a program calls run in the Try, too, with its rights: arithmetic and mathematics as they are. What
 * writes variables of its own, or needs hardware, has a gate (APP_GATE, 8 bytes): an SVC in the section of gates, and a
 * jump to the function. An SVC anywhere else gives no privileges, so a program gets them only by calling such a
 * function. It runs on the program's stack, and returns through gate_return, which gives the privileges up. That the
 * program called it is the only thing kept of it (TRY.gate): tasks interrupt it, faults and breaks leave it as ever.
 *
 * Otherwise all code is privileged, and each slot has a guard of the MPU at its lower end.
 */
#ifndef TRY_H
#define TRY_H

#include "BareMetal.h"
#include "SysExcept.h"
#include "SysExceptCatch.h"
#include "rts_config.h"

enum { EXC_RETURN_THREAD_PSP = (int)0xFFFFFFFD, EXC_RETURN_PSP = 4, EXC_RETURN_BASIC = 16 };
enum { XPSR_THUMB = 1 << 24, XPSR_ALIGNED = 1 << 9 };
enum { CONTROL_NPRIV = 1, CONTROL_SPSEL = 2 };

/* Bits of CFSR, the fault status register. */
enum {
    CFSR_IACCVIOL = 1 << 0,
    CFSR_STACKING = 0x30 | 0x3000, /* MSTKERR, MLSPERR, STKERR, LSPERR */
    CFSR_MMARVALID = 1 << 7,
    CFSR_IBUSERR = 1 << 8,
    CFSR_ILLEGAL = 0xF << 16, /* UNDEFINSTR, INVSTATE, INVPC, NOCP */
    CFSR_INVSTATE = 1 << 17,
    CFSR_UNALIGNED = 1 << 24,
    CFSR_DIVBYZERO = 1 << 25,
};

/* The registers that an exception entry pushes; those of the FPU may follow. */
typedef struct {
    RTS_UI32 r0, r1, r2, r3, r12, lr, pc, xpsr;
} FRAME;

typedef struct {
    FRAME *first;         /* on the process stack, at the upper end of the slot of this depth; never changes */
    FRAME *entered;       /* on the main stack */
    FRAME *outer_process; /* process stack pointer of the depth below */
    RTS_UI32 exc_return;
#if RTS_IEC_UNPRIVILEGED
    RTS_UI32 outer_control; /* of the depth below, or of main */
    RTS_UI32 gate;          /* where a function that has a gate returns to; 0: none runs */
#endif
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    RTS_TRY *outer_tries;
#endif
} TRY;

typedef RTS_UI8 IEC_STACK[RTS_IEC_STACK_SIZE];
RTS_STATIC_ASSERT(RTS_IEC_STACK_SIZE % 32 == 0 && RTS_IEC_STACK_SIZE >= 256, iec_stack_holds_guard_and_frame);

#if RTS_IEC_UNPRIVILEGED
RTS_STATIC_ASSERT((RTS_IEC_STACK_SIZE & (RTS_IEC_STACK_SIZE - 1)) == 0, iec_stack_is_a_region);
enum { IEC_STACK_ALIGN = RTS_IEC_STACK_SIZE };
#else
RTS_STATIC_ASSERT(RTS_IEC_STACK_GUARD == STACK_GUARD, what_is_lost_to_the_guard_is_known);
enum { IEC_STACK_ALIGN = STACK_GUARD };
#endif
enum { IEC_STACK_GUARD = RTS_IEC_STACK_GUARD };

typedef struct {
    TRY *top; /* past the innermost that runs */
    TRY tries[APP_MAX_TASKS];
#if RTS_STRUCTURED_EXCEPTION_HANDLING
    RTS_TRY *newest; /* of rts_try, in all contexts: they nest as interrupts do */
#endif
} TRY_STATE;

extern TRY_STATE TryState;

static inline FRAME *TryProcessStack(void)
{
    FRAME *pointer;
    __asm__ volatile("mrs %0, psp" : "=r"(pointer));
    return pointer;
}

static inline void TrySetProcessStack(FRAME *pointer)
{
    __asm__ volatile("msr psp, %0" ::"r"(pointer) : "memory");
}

static inline bool TryRuns(void)
{
    RTS_UI32 control;
    __asm__ volatile("mrs %0, control" : "=r"(control));
    return (control & CONTROL_SPSEL) != 0;
}

static inline uintptr_t TryStackSlot(const TRY *try)
{
    return (uintptr_t)(try->first + 1) - RTS_IEC_STACK_SIZE;
}

/* The lowest address of the stack of this Try. */
static inline uintptr_t TryStackEnd(const TRY *try)
{
    return TryStackSlot(try) + IEC_STACK_GUARD;
}

/* Gives each depth its stack, and rights to what runs there. */
void TryInit(void);

/* Leaves the running Try, from a handler. Returns the EXC_RETURN to return with. */
RTS_UI32 TryLeave(RTS_UI32 code, RTS_UI32 address, uintptr_t stack, uintptr_t link);

/* Leaves it from what runs in it. */
void TryRaise(RTS_UI32 code, uintptr_t address, const void *stack, uintptr_t link) __attribute__((noreturn));

/* The stack pointer before the exception pushed its frame, with or without the FPU's registers; for the trace alone. */
uintptr_t TryStackBefore(const FRAME *frame, RTS_UI32 exc_return);

/* ---- rights, TryRights.c ---- */

#if RTS_IEC_UNPRIVILEGED
void TryProtectRuntime(uintptr_t stack);
void TryTakeRights(TRY *try);
void TryGiveBackRights(const TRY *try);

/* Gives the program the stack at this address instead of the previous one. Seen after the exception return that follows. */
void TryAllowStack(uintptr_t slot);

/* Gives up FPU registers of the function that is left. */
void TryDropFpuContext(void);

/* In a handler, for thread mode: nothing in it but nPRIV is of effect. */
void TrySetControl(RTS_UI32 control);
#else
#define TryProtectRuntime(stack) ((void)0)
#define TryTakeRights(try) ((void)(try))
#define TryGiveBackRights(try) ((void)(try))
#endif

/* ---- rts_try, TryCatch.c ---- */

#if RTS_STRUCTURED_EXCEPTION_HANDLING
/* Returns the EXC_RETURN that leads to the rts_catch of a fault in a Try, 0 if none catches it. Exceptions in code of the
 * program are not caught here. */
RTS_UI32 TryCatchFault(RTS_UI32 code, uintptr_t address, const FRAME *frame, RTS_UI32 exc_return);

/* The frame that leads to the rts_catch of `found`, for a return to the exception `number`, 0: to main or to a Try. */
FRAME *TryFrameTo(const RTS_TRY *found, RTS_UI32 number, RTS_UI32 exc_return);

/* Goes to the rts_catch of an exception that is raised; returns if there is none. */
void TryCatchRaised(RTS_UI32 code, uintptr_t address, const void *stack);
#else
#define TryCatchFault(code, address, frame, exc_return) 0
#define TryCatchRaised(code, address, stack) ((void)0)
#endif

/* ---- the debugger, TryDebug.c ---- */

enum { TRY_SAVED = 8 }; /* registers r4 to r11, which FaultHandler saves and loads again */

#if BP_MAX > 0
/* Notes the status of the fault that is handled now. */
void TryNoteFault(RTS_UI32 cfsr);

/* Keeps the registers of the fault that TryLeave is called for next. */
#if EXCEPT_REGISTERS > 0
void TryNoteRegisters(const FRAME *frame, RTS_UI32 exc_return, const RTS_UI32 *saved);
#else
#define TryNoteRegisters(frame, exc_return, saved) ((void)0)
#endif

/* Offers a fault to the debugger. Returns the EXC_RETURN by which the program goes on; 0: the fault leaves the Try. */
RTS_UI32 TryDebugFault(FRAME *frame, RTS_UI32 exc_return, RTS_UI32 *saved, RTS_UI32 code);

/* Hands an exception that is raised to a debugger; returns if there is none. */
void TryDebugRaised(RTS_UI32 code, uintptr_t address, const void *stack);
#else
#define TryNoteFault(cfsr) ((void)0)
#define TryNoteRegisters(frame, exc_return, saved) ((void)0)
#define TryDebugFault(frame, exc_return, saved, code) ((void)(saved), 0)
#define TryDebugRaised(code, address, stack) ((void)0)
#endif

#endif
