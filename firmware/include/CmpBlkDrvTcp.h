/*
 * CmpBlkDrvTcp.h - the TCP block driver: a server whose connections are a block driver each. codesys-v3-protocol 1.2.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * What a connection may do before somebody has logged in over it is limited, so that nobody keeps others out: its first
 * frame has to come in time, and when all are taken a new one replaces the one that is of least use.
 */
#ifndef CMPBLKDRVTCP_H
#define CMPBLKDRVTCP_H

#include "CmpRouterEmbedded.h"

typedef struct {
    RTS_UI32 accepted;
    RTS_UI32 frames;    /* received */
    RTS_UI32 displaced; /* connections closed for a new one; those below were closed, too */
    RTS_UI32 bad_magic;
    RTS_UI32 bad_length;   /* of a frame */
    RTS_UI32 late_frames;  /* begun, or expected, and not complete after TCP_FRAME_MS */
    RTS_UI32 idle;         /* for TCP_IDLE_MS */
    RTS_UI32 disconnected; /* by the peer */
} TCP_COUNTERS;

const TCP_COUNTERS *BlkDrvTcpGetCounters(void);

RTS_RESULT CmpBlkDrvTcp_Hook(CMP_HOOK hook);

#endif
