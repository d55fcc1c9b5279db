/*
 * IecSocket.h - UDP and TCP for programs: the blocks NBS.UDP_Peer, NBS.TCP_Client .. of the library.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A program has IEC_SOCKETS of them open at a time. They are closed when the program stops, fails, or ends. What it may
 * reach, the port decides (SysNet.h). Needs HAS_IecSocket and HAS_CmpAppCalls in cmp_list.c; with IEC_SOCKETS 0, on a
 * device without a network, each call has the error IEC_SOCKET_NO_NETWORK.
 */
#ifndef IECSOCKET_H
#define IECSOCKET_H

#include "CmpItf.h"
#include "rts_config.h"

/* Operation of a call, in its low half. The high half is a port number, `value` an IPv4 address, most
 * significant byte first. */
enum {
    IEC_SOCKET_UDP_OPEN = 1,    /* own address; the result is a handle */
    IEC_SOCKET_TCP_LISTEN = 2,  /* own address; the result is a handle */
    IEC_SOCKET_TCP_CONNECT = 3, /* address of the peer; the result is a handle */
    IEC_SOCKET_CLOSE = 4,       /* handle */
    IEC_SOCKET_SEND_TO = 5,     /* handle, address of the peer; all of the data */
    IEC_SOCKET_RECEIVE =
        6, /* handle, `value` most bytes; IEC_SOCKET_HEAD, then the data; the result is its size; PEEK */
    IEC_SOCKET_ACCEPT = 7, /* handle; IEC_SOCKET_HEAD; the result is a handle, 0: no peer connects */
    IEC_SOCKET_STATE = 8,  /* handle; the result is 1 when the connection is there */
    IEC_SOCKET_READ = 9,   /* handle, `value` most bytes; the result is the size of the data; PEEK */
    IEC_SOCKET_WRITE = 10, /* handle; the result is how many bytes were taken */

    /* In the steps of Berkeley sockets (stdlib/syslib_sockets.st); what is open then takes the operations above. */
    IEC_SOCKET_CREATE = 11,   /* `value` IEC_SOCKET_STREAM or .._DATAGRAM; the result is a handle */
    IEC_SOCKET_BIND = 12,     /* handle, own address; opens a socket for datagrams */
    IEC_SOCKET_LISTEN = 13,   /* handle */
    IEC_SOCKET_CONNECT = 14,  /* handle, address of the peer; IEC_SOCKET_STATE tells the end */
    IEC_SOCKET_POLL = 15,     /* handle; the result is SYSNET_READABLE .., IEC_SOCKET_WAITING in front of it */
    IEC_SOCKET_SHUTDOWN = 16, /* handle; it stays until IEC_SOCKET_CLOSE */

    IEC_SOCKET_HOST_NAME = 17, /* the name of the device; the result is its length */
};

/* In the high half of the operations with PEEK: what is read stays, to be read again. */
enum { IEC_SOCKET_PEEK = 1 };

enum { IEC_SOCKET_STREAM = 1, IEC_SOCKET_DATAGRAM = 2 };

/* Shifts the bytes that can be read at once in the result of IEC_SOCKET_POLL. */
enum { IEC_SOCKET_WAITING = 8 };

/* Before received data: address of the peer [0..3], its port [4..5], 1 if there is a datagram [6]; little-endian. */
enum { IEC_SOCKET_HEAD = 8 };

/* Errors of CODESYS' library CAA NetBaseServices; stdlib/sockets.st has them as NBS.ERROR. */
enum {
    IEC_SOCKET_INVALID_ADDR = 6002, /* also one that the program may not reach */
    IEC_SOCKET_INVALID_HANDLE = 6003,
    IEC_SOCKET_INVALID_DATASIZE = 6005, /* a datagram is longer than its buffer, or than a call holds */
    IEC_SOCKET_UDP_SEND_ERROR = 6007,
    IEC_SOCKET_UDP_OPEN_ERROR = 6009,
    IEC_SOCKET_TCP_OPEN_ERROR = 6013,
    IEC_SOCKET_TCP_CONNECT_ERROR = 6014,
    IEC_SOCKET_WRONG_PARAMETER = 6017,
    IEC_SOCKET_NO_CONNECTION = 6019, /* the peer has closed it */
    IEC_SOCKET_TOO_MANY = 6090,      /* own: open sockets */
    IEC_SOCKET_NO_NETWORK = 6091,    /* own: the device has none for programs */
    IEC_SOCKET_SHUT = 6092,          /* own: after IEC_SOCKET_SHUTDOWN */
    IEC_SOCKET_IS_CONNECTED = 6093,  /* own: IEC_SOCKET_CONNECT has ended well */
    IEC_SOCKET_CONNECTING = 6094,    /* own: it has not ended */
};

RTS_RESULT IecSocket_Hook(CMP_HOOK hook);

#endif
