/*
 * fuzz_tcp.c - any bytes in any pieces on two TCP connections: what is sent are frames, and a third connection is served.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: pieces, each after a byte: bits 0..6 its length, bit 7 the connection. A length of 0 lets 700 ms pass.
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpPackets.h"
#include "CmpSrvNumbers.h"
#include "SysSocket.h"
#include "comm_fakes.h"
#include "fuzz.h"
#include "rts_config.h"

enum { FUZZED = 2, CONNECTIONS = 3, STREAM = 1 << 16, PASSED_MS = 700, PIECE_MAX = 0x7F };

/* ---- sockets ---- */

typedef struct {
    bool closed; /* by the device */
    const uint8_t *in;
    uint32_t in_size;
    uint32_t room; /* what the device may send at a time */
    uint8_t out[STREAM];
    uint32_t out_size;
} CONNECTION;

static CONNECTION connections[CONNECTIONS];
static uint32_t dialled;
static uint32_t accepted;

RTS_HANDLE SysSockOpen(SYSSOCK_PURPOSE purpose)
{
    return purpose == SYSSOCK_TCP ? CONNECTIONS : (RTS_HANDLE)RTS_INVALID_HANDLE;
}

RTS_RESULT SysSockGetOwn(RTS_HANDLE socket, SOCKADDRESS *own, RTS_UI32 *prefix)
{
    RTS_UNUSED(socket);
    *own = (SOCKADDRESS){0x7F000001, TCP_PORT};
    *prefix = 8;
    return ERR_OK;
}

RTS_HANDLE SysSockAccept(RTS_HANDLE listener, SOCKADDRESS *peer)
{
    FUZZ_CHECK(listener == CONNECTIONS);
    if (accepted == dialled)
        return (RTS_HANDLE)RTS_INVALID_HANDLE;
    *peer = (SOCKADDRESS){0x7F000001, (RTS_UI16)(50000 + accepted)};
    return accepted++;
}

RTS_RESULT SysSockRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received)
{
    CONNECTION *connection = &connections[socket];

    FUZZ_CHECK(socket < CONNECTIONS && !connection->closed && size != 0);
    *received = size < connection->in_size ? size : connection->in_size;
    if (*received == 0)
        return ERR_OK;
    memcpy(data, connection->in, *received);
    connection->in += *received;
    connection->in_size -= *received;
    return ERR_OK;
}

RTS_RESULT SysSockSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken)
{
    CONNECTION *connection = &connections[socket];

    FUZZ_CHECK(socket < CONNECTIONS && !connection->closed && size != 0);
    *taken = size < connection->room ? size : connection->room;
    if (*taken > STREAM - connection->out_size)
        *taken = STREAM - connection->out_size;
    memcpy(connection->out + connection->out_size, data, *taken);
    connection->out_size += *taken;
    return ERR_OK;
}

RTS_RESULT SysSockRecvFrom(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received)
{
    RTS_UNUSED(socket);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    RTS_UNUSED(from);
    RTS_UNUSED(received);
    return ERR_NOTHING_TO_DO;
}

RTS_RESULT SysSockSendTo(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, const SOCKADDRESS *to)
{
    RTS_UNUSED(socket);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    RTS_UNUSED(to);
    return ERR_OK;
}

void SysSockClose(RTS_HANDLE socket)
{
    FUZZ_CHECK(socket <= CONNECTIONS);
    if (socket < CONNECTIONS) {
        FUZZ_CHECK(!connections[socket].closed);
        connections[socket].closed = true;
    }
}

/* ---- inputs ---- */

/* "How many channels?", a scan, and a request to open a channel. */
static const uint8_t question[] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x00, 0x01, 0x00, 0x02,
                                   0x00, 0x00, 0xC2, 0x00, 0x01, 0x01, 0x36, 0x65, 0x9D, 0xAB};
static const uint8_t scan[] = {0xC5, 0x0B, 0x40, 0x03, 0x00, 0x10, 0x00, 0x01, 0x02, 0xC2, 0x00, 0x04, 1, 2, 3, 4};
static const uint8_t open_channel[] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x33, 0,    0,    0,    0,
                                       0,    0,    0x2D, 0xDF, 0x0A, 0x00, 2,    15,   0x00, 0x00,
                                       0xC3, 0x00, 0x01, 0x01, 0x08, 0x92, 0x77, 0xAC, 0x81, 0xD4,
                                       0x21, 0x83, 0x00, 0x40, 0x1F, 0x00, 0x05, 0x00, 0x00, 0x00};

static size_t frame(const uint8_t *packet, size_t size, uint8_t *out)
{
    BytesPut32(out, (RTS_UI32)TCP_MAGIC);
    BytesPut32(out + 4, (RTS_UI32)(sizeof(TCP_HEADER) + size));
    memcpy(out + sizeof(TCP_HEADER), packet, size);
    return sizeof(TCP_HEADER) + size;
}

/* A frame in pieces of `piece` bytes. */
static size_t put(uint8_t *data, size_t at, const uint8_t *packet, size_t size, size_t piece, uint8_t connection)
{
    uint8_t bytes[128];
    size_t total = frame(packet, size, bytes);

    for (size_t i = 0; i < total; i += piece) {
        size_t part = total - i < piece ? total - i : piece;
        data[at++] = (uint8_t)(connection << 7 | part);
        memcpy(data + at, bytes + i, part);
        at += part;
    }
    return at;
}

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    size_t at = 0;

    (void)capacity;
    switch (index) {
    case 0:
        return put(data, 0, question, sizeof(question), PIECE_MAX, 0);
    case 1:
        at = put(data, 0, scan, sizeof(scan), 5, 1);
        return put(data, at, open_channel, sizeof(open_channel), 3, 0);
    case 2:
        at = put(data, 0, open_channel, sizeof(open_channel), PIECE_MAX, 0);
        data[at++] = 0;
        at = put(data, at, question, sizeof(question), 13, 1);
        data[at++] = 0;
        return put(data, at, scan, sizeof(scan), 1, 0);
    default:
        return 0;
    }
}

/* ---- the target ---- */

static uint32_t check_output(const CONNECTION *connection)
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

static void give(CONNECTION *connection, const uint8_t *data, uint32_t size)
{
    if (connection->closed)
        return;
    connection->in = data;
    connection->in_size = size;
    fakes_cycle(0);
    FUZZ_CHECK(connection->closed || connection->in_size == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t good[64];

    memset(connections, 0, sizeof(connections));
    accepted = 0;
    dialled = FUZZED;
    for (int i = 0; i < CONNECTIONS; i++)
        connections[i].room = i == 0 ? 7 : STREAM;
    fakes_start();
    fakes_cycle(0);
    for (size_t i = 0; i < size;) {
        uint8_t head = data[i++];
        uint32_t length = head & PIECE_MAX;
        if (length > size - i)
            length = (uint32_t)(size - i);
        give(&connections[head >> 7], data + i, length);
        fakes_cycle(length == 0 ? PASSED_MS : 0);
        i += length;
    }
    for (int i = 0; i < FUZZED; i++)
        (void)check_output(&connections[i]);
    dialled = CONNECTIONS;
    fakes_cycle(0);
    give(&connections[FUZZED], good, (uint32_t)frame(question, sizeof(question), good));
    fakes_cycle(0);
    FUZZ_CHECK(check_output(&connections[FUZZED]) >= 1);
    fakes_hook(CH_EXIT_COMM);
    fakes_hook(CH_EXIT3);
    for (int i = 0; i < CONNECTIONS; i++)
        FUZZ_CHECK(connections[i].closed);
    return 0;
}
