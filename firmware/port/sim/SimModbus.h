/*
 * SimModbus.h - simulated Modbus devices, made of the jobs that ask them, and what the bus of Modbus shows of them.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SIMMODBUS_H
#define SIMMODBUS_H

#include "CmpErrors.h"
#include "CmpStd.h"
#include "IoConfig.h"
#include "Sim.h"

/* ---- at the end of the wire; `handle`: line or socket of the client that asks ---- */

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

/* ---- for SimBuses.c ---- */

/* As of SIM_BUS: ERR_NOT_SUPPORTED, the connector is not one of Modbus. */
RTS_RESULT SimModbusSetPlace(const IoConfigConnector *connector, const SIM_IO_PLACE *place, const RTS_UI8 *data);
RTS_RESULT SimModbusGetPlace(const IoConfigConnector *connector, const SIM_IO_PLACE *place, RTS_UI8 *data);
RTS_RESULT SimModbusFail(const IoConfigConnector *connector, RTS_UI32 fault, RTS_UI32 value);

/* When a client has something to send, INT64_MAX: never. */
RTS_I64 SimModbusGetDueNs(RTS_I64 now_ns);

/* The I/O configuration goes; the devices of the new one are made, and have the value 0; the application has stopped. */
void SimModbusForget(void);
void SimModbusMake(void);
void SimModbusCancel(void);

#endif
