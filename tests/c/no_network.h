/*
 * no_network.h - sockets of a network on which no peer is: what the simulator has not, for tests that link TCP.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * To be included by one source of a test.
 */
#ifndef NO_NETWORK_H
#define NO_NETWORK_H

#include "SysSocket.h"

enum { NO_NETWORK_LISTENER = 7 };

static RTS_UI32 listeners;       /* that are open */
static RTS_RESULT listen_result; /* of the next ones; ERR_OK: they open */

RTS_RESULT SysSockListen(const SOCKADDRESS *own, RTS_HANDLE *listener)
{
    RTS_UNUSED(own);
    if (listen_result != ERR_OK)
        return listen_result;
    *listener = NO_NETWORK_LISTENER;
    listeners++;
    return ERR_OK;
}

RTS_HANDLE SysSockAccept(RTS_HANDLE listener, SOCKADDRESS *peer)
{
    RTS_UNUSED(listener);
    RTS_UNUSED(peer);
    return RTS_INVALID_HANDLE;
}

RTS_HANDLE SysSockConnect(const SOCKADDRESS *peer)
{
    RTS_UNUSED(peer);
    return RTS_INVALID_HANDLE;
}

RTS_RESULT SysSockGetConnected(RTS_HANDLE socket)
{
    RTS_UNUSED(socket);
    return ERR_NET_NOTCONNECTED;
}

RTS_RESULT SysSockRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received)
{
    RTS_UNUSED(socket);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    *received = 0;
    return ERR_NET_NOTCONNECTED;
}

RTS_RESULT SysSockSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken)
{
    return SysSockRecv(socket, (RTS_UI8 *)data, size, taken);
}

void SysSockReset(RTS_HANDLE socket)
{
    SysSockClose(socket);
}

void SysSockClose(RTS_HANDLE socket)
{
    listeners -= socket == NO_NETWORK_LISTENER;
}

#endif
