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

int main(void)
{
    RUN(files_lie_where_the_map_says);
    RUN(a_map_beyond_the_flash_is_refused);
    RUN(a_map_off_the_sector_borders_is_refused);
    return test_result();
}
