/*
 * ModbusRtu.h - frames of Modbus on a serial line: unit, PDU, CRC, and silence around them.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Modbus over serial line V1.02, 2.5.1: a frame ends when no byte has come for 3.5 characters, above 19200 baud for
 * 1.75 ms, and nothing is sent before that. But a port may hand over bytes in groups (SYSCOM_HELD_MS), with pauses within
 * a frame, and none between two. There a request or a reply ends where its length says, with a right CRC, and what never
 * is complete is given up after a longer pause. All from main.
 */
#ifndef MODBUSRTU_H
#define MODBUSRTU_H

#include "ModbusLink.h"
#include "SysCom.h"

/* CRC-16 of Modbus, polynomial 0xA001 reflected: "123456789" gives 0x4B37. From any context. */
RTS_UI16 ModbusCrc(const RTS_UI8 *data, RTS_UI32 size);

/* A link on a line that SysComOpenPort has opened with these settings. */
void ModbusRtuBegin(MODBUS_LINK *link, RTS_UI32 line, const SYSCOM_SETTINGS *settings);

bool ModbusRtuReady(MODBUS_LINK *link, RTS_I64 now_ns);
RTS_UI32 ModbusRtuReceive(MODBUS_LINK *link, RTS_I64 now_ns);
void ModbusRtuSend(MODBUS_LINK *link, RTS_UI32 pdu_size, RTS_I64 now_ns);
void ModbusRtuGiveUp(MODBUS_LINK *link);
void ModbusRtuClose(MODBUS_LINK *link);

/* The same frames on a TCP connection (ModbusTcp.h). Begin: makes one of the unit and PDU in the buffer, to be sent. Find:
 * the size of the PDU of a frame in what has been received, 0: none; the reply that is looked for, or a whole other one. */
void ModbusRtuBeginFrame(MODBUS_LINK *link, RTS_UI32 pdu_size);
RTS_UI32 ModbusRtuFindFrame(MODBUS_LINK *link);

#endif
