/*
 * IecCan.h - CAN frames of the program: the blocks CAN_SEND and CAN_RECEIVE of the library. docs/can.md.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Data goes by value and from hand to hand by the state of a slot, without a lock: a task may be aborted at any place, and
 * no address of the program is kept. CAN_MAX_RECEIVERS of rts_config.h: 0 leaves it out, and programs with such
 * blocks are refused.
 */
#ifndef IECCAN_H
#define IECCAN_H

#include "CmpItf.h"

/* ErrorID of the blocks. */
enum {
    CAN_ERROR_NO_NETWORK = 0x201, /* this device has no such controller, or it is away */
    CAN_ERROR_RESERVED = 0x202,   /* the identifier is one of the tools' or of CANopen */
    CAN_ERROR_INVALID = 0x203,    /* identifier or length */
    CAN_ERROR_NO_ROOM = 0x204,    /* as many frames wait, or receivers are used, as there may be: again later */
    CAN_ERROR_BUS_OFF = 0x205,
    CAN_ERROR_CANCELLED = 0x206, /* the program was stopped */
};

#ifndef RTS_CFFI
/* From main: frames wait for its next pass, or filters do. */
bool IecCanWaits(void);

RTS_RESULT IecCan_Hook(CMP_HOOK hook);
#endif

#endif
