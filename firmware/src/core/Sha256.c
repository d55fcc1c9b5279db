/*
 * Sha256.c - SHA-256 and HMAC. Sections are those of FIPS 180-4.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Sha256.h"

#include <string.h>

enum { ROUNDS = 64, WORDS = SHA256_BLOCK / 4, HASH_WORDS = SHA256_SIZE / 4, LENGTH_AT = SHA256_BLOCK - 8 };

/* 4.2.2 */
static const RTS_UI32 constants[ROUNDS] = {
    0x428A2F98, 0x71374491, 0xB5C0FBCF, 0xE9B5DBA5, 0x3956C25B, 0x59F111F1, 0x923F82A4, 0xAB1C5ED5,
    0xD807AA98, 0x12835B01, 0x243185BE, 0x550C7DC3, 0x72BE5D74, 0x80DEB1FE, 0x9BDC06A7, 0xC19BF174,
    0xE49B69C1, 0xEFBE4786, 0x0FC19DC6, 0x240CA1CC, 0x2DE92C6F, 0x4A7484AA, 0x5CB0A9DC, 0x76F988DA,
    0x983E5152, 0xA831C66D, 0xB00327C8, 0xBF597FC7, 0xC6E00BF3, 0xD5A79147, 0x06CA6351, 0x14292967,
    0x27B70A85, 0x2E1B2138, 0x4D2C6DFC, 0x53380D13, 0x650A7354, 0x766A0ABB, 0x81C2C92E, 0x92722C85,
    0xA2BFE8A1, 0xA81A664B, 0xC24B8B70, 0xC76C51A3, 0xD192E819, 0xD6990624, 0xF40E3585, 0x106AA070,
    0x19A4C116, 0x1E376C08, 0x2748774C, 0x34B0BCB5, 0x391C0CB3, 0x4ED8AA4A, 0x5B9CCA4F, 0x682E6FF3,
    0x748F82EE, 0x78A5636F, 0x84C87814, 0x8CC70208, 0x90BEFFFA, 0xA4506CEB, 0xBEF9A3F7, 0xC67178F2,
};

static RTS_UI32 rotate(RTS_UI32 x, RTS_UI32 by)
{
    return x >> by | x << (32 - by);
}

static RTS_UI32 big_endian(const RTS_UI8 *data)
{
    return (RTS_UI32)data[0] << 24 | (RTS_UI32)data[1] << 16 | (RTS_UI32)data[2] << 8 | data[3];
}

static void put_big_endian(RTS_UI8 *data, RTS_UI32 value)
{
    for (RTS_UI32 i = 0; i < 4; i++)
        data[i] = (RTS_UI8)(value >> (24 - 8 * i));
}

/* The next word of the message schedule (6.2.2, step 1), of which the last 16 are kept; `t` from 16 on. */
static RTS_UI32 extend(RTS_UI32 *schedule, RTS_UI32 t)
{
    RTS_UI32 w15 = schedule[(t - 15) % WORDS];
    RTS_UI32 w2 = schedule[(t - 2) % WORDS];

    schedule[t % WORDS] += (rotate(w15, 7) ^ rotate(w15, 18) ^ w15 >> 3) + schedule[(t - 7) % WORDS] +
                           (rotate(w2, 17) ^ rotate(w2, 19) ^ w2 >> 10);
    return schedule[t % WORDS];
}

/* A step (6.2.2, step 3) on the variables a to h, with the sum of constant and word. */
static void step(RTS_UI32 *v, RTS_UI32 sum)
{
    RTS_UI32 t1 =
        v[7] + (rotate(v[4], 6) ^ rotate(v[4], 11) ^ rotate(v[4], 25)) + ((v[4] & v[5]) ^ (~v[4] & v[6])) + sum;
    RTS_UI32 t2 =
        (rotate(v[0], 2) ^ rotate(v[0], 13) ^ rotate(v[0], 22)) + ((v[0] & v[1]) ^ (v[0] & v[2]) ^ (v[1] & v[2]));

    memmove(v + 1, v, (HASH_WORDS - 1) * sizeof(*v));
    v[4] += t1;
    v[0] = t1 + t2;
}

static void take_block(SHA256 *sum)
{
    RTS_UI32 schedule[WORDS];
    RTS_UI32 v[HASH_WORDS];

    memcpy(v, sum->state, sizeof(v));
    for (RTS_UI32 t = 0; t < WORDS; t++)
        schedule[t] = big_endian(sum->block + 4 * t);
    for (RTS_UI32 t = 0; t < ROUNDS; t++)
        step(v, constants[t] + (t < WORDS ? schedule[t] : extend(schedule, t)));
    for (RTS_UI32 i = 0; i < HASH_WORDS; i++)
        sum->state[i] += v[i];
}

void Sha256Begin(SHA256 *sum)
{
    static const RTS_UI32 begin[HASH_WORDS] = {0x6A09E667, 0xBB67AE85, 0x3C6EF372, 0xA54FF53A,
                                               0x510E527F, 0x9B05688C, 0x1F83D9AB, 0x5BE0CD19}; /* 5.3.3 */

    memcpy(sum->state, begin, sizeof(begin));
    sum->fill = 0;
}

void Sha256Add(SHA256 *sum, const void *data, RTS_UI32 size)
{
    const RTS_UI8 *bytes = data;

    for (RTS_UI32 i = 0; i < size; i++) {
        sum->block[sum->fill++ % SHA256_BLOCK] = bytes[i];
        if (sum->fill % SHA256_BLOCK == 0)
            take_block(sum);
    }
}

void Sha256End(SHA256 *sum, RTS_UI8 *digest)
{
    RTS_UI32 size = sum->fill;
    RTS_UI8 length[8] = {0};
    RTS_UI8 padding = 0x80;

    do {
        Sha256Add(sum, &padding, 1);
        padding = 0;
    } while (sum->fill % SHA256_BLOCK != LENGTH_AT);
    put_big_endian(length, size >> 29);
    put_big_endian(length + 4, size << 3);
    Sha256Add(sum, length, sizeof(length));
    for (RTS_UI32 i = 0; i < HASH_WORDS; i++)
        put_big_endian(digest + 4 * i, sum->state[i]);
}

/* Begins with the key, padded with zeros to a block, every byte of it changed by `change`. */
static void begin_with_key(SHA256 *sum, const RTS_UI8 *key, RTS_UI8 change)
{
    Sha256Begin(sum);
    for (RTS_UI32 i = 0; i < SHA256_BLOCK; i++) {
        RTS_UI8 byte = (RTS_UI8)((i < SHA256_SIZE ? key[i] : 0) ^ change);
        Sha256Add(sum, &byte, 1);
    }
}

void HmacBegin(SHA256 *sum, const RTS_UI8 *key)
{
    begin_with_key(sum, key, 0x36);
}

void HmacEnd(SHA256 *sum, const RTS_UI8 *key, RTS_UI8 *digest)
{
    Sha256End(sum, digest);
    begin_with_key(sum, key, 0x5C);
    Sha256Add(sum, digest, SHA256_SIZE);
    Sha256End(sum, digest);
}

bool Sha256IsEqual(const RTS_UI8 *a, const RTS_UI8 *b)
{
    RTS_UI32 difference = 0;

    for (RTS_UI32 i = 0; i < SHA256_SIZE; i++)
        difference |= (RTS_UI32)(a[i] ^ b[i]);
    return difference == 0;
}
