/*
 * CmpCompilerCalls.c - what compiled code calls where the processor has no instruction: soft float and 64-bit division.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Names and meanings are those of the GNU compiler runtime, from which they come. Floating point values travel in core
 * registers, also on cores with an FPU: those are the calls the base procedure call standard has. Three components, so
 * that a device takes only what its applications need: CmpIntCalls (LINT), CmpRealCalls (REAL), CmpLrealCalls (LREAL).
 * The signature of each is the CRC-32 of its interface text, e.g. __addsf3(REAL,REAL):REAL.
 */
#include "CmpCompilerCalls.h"

#include <math.h>

/* A Cortex-M0 has no instruction for it, and the oldest processors with an operating system neither (armv7-linux). */
#if defined(__ARM_ARCH_6M__) || (defined(__ARM_ARCH_PROFILE) && __ARM_ARCH_PROFILE == 'A')
#define OFFERS_DIVISION 1
#else
#define OFFERS_DIVISION 0
#endif

enum { CALLS_VERSION = 0x00010000 };

#ifdef __ARM_ARCH_6M__
/* There libgcc has the names of the run-time ABI only. */
#define __addsf3 __aeabi_fadd
#define __subsf3 __aeabi_fsub
#define __mulsf3 __aeabi_fmul
#define __divsf3 __aeabi_fdiv
#define __unordsf2 __aeabi_fcmpun
#define __fixsfsi __aeabi_f2iz
#define __floatsisf __aeabi_i2f
#define __floatunsisf __aeabi_ui2f
#define __adddf3 __aeabi_dadd
#define __subdf3 __aeabi_dsub
#define __muldf3 __aeabi_dmul
#define __divdf3 __aeabi_ddiv
#define __unorddf2 __aeabi_dcmpun
#define __fixdfsi __aeabi_d2iz
#define __floatsidf __aeabi_i2d
#define __floatunsidf __aeabi_ui2d
#define __extendsfdf2 __aeabi_f2d
#define __truncdfsf2 __aeabi_d2f
#endif

/* Of libgcc. Only their addresses are used, so the prototypes are none. */
void __addsf3(void);
void __subsf3(void);
void __mulsf3(void);
void __divsf3(void);
void __eqsf2(void);
void __nesf2(void);
void __ltsf2(void);
void __lesf2(void);
void __gtsf2(void);
void __gesf2(void);
void __unordsf2(void);
void __fixsfsi(void);
void __fixunssfsi(void);
void __floatsisf(void);
void __floatunsisf(void);
void __adddf3(void);
void __subdf3(void);
void __muldf3(void);
void __divdf3(void);
void __eqdf2(void);
void __nedf2(void);
void __ltdf2(void);
void __ledf2(void);
void __gtdf2(void);
void __gedf2(void);
void __unorddf2(void);
void __fixdfsi(void);
void __fixunsdfsi(void);
void __floatsidf(void);
void __floatunsidf(void);
void __floatdidf(void);
void __floatundidf(void);
void __extendsfdf2(void);
void __truncdfsf2(void);

#ifdef __arm__
#define BASE_CALL __attribute__((pcs("aapcs")))
#else
#define BASE_CALL
#endif

/* ---- LINT ---- */

static RTS_I64 lint_divide(RTS_I64 a, RTS_I64 b)
{
    return a / b;
}

static RTS_I64 lint_modulo(RTS_I64 a, RTS_I64 b)
{
    return a % b;
}

static RTS_UI64 ulint_divide(RTS_UI64 a, RTS_UI64 b)
{
    return a / b;
}

static RTS_UI64 ulint_modulo(RTS_UI64 a, RTS_UI64 b)
{
    return a % b;
}

#if OFFERS_DIVISION
static RTS_I32 dint_divide(RTS_I32 a, RTS_I32 b)
{
    return a / b;
}

static RTS_I32 dint_modulo(RTS_I32 a, RTS_I32 b)
{
    return a % b;
}

static RTS_UI32 udint_divide(RTS_UI32 a, RTS_UI32 b)
{
    return a / b;
}

static RTS_UI32 udint_modulo(RTS_UI32 a, RTS_UI32 b)
{
    return a % b;
}

#endif

#ifdef __ARM_ARCH_6M__
static RTS_I32 udint_leading_zeros(RTS_UI32 value)
{
    return value != 0 ? __builtin_clz(value) : 32;
}

