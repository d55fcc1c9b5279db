/*
 * CmpChannelServerEmbedded.c - layer 4: one reliable channel that carries requests and replies.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpChannelServerEmbedded.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpChecksum.h"
#include "CmpSrv.h"
#include "SysTarget.h"
#include "SysTime.h"
#include "rts_config.h"

enum {
    REPEAT_FIRST_MS = 1000, /* doubles with each repetition */
    REPEAT_COUNT = 4,
    REPEAT_GAP_MS = 100, /* between repetitions that the client's own repetitions ask for */
    MIN_PAYLOAD = CHANNEL_FIRST_SIZE + 12, /* a path that carries less is not worth a channel */
};

/* The channel; id 0 when closed. Times are ms of the clock handed in. */
static struct {
    ROUTER_PEER peer;
    RTS_UI32 request_id; /* of the open request */
    RTS_UI32 limit;      /* largest message, both directions */
    RTS_UI32 payload;    /* largest package of this channel */
    RTS_UI32 last_received;
    RTS_UI32 last_sent;
    RTS_UI16 id;
    RTS_UI8 address_words; /* of both addresses, agreed */
    bool fresh;            /* no block has arrived yet */
    bool open_due;         /* the open response is waiting for room in the driver */
    bool ack_due;
    bool missing_due; /* the acknowledgement asks for a repetition */
} channel;

/* The request on its way in. */
static struct {
    RTS_UI32 block; /* highest block received in order */
    RTS_UI32 gap;   /* lowest block that has come too early since then; 0: none */
    RTS_UI32 length;
    RTS_UI32 crc;
    RTS_UI32 fill;
    bool active;
    RTS_UI8 data[NETSERVER_MESSAGE_SIZE];
} rx;

/* The reply on its way out: blocks first..last. Also kept after the acknowledgement, as nothing needs the room. */
static struct {
    RTS_UI32 first;
    RTS_UI32 last;
    RTS_UI32 next;  /* to be sent; last + 1 when all are */
    RTS_UI32 acked; /* highest acknowledged; last when all are */
    RTS_UI32 size;
    RTS_UI32 crc;
    RTS_UI32 sent_at;
    RTS_UI32 repeats;
    RTS_UI32 missed; /* block the client last asked for; 0: none */
    RTS_UI32 missed_at;
    RTS_UI8 data[NETSERVER_MESSAGE_SIZE];
} tx;

static struct {
    CHANNEL_COUNTERS counters;
    RTS_UI16 last_id;
    RTS_UI32 complained_at;
    bool complained;
} server;

/* ---- packages without blocks ---- */

static RTS_RESULT send_package(const ROUTER_PEER *peer, const RTS_UI8 *package, RTS_UI32 size)
{
    BLK_PART part = {package, size};

    return RouterSend(peer, ROUTER_SVC_CHANNEL, &part, 1);
}

static RTS_UI32 meta_crc(const RTS_UI8 *package, RTS_UI32 size)
{
    static const RTS_UI8 zeros[4] = {0};
    RTS_UI32 crc = CRC32Update(0, package, 4);

    crc = CRC32Update(crc, zeros, sizeof(zeros));
    return CRC32Update(crc, package + CHANNEL_META_SIZE, size - CHANNEL_META_SIZE);
}

/* Completes and sends a meta package whose body is in place. */
static RTS_RESULT send_meta(const ROUTER_PEER *peer, RTS_UI8 type, RTS_UI8 *package, RTS_UI32 size)
{
    package[0] = type;
    package[1] = 0;
    BytesPut16(package + 2, CHANNEL_VERSION);
    BytesPut32(package + 4, meta_crc(package, size));
    return send_package(peer, package, size);
}

static RTS_RESULT send_open_response(const ROUTER_PEER *peer, RTS_UI32 request_id, RTS_UI16 result, RTS_UI16 id)
{
    RTS_UI8 package[CHANNEL_OPEN_RESP_SIZE] = {0};

    BytesPut32(package + 8, request_id);
    BytesPut16(package + 12, result);
    BytesPut16(package + 14, id);
    if (result == CHANNEL_OPEN_OK) {
        BytesPut32(package + 16, channel.limit);
        package[21] = channel.address_words;
    }
    return send_meta(peer, CHANNEL_PKG_OPEN_RESP, package, sizeof(package));
}

