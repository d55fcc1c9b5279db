/*
 * fuzz_lines.c - whole conversations of seven peers on four lines at once: each gets what is its own, and afterwards
 * every line serves a new client.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: steps, each a byte (bits 0..2 the peer, bits 3..5 what it does), two bytes of length, low byte first, and as
 * many bytes. Peer 0 is on the serial line, 1 and 2 send datagrams, 3 and 4 have a connection, 5 and 6 are tools on CAN.
 * A peer has a client that puts in what a recording (make_corpus.py) cannot know: channel ids, sessions, CRCs.
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpPackets.h"
#include "can_client.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "fuzz.h"
#include "fuzz_serial_line.h"
#include "fuzz_sockets.h"

typedef enum {
    STEP_MESSAGE, /* of layer 7, on a channel that is opened when there is none */
    STEP_PACKAGE, /* of layer 4 */
    STEP_PACKET,  /* of layer 3, as it is */
    STEP_BYTES,   /* on the line; a datagram; frames, each after a byte: bits 0..3 its size, bit 4 to all */
    STEP_WAIT,    /* 10 ms for each unit of length */
    STEP_VANISH,  /* the client begins again without a word; a connection ends */
    STEP_OPEN,
    STEP_CLOSE,
} STEP;

enum {
    LINE_SERIAL,
    LINE_UDP,
    LINE_TCP = 3,
    LINE_CAN = 5,
    FUZZED = 7, /* peers */
    LATER_UDP = FUZZED,
    LATER_TCP,
    LATER_CAN,
    PEERS,

    HEAD = 3,
    L7_SIZE = 20, /* of the header in a recording */
    WAIT_MS = 10,
    BEFORE = 4, /* packages for an owner before */
    MAX_GRANTED = 64,
    FIRST_WORD = 0x0102, /* addresses of peers */
    FIRST_PORT = 50100,
    FIRST_TOOL = 200, /* addresses on CAN */
    LISTENER = SIM_CAN_NODES - 1,
    SIZE_MASK = 0x0F,
    TO_ALL = 0x10,
    BIT_RATE = 500000,
};

typedef struct {
    CLIENT client;
    CLIENT_LINK link;
    bool has_sent;
    RTS_UI16 granted[MAX_GRANTED]; /* channels, in turn */
    uint32_t grants;
    uint32_t seen; /* bytes on its connection that were looked at */
    CAN_TOOL *tool;
} PEER;

static PEER peers[PEERS];

static int line_of(const PEER *peer)
{
    static const int lines[PEERS] = {LINE_SERIAL, LINE_UDP, LINE_UDP, LINE_TCP, LINE_TCP,
                                     LINE_CAN,    LINE_CAN, LINE_UDP, LINE_TCP, LINE_CAN};

    return lines[peer - peers];
}

/* ---- what the device sends ---- */

static bool is_granted(const PEER *peer, RTS_UI16 channel)
{
    for (uint32_t i = 0; i < peer->grants && i < MAX_GRANTED; i++)
        if (peer->granted[i] == channel)
            return true;
    return false;
}

/* A package that belongs to a channel is sent only to the peer that was granted this channel. */
static void check_package(PEER *peer, const uint8_t *package, uint32_t size)
{
    FUZZ_CHECK(size >= sizeof(CHANNEL_HEADER));
    if (package[0] == CHANNEL_PKG_OPEN_RESP) {
        FUZZ_CHECK(size >= CLIENT_OLD_RESPONSE);
        if (BytesGet16(package + 12) == CHANNEL_OPEN_OK)
            peer->granted[peer->grants++ % MAX_GRANTED] = BytesGet16(package + 14);
    } else if ((package[0] & CHANNEL_META) == 0) {
        FUZZ_CHECK(is_granted(peer, BytesGet16(package + 2)));
    }
}

static void check_packet(PEER *peer, const uint8_t *packet, uint32_t size)
{
    uint32_t header;

    FUZZ_CHECK(size >= 8 && packet[0] == ROUTER_MAGIC);
    header = (8u + 2u * ((packet[5] >> 4) + (packet[5] & 0x0F)) + 1) & ~3u;
    FUZZ_CHECK(size >= header);
    if (packet[3] == ROUTER_SVC_CHANNEL)
        check_package(peer, packet + header, size - header);
}

