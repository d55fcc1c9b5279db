/*
 * SysSocket.c - sockets of the Linux port.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The sockets that the device listens on are opened in the supervisor, before the worker is forked, and stay open when
 * the worker dies: its successor listens on the same ports, and connections made meanwhile wait for it.
 */
#define _GNU_SOURCE
#include "SysSocket.h"

#include "CmpSrvNumbers.h"
#include "HostNames.h"
#include "SysTime.h"
#include "port.h"
#include "rts_config.h"

#include <time.h> /* before linux/errqueue.h, which needs its timespec */

#include <arpa/inet.h>
#include <errno.h>
#include <ifaddrs.h>
#include <linux/errqueue.h>
#include <net/if.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

enum {
    PURPOSES = SYSSOCK_UDP_BROADCAST + 1,
    SOCKETS = PURPOSES + TCP_MAX_CONNECTIONS + 1 + SYSSOCK_MAX_FIELD_BUS + IEC_SOCKETS,
    /* one waits for a place */
    BACKLOG = 16,
    IP_BITS = 32,
    NOT_ASKED = -1,
    ADDRESS_MS = 1000, /* so long one of several addresses may take to accept a connection */
};

/* A connection that is made by name. */
typedef struct {
    bool is_used;
    int question; /* NOT_ASKED: `found` has the answer */
    HOST_ADDRESSES found;
    RTS_UI32 next; /* of the addresses */
    RTS_UI32 began_ms;
} BY_NAME;

/* The first ones are those the device listens on, in the order of SYSSOCK_PURPOSE. */
static struct {
    PORT_SOURCE source[SOCKETS];
    BY_NAME by_name[SOCKETS];
    bool ready;
} sockets;

static void make_ready(void)
{
    for (int i = 0; i < SOCKETS && !sockets.ready; i++) {
        sockets.source[i].file = -1;
    }
    sockets.ready = true;
}

static void close_file(PORT_SOURCE *source)
{
    PortWaitRemove(source);
    if (source->file >= 0) {
        close(source->file);
    }
    source->file = -1;
}

static void end_by_name(BY_NAME *connection)
{
    if (connection->is_used && connection->question != NOT_ASKED) {
        HostNameForget(connection->question);
    }
    connection->is_used = false;
}

static PORT_SOURCE *find(RTS_HANDLE socket)
{
    return socket < SOCKETS ? &sockets.source[socket] : NULL;
}

static int file_of(RTS_HANDLE socket)
{
    PORT_SOURCE *source = find(socket);
    return source != NULL ? source->file : -1;
}

static struct sockaddr_in make_address(RTS_UI32 ip, RTS_UI16 port)
{
    struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
    address.sin_addr.s_addr = htonl(ip);
    return address;
}

static SOCKADDRESS read_address(const struct sockaddr_in *address)
{
    return (SOCKADDRESS){ntohl(address->sin_addr.s_addr), ntohs(address->sin_port)};
}

static SOCKADDRESS own_address(int file)
{
    struct sockaddr_in own = {.sin_family = AF_INET};
    socklen_t size = sizeof(own);
    (void)getsockname(file, (struct sockaddr *)&own, &size);
    return read_address(&own);
}

/* ---- the networks of this machine ---- */

typedef struct {
    RTS_UI32 ip;
    RTS_UI32 mask;
    bool loopback;
    bool can_broadcast;
} NETWORK;

/* False when it has no IPv4 address. */
static bool read_network(const struct ifaddrs *from, NETWORK *network)
{
    if (from->ifa_addr == NULL || from->ifa_addr->sa_family != AF_INET || from->ifa_netmask == NULL) {
        return false;
    }
    network->ip = ntohl(((const struct sockaddr_in *)(const void *)from->ifa_addr)->sin_addr.s_addr);
    network->mask = ntohl(((const struct sockaddr_in *)(const void *)from->ifa_netmask)->sin_addr.s_addr);
    network->loopback = (from->ifa_flags & IFF_LOOPBACK) != 0;
    network->can_broadcast = network->loopback || (from->ifa_flags & IFF_BROADCAST) != 0;
    return true;
}

