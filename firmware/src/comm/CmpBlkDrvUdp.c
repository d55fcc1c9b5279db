/*
 * CmpBlkDrvUdp.c - the UDP block driver: a datagram is a packet.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A datagram to the device's own address is for the device, whatever receiver the packet has: if a router translates
 * addresses (NAT), the sender knows another one. A broadcast is for the device if the packet has its address as receiver,
 * or no receiver.
 */
#include "CmpBlkDrvUdp.h"

#include <string.h>

#include "CmpPackets.h"
#include "SysSocket.h"
#include "SysTime.h"
#include "rts_config.h"

#if COMM_ENDPOINTS /* a port without network may compile all of firmware/src */

enum {
    READ_MAX = 64, /* datagrams per cycle, so that a flood does not stop the rest of the runtime */
    PORT_BITS = 16,
    IP_BITS = 32,
    NAMES_MAX = 32, /* replies to name requests at once that are longer than the request ... */
    NAMES_EVERY_MS =
        64, /* ... and one more after each such time: at most 2 KB a second to a sender that may be forged */
};

typedef struct {
    RTS_HANDLE socket;
    BLK_DRV driver;
} LISTENER;

/* Replies to both are sent from the socket of the first. */
static struct {
    LISTENER own;
    LISTENER broadcast;
    RTS_UI32 request_size; /* bytes of the datagram that is handled */
    RTS_UI32 names;        /* longer replies to name requests that may be sent now, as of `names_at` */
    RTS_UI32 names_at;     /* SysTimeGetMs */
} udp;

static UDP_COUNTERS counters;

static const char *const counter_names[] = {"packets", "too long", "without reply", "names not sent"};
RTS_STATIC_ASSERT(sizeof(UDP_COUNTERS) == sizeof(RTS_UI32) * RTS_COUNT(counter_names), each_counter_has_a_name);
const BLK_COUNTERS BlkDrvUdpCounters = {"UDP", counter_names, RTS_COUNT(counter_names), &counters.packets, 1};

static const RTS_HANDLE NO_SOCKET = RTS_INVALID_HANDLE;

RTS_UI32 BlkDrvUdpPutAddress(RTS_UI32 ip, RTS_UI32 prefix, RTS_UI32 index, RTS_UI8 *address)
{
    RTS_UI32 host_bits = IP_BITS - prefix;
    RTS_UI64 host = ip & (((RTS_UI64)1 << host_bits) - 1);
    RTS_UI64 value = host | (RTS_UI64)index << host_bits;
    RTS_UI32 words = (host_bits + UDP_INDEX_BITS + 15) / 16;

    for (RTS_UI32 i = 2 * words; i-- > 0; value >>= 8)
        address[i] = (RTS_UI8)value;
    return words;
}

/* ---- endpoints ---- */

static RTS_UI64 endpoint_of(const SOCKADDRESS *address)
{
    return (RTS_UI64)address->ip << PORT_BITS | address->port;
}

static SOCKADDRESS address_of(RTS_UI64 endpoint)
{
    SOCKADDRESS address = {(RTS_UI32)(endpoint >> PORT_BITS), (RTS_UI16)endpoint};

    return address;
}

/* A reply to a multicast or broadcast address would go to many nodes. */
static bool can_be_answered(const SOCKADDRESS *from)
{
    return from->port != 0 && from->ip != 0 && from->ip < 0xE0000000u;
}

/* ---- packets ---- */

/* True if a reply to a name request of this size may be sent: it is not longer than the request, or one of the few that
 * are. The sender of a request can be forged, and its victim would be sent 8 times as many bytes as the attacker sends. */
static bool may_be_named(RTS_UI32 size)
{
    if (size <= udp.request_size)
        return true;
    RTS_UI32 earned = (SysTimeGetMs() - udp.names_at) / NAMES_EVERY_MS;
    udp.names_at += earned * NAMES_EVERY_MS;
    udp.names = earned < NAMES_MAX - udp.names ? udp.names + earned : NAMES_MAX;
    if (udp.names == 0) {
        COMM_COUNT(counters.not_named);
        return false;
    }
    udp.names--;
    return true;
}

