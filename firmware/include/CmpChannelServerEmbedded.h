/*
 * CmpChannelServerEmbedded.h - layer 4: reliable channels that carry requests and replies.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * COMM_MAX_CLIENTS channels, each with a receive and a send buffer. The rules where codesys-v3-protocol 3 is silent:
 * docs/protocol.md. All from main.
 */
#ifndef CMPCHANNELSERVEREMBEDDED_H
#define CMPCHANNELSERVEREMBEDDED_H

#include "CommClient.h"

typedef struct {
    RTS_UI32 opened;
    RTS_UI32 refused;    /* open requests while all channels were in use */
    RTS_UI32 malformed;  /* length, version or CRC of a package wrong */
    RTS_UI32 foreign;    /* unknown channel id, or not its owner */
    RTS_UI32 duplicates; /* blocks received again */
    RTS_UI32 gaps;       /* blocks that came before an earlier one */
    RTS_UI32 repeats;    /* times the reply was sent again */
    RTS_UI32 failed;     /* channels closed because of an error */
} CHANNEL_COUNTERS;

/* Client number `index`, whether it has a channel or not; NULL from COMM_MAX_CLIENTS on. */
COMM_CLIENT *ChannelGetClient(RTS_UI32 index);
bool ChannelIsOpen(const COMM_CLIENT *client);

/* ROUTER_HANDLER of service ROUTER_SVC_CHANNEL. */
void ChannelHandlePackage(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size);

#if COMM_ENDPOINTS
/* Whether a client that has logged in is reached over this driver. */
bool ChannelNeeds(const BLK_DRV *driver);

/* The channel of this peer, if it has one, may be given to another peer until it is heard again. */
void ChannelUnreachable(const BLK_DRV *driver, RTS_UI64 endpoint);
#endif

const CHANNEL_COUNTERS *ChannelGetCounters(void);

RTS_RESULT CmpChannelServerEmbedded_Hook(CMP_HOOK hook);

#endif
