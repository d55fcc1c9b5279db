/*
 * CmpChannelServerEmbedded.c - layer 4: one reliable channel that carries requests and replies.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpChannelServerEmbedded.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpChecksum.h"
#include "CmpPackets.h"
#include "CmpSrv.h"
#include "SysTarget.h"
#include "SysTime.h"
#include "rts_config.h"

enum {
    REPEAT_FIRST_MS = 1000, /* doubles with each repetition */
    REPEAT_COUNT = 4,
    REPEAT_GAP_MS = 100,              /* between repetitions that the client's own repetitions ask for */
    MIN_ROOM = COMM_PREFIX_SIZE + 12, /* a path whose packets carry less is not worth a channel */
};

static COMM_CLIENT clients[COMM_MAX_CLIENTS];

/* What outlives a channel. */
static struct {
    RTS_UI32 complained_at;
    RTS_UI16 last_id;
} server;

static CHANNEL_COUNTERS counters;

#define FOR_EACH_CLIENT(client) for (COMM_CLIENT *client = clients; client < clients + COMM_MAX_CLIENTS; client++)

COMM_CLIENT *ChannelGetClient(RTS_UI32 index)
{
    return index < COMM_MAX_CLIENTS ? &clients[index] : NULL;
}

bool ChannelIsOpen(const COMM_CLIENT *client)
{
    return client->channel.id != 0;
}

/* ---- packages without blocks ---- */

static RTS_RESULT send_package(const ROUTER_PEER *peer, const RTS_UI8 *package, RTS_UI32 size)
{
    BLK_PART part = {package, size};

    return RouterSend(peer, ROUTER_SVC_CHANNEL, &part, 1);
}

static RTS_UI32 meta_crc(const void *package, RTS_UI32 size)
{
    static const RTS_UI8 zeros[sizeof(WIRE_UI32)] = {0};
    const CHANNEL_META_HEADER *meta = package;
    RTS_UI32 crc = CRC32Update(0, meta, offsetof(CHANNEL_META_HEADER, crc));

    crc = CRC32Update(crc, zeros, sizeof(zeros));
    return CRC32Update(crc, meta + 1, size - sizeof(*meta));
}

/* Completes and sends a meta package whose body is in place. */
static RTS_RESULT send_meta(const ROUTER_PEER *peer, RTS_UI8 type, void *package, RTS_UI32 size)
{
    CHANNEL_META_HEADER *meta = package;

    meta->type = type;
    meta->flags = 0;
    BytesPut16(meta->version, CHANNEL_VERSION);
    BytesPut32(meta->crc, meta_crc(package, size));
    return send_package(peer, package, size);
}

/* Version 1.0 has no address words. */
static RTS_UI32 open_response_size(const CHANNEL *channel)
{
#if SRV_OTHER_CLIENTS
    if (channel->is_version_1_0)
        return offsetof(CHANNEL_OPEN_RESPONSE, byte_order);
#endif
    RTS_UNUSED(channel);
    return sizeof(CHANNEL_OPEN_RESPONSE);
}

/* The longest packet that the client may send, of those it would send; nothing for one that does not ask. */
static void put_packet_size(WIRE_UI16 packet, const CHANNEL *channel)
{
#if BLK_LONG_PACKETS
    RTS_UI16 takes = channel->peer.driver->takes;

    BytesPut16(packet, takes < channel->wanted ? takes : channel->wanted);
#endif
    RTS_UNUSED(packet);
    RTS_UNUSED(channel);
}

static RTS_RESULT send_open_response(const CHANNEL *channel)
{
    CHANNEL_OPEN_RESPONSE response = {0};

    BytesPut32(response.request_id, channel->request_id);
    BytesPut16(response.result, CHANNEL_OPEN_OK);
    BytesPut16(response.id, channel->id);
    BytesPut32(response.limit, channel->limit);
    response.address_words = channel->address_words;
    put_packet_size(response.packet, channel);
    return send_meta(&channel->peer, CHANNEL_PKG_OPEN_RESP, &response, open_response_size(channel));
}

