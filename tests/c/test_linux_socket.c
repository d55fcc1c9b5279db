/*
 * test_linux_socket.c - SysSocket: what a closed connection still sends, and one that is reset does not; what main waits
 * for while a peer does not read; datagrams that find no socket; networks.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "SysSocket.h"

#include "SysTime.h"
#include "port.h"
#include "test.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

enum { WAIT_MS = 10000 };

typedef struct {
    int listener;
    int file; /* its end of the connection */
    RTS_HANDLE socket;
} PEER;

/* Connects to a peer that reads nothing yet, and has little room. */
static void begin(PEER *peer)
{
    struct sockaddr_in own = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof(own);
    int room = 4096;
    RTS_I64 deadline = SysTimeGetNs() + WAIT_MS * (RTS_I64)1000000;

    peer->listener = socket(AF_INET, SOCK_STREAM, 0);
    CHECK_EQUAL(setsockopt(peer->listener, SOL_SOCKET, SO_RCVBUF, &room, sizeof(room)), 0);
    CHECK_EQUAL(bind(peer->listener, (struct sockaddr *)&own, size), 0);
    CHECK_EQUAL(listen(peer->listener, 1), 0);
    CHECK_EQUAL(getsockname(peer->listener, (struct sockaddr *)&own, &size), 0);
    peer->socket = SysSockConnect(&(SOCKADDRESS){INADDR_LOOPBACK, ntohs(own.sin_port)});
    while (SysSockGetConnected(peer->socket) == ERR_PENDING && SysTimeGetNs() < deadline)
        (void)PortWait(1);
    peer->file = accept(peer->listener, NULL, NULL);
    CHECK(peer->file >= 0);
}

static void end(PEER *peer)
{
    close(peer->file);
    close(peer->listener);
}

/* Sends until nothing more is taken. */
static size_t fill(RTS_HANDLE socket)
{
    static RTS_UI8 data[65536];
    size_t all = 0;
    RTS_UI32 taken;

    do {
        CHECK_EQUAL(SysSockSend(socket, data, sizeof(data), &taken), ERR_OK);
        all += taken;
    } while (taken != 0);
    return all;
}

/* What the peer gets until the connection ends; *how: 0, or -1 if it was reset. */
static size_t drain(const PEER *peer, ssize_t *how)
{
    static RTS_UI8 data[65536];
    struct pollfd polled = {.fd = peer->file, .events = POLLIN};
    size_t all = 0;

    do {
        CHECK_EQUAL(poll(&polled, 1, WAIT_MS), 1);
        *how = read(peer->file, data, sizeof(data));
        all += *how > 0 ? (size_t)*how : 0;
    } while (*how > 0);
    return all;
}

static void a_closed_connection_sends_what_was_taken(void)
{
    PEER peer;
    ssize_t how;

    begin(&peer);
    size_t sent = fill(peer.socket);
    SysSockClose(peer.socket);
    CHECK_EQUAL(drain(&peer, &how), sent);
    CHECK_EQUAL(how, 0);
    end(&peer);
}

static void one_that_is_reset_sends_nothing_more(void)
{
    PEER peer;
    ssize_t how;

    begin(&peer);
    size_t sent = fill(peer.socket);
    SysSockReset(peer.socket);
    CHECK(drain(&peer, &how) < sent);
    CHECK_EQUAL(how, -1);
    end(&peer);
}

/* A component that sends may read no more until all has left. */
static void what_a_peer_sends_that_does_not_read_ends_no_wait(void)
{
    static RTS_UI8 data[65536];
    PEER peer;

    begin(&peer);
    (void)fill(peer.socket);
    CHECK_EQUAL(write(peer.file, data, 1), 1);
    (void)PortWait(0); /* after what was sent */
    CHECK(!PortWait(0));
    while (!PortWait(1)) /* until there is room again */
        CHECK(read(peer.file, data, sizeof(data)) > 0);
    SysSockReset(peer.socket);
    end(&peer);
}

/* ---- the networks of the device ---- */

static void the_networks_are_those_that_tools_reach_it_by(void)
{
    PORT_REASON reason;
    SOCKNETWORK network;

    CHECK_EQUAL(SysSockGetNetwork(0, &network), ERR_NO_OBJECT); /* none is served */
    CHECK(PortTcpOpen("127.0.0.5:0", &reason));
    CHECK(PortUdpOpen("127.0.0.5", &reason));
    CHECK_EQUAL(SysSockGetNetwork(0, &network), ERR_OK);
    CHECK(network.ip == 0x7F000005 && network.mask == 0xFF000000);
    CHECK_EQUAL(SysSockGetNetwork(1, &network), ERR_NO_OBJECT); /* one for both */
    PortSockClose();
    CHECK(PortTcpOpen("0.0.0.0:0", &reason));
    for (RTS_UI32 i = 0; SysSockGetNetwork(i, &network) == ERR_OK; i++)
        CHECK(network.ip >> 24 != 127);
    PortSockClose();
}

/* ---- datagrams that find no socket ---- */

static int bound(RTS_UI16 *port)
{
    struct sockaddr_in own = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof(own);
    int file = socket(AF_INET, SOCK_DGRAM, 0);

    CHECK_EQUAL(bind(file, (struct sockaddr *)&own, size), 0);
    CHECK_EQUAL(getsockname(file, (struct sockaddr *)&own, &size), 0);
    *port = ntohs(own.sin_port);
    return file;
}

static void a_datagram_that_is_refused_is_told_and_costs_no_other_one(void)
{
    enum { CLOSED = 3 };
    PORT_REASON reason;
    RTS_UI16 port;
    SOCKADDRESS to[CLOSED], refused;
    RTS_UI8 data[4] = {0};

    CHECK(PortUdpOpen("127.0.0.5", &reason));
    RTS_HANDLE socket = SysSockOpen(SYSSOCK_UDP);
    CHECK_EQUAL(SysSockRecvRefused(socket, &refused), ERR_NOTHING_TO_DO);
    for (int i = 0; i < CLOSED; i++) {
        int file = bound(&port);
        to[i] = (SOCKADDRESS){INADDR_LOOPBACK, port};
        close(file);
    }
    int file = bound(&port);
    for (int i = 0; i < CLOSED; i++) {
        CHECK_EQUAL(SysSockSendTo(socket, data, sizeof(data), &to[i]), ERR_OK);
        CHECK_EQUAL(SysSockSendTo(socket, data, sizeof(data), &(SOCKADDRESS){INADDR_LOOPBACK, port}), ERR_OK);
        CHECK_EQUAL(recv(file, data, sizeof(data), MSG_DONTWAIT), sizeof(data));
    }
    for (int i = 0; i < CLOSED; i++) {
        CHECK_EQUAL(SysSockRecvRefused(socket, &refused), ERR_OK);
        CHECK(refused.ip == to[i].ip && refused.port == to[i].port);
    }
    CHECK_EQUAL(SysSockRecvRefused(socket, &refused), ERR_NOTHING_TO_DO);
    (void)PortWait(0);   /* after what earlier tests did */
    CHECK(!PortWait(0)); /* nothing is left that would wake it */
    close(file);
    PortSockClose();
}

int main(void)
{
    RUN(a_closed_connection_sends_what_was_taken);
    RUN(one_that_is_reset_sends_nothing_more);
    RUN(what_a_peer_sends_that_does_not_read_ends_no_wait);
    RUN(a_datagram_that_is_refused_is_told_and_costs_no_other_one);
    RUN(the_networks_are_those_that_tools_reach_it_by);
    return test_result();
}
