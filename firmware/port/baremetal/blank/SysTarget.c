/*
 * SysTarget.c - the identity of this device. Contract: SysTarget.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysTarget.h"

#include <string.h>

#include "CompactDownload.h"

/* Write here: your vendor id in the high half of `id` with the device in the low one (plctool must know that pair as a
 * target), and the serial number of this very device, from its fuses or its factory sector. */
const SYS_TARGET *SysTargetGet(void)
{
    static const SYS_TARGET target = {
        .type = TARGET_TYPE_PROGRAMMABLE,
        .id = TARGET_ID_CORTEX_M3,
        .version = 0x01000000,
        .device_name = "Blank",
        .vendor_name = "Vendor",
        .node_name = "blank",
        .serial_number = "0",
    };
    return &target;
}

/* device_name is the `name` in device.toml, too. A firmware for several boards looks which one it is on. */
bool SysTargetIsBoard(const char *name)
{
    return strcmp(name, SysTargetGet()->device_name) == 0;
}

/* Write here: when start-up paints the stack of main with a pattern, how much of it is left. Not known: as it is. */
SYS_STACK SysTargetGetStack(void)
{
    return (SYS_STACK){0, 0};
}

/* Write here: the chip's random generator, or a pool that is stirred by the times of interrupts. Session ids come from
 * it, so they can be guessed when it can. */
RTS_UI32 SysTargetRandom(void)
{
    static RTS_UI32 last = 1;
    last = last * 1664525u + 1013904223u;
    return last;
}

/* Write here: true with a random generator. */
bool SysTargetHasGenerator(void)
{
    return false;
}