static RTS_I32 ulint_leading_zeros(RTS_UI64 value)
{
    return value != 0 ? __builtin_clzll(value) : 64;
}

static RTS_UI64 lint_multiply(RTS_UI64 a, RTS_UI64 b)
{
    return a * b;
}

static RTS_UI64 lint_shift_left(RTS_UI64 a, RTS_UI32 count)
{
    return a << count;
}

static RTS_UI64 ulint_shift_right(RTS_UI64 a, RTS_UI32 count)
{
    return a >> count;
}

static RTS_I64 lint_shift_right(RTS_I64 a, RTS_UI32 count)
{
    return a >> count;
}
#endif

static const CMP_EXT_FUNCTION int_calls[] = {
#if OFFERS_DIVISION
    {"__divsi3", 0xDAB9671E, CALLS_VERSION, (RTS_PFN)dint_divide},
    {"__udivsi3", 0x42186644, CALLS_VERSION, (RTS_PFN)udint_divide},
    {"__modsi3", 0xA8E7FDB1, CALLS_VERSION, (RTS_PFN)dint_modulo},
    {"__umodsi3", 0x97416208, CALLS_VERSION, (RTS_PFN)udint_modulo},
#endif
#ifdef __ARM_ARCH_6M__
    {"__muldi3", 0xFF782539, CALLS_VERSION, (RTS_PFN)lint_multiply},
    {"__ashldi3", 0xC854631C, CALLS_VERSION, (RTS_PFN)lint_shift_left},
    {"__ashrdi3", 0x316A835E, CALLS_VERSION, (RTS_PFN)lint_shift_right},
    {"__lshrdi3", 0xAAFC8B3F, CALLS_VERSION, (RTS_PFN)ulint_shift_right},
    {"__clzsi2", 0x9281B3F4, CALLS_VERSION, (RTS_PFN)udint_leading_zeros},
    {"__clzdi2", 0x5E356355, CALLS_VERSION, (RTS_PFN)ulint_leading_zeros},
#endif
    {"__divdi3", 0x9A2F73C3, CALLS_VERSION, (RTS_PFN)lint_divide},
    {"__udivdi3", 0x17519471, CALLS_VERSION, (RTS_PFN)ulint_divide},
    {"__moddi3", 0xE871E96C, CALLS_VERSION, (RTS_PFN)lint_modulo},
    {"__umoddi3", 0xC208903D, CALLS_VERSION, (RTS_PFN)ulint_modulo},
};

RTS_RESULT CmpIntCalls_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? CMRegisterExternal(int_calls, RTS_COUNT(int_calls)) : ERR_OK;
}

/* ---- REAL ---- */

/* The C library goes through LREAL for this, which costs two kilobytes. What does not fit gives 0. */
static RTS_UI64 real_to_ulint(RTS_UI32 bits)
{
    RTS_UI32 exponent = bits >> 23 & 0xFF;
    RTS_UI64 mantissa = (bits & 0x7FFFFF) | 0x800000;

    if (exponent < 127 || exponent > 127 + 63)
        return 0;
    return exponent < 150 ? mantissa >> (150 - exponent) : mantissa << (exponent - 150);
}

static RTS_I64 real_to_lint(RTS_UI32 bits)
{
    RTS_I64 magnitude = (RTS_I64)real_to_ulint(bits);

    return bits >> 31 ? -magnitude : magnitude;
}

static BASE_CALL RTS_REAL32 lint_to_real(RTS_I64 value)
{
    return (RTS_REAL32)value;
}

static BASE_CALL RTS_REAL32 ulint_to_real(RTS_UI64 value)
{
    return (RTS_REAL32)value;
}

#ifndef __ARM_FP
static RTS_REAL32 real_sqrt(RTS_REAL32 value)
{
    return sqrtf(value);
}
#endif

