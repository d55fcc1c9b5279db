/*
 * ModbusTcp.h - frames of Modbus on a TCP connection: transaction, protocol, length, unit, PDU.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Frames are found by their length, however they arrive. A connection on which something else comes is closed: then its
 * handle is RTS_INVALID_HANDLE. All from main.
 *
 * A connection that breaks is a sign that the device has restarted (MODBUS_LINK.breaks). Many devices close each
 * connection by themselves, after a reply or when it is idle: after MODBUS_CLOSINGS short ones in a row that is expected.
 */
#ifndef MODBUSTCP_H
#define MODBUSTCP_H

#include "ModbusLink.h"

enum { MODBUS_CLOSINGS = 3, MODBUS_SHORT_CONNECTION_MS = 10000 };

/* A link on an accepted connection. */
void ModbusTcpBeginServer(MODBUS_LINK *link, RTS_HANDLE socket, RTS_I64 now_ns);
/* A link that connects to a server when it is asked whether it is ready. It connects again at once if the last connection
 * had a reply or was given up, and MODBUS_RECONNECT_MS after the last one failed otherwise. */
void ModbusTcpBeginClient(MODBUS_LINK *link, const SOCKADDRESS *peer);
/* The same for a gateway that passes on the frames of its serial line (ModbusRtu.h), as on a line of this device. */
void ModbusTcpBeginRtuClient(MODBUS_LINK *link, const SOCKADDRESS *peer);
#if SYSSOCK_NAMES
/* From now on the link of a client connects to the host of this name, at the port of its peer. The name is looked up for
 * each connection; `host` stays valid as long as the link is in use. */
void ModbusTcpSetHost(MODBUS_LINK *link, const char *host);
#endif
/* Returns why there is no connection because of the host's name; NULL: for another reason. */
const char *ModbusTcpExplainName(const MODBUS_LINK *link);
/* Of a client nothing that is on its way arrives any more: it would do so minutes later, after newer values. Nor of a
 * server whose peer does not read: the system would keep it for ever. */
void ModbusTcpClose(MODBUS_LINK *link);

bool ModbusTcpReady(MODBUS_LINK *link, RTS_I64 now_ns);
RTS_UI32 ModbusTcpReceive(MODBUS_LINK *link, RTS_I64 now_ns);
void ModbusTcpSend(MODBUS_LINK *link, RTS_UI32 pdu_size, RTS_I64 now_ns);
void ModbusTcpGiveUp(MODBUS_LINK *link);

#endif
