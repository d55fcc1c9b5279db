/*
 * SysGpio.c - digital lines of the board. Contract: SysGpio.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysGpio.h"

/* Write here: look the name up among the lines of your board, refuse what the pin cannot do or another line has, keep
 * group, number and options. Touch no pin yet. A line with GPIO_OPTION_RISING or _FALLING posts line->event from its
 * interrupt (SchedPostExternalEvent), or from SysGpioPoll. */
RTS_RESULT SysGpioAdd(RTS_UI32 group, RTS_UI32 number, const SYS_GPIO_LINE *line)
{
    RTS_UNUSED(group);
    RTS_UNUSED(number);
    RTS_UNUSED(line);
    return ERR_NO_OBJECT;
}

/* Write here: set the outputs' registers to these values first, then make them outputs; then pulls and interrupts. */
RTS_RESULT SysGpioOpen(RTS_UI32 group, RTS_UI32 outputs)
{
    RTS_UNUSED(group);
    RTS_UNUSED(outputs);
    return ERR_OK;
}

/* Write here: inputs without interrupts again, and forget the lines of the group. */
void SysGpioClose(RTS_UI32 group)
{
    RTS_UNUSED(group);
}

/* Write here, where pins have no interrupts: look for edges; ERR_DEVICE if the lines are on a chip that has gone. */
RTS_RESULT SysGpioPoll(RTS_UI32 group)
{
    RTS_UNUSED(group);
    return ERR_OK;
}

/* Write here: the levels, by the lines' numbers, turned round for GPIO_OPTION_ACTIVE_LOW. */
RTS_RESULT SysGpioRead(RTS_UI32 group, RTS_UI32 *values)
{
    RTS_UNUSED(group);
    *values = 0;
    return ERR_OK;
}

/* Write here: those in `mask`, by registers that set and clear bits, since other groups may share a port. */
RTS_RESULT SysGpioWrite(RTS_UI32 group, RTS_UI32 mask, RTS_UI32 values)
{
    RTS_UNUSED(group);
    RTS_UNUSED(mask);
    RTS_UNUSED(values);
    return ERR_OK;
}
