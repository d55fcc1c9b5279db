/*
 * SysExcept.h - exceptions of IEC code: numbers (shared with the host) and the port's way to catch them.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A port turns hardware faults (signals, fault handlers), checked errors (SysExceptRaise) and the watchdog's abort
 * (SysExceptBreak) into one return from SysExceptTry. Numbers: codesys-v3-protocol 5.8.
 */
#ifndef SYSEXCEPT_H
#define SYSEXCEPT_H

#include "CmpStd.h"
#include "rts_config.h"

enum {
    RTSEXCPT_NOEXCEPTION = 0x0000,
    RTSEXCPT_WATCHDOG = 0x0010,
    RTSEXCPT_HARDWAREWATCHDOG = 0x0011,
    RTSEXCPT_IO_CONFIG_ERROR = 0x0012,
    RTSEXCPT_PROGRAMCHECKSUM = 0x0013,
    RTSEXCPT_FIELDBUS_ERROR = 0x0014,
    RTSEXCPT_IOUPDATE_ERROR = 0x0015,
    RTSEXCPT_CYCLE_TIME_EXCEED = 0x0016,
    RTSEXCPT_ONLCHANGE_PROGRAM_EXCEEDED = 0x0017,
    RTSEXCPT_UNRESOLVED_EXTREFS = 0x0018,
    RTSEXCPT_DOWNLOAD_REJECTED = 0x0019,
    RTSEXCPT_BOOTPROJECT_REJECTED_DUE_RETAIN_ERROR = 0x001A,
    RTSEXCPT_LOADBOOTPROJECT_FAILED = 0x001B,
    RTSEXCPT_OUT_OF_MEMORY = 0x001C,
    RTSEXCPT_RETAIN_MEMORY_ERROR = 0x001D,
    RTSEXCPT_BOOTPROJECT_CRASH = 0x001E,
    RTSEXCPT_BOOTPROJECTTARGETMISMATCH = 0x0021,
    RTSEXCPT_SCHEDULEERROR = 0x0022,
    RTSEXCPT_FILE_CHECKSUM_ERR = 0x0023,
    RTSEXCPT_RETAIN_IDENTITY_MISMATCH = 0x0024,
    RTSEXCPT_IEC_TASK_CONFIG_ERROR = 0x0025,
    RTSEXCPT_APP_TARGET_MISMATCH = 0x0026,
    RTSEXCPT_ILLEGAL_INSTRUCTION = 0x0050,
    RTSEXCPT_ACCESS_VIOLATION = 0x0051,
    RTSEXCPT_PRIV_INSTRUCTION = 0x0052,
    RTSEXCPT_IN_PAGE_ERROR = 0x0053,
    RTSEXCPT_STACK_OVERFLOW = 0x0054,
    RTSEXCPT_INVALID_DISPOSITION = 0x0055,
    RTSEXCPT_INVALID_HANDLE = 0x0056,
    RTSEXCPT_GUARD_PAGE = 0x0057,
    RTSEXCPT_DOUBLE_FAULT = 0x0058,
    RTSEXCPT_INVALID_OPCODE = 0x0059,
    RTSEXCPT_MISALIGNMENT = 0x0100,
    RTSEXCPT_ARRAYBOUNDS = 0x0101,
    RTSEXCPT_DIVIDEBYZERO = 0x0102,
    RTSEXCPT_OVERFLOW = 0x0103,
    RTSEXCPT_NONCONTINUABLE = 0x0104,
    RTSEXCPT_PROCESSORLOAD_WATCHDOG = 0x0105,
    RTSEXCPT_FPU_ERROR = 0x0150,
    RTSEXCPT_FPU_DENORMAL_OPERAND = 0x0151,
    RTSEXCPT_FPU_DIVIDEBYZERO = 0x0152,
    RTSEXCPT_FPU_INEXACT_RESULT = 0x0153,
    RTSEXCPT_FPU_INVALID_OPERATION = 0x0154,
    RTSEXCPT_FPU_OVERFLOW = 0x0155,
    RTSEXCPT_FPU_STACK_CHECK = 0x0156,
    RTSEXCPT_FPU_UNDERFLOW = 0x0157,
    RTSEXCPT_BREAKPOINT = 0x0200,
    RTSEXCPT_MASK = 0x0FFF,
    RTSEXCPT_LICENSE_INVALID = 0x100D0001,
    RTSEXCPT_WATCHDOG_OMITTED_CYCLE = 0x1000,
    RTSEXCPT_VENDOR_EXCEPTION_BASE = 0x2000,
    RTSEXCPT_STOP_TIMEOUT = 0x2001, /* was in its cycle for too long after a stop, and was aborted */
};

typedef struct {
    RTS_UI32 code;     /* RTSEXCPT_*, RTSEXCPT_NOEXCEPTION when the function returned normally */
    uintptr_t address; /* program counter at the fault; for checked errors that of the call that raised it */
} RTS_EXCEPTION;

#if EXCEPT_MAX_CALLS > 0
/* A word that may be a return address: `target`, an offset in the application's code, was found `distance` bytes above
 * the stack pointer of the exception, or in the link register of processors that have one. */
