/*
 * CmpBlkDrvTcp.c - the TCP block driver: a server whose connections are a block driver each.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Received bytes are collected in a buffer, complete frames are passed to the router. Sending fills a second buffer, from
 * which the socket takes as much as it has room for. A connection that has ended keeps its place, with `gone` set,
 * until the next cycle: so the layers above have seen that before a new connection gets the place.
 */
#include "CmpBlkDrvTcp.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpPackets.h"
#include "SysSocket.h"
#include "SysTime.h"
#include "rts_config.h"

#if COMM_ENDPOINTS /* a port without network may compile all of firmware/src */

enum {
    FRAME_MIN = sizeof(TCP_HEADER) + 8, /* the shortest packet there is: two words of address, no payload */
    FRAME_MAX = sizeof(TCP_HEADER) + BLK_MAX_SIZE,
    READ_MAX = 4 * TCP_BUFFER_SIZE, /* bytes per cycle, so that one connection does not hold up the rest */
};

RTS_STATIC_ASSERT(COMM_ENDPOINTS, tcp_needs_endpoints);
RTS_STATIC_ASSERT(TCP_BUFFER_SIZE >= FRAME_MAX, tcp_buffer_holds_the_largest_frame);
RTS_STATIC_ASSERT(TCP_MAX_CONNECTIONS > COMM_MAX_CLIENTS, one_tcp_connection_has_no_login);

typedef struct {
    RTS_HANDLE socket;  /* RTS_INVALID_HANDLE: none, the place is free */
    bool ended;         /* to be closed in the next cycle */
    bool heard;         /* a frame has come */
    RTS_UI32 began_at;  /* when the frame that is on its way began, the first one with the connection; SysTimeGetMs */
    RTS_UI32 moved_at;  /* when something was received or taken last */
    RTS_UI32 host;      /* of the peer; 0: this machine */
    RTS_UI32 in_size;   /* received, not yet a complete frame */
    RTS_UI32 out_begin; /* what is still to be sent */
    RTS_UI32 out_end;
    BLK_DRV driver;
    RTS_UI8 in[TCP_BUFFER_SIZE];
    RTS_UI8 out[TCP_BUFFER_SIZE];
} CONNECTION;

static struct {
    RTS_HANDLE listener;
    RTS_HANDLE waiting; /* accepted, and all places were taken */
    SOCKADDRESS waiting_peer;
    CONNECTION connections[TCP_MAX_CONNECTIONS];
} tcp;

static TCP_COUNTERS counters;

static const char *const counter_names[] = {"accepted",   "frames", "displaced", "bad magic",
                                            "bad length", "late",   "idle",      "disconnected"};
RTS_STATIC_ASSERT(sizeof(TCP_COUNTERS) == sizeof(RTS_UI32) * RTS_COUNT(counter_names), each_counter_has_a_name);
const BLK_COUNTERS BlkDrvTcpCounters = {"TCP", counter_names, RTS_COUNT(counter_names), &counters.accepted, 1};

static const RTS_HANDLE NO_SOCKET = RTS_INVALID_HANDLE;

#define FOR_EACH_CONNECTION(connection) \
    for (CONNECTION *connection = tcp.connections; connection < tcp.connections + TCP_MAX_CONNECTIONS; connection++)

static bool is_free(const CONNECTION *connection)
{
    return connection->socket == NO_SOCKET;
}

/* ---- the end of a connection ---- */

/* Closed at once; the place is free in the next cycle. */
static void end(CONNECTION *connection)
{
    if (connection->ended)
        return;
    SysSockClose(connection->socket);
    connection->ended = true;
    connection->driver.gone = true;
}

static void end_because(CONNECTION *connection, RTS_UI32 *counter)
{
    COMM_COUNT(*counter);
    end(connection);
}

/* ---- sending ---- */

static void transmit(CONNECTION *connection)
{
    RTS_UI32 taken;

    if (connection->ended || connection->out_begin == connection->out_end)
        return;
    if (SysSockSend(connection->socket, connection->out + connection->out_begin,
                    connection->out_end - connection->out_begin, &taken) != ERR_OK) {
        end_because(connection, &counters.disconnected);
        return;
    }
    if (taken != 0)
        connection->moved_at = SysTimeGetMs();
    connection->out_begin += taken;
    if (connection->out_begin == connection->out_end)
        connection->out_begin = connection->out_end = 0;
}

/* Makes one piece of the room there is. */
static RTS_UI32 make_room(CONNECTION *connection)
{
    if (connection->out_begin != 0) {
        connection->out_end -= connection->out_begin;
        memmove(connection->out, connection->out + connection->out_begin, connection->out_end);
        connection->out_begin = 0;
    }
    return TCP_BUFFER_SIZE - connection->out_end;
}

