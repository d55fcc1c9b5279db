/*
 * CanQueue.c - what drivers of CAN controllers share: frames that wait, and bit timing.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanQueue.h"

#include <string.h>

#include "SysAtomic.h"

RTS_STATIC_ASSERT((CAN_DRIVER_RX_FRAMES & (CAN_DRIVER_RX_FRAMES - 1)) == 0, rx_frames_are_a_power_of_two);

enum { BASE_SHIFT = 18, RANK_SHIFT = 19, BASE_BITS = 0x3FFFF, LEAST_QUANTA = 8, PER_MILLE = 1000, SAMPLE_POINT = 875 };

/* Of frames with the same first 11 bits the short one wins. */
RTS_UI32 CanRank(const CAN_FRAME *frame)
{
    if ((frame->flags & CAN_FLAG_EXTENDED) == 0)
        return frame->id << RANK_SHIFT;
    return frame->id >> BASE_SHIFT << RANK_SHIFT | 1u << BASE_SHIFT | (frame->id & BASE_BITS);
}

/* ---- to send ---- */

bool CanTxPut(CAN_TX *tx, const CAN_FRAME *frame)
{
    RTS_UI32 place = tx->count;

    if (place == CAN_DRIVER_TX_FRAMES)
        return false;
    for (; place > 0 && CanRank(&tx->frame[place - 1]) > CanRank(frame); place--)
        tx->frame[place] = tx->frame[place - 1];
    tx->frame[place] = *frame;
    tx->count++;
    return true;
}

static bool is_in(const RTS_UI32 *ranks, RTS_UI32 count, RTS_UI32 rank)
{
    while (count > 0)
        if (ranks[--count] == rank)
            return true;
    return false;
}

bool CanTxTake(CAN_TX *tx, const RTS_UI32 *busy, RTS_UI32 count, bool only_standard, CAN_FRAME *frame)
{
    RTS_UI32 i = 0;

    while (i < tx->count && (is_in(busy, count, CanRank(&tx->frame[i])) ||
                             (only_standard && (tx->frame[i].flags & CAN_FLAG_EXTENDED) != 0)))
        i++;
    if (i == tx->count)
        return false;
    *frame = tx->frame[i];
    tx->count--;
    memmove(&tx->frame[i], &tx->frame[i + 1], (tx->count - i) * sizeof(tx->frame[0]));
    return true;
}

/* ---- received ---- */

static void add(CAN_RX *rx, const CAN_FRAME *frame)
{
    if (rx->head - SysAtomicLoad(&rx->tail) == CAN_DRIVER_RX_FRAMES) {
        rx->lost++;
        return;
    }
    rx->frame[rx->head % CAN_DRIVER_RX_FRAMES] = *frame;
    SysAtomicStore(&rx->head, rx->head + 1);
}

void CanRxPut(CAN_RX *rx, RTS_UI32 index, const CAN_FRAME *frame)
{
    PF_CAN_URGENT urgent = rx->urgent;
    bool is_standard = (frame->flags & CAN_FLAG_EXTENDED) == 0;

    if (urgent == NULL || !is_standard || !urgent(index, frame))
        add(rx, frame);
}

bool CanRxTake(CAN_RX *rx, CAN_FRAME *frame)
{
    if (SysAtomicLoad(&rx->head) == rx->tail)
        return false;
    *frame = rx->frame[rx->tail % CAN_DRIVER_RX_FRAMES];
    SysAtomicStore(&rx->tail, rx->tail + 1);
    return true;
}

/* ---- data ---- */

void CanToWords(const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *words)
{
    for (RTS_UI32 i = 0; i < size; i++)
        words[i / 4] = (i % 4 == 0 ? 0 : words[i / 4]) | (RTS_UI32)data[i] << 8 * (i % 4);
}

void CanFromWords(const RTS_UI32 *words, RTS_UI32 size, RTS_UI8 *data)
{
    for (RTS_UI32 i = 0; i < size; i++)
        data[i] = (RTS_UI8)(words[i / 4] >> 8 * (i % 4));
}

/* ---- bit timing ---- */

static RTS_UI32 distance(RTS_UI32 a, RTS_UI32 b)
{
    return a > b ? a - b : b - a;
}

/* Splits a bit of `quanta`, of which the first is for synchronisation. Returns how far its sample point is from the wanted
 * one [1/1000]; UINT32_MAX: it cannot be split. */
static RTS_UI32 split(RTS_UI32 quanta, const CAN_TIMING_LIMITS *limits, CAN_TIMING *timing)
{
    RTS_UI32 second = (quanta * (PER_MILLE - SAMPLE_POINT) + PER_MILLE / 2) / PER_MILLE;

    if (second == 0)
        second = 1;
    if (second > limits->segment2)
        second = limits->segment2;
    if (quanta - 1 - second > limits->segment1)
        second = quanta - 1 - limits->segment1;
    if (second > limits->segment2 || second + 2 > quanta)
        return UINT32_MAX;
    timing->segment1 = (RTS_UI16)(quanta - 1 - second);
    timing->segment2 = (RTS_UI16)second;
    timing->jump = (RTS_UI16)(second < limits->jump ? second : limits->jump);
    return distance((quanta - second) * PER_MILLE / quanta, SAMPLE_POINT);
}

bool CanFindTiming(RTS_UI32 clock_hz, RTS_UI32 bit_rate, const CAN_TIMING_LIMITS *limits, CAN_TIMING *timing)
{
    RTS_UI32 most = 1u + limits->segment1 + limits->segment2;
    RTS_UI32 best = UINT32_MAX;

    for (RTS_UI32 quanta = most; bit_rate != 0 && quanta >= LEAST_QUANTA; quanta--) {
        CAN_TIMING found = {0};
        RTS_UI32 prescaler = bit_rate <= clock_hz / quanta ? clock_hz / (bit_rate * quanta) : 0;
        if (prescaler == 0 || prescaler > limits->prescaler || prescaler * bit_rate * quanta != clock_hz)
            continue;
        RTS_UI32 off = split(quanta, limits, &found);
        if (off >= best)
            continue;
        found.prescaler = (RTS_UI16)prescaler;
        *timing = found;
        best = off;
    }
    return best != UINT32_MAX;
}
