/*
 * CanopenDevice.h - a CANopen device: its NMT state, boot-up, heartbeat, emergencies, and what it does with frames.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main; time is an argument. CanopenDevicePdo.h says what others may call.
 */
#ifndef CANOPENDEVICE_H
#define CANOPENDEVICE_H

#include "CanopenDict.h"

/* Errors that last; an emergency tells each, and 0000h when all are gone. */
typedef enum {
    CANOPEN_ERROR_PROGRAM = 1,
    CANOPEN_ERROR_HEARTBEAT = 2, /* of 1016h */
    CANOPEN_ERROR_LATE = 4,      /* an RPDO */
    CANOPEN_ERROR_SHORT = 8,     /* an RPDO */
    CANOPEN_ERROR_BUS = 16,
    CANOPEN_ERROR_COLLISION = 32, /* another device has our number; until a reset */
} CANOPEN_ERROR;

/* A device whose first fields are set boots. False: its table cannot be used. */
bool CanopenDeviceBegin(CANOPEN_SLAVE *slave, RTS_UI32 now_ms);

/* A frame that CanopenPdoTakeUrgent has left. */
void CanopenDeviceTake(CANOPEN_SLAVE *slave, const CAN_FRAME *frame, RTS_UI32 bit_rate, RTS_UI32 now_ms);

void CanopenDevicePoll(CANOPEN_SLAVE *slave, RTS_UI32 now_ms);

/* Reports an error by its code, 0: it is gone. */
void CanopenDeviceReport(CANOPEN_SLAVE *slave, CANOPEN_ERROR error, RTS_UI16 code);

/* The bus has gone off, or is back. */
void CanopenDeviceNoteBus(CANOPEN_SLAVE *slave, bool off, RTS_UI32 now_ms);

/* Returns the time until the next call is due even if no frame arrives [ms]; UINT32_MAX: none. */
RTS_UI32 CanopenDeviceGetWaitMs(const CANOPEN_SLAVE *slave, RTS_UI32 now_ms);

#endif
