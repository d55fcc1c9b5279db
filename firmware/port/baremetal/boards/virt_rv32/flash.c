/*
 * flash.c - SysFlash on parallel NOR flash with the Intel command set (CFI): two chips of 16 bits side by side.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Each half of a word goes to one of the chips, commands too. While they program or erase, what is read is their status:
 * programs run in RAM (CodeInRam.c), and only main reads. QEMU has one command set for both and no times.
 */
#include <string.h>

#include "BareMetal.h"
#include "SysFlash.h"

#define FLASH 0x22000000u
#define BOTH(command) ((command) << 16 | (command))

enum { CMD_PROGRAM = 0x40, CMD_ERASE = 0x20, CMD_CONFIRM = 0xD0, CMD_CLEAR_STATUS = 0x50, CMD_READ = 0xFF };
#define STATUS_READY BOTH(0x80u)
#define STATUS_ERRORS BOTH(0x3Au) /* erase, program, voltage, protected */

enum { SECTOR_SIZE = BOARD_FLASH_SECTOR_SIZE, PROGRAM_SIZE = 4, ERASED = BOARD_FLASH_ERASED };
enum { READY_TRIES = 10000000 }; /* an erase takes up to 4 s */

static bool is_inside(RTS_UI32 offset, RTS_UI32 size)
{
    return offset <= BOARD_FLASH_SIZE && size <= BOARD_FLASH_SIZE - offset;
}

static RTS_RESULT flash_read(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    if (!is_inside(offset, size))
        return ERR_DEVICE;
    memcpy(data, (const void *)(uintptr_t)(FLASH + offset), size);
    return ERR_OK;
}

/* Whether the command at `offset` ends well. */
static bool wait_for_end(RTS_UI32 offset)
{
    RTS_UI32 status = 0;
    for (RTS_UI32 i = 0; i < READY_TRIES && (status & STATUS_READY) != STATUS_READY; i++)
        status = REG32(FLASH + offset);
    return (status & (STATUS_READY | STATUS_ERRORS)) == STATUS_READY;
}

/* The flash is memory again. */
static RTS_RESULT end_commands(bool worked)
{
    REG32(FLASH) = BOTH(CMD_CLEAR_STATUS);
    REG32(FLASH) = BOTH(CMD_READ);
    return worked ? ERR_OK : ERR_DEVICE;
}

static bool is_erased(RTS_UI32 offset, RTS_UI32 size)
{
    const RTS_UI8 *cell = (const RTS_UI8 *)(uintptr_t)(FLASH + offset);
    while (size != 0 && *cell == ERASED)
        cell++, size--;
    return size == 0;
}

static RTS_RESULT flash_program(RTS_UI32 offset, const void *data, RTS_UI32 size)
{
    if (!is_inside(offset, size) || offset % PROGRAM_SIZE || size % PROGRAM_SIZE || !is_erased(offset, size))
        return ERR_DEVICE;
    bool works = true;
    for (RTS_UI32 done = 0; done < size && works; done += PROGRAM_SIZE) {
        RTS_UI32 word;
        memcpy(&word, (const RTS_UI8 *)data + done, sizeof(word));
        REG32(FLASH + offset + done) = BOTH(CMD_PROGRAM);
        REG32(FLASH + offset + done) = word;
        works = wait_for_end(offset + done);
    }
    return end_commands(works);
}

static RTS_RESULT flash_erase(RTS_UI32 offset)
{
    if (!is_inside(offset, SECTOR_SIZE) || offset % SECTOR_SIZE)
        return ERR_DEVICE;
    REG32(FLASH + offset) = BOTH(CMD_ERASE);
    REG32(FLASH + offset) = BOTH(CMD_CONFIRM);
    return end_commands(wait_for_end(offset));
}

/* Each command has ended before the next call. */
static RTS_RESULT flash_sync(void)
{
    return ERR_OK;
}

const SYS_FLASH *SysFlashGet(void)
{
    static const SYS_FLASH flash = {
        .size = BOARD_FLASH_SIZE,
        .sector_size = SECTOR_SIZE,
        .program_size = PROGRAM_SIZE,
        .erased = ERASED,
        .mapped = NULL,
        .read = flash_read,
        .program = flash_program,
        .erase = flash_erase,
        .sync = flash_sync,
    };
    return &flash;
}
