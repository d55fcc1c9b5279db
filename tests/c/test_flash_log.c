/*
 * test_flash_log.c - the record log: the newest record wins, cuts leave the old or the new one.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "Sim.h"
#include "SysFlash.h"
#include "SysFlashLog.h"
#include "test.h"

enum { TAG = 0x54534554, DATA_SIZE = 30 };

typedef struct {
    RTS_UI32 program_size;
    RTS_UI8 erased;
} GEOMETRY;

static const GEOMETRY geometries[] = {{1, 0xFF}, {1, 0x00}, {8, 0xFF}, {8, 0x00}, {16, 0xFF}, {16, 0x00}};

static const FLASH_LOG_RANGE everything = {0, 0x7FFFFFFF};

static FLASH_LOG log_file;

static void start(GEOMETRY g)
{
    CHECK(SimFlashConfigure(16 * 1024, 256, g.program_size, g.erased) == ERR_OK);
    CHECK(SimStart() == ERR_OK);
    CHECK(FlashLogOpen(&log_file, FILE_COMMIT) == ERR_OK);
}

static void fill(RTS_UI8 data[DATA_SIZE], RTS_UI32 number)
{
    memset(data, (int)(number % 251), DATA_SIZE);
    memcpy(data, &number, sizeof number);
}

static RTS_RESULT append(RTS_UI32 number)
{
    RTS_UI8 data[DATA_SIZE];

    fill(data, number);
    return FlashLogAppend(&log_file, TAG, data, DATA_SIZE);
}

/* The number in the newest record, 0 without one; checks that it is whole. */
static RTS_UI32 newest(void)
{
    RTS_UI8 data[DATA_SIZE];
    RTS_UI8 expected[DATA_SIZE];
    RTS_UI32 number;

    if (FlashLogRead(&log_file, everything, TAG, data, DATA_SIZE) != ERR_OK)
        return 0;
    memcpy(&number, data, sizeof number);
    fill(expected, number);
    CHECK(memcmp(data, expected, DATA_SIZE) == 0);
    return number;
}

static void a_blank_log_has_no_record(void)
{
    start(geometries[0]);
    CHECK(newest() == 0);
    CHECK(log_file.sequence == 0);
}

static void the_newest_record_wins_over_many_wraps(void)
{
    RTS_SIZE g;
    RTS_UI32 i;

    for (g = 0; g < RTS_COUNT(geometries); g++) {
        start(geometries[g]);
        for (i = 1; i <= 100; i++) {
            CHECK(append(i) == ERR_OK);
            CHECK(newest() == i);
            if (i % 3 == 0) {
                CHECK(FlashLogOpen(&log_file, FILE_COMMIT) == ERR_OK);
                CHECK(newest() == i);
                CHECK(log_file.sequence == i);
            }
        }
        CHECK(SimFlashViolations() == 0);
    }
}

static RTS_RESULT broken_read(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    RTS_UNUSED(offset);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    return ERR_DEVICE;
}

/* Records that cannot be read now are there, and shall be when the flash works again. */
static void nothing_is_appended_to_a_log_that_cannot_be_read(void)
{
    SYS_FLASH *flash = (SYS_FLASH *)(uintptr_t)SysFlashGet();
    RTS_RESULT (*read)(RTS_UI32 offset, void *data, RTS_UI32 size) = flash->read;

    SimFlashSetMapped(0);
    start(geometries[0]);
    CHECK(append(1) == ERR_OK);
    CHECK(append(2) == ERR_OK);
    flash->read = broken_read;
    CHECK(FlashLogOpen(&log_file, FILE_COMMIT) == ERR_DEVICE);
    flash->read = read;
    CHECK(append(3) == ERR_DEVICE);
    CHECK(FlashLogOpen(&log_file, FILE_COMMIT) == ERR_OK);
    CHECK(newest() == 2);
    SimFlashSetMapped(1);
}

static RTS_UI32 number_to_append;

static void append_number(void *unused)
{
    RTS_UNUSED(unused);
    (void)append(number_to_append);
}

