/*
 * CmpRouterEmbedded.c - layer 3 of a leaf node: takes packets from block drivers, answers to their senders.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpRouterEmbedded.h"

#include <string.h>

enum {
    HEADER_SIZE = 2 * ROUTER_HEADER_WORDS,
    FLAG_SIGNAL = 0x20,
    FLAG_RELATIVE = 0x10,
    PRIO_SHIFT = 6,
    HOP_SHIFT = 3,
    BLOCK_UNIT = 32, /* bytes per step of BlkLenMax */
};

/* A parsed header. */
typedef struct {
    const RTS_UI8 *receiver;
    const RTS_UI8 *sender;
    RTS_UI32 receiver_words;
    RTS_UI32 sender_words;
    RTS_UI32 size; /* with filler: where the payload starts */
} HEADER;

static ROUTER_COUNTERS counters;

/* Bytes of a header with this many static bytes and address words: the payload starts at a multiple of 4. */
static RTS_UI32 header_size(RTS_UI32 fixed, RTS_UI32 words)
{
    return (fixed + 2 * words + 3) & ~(RTS_UI32)3;
}

static bool parse_header(const RTS_UI8 *data, RTS_UI32 size, HEADER *header)
{
    if (size < HEADER_SIZE || size > BLK_MAX_SIZE || data[0] != ROUTER_MAGIC)
        return false;
    RTS_UI32 fixed = 2 * (data[1] & 7u);
    if (fixed < HEADER_SIZE)
        return false;
    header->receiver_words = data[5] & 0x0F;
    header->sender_words = data[5] >> 4;
    header->size = header_size(fixed, header->receiver_words + header->sender_words);
    if (header->size > size)
        return false;
    header->receiver = data + fixed;
    header->sender = header->receiver + 2 * header->receiver_words;
    return true;
}

static bool is_for_us(const BLK_DRV *driver, const RTS_UI8 *data, const HEADER *header)
{
    if ((data[2] & FLAG_RELATIVE) != 0 || data[1] >> HOP_SHIFT == 0)
        return false;
    if (driver->point_to_point || header->receiver_words == 0)
        return true;
    return header->receiver_words == driver->address_words &&
           memcmp(header->receiver, driver->address, 2 * header->receiver_words) == 0;
}

/* The length a sender announces limits what its path carries back; 0 means nothing was said. */
static RTS_UI16 max_packet(RTS_UI8 flags)
{
    RTS_UI32 units = flags & 0x0F;

    return (RTS_UI16)(units == 0 ? BLK_MAX_SIZE : (units + 1) * BLOCK_UNIT);
}

/* Services without a handler: address requests are for parents, and a notification would make its sender our parent. */
static void deliver(const ROUTER_PEER *peer, RTS_UI8 service, const RTS_UI8 *payload, RTS_UI32 size)
{
    for (RTS_UI32 i = 0; i < RouterServiceCount; i++) {
        if (RouterServices[i].number == service) {
            COMM_COUNT(counters.handled);
            RouterServices[i].handler(peer, payload, size);
            return;
        }
    }
    COMM_COUNT(counters.ignored);
}

void RouterHandleData(const BLK_DRV *driver, const RTS_UI8 *data, RTS_UI32 size)
{
    HEADER header;
    ROUTER_PEER peer;

    if (!parse_header(data, size, &header)) {
        COMM_COUNT(counters.malformed);
        return;
    }
    if (!is_for_us(driver, data, &header)) {
        COMM_COUNT(counters.not_for_us);
        return;
    }
    if ((data[2] & FLAG_SIGNAL) != 0 || header.sender_words == 0) {
        COMM_COUNT(counters.ignored);
        return;
    }
    peer.driver = driver;
    peer.max_packet = max_packet(data[2]);
    peer.address_words = (RTS_UI8)header.sender_words;
    memcpy(peer.address, header.sender, 2 * header.sender_words);
    deliver(&peer, data[3], data + header.size, size - header.size);
}

RTS_UI32 RouterGetMaxPayload(const ROUTER_PEER *peer, RTS_UI32 address_words)
{
    RTS_UI32 header = header_size(HEADER_SIZE, address_words);

    return peer->max_packet > header ? peer->max_packet - header : 0;
}

RTS_RESULT RouterSend(const ROUTER_PEER *peer, RTS_UI8 service, const BLK_PART *parts, RTS_UI32 count)
{
    const BLK_DRV *driver = peer->driver;
    RTS_UI8 header[HEADER_SIZE + 4 * ROUTER_MAX_ADDRESS + 2] = {
        ROUTER_MAGIC,
        ROUTER_HOP_COUNT << HOP_SHIFT | ROUTER_HEADER_WORDS,
        ROUTER_PRIO_NORMAL << PRIO_SHIFT,
        service,
    };
    BLK_PART all[1 + ROUTER_MAX_PARTS];
    RTS_UI32 receiver = 2u * peer->address_words;
    RTS_UI32 size = header_size(HEADER_SIZE, (RTS_UI32)peer->address_words + driver->address_words);

    if (count > ROUTER_MAX_PARTS)
        return ERR_PARAMETER;
    header[5] = (RTS_UI8)(driver->address_words << 4 | peer->address_words);
    memcpy(header + HEADER_SIZE, peer->address, receiver);
    memcpy(header + HEADER_SIZE + receiver, driver->address, 2u * driver->address_words);
    all[0].data = header;
    all[0].size = size;
    for (RTS_UI32 i = 0; i < count; i++) {
        all[1 + i] = parts[i];
        size += parts[i].size;
    }
    return size > peer->max_packet ? ERR_NET_MSGSIZE : driver->send(driver, all, 1 + count);
}

bool RouterIsSamePeer(const ROUTER_PEER *a, const ROUTER_PEER *b)
{
    return a->driver == b->driver && a->address_words == b->address_words &&
           memcmp(a->address, b->address, 2u * a->address_words) == 0;
}

const ROUTER_COUNTERS *RouterGetCounters(void)
{
    return &counters;
}

RTS_RESULT CmpRouterEmbedded_Hook(CMP_HOOK hook)
{
    if (COMM_COUNTERS && hook == CH_INIT)
        CMP_CLEAR(counters);
    return ERR_OK;
}
