/*
 * SysCom.h - serial ports a port gives.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Called by CmpBlkDrvSimpleCom and IoDrvModbus from main. Nothing blocks: a port buffers received bytes (interrupt
 * driven) and bytes to send. A line is used by one component at a time: those that the controller is reached by are
 * opened before an application can ask for them.
 */
#ifndef SYSCOM_H
#define SYSCOM_H

#include "CmpErrors.h"
#include "CmpStd.h"

/* How many serial lines the port has configured (0 when none). */
RTS_UI32 SysComGetCount(void);

/* Opens line `index` with the port's own settings: 8 data bits, no parity, one stop bit, no flow control. What came
 * before is forgotten. ERR_DEVICE when it cannot. */
RTS_RESULT SysComOpen(RTS_UI32 index);
void SysComClose(RTS_UI32 index);

enum { SYSCOM_PARITY_NONE, SYSCOM_PARITY_EVEN, SYSCOM_PARITY_ODD };

/* How a line is to run; always 8 data bits, no flow control. */
typedef struct {
    RTS_UI32 baud;
    RTS_UI8 parity;    /* SYSCOM_PARITY_* */
    RTS_UI8 stop_bits; /* 1 or 2 */
    bool rs485;        /* the port drives the bus while it sends, and only then */
} SYSCOM_SETTINGS;

/* Opens a line of a field bus, by the name that the port gives its lines ("/dev/ttyS1", "COM2"), and returns its index.
 * ERR_NO_OBJECT: the port has no such line; ERR_DUPLICATE: it is open; ERR_NOT_SUPPORTED: it cannot run like that;
 * ERR_DEVICE: it cannot be opened. Only a firmware with a field bus needs it, SysComGetByteNs and
 * SysComDiscard. */
RTS_RESULT SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index);

/* Opens the line that programs know by a number, from 1 on, and returns its index. ERR_NO_OBJECT: they may open none of this
 * number; else as SysComOpenPort. Only a firmware with IEC_COMS needs it. */
RTS_RESULT SysComOpenProgram(RTS_UI32 number, const SYSCOM_SETTINGS *settings, RTS_UI32 *index);

/* When the last byte came that SysComRead has returned, or a later one, or when it was read, if the port cannot know better
 * (SysTimeGetNs). SYSCOM_BYTE_TIMES 1. */
RTS_I64 SysComGetByteNs(RTS_UI32 index);

/* Reads what has been received, at most `size` bytes; returns the number, 0 when there is nothing. */
RTS_UI32 SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size);

/* Queues bytes to send; returns how many were taken (0..size), the others have to be offered again. */
RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size);

/* Forgets bytes that SysComWrite took and that have not left, as far as the port can: none of them arrives after a
 * newer request. Of a UART they leave by themselves, so it has nothing to do. */
void SysComDiscard(RTS_UI32 index);

#endif