/* The network that an address belongs to; for 0.0.0.0 the first network that is not loopback. */
static NETWORK find_network(RTS_UI32 ip)
{
    NETWORK found = {.ip = ip, .mask = 0xFFFFFFFF};
    struct ifaddrs *all;
    if (getifaddrs(&all) != 0) {
        return found;
    }
    for (struct ifaddrs *next = all; next != NULL; next = next->ifa_next) {
        NETWORK other;
        if (read_network(next, &other) && (ip == 0 ? !other.loopback : ((ip ^ other.ip) & other.mask) == 0)) {
            found = other;
            found.ip = ip == 0 ? other.ip : ip;
            break;
        }
    }
    freeifaddrs(all);
    return found;
}

static RTS_UI32 prefix_of(RTS_UI32 mask)
{
    return (RTS_UI32)__builtin_popcount(mask);
}

/* ---- sockets that the device listens on ---- */

static bool parse_number(const char *text, unsigned long most, RTS_UI16 *number)
{
    char *end;
    errno = 0;
    unsigned long value = strtoul(text, &end, 10);
    bool known = text[0] >= '0' && text[0] <= '9' && *end == '\0' && errno == 0 && value <= most;
    *number = known ? (RTS_UI16)value : *number;
    return known;
}

static bool parse_ip(const char *text, size_t size, RTS_UI32 *ip)
{
    char host[INET_ADDRSTRLEN];
    struct in_addr parsed;
    if (size >= sizeof(host)) {
        return false;
    }
    memcpy(host, text, size);
    host[size] = '\0';
    bool known = inet_pton(AF_INET, host, &parsed) == 1;
    *ip = known ? ntohl(parsed.s_addr) : 0;
    return known;
}

/* "ADDRESS" or "ADDRESS:NUMBER"; what is not there stays as it is in `place`. *numbered: the number is there. */
static bool parse_place(const char *text, unsigned long most, SOCKADDRESS *place, bool *numbered)
{
    const char *colon = strchr(text, ':');
    *numbered = colon != NULL;
    return parse_ip(text, colon != NULL ? (size_t)(colon - text) : strlen(text), &place->ip) &&
           (colon == NULL || parse_number(colon + 1, most, &place->port));
}

/* Closes what could not be bound, and keeps errno. */
static int bind_socket(int type, SOCKADDRESS address, bool shared)
{
    struct sockaddr_in place = make_address(address.ip, address.port);
    int on = 1;
    int file = socket(AF_INET, type | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (file < 0) {
        return -1;
    }
    if (shared) {
        (void)setsockopt(file, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on));
    }
    if (bind(file, (struct sockaddr *)&place, sizeof(place)) != 0 ||
        (type == SOCK_STREAM && listen(file, BACKLOG) != 0)) {
        int error = errno;
        close(file);
        errno = error;
        return -1;
    }
    return file;
}

/* False, with the reason, when there is no such socket. */
static bool keep(SYSSOCK_PURPOSE purpose, int file, const char *option, const char *text, PORT_REASON *reason)
{
    if (file < 0) {
        int error = errno;
        PortReason(reason, "cannot serve %s %s: %s", option, text, strerror(error));
        reason->busy = error == EADDRINUSE;
        return false;
    }
    sockets.source[purpose] = (PORT_SOURCE){.file = file, .events = POLLIN};
    return true;
}

bool PortTcpKnows(const char *text, SOCKADDRESS *place)
{
    bool numbered;
    *place = (SOCKADDRESS){INADDR_LOOPBACK, TCP_PORT};
    return parse_number(text, UINT16_MAX, &place->port) || parse_place(text, UINT16_MAX, place, &numbered);
}

bool PortTcpOpen(const char *text, PORT_REASON *reason)
{
    SOCKADDRESS place;
    make_ready();
    if (!PortTcpKnows(text, &place)) {
        PortReason(reason, "--tcp %s is no address", text);
        return false;
    }
    return keep(SYSSOCK_TCP, bind_socket(SOCK_STREAM, place, true), "--tcp", text, reason);
}

/* The port of that number, or the first of the four that is free. */
static int bind_udp(SOCKADDRESS address, bool numbered)
{
    RTS_UI32 last = numbered ? address.port : UDP_PORT + UDP_PORTS - 1;
    int file = -1;
    for (RTS_UI32 port = numbered ? address.port : UDP_PORT; file < 0 && port <= last; port++) {
        address.port = (RTS_UI16)port;
        file = bind_socket(SOCK_DGRAM, address, false);
    }
    return file;
}

/* On Linux a socket bound to an address receives no broadcasts: they need another socket, and several devices share its
 * port. */
