/*
 * BxCan.h - SysCan.h on the bxCAN controllers of STM32F0 to F4 and L4 (RM0090, chapter 32; RM0008, chapter 24).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A board gives a table of its controllers, their clock and pins, and calls BxCanInterrupt in the interrupts TX, RX0 and
 * RX1 of each. The one for errors is not needed.
 */
#ifndef BXCAN_H
#define BXCAN_H

#include "CmpStd.h"
#include "rts_config.h"

#ifndef BOARD_CAN_COUNT
#define BOARD_CAN_COUNT 1
#endif

typedef struct {
    RTS_UI32 base;
    RTS_UI32 clock_hz;   /* of APB1 */
    RTS_UI32 filters;    /* base of the controller that has the filters: the first one of a pair, or `base` */
    RTS_UI8 first_bank;  /* of its filters */
    RTS_UI8 bank_count;  /* of 14, or 28 of a pair */
    RTS_UI8 second_bank; /* the first bank of the second controller of the pair, CAN2SB; 0: there is none */
} BXCAN;

/* Of the board: BOARD_CAN_COUNT of them. */
extern const BXCAN BoardCan[BOARD_CAN_COUNT];

/* Of the board: gives the controller its clock and pins, and enables its interrupts. */
void BoardCanStart(RTS_UI32 index);

void BxCanInterrupt(RTS_UI32 index);

#endif