static void send_close(const ROUTER_PEER *peer, RTS_UI16 id, RTS_RESULT error)
{
    RTS_UI8 package[CHANNEL_CLOSE_SIZE];

    BytesPut16(package + 8, id);
    BytesPut16(package + 10, error);
    (void)send_meta(peer, CHANNEL_PKG_CLOSE, package, sizeof(package)); /* a courtesy: the peer notices anyway */
}

static void send_rts_info(const ROUTER_PEER *peer)
{
    RTS_UI8 package[CHANNEL_META_SIZE + 2];

    BytesPut16(package + 8, CHANNEL_MAX_CHANNELS);
    (void)send_meta(peer, CHANNEL_PKG_RTSINFO_RESP, package, sizeof(package));
}

static RTS_RESULT send_ack(void)
{
    RTS_UI8 package[CHANNEL_ACK_SIZE] = {CHANNEL_PKG_ACK, channel.missing_due ? CHANNEL_FLAG_MISSING : 0};

    BytesPut16(package + 2, channel.id);
    BytesPut32(package + 4, rx.block);
    return send_package(&channel.peer, package, sizeof(package));
}

static void send_keepalive(void)
{
    RTS_UI8 package[CHANNEL_KEEPALIVE_SIZE] = {CHANNEL_PKG_KEEPALIVE, 0};

    BytesPut16(package + 2, channel.id);
    (void)send_package(&channel.peer, package, sizeof(package));
}

/* ---- life of the channel ---- */

static void forget_channel(void)
{
    channel.id = 0;
    SrvEndSession();
}

static void close_channel(RTS_RESULT error)
{
    server.counters.failed++;
    send_close(&channel.peer, channel.id, error);
    forget_channel();
}

/* 1..CHANNEL_ID_MAX, and another one than last time. */
static RTS_UI16 new_id(void)
{
    RTS_UI32 id = 1 + SysTargetRandom() % CHANNEL_ID_MAX;

    if (id == server.last_id)
        id = 1 + id % CHANNEL_ID_MAX;
    server.last_id = (RTS_UI16)id;
    return server.last_id;
}

typedef struct {
    RTS_UI32 request_id;
    RTS_UI32 limit;
    RTS_UI32 payload;
    RTS_UI8 address_words;
} OPEN_REQUEST;

/* False when this path or buffer size is no basis for a channel. */
static bool read_open_request(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size, OPEN_REQUEST *request)
{
    RTS_UI32 words = (RTS_UI32)peer->address_words + peer->driver->address_words;

    if (size < CHANNEL_META_SIZE + 8)
        return false;
    request->request_id = BytesGet32(data + 8);
    request->limit = BytesGet32(data + 12);
    if (size >= CHANNEL_OPEN_REQ_SIZE && data[16] > words)
        words = data[16] < 2 * ROUTER_MAX_ADDRESS ? data[16] : 2 * ROUTER_MAX_ADDRESS;
    if (request->limit > NETSERVER_MESSAGE_SIZE)
        request->limit = NETSERVER_MESSAGE_SIZE;
    request->address_words = (RTS_UI8)words;
    request->payload = RouterGetMaxPayload(peer, words);
    return request->limit >= CHANNEL_MIN_MESSAGE && request->payload >= MIN_PAYLOAD;
}

/* Somebody is using the channel and has shown that he may. */
static bool is_taken(const ROUTER_PEER *peer, RTS_UI32 now_ms)
{
    return channel.id != 0 && !RouterIsSamePeer(peer, &channel.peer) && SrvIsLoggedIn() &&
           now_ms - channel.last_received < CHANNEL_IDLE_MS;
}

/* The client asks again because our response was lost. */
static bool is_repetition(const ROUTER_PEER *peer, const OPEN_REQUEST *request)
{
    return channel.id != 0 && channel.fresh && request->request_id == channel.request_id &&
           RouterIsSamePeer(peer, &channel.peer);
}

