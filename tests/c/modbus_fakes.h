/*
 * modbus_fakes.h - a serial line and a network on a virtual clock, for the tests of Modbus.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The line has one other end, which is the test. What is sent on it takes the time that it takes: bytes that the device
 * sends are there when the last one has left, those that the test sends come one after the other.
 */
#ifndef MODBUS_FAKES_H
#define MODBUS_FAKES_H

#include "ModbusLink.h"
#include "SysCom.h"

/* How the bytes of a line are handed over. */
typedef enum {
    FAKE_EACH,  /* each one when it is there, with its time */
    FAKE_16550, /* 8 of them, or what there is 4 characters after the last one; their time is not known */
    FAKE_USB,   /* what is there every 16 ms, or 62 of them; their time is not known */
} FAKE_HARDWARE;

enum { FAKE_LINE_ROOM = 4096, FAKE_SOCKETS = 64, FAKE_SOCKET_ROOM = 4096, FAKE_LISTENER = 1000, FAKE_READS = 1000000 };

typedef struct {
    RTS_UI8 data[FAKE_LINE_ROOM];
    RTS_I64 time_ns[FAKE_LINE_ROOM]; /* when each of them is there */
    RTS_UI32 size;
    RTS_UI32 read;
} FAKE_BYTES;

typedef struct {
    bool open; /* the device's end */
    bool connected;
    bool peer_gone; /* the other end has closed */
    SOCKADDRESS peer;
    const char *host;             /* NULL: by address */
    RTS_UI8 in[FAKE_SOCKET_ROOM]; /* to the device */
    RTS_UI32 in_size;
    RTS_UI8 out[FAKE_SOCKET_ROOM];
    RTS_UI32 out_size;
} FAKE_SOCKET;

typedef struct {
    RTS_I64 now_ns;
    RTS_I64 char_ns;
    FAKE_BYTES to_device;
    FAKE_BYTES from_device;
    RTS_I64 last_byte_ns;
    FAKE_HARDWARE hardware;
    RTS_UI32 discards;
    RTS_UI32 write_limit; /* bytes that one SysComWrite takes */
    RTS_UI32 read_limit;  /* bytes that one SysComRead gives */
    bool babbles;         /* SysComRead gives as many bytes as wanted, of this moment, FAKE_READS times */
    RTS_UI32 reads;
    bool pulled; /* nothing arrives, in either direction */
    RTS_UI32 locks;
    bool locked;

    FAKE_SOCKET sockets[FAKE_SOCKETS];
    RTS_UI32 pending; /* sockets that wait to be accepted, from `accepted` on */
    RTS_UI32 accepted;
    RTS_UI32 used; /* sockets that there were */
    RTS_RESULT listen_result;
    RTS_UI32 listeners;
    RTS_RESULT connect_result; /* ERR_OK, ERR_PENDING, ERR_NET_NOTCONNECTED */
    RTS_RESULT lookup_result;  /* of a connection by name, before that: ERR_OK, or what SysSockGetConnected says */
    RTS_UI32 connects;
    RTS_UI32 send_limit; /* bytes that one SysSockSend takes */
    RTS_UI32 window;     /* bytes that a socket takes before they are read */
} MODBUS_FAKES;

extern MODBUS_FAKES fakes;

/* The clock is at 1 s, the line runs at 19200 8E1, nothing is on its way. */
void fakes_begin(void);

/* Bytes that the test sends from now on, or after what it sent before. */
void line_send(const RTS_UI8 *data, RTS_UI32 size);
/* The same with the CRC after them. */
void line_send_frame(const RTS_UI8 *data, RTS_UI32 size);
/* Bytes that have come from the device; forgets them. */
RTS_UI32 line_take(RTS_UI8 *data, RTS_UI32 capacity);

/* A connection to the device's listener, which is accepted when the device asks. */
FAKE_SOCKET *net_dial(void);
void net_put(FAKE_SOCKET *socket, const RTS_UI8 *data, RTS_UI32 size);
/* An ADU with this PDU. */
void net_put_pdu(FAKE_SOCKET *socket, RTS_UI16 transaction, RTS_UI8 unit, const RTS_UI8 *pdu, RTS_UI32 size);

#endif
