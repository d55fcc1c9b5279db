/*
 * CmpChannelServerEmbedded.h - layer 4: one reliable channel that carries requests and replies.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * One channel, one receive and one send buffer. The rules where codesys-v3-protocol 3 is silent: CmpSrvNumbers.h.
 * All from main.
 */
#ifndef CMPCHANNELSERVEREMBEDDED_H
#define CMPCHANNELSERVEREMBEDDED_H

#include "CmpRouterEmbedded.h"

enum { CHANNEL_MAX_CHANNELS = 1 };

typedef struct {
    RTS_UI32 opened;
    RTS_UI32 refused;      /* open requests while somebody else had the channel */
    RTS_UI32 malformed;    /* length, version or CRC of a package wrong */
    RTS_UI32 foreign;      /* unknown channel id, or not its owner */
    RTS_UI32 duplicates;   /* blocks received again */
    RTS_UI32 gaps;         /* blocks that came before an earlier one */
    RTS_UI32 repeats;      /* times the reply was sent again */
    RTS_UI32 failed;       /* channels closed because of an error */
} CHANNEL_COUNTERS;

/* Called by the router for a packet of service ROUTER_SVC_CHANNEL. */
void ChannelHandlePackage(const ROUTER_PEER *peer, const RTS_UI8 *data, RTS_UI32 size);

const CHANNEL_COUNTERS *ChannelGetCounters(void);

RTS_RESULT CmpChannelServerEmbedded_Hook(CMP_HOOK hook);

#endif