static void send_open_refusal(const ROUTER_PEER *peer, RTS_UI32 request_id)
{
    CHANNEL_OPEN_RESPONSE response = {0};

    BytesPut32(response.request_id, request_id);
    BytesPut16(response.result, CHANNEL_OPEN_NO_CHANNEL);
    BytesPut16(response.id, CHANNEL_ID_NONE);
    (void)send_meta(peer, CHANNEL_PKG_OPEN_RESP, &response, sizeof(response));
}

static void send_close(const ROUTER_PEER *peer, RTS_UI16 id, RTS_RESULT error)
{
    CHANNEL_CLOSE close;

    BytesPut16(close.id, id);
    BytesPut16(close.error, error);
    (void)send_meta(peer, CHANNEL_PKG_CLOSE, &close, sizeof(close)); /* a courtesy: the peer notices anyway */
}

static void send_rts_info(const ROUTER_PEER *peer)
{
    CHANNEL_RTS_INFO info;

    BytesPut16(info.max_channels, COMM_MAX_CLIENTS);
    (void)send_meta(peer, CHANNEL_PKG_RTSINFO_RESP, &info, sizeof(info));
}

/* An acknowledgement; its beginning alone is a keepalive. */
static RTS_RESULT send_short(const CHANNEL *channel, RTS_UI8 type, RTS_UI8 flags, RTS_UI32 size)
{
    CHANNEL_ACK ack = {{type, flags, {0}}, {0}};

    BytesPut16(ack.head.id, channel->id);
    BytesPut32(ack.acknowledged, channel->rx.block);
    return send_package(&channel->peer, (const RTS_UI8 *)&ack, size);
}

/* ---- life of the channel ---- */

/* Whether the reply is kept back, because the one to the next request will do for both (reply_may_wait). */
static bool is_reply_waiting(const COMM_CLIENT *client)
{
#if COMM_ENDPOINTS
    return client->reply_may_wait;
#else
    RTS_UNUSED(client);
    return false;
#endif
}

static void let_reply_go(COMM_CLIENT *client)
{
#if COMM_ENDPOINTS
    client->reply_may_wait = false;
#else
    RTS_UNUSED(client);
#endif
}

static void forget_channel(COMM_CLIENT *client)
{
    client->channel.id = 0;
    let_reply_go(client);
    SrvEndSession(client);
}

static void close_channel(COMM_CLIENT *client, RTS_RESULT error)
{
    COMM_COUNT(counters.failed);
    send_close(&client->channel.peer, client->channel.id, error);
    forget_channel(client);
}

static COMM_CLIENT *find_client(RTS_UI16 id)
{
    FOR_EACH_CLIENT (client)
        if (client->channel.id == id)
            return client;
    return NULL;
}

/* 1..CHANNEL_ID_MAX, another one than last time and than those in use. */
static RTS_UI16 new_id(void)
{
    do {
        RTS_UI32 id = 1 + SysTargetRandom() % (CHANNEL_ID_MAX - 1);
        if (id >= server.last_id)
            id++;
        server.last_id = (RTS_UI16)id;
    } while (COMM_MAX_CLIENTS > 1 && find_client(server.last_id) != NULL);
    return server.last_id;
}

typedef struct {
    RTS_UI32 request_id;
    RTS_UI32 limit;
    RTS_UI32 room;
    RTS_UI8 address_words;
#if SRV_OTHER_CLIENTS
    bool is_version_1_0;
#endif
#if BLK_LONG_PACKETS
    RTS_UI16 packet;
#endif
} OPEN_REQUEST;

