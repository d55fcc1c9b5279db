/*
 * RandomByTime.c - random numbers of a chip without a generator. A board that has one leaves this out and gives
 * SysTargetRandom and SysTargetHasGenerator itself.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "SysTarget.h"
#include "SysTime.h"

bool SysTargetHasGenerator(void)
{
    return false;
}

/* What varies is the time at which the questions come. */
RTS_UI32 SysTargetRandom(void)
{
    static RTS_UI32 pool = 0x9E3779B9u;
    pool ^= (RTS_UI32)SysTimeGetNs() + CpuNoise();
    pool ^= pool << 13;
    pool ^= pool >> 17;
    pool ^= pool << 5;
    return pool;
}
