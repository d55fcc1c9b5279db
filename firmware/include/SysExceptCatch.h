/*
 * SysExceptCatch.h - rts_try, rts_catch and rts_finally: a component in C catches its own faults. Manual 3.13.1.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 *   rts_try {
 *       volatile_result = read_the_device();
 *   }
 *   rts_catch {
 *       LogAdd(CMPID_CmpFoo, LOG_ERROR, ERR_FAILED, "Device: exception %x", (unsigned)EXCPT_GET_CODE());
 *   }
 *   rts_finally {    optional; not run after return, break or goto out of the blocks
 *       release();
 *   }
 *   rts_try_end
 *
 * Where it catches: in main (hooks, services, events), in the phases of a cycle, in functions that a program calls; those
 * with a gate (APP_GATE) where programs have few rights. They nest; an exception in rts_catch is one of the code around.
 * What it catches: faults of C code, and SysExceptRaise. What it leaves alone: the abort of a watchdog, exceptions in
 * code of the program that C code called (the task is left as ever), and interrupts of devices on RISC-V.
 *
 * Variables that the block changes and rts_catch reads are volatile, as with setjmp. A lock that the block took stays
 * taken on Linux; boards enable interrupts again: fault outside of SysLockEnter .. SysLockLeave.
 *
 * Where RTS_STRUCTURED_EXCEPTION_HANDLING is 0 the block runs, nothing is caught, and SysExceptRegisterJmpBuf returns
 * ERR_NOT_SUPPORTED: minimal, standard and configurations between, the LM3S6965 board, ports of your own until they have
 * SysExceptTries, the simulator on Windows and macOS.
 */
#ifndef SYSEXCEPTCATCH_H
#define SYSEXCEPTCATCH_H

#include "CmpErrors.h"
#include "CmpStd.h"
#include "rts_config.h"

/* The processor at the exception. BP: 0, not known. */
typedef struct {
    uintptr_t IP, BP, SP;
} RegContext;

#if RTS_STRUCTURED_EXCEPTION_HANDLING

#ifdef RTS_JMP_BUF_WORDS /* of the port, which saves the registers itself */
typedef uintptr_t RTS_JMP_BUF[RTS_JMP_BUF_WORDS];
int SysExceptSetJmp(RTS_JMP_BUF buffer) __attribute__((returns_twice));
#define RTS_SETJMP(buffer) SysExceptSetJmp(buffer)
#else
#include <setjmp.h>
typedef jmp_buf RTS_JMP_BUF;
#define RTS_SETJMP(buffer) setjmp(buffer)
#endif

typedef struct tagRTS_TRY {
    struct tagRTS_TRY *outer; /* that was registered before */
    RTS_UI32 place;           /* of the port: the context, and the stack in it */
    RTS_UI32 code;            /* RTSEXCPT_* */
    RegContext context;
    RTS_JMP_BUF buffer;
} RTS_TRY;

/* Goes to the RTS_SETJMP of `own->buffer` at an exception in what follows. ERR_OPERATION_DENIED: the caller needs a gate. */
RTS_RESULT SysExceptRegisterJmpBuf(RTS_TRY *own);
/* ERR_NO_OBJECT: not the newest that is registered. */
RTS_RESULT SysExceptUnregisterJmpBuf(RTS_TRY *own);

/* ---- for ports ---- */

/* Returns the list of rts_try of the running context, or NULL if its code may catch nothing. *place is a number of the
 * port for the context and the stack in it; the port passes the same number to SysExceptCatch for a fault there. When
 * SysExceptTry ends, the port restores the list. */
RTS_TRY **SysExceptTries(RTS_UI32 *place);

/* Removes the newest RTS_TRY from the list if it was registered at `place`, writes the exception into it and returns it;
 * the port then continues at its buffer. Else returns NULL. */
RTS_TRY *SysExceptCatch(RTS_TRY **list, RTS_UI32 place, RTS_UI32 code, uintptr_t address, uintptr_t stack);

#else

#define RTS_SETJMP(buffer) 0
typedef struct {
    RTS_UI32 code;
    RegContext context;
} RTS_TRY;

static inline RTS_RESULT SysExceptRegisterJmpBuf(RTS_TRY *own)
{
    own->code = 0; /* RTSEXCPT_NOEXCEPTION */
    return ERR_NOT_SUPPORTED;
}

static inline RTS_RESULT SysExceptUnregisterJmpBuf(RTS_TRY *own)
{
    RTS_UNUSED(own);
    return ERR_NOT_SUPPORTED;
}

#endif

/* When a block is left in any way. */
static inline void SysExceptForgetJmpBuf(RTS_TRY *own)
{
    (void)SysExceptUnregisterJmpBuf(own);
}

#define rts_try                                                              \
    {                                                                        \
        RTS_TRY rts_try_own __attribute__((cleanup(SysExceptForgetJmpBuf))); \
        if (RTS_SETJMP(rts_try_own.buffer) == 0) {                           \
            (void)SysExceptRegisterJmpBuf(&rts_try_own);

#define rts_catch                        \
    SysExceptForgetJmpBuf(&rts_try_own); \
    }                                    \
    else

#define rts_finally
#define rts_try_end }

/* In rts_catch: RTSEXCPT_* (SysExcept.h), and a RegContext *. */
#define EXCPT_GET_CODE() (rts_try_own.code)
#define EXCPT_GET_CONTEXT() (&rts_try_own.context)

#endif
