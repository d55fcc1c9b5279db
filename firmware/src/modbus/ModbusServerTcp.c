/*
 * ModbusServerTcp.c - Modbus servers on TCP: where they listen, and their connections.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusServerTcp.h"

#include <string.h>

#include "ModbusTcp.h"
#include "rts_config.h"

#if MODBUS_MAX_CONNECTIONS > 0 /* a port without sockets may compile all of firmware/src */

enum {
    LISTEN_AGAIN_NS = 1000000000,
    REQUESTS_MAX = 4, /* of a connection in one pass, so that it does not hold up the others */
};

typedef struct {
    MODBUS_SERVER *server;
    SOCKADDRESS own;
    RTS_HANDLE socket;
    RTS_RESULT state;
    RTS_I64 tried_ns;
} LISTENER;

typedef struct {
    MODBUS_SERVER *server; /* NULL: the place is free */
    MODBUS_LINK link;
} CONNECTION;

static struct {
    RTS_UI32 count;
    LISTENER listeners[MODBUS_MAX_SERVERS];
    CONNECTION connections[MODBUS_MAX_CONNECTIONS];
    MODBUS_TCP_COUNTERS counters;
} all;

static const RTS_HANDLE NO_SOCKET = RTS_INVALID_HANDLE;

#define FOR_EACH_CONNECTION(connection) \
    for (CONNECTION *connection = all.connections; connection < all.connections + MODBUS_MAX_CONNECTIONS; connection++)

/* ---- connections ---- */

/* A free place, or that of the idlest connection. */
static CONNECTION *find_place(void)
{
    CONNECTION *idlest = all.connections;

    FOR_EACH_CONNECTION (connection) {
        if (connection->server == NULL)
            return connection;
        if (connection->link.moved_ns < idlest->link.moved_ns)
            idlest = connection;
    }
    return idlest;
}

static void begin(MODBUS_SERVER *server, RTS_HANDLE socket, RTS_I64 now_ns)
{
    CONNECTION *place = find_place();

    all.counters.accepted++;
    if (place->server != NULL) {
        all.counters.displaced++;
        ModbusTcpClose(&place->link);
    }
    place->server = server;
    place->link.bad_frames = 0;
    ModbusTcpBeginServer(&place->link, socket, now_ns);
}

static void serve(CONNECTION *connection, RTS_I64 now_ns)
{
    RTS_UI32 requests = 0;

    while (requests < REQUESTS_MAX && ModbusServerPoll(connection->server, &connection->link, now_ns))
        requests++;
    if (connection->link.handle == NO_SOCKET) {
        all.counters.bad_frames += connection->link.bad_frames;
        connection->server = NULL;
    }
}

/* ---- listeners ---- */

static void listen_again(LISTENER *listener, RTS_I64 now_ns)
{
    listener->tried_ns = now_ns;
    listener->state = SysSockListen(&listener->own, &listener->socket);
    if (listener->state != ERR_OK)
        listener->socket = NO_SOCKET;
}

static void accept_all(LISTENER *listener, RTS_I64 now_ns)
{
    SOCKADDRESS peer;
    RTS_HANDLE socket;

    if (listener->socket == NO_SOCKET && now_ns - listener->tried_ns >= LISTEN_AGAIN_NS)
        listen_again(listener, now_ns);
    if (listener->socket == NO_SOCKET)
        return;
    for (RTS_UI32 i = 0; i < MODBUS_MAX_CONNECTIONS; i++) { /* more have to wait for the next pass */
        socket = SysSockAccept(listener->socket, &peer);
        if (socket == NO_SOCKET)
            return;
        begin(listener->server, socket, now_ns);
    }
}

RTS_RESULT ModbusServerTcpOpen(MODBUS_SERVER *server, const SOCKADDRESS *own)
{
    LISTENER *listener = &all.listeners[all.count];

    if (all.count == MODBUS_MAX_SERVERS)
        return ERR_NOMEMORY;
    all.count++;
    listener->server = server;
    listener->own = *own;
    listener->socket = RTS_INVALID_HANDLE;
    listener->state = ERR_PENDING;
    listener->tried_ns = -LISTEN_AGAIN_NS;
    return ERR_OK;
}

void ModbusServerTcpClose(void)
{
    FOR_EACH_CONNECTION (connection) {
        if (connection->server != NULL)
            ModbusTcpClose(&connection->link);
        connection->server = NULL;
    }
    for (RTS_UI32 i = 0; i < all.count; i++) {
        if (all.listeners[i].socket != NO_SOCKET)
            SysSockClose(all.listeners[i].socket);
    }
    all.count = 0;
    memset(&all.counters, 0, sizeof(all.counters));
}

void ModbusServerTcpPoll(RTS_I64 now_ns)
{
    for (RTS_UI32 i = 0; i < all.count; i++)
        accept_all(&all.listeners[i], now_ns);
    FOR_EACH_CONNECTION (connection) {
        if (connection->server != NULL)
            serve(connection, now_ns);
    }
}

RTS_RESULT ModbusServerTcpGetState(const MODBUS_SERVER *server)
{
    for (RTS_UI32 i = 0; i < all.count; i++) {
        if (all.listeners[i].server == server)
            return all.listeners[i].state;
    }
    return ERR_NO_OBJECT;
}

const MODBUS_TCP_COUNTERS *ModbusServerTcpGetCounters(void)
{
    return &all.counters;
}

#endif
