/*
 * SimNet.c - the sockets of the program in the simulator: within the device, and on a network that its host makes.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Nothing is lost on its way but datagrams that a socket has no room for. Time passes only where the host lets it pass
 * before it hands a packet over.
 */
#include <string.h>

#include "CmpBytes.h"
#include "Sim.h"
#include "SysNet.h"
#include "rts_config.h"
#include "sim_port.h"

enum {
    WAITING = 8, /* connections that no program has accepted */
    SOCKETS = IEC_SOCKETS + WAITING,
    ROOM = 8192, /* bytes that a socket holds */
    HEAD = 8,    /* address, port and size of a datagram in them */
    SENT = 64,   /* packets that the host has not taken */
    FIRST_FREE_PORT = 49152,
    LOOPBACK = 127,
    IP_LOOPBACK = 0x7F000001,
};

typedef enum { FREE, UDP, LISTENER, CONNECTING, CONNECTED, ENDED, REFUSED } STATE;

typedef struct {
    STATE state;
    bool is_waiting; /* to be accepted */
    SOCKADDRESS own;
    SOCKADDRESS peer;
    RTS_UI32 first;
    RTS_UI32 count;
    RTS_UI8 data[ROOM];
} SOCKET;

static struct {
    RTS_UI32 ip;
    RTS_UI32 next_port;
    RTS_UI32 first;
    RTS_UI32 count;
    SOCKET socket[SOCKETS];
    SIM_NET_PACKET sent[SENT];
} net = {.ip = IP_LOOPBACK};

#define FOR_EACH_SOCKET(name) for (SOCKET *name = net.socket; name < net.socket + SOCKETS; name++)

/* ---- bytes of a socket ---- */

static void put_bytes(SOCKET *to, const RTS_UI8 *data, RTS_UI32 size)
{
    for (RTS_UI32 i = 0; i < size; i++)
        to->data[(to->first + to->count++) % ROOM] = data[i];
}

static RTS_UI32 get_bytes(SOCKET *from, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 taken = size < from->count ? size : from->count;

    for (RTS_UI32 i = 0; i < taken; i++)
        data[i] = from->data[(from->first + i) % ROOM];
    from->first = (from->first + taken) % ROOM;
    from->count -= taken;
    return taken;
}

static void skip_bytes(SOCKET *from, RTS_UI32 size)
{
    from->first = (from->first + size) % ROOM;
    from->count -= size;
}

/* ---- packets ---- */

static bool is_own(RTS_UI32 ip)
{
    return ip == net.ip || ip >> 24 == LOOPBACK;
}

static SOCKET *find_connection(const SIM_NET_PACKET *packet)
{
    FOR_EACH_SOCKET(found)
    if (found->state >= CONNECTING && found->own.port == packet->to_port && found->peer.port == packet->from_port &&
        found->peer.ip == packet->from_ip)
        return found;
    return NULL;
}

static SOCKET *find_listener(RTS_UI32 port, STATE state)
{
    FOR_EACH_SOCKET(found)
    if (found->state == state && found->own.port == port)
        return found;
    return NULL;
}

static SOCKET *find_free(void)
{
    FOR_EACH_SOCKET(found)
    if (found->state == FREE)
        return found;
    return NULL;
}

static RTS_RESULT deliver(const SIM_NET_PACKET *packet);

static RTS_RESULT send_packet(RTS_UI32 kind, const SOCKADDRESS *from, const SOCKADDRESS *to, const RTS_UI8 *data,
                              RTS_UI32 size)
{
    static SIM_NET_PACKET local; /* deliver() answers it before it needs it no more: it keeps nothing of it */
    SIM_NET_PACKET *packet = is_own(to->ip) ? &local : &net.sent[(net.first + net.count) % SENT];

    if (packet != &local && net.count == SENT)
        return ERR_NOBUFFER;
    packet->kind = kind;
    packet->from_ip = is_own(to->ip) ? to->ip : net.ip;
    packet->from_port = from->port;
    packet->to_ip = to->ip;
    packet->to_port = to->port;
    packet->size = size;
    if (size > 0)
        memcpy(packet->data, data, size);
    if (packet == &local)
        return deliver(packet);
    net.count++;
    return ERR_OK;
}

