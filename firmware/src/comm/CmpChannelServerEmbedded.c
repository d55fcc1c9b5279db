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
    /* Length and CRC of a message travel before its bytes and fill the first block together with them. */
    PREFIX_SIZE = CHANNEL_FIRST_SIZE - CHANNEL_DATA_SIZE,
    MIN_ROOM = PREFIX_SIZE + 12, /* a path whose packets carry less is not worth a channel */
};

typedef RTS_UI8 MESSAGE[PREFIX_SIZE + NETSERVER_MESSAGE_SIZE]; /* after its length and CRC */

/* The request on its way in. */
typedef struct {
    RTS_UI32 block; /* number of the highest block received in order */
    RTS_UI32 gap;   /* the nearest block that has come too early since then, counted from there; 0: none */
    RTS_UI32 fill;
    RTS_UI32 left; /* bytes still missing; 0 between requests */
} RECEIVER;

/* The reply on its way out. It is kept after the acknowledgement, as nothing needs the room. What concerns one reply
 * counts its blocks, so that their numbers may wrap. */
typedef struct {
    RTS_UI32 base; /* number of the last block before the reply */
    RTS_UI32 count;
    RTS_UI32 sent;
    RTS_UI32 acked;
    RTS_UI32 size;
    RTS_UI32 sent_at;
    RTS_UI32 repeats;
    RTS_UI32 missed; /* block the client last asked for; 0: none */
    RTS_UI32 missed_at;
} SENDER;

/* The channel; id 0 when closed. Times are those of SysTimeGetMs. */
typedef struct {
    RTS_UI16 id;
    RTS_UI8 address_words; /* of both addresses, agreed */
    bool fresh;            /* no block has arrived yet */
    bool open_due;         /* the open response is waiting for room in the driver */
    bool ack_due;
    bool missing_due;    /* the acknowledgement asks for a repetition */
    RTS_UI32 request_id; /* of the open request */
    RTS_UI32 limit;      /* largest message, both directions */
    RTS_UI32 room;       /* bytes of a message, with its prefix, in one block */
    RTS_UI32 last_received;
    RTS_UI32 last_sent;
    RECEIVER rx;
    SENDER tx;
    ROUTER_PEER peer;
} CHANNEL;

static CHANNEL channel;
static MESSAGE request_buffer;
static MESSAGE reply_buffer;

/* What outlives a channel. */
static struct {
    RTS_UI32 complained_at;
    RTS_UI16 last_id;
} server;

static CHANNEL_COUNTERS counters;

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

/* An acknowledgement; its beginning alone is a keepalive. */
static RTS_RESULT send_short(RTS_UI8 type, RTS_UI8 flags, RTS_UI32 size)
{
    RTS_UI8 package[CHANNEL_ACK_SIZE] = {type, flags};

    BytesPut16(package + 2, channel.id);
    BytesPut32(package + 4, channel.rx.block);
    return send_package(&channel.peer, package, size);
}

/* ---- life of the channel ---- */

static void forget_channel(void)
{
    channel.id = 0;
    SrvEndSession();
}

static void close_channel(RTS_RESULT error)
{
    COMM_COUNT(counters.failed);
    send_close(&channel.peer, channel.id, error);
    forget_channel();
}

/* 1..CHANNEL_ID_MAX, and another one than last time. */
static RTS_UI16 new_id(void)
{
    RTS_UI32 id = 1 + SysTargetRandom() % (CHANNEL_ID_MAX - 1);

    if (id >= server.last_id)
        id++;
    server.last_id = (RTS_UI16)id;
    return server.last_id;
}

typedef struct {
    RTS_UI32 request_id;
    RTS_UI32 limit;
    RTS_UI32 room;
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
    RTS_UI32 payload = RouterGetMaxPayload(peer, words);
    request->room = payload - CHANNEL_DATA_SIZE;
    return request->limit >= CHANNEL_MIN_MESSAGE && payload >= CHANNEL_DATA_SIZE + MIN_ROOM;
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
    channel.room = request->room;
    channel.address_words = request->address_words;
    channel.id = new_id();
    channel.fresh = true;
    COMM_COUNT(counters.opened);
}

