/*
 * test_flash_map.c - a port that says itself where the files are in flash (FILE_MAP).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * SysFileFlash is compiled a second time here, with such a map.
 */
#define FILE_MAP                                          \
    {0x4000, 0x2000}, {0x8000, 0x4000}, {0x0000, 0x0400}, \
    {                                                     \
        0x1000, 0x1000                                    \
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
#include "../../firmware/src/sys/SysFileFlash.c"

#include "Sim.h"
#include "test.h"

static RTS_RESULT start(RTS_UI32 size, RTS_UI32 sector_size)
{
    CHECK_EQUAL(SimFlashConfigure(size, sector_size, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    return SysFileFlash_Hook(CH_INIT_SYSTEM2);
}

static void files_lie_where_the_map_says(void)
{
    RTS_UI8 data[FILE_ALIGN] = "1234567";

    CHECK_EQUAL(start(0xC000, 512), ERR_OK);
    CHECK_EQUAL(SysFileGetArea(FILE_SLOT_B)->offset, 0x8000);
    CHECK_EQUAL(SysFileGetArea(FILE_SLOT_B)->size, 0x4000);
    SysFileCreate(FILE_RETAIN);
    CHECK_EQUAL(SysFileWrite(FILE_RETAIN, data, sizeof data), ERR_OK);
    CHECK(memcmp(SimFlashData() + 0x1000, data, sizeof data) == 0);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

static void a_map_beyond_the_flash_is_refused(void)
{
    CHECK_EQUAL(start(0xBE00, 512), ERR_NOMEMORY);
}

static void a_map_off_the_sector_borders_is_refused(void)
{
    CHECK_EQUAL(start(0x10000, 1024), ERR_NOMEMORY); /* the commit log would have one sector only */
    CHECK_EQUAL(start(0x40000, 0x4000), ERR_NOMEMORY);
}

/* True if a file may lie there, with the first one in 0x4000 to 0x5FFF of 0xC000. */
static bool may_lie(RTS_UI32 file, RTS_UI32 offset, RTS_UI32 size)
{
    CHECK_EQUAL(start(0xC000, 512), ERR_OK);
    files[file].area = (FILE_AREA){offset, size};
    return is_valid(file);
}

static void a_file_ends_where_the_next_one_begins_or_the_flash_ends(void)
{
    CHECK(may_lie(FILE_SLOT_B, 0x3E00, 0x200) && may_lie(FILE_SLOT_B, 0x6000, 0x200));
    CHECK(may_lie(FILE_SLOT_B, 0, 0x4000) && may_lie(FILE_SLOT_B, 0x6000, 0x6000));
    CHECK(!may_lie(FILE_SLOT_B, 0x3E00, 0x400) && !may_lie(FILE_SLOT_B, 0x5E00, 0x200));
    CHECK(!may_lie(FILE_SLOT_B, 0x4200, 0x200) && !may_lie(FILE_SLOT_B, 0x3E00, 0x3000));
    CHECK(!may_lie(FILE_SLOT_B, 0x6000, 0x6200) && !may_lie(FILE_SLOT_B, 0xC000, 0x200));
    CHECK(!may_lie(FILE_SLOT_B, 0, 0xC200) && !may_lie(FILE_SLOT_B, 0xFFFFFE00, 0x400));
    CHECK(!may_lie(FILE_SLOT_B, 0x6000, 0));
    CHECK(may_lie(FILE_SLOT_A, 0, 0xC000)); /* only files before it count, and there is none */
}

static void the_halves_of_a_log_are_whole_sectors(void)
{
    CHECK(may_lie(FILE_COMMIT, 0, 0x400) && may_lie(FILE_COMMIT, 0, 0x800));
    CHECK(!may_lie(FILE_COMMIT, 0, 0x200) && !may_lie(FILE_COMMIT, 0, 0x600));
}

static bool is_usable(RTS_UI32 size, RTS_UI32 sector_size, RTS_UI32 program_size)
{
    SYS_FLASH flash = *SysFlashGet();

    flash.size = size;
    flash.sector_size = sector_size;
    flash.program_size = program_size;
    return flash_is_valid(&flash);
}

static void a_flash_has_sectors_that_hold_the_head_of_a_record(void)
{
    CHECK(is_usable(0x8000, 2 * FILE_ALIGN, FILE_ALIGN) && is_usable(0x8000, 1024, 1));
    CHECK(!is_usable(0x8000, FILE_ALIGN, FILE_ALIGN) && !is_usable(0x8000, 1024, 2 * FILE_ALIGN));
    CHECK(!is_usable(0x8200, 1024, 8) && !is_usable(0x8000, 1000, 8) && !is_usable(0x8000, 1024, 12));
    CHECK(!is_usable(0x8000, 0, 8) && !is_usable(0x8000, 1024, 0));
}

int main(void)
{
    RUN(files_lie_where_the_map_says);
    RUN(a_map_beyond_the_flash_is_refused);
    RUN(a_map_off_the_sector_borders_is_refused);
    RUN(a_file_ends_where_the_next_one_begins_or_the_flash_ends);
    RUN(the_halves_of_a_log_are_whole_sectors);
    RUN(a_flash_has_sectors_that_hold_the_head_of_a_record);
    return test_result();
}