static void answer(RTS_UI32 kind, const SIM_NET_PACKET *packet)
{
    const SOCKADDRESS own = {packet->to_ip, (RTS_UI16)packet->to_port};
    const SOCKADDRESS peer = {packet->from_ip, (RTS_UI16)packet->from_port};

    (void)send_packet(kind, &own, &peer, NULL, 0);
}

/* A datagram without room is lost. */
static void take_datagram(const SIM_NET_PACKET *packet)
{
    RTS_UI8 head[HEAD];

    BytesPut32(head, packet->from_ip);
    BytesPut16(head + 4, (RTS_UI16)packet->from_port);
    BytesPut16(head + 6, (RTS_UI16)packet->size);
    FOR_EACH_SOCKET(found)
    if (found->state == UDP && found->own.port == packet->to_port && ROOM - found->count >= HEAD + packet->size) {
        put_bytes(found, head, sizeof head);
        put_bytes(found, packet->data, packet->size);
    }
}

static RTS_UI32 count_waiting(void)
{
    RTS_UI32 count = 0;

    FOR_EACH_SOCKET(found)
    count += found->state != FREE && found->is_waiting;
    return count;
}

static void take_connection(const SIM_NET_PACKET *packet)
{
    SOCKET *found = find_listener(packet->to_port, LISTENER) != NULL && count_waiting() < WAITING ? find_free() : NULL;

    if (found != NULL) {
        found->state = CONNECTED;
        found->is_waiting = true;
        found->own = (SOCKADDRESS){packet->to_ip, (RTS_UI16)packet->to_port};
        found->peer = (SOCKADDRESS){packet->from_ip, (RTS_UI16)packet->from_port};
        found->first = found->count = 0;
    }
    answer(found != NULL ? SIM_NET_ACCEPT : SIM_NET_REFUSE, packet);
}

static RTS_RESULT take_data(SOCKET *found, const SIM_NET_PACKET *packet)
{
    if (found->state != CONNECTED)
        return ERR_OK;
    if (ROOM - found->count < packet->size)
        return ERR_NOBUFFER;
    put_bytes(found, packet->data, packet->size);
    return ERR_OK;
}

static RTS_RESULT take_of_connection(const SIM_NET_PACKET *packet)
{
    SOCKET *found = find_connection(packet);

    if (found == NULL) {
        if (packet->kind == SIM_NET_DATA_OF || packet->kind == SIM_NET_ACCEPT)
            answer(SIM_NET_REFUSE, packet);
        return ERR_OK;
    }
    if (packet->kind == SIM_NET_DATA_OF)
        return take_data(found, packet);
    if (packet->kind == SIM_NET_ACCEPT)
        found->state = found->state == CONNECTING ? CONNECTED : found->state;
    else
        found->state = packet->kind == SIM_NET_END ? ENDED : REFUSED;
    return ERR_OK;
}

static RTS_RESULT deliver(const SIM_NET_PACKET *packet)
{
    if (packet->kind == SIM_NET_DATAGRAM)
        take_datagram(packet);
    else if (packet->kind == SIM_NET_CONNECT)
        take_connection(packet);
    else
        return take_of_connection(packet);
    return ERR_OK;
}

/* ---- the host ---- */

void SimNetPowerOn(void)
{
    RTS_UI32 ip = net.ip;

    memset(&net, 0, sizeof net);
    net.ip = ip;
}

void SimNetSetAddress(RTS_UI32 ip)
{
    net.ip = ip != 0 ? ip : IP_LOOPBACK;
}