/* Frames are of the device and for a tool that has sent something. */
static void check_frames(void)
{
    CAN_FRAME frame;

    while (SimCanReceive(LISTENER, &frame) == ERR_OK) {
        uint32_t target = frame.id >> CAN_TARGET_SHIFT & CAN_ADDRESS_MASK;
        bool is_sent = false;
        if ((frame.id & CAN_ADDRESS_MASK) >= CAN_TOOL_MIN)
            continue;
        for (uint32_t i = 0; i < PEERS; i++)
            is_sent |= line_of(&peers[i]) == LINE_CAN && peers[i].has_sent && peers[i].tool->address == target;
        FUZZ_CHECK((frame.id & CAN_ADDRESS_MASK) == DEVICE_NODE && is_sent && frame.size != 0);
        FUZZ_CHECK(IsoTpKind(frame.data, frame.size) != ISOTP_OTHER);
    }
}

static uint32_t take_datagram(const PEER *peer, uint8_t *packet)
{
    for (uint32_t i = 0; i < sockets.out_count; i++) {
        DATAGRAM *datagram = &sockets.out[i];
        uint32_t size = datagram->size;
        if (size == 0 || datagram->peer.ip != SOCKETS_OWN_IP || datagram->peer.port != FIRST_PORT + (peer - peers))
            continue;
        memcpy(packet, datagram->data, size);
        datagram->size = 0; /* taken */
        return size;
    }
    return 0;
}

/* Nothing was sent to an address from which nothing came. */
static void check_datagrams(void)
{
    for (uint32_t i = 0; i < sockets.out_count; i++)
        FUZZ_CHECK(sockets.out[i].size == 0);
    sockets.out_count = 0;
}

static CONNECTION *connection_of(const PEER *peer)
{
    return &sockets.tcp[peer == &peers[LATER_TCP] ? SOCKETS_TCP - 1 : peer - &peers[LINE_TCP]];
}

static uint32_t take_from_connection(PEER *peer, uint8_t *packet)
{
    const CONNECTION *connection = connection_of(peer);
    uint32_t there = connection->out_size - peer->seen;
    uint32_t size;

    if (there < sizeof(TCP_HEADER))
        return 0;
    FUZZ_CHECK(BytesGet32(connection->out + peer->seen) == (RTS_UI32)TCP_MAGIC);
    size = BytesGet32(connection->out + peer->seen + 4);
    FUZZ_CHECK(size > sizeof(TCP_HEADER) && size <= sizeof(TCP_HEADER) + BLK_MAX_SIZE);
    if (size > there)
        return 0;
    memcpy(packet, connection->out + peer->seen + sizeof(TCP_HEADER), size - sizeof(TCP_HEADER));
    peer->seen += size;
    return size - (uint32_t)sizeof(TCP_HEADER);
}

static RTS_UI32 receive(void *instance, RTS_UI8 *packet, RTS_UI32 capacity)
{
    static uint8_t data[SERIAL_LONGEST];
    PEER *peer = instance;
    uint32_t size;

    if (line_of(peer) == LINE_SERIAL)
        size = (uint32_t)serial_take(data);
    else if (line_of(peer) == LINE_UDP)
        size = take_datagram(peer, data);
    else if (line_of(peer) == LINE_TCP)
        size = take_from_connection(peer, data);
    else
        size = can_take(peer->tool, data, sizeof(data));
    if (size == 0)
        return 0;
    FUZZ_CHECK(peer->has_sent && size <= capacity);
    check_packet(peer, data, size);
    memcpy(packet, data, size);
    return size;
}

/* ---- what peers send ---- */

/* The listener takes part, so that what it has not looked at yet does not get lost. */
static void settle(void)
{
    can_settle();
    check_frames();
}

static void send_frames(const CAN_TOOL *tool, const uint8_t *data, uint32_t size)
{
    while (size != 0) {
        uint8_t head = *data++;
        uint32_t part = head & SIZE_MASK;
        size--;
        part = part < size ? part : size;
        part = part < CAN_CLASSIC_SIZE ? part : CAN_CLASSIC_SIZE;
        can_frame(tool, (head & TO_ALL) != 0 ? CAN_TO_ALL : DEVICE_NODE, data, (RTS_UI8)part);
        data += part;
        size -= part;
        settle();
    }
}

