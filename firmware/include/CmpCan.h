/*
 * CmpCan.h - the CAN controllers, shared by their users: the block driver, CANopen, frames of programs. docs/can.md.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Opens a controller for its first user and closes it after the last one. Merges the filters of all users, gives each
 * the frames that pass its own, and ends bus off. A firmware with one user needs none of it (CAN_SHARED 0).
 */
#ifndef CMPCAN_H
#define CMPCAN_H

#include "CmpItf.h"
#include "SysCan.h"

/* A variable of the user that lives as long as it is attached, so there may be any number of users. Functions may be
 * NULL. */
typedef struct CAN_USER {
    const CAN_FILTER *filters;
    RTS_UI32 filter_count;
    /* Any 11-bit frame, in the context of SysCanSetUrgent. False: it is also offered to `take`. */
    bool (*take_urgent)(RTS_UI32 index, const CAN_FRAME *frame);
    /* Another frame, from main. */
    void (*take)(RTS_UI32 index, const CAN_FRAME *frame, RTS_UI32 now_ms);
    /* From main: the bus has gone off, or is back. */
    void (*note_bus)(RTS_UI32 index, bool off);
    /* From main. True: this user sends or receives the identifier of 11 bits, so programs must not send it. */
    bool (*reserves)(RTS_UI32 index, RTS_UI32 id);
    struct CAN_USER *next; /* of CmpCan */
    bool has_short;        /* of CmpCan: frames of 11 bits pass its filters */
} CAN_USER;

typedef struct {
    RTS_UI32 unwanted; /* received frames that no user asked for: a controller with few filters lets more pass */
    RTS_UI32 bus_off;  /* times */
} CAN_BUS_COUNTERS;

/* From main. ERR_DEVICE: the controller does not exist or cannot be opened; ERR_DUPLICATE: `user` is attached already. */
RTS_RESULT CanAttach(RTS_UI32 index, CAN_USER *user);
void CanDetach(RTS_UI32 index, CAN_USER *user);

/* From main, after a user has changed its filters. Those of a user without `take_urgent` must stay as they are. */
RTS_RESULT CanUpdateFilters(RTS_UI32 index);

/* From main or a task outside of its code. An 11-bit frame that has no room now waits here, up to CAN_URGENT_FRAMES, and
 * frames of 29 bits after it; otherwise as SysCanSend. */
RTS_RESULT CanSend(RTS_UI32 index, const CAN_FRAME *frame);

/* From a task or main. True if a user reserves the identifier. */
bool CanIsReserved(RTS_UI32 index, RTS_UI32 id);

/* From main. False also for a controller that no user has. */
bool CanIsOff(RTS_UI32 index);
const CAN_BUS_COUNTERS *CanGetCounters(RTS_UI32 index);

RTS_RESULT CmpCan_Hook(CMP_HOOK hook);

#endif
