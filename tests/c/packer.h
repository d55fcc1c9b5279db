/*
 * packer.h - packs data for Unpack.h in a simple way, for tests.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef PACKER_H
#define PACKER_H

#include "CmpStd.h"

typedef struct {
    RTS_UI8 *out;
    RTS_UI32 size;
    RTS_UI32 bit; /* of the byte at bits_at that was used last */
    RTS_UI32 bits_at;
} PACKER;

static inline void packer_bit(PACKER *p, bool bit)
{
    p->bit >>= 1;
    if (p->bit == 0) {
        p->bit = 0x80;
        p->bits_at = p->size;
        p->out[p->size++] = 0;
    }
    p->out[p->bits_at] |= (RTS_UI8)(bit ? p->bit : 0);
}

/* `low`: also the first bit of it, which stands in the byte of a distance. */
static inline void packer_number_after(PACKER *p, RTS_UI32 number, bool first)
{
    RTS_UI32 bits = 0;

    while (number >> (bits + 1) != 0)
        bits++;
    for (RTS_UI32 i = bits; i > 0; i--) {
        if (first || i < bits)
            packer_bit(p, false);
        packer_bit(p, (number >> (i - 1) & 1) != 0);
    }
    if (first || bits > 0)
        packer_bit(p, true);
}

static inline void packer_number(PACKER *p, RTS_UI32 number)
{
    packer_number_after(p, number, true);
}

static inline void packer_literals(PACKER *p, const RTS_UI8 *data, RTS_UI32 count)
{
    packer_bit(p, false);
    packer_number(p, count);
    for (RTS_UI32 i = 0; i < count; i++)
        p->out[p->size++] = data[i];
}

/* The distance of the copy before, after literals. */
static inline void packer_repeat(PACKER *p, RTS_UI32 count)
{
    packer_bit(p, false);
    packer_number(p, count);
}

static inline void packer_copy(PACKER *p, RTS_UI32 distance, RTS_UI32 count)
{
    RTS_UI32 high = (distance + 127) / 128;

    packer_bit(p, true);
    packer_number(p, high);
    p->out[p->size++] = (RTS_UI8)((high * 128 - distance) << 1 | (count == 2));
    packer_number_after(p, count - 1, false);
}

/* The longest copy from the nearest place; 0 if none has two bytes. */
static inline RTS_UI32 packer_find(const RTS_UI8 *data, RTS_UI32 at, RTS_UI32 end, RTS_UI32 *distance)
{
    RTS_UI32 best = 1;

    for (RTS_UI32 d = 1; d <= at; d++) {
        RTS_UI32 size = 0;
        while (at + size < end && data[at + size] == data[at + size - d])
            size++;
        if (size > best) {
            best = size;
            *distance = d;
        }
    }
    return best > 1 ? best : 0;
}

/* Packs data[start..end), of which everything before is there; returns the bytes written to `out`. */
static inline RTS_UI32 pack(const RTS_UI8 *data, RTS_UI32 start, RTS_UI32 end, RTS_UI8 *out)
{
    PACKER p = {out, 0, 0, 0};
    RTS_UI32 literals = 0;
    RTS_UI32 last = 1;
    RTS_UI32 distance = 0;

    for (RTS_UI32 at = start; at < end;) {
        RTS_UI32 size = packer_find(data, at, end, &distance);
        bool repeats = size != 0 && literals != 0 && distance == last;
        if (size == 0) {
            literals++;
            at++;
            continue;
        }
        if (literals != 0)
            packer_literals(&p, data + at - literals, literals);
        literals = 0;
        if (repeats)
            packer_repeat(&p, size);
        else
            packer_copy(&p, last = distance, size);
        at += size;
    }
    if (literals != 0)
        packer_literals(&p, data + end - literals, literals);
    return p.size;
}

#endif
