/*
 * CmpBlkDrvTcp.h - the TCP block driver: a server whose connections are a block driver each. codesys-v3-protocol 1.2.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Connections without a login cannot block others: the first frame has to arrive in time, and if all places are in use
 * a new connection replaces the least useful one.
 */
#ifndef CMPBLKDRVTCP_H
#define CMPBLKDRVTCP_H

#include "CmpRouterEmbedded.h"

typedef struct {
    RTS_UI32 accepted;
    RTS_UI32 frames;    /* received */
    RTS_UI32 displaced; /* closed because a new one needed the place; those below: for other reasons */
    RTS_UI32 bad_magic;
    RTS_UI32 bad_length;   /* of a frame */
    RTS_UI32 late_frames;  /* a frame, or the first one, was not complete after TCP_FRAME_MS */
    RTS_UI32 idle;         /* for TCP_IDLE_MS */
    RTS_UI32 disconnected; /* by the peer */
} TCP_COUNTERS;

const TCP_COUNTERS *BlkDrvTcpGetCounters(void);
extern const BLK_COUNTERS BlkDrvTcpCounters; /* the same with names */

RTS_RESULT CmpBlkDrvTcp_Hook(CMP_HOOK hook);

#endif
