/*
 * SysSocket.h - IPv4 sockets of the block drivers of networks.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Called by CmpBlkDrvTcp and CmpBlkDrvUdp from main. Nothing blocks, and a call takes no longer than copying its data.
 * The port decides which networks the device is reached by, as it decides on baud rates: it has opened the sockets, or
 * opens them when it is asked. Addresses and ports are numbers: 127.0.0.1 is 0x7F000001. After start no memory is
 * allocated; a port has room for TCP_MAX_CONNECTIONS accepted sockets and its own.
 */
#ifndef SYSSOCKET_H
#define SYSSOCKET_H

#include "CmpErrors.h"
#include "CmpStd.h"

typedef struct {
    RTS_UI32 ip;
    RTS_UI16 port;
} SOCKADDRESS;

typedef enum {
    SYSSOCK_TCP,           /* listens */
    SYSSOCK_UDP,           /* sends and receives */
    SYSSOCK_UDP_BROADCAST, /* receives what is sent to all, when SYSSOCK_UDP does not; shares its port */
} SYSSOCK_PURPOSE;

/* The socket for this purpose; RTS_INVALID_HANDLE when the port has none. */
RTS_HANDLE SysSockOpen(SYSSOCK_PURPOSE purpose);

/* The address of a socket's own end, and how many bits of it are those of the network (0..32). */
RTS_RESULT SysSockGetOwn(RTS_HANDLE socket, SOCKADDRESS *own, RTS_UI32 *prefix);

/* A connection that was made to a listening socket, and who made it; RTS_INVALID_HANDLE when there is none, or no room
 * for it. It sends without delay (TCP_NODELAY). */
RTS_HANDLE SysSockAccept(RTS_HANDLE listener, SOCKADDRESS *peer);

/* Of a connection: ERR_OK with the number of bytes received or taken, 0 when there is nothing, or no room, now;
 * ERR_NET_NOTCONNECTED when the peer has ended it or cannot be reached any more. */
RTS_RESULT SysSockRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received);
RTS_RESULT SysSockSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken);

/* A datagram: ERR_OK with its size, of which no more than `size` bytes are in `data`; ERR_NOTHING_TO_DO when there is
 * none. */
RTS_RESULT SysSockRecvFrom(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received);

/* ERR_NOBUFFER when there is no room now. ERR_OK does not say that it arrives. */
RTS_RESULT SysSockSendTo(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, const SOCKADDRESS *to);

/* Ends a connection, which still sends what it has taken; or gives back a socket of SysSockOpen, which may be asked for
 * again. */
void SysSockClose(RTS_HANDLE socket);

#endif