static void open_channel(const ROUTER_PEER *peer, const OPEN_REQUEST *request)
{
    if (channel.id != 0 && !RouterIsSamePeer(peer, &channel.peer))
        send_close(&channel.peer, channel.id, ERR_CHS_CLOSED);
    forget_channel();
    memset(&channel, 0, sizeof(channel));
    channel.peer = *peer;
    channel.request_id = request->request_id;
    channel.limit = request->limit;
    channel.payload = request->payload;
    channel.address_words = request->address_words;
    channel.id = new_id();
    channel.fresh = true;
    rx.block = 0;
    rx.gap = 0;
    rx.active = false;
    tx.first = 1;
    tx.last = 0;
    tx.next = 1;
    tx.acked = 0;
    server.counters.opened++;
}

static void handle_open(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    OPEN_REQUEST request;

    if (!read_open_request(peer, data, size, &request)) {
        server.counters.malformed++;
        return;
    }
    if (is_taken(peer, now_ms)) {
        server.counters.refused++;
        (void)send_open_response(peer, request.request_id, CHANNEL_OPEN_NO_CHANNEL, CHANNEL_ID_NONE);
        return;
    }
    if (!is_repetition(peer, &request))
        open_channel(peer, &request);
    channel.last_received = now_ms;
    channel.open_due = true;
}

/* ---- sending the reply ---- */

/* Bytes of the reply before block `block`. */
static RTS_UI32 block_offset(RTS_UI32 block)
{
    if (block == tx.first)
        return 0;
    return channel.payload - CHANNEL_FIRST_SIZE + (block - tx.first - 1) * (channel.payload - CHANNEL_DATA_SIZE);
}

static void start_reply(RTS_UI32 size)
{
    RTS_UI32 in_first = channel.payload - CHANNEL_FIRST_SIZE;
    RTS_UI32 in_next = channel.payload - CHANNEL_DATA_SIZE;
    RTS_UI32 rest = size > in_first ? size - in_first : 0;

    tx.first = tx.last + 1;
    tx.last = tx.first + (rest + in_next - 1) / in_next;
    tx.next = tx.first;
    tx.size = size;
    tx.crc = CRC32Update(0, tx.data, size);
    tx.repeats = 0;
    tx.missed = 0;
}

static RTS_RESULT send_block(RTS_UI32 block)
{
    RTS_UI8 header[CHANNEL_FIRST_SIZE] = {CHANNEL_PKG_DATA, 0};
    RTS_UI32 offset = block_offset(block);
    RTS_UI32 end = block == tx.last ? tx.size : block_offset(block + 1);
    BLK_PART parts[2] = {{header, CHANNEL_DATA_SIZE}, {tx.data + offset, end - offset}};

    BytesPut16(header + 2, channel.id);
    BytesPut32(header + 4, block);
    BytesPut32(header + 8, rx.block);
    if (block == tx.first) {
        header[1] = CHANNEL_FLAG_FIRST;
        BytesPut32(header + 12, tx.size);
        BytesPut32(header + 16, tx.crc);
        parts[0].size = CHANNEL_FIRST_SIZE;
    }
    return RouterSend(&channel.peer, ROUTER_SVC_CHANNEL, parts, 2);
}

/* Sends what is due, in order of urgency, as far as the driver has room. */
static void pump(RTS_UI32 now_ms)
{
    if (channel.open_due) {
        if (send_open_response(&channel.peer, channel.request_id, CHANNEL_OPEN_OK, channel.id) != ERR_OK)
            return;
        channel.open_due = false;
        channel.last_sent = now_ms;
    }
    if (channel.ack_due) {
        if (send_ack() != ERR_OK)
            return;
        channel.ack_due = false;
        channel.missing_due = false;
        channel.last_sent = now_ms;
    }
    while (tx.next <= tx.last && send_block(tx.next) == ERR_OK) {
        tx.next++;
        tx.sent_at = now_ms;
        channel.last_sent = now_ms;
    }
}

static bool is_waiting_for_ack(void)
{
    return tx.acked < tx.last && tx.next > tx.last;
}

