/*
 * IsoTp.c - ISO-TP (ISO 15765-2): packets in CAN frames, one direction of one pair of nodes.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IsoTp.h"

#include <string.h>

enum {
    CLASSIC = 8,     /* bytes of a classic frame */
    FIRST_HEAD = 2,  /* bytes before the data */
    LONG_SINGLE = 2, /* the same of a single frame on FD with more than 7 bytes */
    SEQUENCE_MASK = 0x0F,
    GO_ON = 0,
    WAIT = 1,
    OVERFLOW = 2,
};

/* A caller may look at the clock at the start of its cycle, and again later: then `since_ms` is after `now_ms`. */
static bool has_passed(RTS_UI32 since_ms, RTS_UI32 now_ms, RTS_UI32 ms)
{
    RTS_UI32 passed = now_ms - since_ms;

    return passed >= ms && passed <= INT32_MAX;
}

ISOTP_KIND IsoTpKind(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 kind = size == 0 ? ISOTP_OTHER : data[0] >> 4;

    return kind < ISOTP_OTHER ? (ISOTP_KIND)kind : ISOTP_OTHER;
}

/* ---- receiving ---- */

static bool forget(ISOTP_RX *rx)
{
    bool was = rx->size != 0;

    rx->size = 0;
    rx->flow_due = 0;
    return was;
}

static ISOTP_RX_RESULT take_single(ISOTP_RX *rx, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *packet_size)
{
    bool is_long = size > CLASSIC && data[0] == 0;
    RTS_UI32 head = is_long ? LONG_SINGLE : 1;
    RTS_UI32 length = is_long ? data[1] : data[0];

    (void)forget(rx);
    if (length == 0 || length > size - head || (!is_long && size > CLASSIC))
        return ISOTP_RX_ABORTED;
    if (length > rx->capacity)
        return ISOTP_RX_TOO_LONG;
    memcpy(rx->buffer, data + head, length);
    *packet_size = length;
    return ISOTP_RX_DONE;
}

static ISOTP_RX_RESULT take_first(ISOTP_RX *rx, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    bool aborted = forget(rx);
    RTS_UI32 length = (size >= CLASSIC) ? (RTS_UI32)(data[0] & 0x0F) << 8 | data[1] : 0;

    if (size < CLASSIC || (length != 0 && length <= (size == CLASSIC ? CLASSIC - 1u : size - LONG_SINGLE)))
        return ISOTP_RX_ABORTED; /* it would have been a single frame */
    if (length == 0 || length > rx->capacity) {
        rx->flow_due = 1 + OVERFLOW;
        return ISOTP_RX_TOO_LONG;
    }
    rx->size = length;
    rx->frame_size = (RTS_UI8)size;
    rx->fill = size - FIRST_HEAD;
    rx->sequence = 1;
    rx->heard_ms = now_ms;
    rx->block_left = rx->block_size;
    rx->flow_due = 1 + GO_ON;
    memcpy(rx->buffer, data + FIRST_HEAD, rx->fill);
    return aborted ? ISOTP_RX_ABORTED : ISOTP_RX_NOTHING;
}

static ISOTP_RX_RESULT end_frame(ISOTP_RX *rx, RTS_UI32 *packet_size)
{
    if (rx->fill == rx->size) {
        *packet_size = rx->size;
        (void)forget(rx);
        return ISOTP_RX_DONE;
    }
    if (rx->block_size != 0 && --rx->block_left == 0) {
        rx->block_left = rx->block_size;
        rx->flow_due = 1 + GO_ON;
    }
    return ISOTP_RX_NOTHING;
}

/* CAN may deliver a frame twice (its sender has missed the end of the first one): the number of the frame before is not
 * an error. */
static bool is_repetition(const ISOTP_RX *rx, RTS_UI32 sequence)
{
    return sequence == ((rx->sequence - 1u) & SEQUENCE_MASK) && rx->fill > (RTS_UI32)rx->frame_size - FIRST_HEAD;
}