static bool open_broadcast(SOCKADDRESS own, const char *text, PORT_REASON *reason)
{
    NETWORK network = find_network(own.ip);
    if (own.ip == 0 || !network.can_broadcast) {
        return true;
    }
    own.ip |= ~network.mask;
    return keep(SYSSOCK_UDP_BROADCAST, bind_socket(SOCK_DGRAM, own, true), "--udp", text, reason);
}

/* Without it the kernel keeps to itself what networks say of datagrams; clients that vanish are then noticed later. */
static bool tell_refusals(void)
{
    int on = 1;
    (void)setsockopt(sockets.source[SYSSOCK_UDP].file, IPPROTO_IP, IP_RECVERR, &on, sizeof(on));
    return true;
}

bool PortUdpKnows(const char *text, SOCKADDRESS *place, bool *numbered)
{
    *place = (SOCKADDRESS){INADDR_LOOPBACK, UDP_PORT};
    return parse_place(text, UDP_PORT + UDP_PORTS - 1, place, numbered) && place->port >= UDP_PORT;
}

bool PortUdpOpen(const char *text, PORT_REASON *reason)
{
    SOCKADDRESS place;
    bool numbered;
    make_ready();
    if (!PortUdpKnows(text, &place, &numbered)) {
        PortReason(reason, "--udp %s is no address", text);
        return false;
    }
    return keep(SYSSOCK_UDP, bind_udp(place, numbered), "--udp", text, reason) && tell_refusals() &&
           open_broadcast(own_address(sockets.source[SYSSOCK_UDP].file), text, reason);
}

bool PortSockAddress(SYSSOCK_PURPOSE purpose, SOCKADDRESS *own)
{
    make_ready();
    if (sockets.source[purpose].file < 0) {
        return false;
    }
    *own = own_address(sockets.source[purpose].file);
    return true;
}

bool PortSockName(SYSSOCK_PURPOSE purpose, char *name, size_t size)
{
    SOCKADDRESS own;
    if (!PortSockAddress(purpose, &own)) {
        return false;
    }
    snprintf(name, size, "%u.%u.%u.%u:%u", own.ip >> 24, own.ip >> 16 & 0xFF, own.ip >> 8 & 0xFF, own.ip & 0xFF,
             own.port);
    return true;
}

void PortSockClose(void)
{
    make_ready();
    for (int i = 0; i < SOCKETS; i++) {
        end_by_name(&sockets.by_name[i]);
        close_file(&sockets.source[i]);
    }
}

/* ---- SysSocket.h ---- */

RTS_HANDLE SysSockOpen(SYSSOCK_PURPOSE purpose)
{
    make_ready();
    bool open = sockets.source[purpose].file >= 0 && PortWaitAdd(&sockets.source[purpose]);
    return open ? (RTS_HANDLE)purpose : (RTS_HANDLE)RTS_INVALID_HANDLE;
}

RTS_RESULT SysSockGetOwn(RTS_HANDLE socket, SOCKADDRESS *own, RTS_UI32 *prefix)
{
    int file = file_of(socket);
    if (file < 0) {
        return ERR_INVALID_HANDLE;
    }
    *own = own_address(file);
    NETWORK network = find_network(own->ip);
    own->ip = network.ip;
    *prefix = prefix_of(network.mask);
    return ERR_OK;
}

/* Whether one of the sockets that tools use is reached by this address, which is replaced by the socket's own. */
static bool serves(NETWORK *network)
{
    for (int purpose = SYSSOCK_TCP; purpose <= SYSSOCK_UDP; purpose++) {
        if (sockets.source[purpose].file < 0) {
            continue;
        }
        SOCKADDRESS own = own_address(sockets.source[purpose].file);
        if (own.ip == 0 ? !network->loopback : ((own.ip ^ network->ip) & network->mask) == 0) {
            network->ip = own.ip == 0 ? network->ip : own.ip;
            return true;
        }
    }
    return false;
}

RTS_RESULT SysSockGetNetwork(RTS_UI32 index, SOCKNETWORK *network)
{
    NETWORK found;
    bool there = false;
    struct ifaddrs *all;
    make_ready();
    if (getifaddrs(&all) != 0) {
        return ERR_NO_OBJECT;
    }
    for (struct ifaddrs *next = all; next != NULL && !there; next = next->ifa_next) {
        there = read_network(next, &found) && serves(&found) && index-- == 0;
    }
    freeifaddrs(all);
    if (!there) {
        return ERR_NO_OBJECT;
    }
    *network = (SOCKNETWORK){found.ip, found.mask};
    return ERR_OK;
}

