/*
 * fuzz_sockets.h - sockets of a device that is fuzzed: a target gives it bytes and datagrams and looks at what it sends.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef FUZZ_SOCKETS_H
#define FUZZ_SOCKETS_H

#include "CmpPackets.h"
#include "CmpSrvNumbers.h"
#include "SysSocket.h"
#include "rts_config.h"

enum { SOCKETS_TCP = 3, SOCKETS_STREAM = 1 << 16, SOCKETS_DATAGRAMS = 64 };
enum { SOCKETS_OWN_IP = 0x7F000001 };

typedef struct {
    bool closed; /* by the device */
    bool ended;  /* by the peer */
    const uint8_t *in;
    uint32_t in_size;
    uint32_t room; /* what the device may send at a time */
    uint8_t out[SOCKETS_STREAM];
    uint32_t out_size;
} CONNECTION;

typedef struct {
    SOCKADDRESS peer;
    uint32_t size;
    uint8_t data[BLK_MAX_SIZE];
} DATAGRAM;

typedef struct {
    CONNECTION tcp[SOCKETS_TCP];
    uint32_t dialled;  /* connections that peers have begun */
    uint32_t accepted; /* of them by the device */
    bool has_udp;
    const uint8_t *datagram; /* that waits for the device; NULL: none */
    uint32_t datagram_size;
    SOCKADDRESS datagram_peer;
    SOCKADDRESS refused; /* where the network says that no socket is; port 0: it says nothing */
    DATAGRAM out[SOCKETS_DATAGRAMS];
    uint32_t out_count; /* what does not fit is lost */
} SOCKETS;

extern SOCKETS sockets;

/* Nothing has been dialled, the device may send all at once, and there is UDP if `has_udp`. */
void sockets_start(bool has_udp);

/* Gives the device a datagram, which it takes at once. */
void sockets_give_datagram(SOCKADDRESS peer, const uint8_t *data, uint32_t size);

/* Gives a connection bytes, of which the device takes all unless it closes the connection. */
void sockets_give(CONNECTION *connection, const uint8_t *data, uint32_t size);

/* The frame around a packet; returns its size. */
uint32_t sockets_frame(const uint8_t *packet, uint32_t size, uint8_t *frame);
/* How many whole frames the device has sent on a connection; aborts when something else is among them. */
uint32_t sockets_count_frames(const CONNECTION *connection);

#endif
