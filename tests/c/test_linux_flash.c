/*
 * test_linux_flash.c - SysFlash: a file that obeys the rules of NOR flash.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "SysFlash.h"

#include "port.h"
#include "rts_config.h"
#include "test.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

enum { SECTOR = BOARD_FLASH_SECTOR_SIZE, UNIT = BOARD_FLASH_PROGRAM_SIZE };

static char path[64];
static const RTS_UI8 pattern[2 * UNIT] = "0123456789abcde";

static const SYS_FLASH *open_flash(void)
{
    PORT_REASON reason = {"", false};
    CHECK(PortFlashOpen(path, &reason));
    CHECK_EQUAL(reason.text[0], '\0');
    return SysFlashGet();
}

static const SYS_FLASH *new_flash(void)
{
    PortFlashClose();
    unlink(path);
    return open_flash();
}

/* What the port asks the system to make durable, and a disk that fails on request: in place of the C library's. */
static int synced_folders;
static bool disk_fails;

int fsync(int file)
{
    struct stat info;
    CHECK_EQUAL(fstat(file, &info), 0);
    synced_folders += S_ISDIR(info.st_mode);
    return 0;
}

ssize_t pread(int file, void *data, size_t size, off_t offset)
{
    if (disk_fails) {
        errno = EIO;
        return -1;
    }
    return lseek(file, offset, SEEK_SET) == offset ? read(file, data, size) : -1;
}

static RTS_UI8 byte_at(const SYS_FLASH *flash, RTS_UI32 offset)
{
    RTS_UI8 byte = 0;
    CHECK_EQUAL(flash->read(offset, &byte, 1), ERR_OK);
    return byte;
}

static off_t file_size(void)
{
    struct stat info;
    CHECK_EQUAL(stat(path, &info), 0);
    return info.st_size;
}

static void a_new_file_is_erased_flash(void)
{
    const SYS_FLASH *flash = new_flash();
    CHECK(flash->size == BOARD_FLASH_SIZE && flash->size % flash->sector_size == 0);
    CHECK_EQUAL(file_size(), (off_t)flash->size);
    CHECK_EQUAL(byte_at(flash, 0), flash->erased);
    CHECK_EQUAL(byte_at(flash, flash->size - 1), flash->erased);
}

static void what_was_programmed_can_be_read(void)
{
    const SYS_FLASH *flash = new_flash();
    RTS_UI8 back[sizeof(pattern)];
    CHECK_EQUAL(flash->program(SECTOR + UNIT, pattern, sizeof(pattern)), ERR_OK);
    CHECK_EQUAL(flash->read(SECTOR + UNIT, back, sizeof(back)), ERR_OK);
    CHECK(memcmp(back, pattern, sizeof(back)) == 0);
    CHECK_EQUAL(flash->sync(), ERR_OK);
}

static void a_byte_is_programmed_once_only(void)
{
    const SYS_FLASH *flash = new_flash();
    RTS_UI8 zero[UNIT] = {0};
    CHECK_EQUAL(flash->program(0, pattern, sizeof(pattern)), ERR_OK);
    CHECK_EQUAL(flash->program(UNIT, zero, sizeof(zero)), ERR_DEVICE);
    CHECK_EQUAL(byte_at(flash, UNIT), pattern[UNIT]);
}

static void erase_clears_one_sector(void)
{
    const SYS_FLASH *flash = new_flash();
    for (RTS_UI32 offset = 0; offset < 3 * SECTOR; offset += SECTOR) {
        CHECK_EQUAL(flash->program(offset, pattern, sizeof(pattern)), ERR_OK);
    }
    CHECK_EQUAL(flash->erase(SECTOR), ERR_OK);
    CHECK_EQUAL(byte_at(flash, 0), pattern[0]);
    CHECK_EQUAL(byte_at(flash, SECTOR), flash->erased);
    CHECK_EQUAL(byte_at(flash, 2 * SECTOR), pattern[0]);
    CHECK_EQUAL(flash->program(SECTOR, pattern, sizeof(pattern)), ERR_OK);
}

