/*
 * NoGpio.c - digital lines, of a board that gives none to programs. Contract: SysGpio.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysGpio.h"

RTS_RESULT SysGpioAdd(RTS_UI32 group, RTS_UI32 number, const SYS_GPIO_LINE *line)
{
    RTS_UNUSED(group);
    RTS_UNUSED(number);
    RTS_UNUSED(line);
    return ERR_NO_OBJECT;
}

RTS_RESULT SysGpioOpen(RTS_UI32 group, RTS_UI32 outputs)
{
    RTS_UNUSED(group);
    RTS_UNUSED(outputs);
    return ERR_OK; /* a group without lines */
}

void SysGpioClose(RTS_UI32 group)
{
    RTS_UNUSED(group);
}

RTS_RESULT SysGpioPoll(RTS_UI32 group)
{
    RTS_UNUSED(group);
    return ERR_OK;
}

RTS_RESULT SysGpioRead(RTS_UI32 group, RTS_UI32 *values)
{
    RTS_UNUSED(group);
    *values = 0;
    return ERR_OK;
}

RTS_RESULT SysGpioWrite(RTS_UI32 group, RTS_UI32 mask, RTS_UI32 values)
{
    RTS_UNUSED(group);
    RTS_UNUSED(mask);
    RTS_UNUSED(values);
    return ERR_OK;
}