static void handle_open(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    OPEN_REQUEST request;

    if (!read_open_request(peer, data, size, &request)) {
        COMM_COUNT(counters.malformed);
        return;
    }
    if (is_taken(peer, now_ms)) {
        COMM_COUNT(counters.refused);
        (void)send_open_response(peer, request.request_id, CHANNEL_OPEN_NO_CHANNEL, CHANNEL_ID_NONE);
        return;
    }
    if (!is_repetition(peer, &request))
        open_channel(peer, &request);
    channel.last_received = now_ms;
    channel.open_due = true;
}

/* ---- sending the reply ---- */

/* Of the message in reply_buffer. */
static void start_reply(RTS_UI32 size)
{
    SENDER *tx = &channel.tx;

    BytesPut32(reply_buffer, size);
    BytesPut32(reply_buffer + 4, CRC32Update(0, reply_buffer + PREFIX_SIZE, size));
    tx->base += tx->count;
    tx->size = PREFIX_SIZE + size;
    tx->count = (tx->size + channel.room - 1) / channel.room;
    tx->sent = 0;
    tx->acked = 0;
    tx->repeats = 0;
    tx->missed = 0;
}

static RTS_RESULT send_block(void)
{
    const SENDER *tx = &channel.tx;
    RTS_UI8 header[CHANNEL_DATA_SIZE] = {CHANNEL_PKG_DATA, tx->sent == 0 ? CHANNEL_FLAG_FIRST : 0};
    RTS_UI32 offset = tx->sent * channel.room;
    RTS_UI32 left = tx->size - offset;
    BLK_PART parts[2] = {{header, sizeof(header)}, {reply_buffer + offset, left < channel.room ? left : channel.room}};

    BytesPut16(header + 2, channel.id);
    BytesPut32(header + 4, tx->base + tx->sent + 1);
    BytesPut32(header + 8, channel.rx.block);
    return RouterSend(&channel.peer, ROUTER_SVC_CHANNEL, parts, 2);
}

/* Sends the most urgent of what is due. ERR_NOTHING_TO_DO, ERR_NOBUFFER. */
static RTS_RESULT send_next(RTS_UI32 now_ms)
{
    RTS_RESULT result = ERR_NOTHING_TO_DO;

    if (channel.open_due) {
        result = send_open_response(&channel.peer, channel.request_id, CHANNEL_OPEN_OK, channel.id);
        channel.open_due = result != ERR_OK;
    } else if (channel.ack_due) {
        result = send_short(CHANNEL_PKG_ACK, channel.missing_due ? CHANNEL_FLAG_MISSING : 0, CHANNEL_ACK_SIZE);
        channel.ack_due = result != ERR_OK;
        channel.missing_due = channel.missing_due && channel.ack_due;
    } else if (channel.tx.sent < channel.tx.count) {
        result = send_block();
        if (result == ERR_OK) {
            channel.tx.sent++;
            channel.tx.sent_at = now_ms;
        }
    } else if (now_ms - channel.last_sent >= CHANNEL_KEEPALIVE_MS) {
        result = send_short(CHANNEL_PKG_KEEPALIVE, 0, CHANNEL_KEEPALIVE_SIZE);
    }
    return result;
}

/* Sends what is due as far as the driver has room. */
static void pump(RTS_UI32 now_ms)
{
    while (send_next(now_ms) == ERR_OK)
        channel.last_sent = now_ms;
}

static bool is_waiting_for_ack(void)
{
    return channel.tx.acked < channel.tx.count && channel.tx.sent == channel.tx.count;
}

static void repeat_reply(void)
{
    channel.tx.sent = channel.tx.acked;
    COMM_COUNT(counters.repeats);
}