enum { EXCEPT_LINK = 0xFFFFFF };
typedef struct {
    RTS_UI32 target;
    RTS_UI32 distance; /* EXCEPT_LINK: the link register */
} EXCEPT_CALL;

typedef struct {
    uintptr_t address; /* that of the exception */
    RTS_UI32 count;
    EXCEPT_CALL call[EXCEPT_MAX_CALLS];
} EXCEPT_TRACE;

/* What is known of the exception that stopped the application. From main. */
const EXCEPT_TRACE *SysExceptGetTrace(void);
#endif

/* Which registers the processor has, and their order. The host has the names (debug/registers.py). */
enum {
    EXCEPT_REGISTERS_ARMV7M = 1,  /* r0 .. r12, sp, lr, pc, xpsr, cfsr, fault address */
    EXCEPT_REGISTERS_RISCV32 = 2, /* ra, sp, t0 .. t6, a0 .. a7, s0 .. s11, pc, mcause, mtval */
    EXCEPT_REGISTERS_X86_64 = 3,  /* rax, rbx, rcx, rdx, rsi, rdi, rbp, rsp, r8 .. r15, rip, eflags, fault address */
    EXCEPT_REGISTERS_AARCH64 = 4, /* x0 .. x30, sp, pc, pstate, fault address */
    EXCEPT_REGISTERS_ARM = 5,     /* r0 .. r12, sp, lr, pc, cpsr, fault address */
};

#if EXCEPT_REGISTERS > 0
typedef struct {
    RTS_UI32 kind; /* EXCEPT_REGISTERS_*; 0: not known, as of an error that the program or the runtime found */
    uintptr_t value[EXCEPT_REGISTERS];
} EXCEPT_FRAME;

/* The registers at the fault that stopped the application. From main. */
const EXCEPT_FRAME *SysExceptGetRegisters(void);
#endif

#ifndef RTS_CFFI

/*
 * Runs fn(arg) and catches what goes wrong in it. Not nested. Called by CmpIecTask in the context of a task (timer
 * interrupt or thread) and by CmpAppEmbedded from main for the init code.
 *
 * Returns true when fn returned; false when it was left by an exception, which is in *exception then. After an exception
 * no lock is held that was taken within fn, because IEC code takes none.
 */
bool SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception);

/* Leaves the running SysExceptTry of this context with RTSEXCPT_* `code`. `address`: where the error was seen; `stack`:
 * the stack pointer there. Does not return. Outside a SysExceptTry it is a fatal error of the runtime. */
void SysExceptRaise(RTS_UI32 code, uintptr_t address, const void *stack);

/*
 * Leaves the SysExceptTry that was called with `arg` and runs in another context, with RTSEXCPT_* `code`. Called by the
 * watchdog, from above that context, and again as long as it runs. Does nothing when none with that `arg` runs.
 */
void SysExceptBreak(const void *arg, RTS_UI32 code);

/* Processor time that the context has used so far which runs SysExceptTry with `arg` [ns]; -1 when none does. Only
 * differences count. Called by the watchdog of ports with SCHED_PROCESSOR_TIME. */
RTS_I64 SysExceptGetUsedNs(const void *arg);

/* Gives back what catching took from the process (signal handlers); the next SysExceptTry takes it again. From main,
 * when no SysExceptTry runs. Empty on bare metal. */
void SysExceptShutdown(void);

/* ---- SysExceptTrace.c, for all ports ---- */

/* Where the code of the application is; size 0: there is none. From main, while no IEC code runs. */
void SysExceptCodeRange(const RTS_UI8 *start, RTS_UI32 size);
bool SysExceptIsCode(uintptr_t address);
/* The offset in it of an address for which SysExceptIsCode or SysExceptIsReturn is true. */
RTS_UI32 SysExceptCodeOffset(uintptr_t address);

/* Whether a word may be an address that a call in the application's code returns to. */
bool SysExceptIsReturn(uintptr_t word);

#if EXCEPT_MAX_CALLS > 0
/*
 * Notes which calls may have led to the exception at `address`. A port calls it before it leaves SysExceptTry, in the
 * context of the exception: interrupt, fault or signal handler. `stack` .. `end`: what the stack holds of the code that
 * ran, from the stack pointer on; empty when it cannot be read. `link`: the link register, 0 without. The first
 * exception counts, until it is forgotten.
 */
void SysExceptTrace(uintptr_t address, const uintptr_t *stack, const uintptr_t *end, uintptr_t link);

/* Forgets what was noted, the first one when it is not of the exception at `address`, which may be 0: a call by a
 * pointer that is NULL. From main, while no IEC code runs. */
void SysExceptKeepTrace(uintptr_t address);
void SysExceptForgetTrace(void);
#else
#define SysExceptTrace(address, stack, end, link) ((void)(address), (void)(stack), (void)(end), (void)(link))
#define SysExceptKeepTrace(address) ((void)(address))
#define SysExceptForgetTrace() ((void)0)
#endif

#if EXCEPT_REGISTERS > 0
/* Notes the registers of the fault for which SysExceptTrace is called next, with the same stack. In its context. */
void SysExceptNoteRegisters(const uintptr_t *stack, RTS_UI32 kind, const uintptr_t values[EXCEPT_REGISTERS]);
#endif

#endif
#endif
