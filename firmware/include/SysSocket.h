/*
 * SysSocket.h - IPv4 sockets of the block drivers of networks, and of field buses, which may also reach hosts by name.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Called by CmpBlkDrvTcp, CmpBlkDrvUdp and IoDrvModbus from main. No function blocks; each takes no longer than copying
 * its data. The port decides at which addresses the device can be programmed, as it decides on baud rates: SysSockOpen
 * returns sockets that are bound. Where a field bus listens and connects to, the application says. Addresses and port
 * numbers are in the byte order of the CPU: 127.0.0.1 is 0x7F000001. No memory is allocated after start; a port has
 * room for its own sockets, TCP_MAX_CONNECTIONS + 1 accepted ones, and SYSSOCK_MAX_FIELD_BUS.
 */
#ifndef SYSSOCKET_H
#define SYSSOCKET_H

#include "CmpErrors.h"
#include "CmpStd.h"

typedef struct {
    RTS_UI32 ip;
    RTS_UI16 port;
} SOCKADDRESS;

/* The machine at an address; 0 for this one. */
static inline RTS_UI32 SockHost(RTS_UI32 ip)
{
    return ip >> 24 == 127 ? 0 : ip;
}

typedef struct {
    RTS_UI32 ip;
    RTS_UI32 mask;
} SOCKNETWORK;

enum { SYSSOCK_MAX_NAME = 253 }; /* RFC 1035 */

typedef enum {
    SYSSOCK_TCP,           /* listens */
    SYSSOCK_UDP,           /* sends and receives */
    SYSSOCK_UDP_BROADCAST, /* receives broadcasts, if SYSSOCK_UDP does not; the same port number */
} SYSSOCK_PURPOSE;

/* The socket for this purpose; RTS_INVALID_HANDLE when the port has none. */
RTS_HANDLE SysSockOpen(SYSSOCK_PURPOSE purpose);

/* A socket that listens for TCP connections at an address (0: all of the device). ERR_DUPLICATE: another one does;
 * ERR_NO_ACCESS_RIGHTS: the port number is for others; ERR_NOBUFFER: no room; ERR_DEVICE: not an address of this device. */
RTS_RESULT SysSockListen(const SOCKADDRESS *own, RTS_HANDLE *listener);

/* Begins a connection, which sends without delay; RTS_INVALID_HANDLE: no room, or no way there. */
RTS_HANDLE SysSockConnect(const SOCKADDRESS *peer);
/* The same to a host by its name, or an IPv6 address, for ports with SYSSOCK_NAMES. The port copies `host`; names of more
 * than SYSSOCK_MAX_NAME characters have no way there. Of several addresses each is tried. */
RTS_HANDLE SysSockConnectName(const char *host, RTS_UI16 port);
/* ERR_OK: it is there; ERR_PENDING: not yet; ERR_NET_NOTCONNECTED: refused, or no way there. By name also
 * ERR_NOT_READY_YET: the name is being looked up, or was just found; ERR_NO_OBJECT: no host has this name; ERR_TIMEOUT: no
 * name server replies. */
RTS_RESULT SysSockGetConnected(RTS_HANDLE socket);

/* The local address of a socket, and the length of its network prefix in bits (0..32). ERR_INVALID_HANDLE. */
RTS_RESULT SysSockGetOwn(RTS_HANDLE socket, SOCKADDRESS *own, RTS_UI32 *prefix);

/* Network `index` (0..) at which the device can be programmed, all interfaces but loopback where a socket has no
 * address of its own: the address and mask of the device there. ERR_NO_OBJECT past the last one. Only for what
 * SRV_NETWORKS says. */
RTS_RESULT SysSockGetNetwork(RTS_UI32 index, SOCKNETWORK *network);

/* Accepts a connection and returns the address of its peer; RTS_INVALID_HANDLE if none is waiting, or there is no room.
 * It sends without delay (TCP_NODELAY). */
RTS_HANDLE SysSockAccept(RTS_HANDLE listener, SOCKADDRESS *peer);

/* Receives from or sends to a connection. ERR_OK with the number of bytes received or taken, 0 if there is no data, or no
 * room, now; ERR_NET_NOTCONNECTED if the peer has closed or reset the connection. */
RTS_RESULT SysSockRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received);
RTS_RESULT SysSockSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken);

/* Receives a datagram. ERR_OK with its size; only the first `size` bytes are copied to `data`. ERR_NOTHING_TO_DO if none
 * is waiting. */
RTS_RESULT SysSockRecvFrom(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received);

/* Sends a datagram. ERR_NOBUFFER if there is no room now. ERR_OK does not mean that it arrives. */
RTS_RESULT SysSockSendTo(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, const SOCKADDRESS *to);

/* Where a datagram was sent to of which the network says that no socket there takes it (ICMP: port unreachable). ERR_OK;
 * ERR_NOTHING_TO_DO if there is none, or the system does not tell. */
RTS_RESULT SysSockRecvRefused(RTS_HANDLE socket, SOCKADDRESS *to);

/* Closes a connection at once: what was taken, and has not arrived, is not sent any more. Only a field bus needs it. */
void SysSockReset(RTS_HANDLE socket);

/* Closes a connection, after sending what was taken; or returns a socket of SysSockOpen, which may be opened again. */
void SysSockClose(RTS_HANDLE socket);

#endif
