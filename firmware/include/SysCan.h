/*
 * SysCan.h - CAN controllers a port gives: classic CAN and CAN FD.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Called by the owner of a controller, CmpCan or where there is no other user CmpBlkDrvCan, from main; SysCanSend by
 * CmpCan also from tasks, one at a time. Nothing blocks: a port buffers received frames (interrupt driven) and frames to
 * send. Of the frames that wait to be sent those of 11 bits go before those of 29 bits, as far as the hardware lets them.
 * Frames of one identifier are sent and received in order. Every identifier may be received as the filters say; who
 * calls looks at the identifier nevertheless, because a controller with few filters lets more pass.
 */
#ifndef SYSCAN_H
#define SYSCAN_H

#include "CmpErrors.h"
#include "CmpStd.h"
#include "rts_config.h"

enum {
    CAN_CLASSIC_SIZE = 8, /* most data of a classic frame, bytes */
    CAN_FD_SIZE = 64,
    CAN_DATA_SIZE = CAN_FD ? CAN_FD_SIZE : CAN_CLASSIC_SIZE,
};

/* CAN_FRAME.flags */
enum {
    CAN_FLAG_EXTENDED = 1, /* the identifier has 29 bits, not 11 */
    CAN_FLAG_REMOTE = 2,   /* asks for data, and has none; never FD */
    CAN_FLAG_FD = 4,
    CAN_FLAG_FAST = 8, /* FD: the data is sent at the second bit rate */
};

typedef struct {
    RTS_UI32 id;
    RTS_UI32 time_us; /* when it was received, of a free running clock of the port; wraps. Of sent frames: unused */
    RTS_UI8 flags;
    RTS_UI8 size; /* bytes of data: 0..8, FD also 12, 16, 20, 24, 32, 48, 64 */
    RTS_UI8 data[CAN_DATA_SIZE];
} CAN_FRAME;

/* A frame is received if its identifier has the bits of `id` where `mask` has ones, and the length of `extended`. */
typedef struct {
    RTS_UI32 id;
    RTS_UI32 mask;
    bool extended;
} CAN_FILTER;

/* What the controller does, by its error counters (ISO 11898-1). */
typedef enum {
    CAN_BUS_STOPPED, /* not open, or its adapter is away */
    CAN_BUS_ACTIVE,
    CAN_BUS_WARNING, /* a counter has reached 96 */
    CAN_BUS_PASSIVE, /* 128 */
    CAN_BUS_OFF,     /* 256 failures to send: it neither sends nor receives until SysCanRestart */
} CAN_BUS_STATE;

/* Counters are 0 where a port cannot read them. */
typedef struct {
    CAN_BUS_STATE bus;
    RTS_UI32 bit_rate; /* bit/s; 0: not known */
    RTS_UI32 data_bit_rate;
    RTS_UI32 tx_errors; /* the error counters of the controller, 0..256 */
    RTS_UI32 rx_errors;
    RTS_UI32 lost; /* received frames for which there was no room */
} CAN_STATE;

/* How a node is addressed (docs/can.md). */
typedef struct {
    RTS_UI32 base; /* of the 29-bit identifiers, its last 16 bits 0: CAN_ID_BASE, if the user has chosen no other */
    RTS_UI32 node; /* 1..127, as set by switches or stored; 0: none, it takes no part */
} CAN_ADDRESS;

/* How many controllers the port has configured. */
RTS_UI32 SysCanGetCount(void);

/* What the user has chosen, as it is: what cannot be is refused, and said in the log, by who asks. */
void SysCanGetAddress(RTS_UI32 index, CAN_ADDRESS *address);

/* Opens a controller at a bit rate, 0: the port's own; `data_bit_rate` not 0: FD frames may be sent, and received. What
 * came before is forgotten; without filters nothing is received. ERR_DEVICE when there is none, ERR_NOT_SUPPORTED for a
 * bit rate. */
RTS_RESULT SysCanOpen(RTS_UI32 index, RTS_UI32 bit_rate, RTS_UI32 data_bit_rate);
void SysCanClose(RTS_UI32 index);

/* Whether FD frames can be sent: the controller, the port's configuration and SysCanOpen allow it. */
bool SysCanIsFd(RTS_UI32 index);

/* Replaces all filters. They are copied. ERR_DEVICE. */
RTS_RESULT SysCanSetFilters(RTS_UI32 index, const CAN_FILTER *filters, RTS_UI32 count);

/* Queues a frame. ERR_NOBUFFER: no room now, offer it again; ERR_DEVICE: bus off, or not open; ERR_PARAMETER: the
 * identifier, the size or a flag is not one of a frame, or of this controller. */
RTS_RESULT SysCanSend(RTS_UI32 index, const CAN_FRAME *frame);

/* Takes an 11-bit frame that passes the filters. False: SysCanReceive is to return it. */
typedef bool (*PF_CAN_URGENT)(RTS_UI32 index, const CAN_FRAME *frame);

/* From now on the port shows each 11-bit frame to `handler` when it arrives: in the interrupt of the controller, on Linux
 * in a thread that receives, in the simulator at the time of the frame; where there is none of these, in SysCanReceive.
 * NULL: not any more; the handler does not run after that. Only with CAN_SHARED. */
void SysCanSetUrgent(RTS_UI32 index, PF_CAN_URGENT handler);

/* Takes the oldest received frame; ERR_NOTHING_TO_DO when there is none. */
RTS_RESULT SysCanReceive(RTS_UI32 index, CAN_FRAME *frame);

void SysCanGetState(RTS_UI32 index, CAN_STATE *state);

/* Ends bus off: forgets the frames that wait and takes part again after 128 times 11 recessive bits. Does nothing
 * otherwise. */
void SysCanRestart(RTS_UI32 index);

/* ---- for what makes and takes frames ---- */

/* The data of the smallest frame that holds `size` bytes, at most 64; those up to 8 are classic. */
static inline RTS_UI32 CanRoundSize(RTS_UI32 size)
{
    static const RTS_UI8 sizes[] = {12, 16, 20, 24, 32, 48};

    if (size <= CAN_CLASSIC_SIZE)
        return size;
    for (RTS_UI32 i = 0; i < RTS_COUNT(sizes); i++)
        if (size <= sizes[i])
            return sizes[i];
    return CAN_FD_SIZE;
}

/* Whether a frame can exist. */
static inline bool CanIsFrame(const CAN_FRAME *frame)
{
    RTS_UI32 ids = (frame->flags & CAN_FLAG_EXTENDED) != 0 ? 0x1FFFFFFF : 0x7FF;

    if (frame->id > ids || frame->size > CAN_DATA_SIZE)
        return false;
    if ((frame->flags & CAN_FLAG_FD) != 0)
        return (frame->flags & CAN_FLAG_REMOTE) == 0 && CanRoundSize(frame->size) == frame->size;
    return frame->size <= CAN_CLASSIC_SIZE && (frame->flags & CAN_FLAG_FAST) == 0;
}

static inline bool CanPasses(const CAN_FILTER *filters, RTS_UI32 count, const CAN_FRAME *frame)
{
    bool extended = (frame->flags & CAN_FLAG_EXTENDED) != 0;

    for (RTS_UI32 i = 0; i < count; i++)
        if (filters[i].extended == extended && ((filters[i].id ^ frame->id) & filters[i].mask) == 0)
            return true;
    return false;
}

#endif