/* False when this path or buffer size is no basis for a channel. */
static bool read_open_request(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size, OPEN_REQUEST *request)
{
    const CHANNEL_OPEN_REQUEST *open = (const CHANNEL_OPEN_REQUEST *)data;
    RTS_UI32 words = (RTS_UI32)peer->address_words + peer->driver->address_words;

    if (size < offsetof(CHANNEL_OPEN_REQUEST, address_words))
        return false;
    request->request_id = BytesGet32(open->request_id);
    request->limit = BytesGet32(open->limit);
#if SRV_OTHER_CLIENTS
    request->is_version_1_0 = size < sizeof(*open);
#endif
#if BLK_LONG_PACKETS
    request->packet = size < sizeof(*open) ? 0 : BytesGet16(open->packet);
#endif
    if (size >= sizeof(*open) && open->address_words > words)
        words = open->address_words < 2 * ROUTER_MAX_ADDRESS ? open->address_words : 2 * ROUTER_MAX_ADDRESS;
    if (request->limit > NETSERVER_MESSAGE_SIZE)
        request->limit = NETSERVER_MESSAGE_SIZE;
    request->address_words = (RTS_UI8)words;
    RTS_UI32 payload = RouterGetMaxPayload(peer, words);
    request->room = payload - (RTS_UI32)sizeof(CHANNEL_DATA);
    return request->limit >= CHANNEL_MIN_MESSAGE && payload >= sizeof(CHANNEL_DATA) + MIN_ROOM;
}

static bool is_gone(const ROUTER_PEER *peer)
{
#if COMM_ENDPOINTS
    return peer->driver->gone;
#else
    RTS_UNUSED(peer);
    return false;
#endif
}

static bool is_reliable(const ROUTER_PEER *peer)
{
#if COMM_ENDPOINTS
    return peer->driver->reliable;
#else
    RTS_UNUSED(peer);
    return false;
#endif
}

/* Nothing says that its peer is there. */
static bool is_lost(const CHANNEL *channel)
{
#if COMM_ENDPOINTS
    return channel->peer.driver->gone || channel->unreachable;
#else
    RTS_UNUSED(channel);
    return false;
#endif
}

/* The channel is in use by a logged-in client. */
static bool is_taken(const COMM_CLIENT *client, RTS_UI32 now_ms)
{
    return client->channel.id != 0 && SrvIsLoggedIn(client) && !is_lost(&client->channel) &&
           now_ms - client->channel.last_received < CHANNEL_IDLE_MS;
}

/* The channel is in use by a client that may be about to log in: another one that only opens does not end it. */
static bool is_settling(const COMM_CLIENT *client, RTS_UI32 now_ms)
{
    const CHANNEL *channel = &client->channel;

    return COMM_ENDPOINTS && channel->id != 0 && !SrvIsLoggedIn(client) && !channel->fresh && !is_lost(channel) &&
           now_ms - channel->anonymous_since < CHANNEL_SETTLE_MS;
}

/* Whether `a` is the better one to give to a new peer: it is free, or was never used, or has been silent longer. */
static bool is_better(const CHANNEL *a, const CHANNEL *b, RTS_UI32 now_ms)
{
    if (a->id == 0 || b->id == 0)
        return b->id != 0;
    if (COMM_ENDPOINTS && a->fresh != b->fresh)
        return a->fresh;
    return now_ms - a->last_received > now_ms - b->last_received;
}

/* The machine of a peer; 0: not known, or this one. */
static RTS_UI32 host_of(const ROUTER_PEER *peer)
{
#if COMM_HOST_CHANNELS
    return peer->driver->host_of != NULL ? peer->driver->host_of(peer) : 0;
#else
    RTS_UNUSED(peer);
    return 0;
#endif
}

static bool is_at_host(const CHANNEL *channel, RTS_UI32 host)
{
    return channel->id != 0 && host_of(&channel->peer) == host;
}

/* A machine with many ports or connections does not get all channels: it has to do with those it has. */
static bool has_its_share(RTS_UI32 host)
{
    RTS_UI32 count = 0;

    if (host == 0)
        return false;
    FOR_EACH_CLIENT (client)
        count += is_at_host(&client->channel, host);
    return count + 1 > COMM_HOST_CHANNELS; /* where there are no hosts it is 0 */
}

/* A peer has one channel at most. */
static bool has_client(const ROUTER_PEER *peer, const COMM_CLIENT *client)
{
    return client->channel.id != 0 && RouterIsSamePeer(peer, &client->channel.peer);
}

