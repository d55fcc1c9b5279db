/*
 * test_flash_file.c - SysFileFlash: files on flash, written in sequence.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "Sim.h"
#include "SysFileFlash.h"
#include "SysFlash.h"
#include "test.h"

typedef struct {
    RTS_UI32 program_size;
    RTS_UI8 erased;
} GEOMETRY;

static const GEOMETRY geometries[] = {{1, 0xFF}, {2, 0x00}, {4, 0xFF}, {8, 0x00}, {16, 0xFF}};

static RTS_UI8 pattern[8192];

static void start(GEOMETRY g)
{
    RTS_UI32 i;

    for (i = 0; i < sizeof pattern; i++)
        pattern[i] = (RTS_UI8)(i * 13 + i / 256);
    CHECK_EQUAL(SimFlashConfigure(64 * 1024, 512, g.program_size, g.erased), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
}

static bool holds_pattern(RTS_UI32 file, RTS_UI32 size)
{
    static RTS_UI8 data[sizeof pattern];

    return SysFileRead(file, 0, data, size) == ERR_OK && memcmp(data, pattern, size) == 0;
}

static void files_lie_side_by_side_on_sector_borders(void)
{
    RTS_UI32 end = 0;
    RTS_UI32 i;

    start(geometries[0]);
    for (i = 0; i < FILE_COUNT; i++) {
        const FILE_AREA *area = SysFileGetArea(i);
        CHECK_EQUAL(area->offset, end);
        CHECK(area->size > 0 && area->size % 512 == 0);
        end = area->offset + area->size;
    }
    CHECK(end <= 64 * 1024);
    CHECK_EQUAL(SysFileGetArea(FILE_SLOT_A)->size, SysFileGetArea(FILE_SLOT_B)->size);
    CHECK(SysFileGetArea(FILE_SLOT_A)->size > 20 * 1024);
    CHECK_EQUAL(SysFileGetArea(FILE_COMMIT)->size, 2 * 512);
}

static void a_flash_that_is_too_small_stops_the_start_up(void)
{
    CHECK_EQUAL(SimFlashConfigure(1024, 256, 1, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_NOMEMORY);
    CHECK_EQUAL(SimAdvance(1), ERR_NOTINITIALIZED);
    CHECK_EQUAL(SimFlashConfigure(2048, 256, 1, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK); /* 2 commit, 2 retain, 2 x 2 slots */
    CHECK_EQUAL(SysFileGetArea(FILE_SLOT_B)->size, 512);
    CHECK_EQUAL(SimFlashConfigure(2048, 8, 1, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_PARAMETER); /* sectors smaller than what files are aligned to */
}

/* Blocks of all sizes, in a pattern that has nothing to do with units and sectors. */
static void what_is_written_in_pieces_can_be_read(void)
{
    static const RTS_UI32 blocks[] = {1, 2, 3, 5, 7, 8, 13, 16, 17, 31, 64, 100, 511, 512, 513, 1000};
    RTS_SIZE g;
    RTS_SIZE b;

    for (g = 0; g < RTS_COUNT(geometries); g++) {
        for (b = 0; b < RTS_COUNT(blocks); b++) {
            RTS_UI32 done = 0;
            start(geometries[g]);
            SysFileCreate(FILE_SLOT_B);
            while (done < sizeof pattern) {
                RTS_UI32 size =
                    (RTS_UI32)sizeof pattern - done < blocks[b] ? (RTS_UI32)sizeof pattern - done : blocks[b];
                CHECK_EQUAL(SysFileWrite(FILE_SLOT_B, pattern + done, size), ERR_OK);
                done += size;
                CHECK_EQUAL(SysFileGetPos(FILE_SLOT_B), done);
            }
            CHECK_EQUAL(SysFileClose(FILE_SLOT_B), ERR_OK);
            CHECK(holds_pattern(FILE_SLOT_B, sizeof pattern));
            CHECK_EQUAL(SimFlashViolations(), 0);
        }
    }
}

static void an_odd_end_is_padded_with_the_erased_value(void)
{
    RTS_UI8 data[16];
    RTS_SIZE g;

    for (g = 0; g < RTS_COUNT(geometries); g++) {
        start(geometries[g]);
        SysFileCreate(FILE_SLOT_A);
        CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, pattern, 17), ERR_OK);
        CHECK_EQUAL(SysFileClose(FILE_SLOT_A), ERR_OK);
        CHECK(holds_pattern(FILE_SLOT_A, 17));
        CHECK_EQUAL(SysFileRead(FILE_SLOT_A, 17, data, 15), ERR_OK);
        CHECK(data[0] == geometries[g].erased && data[14] == geometries[g].erased);
        CHECK_EQUAL(SimFlashViolations(), 0);
    }
}

static void sectors_are_erased_when_their_first_unit_is_due(void)
{
    enum { UNITS = 512 / FILE_ALIGN };

    start((GEOMETRY){1, 0xFF});
    SysFileCreate(FILE_SLOT_A);
    CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, pattern, 512), ERR_OK);
    CHECK_EQUAL(SimFlashOps(), 1 + UNITS); /* one erase, all units programmed */
    CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, pattern, FILE_ALIGN - 1), ERR_OK);
    CHECK_EQUAL(SimFlashOps(), 1 + UNITS);
    CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, pattern, 1), ERR_OK);
    CHECK_EQUAL(SimFlashOps(), 1 + UNITS + 2);
    CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, pattern, 512 - FILE_ALIGN), ERR_OK);
    CHECK_EQUAL(SimFlashOps(), 2 * (1 + UNITS));
}

