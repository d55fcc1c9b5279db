/*
 * CmpBlkDrvUdp.h - the UDP block driver: a datagram is a packet. codesys-v3-protocol 1.1.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A reply goes to the source of the datagram, never to an address inside the packet.
 */
#ifndef CMPBLKDRVUDP_H
#define CMPBLKDRVUDP_H

#include "CmpRouterEmbedded.h"

typedef struct {
    RTS_UI32 packets;   /* received */
    RTS_UI32 too_long;  /* longer than any packet */
    RTS_UI32 no_reply;  /* the source cannot be replied to: port 0, multicast */
    RTS_UI32 not_named; /* name requests without reply: too many, and shorter than the reply */
} UDP_COUNTERS;

/* Writes the network address of a node: the host bits of `ip` (those after `prefix`, 0..32), preceded by the port index
 * (port - UDP_PORT). Big-endian, right-aligned in as few words as possible; returns their number, at most
 * ROUTER_MAX_NETWORK. */
RTS_UI32 BlkDrvUdpPutAddress(RTS_UI32 ip, RTS_UI32 prefix, RTS_UI32 index, RTS_UI8 *address);

const UDP_COUNTERS *BlkDrvUdpGetCounters(void);
extern const BLK_COUNTERS BlkDrvUdpCounters; /* the same with names */

RTS_RESULT CmpBlkDrvUdp_Hook(CMP_HOOK hook);

#endif