/* The one that this peer has, or one that can be given to it; NULL when all are taken. */
static COMM_CLIENT *claim_client(const ROUTER_PEER *peer, RTS_UI32 now_ms)
{
    COMM_CLIENT *found = NULL;
    RTS_UI32 host = host_of(peer);
    bool own_only = has_its_share(host);

    FOR_EACH_CLIENT (client) {
        if (has_client(peer, client))
            return client;
        if (own_only && !is_at_host(&client->channel, host))
            continue;
        if (!is_taken(client, now_ms) && !is_settling(client, now_ms) &&
            (found == NULL || is_better(&client->channel, &found->channel, now_ms)))
            found = client;
    }
    return found;
}

/* Makes those that have been silent for a while show whether they are still there (ChannelUnreachable). */
static void probe_silent(RTS_UI32 now_ms)
{
    FOR_EACH_CLIENT (client) {
        CHANNEL *channel = &client->channel;
        if (now_ms - channel->last_received >= CHANNEL_PROBE_MS && now_ms - channel->last_sent >= CHANNEL_PROBE_MS)
            channel->last_sent = now_ms - CHANNEL_KEEPALIVE_MS;
    }
}

/* The client asks again because our response was lost. */
static bool is_repetition(const CHANNEL *channel, const ROUTER_PEER *peer, const OPEN_REQUEST *request)
{
    return channel->id != 0 && channel->fresh && request->request_id == channel->request_id &&
           RouterIsSamePeer(peer, &channel->peer);
}

static void open_channel(COMM_CLIENT *client, const ROUTER_PEER *peer, const OPEN_REQUEST *request, RTS_UI32 now_ms)
{
    CHANNEL *channel = &client->channel;
    bool again = has_client(peer, client);
    RTS_UI32 since = COMM_ENDPOINTS && again ? channel->anonymous_since : now_ms;

    if (channel->id != 0 && !again)
        send_close(&channel->peer, channel->id, ERR_CHS_CLOSED);
    forget_channel(client);
    memset(channel, 0, sizeof(*channel));
    channel->peer = *peer;
    channel->request_id = request->request_id;
    channel->limit = request->limit;
    channel->room = request->room;
    channel->address_words = request->address_words;
    channel->id = new_id();
    channel->fresh = true;
#if SRV_OTHER_CLIENTS
    channel->is_version_1_0 = request->is_version_1_0;
#endif
#if BLK_LONG_PACKETS
    channel->wanted = request->packet;
#endif
    if (COMM_ENDPOINTS)
        channel->anonymous_since = since; /* a peer that opens again and again is not protected for ever */
#if COMM_ENDPOINTS
    channel->guessed_at = now_ms - CHANNEL_COMPLAINT_MS;
#endif
    COMM_COUNT(counters.opened);
}

static void handle_open(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    OPEN_REQUEST request;

    if (!read_open_request(peer, data, size, &request)) {
        COMM_COUNT(counters.malformed);
        return;
    }
    COMM_CLIENT *client = claim_client(peer, now_ms);
    if (client == NULL) {
        COMM_COUNT(counters.refused);
        send_open_refusal(peer, request.request_id);
        if (COMM_ENDPOINTS)
            probe_silent(now_ms);
        return;
    }
    if (!is_repetition(&client->channel, peer, &request))
        open_channel(client, peer, &request, now_ms);
    client->channel.last_received = now_ms;
    client->channel.open_due = true;
}

/* ---- sending the reply ---- */

/* Of the message in client->reply. */
static void start_reply(COMM_CLIENT *client, RTS_UI32 size)
{
    CHANNEL_SENDER *tx = &client->channel.tx;
    CHANNEL_MESSAGE *message = (CHANNEL_MESSAGE *)client->reply;

    BytesPut32(message->size, size);
    BytesPut32(message->crc, CRC32Update(0, message + 1, size));
    tx->base += tx->count;
    tx->size = COMM_PREFIX_SIZE + size;
    tx->count = (tx->size + client->channel.room - 1) / client->channel.room;
    tx->sent = 0;
    tx->acked = 0;
    tx->repeats = 0;
    tx->missed = 0;
}

