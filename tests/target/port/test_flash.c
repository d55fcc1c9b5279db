/*
 * test_flash.c - the NOR rules of the board's flash driver, and what surrounds it: random numbers, identity, reset
 * cause.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CompactDownload.h"
#include "BareMetal.h"
#include "SysFlash.h"
#include "SysTarget.h"
#include "check.h"

enum { SECTOR = 2 }; /* the one the tests use */

static const SYS_FLASH *flash;
static RTS_UI32 base;
static const RTS_UI8 pattern[16] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16};

static RTS_UI8 byte_at(RTS_UI32 offset)
{
    RTS_UI8 byte = 0;
    CHECK_EQUAL(flash->read(offset, &byte, 1), ERR_OK);
    if (flash->mapped != NULL)
        CHECK_EQUAL(flash->mapped[offset], byte);
    return byte;
}

static int is_erased(RTS_UI32 offset, RTS_UI32 size)
{
    while (size && byte_at(offset) == flash->erased)
        offset++, size--;
    return size == 0;
}

static int is_pattern(RTS_UI32 offset)
{
    RTS_UI8 back[sizeof(pattern)];
    CHECK_EQUAL(flash->read(offset, back, sizeof(back)), ERR_OK);
    return memcmp(back, pattern, sizeof(pattern)) == 0;
}

static void geometry_is_sound(void)
{
    CHECK_EQUAL(flash->size % flash->sector_size, 0);
    CHECK_EQUAL(flash->sector_size & (flash->sector_size - 1), 0);
    CHECK_EQUAL(sizeof(pattern) % flash->program_size, 0);
}

static void erase_sets_one_sector(void)
{
    CHECK_EQUAL(flash->erase(base + flash->sector_size), ERR_OK);
    CHECK_EQUAL(flash->program(base + flash->sector_size, pattern, sizeof(pattern)), ERR_OK);
    CHECK_EQUAL(flash->erase(base), ERR_OK);
    CHECK(is_erased(base, flash->sector_size));
    CHECK(is_pattern(base + flash->sector_size));
}

static void programmed_bytes_are_read_back(void)
{
    CHECK_EQUAL(flash->erase(base), ERR_OK);
    CHECK_EQUAL(flash->program(base + 32, pattern, sizeof(pattern)), ERR_OK);
    CHECK(is_pattern(base + 32));
    CHECK(is_erased(base, 32));
    CHECK(is_erased(base + 48, 64));
    CHECK_EQUAL(flash->sync(), ERR_OK);
}

static void a_unit_is_programmed_once(void)
{
    CHECK_EQUAL(flash->erase(base), ERR_OK);
    CHECK_EQUAL(flash->program(base, pattern, flash->program_size), ERR_OK);
    CHECK_EQUAL(flash->program(base, pattern, flash->program_size), ERR_DEVICE);
    CHECK_EQUAL(flash->program(base + flash->program_size, pattern, flash->program_size), ERR_OK);
}

static void only_whole_units_are_programmed(void)
{
    CHECK_EQUAL(flash->erase(base), ERR_OK);
    if (flash->program_size > 1) {
        CHECK_EQUAL(flash->program(base + 1, pattern, flash->program_size), ERR_DEVICE);
        CHECK_EQUAL(flash->program(base, pattern, flash->program_size + 1), ERR_DEVICE);
    }
    CHECK(is_erased(base, flash->sector_size));
}

static void nothing_reaches_past_the_end(void)
{
    RTS_UI8 byte;
    CHECK_EQUAL(flash->program(flash->size, pattern, flash->program_size), ERR_DEVICE);
    CHECK_EQUAL(flash->program(0xFFFFFFF8u, pattern, 16), ERR_DEVICE);
    CHECK_EQUAL(flash->read(flash->size, &byte, 1), ERR_DEVICE);
    CHECK_EQUAL(flash->read(4, &byte, 0xFFFFFFFFu), ERR_DEVICE);
    CHECK_EQUAL(flash->erase(flash->size), ERR_DEVICE);
    CHECK_EQUAL(flash->erase(1), ERR_DEVICE);
}

/* In place, or in a copy. */
static void code_can_be_run(void)
{
    CHECK_EQUAL(flash->erase(base), ERR_OK);
    CHECK_EQUAL(flash->program(base + 16, pattern, sizeof(pattern)), ERR_OK);
    const RTS_UI8 *code = SysFlashMapCode(0, base + 16, sizeof(pattern));
    CHECK(code != NULL && (uintptr_t)code % 16 == 0 && memcmp(code, pattern, sizeof(pattern)) == 0);
    CHECK(SysFlashMapCode(1, flash->size - 16, 17) == NULL);
    SysFlashReleaseCode(0);
}

static void target_has_a_name_and_a_serial_number(void)
{
    const SYS_TARGET *target = SysTargetGet();
    CHECK_EQUAL(target->type, TARGET_TYPE_PROGRAMMABLE);
    CHECK(target->serial_number[0] != '\0');
    CHECK(target->device_name[0] != '\0');
}

static void random_numbers_differ(void)
{
    RTS_UI32 one = SysTargetRandom();
    CHECK(SysTargetRandom() != one);
    CHECK(SysTargetRandom() != one);
}

static void first_start_is_power_on(void)
{
    CHECK_EQUAL(ResetGet()->cause, RESET_POWER_ON);
}

int main(void)
{
    TEST_BEGIN();
    flash = SysFlashGet();
    base = SECTOR * flash->sector_size;
    TEST_RUN(geometry_is_sound);
    TEST_RUN(erase_sets_one_sector);
    TEST_RUN(programmed_bytes_are_read_back);
    TEST_RUN(a_unit_is_programmed_once);
    TEST_RUN(only_whole_units_are_programmed);
    TEST_RUN(nothing_reaches_past_the_end);
    TEST_RUN(code_can_be_run);
    TEST_RUN(target_has_a_name_and_a_serial_number);
    TEST_RUN(random_numbers_differ);
    TEST_RUN(first_start_is_power_on);
    TEST_END();
}