static void send_bytes(PEER *peer, const uint8_t *data, uint32_t size)
{
    peer->has_sent = true;
    if (line_of(peer) == LINE_SERIAL)
        serial_deliver(data, size);
    else if (line_of(peer) == LINE_UDP)
        sockets_give_datagram((SOCKADDRESS){SOCKETS_OWN_IP, (RTS_UI16)(FIRST_PORT + (peer - peers))}, data, size);
    else if (line_of(peer) == LINE_TCP)
        sockets_give(connection_of(peer), data, size);
    else
        send_frames(peer->tool, data, size);
    fakes_cycle(0);
}

static void send_on_can(PEER *peer, const uint8_t *packet, uint32_t size)
{
    peer->has_sent = true;
    (void)can_put(peer->tool, packet, size);
    settle();
}

static void send(void *instance, const RTS_UI8 *packet, RTS_UI32 size)
{
    static uint8_t frame[2 * CLIENT_LONGEST + 8];
    PEER *peer = instance;

    if (line_of(peer) == LINE_SERIAL)
        send_bytes(peer, frame, (uint32_t)serial_frame(packet, size, frame));
    else if (line_of(peer) == LINE_UDP)
        send_bytes(peer, packet, size);
    else if (line_of(peer) == LINE_TCP)
        send_bytes(peer, frame, sockets_frame(packet, size, frame));
    else
        send_on_can(peer, packet, size);
}

/* ---- a step ---- */

/* All that has come for a peer; the last grant is the channel of its client. */
static void drain(PEER *peer)
{
    uint8_t packet[BLK_MAX_SIZE];
    uint32_t grants = peer->grants;

    while (receive(peer, packet, sizeof(packet)) != 0) {
    }
    if (peer->grants != grants) {
        peer->client.channel = peer->granted[(peer->grants - 1) % MAX_GRANTED];
        peer->client.sent = 0;
        peer->client.received = 0;
    }
}

/* Sessions of the client for "ssss" in the header and "SSSS" in tags, the length of the content for FF FF FF FF. */
static void complete(const CLIENT *client, uint8_t *message, uint32_t size)
{
    if (memcmp(message + 8, "ssss", 4) == 0)
        BytesPut32(message + 8, client->session);
    if (BytesGet32(message + 12) == 0xFFFFFFFF)
        BytesPut32(message + 12, size - L7_SIZE);
    for (uint32_t i = L7_SIZE; i + 4 <= size; i++)
        if (memcmp(message + i, "SSSS", 4) == 0)
            BytesPut32(message + i, client->app_session);
}

static void send_message(PEER *peer, uint8_t *message, uint32_t size)
{
    static uint8_t reply[NETSERVER_MESSAGE_SIZE];
    BTAG_READER tags;
    uint32_t taken, header;

    if (size < L7_SIZE)
        return;
    if (peer->client.channel == 0)
        client_send_open(&peer->client, 7, NETSERVER_MESSAGE_SIZE);
    drain(peer);
    complete(&peer->client, message, size);
    client_send_message(&peer->client, message, size);
    taken = client_take_message(&peer->client, reply);
    if (taken == 0)
        return;
    header = 4u + BytesGet16(reply + 2); /* as in the request */
    FUZZ_CHECK(taken >= header && BytesGet32(reply + 12) == taken - header);
    BTagReaderInit(&tags, reply + header, taken - header);
    (void)client_learn(&peer->client, &tags);
}

/* Channel, version and CRC are right. */
static void send_package(PEER *peer, uint8_t *package, uint32_t size)
{
    if (size >= sizeof(CHANNEL_META_HEADER) && (package[0] & CHANNEL_META) != 0)
        client_seal(package, size);
    else if (size >= sizeof(CHANNEL_HEADER))
        BytesPut16(package + 2, peer->client.channel);
    client_send_package(&peer->client, package, size);
}

static void begin(PEER *peer)
{
    client_init(&peer->client, (RTS_UI16)(FIRST_WORD + (peer - peers)));
    peer->client.link = &peer->link;
}

static void vanish(PEER *peer)
{
    if (line_of(peer) == LINE_CAN)
        can_restart(peer->tool);
    else if (line_of(peer) == LINE_TCP)
        connection_of(peer)->ended = true;
    else if (line_of(peer) == LINE_UDP)
        sockets.refused = (SOCKADDRESS){SOCKETS_OWN_IP, (RTS_UI16)(FIRST_PORT + (peer - peers))};
    begin(peer);
}

