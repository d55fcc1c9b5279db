/*
 * test_core_checksum.c - CRC-32 and CRC-16, with both sizes of table.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "rts_config.h"
#include "test.h"

#undef CHECKSUM_TABLE_ENTRIES
#define CHECKSUM_TABLE_ENTRIES 256
#define CRC32Update crc32_by_byte
#define CRC16Update crc16_by_byte
#define crc32_table crc32_table_256
#define crc16_table crc16_table_256
#define crc32_step crc32_step_256
#define crc16_step crc16_step_256
#include "../../firmware/src/core/CmpChecksum.c"
#undef CHECKSUM_TABLE_ENTRIES
#define CHECKSUM_TABLE_ENTRIES 16
#undef CRC32Update
#undef CRC16Update
#undef crc32_table
#undef crc16_table
#undef crc32_step
#undef crc16_step
#define CRC32Update crc32_by_nibble
#define CRC16Update crc16_by_nibble
#define crc32_table crc32_table_16
#define crc16_table crc16_table_16
#define crc32_step crc32_step_16
#define crc16_step crc16_step_16
RTS_UI32 crc32_by_nibble(RTS_UI32 crc, const void *data, RTS_SIZE size);
RTS_UI16 crc16_by_nibble(RTS_UI16 crc, const void *data, RTS_SIZE size);
#include "../../firmware/src/core/CmpChecksum.c"

static const char digits[] = "123456789";

/* The definitions, bit by bit. */
static RTS_UI32 slow_crc32(const RTS_UI8 *data, RTS_SIZE size)
{
    RTS_UI32 crc = 0xFFFFFFFF;
    int bit;

    while (size-- > 0) {
        crc ^= *data++;
        for (bit = 0; bit < 8; bit++)
            crc = (crc & 1) != 0 ? crc >> 1 ^ 0xEDB88320 : crc >> 1;
    }
    return ~crc;
}

static RTS_UI16 slow_crc16(const RTS_UI8 *data, RTS_SIZE size)
{
    RTS_UI32 crc = 0x1D0F;
    int bit;

    while (size-- > 0) {
        crc ^= (RTS_UI32)*data++ << 8;
        for (bit = 0; bit < 8; bit++)
            crc = (crc & 0x8000) != 0 ? crc << 1 ^ 0x1021 : crc << 1;
    }
    return (RTS_UI16)crc;
}

static void check_values_are_those_of_the_catalogue(void)
{
    CHECK_EQUAL(crc32_by_byte(0, digits, 9), 0xCBF43926);
    CHECK_EQUAL(crc32_by_nibble(0, digits, 9), 0xCBF43926);
    CHECK_EQUAL(crc16_by_byte(CRC16_INIT, digits, 9), 0xE5CC);
    CHECK_EQUAL(crc16_by_nibble(CRC16_INIT, digits, 9), 0xE5CC);
}

static void nothing_changes_nothing(void)
{
    CHECK_EQUAL(crc32_by_byte(0, "", 0), 0);
    CHECK_EQUAL(crc32_by_nibble(0x12345678, "", 0), 0x12345678);
    CHECK_EQUAL(crc16_by_byte(CRC16_INIT, "", 0), CRC16_INIT);
    CHECK_EQUAL(crc16_by_nibble(7, "", 0), 7);
}

static void both_tables_follow_the_definition(void)
{
    RTS_UI8 data[300];
    RTS_SIZE i;

    for (i = 0; i < sizeof data; i++)
        data[i] = (RTS_UI8)(i * 167 + i / 7);
    for (i = 0; i < sizeof data; i++) {
        CHECK_EQUAL(crc32_by_byte(0, data, i), slow_crc32(data, i));
        CHECK_EQUAL(crc32_by_nibble(0, data, i), slow_crc32(data, i));
        CHECK_EQUAL(crc16_by_byte(CRC16_INIT, data, i), slow_crc16(data, i));
        CHECK_EQUAL(crc16_by_nibble(CRC16_INIT, data, i), slow_crc16(data, i));
    }
}

static void pieces_give_the_same_as_the_whole(void)
{
    RTS_SIZE cut;

    for (cut = 0; cut <= 9; cut++) {
        CHECK_EQUAL(crc32_by_byte(crc32_by_byte(0, digits, cut), digits + cut, 9 - cut), 0xCBF43926);
        CHECK_EQUAL(crc16_by_nibble(crc16_by_nibble(CRC16_INIT, digits, cut), digits + cut, 9 - cut), 0xE5CC);
    }
}

int main(void)
{
    RUN(check_values_are_those_of_the_catalogue);
    RUN(nothing_changes_nothing);
    RUN(both_tables_follow_the_definition);
    RUN(pieces_give_the_same_as_the_whole);
    return test_result();
}
