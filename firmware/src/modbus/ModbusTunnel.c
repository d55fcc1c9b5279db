/*
 * ModbusTunnel.c - a line of tools within Modbus: bytes between requests and the serial block driver.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Bytes that a reply has taken are kept until the next sequence number says that it arrived.
 */
#include "ModbusTunnel.h"

#include <string.h>

#include "CmpPackets.h"

enum {
    TAKES = MODBUS_MAX_PDU - sizeof(MODBUS_TUNNEL_REQUEST),
    GIVES = MODBUS_MAX_PDU - sizeof(MODBUS_TUNNEL_REPLY),
    FROM_DEVICE = 2 * GIVES, /* while one reply is on its way the next one gets full */
    LAST_SEQUENCE = 255,
};

static struct {
    bool begun;
    RTS_UI8 sequence; /* of the last request that was taken, */
    RTS_UI8 taken;    /* how many of its bytes, */
    RTS_UI8 given;    /* and how many bytes its reply has, from the first one of from_device on */
    RTS_UI16 to_fill;
    RTS_UI16 to_read;
    RTS_UI16 from_fill;
    RTS_UI8 to_device[TAKES];
    RTS_UI8 from_device[FROM_DEVICE];
} tunnel;

static RTS_UI32 least(RTS_UI32 a, RTS_UI32 b)
{
    return a < b ? a : b;
}

void ModbusTunnelReset(void)
{
    memset(&tunnel, 0, sizeof(tunnel));
}

/* ---- for the block driver ---- */

RTS_UI32 ModbusTunnelRead(RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 count = least(size, (RTS_UI32)tunnel.to_fill - tunnel.to_read);

    memcpy(data, tunnel.to_device + tunnel.to_read, count);
    tunnel.to_read = (RTS_UI16)(tunnel.to_read + count);
    if (tunnel.to_read == tunnel.to_fill)
        tunnel.to_read = tunnel.to_fill = 0;
    return count;
}

RTS_UI32 ModbusTunnelWrite(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 count = least(size, (RTS_UI32)FROM_DEVICE - tunnel.from_fill);

    memcpy(tunnel.from_device + tunnel.from_fill, data, count);
    tunnel.from_fill = (RTS_UI16)(tunnel.from_fill + count);
    return count;
}

/* ---- for servers ---- */

static RTS_UI8 following(RTS_UI8 sequence)
{
    return (RTS_UI8)(sequence == LAST_SEQUENCE ? MODBUS_TUNNEL_BEGIN + 1 : sequence + 1);
}

static void drop_given(void)
{
    tunnel.from_fill = (RTS_UI16)(tunnel.from_fill - tunnel.given);
    memmove(tunnel.from_device, tunnel.from_device + tunnel.given, tunnel.from_fill);
}

static void take_request(RTS_UI8 sequence, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 taken = least(size, (RTS_UI32)TAKES - tunnel.to_fill);

    drop_given();
    memcpy(tunnel.to_device + tunnel.to_fill, data, taken);
    tunnel.to_fill = (RTS_UI16)(tunnel.to_fill + taken);
    tunnel.taken = (RTS_UI8)taken;
    tunnel.given = (RTS_UI8)least(tunnel.from_fill, GIVES);
    tunnel.sequence = sequence;
}

RTS_UI32 ModbusTunnelReply(RTS_UI8 *pdu, RTS_UI32 size, RTS_UI8 *exception)
{
    const RTS_UI32 head = sizeof(MODBUS_TUNNEL_REQUEST);
    MODBUS_TUNNEL_REPLY *reply = (MODBUS_TUNNEL_REPLY *)(void *)pdu;
    RTS_UI8 sequence = size >= head ? reply->sequence : 0;
    bool begins = size == head && sequence == MODBUS_TUNNEL_BEGIN;
    bool repeats = tunnel.begun && size >= head && sequence == tunnel.sequence;

    if (begins) {
        ModbusTunnelReset();
        tunnel.begun = true;
    } else if (!repeats) {
        if (!tunnel.begun || size < head || size > MODBUS_MAX_PDU || sequence != following(tunnel.sequence)) {
            *exception = MODBUS_ILLEGAL_VALUE;
            return 0;
        }
        take_request(sequence, pdu + head, size - head);
    }
    reply->taken = tunnel.taken;
    reply->size = tunnel.given;
    memcpy(reply + 1, tunnel.from_device, tunnel.given);
    return (RTS_UI32)(sizeof(*reply) + tunnel.given);
}