static const CMP_EXT_FUNCTION real_calls[] = {
    {"__fixsfdi", 0xE0DF499C, CALLS_VERSION, (RTS_PFN)real_to_lint},
    {"__fixunssfdi", 0x87F7DAF4, CALLS_VERSION, (RTS_PFN)real_to_ulint},
    {"__floatdisf", 0x6B4A5F99, CALLS_VERSION, (RTS_PFN)lint_to_real},
    {"__floatundisf", 0x55D576F3, CALLS_VERSION, (RTS_PFN)ulint_to_real},
#ifndef __ARM_FP
    {"sqrtf", 0x2AD9491D, CALLS_VERSION, (RTS_PFN)real_sqrt},
    {"__addsf3", 0x2D9644EB, CALLS_VERSION, (RTS_PFN)__addsf3},
    {"__subsf3", 0xFA2CCB8D, CALLS_VERSION, (RTS_PFN)__subsf3},
    {"__mulsf3", 0x8191B62B, CALLS_VERSION, (RTS_PFN)__mulsf3},
    {"__divsf3", 0xE4C6E0D1, CALLS_VERSION, (RTS_PFN)__divsf3},
    {"__eqsf2", 0x9723C695, CALLS_VERSION, (RTS_PFN)__eqsf2},
    {"__nesf2", 0x67E40D7C, CALLS_VERSION, (RTS_PFN)__nesf2},
    {"__ltsf2", 0x06819C62, CALLS_VERSION, (RTS_PFN)__ltsf2},
    {"__lesf2", 0x83200C01, CALLS_VERSION, (RTS_PFN)__lesf2},
    {"__gtsf2", 0x586D17F7, CALLS_VERSION, (RTS_PFN)__gtsf2},
    {"__gesf2", 0xDDCC8794, CALLS_VERSION, (RTS_PFN)__gesf2},
    {"__unordsf2", 0xB7ED322C, CALLS_VERSION, (RTS_PFN)__unordsf2},
    {"__fixsfsi", 0xEC1FC1F1, CALLS_VERSION, (RTS_PFN)__fixsfsi},
    {"__fixunssfsi", 0x413C64B7, CALLS_VERSION, (RTS_PFN)__fixunssfsi},
    {"__floatsisf", 0xA7FE8F38, CALLS_VERSION, (RTS_PFN)__floatsisf},
    {"__floatunsisf", 0x5DDCF0EC, CALLS_VERSION, (RTS_PFN)__floatunsisf},
#endif
};

RTS_RESULT CmpRealCalls_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? CMRegisterExternal(real_calls, RTS_COUNT(real_calls)) : ERR_OK;
}

/* ---- LREAL ---- */

static BASE_CALL RTS_I64 lreal_to_lint(RTS_REAL64 value)
{
    return (RTS_I64)value;
}

static BASE_CALL RTS_UI64 lreal_to_ulint(RTS_REAL64 value)
{
    return (RTS_UI64)value;
}

static BASE_CALL RTS_REAL64 lreal_sqrt(RTS_REAL64 value)
{
    return sqrt(value);
}

#if defined(__arm__) && !defined(__ARM_ARCH_6M__)
/*
 * The sum in libgcc of Armv7-M loses a bit when the signs differ, the exponents are FAR apart, and the result has a
 * smaller exponent than the larger operand: 4294967295.5 - 18446744073709551616.0 is one unit off. Here that case is
 * right.
 */
enum { FAR = 33, MANTISSA_BITS = 52, GUARD_BITS = 3, EXPONENTS = 0x7FF };

typedef union {
    RTS_REAL64 value;
    RTS_UI64 bits;
} LREAL_BITS;

static RTS_I32 lreal_exponent(LREAL_BITS x)
{
    return (RTS_I32)(x.bits >> MANTISSA_BITS & EXPONENTS);
}

/* With GUARD_BITS zeros after it. */
static RTS_UI64 lreal_mantissa(LREAL_BITS x)
{
    RTS_UI64 one = (RTS_UI64)1 << MANTISSA_BITS;

    return ((x.bits & (one - 1)) | (lreal_exponent(x) != 0 ? one : 0)) << GUARD_BITS;
}

/* `large` minus the magnitude of `small`, which is FAR below: what is lost of it remains as one sticky bit. */
static RTS_REAL64 lreal_reduce(LREAL_BITS large, LREAL_BITS small)
{
    RTS_UI64 mantissa = lreal_mantissa(small);
    RTS_UI64 sticky = (mantissa & (((RTS_UI64)1 << FAR) - 1)) != 0;
    RTS_UI64 exponent = (RTS_UI64)lreal_exponent(large);

    mantissa = lreal_mantissa(large) - (mantissa >> FAR | sticky);
    if (mantissa >> (MANTISSA_BITS + GUARD_BITS) == 0) {
        mantissa <<= 1;
        exponent--;
    }
    mantissa = (mantissa + 3 + (mantissa >> GUARD_BITS & 1)) >> GUARD_BITS; /* to nearest, halves to even */
    large.bits &= (RTS_UI64)1 << 63;
    large.bits += ((exponent - 1) << MANTISSA_BITS) + mantissa; /* adds the leading 1, and a carry from rounding */
    return large.value;
}

