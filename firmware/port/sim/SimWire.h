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

/* ---- the devices, SimModbus.c; `handle`: line or socket of the client that asks ---- */

/* Whether the wire is in one piece. */
bool SimModbusIsPlugged(RTS_HANDLE handle);

/* Whether it has the frames of a serial line. */
bool SimModbusIsRtu(RTS_HANDLE handle);

/* How long the device needs before it replies [ns]; negative: it does not. */
RTS_I64 SimModbusGetDelayNs(RTS_HANDLE handle, RTS_UI8 unit);

/* How a reply arrives. What is wrong with the last bytes of a connection is that they are missing. */
typedef enum {
    SIM_WHOLE,
    SIM_DAMAGED, /* with a wrong CRC */
    SIM_CUT,     /* its first half */
} SIM_ARRIVAL;

/* The reply in place of a request, at most MODBUS_MAX_PDU bytes; 0: none. */
RTS_UI32 SimModbusReply(RTS_HANDLE handle, RTS_UI8 unit, RTS_UI8 *pdu, RTS_UI32 size, SIM_ARRIVAL *arrival);

#endif
