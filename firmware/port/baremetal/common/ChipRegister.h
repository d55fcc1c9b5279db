/*
 * ChipRegister.h - registers of a chip's peripherals, for drivers that are tested on a model of them.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CHIPREGISTER_H
#define CHIPREGISTER_H

#include "CmpStd.h"

#ifdef CHIP_REGISTER_MODEL
RTS_UI32 ChipRead(RTS_UI32 address);
void ChipWrite(RTS_UI32 address, RTS_UI32 value);
#else
static inline RTS_UI32 ChipRead(RTS_UI32 address)
{
    return *(volatile RTS_UI32 *)(uintptr_t)address;
}

static inline void ChipWrite(RTS_UI32 address, RTS_UI32 value)
{
    *(volatile RTS_UI32 *)(uintptr_t)address = value;
}
#endif

static inline void ChipSet(RTS_UI32 address, RTS_UI32 bits)
{
    ChipWrite(address, ChipRead(address) | bits);
}

static inline void ChipClear(RTS_UI32 address, RTS_UI32 bits)
{
    ChipWrite(address, ChipRead(address) & ~bits);
}

/* False if `bits` do not become `value` within some 10 ms. */
static inline bool ChipWaitFor(RTS_UI32 address, RTS_UI32 bits, RTS_UI32 value)
{
    enum { TRIES = 100000 };

    for (RTS_UI32 i = 0; i < TRIES; i++)
        if ((ChipRead(address) & bits) == value)
            return true;
    return false;
}

#endif
