/*
 * SysGpio.h - digital lines of the board, for IoDrvGpio.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The port implements it. Lines that belong together are a group (of IO_GPIO_GROUPS): they are read, and written, as a
 * whole. Within a group they have numbers, below IO_GPIO_LINES. A bit of a value is the line of that number; what it means
 * is already put right for GPIO_OPTION_ACTIVE_LOW.
 */
#ifndef SYSGPIO_H
#define SYSGPIO_H

#include "CmpErrors.h"
#include "CmpStd.h"
#include "IoDrvGpio.h"

typedef struct {
    const char *name; /* what the board, or its kernel, calls the line */
    RTS_UI32 options; /* GPIO_OPTION_* */
    RTS_HANDLE event; /* that its edges post (SchedPostExternalEvent), RTS_INVALID_HANDLE: none */
} SYS_GPIO_LINE;

/* ---- from main ---- */

/*
 * Adds a line to a group that is closed, or is being put together; below 1 ms, with nothing done to the hardware. Tasks
 * may use other groups meanwhile. The name is copied or understood, not kept. ERR_NO_OBJECT: the board has no such line;
 * ERR_OPERATION_DENIED: something else has it (another process, the kernel, another group); ERR_NOT_SUPPORTED: it cannot
 * do what the options say; ERR_NOMEMORY.
 */
RTS_RESULT SysGpioAdd(RTS_UI32 group, RTS_UI32 number, const SYS_GPIO_LINE *line);

/* Takes all lines that were added, outputs with these values and without a pulse of another. The errors of Add, when
 * something changed meanwhile, or ERR_DEVICE; the group is closed then. */
RTS_RESULT SysGpioOpen(RTS_UI32 group, RTS_UI32 outputs);

/* Gives the lines of a group back: inputs, or as the hardware leaves them. It has none then. Also for one that was never
 * opened. */
void SysGpioClose(RTS_UI32 group);

/* In each pass of main, of an open group: a port whose edges are no interrupts looks for them here, without waiting.
 * ERR_DEVICE: the chip has gone, which nothing else may notice, if the tasks of the group run by its edges only. */
RTS_RESULT SysGpioPoll(RTS_UI32 group);

/* ---- from a task or main, one call for a group at a time, of an open group ---- */

/* All lines, outputs as well. Linux: one system call for each chip. ERR_DEVICE: the chip has gone. */
RTS_RESULT SysGpioRead(RTS_UI32 group, RTS_UI32 *values);

/* The outputs in `mask`, at the same time where the hardware can. */
RTS_RESULT SysGpioWrite(RTS_UI32 group, RTS_UI32 mask, RTS_UI32 values);

#endif