static RTS_RESULT send_block(const COMM_CLIENT *client)
{
    const CHANNEL *channel = &client->channel;
    const CHANNEL_SENDER *tx = &channel->tx;
    CHANNEL_DATA header = {{CHANNEL_PKG_DATA, tx->sent == 0 ? CHANNEL_FLAG_FIRST : 0, {0}}, {0}, {0}};
    RTS_UI32 offset = tx->sent * channel->room;
    RTS_UI32 left = tx->size - offset;
    BLK_PART parts[2] = {{(const RTS_UI8 *)&header, sizeof(header)},
                         {client->reply + offset, left < channel->room ? left : channel->room}};

    BytesPut16(header.head.id, channel->id);
    BytesPut32(header.block, tx->base + tx->sent + 1);
    BytesPut32(header.acknowledged, channel->rx.block);
    return RouterSend(&channel->peer, ROUTER_SVC_CHANNEL, parts, 2);
}

/* Sends the most urgent of what is due. ERR_NOTHING_TO_DO, ERR_NOBUFFER. */
static RTS_RESULT send_next(COMM_CLIENT *client, RTS_UI32 now_ms)
{
    CHANNEL *channel = &client->channel;
    RTS_RESULT result = ERR_NOTHING_TO_DO;

    if (channel->open_due) {
        result = send_open_response(channel);
        channel->open_due = result != ERR_OK;
    } else if (channel->ack_due) {
        result =
            send_short(channel, CHANNEL_PKG_ACK, channel->missing_due ? CHANNEL_FLAG_MISSING : 0, sizeof(CHANNEL_ACK));
        channel->ack_due = result != ERR_OK;
        channel->missing_due = channel->missing_due && channel->ack_due;
    } else if (channel->tx.sent < channel->tx.count && !is_reply_waiting(client)) {
        result = send_block(client);
        if (result == ERR_OK) {
            channel->tx.sent++;
            channel->tx.sent_at = now_ms;
        }
    } else if (now_ms - channel->last_sent >= CHANNEL_KEEPALIVE_MS) {
        result = send_short(channel, CHANNEL_PKG_KEEPALIVE, 0, sizeof(CHANNEL_HEADER));
    }
    return result;
}

/* Sends what is due as far as the driver has room. */
static void pump(COMM_CLIENT *client, RTS_UI32 now_ms)
{
    while (send_next(client, now_ms) == ERR_OK)
        client->channel.last_sent = now_ms;
}

static bool is_waiting_for_ack(const CHANNEL_SENDER *tx)
{
    return tx->acked < tx->count && tx->sent == tx->count;
}

static void repeat_reply(CHANNEL_SENDER *tx)
{
    tx->sent = tx->acked;
    COMM_COUNT(counters.repeats);
}

/* The client asks for the block after those it has. Some ask with each block that comes after it: once is enough. */
static void handle_missing(CHANNEL_SENDER *tx, RTS_UI32 now_ms)
{
    RTS_UI32 missed = tx->acked + 1;

    if (tx->sent == tx->acked || (tx->missed == missed && now_ms - tx->missed_at < REPEAT_GAP_MS))
        return;
    tx->missed = missed;
    tx->missed_at = now_ms;
    repeat_reply(tx);
}

static void handle_ack(CHANNEL_SENDER *tx, RTS_UI32 block, bool missing, RTS_UI32 now_ms)
{
    RTS_UI32 acked = block - tx->base; /* of an earlier reply: more than there are */

    if (acked < tx->acked || acked > tx->count)
        return;
    if (acked > tx->acked)
        tx->repeats = 0;
    tx->acked = acked;
    if (tx->sent < acked)
        tx->sent = acked;
    if (missing && acked < tx->count)
        handle_missing(tx, now_ms);
}

/* ---- receiving the request ---- */

