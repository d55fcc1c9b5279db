/*
 * IniText.c - reads a text of sections, keys and values.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IniText.h"

#include <string.h>

static const char mark[] = "\xEF\xBB\xBF"; /* of UTF-8; some editors write it */

void IniOpen(INI_READER *reader, const char *text, RTS_UI32 size)
{
    RTS_UI32 skip = size >= sizeof mark - 1 && memcmp(text, mark, sizeof mark - 1) == 0 ? sizeof mark - 1 : 0;

    memset(reader, 0, sizeof *reader);
    reader->rest.text = text + skip;
    reader->rest.size = size - skip;
    reader->section.text = text;
}

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

static INI_PART trimmed(const char *text, RTS_UI32 size)
{
    INI_PART part;

    while (size > 0 && is_blank(*text)) {
        text++;
        size--;
    }
    while (size > 0 && is_blank(text[size - 1]))
        size--;
    part.text = text;
    part.size = size;
    return part;
}

static INI_PART next_line(INI_READER *reader)
{
    INI_PART *rest = &reader->rest;
    RTS_UI32 size = 0;
    INI_PART line;

    while (size < rest->size && rest->text[size] != '\n')
        size++;
    line = trimmed(rest->text, size);
    if (size < rest->size)
        size++;
    rest->text += size;
    rest->size -= size;
    reader->line++;
    return line;
}

static bool is_comment(const INI_PART *line)
{
    return line->size == 0 || line->text[0] == ';' || line->text[0] == '#' ||
           (line->size >= 2 && line->text[0] == '/' && line->text[1] == '/');
}

static bool has_controls(const INI_PART *line)
{
    RTS_UI32 i;

    for (i = 0; i < line->size; i++) {
        if ((unsigned char)line->text[i] < ' ' && line->text[i] != '\t')
            return true;
    }
    return false;
}

static INI_KIND read_section(INI_READER *reader, const INI_PART *line)
{
    if (line->text[line->size - 1] != ']')
        return INI_BAD;
    reader->section = trimmed(line->text + 1, line->size - 2);
    return reader->section.size > 0 ? INI_SECTION : INI_BAD;
}

static INI_KIND read_entry(const INI_PART *line, INI_ENTRY *entry)
{
    RTS_UI32 equals = 0;

    while (equals < line->size && line->text[equals] != '=')
        equals++;
    if (equals == line->size)
        return INI_BAD;
    entry->key = trimmed(line->text, equals);
    entry->value = trimmed(line->text + equals + 1, line->size - equals - 1);
    return entry->key.size > 0 ? INI_VALUE : INI_BAD;
}

INI_KIND IniNext(INI_READER *reader, INI_ENTRY *entry)
{
    INI_PART line;

    do {
        if (reader->rest.size == 0)
            return INI_END;
        line = next_line(reader);
    } while (is_comment(&line));
    if (has_controls(&line))
        return INI_BAD;
    return line.text[0] == '[' ? read_section(reader, &line) : read_entry(&line, entry);
}

bool IniIs(const INI_PART *part, const char *text)
{
    return strlen(text) == part->size && memcmp(part->text, text, part->size) == 0;
}

/* 255 for what is not a digit. */
static RTS_UI32 digit(char c)
{
    if (c >= '0' && c <= '9')
        return (RTS_UI32)(c - '0');
    c |= 0x20;
    return c >= 'a' && c <= 'f' ? (RTS_UI32)(c - 'a') + 10 : 255;
}

bool IniNumber(const INI_PART *part, RTS_I32 *number)
{
    bool negative = part->size > 0 && part->text[0] == '-';
    bool hex = !negative && part->size > 2 && part->text[0] == '0' && (part->text[1] | 0x20) == 'x';
    RTS_UI32 base = hex ? 16 : 10;
    RTS_UI32 at = hex ? 2 : (RTS_UI32)negative;
    RTS_I64 value = 0;

    if (at == part->size)
        return false;
    for (; at < part->size; at++) {
        RTS_UI32 next = digit(part->text[at]);
        value = value * (RTS_I64)base + (RTS_I64)next;
        if (next >= base || value > (RTS_I64)INT32_MAX + (negative ? 1 : 0))
            return false;
    }
    *number = (RTS_I32)(negative ? -value : value);
    return true;
}
