/*
 * SimSram.c - RAM of the simulated device that keeps its content while the power is off.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "Sim.h"
#include "SysSram.h"
#include "rts_config.h"

enum { MOST = 16384 };

static union {
    RTS_UI64 aligned;
    RTS_UI8 bytes[MOST];
} content;
static RTS_UI32 present;

void SimSetSram(RTS_UI32 size)
{
    present = size < MOST ? size : MOST;
    memset(content.bytes, 0xA5, sizeof content.bytes);
}

RTS_UI8 *SysSramGet(RTS_UI32 *size)
{
    *size = present;
    return content.bytes;
}
