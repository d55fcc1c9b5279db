/*
 * IniText.h - reads a text of sections, keys and values, line by line and without memory of its own.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 *   [Section]
 *   Key=Value
 *   ; a comment, also with # or //
 *
 * Blanks around names and values do not count; a value ends with its line, and may be empty. Lines end with LF or CR LF.
 * The text needs no NUL. From any context.
 */
#ifndef INITEXT_H
#define INITEXT_H

#include "CmpStd.h"

/* A part of the text. */
typedef struct {
    const char *text;
    RTS_UI32 size;
} INI_PART;

typedef struct {
    INI_PART rest;    /* not read yet */
    INI_PART section; /* "" before the first one */
    RTS_UI32 line;    /* read last, from 1 */
} INI_READER;

typedef enum {
    INI_END,
    INI_VALUE,
    INI_SECTION,
    INI_BAD, /* none of them: a control character, a name that is empty, no "=" */
} INI_KIND;

typedef struct {
    INI_PART key;
    INI_PART value;
} INI_ENTRY;

void IniOpen(INI_READER *reader, const char *text, RTS_UI32 size);

/* Reads up to the next line that says something, which reader->line numbers. *entry is that of INI_VALUE. */
INI_KIND IniNext(INI_READER *reader, INI_ENTRY *entry);

/* True if the part is exactly this. */
bool IniIs(const INI_PART *part, const char *text);

/* True if all of the part is a number of 32 bits: decimal, with "-" before it, or hexadecimal with 0x. */
bool IniNumber(const INI_PART *part, RTS_I32 *number);

#endif
