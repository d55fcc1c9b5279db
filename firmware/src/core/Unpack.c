/*
 * Unpack.c - unpacks what plctool has packed for a slow line.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Unpack.h"

enum {
    NUMBER_MAX = 0xFFFF, /* no number in the data is larger */
    BYTE_BITS = 8,
    LOW_BITS = 7, /* of a distance, in a byte of their own */
};

/* Bits are taken from a byte that stands among the others where the first of them is needed, the highest first. */
typedef struct {
    const RTS_UI8 *data;
    RTS_UI32 left; /* bytes */
    RTS_UI32 bits; /* of the last byte, and a 1 after them; those that were taken are above bit 7 */
    RTS_UI32 distance;
    bool wrong; /* the data end too early, or a number is too large */
} PACKED;

static RTS_UI32 take_byte(PACKED *packed)
{
    if (packed->left == 0) {
        packed->wrong = true;
        return 0;
    }
    packed->left--;
    return *packed->data++;
}

static bool take_bit(PACKED *packed)
{
    packed->bits <<= 1;
    if ((packed->bits & 0xFF) == 0)
        packed->bits = take_byte(packed) << 1 | 1;
    return (packed->bits >> BYTE_BITS & 1) != 0;
}

/* A number from 1 on: its bits after the highest one, each after a 0; then a 1. `ends`: the first of these. */
static RTS_UI32 take_number(PACKED *packed, bool ends)
{
    RTS_UI32 number = 1;

    for (; !ends && !packed->wrong; ends = take_bit(packed)) {
        number = number << 1 | take_bit(packed);
        if (number > NUMBER_MAX)
            packed->wrong = true;
    }
    return number;
}

static RTS_RESULT take_literals(PACKED *packed, RTS_UI32 count, const UNPACK_SINK *sink)
{
    const RTS_UI8 *literals = packed->data;

    if (count > packed->left)
        return ERR_NO_CONSISTENCY;
    packed->data += count;
    packed->left -= count;
    return sink->write(literals, count);
}

/* The distance, and how many bytes to copy from there. */
static RTS_UI32 take_distant(PACKED *packed)
{
    RTS_UI32 high = take_number(packed, take_bit(packed));
    RTS_UI32 low = take_byte(packed);

    packed->distance = (high << LOW_BITS) - (low >> 1);
    return take_number(packed, low & 1) + 1;
}

RTS_RESULT Unpack(const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 unpacked, const UNPACK_SINK *sink)
{
    PACKED packed = {data, size, 0x80, 1, false};
    RTS_RESULT result = ERR_OK;
    bool copied = true; /* what came last; literals never come twice */

    while (unpacked > 0 && result == ERR_OK) {
        bool distant = take_bit(&packed);
        RTS_UI32 count = distant ? take_distant(&packed) : take_number(&packed, take_bit(&packed));
        if (packed.wrong || count > unpacked)
            return ERR_NO_CONSISTENCY;
        unpacked -= count;
        copied = distant || !copied;
        result = copied ? sink->copy(packed.distance, count) : take_literals(&packed, count, sink);
    }
    return result == ERR_OK && packed.left > 0 ? ERR_NO_CONSISTENCY : result;
}
