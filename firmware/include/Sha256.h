/*
 * Sha256.h - SHA-256 (FIPS 180-4) and HMAC with it (RFC 2104), small rather than fast.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Needs 170 bytes of stack. A Cortex-M3 takes about 6000 instructions for 64 bytes. From any context.
 */
#ifndef SHA256_H
#define SHA256_H

#include "CmpStd.h"

enum { SHA256_SIZE = 32, SHA256_BLOCK = 64 };

/* A sum under way. */
typedef struct {
    RTS_UI32 state[SHA256_SIZE / 4];
    RTS_UI32 fill; /* bytes so far */
    RTS_UI8 block[SHA256_BLOCK];
} SHA256;

void Sha256Begin(SHA256 *sum);
void Sha256Add(SHA256 *sum, const void *data, RTS_UI32 size);
/* `digest` has SHA256_SIZE bytes. */
void Sha256End(SHA256 *sum, RTS_UI8 *digest);

/* The same for an HMAC; `key` has SHA256_SIZE bytes, and is the same at begin and end. */
void HmacBegin(SHA256 *sum, const RTS_UI8 *key);
void HmacEnd(SHA256 *sum, const RTS_UI8 *key, RTS_UI8 *digest);

/* Whether two digests are equal; takes as long whatever they are. */
bool Sha256IsEqual(const RTS_UI8 *a, const RTS_UI8 *b);

#endif
