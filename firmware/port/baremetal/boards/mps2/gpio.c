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

/* What the group says of a line. */
static struct {
    RTS_UI8 user; /* group + 1; 0: free */
    RTS_UI8 number;
} lines[LINES];

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

RTS_RESULT SysGpioAdd(RTS_UI32 group, RTS_UI32 number, const SYS_GPIO_LINE *line)
{
    const RTS_UI32 possible = GPIO_OPTION_ACTIVE_LOW | GPIO_OPTION_OUT;
    RTS_UI32 i = find(line->name);

    if (i == LINES)
        return ERR_NO_OBJECT;
    if (lines[i].user != 0)
        return ERR_OPERATION_DENIED;
    if ((line->options & ~possible) != 0 || ((line->options & GPIO_OPTION_OUT) != 0) != (i < FIRST_BUTTON))
        return ERR_NOT_SUPPORTED;
    lines[i].user = (RTS_UI8)(group + 1);
    lines[i].number = (RTS_UI8)number;
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
    RTS_UI32 i;

    for (i = 0; i < LINES; i++) {
        if (lines[i].user == group + 1)
            lines[i].user = 0;
    }
}

void SysGpioPoll(void)
{
}

RTS_RESULT SysGpioRead(RTS_UI32 group, RTS_UI32 *values)
{
    RTS_UI32 levels = ((FPGA_LED & 3u) | (FPGA_BUTTON & 3u) << FIRST_BUTTON) ^ active_low;
    RTS_UI32 found = 0;
    RTS_UI32 i;

    for (i = 0; i < LINES; i++, levels >>= 1) {
        if (lines[i].user == group + 1)
            found |= (levels & 1) << lines[i].number;
    }
    *values = found;
    return ERR_OK;
}

RTS_RESULT SysGpioWrite(RTS_UI32 group, RTS_UI32 mask, RTS_UI32 values)
{
    RTS_UI32 leds = FPGA_LED;
    RTS_UI32 i;

    for (i = 0; i < FIRST_BUTTON; i++) {
        RTS_UI32 number = lines[i].number;
        RTS_UI32 level = (values >> number ^ active_low >> i) & 1;
        if (lines[i].user == group + 1 && (mask >> number & 1) != 0)
            leds = (leds & ~(1u << i)) | level << i;
    }
    FPGA_LED = leds;
    return ERR_OK;
}
