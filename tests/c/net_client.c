/*
 * net_client.c - the other end of the device's sockets.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "net_client.h"

#include <arpa/inet.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "CmpBytes.h"
#include "CmpPackets.h"
#include "comm_fakes.h"
#include "port.h"

/* Passes of the device in which something is bound to come, and after which nothing comes; each takes MOMENT_MS when
 * nothing happens. */
enum { PASSES = 20000, NO_PASSES = 200, MOMENT_MS = 1 };

/* What the tests stand on: nothing of them would make sense without it. */
#define REQUIRE(condition)                                                                \
    do {                                                                                  \
        if (!(condition)) {                                                               \
            fprintf(stderr, "%s:%d: %s: %s\n", __FILE__, __LINE__, __func__, #condition); \
            exit(1);                                                                      \
        }                                                                                 \
    } while (0)

/* ---- the device ---- */

const char *net_own(void)
{
    static char own[INET_ADDRSTRLEN];
    unsigned id = (unsigned)getpid();

    snprintf(own, sizeof(own), "127.%u.%u.%u", 1 + (id >> 16) % 250, (id >> 8) % 256, 1 + id % 250);
    return own;
}

static void open_place(bool (*open)(const char *, PORT_REASON *), const char *place)
{
    char text[64];
    PORT_REASON reason = {.text = ""};

    if (place[0] == '\0')
        return;
    snprintf(text, sizeof(text), "%s%s", place[0] == '@' ? net_own() : "", place + (place[0] == '@'));
    REQUIRE(open(text, &reason));
}

void net_start(const char *tcp, const char *udp)
{
    fakes_init();
    open_place(PortTcpOpen, tcp);
    open_place(PortUdpOpen, udp);
    fakes_run_init_hooks();
}

void net_end(void)
{
    fakes_hook(CH_EXIT_COMM);
    fakes_hook(CH_EXIT3);
    PortSockClose();
}

SOCKADDRESS net_device(SYSSOCK_PURPOSE purpose)
{
    SOCKADDRESS own = {0, 0};
    RTS_UI32 prefix;

    REQUIRE(SysSockGetOwn((RTS_HANDLE)purpose, &own, &prefix) == ERR_OK);
    return own;
}

void net_settle(void)
{
    do
        fakes_cycle(0);
    while (PortWait(MOMENT_MS));
    fakes_cycle(0);
}

/* ---- sockets ---- */

static struct sockaddr_in make_address(SOCKADDRESS address)
{
    struct sockaddr_in made = {.sin_family = AF_INET, .sin_port = htons(address.port)};

    made.sin_addr.s_addr = htonl(address.ip);
    return made;
}

SOCKADDRESS net_name(int file)
{
    struct sockaddr_in name = {.sin_family = AF_INET};
    socklen_t size = sizeof(name);

    REQUIRE(getsockname(file, (struct sockaddr *)&name, &size) == 0);
    return (SOCKADDRESS){ntohl(name.sin_addr.s_addr), ntohs(name.sin_port)};
}

int net_dial(void)
{
    struct sockaddr_in device = make_address(net_device(SYSSOCK_TCP));
    int file = socket(AF_INET, SOCK_STREAM, 0);
    int on = 1;

    REQUIRE(file >= 0 && connect(file, (struct sockaddr *)&device, sizeof(device)) == 0);
    REQUIRE(setsockopt(file, IPPROTO_TCP, TCP_NODELAY, &on, sizeof(on)) == 0);
    return file;
}

int net_udp(RTS_UI16 port)
{
    struct sockaddr_in own = {.sin_family = AF_INET, .sin_port = htons(port)};
    int on = 1;
    int file = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK, 0);

    REQUIRE(inet_pton(AF_INET, net_own(), &own.sin_addr) == 1);
    REQUIRE(file >= 0 && bind(file, (struct sockaddr *)&own, sizeof(own)) == 0);
    REQUIRE(setsockopt(file, SOL_SOCKET, SO_BROADCAST, &on, sizeof(on)) == 0);
    return file;
}

