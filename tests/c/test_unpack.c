/*
 * test_unpack.c - Unpack: what was packed comes back; other data are refused, and no byte too many is written.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "Unpack.h"

#include <stdlib.h>
#include <string.h>

#include "packer.h"
#include "test.h"

enum { CAPACITY = 4096 };

static RTS_UI8 written[CAPACITY];
static RTS_UI32 position;
static RTS_UI32 limit; /* the sink takes no more */

static RTS_RESULT write_bytes(const RTS_UI8 *data, RTS_UI32 size)
{
    if (size > limit - position)
        return ERR_DISK_FULL;
    memcpy(written + position, data, size);
    position += size;
    return ERR_OK;
}

static RTS_RESULT copy_bytes(RTS_UI32 distance, RTS_UI32 size)
{
    CHECK(distance > 0);
    if (distance > position)
        return ERR_OUT_OF_LIMITS;
    if (size > limit - position)
        return ERR_DISK_FULL;
    for (; size > 0; size--, position++)
        written[position] = written[position - distance];
    return ERR_OK;
}

/* The data are in memory of just their size, so that the sanitizer sees a look beyond. */
static RTS_RESULT unpack(const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 unpacked)
{
    static const UNPACK_SINK sink = {write_bytes, copy_bytes};
    RTS_UI8 *exact = malloc(size + 1);

    memcpy(exact, data, size);
    RTS_RESULT result = Unpack(exact, size, unpacked, &sink);
    free(exact);
    return result;
}

static void setup(const char *before)
{
    limit = CAPACITY;
    position = (RTS_UI32)strlen(before);
    memcpy(written, before, position);
}

static RTS_UI32 random_state = 1;

static RTS_UI32 random_below(RTS_UI32 limit_of_it)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (random_state >> 8) % limit_of_it;
}

static void literals_come_back(void)
{
    static const RTS_UI8 data[] = {0x30, 'a', 'b', 'c'}; /* 0: literals; 3: 0 1 1 */

    setup("");
    CHECK_EQUAL(unpack(data, sizeof(data), 3), ERR_OK);
    CHECK(position == 3 && memcmp(written, "abc", 3) == 0);
}

static void copies_may_overlap_what_they_write(void)
{
    RTS_UI8 data[20] = {0};
    PACKER p = {data, 0, 0, 0};

    packer_copy(&p, 2, 7);
    setup("xab");
    CHECK_EQUAL(unpack(data, p.size, 7), ERR_OK);
    CHECK(position == 10 && memcmp(written, "xababababa", 10) == 0);
}

static void repeated_distance_is_that_of_the_copy_before(void)
{
    RTS_UI8 data[20] = {0};
    PACKER p = {data, 0, 0, 0};

    packer_copy(&p, 3, 2);
    packer_literals(&p, (const RTS_UI8 *)"-", 1);
    packer_repeat(&p, 1);
    setup("abc");
    CHECK_EQUAL(unpack(data, p.size, 4), ERR_OK);
    CHECK(position == 7 && memcmp(written, "abcab-a", 7) == 0);
}

static void distance_is_one_at_first(void)
{
    RTS_UI8 data[20] = {0};
    PACKER p = {data, 0, 0, 0};

    packer_literals(&p, (const RTS_UI8 *)"z", 1);
    packer_repeat(&p, 5);
    setup("");
    CHECK_EQUAL(unpack(data, p.size, 6), ERR_OK);
    CHECK(memcmp(written, "zzzzzz", 6) == 0);
}

/* Of a few kinds of bytes, so that there is something to copy, also from what is before the block. */
static void anything_that_was_packed_comes_back(void)
{
    static RTS_UI8 image[1000];
    static RTS_UI8 packed[2 * sizeof(image)];

    for (RTS_UI32 round = 0; round < 2000; round++) {
        RTS_UI32 size = 1 + random_below(sizeof(image));
        RTS_UI32 start = random_below(size);
        RTS_UI32 kinds = 1 + random_below(round % 2 ? 4 : 256);
        for (RTS_UI32 i = 0; i < size; i++)
            image[i] = (RTS_UI8)random_below(kinds);
        setup("");
        memcpy(written, image, start);
        position = start;
        limit = size;
        RTS_UI32 packed_size = pack(image, start, size, packed);
        CHECK_EQUAL(unpack(packed, packed_size, size - start), ERR_OK);
        CHECK(position == size && memcmp(written, image, size) == 0);
    }
}

static void data_that_end_early_or_go_on_are_refused(void)
{
    RTS_UI8 data[64] = {0};
    RTS_UI32 size = pack((const RTS_UI8 *)"abcabcabcabx-abcabc", 0, 19, data);

    for (RTS_UI32 cut = 0; cut < size; cut++) {
        setup("");
        CHECK_EQUAL(unpack(data, cut, 19), ERR_NO_CONSISTENCY);
        CHECK(position <= 19);
    }
    setup("");
    CHECK_EQUAL(unpack(data, size + 1, 19), ERR_NO_CONSISTENCY);
    setup("");
    CHECK_EQUAL(unpack(data, size, 18), ERR_NO_CONSISTENCY);
    CHECK(position <= 18);
}

static void copy_from_before_the_start_is_refused(void)
{
    RTS_UI8 data[20] = {0};
    PACKER p = {data, 0, 0, 0};

    packer_copy(&p, 4, 2);
    setup("abc");
    CHECK_EQUAL(unpack(data, p.size, 2), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(position, 3);
    setup("");
    CHECK_EQUAL(unpack(data, p.size, 2), ERR_OUT_OF_LIMITS);
}

/* Few bytes that say there are very many. */
static void bomb_writes_no_more_than_it_is_said_to_unpack_to(void)
{
    RTS_UI8 data[20] = {0};
    PACKER p = {data, 0, 0, 0};

    packer_copy(&p, 1, 60000);
    setup("a");
    CHECK_EQUAL(unpack(data, p.size, 1000), ERR_NO_CONSISTENCY);
    CHECK_EQUAL(position, 1);
}

static void number_without_end_is_refused(void)
{
    RTS_UI8 data[1000];

    for (RTS_UI32 fill = 0; fill < 256; fill++) {
        memset(data, (int)fill, sizeof(data));
        setup("abc");
        limit = 103;
        CHECK(unpack(data, sizeof(data), 100) != ERR_OK);
    }
}

static void error_of_the_sink_ends_it(void)
{
    RTS_UI8 data[64] = {0};
    RTS_UI32 size = pack((const RTS_UI8 *)"abcabcabcabx-abcabc", 0, 19, data);

    for (RTS_UI32 room = 0; room < 19; room++) {
        setup("");
        limit = room;
        CHECK_EQUAL(unpack(data, size, 19), ERR_DISK_FULL);
    }
}

int main(void)
{
    RUN(literals_come_back);
    RUN(copies_may_overlap_what_they_write);
    RUN(repeated_distance_is_that_of_the_copy_before);
    RUN(distance_is_one_at_first);
    RUN(anything_that_was_packed_comes_back);
    RUN(data_that_end_early_or_go_on_are_refused);
    RUN(copy_from_before_the_start_is_refused);
    RUN(bomb_writes_no_more_than_it_is_said_to_unpack_to);
    RUN(number_without_end_is_refused);
    RUN(error_of_the_sink_ends_it);
    return test_result();
}