static void repeat_reply(void)
{
    tx.next = tx.acked < tx.first ? tx.first : tx.acked + 1;
    server.counters.repeats++;
}

/* The client asks for the block after `ack`. Some ask with each block that comes after it: once is enough. */
static void handle_missing(RTS_UI32 ack, RTS_UI32 now_ms)
{
    if (tx.next == ack + 1 || (tx.missed == ack + 1 && now_ms - tx.missed_at < REPEAT_GAP_MS))
        return;
    tx.missed = ack + 1;
    tx.missed_at = now_ms;
    repeat_reply();
}

static void handle_ack(RTS_UI32 ack, bool missing, RTS_UI32 now_ms)
{
    if (ack < tx.acked || ack > tx.last)
        return;
    if (ack > tx.acked)
        tx.repeats = 0;
    tx.acked = ack;
    if (tx.next <= ack)
        tx.next = ack + 1;
    if (missing && ack < tx.last)
        handle_missing(ack, now_ms);
}

/* ---- receiving the request ---- */

static void handle_message(void)
{
    rx.active = false;
    if (CRC32Update(0, rx.data, rx.length) != rx.crc) {
        close_channel(ERR_CHS_CHECKSUM);
        return;
    }
    tx.acked = tx.last; /* whoever asks again has the answer before */
    RTS_UI32 size = SrvHandleMessage(rx.data, rx.length, tx.data, channel.limit);
    if (size == 0)
        close_channel(ERR_CHS_REQNOTHANDLED);
    else
        start_reply(size);
}

static RTS_RESULT start_message(const RTS_UI8 *data, RTS_UI32 size)
{
    if (size < CHANNEL_FIRST_SIZE)
        return ERR_CHS_PROTOCOL;
    rx.length = BytesGet32(data + 12);
    rx.crc = BytesGet32(data + 16);
    rx.fill = 0;
    if (rx.length == 0)
        return ERR_CHS_PROTOCOL;
    if (rx.length > channel.limit)
        return ERR_CHS_MESSAGESIZE;
    rx.active = true;
    return ERR_OK;
}

/* Takes the block that is next in order. */
static void accept_block(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 header = CHANNEL_DATA_SIZE;

    if (data[1] & CHANNEL_FLAG_FIRST) {
        RTS_RESULT result = start_message(data, size);
        if (result != ERR_OK) {
            close_channel(result);
            return;
        }
        header = CHANNEL_FIRST_SIZE;
    }
    size -= header;
    if (!rx.active || size > rx.length - rx.fill) {
        close_channel(ERR_CHS_PROTOCOL);
        return;
    }
    memcpy(rx.data + rx.fill, data + header, size);
    rx.fill += size;
    rx.block++;
    rx.gap = 0;
    if (rx.fill == rx.length)
        handle_message();
}

/* A block received before: its acknowledgement was lost, and perhaps the reply too. */
static void handle_duplicate(RTS_UI32 now_ms)
{
    server.counters.duplicates++;
    channel.ack_due = true;
    if (is_waiting_for_ack() && now_ms - tx.sent_at >= REPEAT_GAP_MS)
        repeat_reply();
}

/* A block before this one is missing. Said once per run of the client through its blocks, or one loss would be
 * answered with a storm of repetitions. */
static void handle_gap(RTS_UI32 block)
{
    server.counters.gaps++;
    if (rx.gap == 0 || block <= rx.gap) {
        rx.gap = block;
        channel.ack_due = true;
        channel.missing_due = true;
    }
}

static void handle_data(const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    if (size < CHANNEL_DATA_SIZE) {
        server.counters.malformed++;
        return;
    }
    RTS_UI32 block = BytesGet32(data + 4);
    channel.fresh = false;
    handle_ack(BytesGet32(data + 8), false, now_ms);
    if (block == rx.block + 1)
        accept_block(data, size);
    else if (block <= rx.block)
        handle_duplicate(now_ms);
    else
        handle_gap(block);
}

/* ---- packages ---- */

