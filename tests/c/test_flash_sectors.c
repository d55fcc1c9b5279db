/*
 * test_flash_sectors.c - a flash whose sectors have different sizes (FLASH_SECTOR_AT): those of an STM32F4, a 16th as
 * large. Programs use the larger ones, the commit log two of the smallest.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * SysFileFlash is compiled a second time here, on a flash that accepts an erase only where a sector begins, and
 * remembers which.
 */
#include "CmpStd.h"

static RTS_UI32 sector_at(RTS_UI32 offset);
#define FLASH_SECTOR_AT(offset) sector_at(offset)
#define FILE_MAP                                          \
    {0x4000, 0x4000}, {0x8000, 0x4000}, {0x0400, 0x0800}, \
    {                                                     \
        0xC000, 0x4000                                    \
    }
#define SysFileGetArea test_area
#define SysFileCreate test_create
#define SysFileCreateAt test_create_at
#define SysFileAppend test_append
#define SysFileWrite test_write
#define SysFileCopy test_copy
#define SysFileGetPos test_pos
#define SysFileClose test_close
#define SysFileRead test_read
#define SysFileCRC32 test_crc
#define SysFileErase test_erase
#define SysFileFlash_Hook test_hook
#define SysFlashGet test_flash
#include "../../firmware/src/sys/SysFileFlash.c"

#include "test.h"

enum { SIZE = 0x10000, SMALLEST = 0x400, MAX_ERASES = 16 };

static RTS_UI8 cells[SIZE];
static RTS_UI32 erased[MAX_ERASES], erases;

/* Four of 1 KiB, one of 4 KiB, the others of 8 KiB. */
static RTS_UI32 sector_at(RTS_UI32 offset)
{
    return offset < 0x1000 ? 0x400 : offset < 0x2000 ? 0x1000 : 0x2000;
}

static RTS_RESULT read_cells(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    memcpy(data, cells + offset, size);
    return ERR_OK;
}

static RTS_RESULT program_cells(RTS_UI32 offset, const void *data, RTS_UI32 size)
{
    RTS_UI32 i;

    for (i = 0; i < size; i++)
        CHECK_EQUAL(cells[offset + i], 0xFF);
    memcpy(cells + offset, data, size);
    return ERR_OK;
}

static RTS_RESULT erase_sector(RTS_UI32 offset)
{
    CHECK_EQUAL(offset % sector_at(offset), 0);
    memset(cells + offset, 0xFF, sector_at(offset));
    if (erases < MAX_ERASES)
        erased[erases++] = offset;
    return ERR_OK;
}

static RTS_RESULT sync_cells(void)
{
    return ERR_OK;
}

const SYS_FLASH *SysFlashGet(void)
{
    static const SYS_FLASH flash = {
        SIZE, SMALLEST, 4, 0xFF, NULL, read_cells, program_cells, erase_sector, sync_cells,
    };
    return &flash;
}

static void start(void)
{
    memset(cells, 0, sizeof cells);
    CHECK_EQUAL(SysFileFlash_Hook(CH_INIT_SYSTEM2), ERR_OK);
    erases = 0;
}

static void each_sector_is_erased_once_when_its_first_unit_is_written(void)
{
    static const RTS_UI8 data[0x2000 + FILE_ALIGN] = {1};

    start();
    SysFileCreate(FILE_SLOT_A);
    CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, data, 0x2000), ERR_OK);
    CHECK_EQUAL(erases, 1);
    CHECK_EQUAL(SysFileWrite(FILE_SLOT_A, data, FILE_ALIGN), ERR_OK);
    CHECK_EQUAL(erases, 2);
    CHECK_EQUAL(erased[0], 0x4000);
    CHECK_EQUAL(erased[1], 0x6000);
}

static void half_a_log_is_erased_by_its_own_sectors(void)
{
    start();
    CHECK_EQUAL(SysFileErase(FILE_COMMIT, 0x400, 0x400), ERR_OK);
    CHECK_EQUAL(SysFileErase(FILE_RETAIN, 0x2000, 0x2000), ERR_OK);
    CHECK_EQUAL(erases, 2);
    CHECK_EQUAL(erased[0], 0x800);
    CHECK_EQUAL(erased[1], 0xE000);
}

/* The seal of a slot goes with its first sector, whose size the caller does not know. */
static void erasing_the_smallest_size_takes_the_sector_that_begins_there(void)
{
    start();
    CHECK_EQUAL(SysFileErase(FILE_SLOT_B, 0, SysFlashGet()->sector_size), ERR_OK);
    CHECK_EQUAL(erases, 1);
    CHECK_EQUAL(erased[0], 0x8000);
}

static bool is_log_valid(RTS_UI32 offset, RTS_UI32 size)
{
    files[FILE_COMMIT].area = (FILE_AREA){offset, size};
    return is_valid(FILE_COMMIT);
}

static void a_log_whose_halves_are_no_sectors_is_invalid(void)
{
    start();
    CHECK(is_log_valid(0x400, 0x800));
    CHECK(is_log_valid(0x0, 0x1000));
    CHECK(!is_log_valid(0xC00, 0x1400));  /* 1 KiB and 4 KiB: no border in the middle */
    CHECK(!is_log_valid(0x1000, 0x1000)); /* one sector */
    CHECK(!is_log_valid(0x200, 0x800));
    CHECK(!is_log_valid(0x400, 0x900));
}

int main(void)
{
    RUN(each_sector_is_erased_once_when_its_first_unit_is_written);
    RUN(half_a_log_is_erased_by_its_own_sectors);
    RUN(erasing_the_smallest_size_takes_the_sector_that_begins_there);
    RUN(a_log_whose_halves_are_no_sectors_is_invalid);
    return test_result();
}