static RTS_HANDLE find_free(void)
{
    RTS_HANDLE handle = PURPOSES;
    while (handle < SOCKETS && (sockets.source[handle].file >= 0 || sockets.by_name[handle].is_used)) {
        handle++;
    }
    return handle;
}

/* A socket that is waited for; what there is no room for is closed. */
static RTS_HANDLE take(int file, short events)
{
    RTS_HANDLE handle = find_free();
    if (handle == SOCKETS) {
        close(file);
        return RTS_INVALID_HANDLE;
    }
    sockets.source[handle] = (PORT_SOURCE){.file = file, .events = events};
    if (!PortWaitAdd(&sockets.source[handle])) {
        SysSockClose(handle);
        return RTS_INVALID_HANDLE;
    }
    return handle;
}

static RTS_RESULT why_not_bound(void)
{
    switch (errno) {
    case EADDRINUSE:
        return ERR_DUPLICATE;
    case EACCES:
        return ERR_NO_ACCESS_RIGHTS;
    default:
        return ERR_DEVICE;
    }
}

/* Datagrams of a program, which it may also send to all hosts of a network. */
RTS_RESULT PortSockBind(const SOCKADDRESS *own, RTS_HANDLE *socket)
{
    int on = 1;
    int file = bind_socket(SOCK_DGRAM, *own, false);
    if (file < 0) {
        return why_not_bound();
    }
    (void)setsockopt(file, SOL_SOCKET, SO_BROADCAST, &on, sizeof(on));
    make_ready();
    *socket = take(file, POLLIN);
    return *socket != RTS_INVALID_HANDLE ? ERR_OK : ERR_NOBUFFER;
}

void PortSockQuiet(RTS_HANDLE socket)
{
    PORT_SOURCE *source = find(socket);
    if (source != NULL) {
        PortWaitRemove(source);
    }
}

short PortSockPoll(RTS_HANDLE socket, RTS_UI32 *waiting)
{
    struct pollfd polled = {.fd = file_of(socket), .events = POLLIN | POLLOUT};
    int bytes = 0;
    if (poll(&polled, 1, 0) < 0) {
        polled.revents = POLLERR;
    }
    (void)ioctl(polled.fd, FIONREAD, &bytes);
    *waiting = (RTS_UI32)bytes;
    return polled.revents;
}

static void send_without_delay(int file)
{
    int on = 1;
    (void)setsockopt(file, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on));
}

RTS_RESULT SysSockListen(const SOCKADDRESS *own, RTS_HANDLE *listener)
{
    int file = bind_socket(SOCK_STREAM, *own, true);
    if (file < 0) {
        return why_not_bound();
    }
    make_ready();
    *listener = take(file, POLLIN);
    return *listener != RTS_INVALID_HANDLE ? ERR_OK : ERR_NOBUFFER;
}