/* Tells whoever uses a channel that is not his (or not any more), so that he need not wait for a time-out. */
static void complain(const ROUTER_PEER *peer, RTS_UI16 id, RTS_UI32 now_ms)
{
    server.counters.foreign++;
    if (server.complained && now_ms - server.complained_at < CHANNEL_COMPLAINT_MS)
        return;
    server.complained = true;
    server.complained_at = now_ms;
    send_close(peer, id, ERR_CHS_CHINVALID);
}

static bool is_owner(const ROUTER_PEER *peer, RTS_UI16 id)
{
    return channel.id != 0 && id == channel.id && RouterIsSamePeer(peer, &channel.peer);
}

static void handle_channel_package(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    if (size < CHANNEL_KEEPALIVE_SIZE || (data[1] & CHANNEL_FLAG_TO_SERVER) == 0) {
        server.counters.malformed++;
        return;
    }
    if (!is_owner(peer, BytesGet16(data + 2))) {
        complain(peer, BytesGet16(data + 2), now_ms);
        return;
    }
    channel.last_received = now_ms;
    if (data[0] == CHANNEL_PKG_DATA)
        handle_data(data, size, now_ms);
    else if (data[0] == CHANNEL_PKG_ACK && size >= CHANNEL_ACK_SIZE)
        handle_ack(BytesGet32(data + 4), (data[1] & CHANNEL_FLAG_MISSING) != 0, now_ms);
    else if (data[0] != CHANNEL_PKG_KEEPALIVE)
        server.counters.malformed++;
}

static void handle_close(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size)
{
    if (size < CHANNEL_CLOSE_SIZE)
        server.counters.malformed++;
    else if (is_owner(peer, BytesGet16(data + 8)))
        forget_channel();
    else
        server.counters.foreign++;
}

static void handle_meta_package(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    if (size < CHANNEL_META_SIZE || BytesGet16(data + 2) >> 8 != CHANNEL_VERSION >> 8 ||
        BytesGet32(data + 4) != meta_crc(data, size)) {
        server.counters.malformed++;
        return;
    }
    if (data[0] == CHANNEL_PKG_OPEN_REQ)
        handle_open(peer, data, size, now_ms);
    else if (data[0] == CHANNEL_PKG_CLOSE_REQ)
        handle_close(peer, data, size);
    else if (data[0] == CHANNEL_PKG_RTSINFO_REQ)
        send_rts_info(peer);
}

RTS_NOINLINE void ChannelHandlePackage(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    if (size == 0)
        server.counters.malformed++;
    else if (data[0] & CHANNEL_META)
        handle_meta_package(peer, data, size, now_ms);
    else
        handle_channel_package(peer, data, size, now_ms);
    if (channel.id != 0)
        pump(now_ms);
}

/* ---- time ---- */

static void repeat_when_overdue(RTS_UI32 now_ms)
{
    if (!is_waiting_for_ack() || tx.repeats >= REPEAT_COUNT ||
        now_ms - tx.sent_at < (RTS_UI32)REPEAT_FIRST_MS << tx.repeats)
        return;
    tx.repeats++;
    repeat_reply();
}

void ChannelCycle(RTS_UI32 now_ms)
{
    if (channel.id == 0)
        return;
    if (now_ms - channel.last_received >= CHANNEL_TIMEOUT_MS) {
        close_channel(ERR_CHS_TIMEOUT);
        return;
    }
    repeat_when_overdue(now_ms);
    pump(now_ms);
    if (now_ms - channel.last_sent >= CHANNEL_KEEPALIVE_MS) {
        channel.last_sent = now_ms;
        send_keepalive();
    }
}

const CHANNEL_COUNTERS *ChannelGetCounters(void)
{
    return &server.counters;
}

static void reset_all(void)
{
    memset(&channel, 0, sizeof(channel));
    memset(&rx, 0, sizeof(rx));
    memset(&tx, 0, sizeof(tx));
    memset(&server, 0, sizeof(server));
}

RTS_RESULT CmpChannelServerEmbedded_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        reset_all();
    else if (hook == CH_COMM_CYCLE)
        ChannelCycle(SysTimeGetMs());
    else if (hook == CH_EXIT_COMM && channel.id != 0)
        close_channel(ERR_CHS_SHUTDOWN);
    return ERR_OK;
}