static void append(CONNECTION *connection, const void *data, RTS_UI32 size)
{
    memcpy(connection->out + connection->out_end, data, size);
    connection->out_end += size;
}

/* Queues a frame; `transmit` sends all queued frames with one call. */
static RTS_RESULT tcp_send(const ROUTER_PEER *peer, const BLK_PART *parts, RTS_UI32 count)
{
    CONNECTION *connection = peer->driver->instance;
    TCP_HEADER header;
    RTS_UI32 size = sizeof(header);

    if (connection->ended)
        return ERR_NET_NOTCONNECTED;
    for (RTS_UI32 i = 0; i < count; i++)
        size += parts[i].size;
    if (size > FRAME_MAX)
        return ERR_NET_MSGSIZE;
    if (size > make_room(connection))
        return ERR_NOBUFFER;
    BytesPut32(header.magic, (RTS_UI32)TCP_MAGIC);
    BytesPut32(header.size, size);
    append(connection, &header, sizeof(header));
    for (RTS_UI32 i = 0; i < count; i++)
        append(connection, parts[i].data, parts[i].size);
    return ERR_OK;
}

/* ---- receiving ---- */

/* The size of the frame with this header; 0 if the header is invalid, which ends the connection. */
static RTS_UI32 frame_size(CONNECTION *connection, const TCP_HEADER *header)
{
    RTS_UI32 size = BytesGet32(header->size);

    if (BytesGet32(header->magic) != (RTS_UI32)TCP_MAGIC)
        end_because(connection, &counters.bad_magic);
    else if (size < FRAME_MIN || size > FRAME_MAX)
        end_because(connection, &counters.bad_length);
    return connection->ended ? 0 : size;
}

/* Passes the frame at `at` to the router; returns its size, 0 if it is not complete or invalid. */
static RTS_UI32 take_frame(CONNECTION *connection, RTS_UI32 at)
{
    const TCP_HEADER *header = (const TCP_HEADER *)(connection->in + at);
    RTS_UI32 there = connection->in_size - at;
    RTS_UI32 size = there < sizeof(*header) ? 0 : frame_size(connection, header);

    if (size == 0 || size > there)
        return 0;
    COMM_COUNT(counters.frames);
    connection->heard = true;
    RouterHandleData(&connection->driver, (const RTS_UI8 *)(header + 1), size - (RTS_UI32)sizeof(*header));
    return connection->ended ? 0 : size;
}

static void take_frames(CONNECTION *connection)
{
    RTS_UI32 at = 0;
    RTS_UI32 size;

    while ((size = take_frame(connection, at)) != 0)
        at += size;
    if (at == 0)
        return;
    connection->in_size -= at;
    memmove(connection->in, connection->in + at, connection->in_size);
    connection->began_at = connection->moved_at;
}

/* Returns the number of bytes received. The buffer has room: it holds less than a frame. */
static RTS_UI32 receive_some(CONNECTION *connection)
{
    RTS_UI32 size;

    if (SysSockRecv(connection->socket, connection->in + connection->in_size, TCP_BUFFER_SIZE - connection->in_size,
                    &size) != ERR_OK) {
        end_because(connection, &counters.disconnected);
        return 0;
    }
    if (size == 0)
        return 0;
    connection->moved_at = SysTimeGetMs();
    if (connection->in_size == 0 && connection->heard)
        connection->began_at = connection->moved_at;
    connection->in_size += size;
    take_frames(connection);
    return size;
}

static void receive(CONNECTION *connection)
{
    RTS_UI32 total = 0;
    RTS_UI32 size;

    if (connection->ended)
        return;
    do {
        size = receive_some(connection);
        total += size;
    } while (size != 0 && !connection->ended && total < READ_MAX);
}

/* ---- time ---- */

static void look_at_time(CONNECTION *connection)
{
    RTS_UI32 now_ms = SysTimeGetMs();
    bool waits = connection->in_size != 0 || !connection->heard;

    if (waits && now_ms - connection->began_at >= TCP_FRAME_MS)
        end_because(connection, &counters.late_frames);
    else if (now_ms - connection->moved_at >= TCP_IDLE_MS)
        end_because(connection, &counters.idle);
}

/* ---- connections ---- */

static void put_address(TCP_ADDRESS *address, const SOCKADDRESS *end)
{
    for (RTS_UI32 i = 0; i < sizeof(address->port); i++)
        address->port[i] = (RTS_UI8)(end->port >> 8 * (sizeof(address->port) - 1 - i));
    for (RTS_UI32 i = 0; i < sizeof(address->ip); i++)
        address->ip[i] = (RTS_UI8)(end->ip >> 8 * (sizeof(address->ip) - 1 - i));
}

#if COMM_HOST_CHANNELS
static RTS_UI32 host_of(const ROUTER_PEER *peer)
{
    const CONNECTION *connection = peer->driver->instance;

    return connection->host;
}
#endif

