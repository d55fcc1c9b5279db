/*
 * FdCan.h - SysCan.h on the FDCAN controllers of STM32G0, G4, L5, U5 and H5, whose message memory has a fixed layout
 * (RM0440, chapter 44).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A board gives a table of its controllers, their clock and pins, and calls FdCanInterrupt in interrupt line 0 of each.
 * With CAN_FD 1 they also send and receive CAN FD.
 */
#ifndef FDCAN_H
#define FDCAN_H

#include "CmpStd.h"
#include "rts_config.h"

#ifndef BOARD_CAN_COUNT
#define BOARD_CAN_COUNT 1
#endif

typedef struct {
    RTS_UI32 base;
    RTS_UI32 memory; /* of its messages: SRAMCAN, 0x350 bytes for each controller */
    RTS_UI32 clock_hz;
} FDCAN;

/* Of the board. */
extern const FDCAN BoardCan[BOARD_CAN_COUNT];

/* Of the board: gives the controller its clock and pins, and enables its interrupt. */
void BoardCanStart(RTS_UI32 index);

void FdCanInterrupt(RTS_UI32 index);

#endif