/* The last one may be filled up to the size of all others. */
static ISOTP_RX_RESULT take_consecutive(ISOTP_RX *rx, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms,
                                        RTS_UI32 *packet_size)
{
    RTS_UI32 left = rx->size - rx->fill;
    RTS_UI32 sequence = data[0] & SEQUENCE_MASK;

    if (rx->size == 0 || is_repetition(rx, sequence))
        return ISOTP_RX_NOTHING;
    if (sequence != rx->sequence || size > rx->frame_size || (size < rx->frame_size && size - 1 < left)) {
        (void)forget(rx);
        return ISOTP_RX_ABORTED;
    }
    RTS_UI32 part = size - 1 < left ? size - 1 : left;
    memcpy(rx->buffer + rx->fill, data + 1, part);
    rx->fill += part;
    rx->sequence = (rx->sequence + 1) & SEQUENCE_MASK;
    rx->heard_ms = now_ms;
    return end_frame(rx, packet_size);
}

ISOTP_RX_RESULT IsoTpReceive(ISOTP_RX *rx, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms, RTS_UI32 *packet_size)
{
    *packet_size = 0;
    if (size > ISOTP_MAX_FRAME)
        return ISOTP_RX_NOTHING;
    switch (IsoTpKind(data, size)) {
    case ISOTP_SINGLE:
        return take_single(rx, data, size, packet_size);
    case ISOTP_FIRST:
        return take_first(rx, data, size, now_ms);
    case ISOTP_CONSECUTIVE:
        return take_consecutive(rx, data, size, now_ms, packet_size);
    default:
        return ISOTP_RX_NOTHING;
    }
}

bool IsoTpFlow(const ISOTP_RX *rx, RTS_UI8 frame[ISOTP_FLOW_SIZE])
{
    if (rx->flow_due == 0)
        return false;
    frame[0] = (RTS_UI8)(ISOTP_FLOW << 4 | (rx->flow_due - 1));
    frame[1] = rx->block_size;
    frame[2] = rx->separation;
    return true;
}

void IsoTpFlowSent(ISOTP_RX *rx)
{
    rx->flow_due = 0;
}

bool IsoTpReceiveExpired(ISOTP_RX *rx, RTS_UI32 now_ms)
{
    return rx->size != 0 && has_passed(rx->heard_ms, now_ms, ISOTP_TIMEOUT_MS) && forget(rx);
}

/* ---- sending ---- */

RTS_RESULT IsoTpStart(ISOTP_TX *tx, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 frame_max, RTS_UI32 now_ms)
{
    if (IsoTpIsSending(tx))
        return ERR_NOBUFFER;
    if (size == 0 || size > ISOTP_MAX_PACKET)
        return ERR_NET_MSGSIZE;
    tx->data = data;
    tx->size = size;
    tx->sent = 0;
    tx->frame_max = frame_max < CLASSIC ? CLASSIC : frame_max;
    tx->since_ms = now_ms;
    tx->sequence = 0;
    tx->waits = 0;
    tx->separation_ms = 0;
    tx->state = ISOTP_TX_START;
    return ERR_OK;
}

static RTS_UI32 single_head(const ISOTP_TX *tx)
{
    return tx->size < CLASSIC ? 1 : LONG_SINGLE;
}

static bool is_single(const ISOTP_TX *tx)
{
    return tx->size < CLASSIC || tx->size + LONG_SINGLE <= (tx->frame_max > CLASSIC ? tx->frame_max : 0);
}

/* Bytes of the packet in the next frame. */
static RTS_UI32 next_part(const ISOTP_TX *tx)
{
    RTS_UI32 room = tx->frame_max - (tx->sequence == 0 && tx->sent == 0 ? (RTS_UI32)FIRST_HEAD : 1);
    RTS_UI32 left = tx->size - tx->sent;

    return left < room ? left : room;
}

static RTS_UI32 put_start(const ISOTP_TX *tx, RTS_UI8 *frame)
{
    if (is_single(tx)) {
        frame[0] = single_head(tx) == 1 ? (RTS_UI8)tx->size : 0;
        frame[1] = (RTS_UI8)tx->size;
        memcpy(frame + single_head(tx), tx->data, tx->size);
        return single_head(tx) + tx->size;
    }
    frame[0] = (RTS_UI8)(ISOTP_FIRST << 4 | tx->size >> 8);
    frame[1] = (RTS_UI8)tx->size;
    memcpy(frame + FIRST_HEAD, tx->data, tx->frame_max - FIRST_HEAD);
    return tx->frame_max;
}