/* The client asks for the block after those it has. Some ask with each block that comes after it: once is enough. */
static void handle_missing(RTS_UI32 now_ms)
{
    SENDER *tx = &channel.tx;
    RTS_UI32 missed = tx->acked + 1;

    if (tx->sent == tx->acked || (tx->missed == missed && now_ms - tx->missed_at < REPEAT_GAP_MS))
        return;
    tx->missed = missed;
    tx->missed_at = now_ms;
    repeat_reply();
}

static void handle_ack(RTS_UI32 block, bool missing, RTS_UI32 now_ms)
{
    SENDER *tx = &channel.tx;
    RTS_UI32 acked = block - tx->base; /* of an earlier reply: more than there are */

    if (acked < tx->acked || acked > tx->count)
        return;
    if (acked > tx->acked)
        tx->repeats = 0;
    tx->acked = acked;
    if (tx->sent < acked)
        tx->sent = acked;
    if (missing && acked < tx->count)
        handle_missing(now_ms);
}

/* ---- receiving the request ---- */

static RTS_RESULT handle_message(void)
{
    const RTS_UI8 *message = request_buffer + PREFIX_SIZE;
    RTS_UI32 size = BytesGet32(request_buffer);

    if (CRC32Update(0, message, size) != BytesGet32(request_buffer + 4))
        return ERR_CHS_CHECKSUM;
    size = SrvHandleMessage(message, size, reply_buffer + PREFIX_SIZE, channel.limit);
    if (size == 0)
        return ERR_CHS_REQNOTHANDLED;
    start_reply(size); /* whoever asks again has had the reply before */
    return ERR_OK;
}

/* A new request, whatever has become of the one before. */
static RTS_RESULT start_message(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 length = size < PREFIX_SIZE ? 0 : BytesGet32(data);

    channel.rx.fill = 0;
    channel.rx.left = 0;
    if (length == 0)
        return ERR_CHS_PROTOCOL;
    if (length > channel.limit)
        return ERR_CHS_MESSAGESIZE;
    channel.rx.left = PREFIX_SIZE + length;
    return ERR_OK;
}

/* Takes the block that is next in order: `data` is what follows its header. */
static RTS_RESULT accept_block(bool is_first, const RTS_UI8 *data, RTS_UI32 size)
{
    RECEIVER *rx = &channel.rx;
    RTS_RESULT result = is_first ? start_message(data, size) : ERR_OK;

    if (result != ERR_OK)
        return result;
    if (rx->left == 0 || size > rx->left)
        return ERR_CHS_PROTOCOL;
    memcpy(request_buffer + rx->fill, data, size);
    rx->fill += size;
    rx->left -= size;
    rx->block++;
    rx->gap = 0;
    return rx->left == 0 ? handle_message() : ERR_OK;
}

/* A block received before: its acknowledgement was lost, and perhaps the reply too. */
static void handle_duplicate(RTS_UI32 now_ms)
{
    COMM_COUNT(counters.duplicates);
    channel.ack_due = true;
    if (is_waiting_for_ack() && now_ms - channel.tx.sent_at >= REPEAT_GAP_MS)
        repeat_reply();
}

/* Blocks before this one are missing. Said once per run of the client through its blocks, or one loss would be
 * answered with a storm of repetitions. */
static void handle_gap(RTS_UI32 ahead)
{
    COMM_COUNT(counters.gaps);
    if (channel.rx.gap == 0 || ahead <= channel.rx.gap) {
        channel.rx.gap = ahead;
        channel.ack_due = true;
        channel.missing_due = true;
    }
}

static void handle_data(const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    RTS_UI32 ahead = BytesGet32(data + 4) - channel.rx.block; /* numbers wrap */
    RTS_RESULT result = ERR_OK;

    channel.fresh = false;
    handle_ack(BytesGet32(data + 8), false, now_ms);
    if (ahead == 1)
        result = accept_block((data[1] & CHANNEL_FLAG_FIRST) != 0, data + CHANNEL_DATA_SIZE, size - CHANNEL_DATA_SIZE);
    else if ((RTS_I32)ahead <= 0)
        handle_duplicate(now_ms);
    else
        handle_gap(ahead);
    if (result != ERR_OK)
        close_channel(result);
}

