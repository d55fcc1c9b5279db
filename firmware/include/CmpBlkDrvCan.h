/*
 * CmpBlkDrvCan.h - the CAN block driver: packets over ISO-TP, to several tools at once. docs/can.md.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A peer is a source of CAN frames: replies go there, whatever addresses a packet has inside.
 */
#ifndef CMPBLKDRVCAN_H
#define CMPBLKDRVCAN_H

#include "CmpRouterEmbedded.h"

typedef struct {
    RTS_UI32 packets;    /* received */
    RTS_UI32 aborted;    /* packets whose frames were not in order, or that did not go on */
    RTS_UI32 too_long;   /* packets longer than any of this device */
    RTS_UI32 no_session; /* packets while CAN_RX_SESSIONS others were arriving */
    RTS_UI32 unsent;     /* packets that the receiver did not take */
    RTS_UI32 scans;      /* requests that were answered */
    RTS_UI32 same_node;  /* frames of another node with our number */
    RTS_UI32 bus_off;    /* times */
} CAN_COUNTERS;

const CAN_COUNTERS *BlkDrvCanGetCounters(void);
extern const BLK_COUNTERS BlkDrvCanCounters; /* the same with names */

RTS_RESULT CmpBlkDrvCan_Hook(CMP_HOOK hook);

#endif