/* Begins a connection; -1: no way there. */
static int begin_connection(const void *address, socklen_t size, int family)
{
    int file = socket(family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (file < 0) {
        return -1;
    }
    send_without_delay(file);
    if (connect(file, address, size) != 0 && errno != EINPROGRESS) {
        close(file);
        return -1;
    }
    return file;
}

RTS_HANDLE SysSockConnect(const SOCKADDRESS *peer)
{
    struct sockaddr_in there = make_address(peer->ip, peer->port);
    int file = begin_connection(&there, sizeof(there), AF_INET);
    if (file < 0) {
        return RTS_INVALID_HANDLE;
    }
    make_ready();
    return take(file, POLLOUT);
}

/* ---- connections by name ---- */

RTS_HANDLE SysSockConnectName(const char *host, RTS_UI16 port)
{
    make_ready();
    RTS_HANDLE handle = find_free();
    int question = handle < SOCKETS ? HostNameAsk(host, port) : NOT_ASKED;
    if (question == NOT_ASKED) {
        return RTS_INVALID_HANDLE;
    }
    sockets.by_name[handle] = (BY_NAME){.is_used = true, .question = question};
    return handle;
}

/* Begins a connection to the next of the addresses to which there is a way. */
static RTS_RESULT try_next(BY_NAME *connection, PORT_SOURCE *source)
{
    close_file(source);
    while (source->file < 0 && connection->next < connection->found.count) {
        const struct sockaddr_in6 *there = &connection->found.address[connection->next++];
        bool is_ip6 = there->sin6_family == AF_INET6;
        source->file =
            begin_connection(there, is_ip6 ? sizeof(*there) : sizeof(struct sockaddr_in), there->sin6_family);
    }
    connection->began_ms = SysTimeGetMs();
    source->events = POLLOUT;
    return source->file >= 0 && PortWaitAdd(source) ? ERR_OK : ERR_NET_NOTCONNECTED;
}

static RTS_RESULT take_answer(BY_NAME *connection, PORT_SOURCE *source)
{
    RTS_RESULT result = HostNameGet(connection->question, &connection->found);
    if (result == ERR_PENDING) {
        return ERR_NOT_READY_YET;
    }
    connection->question = NOT_ASKED;
    if (result == ERR_OK) {
        result = try_next(connection, source);
    }
    return result == ERR_OK ? (RTS_RESULT)ERR_NOT_READY_YET : result;
}

/* How the connection to one of the addresses is; when it fails, or takes long, the next one has its turn. */
static RTS_RESULT look_further(BY_NAME *connection, PORT_SOURCE *source, RTS_RESULT result)
{
    bool has_more = connection->next < connection->found.count;
    bool is_slow = result == ERR_PENDING && SysTimeGetMs() - connection->began_ms >= ADDRESS_MS;
    if (result == ERR_OK) {
        connection->is_used = false;
    } else if (has_more && (is_slow || result != ERR_PENDING)) {
        result = try_next(connection, source) == ERR_OK ? ERR_PENDING : ERR_NET_NOTCONNECTED;
    }
    return result;
}

static RTS_RESULT get_connected(RTS_HANDLE socket)
{
    struct pollfd polled = {.fd = file_of(socket), .events = POLLOUT};
    int error = 0;
    socklen_t size = sizeof(error);
    if (polled.fd < 0) {
        return ERR_NET_NOTCONNECTED;
    }
    if (poll(&polled, 1, 0) == 0) {
        return ERR_PENDING;
    }
    find(socket)->events = POLLIN;
    bool good = getsockopt(polled.fd, SOL_SOCKET, SO_ERROR, &error, &size) == 0 && error == 0;
    return good ? ERR_OK : ERR_NET_NOTCONNECTED;
}

RTS_RESULT SysSockGetConnected(RTS_HANDLE socket)
{
    PORT_SOURCE *source = find(socket);
    if (source == NULL || !sockets.by_name[socket].is_used) {
        return get_connected(socket);
    }
    BY_NAME *connection = &sockets.by_name[socket];
    if (connection->question != NOT_ASKED) {
        return take_answer(connection, source);
    }
    return look_further(connection, source, get_connected(socket));
}

RTS_HANDLE SysSockAccept(RTS_HANDLE listener, SOCKADDRESS *peer)
{
    struct sockaddr_in from = {.sin_family = AF_INET};
    socklen_t size = sizeof(from);
    if (find_free() == SOCKETS) {
        return RTS_INVALID_HANDLE;
    }
    int file = accept4(file_of(listener), (struct sockaddr *)&from, &size, SOCK_NONBLOCK | SOCK_CLOEXEC);
    if (file < 0) {
        return RTS_INVALID_HANDLE;
    }
    send_without_delay(file);
    PortWaitNotNow();
    *peer = read_address(&from);
    return take(file, POLLIN);
}

static bool is_later(void)
{
    return errno == EAGAIN || errno == EINTR || errno == ENOBUFS || errno == ENOMEM;
}

RTS_RESULT SysSockRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received)
{
    ssize_t count = recv(file_of(socket), data, size, 0);
    *received = count > 0 ? (RTS_UI32)count : 0;
    if (count == 0 || (count < 0 && !is_later())) {
        return ERR_NET_NOTCONNECTED;
    }
    if (count > 0) {
        PortWaitNotNow();
    }
    return ERR_OK;
}

RTS_RESULT SysSockSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken)
{
    ssize_t count = send(file_of(socket), data, size, MSG_NOSIGNAL);
    *taken = count > 0 ? (RTS_UI32)count : 0;
    if (count < 0 && !is_later()) {
        return ERR_NET_NOTCONNECTED;
    }
    if (count > 0) {
        PortWaitNotNow();
    }
    /* Who has more to send may not read until it is gone: bytes that come meanwhile would end each wait. */
    find(socket)->events = *taken < size ? POLLOUT : POLLIN;
    return ERR_OK;
}

