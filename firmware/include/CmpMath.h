/*
 * CmpMath.h - C functions offered to IEC code: what is not reasonable to write in ST.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * External functions by their C names: zlib CRC-32 of the interface text (the signature), and the text. The standard
 * library (host/plctool/stdlib/math.st) declares them under these names; tests/c/test_math.c recomputes the CRCs.
 *
 *   0xB90BD8A4  sin(LREAL):LREAL           0xE84B70A8  sinf(REAL):REAL
 *   0xAC9E7EFF  cos(LREAL):LREAL           0xA7C062F5  cosf(REAL):REAL
 *   0x8B7BEC56  tan(LREAL):LREAL           0x40136184  tanf(REAL):REAL
 *   0x681CFE01  asin(LREAL):LREAL          0x440A240C  asinf(REAL):REAL
 *   0x7D89585A  acos(LREAL):LREAL          0x0B813651  acosf(REAL):REAL
 *   0x5A6CCAF3  atan(LREAL):LREAL          0xEC523520  atanf(REAL):REAL
 *   0x5C0DA295  exp(LREAL):LREAL           0x3B8F4C65  expf(REAL):REAL
 *   0x5D6AAAB2  log(LREAL):LREAL           0x87F66D24  logf(REAL):REAL            natural logarithm, LN
 *   0xE3684D8C  log10(LREAL):LREAL         0x8E014356  log10f(REAL):REAL          LOG
 *   0x62B830F9  atan2(LREAL,LREAL):LREAL   0x8B5C7723  atan2f(REAL,REAL):REAL
 *   0x0909C5B0  pow(LREAL,LREAL):LREAL     0x4F59F748  powf(REAL,REAL):REAL       EXPT
 *
 * All are pure: no lock, no allocation, the same from any task, so the watchdog may abort them. Arguments
 * outside a function's domain give NaN or infinity as IEEE 754 says, never an exception. Library version 1.0.
 */
#ifndef CMPMATH_H
#define CMPMATH_H

#include "CmpItf.h"

/* Registers the functions in CH_INIT3. */
RTS_RESULT CmpMath_Hook(CMP_HOOK hook);

#endif