static void what_is_not_aligned_is_refused(void)
{
    const SYS_FLASH *flash = new_flash();
    CHECK_EQUAL(flash->program(1, pattern, UNIT), ERR_DEVICE);
    CHECK_EQUAL(flash->program(0, pattern, UNIT - 1), ERR_DEVICE);
    CHECK_EQUAL(flash->erase(UNIT), ERR_DEVICE);
    CHECK_EQUAL(byte_at(flash, 0), flash->erased);
}

static void what_lies_outside_is_refused(void)
{
    const SYS_FLASH *flash = new_flash();
    RTS_UI8 bytes[2 * UNIT];
    CHECK_EQUAL(flash->read(flash->size - UNIT, bytes, 2 * UNIT), ERR_DEVICE);
    CHECK_EQUAL(flash->read(0xFFFFFFFF, bytes, 2), ERR_DEVICE);
    CHECK_EQUAL(flash->program(flash->size - UNIT, pattern, 2 * UNIT), ERR_DEVICE);
    CHECK_EQUAL(flash->program(0xFFFFFFF8, pattern, 2 * UNIT), ERR_DEVICE);
    CHECK_EQUAL(flash->erase(flash->size), ERR_DEVICE);
    CHECK_EQUAL(file_size(), (off_t)flash->size);
}

static void the_name_of_a_new_file_is_made_durable(void)
{
    synced_folders = 0;
    (void)new_flash();
    CHECK_EQUAL(synced_folders, 1);
}

static void a_disk_that_cannot_be_read_is_an_error(void)
{
    const SYS_FLASH *flash = new_flash();
    RTS_UI8 byte;
    disk_fails = true;
    CHECK_EQUAL(flash->read(0, &byte, 1), ERR_DEVICE);
    CHECK_EQUAL(flash->program(0, pattern, sizeof(pattern)), ERR_DEVICE);
    CHECK(SysFlashMapCode(0, 0, 16) == NULL);
    disk_fails = false;
    CHECK_EQUAL(byte_at(flash, 0), flash->erased);
}

static void a_file_cut_short_while_in_use_is_an_error(void)
{
    const SYS_FLASH *flash = new_flash();
    RTS_UI8 byte;
    CHECK_EQUAL(truncate(path, SECTOR), 0);
    CHECK_EQUAL(flash->read(SECTOR - 1, &byte, 1), ERR_OK);
    CHECK_EQUAL(flash->read(SECTOR, &byte, 1), ERR_DEVICE);
}

static void it_is_all_there_after_a_restart(void)
{
    const SYS_FLASH *flash = new_flash();
    CHECK_EQUAL(flash->program(5 * SECTOR, pattern, sizeof(pattern)), ERR_OK);
    PortFlashClose();
    flash = open_flash();
    CHECK_EQUAL(byte_at(flash, 5 * SECTOR + 1), pattern[1]);
    CHECK_EQUAL(flash->program(5 * SECTOR, pattern, sizeof(pattern)), ERR_DEVICE);
}

static void a_creation_that_was_cut_short_is_completed(void)
{
    (void)new_flash();
    PortFlashClose();
    CHECK_EQUAL(truncate(path, SECTOR + 3), 0);
    const SYS_FLASH *flash = open_flash();
    CHECK_EQUAL(byte_at(flash, SECTOR + 3), flash->erased);
    CHECK_EQUAL(file_size(), (off_t)flash->size);
}

static void check_refused(const char *part_of_reason)
{
    PORT_REASON reason = {"", false};
    CHECK(!PortFlashOpen(path, &reason));
    CHECK(strstr(reason.text, part_of_reason) != NULL);
    CHECK(strstr(reason.text, path) != NULL);
}

static void a_file_that_is_in_use_is_refused(void)
{
    (void)new_flash();
    PortFlashClose();
    int other = open(path, O_RDWR);
    CHECK_EQUAL(flock(other, LOCK_EX | LOCK_NB), 0);
    check_refused("in use");
    close(other);
    (void)open_flash();
    other = open(path, O_RDWR);
    CHECK(flock(other, LOCK_EX | LOCK_NB) != 0);
    close(other);
}

