/*
 * ModbusTunnel.h - a line of tools within Modbus: function 43, MEI type 128 of a server.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Requests bring bytes to the device and replies take bytes from it (CmpPackets.h); the serial block driver has them as
 * one more line. A server only moves bytes: what they ask for is done in the cycle of the block driver, because it may
 * end the server. So this state is apart from those of servers, and a request whose reply was lost with its server is
 * repeated at the next one. All from main.
 */
#ifndef MODBUSTUNNEL_H
#define MODBUSTUNNEL_H

#include "Modbus.h"
#include "rts_config.h"

/* ---- for servers ---- */

/* Whether a PDU is a request of this kind, or the beginning of one. */
static inline bool ModbusTunnelIsRequest(const RTS_UI8 *pdu, RTS_UI32 size)
{
    return size >= 2 && pdu[0] == MODBUS_ENCAPSULATED && pdu[1] == MODBUS_TUNNEL_MEI;
}

/* Replaces the request in `pdu` (MODBUS_MAX_PDU bytes) by its reply; returns the size of that. MODBUS_ILLEGAL_VALUE in
 * *exception: it is too short, or its sequence number does not follow: the tool has to begin again. */
RTS_UI32 ModbusTunnelReply(RTS_UI8 *pdu, RTS_UI32 size, RTS_UI8 *exception);

/* ---- for the block driver ---- */

/* As SysComRead and SysComWrite. */
RTS_UI32 ModbusTunnelRead(RTS_UI8 *data, RTS_UI32 size);
RTS_UI32 ModbusTunnelWrite(const RTS_UI8 *data, RTS_UI32 size);

/* Forgets all, as at power on. */
void ModbusTunnelReset(void);

#endif
