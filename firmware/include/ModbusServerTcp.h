/*
 * ModbusServerTcp.h - Modbus servers on TCP: where they listen, and their connections.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * All servers share MODBUS_MAX_CONNECTIONS. If they are in use, a new connection replaces the one on which nothing has
 * moved for the longest time. All from main.
 */
#ifndef MODBUSSERVERTCP_H
#define MODBUSSERVERTCP_H

#include "ModbusServer.h"

typedef struct {
    RTS_UI32 accepted;
    RTS_UI32 displaced;  /* closed because a new one needed the place */
    RTS_UI32 bad_frames; /* on which a connection was closed */
} MODBUS_TCP_COUNTERS;

/* A server listens at an address; if it is in use, or not there yet, again each second. ERR_NOMEMORY if there are
 * MODBUS_MAX_SERVERS. */
RTS_RESULT ModbusServerTcpOpen(MODBUS_SERVER *server, const SOCKADDRESS *own);
/* Closes all listeners and connections. */
void ModbusServerTcpClose(void);

void ModbusServerTcpPoll(RTS_I64 now_ns);

/* What the last try to listen came to: ERR_OK, or the error of SysSockListen. */
RTS_RESULT ModbusServerTcpGetState(const MODBUS_SERVER *server);
const MODBUS_TCP_COUNTERS *ModbusServerTcpGetCounters(void);

#endif
