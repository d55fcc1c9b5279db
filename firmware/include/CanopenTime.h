/*
 * CanopenTime.h - the TIME frame of CANopen: ms since midnight and days since 1984-01-01, in UTC.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CANOPENTIME_H
#define CANOPENTIME_H

#include "Canopen.h"
#include "CmpBytes.h"
#include "SysCan.h"

enum { CANOPEN_TIME_SIZE = 6, CANOPEN_TIME_FIRST_DAY = 5113 /* since 1970-01-01 */, CANOPEN_TIME_DAY_MS = 86400000 };

static inline CAN_FRAME CanopenTimeMake(RTS_I64 utc_ns)
{
    CAN_FRAME frame = {.id = CANOPEN_TIME, .size = CANOPEN_TIME_SIZE};
    RTS_I64 ms = utc_ns / 1000000;

    BytesPut32(frame.data, (RTS_UI32)(ms % CANOPEN_TIME_DAY_MS));
    BytesPut16(frame.data + 4, (RTS_UI16)(ms / CANOPEN_TIME_DAY_MS - CANOPEN_TIME_FIRST_DAY));
    return frame;
}

/* False: the frame has no time. The upper 4 bits of the ms are reserved. */
static inline bool CanopenTimeGet(const CAN_FRAME *frame, RTS_I64 *utc_ns)
{
    RTS_UI32 ms = BytesGet32(frame->data) & 0x0FFFFFFF;

    if (frame->size != CANOPEN_TIME_SIZE || ms >= CANOPEN_TIME_DAY_MS)
        return false;
    *utc_ns = ((RTS_I64)(BytesGet16(frame->data + 4) + CANOPEN_TIME_FIRST_DAY) * CANOPEN_TIME_DAY_MS + ms) * 1000000;
    return true;
}

#endif
