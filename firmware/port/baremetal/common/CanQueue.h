/*
 * CanQueue.h - what drivers of CAN controllers share: frames that wait, and bit timing.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A driver's interrupt takes frames to send and adds received ones; main and tasks add the former and take the latter.
 * The frames to send are changed while the driver's interrupt for sending is off.
 */
#ifndef CANQUEUE_H
#define CANQUEUE_H

#include "SysCan.h"

/* Frames to send, in the order in which they win the arbitration; of one identifier in the order of CanTxPut. */
typedef struct {
    RTS_UI32 count;
    CAN_FRAME frame[CAN_DRIVER_TX_FRAMES];
} CAN_TX;

/* Received frames; positions run freely. `urgent` gets those of 11 bits first (SysCanSetUrgent). */
typedef struct {
    PF_CAN_URGENT volatile urgent;
    RTS_UI32 head;
    RTS_UI32 tail;
    RTS_UI32 lost;
    CAN_FRAME frame[CAN_DRIVER_RX_FRAMES];
} CAN_RX;

/* What a frame is in the arbitration: the lowest wins. */
RTS_UI32 CanRank(const CAN_FRAME *frame);

/* False: no room. */
bool CanTxPut(CAN_TX *tx, const CAN_FRAME *frame);

/* Takes the first frame whose rank is not one of `count` in `busy`: two frames of one identifier would change places in
 * the controller. `only_standard`: only one of 11 bits. False: there is none. */
bool CanTxTake(CAN_TX *tx, const RTS_UI32 *busy, RTS_UI32 count, bool only_standard, CAN_FRAME *frame);

/* In the interrupt: a frame of controller `index`. */
void CanRxPut(CAN_RX *rx, RTS_UI32 index, const CAN_FRAME *frame);
bool CanRxTake(CAN_RX *rx, CAN_FRAME *frame);

/* Most of each part of a bit that a controller can have. */
typedef struct {
    RTS_UI16 prescaler;
    RTS_UI16 segment1; /* with the propagation segment */
    RTS_UI16 segment2;
    RTS_UI16 jump;
} CAN_TIMING_LIMITS;

typedef struct {
    RTS_UI16 prescaler;
    RTS_UI16 segment1;
    RTS_UI16 segment2;
    RTS_UI16 jump;
} CAN_TIMING;

/* Bytes of data in 32-bit registers, the first byte lowest; CanToWords also clears the rest of the last one. */
void CanToWords(const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *words);
void CanFromWords(const RTS_UI32 *words, RTS_UI32 size, RTS_UI8 *data);

/* Of the settings that give exactly this bit rate the one whose sample point is nearest to 87.5 % (CiA 601). False: there
 * is none. */
bool CanFindTiming(RTS_UI32 clock_hz, RTS_UI32 bit_rate, const CAN_TIMING_LIMITS *limits, CAN_TIMING *timing);

#endif
