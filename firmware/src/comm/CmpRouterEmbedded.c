/*
 * CmpRouterEmbedded.c - layer 3 of a leaf node: takes packets from block drivers, answers to their senders.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpRouterEmbedded.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpPackets.h"
#include "rts_config.h"

enum {
    HEADER_WORDS = sizeof(ROUTER_HEADER) / 2,
    WORDS_MASK = (1 << ROUTER_HOP_SHIFT) - 1,
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
    const ROUTER_HEADER *fixed = (const ROUTER_HEADER *)data;

    if (size < sizeof(*fixed) || size > BLK_LONGEST_PACKET || fixed->magic != ROUTER_MAGIC)
        return false;
    RTS_UI32 words = fixed->hops & WORDS_MASK;
    if (words < HEADER_WORDS)
        return false;
    header->receiver_words = fixed->lengths & 0x0F;
    header->sender_words = fixed->lengths >> 4;
    header->size = header_size(2 * words, header->receiver_words + header->sender_words);
    if (header->size > size)
        return false;
    header->receiver = data + 2 * words;
    header->sender = header->receiver + 2 * header->receiver_words;
    return true;
}

#if SRV_OTHER_CLIENTS
/* Ones in the last `bits`, zeros before them. */
static bool has_ones(const HEADER *header, RTS_UI32 bits)
{
    for (RTS_UI32 i = 2 * header->receiver_words; i-- > 0; bits -= bits < 8 ? bits : 8)
        if (header->receiver[i] != (bits < 8 ? (1u << bits) - 1 : 0xFF))
            return false;
    return true;
}

/* Ones alone: to all nodes, as no receiver is. */
static bool is_to_all(const BLK_DRV *driver, const HEADER *header)
{
    return has_ones(header, 16 * header->receiver_words) ||
           (header->receiver_words == driver->address_words && driver->address_bits != 0 &&
            has_ones(header, driver->address_bits));
}
#else
static bool is_to_all(const BLK_DRV *driver, const HEADER *header)
{
    RTS_UNUSED(driver);
    RTS_UNUSED(header);
    return false;
}
#endif

static bool is_for_us(const BLK_DRV *driver, const ROUTER_HEADER *fixed, const HEADER *header)
{
    if ((fixed->flags & ROUTER_FLAG_RELATIVE) != 0 || fixed->hops >> ROUTER_HOP_SHIFT == 0)
        return false;
    if (driver->point_to_point || header->receiver_words == 0 || is_to_all(driver, header))
        return true;
    return header->receiver_words == driver->address_words &&
           memcmp(header->receiver, driver->address, 2 * header->receiver_words) == 0;
}

