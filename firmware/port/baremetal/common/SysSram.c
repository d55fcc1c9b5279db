/*
 * SysSram.c - RAM that outlasts a reset, as a stand-in for one with a battery: for a board where all RAM does.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The start-up code does not clear it. A board with backup RAM has its own file, which returns its address.
 */
#include "SysSram.h"

#include "rts_config.h"

#if APP_RETAIN_SRAM

enum { HEADS = 64 };

__attribute__((section(".noinit"), aligned(8))) static RTS_UI8 content[2 * (APP_RETAIN_SIZE + HEADS)];

RTS_UI8 *SysSramGet(RTS_UI32 *size)
{
    *size = sizeof content;
    return content;
}

#endif
