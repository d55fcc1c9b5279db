/*
 * RiscvStep.h - executes one instruction of the application for a debugger.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Branches are executed here. After any other instruction the processor is at the next one, where SysExcept.c writes a trap.
 */
#ifndef RISCVSTEP_H
#define RISCVSTEP_H

#include "BareMetal.h"

enum { SAVED = 12 }; /* s0 to s11, which are not in a FRAME */

typedef enum {
    RISCV_STRAIGHT, /* the processor is to execute it */
    RISCV_DONE,     /* it was executed here */
    RISCV_FAULT,    /* a program has no such instruction */
} RISCV_STEP;

RISCV_STEP RiscvStep(FRAME *frame, RTS_UI32 *saved);

/* Bytes of the instruction there. */
RTS_UI32 RiscvSize(uintptr_t address);

#endif
