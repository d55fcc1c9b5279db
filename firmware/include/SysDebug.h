/*
 * SysDebug.h - traps in the code of the application, and the wait of a task that is halted.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * For CmpAppBP. A port that has it implements it beside SysExcept.c, which catches traps as it catches faults.
 */
#ifndef SYSDEBUG_H
#define SYSDEBUG_H

#include "CmpErrors.h"
#include "CmpStd.h"
#include "SysExcept.h"

/* Where IEC code stopped. */
typedef struct {
    RTS_UI32 code;     /* RTSEXCPT_BREAKPOINT: a trap; RTSEXCPT_NOEXCEPTION: the instruction of SYS_DEBUG_PASS was
                         * executed; else an exception, before it unwinds */
    uintptr_t address; /* of the trap, or of the exception */
    uintptr_t stack;   /* the stack pointer */
    uintptr_t end;     /* past the highest address of the stack */
    uintptr_t link;    /* the link register; 0 without one */
    const void *arg;   /* of the running SysExceptTry */
} SYS_DEBUG_STOP;

/* What IEC code does after it. */
typedef enum {
    SYS_DEBUG_LEAVE, /* it ends with the exception; of a trap with RTSEXCPT_ILLEGAL_INSTRUCTION */
    SYS_DEBUG_GO,    /* the instruction at the address is executed (again) */
    SYS_DEBUG_PASS,  /* the same, and the handler is called again after it */
    SYS_DEBUG_HALT, /* SYS_DEBUG_WAITS 0: SysExceptTry returns with SYS_DEBUG_HALTED; the code keeps registers and stack */
} SYS_DEBUG_ACTION;

/* Instructions, and traps, begin at multiples of this; SYS_DEBUG_LONGEST: bytes of the longest trap. */
#if defined(__x86_64__)
#define SYS_DEBUG_ALIGN 1
#define SYS_DEBUG_LONGEST 1
#elif defined(__aarch64__)
#define SYS_DEBUG_ALIGN 4
#define SYS_DEBUG_LONGEST 4
#elif defined(__arm__)
#define SYS_DEBUG_ALIGN 2
#define SYS_DEBUG_LONGEST 4
#else
#define SYS_DEBUG_ALIGN 2
#define SYS_DEBUG_LONGEST 2
#endif

/* RTS_EXCEPTION.code of a task that is halted, and SYS_DEBUG_STOP.code when it is to go on. */
#define SYS_DEBUG_HALTED 0xFFFFFFFFu

/* Called in the context of the task, from the handler of its trap or fault; may wait (SysDebugWait). */
typedef SYS_DEBUG_ACTION (*PF_SYS_DEBUG)(const SYS_DEBUG_STOP *stop);

/* False where the port has no traps: the functions below do nothing then. */
bool SysDebugCanTrap(void);

/* From now on `handler` gets traps and exceptions of IEC code; NULL: SysExcept.c treats all as exceptions. From main. */
void SysDebugSetHandler(PF_SYS_DEBUG handler);

/* Writes a trap over the instruction at an address of the application's code, and its bytes back. Other tasks may
 * execute the code at the same time. ERR_NO_ACCESS_RIGHTS: the system does not let code be written. From any context. */
RTS_RESULT SysDebugWriteTrap(uintptr_t address, RTS_UI32 *original);
void SysDebugRestore(uintptr_t address, RTS_UI32 original);
/* Bytes that a trap overwrites there, or has overwritten. */
RTS_UI32 SysDebugTrapSize(uintptr_t address);
/* True if the instruction there is a trap. */
bool SysDebugIsTrap(uintptr_t address);

#if !SYS_DEBUG_WAITS
/* SysExceptTry for the rest of what is halted, after the handler was asked again. From main, while tasks are held. */
bool SysDebugResume(RTS_EXCEPTION *exception);
#endif

/* False in main, which serves the debugger. */
bool SysDebugMayWait(void);
/* Main is the context that calls it. */
void SysDebugIsMain(void);

/* Returns at the latest when *word differs from `value` and SysDebugWake was called; also without reason. */
void SysDebugWait(const RTS_UI32 *word, RTS_UI32 value);
void SysDebugWake(RTS_UI32 *word);

#endif