static void step(PEER *peer, STEP what, uint8_t *data, uint32_t size)
{
    switch (what) {
    case STEP_MESSAGE:
        send_message(peer, data, size);
        break;
    case STEP_PACKAGE:
        send_package(peer, data, size < client_room(&peer->client) ? size : client_room(&peer->client));
        break;
    case STEP_PACKET:
        send(peer, data, size < CLIENT_LONGEST ? size : CLIENT_LONGEST);
        break;
    case STEP_BYTES:
        send_bytes(peer, data, size);
        break;
    case STEP_WAIT:
        fakes_cycle(WAIT_MS * size);
        break;
    case STEP_VANISH:
        vanish(peer);
        break;
    case STEP_OPEN:
        client_send_open(&peer->client, 1 + size, NETSERVER_MESSAGE_SIZE);
        break;
    case STEP_CLOSE:
        client_send_close(&peer->client);
        peer->client.channel = 0;
        break;
    }
    fakes_cycle(1);
    settle();
    for (uint32_t i = 0; i < PEERS; i++)
        drain(&peers[i]);
    check_datagrams();
}

/* A client that has the device to itself opens a channel and asks who it is. */
static void check_served(PEER *peer)
{
    REPLY reply;

    begin(peer);
    client_send_open(&peer->client, 1, NETSERVER_MESSAGE_SIZE);
    for (uint32_t i = 0; client_take_open(&peer->client) != CHANNEL_OPEN_OK; i++)
        FUZZ_CHECK(i < BEFORE); /* the close for an owner before it comes first */
    FUZZ_CHECK(client_request(&peer->client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply));
}

/* ---- the target ---- */

static void start(void)
{
    sockets_start(true);
    sockets.dialled = SOCKETS_TCP - 1;
    memset(peers, 0, sizeof(peers));
    for (uint32_t i = 0; i < PEERS; i++) {
        peers[i].link = (CLIENT_LINK){send, receive, &peers[i]};
        begin(&peers[i]);
    }
    can_start(BIT_RATE, 0);
    SimCanStart(LISTENER);
    for (uint32_t i = 0; i < PEERS; i++)
        if (line_of(&peers[i]) == LINE_CAN)
            peers[i].tool = can_tool((RTS_UI8)(FIRST_TOOL + i));
    fakes_cycle(0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t content[1 << 16];

    start();
    for (size_t i = 0; size - i >= HEAD;) {
        PEER *peer = &peers[(data[i] & 7) % FUZZED];
        STEP what = (STEP)(data[i] >> 3 & 7);
        uint32_t length = BytesGet16(data + i + 1);
        i += HEAD;
        if (what != STEP_WAIT && what != STEP_OPEN) {
            if (length > size - i)
                length = (uint32_t)(size - i);
            memcpy(content, data + i, length);
            i += length;
        }
        step(peer, what, content, length);
    }
    fakes_cycle(CHANNEL_IDLE_MS);
    sockets.dialled = SOCKETS_TCP;
    fakes_cycle(0);
    settle();
    fakes.line_out_size = 0;
    check_served(&peers[LATER_UDP]);
    check_served(&peers[LATER_TCP]);
    check_served(&peers[LATER_CAN]);
    serial_deliver((const uint8_t *)"#>#>", 4); /* the end of what was begun */
    check_served(&peers[LINE_SERIAL]);
    return 0;
}

/* ---- inputs ---- */

/* Three open channels, time passes, one vanishes and one closes; two tools on CAN of which one leaves a packet in its
 * midst, and a scan. The others are recordings. */
size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const uint8_t three[] = {0x30, 1, 0, 0x31, 2, 0, 0x33, 3, 0, 0x20, 0x40, 0, 0x2B, 0, 0, 0x38, 0, 0};
    static const uint8_t can[] = {0x35, 1,    0,    0x1E, 9,    0, 8,    0x10, 0x60, 0xC5, 0x6B, 0x40,
                                  0x40, 0x00, 0x11, 0x36, 2,    0, 0x2D, 0,    0,    0x1D, 9,    0,
                                  0x18, 0x40, 0x01, 0x00, 0x04, 1, 2,    3,    4,    0x20, 0xC8, 0};
    static const struct {
        const uint8_t *data;
        size_t size;
    } seeds[] = {{three, sizeof(three)}, {can, sizeof(can)}};

    if (index >= RTS_COUNT(seeds) || seeds[index].size > capacity)
        return 0;
    memcpy(data, seeds[index].data, seeds[index].size);
    return seeds[index].size;
}
