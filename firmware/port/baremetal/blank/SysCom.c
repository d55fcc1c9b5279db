/*
 * SysCom.c - serial lines. Contract: SysCom.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysCom.h"

/* Write here: how many lines there are. */
RTS_UI32 SysComGetCount(void)
{
    return 0;
}

/* Write here: baud rate and pins, empty both ring buffers and the FIFOs of the hardware (bytes that came while no one
 * listened may hold back the interrupt of the next one), switch the receive interrupt on. That interrupt has to be
 * above all tasks, else a long cycle loses bytes. */
RTS_RESULT SysComOpen(RTS_UI32 index)
{
    RTS_UNUSED(index);
    return ERR_DEVICE;
}

/* Write here: switch the line off. */
void SysComClose(RTS_UI32 index)
{
    RTS_UNUSED(index);
}

/* Write here: take what the receive interrupt has put in the ring; never wait. */
RTS_UI32 SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UNUSED(index);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    return 0;
}

/* Write here: put as much as fits in the ring of the transmit interrupt and start it; never wait. */
RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UNUSED(index);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    return 0;
}

/* Write here, for a field bus: find the line of this name; ERR_DUPLICATE if it is open, so that no application takes the
 * line that the tool uses; else do what SysComOpen does with these settings. With rs485 the port drives the bus from the
 * first start bit to the last stop bit: take it back in the interrupt that comes when the shift register is empty, not
 * when the data register is. */
RTS_RESULT SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index)
{
    RTS_UNUSED(name);
    RTS_UNUSED(settings);
    RTS_UNUSED(index);
    return ERR_NO_OBJECT;
}

/* Of a UART the bytes leave by themselves: nothing to do. */
void SysComDiscard(RTS_UI32 index)
{
    RTS_UNUSED(index);
}

/* Write here, for a field bus: what SysTimeGetNs was in the last receive interrupt. */
RTS_I64 SysComGetByteNs(RTS_UI32 index)
{
    RTS_UNUSED(index);
    return 0;
}
