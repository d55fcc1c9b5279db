/*
 * IsoTp.h - ISO-TP (ISO 15765-2): packets in CAN frames, one direction of one pair of nodes.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Neither identifiers nor a bus nor a clock in here: the caller hands in frames and the time, and sends the frames it
 * gets. Times are milliseconds that may wrap, from one clock. Nothing blocks, nothing is kept but what the caller holds.
 * Normal addressing; classic frames and CAN FD, whose size the caller says. Docs: docs/can.md.
 *
 *   single frame        0L data            L bytes, 1..7; on FD also 00 LL data
 *   first frame         1L LL data         12 bits of length; longer packets (10 00 and 32 bits) are refused
 *   consecutive frame   2S data            S counts 1..15, 0, 1, ...
 *   flow control        3F BS ST           F 0 go on, 1 wait, 2 too long; BS frames until the next one, 0: no limit
 */
#ifndef ISOTP_H
#define ISOTP_H

#include "CmpErrors.h"
#include "CmpStd.h"

enum {
    ISOTP_MAX_FRAME = 64,
    ISOTP_MAX_PACKET = 4095, /* bytes */
    ISOTP_FLOW_SIZE = 3,     /* of a flow control frame */
    ISOTP_TIMEOUT_MS = 1000, /* N_Bs and N_Cr: for flow control and for the next consecutive frame */
    ISOTP_UNHEARD_MS = 300,  /* a receiver that is there says something within this time */
    ISOTP_MAX_WAITS = 10,    /* flow control frames in a row that say wait */
};

/* What a frame is, by its first nibble. */
typedef enum {
    ISOTP_SINGLE,
    ISOTP_FIRST,
    ISOTP_CONSECUTIVE,
    ISOTP_FLOW,
    ISOTP_OTHER, /* none of ISO-TP's; also an empty frame */
} ISOTP_KIND;

ISOTP_KIND IsoTpKind(const RTS_UI8 *data, RTS_UI32 size);

/* ---- receiving ---- */

/* The fields are those of IsoTp.c, but for `buffer`, `capacity` and what flow control asks for, which the caller sets. */
typedef struct {
    RTS_UI8 *buffer;
    RTS_UI32 capacity;  /* bytes, at most ISOTP_MAX_PACKET */
    RTS_UI8 block_size; /* frames between two flow control frames; 0: no limit */
    RTS_UI8 separation; /* least time between two frames, as in a flow control frame: 0..127 ms, F1..F9: 100..900 us */
    RTS_UI8 sequence;   /* of the next frame */
    RTS_UI8 block_left;
    RTS_UI8 frame_size; /* of the first frame; all but the last one have it */
    RTS_UI8 flow_due;   /* 1 + its F; 0: none */
    RTS_UI32 size;      /* of the packet; 0: none is under way */
    RTS_UI32 fill;
    RTS_UI32 heard_ms;
} ISOTP_RX;

typedef enum {
    ISOTP_RX_NOTHING,  /* the packet goes on, or the frame was none for it */
    ISOTP_RX_DONE,     /* the packet is in `buffer`, IsoTpReceive's *size bytes of it */
    ISOTP_RX_ABORTED,  /* a wrong sequence number, another length, or a new packet before the end of the last one */
    ISOTP_RX_TOO_LONG, /* longer than the buffer; flow control says so */
} ISOTP_RX_RESULT;

/* Takes a single, first or consecutive frame. */
ISOTP_RX_RESULT IsoTpReceive(ISOTP_RX *rx, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms, RTS_UI32 *packet_size);

/* Writes the flow control frame that is due; false when there is none. IsoTpFlowSent when it was sent. */
bool IsoTpFlow(const ISOTP_RX *rx, RTS_UI8 frame[ISOTP_FLOW_SIZE]);
void IsoTpFlowSent(ISOTP_RX *rx);

/* Ends a packet whose next frame does not come; true when it did. Call it now and then. */
bool IsoTpReceiveExpired(ISOTP_RX *rx, RTS_UI32 now_ms);

static inline bool IsoTpIsReceiving(const ISOTP_RX *rx)
{
    return rx->size != 0;
}

/* ---- sending ---- */

typedef enum { ISOTP_TX_IDLE, ISOTP_TX_START, ISOTP_TX_WAIT, ISOTP_TX_SEND } ISOTP_TX_STATE;

/* The fields are those of IsoTp.c. */
typedef struct {
    const RTS_UI8 *data;
    RTS_UI32 size;
    RTS_UI32 sent;
    RTS_UI32 frame_max; /* bytes: 8, or up to 64 on FD */
    RTS_UI32 since_ms;  /* of the last frame */
    RTS_UI8 state;      /* ISOTP_TX_STATE */
    RTS_UI8 sequence;
    RTS_UI8 block_left; /* 0: no limit */
    RTS_UI8 separation_ms;
    RTS_UI8 waits;
} ISOTP_TX;

typedef enum {
    ISOTP_TX_NOTHING,
    ISOTP_TX_FAILED, /* there is no flow control, it is wrong, or the packet is too long for the receiver */
} ISOTP_TX_RESULT;

/* Begins a packet; `data` stays as it is until IsoTpIsSending is false. `frame_max`: bytes of a frame, 8..64.
 * ERR_NET_MSGSIZE for 0 bytes or more than ISOTP_MAX_PACKET, ERR_NOBUFFER while another one is under way. */
RTS_RESULT IsoTpStart(ISOTP_TX *tx, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 frame_max, RTS_UI32 now_ms);

/* Writes the frame that can be sent now and returns its size; 0 when there is none. The same one again until
 * IsoTpSent. */
RTS_UI32 IsoTpNext(const ISOTP_TX *tx, RTS_UI8 frame[ISOTP_MAX_FRAME], RTS_UI32 now_ms);
void IsoTpSent(ISOTP_TX *tx, RTS_UI32 now_ms);

/* Takes a flow control frame. */
ISOTP_TX_RESULT IsoTpTakeFlow(ISOTP_TX *tx, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms);

/* Whether flow control is awaited for longer than a receiver that is there takes; ISOTP_UNHEARD_MS. */
bool IsoTpIsUnheard(const ISOTP_TX *tx, RTS_UI32 now_ms);

/* Ends a packet whose flow control does not come, or whose next frame cannot be sent; true when it did. */
bool IsoTpSendExpired(ISOTP_TX *tx, RTS_UI32 now_ms);

static inline bool IsoTpIsSending(const ISOTP_TX *tx)
{
    return tx->state != ISOTP_TX_IDLE;
}

#endif