/* ---- packages ---- */

/* Tells whoever uses a channel that is not his (or not any more), so that he need not wait for a time-out. */
static void complain(const ROUTER_PEER *peer, RTS_UI16 id, RTS_UI32 now_ms)
{
    COMM_COUNT(counters.foreign);
    if (now_ms - server.complained_at < CHANNEL_COMPLAINT_MS)
        return;
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
        COMM_COUNT(counters.malformed);
        return;
    }
    if (!is_owner(peer, BytesGet16(data + 2))) {
        complain(peer, BytesGet16(data + 2), now_ms);
        return;
    }
    channel.last_received = now_ms;
    if (data[0] == CHANNEL_PKG_DATA && size >= CHANNEL_DATA_SIZE)
        handle_data(data, size, now_ms);
    else if (data[0] == CHANNEL_PKG_ACK && size >= CHANNEL_ACK_SIZE)
        handle_ack(BytesGet32(data + 4), (data[1] & CHANNEL_FLAG_MISSING) != 0, now_ms);
    else if (data[0] != CHANNEL_PKG_KEEPALIVE)
        COMM_COUNT(counters.malformed);
}

static void handle_close(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size)
{
    if (size < CHANNEL_CLOSE_SIZE)
        COMM_COUNT(counters.malformed);
    else if (is_owner(peer, BytesGet16(data + 8)))
        forget_channel();
    else
        COMM_COUNT(counters.foreign);
}

static void handle_meta_package(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    if (size < CHANNEL_META_SIZE || BytesGet16(data + 2) >> 8 != CHANNEL_VERSION >> 8 ||
        BytesGet32(data + 4) != meta_crc(data, size)) {
        COMM_COUNT(counters.malformed);
        return;
    }
    if (data[0] == CHANNEL_PKG_OPEN_REQ)
        handle_open(peer, data, size, now_ms);
    else if (data[0] == CHANNEL_PKG_CLOSE_REQ)
        handle_close(peer, data, size);
    else if (data[0] == CHANNEL_PKG_RTSINFO_REQ)
        send_rts_info(peer);
}

RTS_NOINLINE void ChannelHandlePackage(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 now_ms = SysTimeGetMs();

    if (size == 0)
        COMM_COUNT(counters.malformed);
    else if (data[0] & CHANNEL_META)
        handle_meta_package(peer, data, size, now_ms);
    else
        handle_channel_package(peer, data, size, now_ms);
    if (channel.id != 0)
        pump(SysTimeGetMs()); /* a service may have taken its time */
}

/* ---- time ---- */

static void repeat_when_overdue(RTS_UI32 now_ms)
{
    SENDER *tx = &channel.tx;

    if (!is_waiting_for_ack() || tx->repeats >= REPEAT_COUNT ||
        now_ms - tx->sent_at < (RTS_UI32)REPEAT_FIRST_MS << tx->repeats)
        return;
    tx->repeats++;
    repeat_reply();
}

static void cycle(RTS_UI32 now_ms)
{
    if (channel.id == 0)
        return;
    if (now_ms - channel.last_received >= CHANNEL_TIMEOUT_MS) {
        close_channel(ERR_CHS_TIMEOUT);
        return;
    }
    repeat_when_overdue(now_ms);
    pump(now_ms);
}

const CHANNEL_COUNTERS *ChannelGetCounters(void)
{
    return &counters;
}

static void reset_all(void)
{
    CMP_CLEAR(channel);
    CMP_CLEAR(server);
    if (COMM_COUNTERS)
        CMP_CLEAR(counters);
}

RTS_RESULT CmpChannelServerEmbedded_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        reset_all();
    else if (hook == CH_COMM_CYCLE)
        cycle(SysTimeGetMs());
    else if (hook == CH_EXIT_COMM && channel.id != 0)
        close_channel(ERR_CHS_SHUTDOWN);
    return ERR_OK;
}