void net_send_to(int file, SOCKADDRESS to, const void *data, RTS_UI32 size)
{
    struct sockaddr_in receiver = make_address(to);

    REQUIRE(sendto(file, data, size, 0, (struct sockaddr *)&receiver, sizeof(receiver)) == (ssize_t)size);
}

void net_write(int file, const void *data, RTS_UI32 size)
{
    REQUIRE(send(file, data, size, MSG_NOSIGNAL) == (ssize_t)size);
}

/* Lets the device run until there is something to read, or the end. */
static bool wait_for(int file, int passes)
{
    struct pollfd polled = {.fd = file, .events = POLLIN};

    for (int i = 0; i < passes; i++) {
        fakes_cycle(0);
        if (poll(&polled, 1, 0) > 0)
            return true;
        (void)PortWait(MOMENT_MS);
    }
    return false;
}

bool net_read(int file, void *data, RTS_UI32 size)
{
    RTS_UI32 fill = 0;

    while (fill < size && wait_for(file, PASSES)) {
        ssize_t count = recv(file, (char *)data + fill, size - fill, MSG_DONTWAIT);
        if (count <= 0)
            return false;
        fill += (RTS_UI32)count;
    }
    return fill == size;
}

RTS_UI32 net_datagram(int file, RTS_UI8 *data, RTS_UI32 capacity)
{
    ssize_t count = net_has_arrived(file) ? recv(file, data, capacity, MSG_DONTWAIT) : 0;

    return count > 0 ? (RTS_UI32)count : 0;
}

bool net_is_closed(int file)
{
    RTS_UI8 data[4096];

    while (wait_for(file, PASSES))
        if (recv(file, data, sizeof(data), MSG_DONTWAIT) <= 0)
            return true;
    return false;
}

bool net_has_arrived(int file)
{
    return wait_for(file, NO_PASSES);
}

bool net_is_open(int file)
{
    struct pollfd polled = {.fd = file, .events = POLLRDHUP};

    net_settle();
    return poll(&polled, 1, 0) == 0;
}

void net_reset(int file)
{
    const struct linger at_once = {.l_onoff = 1, .l_linger = 0};

    REQUIRE(setsockopt(file, SOL_SOCKET, SO_LINGER, &at_once, sizeof(at_once)) == 0);
    close(file);
}

/* ---- frames ---- */

RTS_UI32 net_frame(const RTS_UI8 *packet, RTS_UI32 size, RTS_UI8 *frame)
{
    static const RTS_UI8 magic[] = {0x00, 0x01, 0x17, 0xE8};

    memcpy(frame, magic, sizeof(magic));
    BytesPut32(frame + 4, 8 + size);
    memcpy(frame + 8, packet, size);
    return 8 + size;
}

RTS_UI32 net_read_packet(int file, RTS_UI8 *packet)
{
    static const RTS_UI8 magic[] = {0x00, 0x01, 0x17, 0xE8};
    RTS_UI8 header[8];

    if (!net_read(file, header, sizeof(header)))
        return 0;
    RTS_UI32 size = BytesGet32(header + 4) - 8;
    REQUIRE(memcmp(header, magic, sizeof(magic)) == 0 && size <= BLK_MAX_SIZE);
    return size <= BLK_MAX_SIZE && net_read(file, packet, size) ? size : 0;
}

/* ---- a client ---- */

static void send_packet(void *instance, const RTS_UI8 *packet, RTS_UI32 size)
{
    RTS_UI8 frame[8 + BLK_MAX_SIZE];

    net_write(*(int *)instance, frame, net_frame(packet, size, frame));
    net_settle(); /* as SimLink: what is sent has been handled */
}

static RTS_UI32 receive_packet(void *instance, RTS_UI8 *packet, RTS_UI32 capacity)
{
    RTS_UNUSED(capacity);
    return net_has_arrived(*(int *)instance) ? net_read_packet(*(int *)instance, packet) : 0;
}

void net_client(CLIENT *client, CLIENT_LINK *link, int *file)
{
    client_init(client, (RTS_UI16)(net_name(*file).port | 1));
    *link = (CLIENT_LINK){send_packet, receive_packet, file};
    client->link = link;
}