/* Time is whole milliseconds, of which the first one may be almost over. */
static bool may_send(const ISOTP_TX *tx, RTS_UI32 now_ms)
{
    return tx->separation_ms == 0 || has_passed(tx->since_ms, now_ms, tx->separation_ms + 1u);
}

RTS_UI32 IsoTpNext(const ISOTP_TX *tx, RTS_UI8 frame[ISOTP_MAX_FRAME], RTS_UI32 now_ms)
{
    if (tx->state == ISOTP_TX_START)
        return put_start(tx, frame);
    if (tx->state != ISOTP_TX_SEND || !may_send(tx, now_ms))
        return 0;
    RTS_UI32 part = next_part(tx);
    frame[0] = (RTS_UI8)(ISOTP_CONSECUTIVE << 4 | tx->sequence);
    memcpy(frame + 1, tx->data + tx->sent, part);
    return 1 + part;
}

void IsoTpSent(ISOTP_TX *tx, RTS_UI32 now_ms)
{
    tx->since_ms = now_ms;
    if (tx->state == ISOTP_TX_START) {
        tx->sent = is_single(tx) ? tx->size : tx->frame_max - FIRST_HEAD;
        tx->sequence = 1;
        tx->state = is_single(tx) ? ISOTP_TX_IDLE : ISOTP_TX_WAIT;
        return;
    }
    tx->sent += next_part(tx);
    tx->sequence = (tx->sequence + 1) & SEQUENCE_MASK;
    if (tx->sent == tx->size)
        tx->state = ISOTP_TX_IDLE;
    else if (tx->block_left != 0 && --tx->block_left == 0)
        tx->state = ISOTP_TX_WAIT;
}

/* Of a separation time in milliseconds, rounded up; what is reserved counts as the longest (ISO 15765-2, 9.6.5.4). */
static RTS_UI8 separation_ms(RTS_UI8 separation)
{
    if (separation <= 0x7F)
        return separation;
    return separation >= 0xF1 && separation <= 0xF9 ? 1 : 0x7F;
}

static ISOTP_TX_RESULT fail(ISOTP_TX *tx)
{
    tx->state = ISOTP_TX_IDLE;
    return ISOTP_TX_FAILED;
}

ISOTP_TX_RESULT IsoTpTakeFlow(ISOTP_TX *tx, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 now_ms)
{
    if (tx->state != ISOTP_TX_WAIT || size < ISOTP_FLOW_SIZE || IsoTpKind(data, size) != ISOTP_FLOW)
        return ISOTP_TX_NOTHING;
    switch (data[0] & 0x0F) {
    case GO_ON:
        tx->state = ISOTP_TX_SEND;
        tx->block_left = data[1];
        tx->separation_ms = separation_ms(data[2]);
        tx->since_ms = now_ms - tx->separation_ms - 1; /* the first frame of a block comes at once */
        tx->waits = 0;
        return ISOTP_TX_NOTHING;
    case WAIT:
        tx->since_ms = now_ms;
        return ++tx->waits > ISOTP_MAX_WAITS ? fail(tx) : ISOTP_TX_NOTHING;
    default:
        return fail(tx);
    }
}

bool IsoTpIsUnheard(const ISOTP_TX *tx, RTS_UI32 now_ms)
{
    return tx->state == ISOTP_TX_WAIT && has_passed(tx->since_ms, now_ms, ISOTP_UNHEARD_MS);
}

bool IsoTpSendExpired(ISOTP_TX *tx, RTS_UI32 now_ms)
{
    return IsoTpIsSending(tx) && has_passed(tx->since_ms, now_ms, ISOTP_TIMEOUT_MS + (RTS_UI32)tx->separation_ms) &&
           fail(tx) == ISOTP_TX_FAILED;
}