static BASE_CALL RTS_REAL64 lreal_add(RTS_REAL64 a, RTS_REAL64 b)
{
    LREAL_BITS x = {a};
    LREAL_BITS y = {b};
    RTS_I32 x_exponent = lreal_exponent(x);
    RTS_I32 y_exponent = lreal_exponent(y);
    RTS_I32 distance = (x_exponent != 0 ? x_exponent : 1) - (y_exponent != 0 ? y_exponent : 1);

    if ((distance != FAR && distance != -FAR) || (x.bits ^ y.bits) >> 63 == 0 || x_exponent == EXPONENTS ||
        y_exponent == EXPONENTS)
        return a + b;
    return distance > 0 ? lreal_reduce(x, y) : lreal_reduce(y, x);
}

static BASE_CALL RTS_REAL64 lreal_subtract(RTS_REAL64 a, RTS_REAL64 b)
{
    return lreal_add(a, -b);
}

#define LREAL_ADD lreal_add
#define LREAL_SUBTRACT lreal_subtract
#else
#define LREAL_ADD __adddf3
#define LREAL_SUBTRACT __subdf3
#endif

static const CMP_EXT_FUNCTION lreal_calls[] = {
    {"__fixdfdi", 0x0B7A9758, CALLS_VERSION, (RTS_PFN)lreal_to_lint},
    {"__fixunsdfdi", 0x71038A92, CALLS_VERSION, (RTS_PFN)lreal_to_ulint},
    {"sqrt", 0x02C20D9E, CALLS_VERSION, (RTS_PFN)lreal_sqrt},
    {"__adddf3", 0x9824AF08, CALLS_VERSION, (RTS_PFN)LREAL_ADD},
    {"__subdf3", 0x43D1C65B, CALLS_VERSION, (RTS_PFN)LREAL_SUBTRACT},
    {"__muldf3", 0xB1652F78, CALLS_VERSION, (RTS_PFN)__muldf3},
    {"__divdf3", 0x10D8E79E, CALLS_VERSION, (RTS_PFN)__divdf3},
    {"__eqdf2", 0x4A287FAE, CALLS_VERSION, (RTS_PFN)__eqdf2},
    {"__nedf2", 0xC922DCF4, CALLS_VERSION, (RTS_PFN)__nedf2},
    {"__ltdf2", 0x9A6B219C, CALLS_VERSION, (RTS_PFN)__ltdf2},
    {"__ledf2", 0x24B40F1D, CALLS_VERSION, (RTS_PFN)__ledf2},
    {"__gtdf2", 0xEC375B87, CALLS_VERSION, (RTS_PFN)__gtdf2},
    {"__gedf2", 0x52E87506, CALLS_VERSION, (RTS_PFN)__gedf2},
    {"__unorddf2", 0xC5FF7C94, CALLS_VERSION, (RTS_PFN)__unorddf2},
    {"__fixdfsi", 0xCDB1291B, CALLS_VERSION, (RTS_PFN)__fixdfsi},
    {"__fixunsdfsi", 0x6BD43228, CALLS_VERSION, (RTS_PFN)__fixunsdfsi},
    {"__floatsidf", 0x260BA2DF, CALLS_VERSION, (RTS_PFN)__floatsidf},
    {"__floatunsidf", 0x7B539094, CALLS_VERSION, (RTS_PFN)__floatunsidf},
    {"__floatdidf", 0x87168571, CALLS_VERSION, (RTS_PFN)__floatdidf},
    {"__floatundidf", 0xF65394E7, CALLS_VERSION, (RTS_PFN)__floatundidf},
    {"__extendsfdf2", 0x25FA0353, CALLS_VERSION, (RTS_PFN)__extendsfdf2},
    {"__truncdfsf2", 0xAFFF5D12, CALLS_VERSION, (RTS_PFN)__truncdfsf2},
};

RTS_RESULT CmpLrealCalls_Hook(CMP_HOOK hook)
{
    return hook == CH_INIT3 ? CMRegisterExternal(lreal_calls, RTS_COUNT(lreal_calls)) : ERR_OK;
}
