/*
 * fuzz_sockets.c - sockets of a device that is fuzzed.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "fuzz_sockets.h"

#include <string.h>

#include "CmpBytes.h"
#include "comm_fakes.h"
#include "fuzz.h"

enum { LISTENER = SOCKETS_TCP, UDP, FIRST_PORT = 50000, PREFIX = 8 };

SOCKETS sockets;

void sockets_start(bool has_udp)
{
    memset(&sockets, 0, sizeof(sockets));
    sockets.has_udp = has_udp;
    for (int i = 0; i < SOCKETS_TCP; i++)
        sockets.tcp[i].room = SOCKETS_STREAM;
}

void sockets_give(CONNECTION *connection, const uint8_t *data, uint32_t size)
{
    if (connection->closed)
        return;
    connection->in = data;
    connection->in_size = size;
    fakes_cycle(0);
    FUZZ_CHECK(connection->closed || connection->in_size == 0);
}

void sockets_give_datagram(SOCKADDRESS peer, const uint8_t *data, uint32_t size)
{
    sockets.datagram = data;
    sockets.datagram_size = size;
    sockets.datagram_peer = peer;
    fakes_cycle(0);
    FUZZ_CHECK(sockets.datagram == NULL);
}

uint32_t sockets_frame(const uint8_t *packet, uint32_t size, uint8_t *frame)
{
    BytesPut32(frame, (RTS_UI32)TCP_MAGIC);
    BytesPut32(frame + 4, (RTS_UI32)sizeof(TCP_HEADER) + size);
    memcpy(frame + sizeof(TCP_HEADER), packet, size);
    return (uint32_t)sizeof(TCP_HEADER) + size;
}

uint32_t sockets_count_frames(const CONNECTION *connection)
{
    uint32_t frames = 0;
    uint32_t at = 0;

    while (connection->out_size - at >= sizeof(TCP_HEADER)) {
        uint32_t size = BytesGet32(connection->out + at + 4);
        FUZZ_CHECK(BytesGet32(connection->out + at) == (RTS_UI32)TCP_MAGIC);
        FUZZ_CHECK(size >= sizeof(TCP_HEADER) + 8 && size <= sizeof(TCP_HEADER) + BLK_MAX_SIZE);
        if (size > connection->out_size - at)
            break; /* the rest waits for room, or the end came before */
        at += size;
        frames++;
    }
    return frames;
}

/* ---- what the device calls ---- */

RTS_HANDLE SysSockOpen(SYSSOCK_PURPOSE purpose)
{
    if (purpose == SYSSOCK_TCP)
        return LISTENER;
    return purpose == SYSSOCK_UDP && sockets.has_udp ? UDP : (RTS_HANDLE)RTS_INVALID_HANDLE;
}

RTS_RESULT SysSockGetOwn(RTS_HANDLE socket, SOCKADDRESS *own, RTS_UI32 *prefix)
{
    *own = (SOCKADDRESS){SOCKETS_OWN_IP, socket == UDP ? UDP_PORT : TCP_PORT};
    *prefix = PREFIX;
    return ERR_OK;
}

RTS_HANDLE SysSockAccept(RTS_HANDLE listener, SOCKADDRESS *peer)
{
    FUZZ_CHECK(listener == LISTENER);
    if (sockets.accepted == sockets.dialled)
        return (RTS_HANDLE)RTS_INVALID_HANDLE;
    *peer = (SOCKADDRESS){SOCKETS_OWN_IP, (RTS_UI16)(FIRST_PORT + sockets.accepted)};
    return sockets.accepted++;
}

RTS_RESULT SysSockRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received)
{
    CONNECTION *connection = &sockets.tcp[socket];

    FUZZ_CHECK(socket < SOCKETS_TCP && !connection->closed && size != 0);
    *received = size < connection->in_size ? size : connection->in_size;
    if (*received == 0)
        return connection->ended ? ERR_NET_NOTCONNECTED : ERR_OK;
    memcpy(data, connection->in, *received);
    connection->in += *received;
    connection->in_size -= *received;
    return ERR_OK;
}

RTS_RESULT SysSockSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken)
{
    CONNECTION *connection = &sockets.tcp[socket];

    FUZZ_CHECK(socket < SOCKETS_TCP && !connection->closed && size != 0);
    *taken = size < connection->room ? size : connection->room;
    if (*taken > SOCKETS_STREAM - connection->out_size)
        *taken = SOCKETS_STREAM - connection->out_size;
    memcpy(connection->out + connection->out_size, data, *taken);
    connection->out_size += *taken;
    return ERR_OK;
}

RTS_RESULT SysSockRecvFrom(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received)
{
    FUZZ_CHECK(socket == UDP);
    if (sockets.datagram == NULL)
        return ERR_NOTHING_TO_DO;
    *from = sockets.datagram_peer;
    *received = sockets.datagram_size;
    memcpy(data, sockets.datagram, size < *received ? size : *received);
    sockets.datagram = NULL;
    return ERR_OK;
}

RTS_RESULT SysSockSendTo(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, const SOCKADDRESS *to)
{
    DATAGRAM *datagram = &sockets.out[sockets.out_count];

    FUZZ_CHECK(socket == UDP && size <= BLK_MAX_SIZE);
    if (sockets.out_count == SOCKETS_DATAGRAMS)
        return ERR_NOBUFFER;
    datagram->peer = *to;
    datagram->size = size;
    memcpy(datagram->data, data, size);
    sockets.out_count++;
    return ERR_OK;
}

RTS_RESULT SysSockRecvRefused(RTS_HANDLE socket, SOCKADDRESS *to)
{
    FUZZ_CHECK(socket == UDP);
    if (sockets.refused.port == 0)
        return ERR_NOTHING_TO_DO;
    *to = sockets.refused;
    sockets.refused.port = 0;
    return ERR_OK;
}

void SysSockClose(RTS_HANDLE socket)
{
    FUZZ_CHECK(socket <= UDP);
    if (socket < SOCKETS_TCP) {
        FUZZ_CHECK(!sockets.tcp[socket].closed);
        sockets.tcp[socket].closed = true;
    }
}
