/*
 * CmpRouterEmbedded.h - layer 3 of a leaf node: takes packets from block drivers, answers to their senders.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A leaf never forwards, has no parent, and sends only answers. codesys-v3-protocol 2. All from main.
 */
#ifndef CMPROUTEREMBEDDED_H
#define CMPROUTEREMBEDDED_H

#include "CmpItf.h"
#include "CmpSrvNumbers.h"
#include "rts_config.h"

/* Counts what happened on one of the layers 2 to 4, for the PLC shell and debuggers. */
#define COMM_COUNT(counter) ((void)(COMM_COUNTERS && ++(counter)))

/* A packet to send, in pieces, so that no layer has to assemble it in a buffer of its own. */
typedef struct {
    const RTS_UI8 *data;
    RTS_UI32 size;
} BLK_PART;

struct ROUTER_PEER;

/* A block driver (layer 2): one of a serial line, a UDP socket, a TCP connection, or in process. */
typedef struct {
    RTS_UI8 type;           /* BLK_DRV_TYPE_*, in the name service reply */
    RTS_UI8 point_to_point; /* 1: everything that arrives is for this node, whatever its receiver address */
    RTS_UI8 address_words;  /* own network address, 1..ROUTER_MAX_ADDRESS */
    RTS_UI8 address[2 * ROUTER_MAX_ADDRESS];
#if SRV_OTHER_CLIENTS
    RTS_UI8 address_bits; /* of it that are used, from the last byte on; 0: all */
#endif
#if BLK_LONG_PACKETS
    RTS_UI16 takes; /* longest packet it takes, if that is more than BLK_MAX_SIZE */
#endif
#if COMM_ENDPOINTS
    bool reliable; /* what it takes arrives, once and in order, or the peer is gone */
    bool gone;     /* its only peer has gone; true for one pass of CH_COMM_CYCLE at least */
    /* Network address of its only peer; it replaces the one in the packets of that peer. 0 words: not known. */
    RTS_UI8 peer_words;
    RTS_UI8 peer_address[2 * ROUTER_MAX_NETWORK];
#endif
#if COMM_HOST_CHANNELS
    RTS_UI32 (*host_of)(const struct ROUTER_PEER *peer); /* its machine, or tool; 0: this machine */
#endif
    void *instance; /* the driver's own */

    /* Queues one packet made of `count` parts, BLK_MAX_SIZE bytes at most; the parts are copied. To a peer whose
     * `driver` this is. ERR_NOBUFFER: no room now, offer it again in a later cycle. */
    RTS_RESULT (*send)(const struct ROUTER_PEER *peer, const BLK_PART *parts, RTS_UI32 count);
} BLK_DRV;

/* Where a packet came from, and so where its answer goes. */
typedef struct ROUTER_PEER {
    const BLK_DRV *driver;
#if COMM_ENDPOINTS
    RTS_UI64 endpoint; /* the driver's own: which of its peers; 0 when it has only one */
#endif
    RTS_UI16 max_packet;   /* bytes, what the sender's path can carry */
    RTS_UI8 address_words; /* 1..ROUTER_MAX_ADDRESS */
    RTS_UI8 address[2 * ROUTER_MAX_ADDRESS];
} ROUTER_PEER;

/* The counters of a block driver with their names, for the PLC shell. */
typedef struct BLK_COUNTERS {
    const char *driver;
    const char *const *names;
    RTS_UI32 count;
    const RTS_UI32 *values; /* `count` of each line */
    RTS_UI32 lines;
} BLK_COUNTERS;

/* Of the drivers that a port has, NULL after them (CmpList.h). */
extern const BLK_COUNTERS *const BlkCounters[];

/* What happened to packets since start. */
typedef struct {
    RTS_UI32 handled;
    RTS_UI32 malformed;  /* header wrong or cut */
    RTS_UI32 not_for_us; /* other receiver, relative address, hop count 0 */
    RTS_UI32 ignored;    /* signals, notifications, services a leaf does not offer */
} ROUTER_COUNTERS;

/* Takes the payload of a packet; valid during the call only. */
typedef void (*ROUTER_HANDLER)(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size);

/* The services of this node, a table in CommServices.c: it takes no RAM, and the router knows none of them by name. */
typedef struct {
    RTS_UI8 number; /* ROUTER_SVC_* */
    ROUTER_HANDLER handler;
#if COMM_ENDPOINTS
    bool (*needs)(const BLK_DRV *driver); /* whether a client of it is logged in over this driver; NULL: never */
    void (*unreachable)(const BLK_DRV *driver, RTS_UI64 endpoint); /* see RouterUnreachable; NULL: nothing to do */
#endif
} ROUTER_SERVICE;
extern const ROUTER_SERVICE RouterServices[];
extern const RTS_UI32 RouterServiceCount;

/* Called by a block driver for each packet whose check sum was right. `data` may be reused when it returns. */
void RouterHandleData(const BLK_DRV *driver, const RTS_UI8 *data, RTS_UI32 size);

#if COMM_ENDPOINTS
/* The same for a driver with several peers: the packet comes from this one. */
void RouterHandleDataFrom(const BLK_DRV *driver, RTS_UI64 endpoint, const RTS_UI8 *data, RTS_UI32 size);

/* What was sent to this peer has not been taken: the program there may have ended. That is a hint only; a peer that sends
 * something is there. */
void RouterUnreachable(const BLK_DRV *driver, RTS_UI64 endpoint);

/* Whether a service has a client on this driver that would lose its login with it. */
bool RouterNeeds(const BLK_DRV *driver);
#endif

enum { ROUTER_MAX_PARTS = 2 };

/* Sends `parts` (at most ROUTER_MAX_PARTS) as the payload of one packet. ERR_NOBUFFER: later; ERR_NET_MSGSIZE: too
 * long. */
RTS_RESULT RouterSend(const ROUTER_PEER *peer, RTS_UI8 service, const BLK_PART *parts, RTS_UI32 count);

/* Largest payload of one packet to this peer when both addresses together have `address_words` words. */
RTS_UI32 RouterGetMaxPayload(const ROUTER_PEER *peer, RTS_UI32 address_words);

/* Same driver, same endpoint, same address. */
bool RouterIsSamePeer(const ROUTER_PEER *a, const ROUTER_PEER *b);

const ROUTER_COUNTERS *RouterGetCounters(void);

RTS_RESULT CmpRouterEmbedded_Hook(CMP_HOOK hook);

#endif
