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

/* True if the condition (0 .. 15) of an instruction holds with these flags. Each pair of conditions, of which the odd one is
 * the opposite, has a bit for every value of NZCV. */
static inline bool ArmConditionHolds(RTS_UI32 condition, RTS_UI32 flags)
{
    static const RTS_UI16 holds[] = {
        0xF0F0, /* EQ: Z */
        0xCCCC, /* CS: C */
        0xFF00, /* MI: N */
        0xAAAA, /* VS: V */
        0x0C0C, /* HI: C and not Z */
        0xAA55, /* GE: N is V */
        0x0A05, /* GT: N is V, and not Z */
        0xFFFF, /* always */
    };
    return condition == 15 || (holds[condition >> 1] >> (flags >> 28) & 1u) != (condition & 1);
}

#endif