static void a_file_that_is_no_flash_is_refused_and_not_touched(void)
{
    (void)new_flash();
    PortFlashClose();
    CHECK_EQUAL(truncate(path, BOARD_FLASH_SIZE + 1), 0);
    check_refused("not a flash file");
    CHECK_EQUAL(file_size(), BOARD_FLASH_SIZE + 1);
    unlink(path);
    int notes = open(path, O_WRONLY | O_CREAT, 0600);
    CHECK_EQUAL(write(notes, pattern, sizeof(pattern)), sizeof(pattern));
    close(notes);
    check_refused("not a flash file");
    CHECK_EQUAL(file_size(), sizeof(pattern));
    unlink(path);
    CHECK_EQUAL(mkdir(path, 0700), 0);
    check_refused("cannot open");
    rmdir(path);
}

/* ---- code ---- */

#if defined(__x86_64__)
static const RTS_UI8 return_42[8] = {0xB8, 42, 0, 0, 0, 0xC3, 0x90, 0x90}; /* mov eax, 42; ret */
#elif defined(__aarch64__)
static const RTS_UI8 return_42[8] = {0x40, 0x05, 0x80, 0x52, 0xC0, 0x03, 0x5F, 0xD6}; /* mov w0, 42; ret */
#elif defined(__arm__)
static const RTS_UI8 return_42[8] = {0x2A, 0x20, 0x70, 0x47, 0x00, 0xBF, 0x00, 0xBF}; /* movs r0, #42; bx lr */
#endif

static int call(const RTS_UI8 *code)
{
    return ((int (*)(void))((uintptr_t)code | APP_ENTRY_MODE_BIT))();
}

static void code_of_both_slots_runs_until_it_is_released(void)
{
    const SYS_FLASH *flash = new_flash();
    CHECK_EQUAL(flash->program(0, return_42, sizeof(return_42)), ERR_OK);
    CHECK_EQUAL(flash->program(3 * SECTOR, return_42, sizeof(return_42)), ERR_OK);
    const RTS_UI8 *a = SysFlashMapCode(0, 0, sizeof(return_42));
    const RTS_UI8 *b = SysFlashMapCode(1, 3 * SECTOR, sizeof(return_42));
    CHECK(a != NULL && b != NULL && a != b);
    CHECK((uintptr_t)a % 16 == 0 && (uintptr_t)b % 16 == 0);
    CHECK(call(a) == 42 && call(b) == 42);
    SysFlashReleaseCode(0);
    CHECK_EQUAL(call(b), 42);
    SysFlashReleaseCode(0);
    a = SysFlashMapCode(0, 3 * SECTOR, sizeof(return_42));
    CHECK(a != NULL && call(a) == 42);
}

static void code_that_does_not_exist_is_not_mapped(void)
{
    (void)new_flash();
    CHECK(SysFlashMapCode(2, 0, 16) == NULL);
    CHECK(SysFlashMapCode(0, BOARD_FLASH_SIZE - 8, 16) == NULL);
    CHECK(SysFlashMapCode(0, 0, PORT_CODE_SIZE + 1) == NULL);
    SysFlashReleaseCode(2);
}

int main(void)
{
    char folder[] = "/tmp/test_linux_flash.XXXXXX";
    if (mkdtemp(folder) == NULL) {
        return 1;
    }
    snprintf(path, sizeof(path), "%s/flash", folder);
    RUN(a_new_file_is_erased_flash);
    RUN(what_was_programmed_can_be_read);
    RUN(a_byte_is_programmed_once_only);
    RUN(erase_clears_one_sector);
    RUN(what_is_not_aligned_is_refused);
    RUN(what_lies_outside_is_refused);
    RUN(the_name_of_a_new_file_is_made_durable);
    RUN(a_disk_that_cannot_be_read_is_an_error);
    RUN(a_file_cut_short_while_in_use_is_an_error);
    RUN(it_is_all_there_after_a_restart);
    RUN(a_creation_that_was_cut_short_is_completed);
    RUN(a_file_that_is_in_use_is_refused);
    RUN(a_file_that_is_no_flash_is_refused_and_not_touched);
    RUN(code_of_both_slots_runs_until_it_is_released);
    RUN(code_that_does_not_exist_is_not_mapped);
    PortFlashClose();
    unlink(path);
    rmdir(folder);
    return test_result();
}