/* Appends one record after the other, each one cut at its k-th operation before it succeeds. */
static void a_cut_at_any_operation_leaves_the_old_or_the_new_record(void)
{
    RTS_SIZE g;
    RTS_UI32 cuts = 0;

    for (g = 0; g < RTS_COUNT(geometries); g++) {
        RTS_UI32 number;
        start(geometries[g]);
        CHECK(append(1) == ERR_OK);
        for (number = 2; number < 60; number++) {
            RTS_UI32 k = number % 6 + 1;
            RTS_UI32 found;
            number_to_append = number;
            SimFlashCut(k, number / 6 % 3);
            if (SimCall(append_number, NULL) == SIM_POWER_CUT)
                cuts++;
            CHECK(SimStart() == ERR_OK);
            CHECK(FlashLogOpen(&log_file, FILE_COMMIT) == ERR_OK);
            found = newest();
            CHECK(found == number || found == number - 1);
            CHECK(append(number) == ERR_OK);
            CHECK(newest() == number);
        }
        CHECK(SimFlashViolations() == 0);
        if (SimFlashViolations() != 0)
            fprintf(stderr, "geometry %u: %s\n", (unsigned)g, SimFlashViolation());
    }
    CHECK(cuts > 100);
}

/* Data that look like erased flash must not be programmed over after a cut. */
static void a_record_of_erased_bytes_is_not_taken_for_free_space(void)
{
    static RTS_UI8 data[64];
    RTS_SIZE g;
    RTS_UI32 k;

    for (g = 0; g < RTS_COUNT(geometries); g++) {
        memset(data, geometries[g].erased, sizeof data);
        for (k = 1; k < 9; k++) {
            start(geometries[g]);
            CHECK(append(1) == ERR_OK);
            SimFlashCut(k, SIM_CUT_AFTER);
            (void)FlashLogAppend(&log_file, TAG, data, sizeof data);
            CHECK(SimStart() == ERR_OK);
            CHECK(FlashLogOpen(&log_file, FILE_COMMIT) == ERR_OK);
            CHECK(append(2) == ERR_OK);
            CHECK(newest() == 2);
            CHECK(SimFlashViolations() == 0);
        }
    }
}

static void records_are_distinguished_by_tag_and_size(void)
{
    RTS_UI8 data[DATA_SIZE] = {7};

    start(geometries[2]);
    CHECK(append(1) == ERR_OK);
    CHECK(FlashLogAppend(&log_file, TAG + 1, data, DATA_SIZE) == ERR_OK);
    CHECK(FlashLogAppend(&log_file, TAG, data, DATA_SIZE - 1) == ERR_OK);
    CHECK(newest() == 1);
    CHECK(FlashLogRead(&log_file, everything, TAG + 1, data, DATA_SIZE) == ERR_OK);
    CHECK(data[0] == 7);
    CHECK(FlashLogRead(&log_file, everything, TAG + 2, data, DATA_SIZE) == ERR_NO_OBJECT);
    CHECK(FlashLogRead(&log_file, everything, TAG, data, DATA_SIZE - 2) == ERR_NO_OBJECT);
    CHECK(data[0] == 7);
}

static void a_range_limits_what_is_read(void)
{
    FLASH_LOG_RANGE range = {0, 2};
    RTS_UI8 data[DATA_SIZE];

    start(geometries[0]);
    CHECK(append(1) == ERR_OK);
    CHECK(append(2) == ERR_OK);
    CHECK(append(3) == ERR_OK);
    CHECK(FlashLogRead(&log_file, range, TAG, data, DATA_SIZE) == ERR_OK);
    CHECK(data[0] == 2);
    range.until = 3;
    range.after = 3;
    CHECK(FlashLogRead(&log_file, range, TAG, data, DATA_SIZE) == ERR_NO_OBJECT);
}

static void numbers_wrap(void)
{
    RTS_UI32 i;

    start(geometries[2]);
    log_file.sequence = 0xFFFFFFF0;
    for (i = 1; i < 40; i++) {
        FLASH_LOG_RANGE range = {0xFFFFFF00, 0x100};
        RTS_UI8 data[DATA_SIZE];
        RTS_UI32 number;
        CHECK(append(i) == ERR_OK);
        CHECK(FlashLogOpen(&log_file, FILE_COMMIT) == ERR_OK);
        CHECK(log_file.sequence == 0xFFFFFFF0 + i);
        CHECK(FlashLogRead(&log_file, range, TAG, data, DATA_SIZE) == ERR_OK);
        memcpy(&number, data, sizeof number);
        CHECK(number == i);
    }
}