static RTS_RESULT udp_send(const ROUTER_PEER *peer, const BLK_PART *parts, RTS_UI32 count)
{
    SOCKADDRESS to = address_of(peer->endpoint);
    RTS_UI8 packet[BLK_MAX_SIZE];
    RTS_UI32 size = 0;

    for (RTS_UI32 i = 0; i < count; i++) {
        if (parts[i].size > sizeof(packet) - size)
            return ERR_NET_MSGSIZE;
        memcpy(packet + size, parts[i].data, parts[i].size);
        size += parts[i].size;
    }
    if (size < sizeof(ROUTER_HEADER))
        return ERR_NET_MSGSIZE;
    if (((const ROUTER_HEADER *)packet)->service == ROUTER_SVC_NAME_RESPONSE && !may_be_named(size))
        return ERR_NOBUFFER;
    return SysSockSendTo(udp.own.socket, packet, size, &to);
}

#if COMM_HOST_CHANNELS
static RTS_UI32 host_of(const ROUTER_PEER *peer)
{
    return SockHost(address_of(peer->endpoint).ip);
}
#endif

static void take(const LISTENER *listener, const RTS_UI8 *data, RTS_UI32 size, const SOCKADDRESS *from)
{
    if (size > BLK_MAX_SIZE) {
        COMM_COUNT(counters.too_long);
    } else if (!can_be_answered(from)) {
        COMM_COUNT(counters.no_reply);
    } else {
        COMM_COUNT(counters.packets);
        udp.request_size = size;
        RouterHandleDataFrom(&listener->driver, endpoint_of(from), data, size);
    }
}

static void receive(const LISTENER *listener)
{
    RTS_UI8 data[BLK_MAX_SIZE];
    SOCKADDRESS from;
    RTS_UI32 size;

    if (listener->socket == NO_SOCKET)
        return;
    for (RTS_UI32 i = 0; i < READ_MAX; i++) {
        if (SysSockRecvFrom(listener->socket, data, sizeof(data), &from, &size) != ERR_OK)
            return;
        take(listener, data, size, &from);
    }
}

static void receive_refusals(void)
{
    SOCKADDRESS to;

    if (udp.own.socket == NO_SOCKET)
        return;
    for (RTS_UI32 i = 0; i < READ_MAX && SysSockRecvRefused(udp.own.socket, &to) == ERR_OK; i++)
        RouterUnreachable(&udp.own.driver, endpoint_of(&to));
}

/* ---- life ---- */

static void open_listener(LISTENER *listener, SYSSOCK_PURPOSE purpose)
{
    listener->socket = SysSockOpen(purpose);
    listener->driver.type = BLK_DRV_TYPE_UDP;
    listener->driver.point_to_point = purpose == SYSSOCK_UDP;
    listener->driver.send = udp_send;
#if COMM_HOST_CHANNELS
    listener->driver.host_of = host_of;
#endif
}

static void open_all(void)
{
    SOCKADDRESS own = {0, UDP_PORT};
    RTS_UI32 prefix = IP_BITS;
    BLK_DRV *driver = &udp.own.driver;

    memset(&udp, 0, sizeof(udp));
    udp.names = NAMES_MAX;
    udp.names_at = SysTimeGetMs();
    open_listener(&udp.own, SYSSOCK_UDP);
    open_listener(&udp.broadcast, SYSSOCK_UDP_BROADCAST);
    if (udp.own.socket == NO_SOCKET)
        return;
    (void)SysSockGetOwn(udp.own.socket, &own, &prefix);
    driver->address_words =
        (RTS_UI8)BlkDrvUdpPutAddress(own.ip, prefix, (own.port - UDP_PORT) % UDP_PORTS, driver->address);
#if SRV_OTHER_CLIENTS
    udp.broadcast.driver.address_bits = (RTS_UI8)(IP_BITS - prefix + UDP_INDEX_BITS);
#endif
    udp.broadcast.driver.address_words = driver->address_words;
    memcpy(udp.broadcast.driver.address, driver->address, sizeof(driver->address));
}

static void cycle(void)
{
    receive_refusals();
    receive(&udp.own);
    receive(&udp.broadcast);
}

static void close_listener(LISTENER *listener)
{
    if (listener->socket != NO_SOCKET)
        SysSockClose(listener->socket);
    listener->socket = RTS_INVALID_HANDLE;
}

static void close_all(void)
{
    close_listener(&udp.own);
    close_listener(&udp.broadcast);
}

const UDP_COUNTERS *BlkDrvUdpGetCounters(void)
{
    return &counters;
}

RTS_RESULT CmpBlkDrvUdp_Hook(CMP_HOOK hook)
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