static RTS_RESULT handle_message(COMM_CLIENT *client)
{
    const CHANNEL_MESSAGE *head = (const CHANNEL_MESSAGE *)client->request;
    const RTS_UI8 *message = client->request + COMM_PREFIX_SIZE;
    RTS_UI32 size = BytesGet32(head->size);

    if (CRC32Update(0, message, size) != BytesGet32(head->crc))
        return ERR_CHS_CHECKSUM;
    let_reply_go(client);
    size = SrvHandleMessage(client, message, size, client->reply + COMM_PREFIX_SIZE, client->channel.limit);
    if (size == 0)
        return ERR_CHS_REQNOTHANDLED;
    start_reply(client, size); /* a new request implies that the previous reply arrived */
    return ERR_OK;
}

/* A new request, whatever has become of the previous one. */
static RTS_RESULT start_message(CHANNEL *channel, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 length = size < COMM_PREFIX_SIZE ? 0 : BytesGet32(((const CHANNEL_MESSAGE *)data)->size);

    channel->rx.fill = 0;
    channel->rx.left = 0;
    if (length == 0)
        return ERR_CHS_PROTOCOL;
    if (length > channel->limit)
        return ERR_CHS_MESSAGESIZE;
    channel->rx.left = COMM_PREFIX_SIZE + length;
    return ERR_OK;
}

/* Takes the block that is next in order: `data` is what follows its header. */
static RTS_RESULT accept_block(COMM_CLIENT *client, bool is_first, const RTS_UI8 *data, RTS_UI32 size)
{
    CHANNEL_RECEIVER *rx = &client->channel.rx;
    RTS_RESULT result = is_first ? start_message(&client->channel, data, size) : ERR_OK;

    if (result != ERR_OK)
        return result;
    if (rx->left == 0 || size > rx->left)
        return ERR_CHS_PROTOCOL;
    memcpy(client->request + rx->fill, data, size);
    rx->fill += size;
    rx->left -= size;
    rx->block++;
    rx->gap = 0;
    return rx->left == 0 ? handle_message(client) : ERR_OK;
}

/* On a line with several peers one may pretend to be another. What is at the end of a connection or of a serial line
 * need not. */
static bool may_be_another(const ROUTER_PEER *peer)
{
#if COMM_ENDPOINTS
    return peer->endpoint != 0;
#else
    RTS_UNUSED(peer);
    return false;
#endif
}

/* A package came that is not the channel's, as it seems of `peer`: another one may pretend to be it and try ids. */
static void note_guess(const ROUTER_PEER *peer, RTS_UI32 now_ms)
{
    COMM_COUNT(counters.foreign);
#if COMM_ENDPOINTS
    FOR_EACH_CLIENT (client)
        if (may_be_another(peer) && RouterIsSamePeer(peer, &client->channel.peer))
            client->channel.guessed_at = now_ms;
#else
    RTS_UNUSED(peer);
    RTS_UNUSED(now_ms);
#endif
}

/* While they come no package ends the channel: a client that is honest then ends it by silence. */
static bool is_guessing(const CHANNEL *channel, RTS_UI32 now_ms)
{
#if COMM_ENDPOINTS
    return now_ms - channel->guessed_at < CHANNEL_COMPLAINT_MS;
#else
    RTS_UNUSED(channel);
    RTS_UNUSED(now_ms);
    return false;
#endif
}

/* A block received before: its acknowledgement was lost, and perhaps the reply too. */
static void handle_duplicate(COMM_CLIENT *client, RTS_UI32 now_ms)
{
    CHANNEL *channel = &client->channel;

    COMM_COUNT(counters.duplicates);
    let_reply_go(client);
    channel->ack_due = true;
    if (is_waiting_for_ack(&channel->tx) && now_ms - channel->tx.sent_at >= REPEAT_GAP_MS)
        repeat_reply(&channel->tx);
}

/* Blocks before this one are missing. Said once per run of the client through its blocks, or one loss would be
 * answered with a storm of repetitions. */
static void handle_gap(CHANNEL *channel, RTS_UI32 ahead)
{
    COMM_COUNT(counters.gaps);
    if (channel->rx.gap == 0 || ahead <= channel->rx.gap) {
        channel->rx.gap = ahead;
        channel->ack_due = true;
        channel->missing_due = true;
    }
}

/* A message with a wrong CRC may come from one that knows or guesses the id. If it was one block, the client's own is
 * taken in its place. */
