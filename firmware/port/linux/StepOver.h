/*
 * StepOver.h - the one instruction of SYS_DEBUG_PASS on Arm, which lets no process execute a single instruction.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * For SysExcept.c. A branch is executed in place of the processor. Any other instruction ends at the next one, where a trap
 * is written. One thread at a time does that; another one that meets the trap waits until it is gone.
 */
#ifndef STEPOVER_H
#define STEPOVER_H

#include "CmpStd.h"

/* What a signal in IEC code is to steps. */
typedef enum {
    STEP_NONE,        /* nothing */
    STEP_ENDED,       /* the end of that of this thread, which goes on where it is */
    STEP_INTERRUPTED, /* the end of that of this thread, by an exception or at a breakpoint */
    STEP_OF_ANOTHER,  /* the end of that of another thread; this one tries again */
} STEP_TRAP;

/* The thread executes the instruction that it was interrupted at. True if that was done here. */
bool StepBegin(void *ucontext);

/* From the handler of a signal. NULL: the thread leaves its IEC code. */
STEP_TRAP StepEnd(void *ucontext);

#endif
