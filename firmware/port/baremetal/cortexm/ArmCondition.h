/*
 * ArmCondition.h - the conditions of Arm's instructions.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Shared by all Arm processors, also those with Linux: the flags N, Z, C and V are bits 31 to 28 of CPSR, PSTATE and xPSR.
 */
#ifndef ARMCONDITION_H
#define ARMCONDITION_H

#include "CmpStd.h"

/* True if the condition (0 .. 15) of an instruction holds with these flags. */
static inline bool ArmConditionHolds(RTS_UI32 condition, RTS_UI32 flags)
{
    bool n = (flags >> 31 & 1) != 0, z = (flags >> 30 & 1) != 0, c = (flags >> 29 & 1) != 0, v = (flags >> 28 & 1) != 0;
    const bool holds[] = {z, c, n, v, c && !z, n == v, n == v && !z, true};
    return condition == 15 || holds[condition >> 1] != ((condition & 1) != 0);
}

#endif
