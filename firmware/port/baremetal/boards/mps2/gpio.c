/*
 * gpio.c - the two LEDs and the two buttons of an MPS2 board: LED0, LED1, BUTTON0, BUTTON1. Contract: SysGpio.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * They are registers of the FPGA without interrupts, so there are no edges. QEMU has the LEDs; its buttons are never
 * pressed.
 */
#include <string.h>

#include "SysGpio.h"
#include "rts_config.h"

enum { LINES = 4, FIRST_BUTTON = 2 };

#define FPGA_LED (*(volatile RTS_UI32 *)0x40028000u)
#define FPGA_BUTTON (*(volatile RTS_UI32 *)0x40028008u)

/* What a group calls a line: the bit of its number; 0: it has not got it. */
static RTS_UI32 bits[IO_GPIO_GROUPS][LINES];

static RTS_UI32 active_low; /* lines, a bit each */

/* LINES when there is none of that name. */
static RTS_UI32 find(const char *name)
{
    static const char names[LINES][8] = {"LED0", "LED1", "BUTTON0", "BUTTON1"};
    RTS_UI32 i = 0;

    while (i < LINES && strncmp(names[i], name, sizeof names[i]) != 0)
        i++;
    return i;
}

static bool is_taken(RTS_UI32 i)
{
    RTS_UI32 group = 0;

    while (group < IO_GPIO_GROUPS && bits[group][i] == 0)
        group++;
    return group < IO_GPIO_GROUPS;
}

RTS_RESULT SysGpioAdd(RTS_UI32 group, RTS_UI32 number, const SYS_GPIO_LINE *line)
{
    const RTS_UI32 possible = GPIO_OPTION_ACTIVE_LOW | GPIO_OPTION_OUT;
    RTS_UI32 i = find(line->name);

    if (i == LINES)
        return ERR_NO_OBJECT;
    if (is_taken(i))
        return ERR_OPERATION_DENIED;
    if ((line->options & ~possible) != 0 || ((line->options & GPIO_OPTION_OUT) != 0) != (i < FIRST_BUTTON))
        return ERR_NOT_SUPPORTED;
    bits[group][i] = 1u << number;
    active_low &= ~(1u << i);
    active_low |= (RTS_UI32)((line->options & GPIO_OPTION_ACTIVE_LOW) != 0) << i;
    return ERR_OK;
}

RTS_RESULT SysGpioOpen(RTS_UI32 group, RTS_UI32 outputs)
{
    return SysGpioWrite(group, 0xFFFFFFFFu, outputs);
}

void SysGpioClose(RTS_UI32 group)
{
    memset(bits[group], 0, sizeof bits[group]);
}

RTS_RESULT SysGpioPoll(RTS_UI32 group)
{
    RTS_UNUSED(group);
    return ERR_OK;
}

RTS_RESULT SysGpioRead(RTS_UI32 group, RTS_UI32 *values)
{
    RTS_UI32 levels = ((FPGA_LED & 3u) | (FPGA_BUTTON & 3u) << FIRST_BUTTON) ^ active_low;
    RTS_UI32 found = 0;
    RTS_UI32 i;

    for (i = 0; i < LINES; i++) {
        if ((levels >> i & 1) != 0)
            found |= bits[group][i];
    }
    *values = found;
    return ERR_OK;
}

RTS_RESULT SysGpioWrite(RTS_UI32 group, RTS_UI32 mask, RTS_UI32 values)
{
    RTS_UI32 leds = FPGA_LED;
    RTS_UI32 i;

    for (i = 0; i < FIRST_BUTTON; i++) {
        RTS_UI32 bit = bits[group][i] & mask;
        bool is_high = ((values & bit) != 0) != ((active_low >> i & 1) != 0);
        if (bit != 0)
            leds = is_high ? leds | 1u << i : leds & ~(1u << i);
    }
    FPGA_LED = leds;
    return ERR_OK;
}
