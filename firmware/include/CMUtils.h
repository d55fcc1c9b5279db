/*
 * CMUtils.h - text without stdio, so that bare metal needs none.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CMUTILS_H
#define CMUTILS_H

#include <stdarg.h>

#include "CmpStd.h"

/*
 * Formats into `out`, always NUL-terminated and cut to `size` bytes (at least 1). Understands %s, %d (int), %u, %X and %x
 * (unsigned, the latter two the same: always eight digits), %%. Any other conversion, such as %ld or %5d, and what
 * follows it stand in the result as they are written. Returns the length of the result. From any context.
 */
RTS_SIZE CMUtlvsnprintf(char *out, RTS_SIZE size, const char *format, va_list arguments) RTS_FORMAT(3, 0);
RTS_SIZE CMUtlsnprintf(char *out, RTS_SIZE size, const char *format, ...) RTS_FORMAT(3, 4);

/* Length of a text that may be cut: at most `max`. */
RTS_UI32 CMUtlStrNLen(const char *text, RTS_UI32 max);

/* Writes `length` characters as UTF-16LE and a NUL; returns their end. */
RTS_UI8 *CMUtlPutWide(RTS_UI8 *place, const char *text, RTS_UI32 length);

#endif