/* An error here is of a datagram sent earlier: SysSockRecvRefused. */
RTS_RESULT SysSockRecvFrom(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received)
{
    struct sockaddr_in sender = {.sin_family = AF_INET};
    socklen_t length = sizeof(sender);
    ssize_t count = recvfrom(file_of(socket), data, size, MSG_TRUNC, (struct sockaddr *)&sender, &length);
    if (count < 0) {
        return ERR_NOTHING_TO_DO;
    }
    PortWaitNotNow();
    *received = (RTS_UI32)count;
    *from = read_address(&sender);
    return ERR_OK;
}

/* MSG_TRUNC gives the size of a longer datagram; on a connection it would drop the data. */
RTS_RESULT PortSockPeek(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received)
{
    struct sockaddr_in sender = {.sin_family = AF_INET};
    socklen_t length = sizeof(sender);
    int flags = from != NULL ? MSG_PEEK | MSG_TRUNC : MSG_PEEK;
    ssize_t count = recvfrom(file_of(socket), data, size, flags, (struct sockaddr *)&sender, &length);
    *received = count > 0 ? (RTS_UI32)count : 0;
    if (from == NULL) {
        return count == 0 || (count < 0 && !is_later()) ? (RTS_RESULT)ERR_NET_NOTCONNECTED : (RTS_RESULT)ERR_OK;
    }
    if (count < 0) {
        return ERR_NOTHING_TO_DO;
    }
    *from = read_address(&sender);
    return ERR_OK;
}

static bool send_to(int file, const RTS_UI8 *data, RTS_UI32 size, struct sockaddr_in receiver)
{
    return sendto(file, data, size, MSG_NOSIGNAL, (struct sockaddr *)&receiver, sizeof(receiver)) >= 0;
}

/* The error of a datagram sent earlier is reported once, in place of sending this one. */
RTS_RESULT SysSockSendTo(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, const SOCKADDRESS *to)
{
    struct sockaddr_in receiver = make_address(to->ip, to->port);
    int file = file_of(socket);
    bool sent = send_to(file, data, size, receiver) || (!is_later() && send_to(file, data, size, receiver));
    return sent || !is_later() ? ERR_OK : ERR_NOBUFFER;
}

/* The error that a message of a socket's error queue is about. */
static int queued_error(struct msghdr *message)
{
    for (struct cmsghdr *part = CMSG_FIRSTHDR(message); part != NULL; part = CMSG_NXTHDR(message, part)) {
        if (part->cmsg_level == IPPROTO_IP && part->cmsg_type == IP_RECVERR) {
            struct sock_extended_err error;
            memcpy(&error, CMSG_DATA(part), sizeof(error));
            return (int)error.ee_errno;
        }
    }
    return 0;
}

RTS_RESULT SysSockRecvRefused(RTS_HANDLE socket, SOCKADDRESS *to)
{
    enum { CONTROL_SIZE = 256 };
    union {
        struct cmsghdr aligned;
        char bytes[CONTROL_SIZE];
    } control;
    struct sockaddr_in receiver;
    struct msghdr message;
    char start; /* of the datagram: QEMU's user mode gives no message to a caller without room for data */
    struct iovec room = {.iov_base = &start, .iov_len = sizeof(start)};
    do {
        message = (struct msghdr){.msg_name = &receiver,
                                  .msg_namelen = sizeof(receiver),
                                  .msg_iov = &room,
                                  .msg_iovlen = 1,
                                  .msg_control = &control,
                                  .msg_controllen = sizeof(control)};
        if (recvmsg(file_of(socket), &message, MSG_ERRQUEUE) < 0) {
            return ERR_NOTHING_TO_DO;
        }
    } while (queued_error(&message) != ECONNREFUSED);
    *to = read_address(&receiver);
    return ERR_OK;
}

void SysSockReset(RTS_HANDLE socket)
{
    struct linger none = {.l_onoff = 1, .l_linger = 0};
    (void)setsockopt(file_of(socket), SOL_SOCKET, SO_LINGER, &none, sizeof(none));
    SysSockClose(socket);
}

void SysSockClose(RTS_HANDLE socket)
{
    PORT_SOURCE *source = find(socket);
    if (source == NULL) {
        return;
    }
    end_by_name(&sockets.by_name[socket]);
    PortWaitRemove(source);
    if (socket >= PURPOSES && source->file >= 0) { /* those of the device are the port's */
        close(source->file);
        source->file = -1;
    }
}