RTS_RESULT SimNetPut(const SIM_NET_PACKET *packet)
{
    if (packet->kind > SIM_NET_END || packet->size > SIM_NET_DATA || packet->from_port - 1 >= UINT16_MAX ||
        packet->to_port - 1 >= UINT16_MAX)
        return ERR_PARAMETER;
    return net.count < SENT ? deliver(packet) : (RTS_RESULT)ERR_NOBUFFER; /* there is room for an answer */
}

RTS_RESULT SimNetGet(SIM_NET_PACKET *packet)
{
    if (net.count == 0)
        return ERR_NOTHING_TO_DO;
    *packet = net.sent[net.first];
    net.first = (net.first + 1) % SENT;
    net.count--;
    return ERR_OK;
}

/* ---- SysNet.h ---- */

static SOCKET *find(RTS_HANDLE handle)
{
    return handle < SOCKETS && net.socket[handle].state != FREE ? &net.socket[handle] : NULL;
}

static bool is_used(RTS_UI32 port, bool is_udp)
{
    FOR_EACH_SOCKET(found)
    if (found->state != FREE && (found->state == UDP) == is_udp && found->own.port == port)
        return true;
    return false;
}

static RTS_UI16 free_port(bool is_udp)
{
    RTS_UI32 port;

    do {
        port = FIRST_FREE_PORT + net.next_port++ % (UINT16_MAX - FIRST_FREE_PORT);
    } while (is_used(port, is_udp));
    return (RTS_UI16)port;
}

static RTS_RESULT bind(SOCKET *found, const SOCKADDRESS *own, STATE state)
{
    bool is_udp = state == UDP;

    if (own->ip != 0 && !is_own(own->ip))
        return ERR_DEVICE;
    if (own->port != 0 && (is_udp ? is_used(own->port, true) : find_listener(own->port, LISTENER) != NULL))
        return ERR_DUPLICATE;
    found->own = *own;
    if (own->port == 0)
        found->own.port = free_port(is_udp);
    found->state = state;
    return ERR_OK;
}

static RTS_RESULT connect(SOCKET *found, const SOCKADDRESS *peer)
{
    found->own.port = free_port(false);
    found->peer = *peer;
    found->state = CONNECTING;
    RTS_RESULT result = send_packet(SIM_NET_CONNECT, &found->own, peer, NULL, 0);
    if (result != ERR_OK)
        found->state = FREE;
    return result;
}

RTS_RESULT SysNetOpen(SYSNET_KIND kind, const SOCKADDRESS *address, RTS_HANDLE *socket)
{
    SOCKET *found = find_free();

    if (found == NULL)
        return ERR_NOBUFFER;
    memset(found, 0, sizeof *found);
    *socket = (RTS_HANDLE)(found - net.socket);
    if (kind == SYSNET_CLIENT)
        return connect(found, address);
    return bind(found, address, kind == SYSNET_UDP ? UDP : LISTENER);
}

bool SysNetMayReach(const SOCKADDRESS *peer)
{
    RTS_UNUSED(peer);
    return true;
}

RTS_RESULT SysNetGetConnected(RTS_HANDLE socket)
{
    const SOCKET *found = find(socket);

    if (found != NULL && found->state == CONNECTING)
        return ERR_PENDING;
    return found != NULL && found->state == CONNECTED ? ERR_OK : ERR_NET_NOTCONNECTED;
}

RTS_RESULT SysNetAccept(RTS_HANDLE listener, SOCKADDRESS *peer, RTS_HANDLE *socket)
{
    const SOCKET *at = find(listener);

    FOR_EACH_SOCKET(found)
    if (at != NULL && found->state != FREE && found->is_waiting && found->own.port == at->own.port) {
        found->is_waiting = false;
        *peer = found->peer;
        *socket = (RTS_HANDLE)(found - net.socket);
        return ERR_OK;
    }
    return ERR_NOTHING_TO_DO;
}

