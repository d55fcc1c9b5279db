/*
 * SysNet.h - IPv4 sockets of programs (IecSocket.h).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Called by IecSocket from main. No function blocks; each takes no longer than copying its data. Data that comes does not
 * wake main: the program asks for it. A port has IEC_SOCKETS of them, besides those of SysSocket.h, and decides which
 * addresses a program may reach. Addresses and port numbers are in the byte order of the CPU, as in SysSocket.h.
 */
#ifndef SYSNET_H
#define SYSNET_H

#include "SysSocket.h"

typedef enum {
    SYSNET_UDP,      /* sends and receives at an own address; 0: all of the device; port 0: one that is free */
    SYSNET_LISTENER, /* listens for TCP connections at an own address */
    SYSNET_CLIENT,   /* begins a TCP connection to an address */
} SYSNET_KIND;

/* Opens a socket. ERR_DUPLICATE: the port number is in use; ERR_NO_ACCESS_RIGHTS: it is for others; ERR_NOBUFFER: no room;
 * ERR_DEVICE: not an address of this device, or no way there. */
RTS_RESULT SysNetOpen(SYSNET_KIND kind, const SOCKADDRESS *address, RTS_HANDLE *socket);

/* True if a program may exchange data with this address; port 0: with some port there. */
bool SysNetMayReach(const SOCKADDRESS *peer);

/* ERR_OK: the connection is there; ERR_PENDING: not yet; ERR_NET_NOTCONNECTED: refused, or no way there. */
RTS_RESULT SysNetGetConnected(RTS_HANDLE socket);

/* Accepts a connection. ERR_NOTHING_TO_DO: none is waiting. */
RTS_RESULT SysNetAccept(RTS_HANDLE listener, SOCKADDRESS *peer, RTS_HANDLE *socket);

/* As SysSockRecv, SysSockSend, SysSockRecvFrom and SysSockSendTo. */
RTS_RESULT SysNetRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received);
RTS_RESULT SysNetSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken);
RTS_RESULT SysNetRecvFrom(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received);
RTS_RESULT SysNetSendTo(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, const SOCKADDRESS *to);

/* Reads as SysNetRecv (`from` NULL: a connection) or SysNetRecvFrom, and leaves the data there to be read again. */
RTS_RESULT SysNetPeek(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received);

enum {
    SYSNET_READABLE = 1, /* data, the end of a connection, or a connection to accept */
    SYSNET_WRITABLE = 2,
    SYSNET_FAILED = 4, /* the connection was refused, or is broken */
};

/* Returns what can be done at once, SYSNET_*; `waiting` is how many bytes can be read, of datagrams those of the first one. */
RTS_UI32 SysNetPoll(RTS_HANDLE socket, RTS_UI32 *waiting);

/* Closes a socket; a connection after sending what was taken. */
void SysNetClose(RTS_HANDLE socket);

#endif
