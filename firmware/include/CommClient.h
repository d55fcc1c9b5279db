/*
 * CommClient.h - what belongs to one connection: its channel, its session, its buffers.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * There are COMM_MAX_CLIENTS of them, held by the channel server. A service gets the one that asks. `channel` is
 * changed by CmpChannelServerEmbedded.c only, `session` by CmpSrv.c only. All from main.
 */
#ifndef COMMCLIENT_H
#define COMMCLIENT_H

#include "CmpPackets.h"
#include "CmpRouterEmbedded.h"
#include "rts_config.h"

/* ---- layer 4 ---- */

/* A message has its CHANNEL_MESSAGE before it in the first block, and so in the buffer. */
enum { COMM_PREFIX_SIZE = sizeof(CHANNEL_MESSAGE) };

typedef RTS_UI8 COMM_MESSAGE[COMM_PREFIX_SIZE + NETSERVER_MESSAGE_SIZE];

/* The request on its way in. */
typedef struct {
    RTS_UI32 block; /* number of the highest block received in order */
    RTS_UI32 gap;   /* the nearest block that has come too early since then, counted from there; 0: none */
    RTS_UI32 fill;
    RTS_UI32 left; /* bytes still missing; 0 between requests */
} CHANNEL_RECEIVER;

/* The reply on its way out. It is kept after the acknowledgement, as nothing needs the room. What concerns one reply
 * counts its blocks, so that their numbers may wrap. */
typedef struct {
    RTS_UI32 base; /* number of the last block before the reply */
    RTS_UI32 count;
    RTS_UI32 sent;
    RTS_UI32 acked;
    RTS_UI32 size;
    RTS_UI32 sent_at;
    RTS_UI32 repeats;
    RTS_UI32 missed; /* block the client last asked for; 0: none */
    RTS_UI32 missed_at;
} CHANNEL_SENDER;

/* The channel; id 0 when closed. Times are those of SysTimeGetMs. */
typedef struct {
    RTS_UI16 id;
    RTS_UI8 address_words; /* of both addresses, agreed */
    bool fresh;            /* no block has arrived yet */
    bool open_due;         /* the open response is waiting for room in the driver */
    bool ack_due;
#if SRV_OTHER_CLIENTS
    bool is_version_1_0; /* of the open request: shorter */
#endif
#if BLK_LONG_PACKETS
    RTS_UI16 wanted; /* longest packet the client would send, in place of BLK_MAX_SIZE; 0: it does not ask */
#endif
#if COMM_ENDPOINTS
    bool unreachable; /* has not taken what was sent, and has not been heard since */
#endif
    bool missing_due;    /* the acknowledgement asks for a repetition */
    RTS_UI32 request_id; /* of the open request */
    RTS_UI32 limit;      /* largest message, both directions */
    RTS_UI32 room;       /* bytes of a message, with its prefix, in one block */
    RTS_UI32 last_received;
    RTS_UI32 last_sent;
    RTS_UI32 anonymous_since; /* without a login; with COMM_ENDPOINTS only */
#if COMM_ENDPOINTS
    RTS_UI32 guessed_at; /* the last package in the name of the peer that cannot be its */
#endif
    CHANNEL_RECEIVER rx;
    CHANNEL_SENDER tx;
    ROUTER_PEER peer;
} CHANNEL;

/* ---- layer 7 ---- */

/* The session; it ends with its channel. */
typedef struct {
    RTS_UI32 id;          /* 0: none */
    RTS_UI32 app_session; /* 0: none */
    RTS_UI32 rights;      /* RIGHT_*; 0 before the login */
#if COMM_PASSWORD
    bool challenged;         /* `challenge` has been asked for, and no proof has come yet */
    DEV_CHALLENGE challenge; /* CmpUserMgr's */
#endif
} SRV_SESSION;

/* ---- both ---- */

typedef struct {
    CHANNEL channel;
    SRV_SESSION session;
#if COMM_ENDPOINTS
    bool reply_may_wait; /* set by a service: the reply to the next request, if that comes soon, will do for both */
#endif
#if COMM_PASSWORD
    bool login_paused; /* by CmpUserMgr, for all that get this channel, from then on */
    RTS_UI32 paused_since;
#endif
    COMM_MESSAGE request;
    COMM_MESSAGE reply;
} COMM_CLIENT;

#endif
