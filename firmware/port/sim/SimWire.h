/*
 * SimWire.h - the wires of simulated field buses: serial lines and TCP connections, on the virtual clock.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * What SysCom.h gives of lines from 1 on, and SysSocket.h for clients of a field bus. A frame takes its time: each
 * character of a serial line, the pause before the device replies, and silence after frames. Who replies is in
 * SimModbus.c.
 */
#ifndef SIMWIRE_H
#define SIMWIRE_H

#include "CmpErrors.h"
#include "SysCom.h"

RTS_RESULT SimWireOpen(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *line);
void SimWireClose(RTS_UI32 line);
RTS_UI32 SimWireRead(RTS_UI32 line, RTS_UI8 *data, RTS_UI32 size);
RTS_UI32 SimWireWrite(RTS_UI32 line, const RTS_UI8 *data, RTS_UI32 size);
void SimWireDiscard(RTS_UI32 line);
RTS_I64 SimWireGetByteNs(RTS_UI32 line);

/* When something on a wire is next to be looked at, INT64_MAX: nothing is on its way. */
RTS_I64 SimWireGetDueNs(RTS_I64 now_ns);

#endif
