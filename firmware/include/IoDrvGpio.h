/*
 * IoDrvGpio.h - driver of the board's own digital inputs and outputs: its parameters (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A connector of it (CT_MASTER, driver "IoDrvGpio") has up to IO_GPIO_LINES lines, numbered from 0. Line n has the
 * parameters GPIO_LINE + n and, as needed, GPIO_OPTIONS + n and GPIO_EVENT + n. Channels are bits of GPIO_INPUTS and
 * GPIO_OUTPUTS: bit n is line n. Lines next to each other, inputs as well as outputs, may be one channel.
 */
#ifndef IODRVGPIO_H
#define IODRVGPIO_H

#include "CmpStd.h"

enum {
    GPIO_INPUTS = 1,
    GPIO_OUTPUTS = 2,
    GPIO_LINE = 0x1000,    /* name of the line on the board, a text: "DI0", "gpiochip0:17", "PA5" */
    GPIO_OPTIONS = 0x2000, /* GPIO_OPTION_*; without it a plain input */
    GPIO_EVENT = 0x3000,   /* name of the external event that its edges post, a text */
    IO_GPIO_LINES = 32,    /* of one connector */
};

enum {
    GPIO_OPTION_OUT = 0x01, /* an output */
    GPIO_OPTION_PULL_UP = 0x02,
    GPIO_OPTION_PULL_DOWN = 0x04,
    GPIO_OPTION_ACTIVE_LOW = 0x08, /* TRUE is low */
    GPIO_OPTION_RISING = 0x10,     /* its event is posted when it becomes TRUE */
    GPIO_OPTION_FALLING = 0x20,    /* and when it becomes FALSE */
    GPIO_OPTION_OPEN_DRAIN = 0x40, /* TRUE, or with ACTIVE_LOW FALSE: not driven */
};

#ifndef RTS_CFFI
#include "CmpItf.h"
RTS_RESULT IoDrvGpio_Hook(CMP_HOOK hook);
#endif

#endif