static void drop_message(CHANNEL *channel, bool is_one_block, RTS_UI32 now_ms)
{
    note_guess(&channel->peer, now_ms);
    if (is_one_block)
        channel->rx.block--;
}

static void handle_data(COMM_CLIENT *client, const CHANNEL_DATA *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    CHANNEL *channel = &client->channel;
    RTS_UI32 ahead = BytesGet32(data->block) - channel->rx.block; /* numbers wrap */
    bool is_first = (data->head.flags & CHANNEL_FLAG_FIRST) != 0;
    RTS_RESULT result = ERR_OK;

    channel->fresh = false;
    handle_ack(&channel->tx, BytesGet32(data->acknowledged), false, now_ms);
    if (ahead == 1)
        result = accept_block(client, is_first, (const RTS_UI8 *)(data + 1), size - (RTS_UI32)sizeof(*data));
    else if ((RTS_I32)ahead <= 0)
        handle_duplicate(client, now_ms);
    else
        handle_gap(channel, ahead);
    if (result == ERR_CHS_CHECKSUM && may_be_another(&channel->peer))
        drop_message(channel, is_first, now_ms);
    else if (result != ERR_OK && !is_guessing(channel, now_ms))
        close_channel(client, result);
}

/* ---- packages ---- */

/* Informs a peer that its channel does not exist (any more), so that it need not wait for a time-out. */
static void complain(const ROUTER_PEER *peer, RTS_UI16 id, RTS_UI32 now_ms)
{
    if (now_ms - server.complained_at < CHANNEL_COMPLAINT_MS)
        return;
    server.complained_at = now_ms;
    send_close(peer, id, ERR_CHS_CHINVALID);
}

/* The client of an open channel, for the peer that opened it; else NULL. */
static COMM_CLIENT *find_owner(const ROUTER_PEER *peer, RTS_UI16 id, RTS_UI32 now_ms)
{
    COMM_CLIENT *client = id != 0 ? find_client(id) : NULL;

    if (client != NULL && RouterIsSamePeer(peer, &client->channel.peer))
        return client;
    note_guess(peer, now_ms);
    return NULL;
}

/* Some clients leave out the direction of their keepalives. */
static bool is_to_server(const CHANNEL_HEADER *head)
{
    return (head->flags & CHANNEL_FLAG_TO_SERVER) != 0 || (SRV_OTHER_CLIENTS && head->type == CHANNEL_PKG_KEEPALIVE);
}

static void note_received(CHANNEL *channel, RTS_UI32 now_ms)
{
    channel->last_received = now_ms;
#if COMM_ENDPOINTS
    channel->unreachable = false;
#endif
}

static void handle_channel_package(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    const CHANNEL_HEADER *head = (const CHANNEL_HEADER *)data;
    const CHANNEL_ACK *ack = (const CHANNEL_ACK *)data;

    if (size < sizeof(*head) || !is_to_server(head)) {
        COMM_COUNT(counters.malformed);
        return;
    }
    COMM_CLIENT *client = find_owner(peer, BytesGet16(head->id), now_ms);
    if (client == NULL) {
        complain(peer, BytesGet16(head->id), now_ms);
        return;
    }
    note_received(&client->channel, now_ms);
    if (head->type == CHANNEL_PKG_DATA && size >= sizeof(CHANNEL_DATA))
        handle_data(client, (const CHANNEL_DATA *)data, size, now_ms);
    else if (head->type == CHANNEL_PKG_ACK && size >= sizeof(*ack))
        handle_ack(&client->channel.tx, BytesGet32(ack->acknowledged), (head->flags & CHANNEL_FLAG_MISSING) != 0,
                   now_ms);
    else if (head->type != CHANNEL_PKG_KEEPALIVE)
        COMM_COUNT(counters.malformed);
}

static void handle_close(const ROUTER_PEER *peer, const CHANNEL_CLOSE *close, RTS_UI32 size, RTS_UI32 now_ms)
{
    if (size < sizeof(*close)) {
        COMM_COUNT(counters.malformed);
        return;
    }
    COMM_CLIENT *client = find_owner(peer, BytesGet16(close->id), now_ms);
    if (client != NULL && !is_guessing(&client->channel, now_ms))
        forget_channel(client);
}

