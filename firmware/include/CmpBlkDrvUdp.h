/*
 * CmpBlkDrvUdp.h - the UDP block driver: a datagram is a packet. codesys-v3-protocol 1.1.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * An answer goes to where the datagram came from, whatever addresses the packet has.
 */
#ifndef CMPBLKDRVUDP_H
#define CMPBLKDRVUDP_H

#include "CmpRouterEmbedded.h"

typedef struct {
    RTS_UI32 packets;  /* received */
    RTS_UI32 too_long; /* longer than any packet */
    RTS_UI32 no_reply; /* from where no answer can go: port 0, or everybody */
} UDP_COUNTERS;

/* The network address of a host: the bits of `ip` after `prefix` (0..32), before them the index of the port (UDP_PORT
 * has 0). Big-endian, at the end of as many words as it needs, which are returned. */
RTS_UI32 BlkDrvUdpPutAddress(RTS_UI32 ip, RTS_UI32 prefix, RTS_UI32 index, RTS_UI8 *address);

const UDP_COUNTERS *BlkDrvUdpGetCounters(void);

RTS_RESULT CmpBlkDrvUdp_Hook(CMP_HOOK hook);

#endif
