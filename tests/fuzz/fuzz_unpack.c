/*
 * fuzz_unpack.c - any bytes as packed data: they unpack to just as many bytes as they are said to, or are refused.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: how many bytes they unpack to, and how many there are before them (16 bits each), then the data.
 */
#include <string.h>

#include "../c/packer.h"
#include "Unpack.h"
#include "fuzz.h"

enum { HEAD = 4, MOST = 0xFFFF };

static uint8_t written[2 * MOST];
static uint32_t position;
static uint32_t end;

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const char *const texts[] = {"a", "abcabcabcab", "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa",
                                        "abcdefgh-abcdxfgh-abcdefghxabcdefghi", "xyzxyz0123xyz4567xyz89xyz"};

    if (index >= sizeof(texts) / sizeof(texts[0]) || capacity < 256)
        return 0;
    size_t size = strlen(texts[index]);
    size_t before = index % 2 ? size / 3 : 0;
    const uint8_t head[HEAD] = {(uint8_t)(size - before), 0, (uint8_t)before, 0};
    memcpy(data, head, HEAD);
    memset(data + HEAD, 0, 200);
    return HEAD + pack((const uint8_t *)texts[index], (RTS_UI32)before, (RTS_UI32)size, data + HEAD);
}

static RTS_RESULT write_bytes(const RTS_UI8 *data, RTS_UI32 size)
{
    FUZZ_CHECK(size > 0 && size <= end - position);
    memcpy(written + position, data, size);
    position += size;
    return ERR_OK;
}

static RTS_RESULT copy_bytes(RTS_UI32 distance, RTS_UI32 size)
{
    FUZZ_CHECK(distance > 0 && size > 0 && size <= end - position);
    if (distance > position)
        return ERR_OUT_OF_LIMITS;
    for (; size > 0; size--, position++)
        written[position] = written[position - distance];
    return ERR_OK;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const UNPACK_SINK sink = {write_bytes, copy_bytes};

    if (size <= HEAD)
        return 0;
    uint32_t unpacked = data[0] | (uint32_t)data[1] << 8;
    position = data[2] | (uint32_t)data[3] << 8;
    end = position + unpacked;
    uint8_t *exact = malloc(size - HEAD); /* the sanitizer sees a look beyond */
    FUZZ_CHECK(exact != NULL);
    memcpy(exact, data + HEAD, size - HEAD);
    RTS_RESULT result = Unpack(exact, (RTS_UI32)(size - HEAD), unpacked, &sink);
    free(exact);
    FUZZ_CHECK(result == ERR_OK ? position == end : result == ERR_NO_CONSISTENCY || result == ERR_OUT_OF_LIMITS);
    return 0;
}