static void a_second_writing_replaces_the_first(void)
{
    start((GEOMETRY){8, 0xFF});
    SysFileCreate(FILE_SLOT_A);
    CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, pattern + 1, 2000), ERR_OK);
    SysFileCreate(FILE_SLOT_A);
    CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, pattern, 1000), ERR_OK);
    CHECK_EQUAL(SysFileClose(FILE_SLOT_A), ERR_OK);
    CHECK(holds_pattern(FILE_SLOT_A, 1000));
    CHECK_EQUAL(SimFlashViolations(), 0);
}

static void a_file_ends_where_its_area_ends(void)
{
    RTS_UI32 size;
    RTS_UI32 i;

    start((GEOMETRY){8, 0xFF});
    size = SysFileGetArea(FILE_COMMIT)->size;
    SysFileCreate(FILE_COMMIT);
    CHECK_EQUAL(SysFileWrite(FILE_COMMIT, pattern, size + 1), ERR_DISK_FULL);
    CHECK_EQUAL(SysFileGetPos(FILE_COMMIT), 0);
    for (i = 0; i < size; i += 64)
        CHECK_EQUAL(SysFileWrite(FILE_COMMIT, pattern, 64), ERR_OK);
    CHECK_EQUAL(SysFileWrite(FILE_COMMIT, pattern, 1), ERR_DISK_FULL);
    CHECK_EQUAL(SysFileClose(FILE_COMMIT), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

/* From what is programmed, from what is not, and from what the copy itself has just written. */
static void what_was_written_can_be_copied(void)
{
    static const RTS_UI32 copies[][2] = {{1, 40}, {5, 3}, {17, 100}, {100, 33}, {700, 600}, {1, 1}};
    static RTS_UI8 expected[4096];
    static RTS_UI8 read[sizeof expected];

    for (RTS_SIZE g = 0; g < RTS_COUNT(geometries); g++) {
        RTS_UI32 size = 733;
        start(geometries[g]);
        memcpy(expected, pattern, size);
        SysFileCreate(FILE_SLOT_A);
        CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, pattern, size), ERR_OK);
        for (RTS_SIZE i = 0; i < RTS_COUNT(copies); i++) {
            CHECK_EQUAL(SysFileCopy(FILE_SLOT_A, copies[i][0], copies[i][1]), ERR_OK);
            for (RTS_UI32 n = 0; n < copies[i][1]; n++, size++)
                expected[size] = expected[size - copies[i][0]];
            CHECK_EQUAL(SysFileGetPos(FILE_SLOT_A), size);
        }
        CHECK_EQUAL(SysFileCopy(FILE_SLOT_A, size + 1, 1), ERR_OUT_OF_LIMITS);
        CHECK_EQUAL(SysFileCopy(FILE_SLOT_A, 0, 1), ERR_OUT_OF_LIMITS);
        CHECK_EQUAL(SysFileCopy(FILE_SLOT_A, 1, SysFileGetArea(FILE_SLOT_A)->size), ERR_DISK_FULL);
        CHECK_EQUAL(SimFlashViolations(), 0);
        SysFileCreate(FILE_SLOT_A);
        CHECK_EQUAL(SysFileCopy(FILE_SLOT_A, 1, 1), ERR_OUT_OF_LIMITS);
        CHECK_EQUAL(SysFileRead(FILE_SLOT_A, 0, read, size / FILE_ALIGN * FILE_ALIGN), ERR_OK);
        CHECK(memcmp(read, expected, size / FILE_ALIGN * FILE_ALIGN) == 0);
    }
}

static void reading_stays_within_the_file(void)
{
    RTS_UI32 size;
    RTS_UI8 data[8];

    start((GEOMETRY){8, 0xFF});
    size = SysFileGetArea(FILE_SLOT_A)->size;
    CHECK_EQUAL(SysFileRead(FILE_SLOT_A, size - 8, data, 8), ERR_OK);
    CHECK_EQUAL(SysFileRead(FILE_SLOT_A, size - 7, data, 8), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(SysFileRead(FILE_SLOT_A, 0xFFFFFFFF, data, 1), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(SysFileRead(FILE_SLOT_A, 1, data, 0xFFFFFFFF), ERR_OUT_OF_LIMITS);
}

static void faults_are_reported(void)
{
    start((GEOMETRY){8, 0xFF});
    SysFileCreate(FILE_SLOT_A);
    SimFlashCut(1, SIM_FAULT);
    CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, pattern, FILE_ALIGN), ERR_DEVICE);
    SysFileCreate(FILE_SLOT_A);
    SimFlashCut(2, SIM_FAULT);
    CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, pattern, FILE_ALIGN), ERR_DEVICE);
    SysFileCreate(FILE_SLOT_A);
    CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, pattern, 1), ERR_OK);
    SimFlashCut(2, SIM_FAULT);
    CHECK_EQUAL(SysFileClose(FILE_SLOT_A), ERR_DEVICE);
    SimFlashCut(1, SIM_FAULT);
    CHECK_EQUAL(SysFileErase(FILE_SLOT_A, 0, 1024), ERR_DEVICE);
    CHECK_EQUAL(SysFileErase(FILE_SLOT_A, 0, 1024), ERR_OK);
}

int main(void)
{
    RUN(files_lie_side_by_side_on_sector_borders);
    RUN(a_flash_that_is_too_small_stops_the_start_up);
    RUN(what_is_written_in_pieces_can_be_read);
    RUN(an_odd_end_is_padded_with_the_erased_value);
    RUN(sectors_are_erased_when_their_first_unit_is_due);
    RUN(a_second_writing_replaces_the_first);
    RUN(a_file_ends_where_its_area_ends);
    RUN(what_was_written_can_be_copied);
    RUN(reading_stays_within_the_file);
    RUN(faults_are_reported);
    return test_result();
}
