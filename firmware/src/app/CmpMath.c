/*
 * CmpMath.c - the table of C functions offered to IEC code.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpMath.h"

#include <math.h>

enum { VERSION = 0x00010000 };

/* Some C libraries have a powf that is several units of the last place off. */
static float real_power(float base, float exponent)
{
    return (float)pow((double)base, (double)exponent);
}

/* The signatures are those in CmpMath.h. */
/* clang-format off */
static const CMP_EXT_FUNCTION functions[] = {
    {"sin", 0xB90BD8A4, VERSION, (RTS_PFN)sin},
    {"cos", 0xAC9E7EFF, VERSION, (RTS_PFN)cos},
    {"tan", 0x8B7BEC56, VERSION, (RTS_PFN)tan},
    {"asin", 0x681CFE01, VERSION, (RTS_PFN)asin},
    {"acos", 0x7D89585A, VERSION, (RTS_PFN)acos},
    {"atan", 0x5A6CCAF3, VERSION, (RTS_PFN)atan},
    {"exp", 0x5C0DA295, VERSION, (RTS_PFN)exp},
    {"log", 0x5D6AAAB2, VERSION, (RTS_PFN)log},
    {"log10", 0xE3684D8C, VERSION, (RTS_PFN)log10},
    {"atan2", 0x62B830F9, VERSION, (RTS_PFN)atan2},
    {"pow", 0x0909C5B0, VERSION, (RTS_PFN)pow},
    {"sinf", 0xE84B70A8, VERSION, (RTS_PFN)sinf},
    {"cosf", 0xA7C062F5, VERSION, (RTS_PFN)cosf},
    {"tanf", 0x40136184, VERSION, (RTS_PFN)tanf},
    {"asinf", 0x440A240C, VERSION, (RTS_PFN)asinf},
    {"acosf", 0x0B813651, VERSION, (RTS_PFN)acosf},
    {"atanf", 0xEC523520, VERSION, (RTS_PFN)atanf},
    {"expf", 0x3B8F4C65, VERSION, (RTS_PFN)expf},
    {"logf", 0x87F66D24, VERSION, (RTS_PFN)logf},
    {"log10f", 0x8E014356, VERSION, (RTS_PFN)log10f},
    {"atan2f", 0x8B5C7723, VERSION, (RTS_PFN)atan2f},
    {"powf", 0x4F59F748, VERSION, (RTS_PFN)real_power},
};
/* clang-format on */

RTS_RESULT CmpMath_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? CMRegisterExternal(functions, RTS_COUNT(functions)) : ERR_OK;
}
