/*
 * telegrams.c - twin of telegrams.st: strings that know their length, nothing is copied twice.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <stdint.h>
#include <string.h>

enum { CAPACITY = 80 };

typedef struct {
    int length;
    char text[CAPACITY + 1];
} TEXT;

uint32_t chk;
static int32_t serial;

void scan_init(void)
{
    serial = 0;
    chk = 0;
}

static void append(TEXT *to, const char *text, int length)
{
    if (length > CAPACITY - to->length)
        length = CAPACITY - to->length;
    memcpy(to->text + to->length, text, (size_t)length);
    to->length += length;
    to->text[to->length] = '\0';
}

static void append_number(TEXT *to, int32_t number)
{
    char digits[12];
    int at = sizeof digits;
    uint32_t rest = number < 0 ? 0u - (uint32_t)number : (uint32_t)number;

    do
        digits[--at] = (char)('0' + rest % 10);
    while ((rest /= 10) != 0);
    if (number < 0)
        digits[--at] = '-';
    append(to, digits + at, (int)sizeof digits - at);
}

static int find(const TEXT *in, const char *what, int length)
{
    for (int i = 0; i + length <= in->length; i++) {
        if (memcmp(in->text + i, what, (size_t)length) == 0)
            return i + 1;
    }
    return 0;
}

static void middle(TEXT *to, const TEXT *from, int length, int position)
{
    to->length = 0;
    append(to, from->text + position - 1, length);
}

static int32_t number_of(const TEXT *text)
{
    int32_t value = 0;

    for (int i = 0; i < text->length && text->text[i] >= '0' && text->text[i] <= '9'; i++)
        value = value * 10 + (text->text[i] - '0');
    return value;
}

/* Puts `what` in place of `length` characters from `position` on. */
static void splice(TEXT *text, const char *what, int what_length, int length, int position)
{
    TEXT tail;

    tail.length = 0;
    append(&tail, text->text + position - 1 + length, text->length - (position - 1 + length));
    text->length = position - 1;
    append(text, what, what_length);
    append(text, tail.text, tail.length);
}

void scan(void)
{
    int32_t sum = 0;

    for (int i = 1; i <= 8; i++) {
        static TEXT telegram, name, value, mark;
        int comma, equals, semicolon;

        serial = (serial + 37) % 20000;
        telegram.length = 0;
        append_number(&telegram, i);
        append(&telegram, ",axis", 5);
        append_number(&telegram, i * 11);
        append(&telegram, "=", 1);
        append_number(&telegram, serial);
        append(&telegram, ";ready", 6);
        comma = find(&telegram, ",", 1);
        equals = find(&telegram, "=", 1);
        semicolon = find(&telegram, ";", 1);
        middle(&name, &telegram, equals - comma - 1, comma + 1);
        middle(&value, &telegram, semicolon - equals - 1, equals + 1);
        middle(&mark, &telegram, telegram.length - semicolon, semicolon + 1);
        if (mark.length == 5 && memcmp(mark.text, "ready", 5) == 0)
            sum += number_of(&value) * name.length;
        splice(&telegram, "idle", 4, mark.length, semicolon + 1);
        splice(&telegram, name.text, name.length, 0, comma + 1);
        splice(&telegram, "", 0, 2, 1);
        sum += telegram.length + find(&telegram, "idle", 4);
    }
    chk = (chk << 1 | chk >> 31) ^ (uint32_t)sum;
}
