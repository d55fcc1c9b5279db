/*
 * SysCom.h - serial ports a port gives.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Called by CmpBlkDrvSimpleCom from main. Nothing blocks: a port buffers received bytes (interrupt driven) and bytes
 * to send.
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

/* Reads what has been received, at most `size` bytes; returns the number, 0 when there is nothing. */
RTS_UI32 SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size);

/* Queues bytes to send; returns how many were taken (0..size), the others have to be offered again. */
RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size);

#endif
