/*
 * fuzz_channel.c - any sequence of channel packages after a login: afterwards a new client is served.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: packages, each after a byte: bits 0..6 its length / 4 rounded, bit 7: repair channel id and meta CRC,
 * so that mutations get past the checks. A length of 0 lets 300 ms pass.
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpPackets.h"
#include "CmpChecksum.h"
#include "SimLink.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "fuzz.h"

enum { REPAIR = 0x80, UNIT = 4 };

static size_t put(uint8_t *data, size_t at, const uint8_t *package, size_t size)
{
    data[at] = (uint8_t)(REPAIR | (size + UNIT - 1) / UNIT);
    memset(data + at + 1, 0, (size + UNIT - 1) / UNIT * UNIT);
    memcpy(data + at + 1, package, size);
    return at + 1 + (size + UNIT - 1) / UNIT * UNIT;
}

/* A request in blocks of 12 bytes, its blocks numbered from `first`. */
static size_t put_message(uint8_t *data, size_t at, uint32_t first, const uint8_t *message, size_t size)
{
    for (size_t offset = 0; offset < size; offset += 12, first++) {
        uint8_t package[32] = {CHANNEL_PKG_DATA, CHANNEL_FLAG_TO_SERVER};
        size_t head = sizeof(CHANNEL_DATA);
        BytesPut32(package + 4, first);
        if (offset == 0) {
            package[1] |= CHANNEL_FLAG_FIRST;
            BytesPut32(package + 12, (RTS_UI32)size);
            BytesPut32(package + 16, CRC32Update(0, message, size));
            head = CHANNEL_FIRST_SIZE;
        }
        memcpy(package + head, message + offset, 12);
        at = put(data, at, package, head + 12);
    }
    return at;
}

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const uint8_t status[24] = {0x55, 0xCD, 0x10, 0, 2, 0, 0x14};
    /* clang-format off */
    static const uint8_t echo[36] = {0x55, 0xCD, 0x10, 0, 1, 0, 5, 0, 0, 0, 0, 0, 16, 0, 0, 0, 0, 0, 0, 0,
                                     0x52, 0x84, 0x80, 0, 0, 4, 0, 0};
    /* clang-format on */
    static const uint8_t ack[8] = {CHANNEL_PKG_ACK, CHANNEL_FLAG_TO_SERVER | CHANNEL_FLAG_MISSING, 0, 0, 3};
    static const uint8_t keepalive[4] = {CHANNEL_PKG_KEEPALIVE, CHANNEL_FLAG_TO_SERVER};
    static const uint8_t close[12] = {CHANNEL_PKG_CLOSE_REQ, 0, 1, 1};
    static const uint8_t open[20] = {CHANNEL_PKG_OPEN_REQ, 0, 1, 1, 0, 0, 0, 0, 9, 0, 0, 0, 0, 0, 1, 0, 2};
    size_t at = 0;

    (void)capacity;
    switch (index) {
    case 0: /* block 1 was the login */
        return put_message(data, 0, 2, status, sizeof(status));
    case 1:
        at = put_message(data, 0, 2, echo, sizeof(echo));
        at = put(data, at, ack, sizeof(ack));
        at = put_message(data, at, 5, status, sizeof(status));
        return put(data, at, keepalive, sizeof(keepalive));
    case 2:
        at = put_message(data, 0, 2, echo, sizeof(echo));
        return put_message(data, at, 2, echo, sizeof(echo));
    case 3:
        at = put_message(data, 0, 3, status, sizeof(status));
        return put_message(data, at, 2, status, sizeof(status));
    case 4:
        at = put(data, 0, open, sizeof(open));
        at = put_message(data, at, 1, status, sizeof(status));
        return put(data, at, close, sizeof(close));
    case 5:
        at = put_message(data, 0, 2, echo, sizeof(echo));
        data[at++] = 0;
        data[at++] = 0;
        return at;
    default:
        return 0;
    }
}

static void repair(const CLIENT *client, uint8_t *package, RTS_UI32 size)
{
    if (size >= sizeof(CHANNEL_META_HEADER) && (package[0] & CHANNEL_META) != 0) {
        if (package[0] == CHANNEL_PKG_CLOSE_REQ && size >= sizeof(CHANNEL_CLOSE))
            BytesPut16(package + 8, client->channel);
        client_seal(package, size);
    } else if (size >= sizeof(CHANNEL_HEADER)) {
        BytesPut16(package + 2, client->channel);
    }
}

/* Every answer is a package of a known kind, and blocks belong to the channel. */
static void drain(CLIENT *client)
{
    uint8_t package[BLK_MAX_SIZE];
    RTS_UI32 size;

    while ((size = client_take(client, NULL, package)) != 0) {
        FUZZ_CHECK(size >= sizeof(CHANNEL_HEADER));
        if (package[0] == CHANNEL_PKG_OPEN_RESP && size == sizeof(CHANNEL_OPEN_RESPONSE) &&
            BytesGet16(package + 12) == 0)
            client->channel = BytesGet16(package + 14);
        else if (package[0] == CHANNEL_PKG_DATA)
            FUZZ_CHECK(size > sizeof(CHANNEL_DATA) && BytesGet16(package + 2) == client->channel);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    CLIENT client;
    CLIENT later;
    REPLY reply;

    fakes_start();
    client_init(&client, 0x0102);
    FUZZ_CHECK(client_open(&client) && client_login(&client));
    for (size_t i = 0; i < size;) {
        uint8_t package[BLK_MAX_SIZE - CLIENT_HEADER_SIZE];
        uint8_t head = data[i++];
        RTS_UI32 length = UNIT * (head & 0x7Fu);
        if (length > sizeof(package))
            length = sizeof(package);
        if (length > size - i)
            length = (RTS_UI32)(size - i);
        memcpy(package, data + i, length);
        i += length;
        if (length == 0)
            fakes_cycle(300);
        if (head & REPAIR)
            repair(&client, package, length);
        client_send_package(&client, package, length);
        drain(&client);
    }
    fakes_cycle(CHANNEL_IDLE_MS);
    SimLinkReset();
    client_init(&later, 0x0304);
    client_send_open(&later, 1, NETSERVER_MESSAGE_SIZE);
    while (client_take_open(&later) != CHANNEL_OPEN_OK)
        FUZZ_CHECK(later.channel == 0); /* the close for the old owner comes first */
    FUZZ_CHECK(client_request(&later, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply));
    return 0;
}
