/*
 * CMUtils.c - text without stdio.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CMUtils.h"

#include "CmpBytes.h"

typedef struct {
    char *text;
    RTS_SIZE size;
    RTS_SIZE length;
} OUTPUT;

static void put_char(OUTPUT *out, char c)
{
    if (out->length + 1 < out->size)
        out->text[out->length++] = c;
}

static void put_string(OUTPUT *out, const char *s)
{
    while (*s != '\0')
        put_char(out, *s++);
}

enum { HEX_DIGITS = 8 };

/* Hexadecimal numbers are CRCs, places and numbers of devices: they are as long everywhere. */
static void put_number(OUTPUT *out, unsigned value, unsigned base)
{
    char digits[3 * sizeof value];
    RTS_SIZE count = 0;

    do {
        digits[count++] = "0123456789ABCDEF"[value % base];
        value /= base;
    } while (value != 0 || (base == 16 && count < HEX_DIGITS));
    while (count > 0)
        put_char(out, digits[--count]);
}

static void put_signed(OUTPUT *out, int value)
{
    if (value < 0)
        put_char(out, '-');
    put_number(out, value < 0 ? 0u - (unsigned)value : (unsigned)value, 10);
}

RTS_SIZE CMUtlvsnprintf(char *out, RTS_SIZE size, const char *format, va_list arguments)
{
    OUTPUT output = {out, size, 0};
    const char *s;

    for (; *format != '\0'; format++) {
        if (*format != '%' || *++format == '%') {
            put_char(&output, *format);
            continue;
        }
        switch (*format) {
        case 's':
            s = va_arg(arguments, const char *);
            put_string(&output, s != NULL ? s : "(null)");
            break;
        case 'd':
            put_signed(&output, va_arg(arguments, int));
            break;
        case 'u':
            put_number(&output, va_arg(arguments, unsigned), 10);
            break;
        case 'X':
        case 'x':
            put_number(&output, va_arg(arguments, unsigned), 16);
            break;
        default: /* which argument is whose is not known from here on */
            put_string(&output, format - 1);
            goto end;
        }
    }
end:
    out[output.length] = '\0';
    return output.length;
}

RTS_SIZE CMUtlsnprintf(char *out, RTS_SIZE size, const char *format, ...)
{
    va_list arguments;
    RTS_SIZE length;

    va_start(arguments, format);
    length = CMUtlvsnprintf(out, size, format, arguments);
    va_end(arguments);
    return length;
}

RTS_UI32 CMUtlStrNLen(const char *text, RTS_UI32 max)
{
    RTS_UI32 length = 0;

    while (length < max && text[length] != '\0')
        length++;
    return length;
}

RTS_UI8 *CMUtlPutWide(RTS_UI8 *place, const char *text, RTS_UI32 length)
{
    for (RTS_UI32 i = 0; i < length; i++, place += 2)
        BytesPut16(place, (RTS_UI8)text[i]);
    BytesPut16(place, 0);
    return place + 2;
}