static void handle_meta_package(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    const CHANNEL_META_HEADER *meta = (const CHANNEL_META_HEADER *)data;

    if (size < sizeof(*meta) || BytesGet16(meta->version) >> 8 != CHANNEL_VERSION >> 8 ||
        BytesGet32(meta->crc) != meta_crc(data, size)) {
        COMM_COUNT(counters.malformed);
        return;
    }
    if (meta->type == CHANNEL_PKG_OPEN_REQ)
        handle_open(peer, data, size, now_ms);
    else if (meta->type == CHANNEL_PKG_CLOSE_REQ)
        handle_close(peer, (const CHANNEL_CLOSE *)data, size, now_ms);
    else if (meta->type == CHANNEL_PKG_RTSINFO_REQ)
        send_rts_info(peer);
}

static void pump_all(void)
{
    FOR_EACH_CLIENT (client)
        if (client->channel.id != 0)
            pump(client, SysTimeGetMs()); /* a service may have taken its time */
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
    pump_all();
}

/* ---- time ---- */

static void repeat_when_overdue(CHANNEL_SENDER *tx, RTS_UI32 now_ms)
{
    if (!is_waiting_for_ack(tx) || tx->repeats >= REPEAT_COUNT ||
        now_ms - tx->sent_at < (RTS_UI32)REPEAT_FIRST_MS << tx->repeats)
        return;
    tx->repeats++;
    repeat_reply(tx);
}

static bool is_anonymous_too_long(const CHANNEL *channel, RTS_UI32 now_ms)
{
    return COMM_ENDPOINTS && now_ms - channel->anonymous_since >= CHANNEL_LOGIN_MS;
}

static void cycle_client(COMM_CLIENT *client, RTS_UI32 now_ms)
{
    if (client->channel.id == 0)
        return;
    if (is_gone(&client->channel.peer)) {
        forget_channel(client);
        return;
    }
    if (COMM_ENDPOINTS && SrvIsLoggedIn(client))
        client->channel.anonymous_since = now_ms;
    if (now_ms - client->channel.last_received >= CHANNEL_TIMEOUT_MS ||
        is_anonymous_too_long(&client->channel, now_ms)) {
        close_channel(client, ERR_CHS_TIMEOUT);
        return;
    }
    if (now_ms - client->channel.last_received >= CHANNEL_REPLY_WAIT_MS)
        let_reply_go(client);
    if (!is_reliable(&client->channel.peer))
        repeat_when_overdue(&client->channel.tx, now_ms);
    pump(client, now_ms);
}

static void cycle(void)
{
    FOR_EACH_CLIENT (client)
        cycle_client(client, SysTimeGetMs());
}

#if COMM_ENDPOINTS
bool ChannelNeeds(const BLK_DRV *driver)
{
    FOR_EACH_CLIENT (client)
        if (client->channel.id != 0 && client->channel.peer.driver == driver && SrvIsLoggedIn(client))
            return true;
    return false;
}

void ChannelUnreachable(const BLK_DRV *driver, RTS_UI64 endpoint)
{
    FOR_EACH_CLIENT (client)
        if (client->channel.peer.driver == driver && client->channel.peer.endpoint == endpoint)
            client->channel.unreachable = true;
}
#endif

const CHANNEL_COUNTERS *ChannelGetCounters(void)
{
    return &counters;
}

static void reset_all(void)
{
    CMP_CLEAR(clients);
    CMP_CLEAR(server);
    if (COMM_COUNTERS)
        CMP_CLEAR(counters);
}

static void close_all(void)
{
    FOR_EACH_CLIENT (client)
        if (client->channel.id != 0)
            close_channel(client, ERR_CHS_SHUTDOWN);
}

RTS_RESULT CmpChannelServerEmbedded_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        reset_all();
    else if (hook == CH_COMM_CYCLE)
        cycle();
    else if (hook == CH_EXIT_COMM)
        close_all();
    return ERR_OK;
}
