/*
 * CanopenDeviceDriver.h - what the simulator asks of the driver of this controller as a CANopen device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CANOPENDEVICEDRIVER_H
#define CANOPENDEVICEDRIVER_H

#include "CanopenObject.h"
#include "IoConfig.h"

/* When main has something to do without a frame [ns], INT64_MAX: never. */
RTS_I64 IoDrvCanopenDeviceGetDueNs(RTS_I64 now_ns);

/* Write values as the network does, and read them: `bits` from bit `bit` of a parameter on. ERR_NOT_SUPPORTED: the connector
 * is not the device, or it has no such channels; ERR_OUT_OF_LIMITS. */
RTS_RESULT IoDrvCanopenDeviceSet(const IoConfigConnector *connector, RTS_UI32 parameter, RTS_UI32 bit, RTS_UI32 bits,
                                 const RTS_UI8 *data);
RTS_RESULT IoDrvCanopenDeviceGet(const IoConfigConnector *connector, RTS_UI32 parameter, RTS_UI32 bit, RTS_UI32 bits,
                                 RTS_UI8 *data);

/* The number of the device on a network, 0: there is none; its state as a heartbeat has it. From any context. */
RTS_UI8 IoDrvCanopenDeviceGetNode(RTS_UI32 network);
RTS_UI8 IoDrvCanopenDeviceGetState(void);

/* From main: reads or writes an object as a manager does. An abort code, 0: done; SDO_ABORT_NO_DICTIONARY: this controller
 * is no device on the network. `*size`: bytes to be written, or the room for what is read, and then the bytes of it. */
RTS_UI32 IoDrvCanopenDeviceAccess(RTS_UI32 network, const CANOPEN_OBJECT *what, bool is_write, RTS_UI8 *data,
                                  RTS_UI32 *size);

#endif
