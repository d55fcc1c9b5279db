/*
 * ThumbStep.h - executes one Thumb instruction of the application for a debugger, where the processor cannot do that.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Branches are executed here. After any other instruction the processor is at the next one, where the port writes a trap.
 * Shared by Cortex-M and 32-bit Arm with Linux.
 */
#ifndef THUMBSTEP_H
#define THUMBSTEP_H

#include "CmpStd.h"

typedef struct {
    RTS_UI32 r[16]; /* r[15]: of the instruction; afterwards with the mode bit, if it was executed */
    RTS_UI32 flags; /* CPSR or xPSR; only its flags and the state of an IT block are used */
} THUMB_REGISTERS;

typedef enum {
    THUMB_STRAIGHT, /* the processor is to execute it */
    THUMB_DONE,     /* it was executed here */
    THUMB_FAULT,    /* it would read memory that cannot be read */
} THUMB_STEP;

THUMB_STEP ThumbStep(THUMB_REGISTERS *at);

/* Bytes of the instruction that begins with this half word. */
RTS_UI32 ThumbSize(RTS_UI16 first);

/* In an IT block an instruction that is to be executed is executed by `ThumbAlone`; afterwards the flags become those of
 * `ThumbAfter`, which gets those of before and of after. Elsewhere nothing changes. */
RTS_UI32 ThumbAlone(RTS_UI32 flags);
RTS_UI32 ThumbAfter(RTS_UI32 before, RTS_UI32 after);

/* ---- traps ---- */

/* Writes a trap over an instruction, or what was there. `store` writes two bytes of code. */
typedef bool (*PF_STORE_CODE)(uintptr_t address, RTS_UI16 half);
RTS_UI32 ThumbRead(uintptr_t address);
bool ThumbWriteTrap(uintptr_t address, PF_STORE_CODE store);
void ThumbRestore(uintptr_t address, RTS_UI32 original, PF_STORE_CODE store);
bool ThumbIsTrap(uintptr_t address);

/* ---- of the port ---- */

/* True if the application may read there. */
bool ThumbMayRead(uintptr_t address, RTS_UI32 size);

#endif