/* The length a sender announces limits what its path carries back; 0 means nothing was said. */
static RTS_UI16 max_packet(RTS_UI8 flags)
{
    RTS_UI32 units = flags & 0x0F;

    return (RTS_UI16)(units == 0 ? BLK_MAX_SIZE : (units + 1) * ROUTER_BLOCK_UNIT);
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

/* The sender's address begins with its network address, which is replaced if the driver knows the real one. */
static void locate(ROUTER_PEER *peer, RTS_UI64 endpoint)
{
#if COMM_ENDPOINTS
    peer->endpoint = endpoint;
    if (peer->address_words >= peer->driver->peer_words)
        memcpy(peer->address, peer->driver->peer_address, 2u * peer->driver->peer_words);
#else
    RTS_UNUSED(peer);
    RTS_UNUSED(endpoint);
#endif
}

static void handle(const BLK_DRV *driver, RTS_UI64 endpoint, const RTS_UI8 *data, RTS_UI32 size)
{
    const ROUTER_HEADER *fixed = (const ROUTER_HEADER *)data;
    HEADER header;
    ROUTER_PEER peer;

    if (!parse_header(data, size, &header)) {
        COMM_COUNT(counters.malformed);
        return;
    }
    if (!is_for_us(driver, fixed, &header)) {
        COMM_COUNT(counters.not_for_us);
        return;
    }
    if ((fixed->flags & ROUTER_FLAG_SIGNAL) != 0 || header.sender_words == 0) {
        COMM_COUNT(counters.ignored);
        return;
    }
    peer.driver = driver;
    peer.max_packet = max_packet(fixed->flags);
    peer.address_words = (RTS_UI8)header.sender_words;
    memcpy(peer.address, header.sender, 2 * header.sender_words);
    locate(&peer, endpoint);
    deliver(&peer, fixed->service, data + header.size, size - header.size);
}

void RouterHandleData(const BLK_DRV *driver, const RTS_UI8 *data, RTS_UI32 size)
{
    handle(driver, 0, data, size);
}

#if COMM_ENDPOINTS
void RouterHandleDataFrom(const BLK_DRV *driver, RTS_UI64 endpoint, const RTS_UI8 *data, RTS_UI32 size)
{
    handle(driver, endpoint, data, size);
}

void RouterUnreachable(const BLK_DRV *driver, RTS_UI64 endpoint)
{
    for (RTS_UI32 i = 0; i < RouterServiceCount; i++)
        if (RouterServices[i].unreachable != NULL)
            RouterServices[i].unreachable(driver, endpoint);
}

bool RouterNeeds(const BLK_DRV *driver)
{
    for (RTS_UI32 i = 0; i < RouterServiceCount; i++)
        if (RouterServices[i].needs != NULL && RouterServices[i].needs(driver))
            return true;
    return false;
}
#endif

RTS_UI32 RouterGetMaxPayload(const ROUTER_PEER *peer, RTS_UI32 address_words)
{
    RTS_UI32 header = header_size(sizeof(ROUTER_HEADER), address_words);

    return peer->max_packet > header ? peer->max_packet - header : 0;
}

static RTS_UI8 *append(RTS_UI8 *end, const void *data, RTS_UI32 size)
{
    memcpy(end, data, size);
    return end + size;
}

RTS_RESULT RouterSend(const ROUTER_PEER *peer, RTS_UI8 service, const BLK_PART *parts, RTS_UI32 count)
{
    const BLK_DRV *driver = peer->driver;
    const ROUTER_HEADER fixed = {
        ROUTER_MAGIC,
        ROUTER_HOP_COUNT << ROUTER_HOP_SHIFT | HEADER_WORDS,
        ROUTER_PRIO_NORMAL << ROUTER_PRIO_SHIFT,
        service,
        0,
        (RTS_UI8)(driver->address_words << 4 | peer->address_words),
    };
    RTS_UI8 header[sizeof(fixed) + 4 * ROUTER_MAX_ADDRESS + 2];
    BLK_PART all[1 + ROUTER_MAX_PARTS];
    RTS_UI8 *end = header;

    if (count > ROUTER_MAX_PARTS)
        return ERR_NET_MSGSIZE;
    end = append(end, &fixed, sizeof(fixed));
    end = append(end, peer->address, 2u * peer->address_words);
    end = append(end, driver->address, 2u * driver->address_words);
    BytesPut16(end, 0); /* the filler, if there is one */
    RTS_UI32 size = header_size(0, (RTS_UI32)(end - header) / 2);
    all[0].data = header;
    all[0].size = size;
    for (RTS_UI32 i = 0; i < count; i++) {
        all[1 + i] = parts[i];
        size += parts[i].size;
    }
    return size > peer->max_packet ? ERR_NET_MSGSIZE : driver->send(peer, all, 1 + count);
}

/* The length of an address and the address are compared in one piece. */
bool RouterIsSamePeer(const ROUTER_PEER *a, const ROUTER_PEER *b)
{
    enum { ADDRESS = offsetof(ROUTER_PEER, address_words) };

#if COMM_ENDPOINTS
    if (a->endpoint != b->endpoint)
        return false;
#endif
    return a->driver == b->driver && memcmp((const RTS_UI8 *)a + ADDRESS, (const RTS_UI8 *)b + ADDRESS,
                                            sizeof(a->address_words) + 2u * a->address_words) == 0;
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
