/*
 * fuzz_tcp.c - any bytes in any pieces on two TCP connections: what is sent are frames, and a third connection is served.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: pieces, each after a byte: bits 0..6 its length, bit 7 the connection. A length of 0 lets 700 ms pass.
 */
#include <string.h>

#include "comm_fakes.h"
#include "fuzz.h"
#include "fuzz_sockets.h"

enum { FUZZED = SOCKETS_TCP - 1, PASSED_MS = 700, PIECE_MAX = 0x7F };

/* ---- inputs ---- */

/* "How many channels?", a scan, and a request to open a channel. */
static const uint8_t question[] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x00, 0x01, 0x00, 0x02,
                                   0x00, 0x00, 0xC2, 0x00, 0x01, 0x01, 0x36, 0x65, 0x9D, 0xAB};
static const uint8_t scan[] = {0xC5, 0x0B, 0x40, 0x03, 0x00, 0x10, 0x00, 0x01, 0x02, 0xC2, 0x00, 0x04, 1, 2, 3, 4};
static const uint8_t open_channel[] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x33, 0,    0,    0,    0,
                                       0,    0,    0x2D, 0xDF, 0x0A, 0x00, 2,    15,   0x00, 0x00,
                                       0xC3, 0x00, 0x01, 0x01, 0x08, 0x92, 0x77, 0xAC, 0x81, 0xD4,
                                       0x21, 0x83, 0x00, 0x40, 0x1F, 0x00, 0x05, 0x00, 0x00, 0x00};

/* A frame in pieces of `piece` bytes. */
static size_t put(uint8_t *data, size_t at, const uint8_t *packet, size_t size, size_t piece, uint8_t connection)
{
    uint8_t bytes[128];
    size_t total = sockets_frame(packet, (uint32_t)size, bytes);

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

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    uint8_t good[64];

    sockets_start(false);
    sockets.dialled = FUZZED;
    sockets.tcp[0].room = 7;
    fakes_start();
    fakes_cycle(0);
    for (size_t i = 0; i < size;) {
        uint8_t head = data[i++];
        uint32_t length = head & PIECE_MAX;
        if (length > size - i)
            length = (uint32_t)(size - i);
        sockets_give(&sockets.tcp[head >> 7], data + i, length);
        fakes_cycle(length == 0 ? PASSED_MS : 0);
        i += length;
    }
    for (int i = 0; i < FUZZED; i++)
        (void)sockets_count_frames(&sockets.tcp[i]);
    sockets.dialled = SOCKETS_TCP;
    fakes_cycle(0);
    sockets_give(&sockets.tcp[FUZZED], good, sockets_frame(question, sizeof(question), good));
    fakes_cycle(0);
    FUZZ_CHECK(sockets_count_frames(&sockets.tcp[FUZZED]) >= 1);
    fakes_hook(CH_EXIT_COMM);
    fakes_hook(CH_EXIT3);
    for (int i = 0; i < SOCKETS_TCP; i++)
        FUZZ_CHECK(sockets.tcp[i].closed);
    return 0;
}