static void begin(CONNECTION *connection, RTS_HANDLE socket, const SOCKADDRESS *peer)
{
    BLK_DRV *driver = &connection->driver;
    SOCKADDRESS own = {0, 0};
    RTS_UI32 prefix;

    COMM_COUNT(counters.accepted);
    memset(connection, 0, offsetof(CONNECTION, in));
    connection->socket = socket;
    connection->host = SockHost(peer->ip);
    connection->began_at = connection->moved_at = SysTimeGetMs();
    (void)SysSockGetOwn(socket, &own, &prefix);
    driver->type = BLK_DRV_TYPE_TCP;
    driver->point_to_point = 1;
    driver->reliable = true;
    driver->address_words = sizeof(TCP_ADDRESS) / 2;
    driver->peer_words = sizeof(TCP_ADDRESS) / 2;
    put_address((TCP_ADDRESS *)driver->address, &own);
    put_address((TCP_ADDRESS *)driver->peer_address, peer);
    driver->instance = connection;
    driver->send = tcp_send;
#if COMM_HOST_CHANNELS
    driver->host_of = host_of;
#endif
}

/* Connections of its machine. */
static RTS_UI32 count_of_host(const CONNECTION *one)
{
    RTS_UI32 count = 0;

    FOR_EACH_CONNECTION (connection)
        count += !is_free(connection) && connection->host == one->host;
    return count;
}

/* Whether `a` is less useful than `b`: its machine has more connections, it has not sent a frame, or has been silent
 * longer. */
static bool is_less(const CONNECTION *a, const CONNECTION *b)
{
    RTS_UI32 now_ms = SysTimeGetMs();

    if (a->host != b->host && count_of_host(a) != count_of_host(b))
        return count_of_host(a) > count_of_host(b);
    return a->heard != b->heard ? !a->heard : now_ms - a->moved_at > now_ms - b->moved_at;
}

/* A free place, or the least useful one that no client needs: there are fewer clients than places. */
static CONNECTION *find_place(void)
{
    CONNECTION *least = NULL;

    FOR_EACH_CONNECTION (connection) {
        if (is_free(connection))
            return connection;
        if (!RouterNeeds(&connection->driver) && (least == NULL || is_less(connection, least)))
            least = connection;
    }
    return least;
}

/* Gives the waiting connection a place. If none is free, ends another connection, so that there is one in the next
 * cycle; false then. */
static bool place_waiting(void)
{
    CONNECTION *place = find_place();

    if (is_free(place)) {
        begin(place, tcp.waiting, &tcp.waiting_peer);
        tcp.waiting = RTS_INVALID_HANDLE;
        return true;
    }
    end_because(place, &counters.displaced);
    return false;
}

static void accept_all(void)
{
    do {
        if (tcp.waiting == NO_SOCKET)
            tcp.waiting = SysSockAccept(tcp.listener, &tcp.waiting_peer);
    } while (tcp.waiting != NO_SOCKET && place_waiting());
}

/* ---- life ---- */

static void open_all(void)
{
    tcp.listener = SysSockOpen(SYSSOCK_TCP);
    tcp.waiting = RTS_INVALID_HANDLE;
    FOR_EACH_CONNECTION (connection)
        connection->socket = RTS_INVALID_HANDLE;
}

static void free_ended(void)
{
    FOR_EACH_CONNECTION (connection)
        if (connection->ended)
            connection->socket = RTS_INVALID_HANDLE;
}

static void serve(CONNECTION *connection)
{
    if (is_free(connection))
        return;
    receive(connection);
    transmit(connection);
    if (!connection->ended)
        look_at_time(connection);
}

static void cycle(void)
{
    if (tcp.listener == NO_SOCKET)
        return;
    free_ended();
    accept_all();
    FOR_EACH_CONNECTION (connection)
        serve(connection);
}

static void close_all(void)
{
    if (tcp.listener == NO_SOCKET)
        return;
    free_ended();
    FOR_EACH_CONNECTION (connection) {
        if (!is_free(connection)) {
            transmit(connection);
            end(connection);
        }
    }
    if (tcp.waiting != NO_SOCKET)
        SysSockClose(tcp.waiting);
    SysSockClose(tcp.listener);
    tcp.listener = RTS_INVALID_HANDLE;
}

const TCP_COUNTERS *BlkDrvTcpGetCounters(void)
{
    return &counters;
}

RTS_RESULT CmpBlkDrvTcp_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT && COMM_COUNTERS)
        CMP_CLEAR(counters);
    else if (hook == CH_INIT3) /* before an application can take the port */
        open_all();
    else if (hook == CH_COMM_CYCLE)
        cycle();
    else if (hook == CH_EXIT3) /* not CH_EXIT_COMM: there the channel server takes leave */
        close_all();
    return ERR_OK;
}

#endif