RTS_RESULT SysNetRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received)
{
    SOCKET *found = find(socket);

    *received = found != NULL ? get_bytes(found, data, size) : 0;
    return *received > 0 || (found != NULL && found->state < ENDED) ? ERR_OK : ERR_NET_NOTCONNECTED;
}

RTS_RESULT SysNetSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken)
{
    const SOCKET *found = find(socket);

    *taken = 0;
    if (found == NULL || found->state != CONNECTED)
        return ERR_NET_NOTCONNECTED;
    if (size > SIM_NET_DATA)
        size = SIM_NET_DATA;
    if (send_packet(SIM_NET_DATA_OF, &found->own, &found->peer, data, size) == ERR_OK)
        *taken = size;
    return ERR_OK;
}

RTS_RESULT SysNetRecvFrom(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received)
{
    SOCKET *found = find(socket);
    RTS_UI8 head[HEAD];

    if (found == NULL || get_bytes(found, head, sizeof head) < sizeof head)
        return ERR_NOTHING_TO_DO;
    *from = (SOCKADDRESS){BytesGet32(head), BytesGet16(head + 4)};
    *received = BytesGet16(head + 6);
    skip_bytes(found, *received - get_bytes(found, data, size < *received ? size : *received));
    return ERR_OK;
}

RTS_RESULT SysNetSendTo(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, const SOCKADDRESS *to)
{
    const SOCKET *found = find(socket);

    if (found == NULL || size > SIM_NET_DATA)
        return ERR_FAILED;
    return send_packet(SIM_NET_DATAGRAM, &found->own, to, data, size);
}

RTS_RESULT SysNetPeek(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received)
{
    SOCKET *found = find(socket);
    RTS_UI32 first = found != NULL ? found->first : 0;
    RTS_UI32 count = found != NULL ? found->count : 0;
    RTS_RESULT result =
        from != NULL ? SysNetRecvFrom(socket, data, size, from, received) : SysNetRecv(socket, data, size, received);

    if (found != NULL) { /* reading moves these two alone */
        found->first = first;
        found->count = count;
    }
    return result;
}

static bool has_waiting(const SOCKET *listener)
{
    FOR_EACH_SOCKET(found)
    if (found->state != FREE && found->is_waiting && found->own.port == listener->own.port)
        return true;
    return false;
}

/* Returns the bytes of the first datagram, or those of a connection. */
static RTS_UI32 count_readable(const SOCKET *found)
{
    if (found->state != UDP || found->count == 0)
        return found->count;
    return found->data[(found->first + 6) % ROOM] + ((RTS_UI32)found->data[(found->first + 7) % ROOM] << 8);
}

RTS_UI32 SysNetPoll(RTS_HANDLE socket, RTS_UI32 *waiting)
{
    const SOCKET *found = find(socket);

    *waiting = found != NULL ? count_readable(found) : 0;
    if (found == NULL || found->state == REFUSED)
        return SYSNET_FAILED;
    if (found->state == LISTENER)
        return has_waiting(found) ? SYSNET_READABLE : 0;
    return (found->count > 0 || found->state == ENDED ? SYSNET_READABLE : 0) |
           (found->state == UDP || found->state == CONNECTED ? SYSNET_WRITABLE : 0);
}

static void close(SOCKET *found)
{
    bool tells = found->state == CONNECTED || found->state == CONNECTING;

    found->state = FREE;
    if (tells)
        (void)send_packet(SIM_NET_END, &found->own, &found->peer, NULL, 0);
}

/* With a listener go the connections that it has not accepted. */
void SysNetClose(RTS_HANDLE socket)
{
    SOCKET *closed = find(socket);

    if (closed == NULL)
        return;
    bool is_listener = closed->state == LISTENER;
    close(closed);
    FOR_EACH_SOCKET(found)
    if (is_listener && found->state != FREE && found->is_waiting && found->own.port == closed->own.port)
        close(found);
}