static void the_largest_record_fills_a_half(void)
{
    static RTS_UI8 data[256];
    RTS_UI32 capacity;
    RTS_UI32 i;

    start(geometries[4]);
    capacity = FlashLogCapacity(&log_file);
    CHECK(capacity == 256 - FLASH_LOG_HEAD_SIZE);
    CHECK(FlashLogAppend(&log_file, TAG, data, capacity + 1) == ERR_DISK_FULL);
    for (i = 1; i < 10; i++) {
        data[0] = (RTS_UI8)i;
        CHECK(FlashLogAppend(&log_file, TAG, data, capacity) == ERR_OK);
        CHECK(FlashLogOpen(&log_file, FILE_COMMIT) == ERR_OK);
        data[0] = 0;
        CHECK(FlashLogRead(&log_file, everything, TAG, data, capacity) == ERR_OK);
        CHECK(data[0] == i);
    }
    CHECK(FlashLogAppend(&log_file, TAG, data, 0) == ERR_OK);
    CHECK(SimFlashViolations() == 0);
}

static void a_damaged_record_gives_way_to_the_one_before(void)
{
    const FILE_AREA *area = SysFileGetArea(FILE_COMMIT);
    RTS_UI32 byte;

    start(geometries[0]);
    CHECK(append(1) == ERR_OK);
    CHECK(append(2) == ERR_OK);
    CHECK(SimFlashSave() == ERR_OK);
    for (byte = 0; byte < FLASH_LOG_HEAD_SIZE + DATA_SIZE; byte++) {
        CHECK(SimFlashRestore() == ERR_OK);
        SimFlashData()[area->offset + log_file.start + 64 + byte] ^= 0x10;
        CHECK(FlashLogOpen(&log_file, FILE_COMMIT) == ERR_OK);
        CHECK(newest() == 1);
    }
}

static void garbage_is_survived(void)
{
    RTS_UI32 seed;
    RTS_UI32 i;

    for (seed = 1; seed < 200; seed++) {
        RTS_UI32 state = seed;
        const FILE_AREA *area;
        start(geometries[seed % RTS_COUNT(geometries)]);
        area = SysFileGetArea(FILE_COMMIT);
        for (i = 0; i < area->size; i++) {
            state = state * 1664525 + 1013904223;
            SimFlashData()[area->offset + i] = (RTS_UI8)(state >> 24);
        }
        CHECK(FlashLogOpen(&log_file, FILE_COMMIT) == ERR_OK);
        CHECK(newest() == 0);
        CHECK(append(5) == ERR_OK);
        CHECK(newest() == 5);
    }
}

static void a_fault_uses_up_its_place_only(void)
{
    RTS_UI32 k;

    for (k = 1; k <= 4; k++) {
        start(geometries[2]);
        CHECK(append(1) == ERR_OK);
        SimFlashCut(k, SIM_FAULT);
        CHECK(append(2) == ERR_DEVICE);
        CHECK(newest() == (k < 4 ? 1 : 2)); /* the last one lost only padding */
        CHECK(append(3) == ERR_OK);
        CHECK(newest() == 3);
        CHECK(FlashLogOpen(&log_file, FILE_COMMIT) == ERR_OK);
        CHECK(newest() == 3);
        CHECK(SimFlashViolations() == 0);
    }
}

int main(void)
{
    RUN(a_blank_log_has_no_record);
    RUN(the_newest_record_wins_over_many_wraps);
    RUN(nothing_is_appended_to_a_log_that_cannot_be_read);
    RUN(a_cut_at_any_operation_leaves_the_old_or_the_new_record);
    RUN(a_record_of_erased_bytes_is_not_taken_for_free_space);
    RUN(records_are_distinguished_by_tag_and_size);
    RUN(a_range_limits_what_is_read);
    RUN(numbers_wrap);
    RUN(the_largest_record_fills_a_half);
    RUN(a_damaged_record_gives_way_to_the_one_before);
    RUN(garbage_is_survived);
    RUN(a_fault_uses_up_its_place_only);
    return test_result();
}
