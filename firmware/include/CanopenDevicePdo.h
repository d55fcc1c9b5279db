/*
 * CanopenDevicePdo.h - the PDOs of a CANopen device: mapping, reception, transmission.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A frame is received in the context of the port and stays in its PDO until a task or main brings it into the values. PDOs
 * that are sent on change are sent by the bus cycle task, those after SYNC by main.
 */
#ifndef CANOPENDEVICEPDO_H
#define CANOPENDEVICEPDO_H

#include "CanopenDict.h"

/* True if the identifier is not for PDOs, SYNC and EMCY (CiA 301). */
bool CanopenIsRestricted(RTS_UI32 id);

/* Read and write an object of a PDO. `sub` is of the object. From main; write: an abort code, 0: done. */
RTS_UI32 CanopenPdoGet(const CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object);
RTS_UI32 CanopenPdoSet(CANOPEN_SLAVE *slave, const CANOPEN_OBJECT *object, RTS_UI32 value, RTS_UI32 now_ms);

/* From main, after a change of the state of the device or of all settings: PDOs begin and end. */
void CanopenPdoUpdate(CANOPEN_SLAVE *slave, RTS_UI32 now_ms);

/* In the context of the port. True: the frame is one of an RPDO, and main need not see it. */
bool CanopenPdoTakeUrgent(CANOPEN_SLAVE *slave, const CAN_FRAME *frame, RTS_UI32 now_ms);

/* From main: true if the frame is one of an RPDO (that was too short for it). */
bool CanopenPdoIsMine(const CANOPEN_SLAVE *slave, RTS_UI32 id);

/* Within SysLock: brings what was received into the values. */
void CanopenPdoUnpack(CANOPEN_SLAVE *slave);

/* From the bus cycle task: sends what has changed or is due. */
void CanopenPdoSendChanged(CANOPEN_SLAVE *slave, RTS_UI32 now_ms);

/* From main: SYNC has come, with this counter; 0: without one. */
void CanopenPdoSync(CANOPEN_SLAVE *slave, RTS_UI32 counter, RTS_UI32 now_ms);

/* From main: true if an RPDO with an event timer is late. `wait_ms`: until the next one is, UINT32_MAX: never. */
bool CanopenPdoIsLate(const CANOPEN_SLAVE *slave, RTS_UI32 now_ms, RTS_UI32 *wait_ms);

#endif
