/*
 * CmpMath.h - C functions offered to IEC code: transcendental functions, numbers to text and back.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Each line is one external function: zlib CRC-32 of the interface text (its signature), and the text. Library version 1.0
 * (0x00010000) for all. The standard library (host/plctool/stdlib) declares them under the same names; tests/c/test_math.c
 * recomputes the CRCs. A STRING by reference travels as (pointer, u32 capacity in characters without the NUL).
 *
 *   0xB90BD8A4  sin(LREAL):LREAL            0xE84B70A8  sinf(REAL):REAL
 *   0xAC9E7EFF  cos(LREAL):LREAL            0xA7C062F5  cosf(REAL):REAL
 *   0x8B7BEC56  tan(LREAL):LREAL            0x40136184  tanf(REAL):REAL
 *   0x681CFE01  asin(LREAL):LREAL           0x440A240C  asinf(REAL):REAL
 *   0x7D89585A  acos(LREAL):LREAL           0x0B813651  acosf(REAL):REAL
 *   0x5A6CCAF3  atan(LREAL):LREAL           0xEC523520  atanf(REAL):REAL
 *   0x474A2976  ln(LREAL):LREAL             0x7DA1D430  lnf(REAL):REAL        natural logarithm
 *   0x5D6AAAB2  log(LREAL):LREAL            0x87F66D24  logf(REAL):REAL       base 10, as IEC has it
 *   0x5C0DA295  exp(LREAL):LREAL            0x3B8F4C65  expf(REAL):REAL
 *   0x0909C5B0  pow(LREAL,LREAL):LREAL      0x4F59F748  powf(REAL,REAL):REAL  EXPT
 *   0x62B830F9  atan2(LREAL,LREAL):LREAL    0x8B5C7723  atan2f(REAL,REAL):REAL
 *   0xA0BD02CA  lrealtostr(LREAL,&STRING):UDINT
 *   0xA9AE2FC0  realtostr(REAL,&STRING):UDINT
 *   0xC640D795  strtolreal(&STRING):LREAL
 *   0x5D9F3612  strtoreal(&STRING):REAL
 *
 * All are pure: no state, no lock, no allocation, the same from any task, so the watchdog may break into them. Arguments
 * outside a function's domain give NaN or infinity as IEEE 754 says, never an exception.
 */
#ifndef CMPMATH_H
#define CMPMATH_H

#include "CmpItf.h"

enum {
    MATH_VERSION = 0x00010000,
    MATH_TEXT_MAX = 24, /* longest text of a number, without the NUL: a STRING[24] always suffices */
};

/*
 * Writes the shortest decimal that reads back as `value`, in the form of an IEC literal: 0.1, -25.0, 1.0E21, 5.0E-324;
 * INF, -INF and NAN for what is no number. Returns its length. A text of more than `capacity` characters would be a
 * wrong number when cut: then the result is "" and 0. `text` holds capacity + 1 bytes.
 */
RTS_UI32 MathLrealToText(RTS_REAL64 value, char *text, RTS_UI32 capacity);
RTS_UI32 MathRealToText(RTS_REAL32 value, char *text, RTS_UI32 capacity);

/*
 * Reads the number at the start of `text` (at most `capacity` characters or up to the NUL), correctly rounded for up to
 * 100 digits: blanks, sign, digits with an optional point, optional exponent. What follows is ignored; 0.0 when there is
 * no number; infinity when it is too large.
 */
RTS_REAL64 MathTextToLreal(const char *text, RTS_UI32 capacity);
RTS_REAL32 MathTextToReal(const char *text, RTS_UI32 capacity);

/* Registers the functions above in CH_INIT3. */
RTS_RESULT CmpMath_Hook(CMP_HOOK hook);

#endif
