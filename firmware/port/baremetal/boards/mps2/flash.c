/*
 * flash.c - SysFlash on the board's PSRAM, which QEMU keeps in a file, with the rules of NOR flash.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Stricter than the memory: a unit is programmed once after an erase, nothing is written past the area, and the MPU
 * keeps all others from writing at all, as a flash controller would.
 */
#include <string.h>

#include "BareMetal.h"
#include "SysFlash.h"

#define FILE_FLASH ((RTS_UI8 *)(uintptr_t)BOARD_FLASH_ADDRESS)

enum { SECTOR_SIZE = BOARD_FLASH_SECTOR_SIZE, PROGRAM_SIZE = 8, ERASED = BOARD_FLASH_ERASED, FLASH_LOG2 = 24 };
#define ERASED_WORD (ERASED * 0x01010101u)

static void protect(RTS_UI32 attributes)
{
    MpuProtect(MPU_BOARD, (uintptr_t)FILE_FLASH, FLASH_LOG2, attributes);
}

static RTS_RESULT flash_read(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    if (offset > BOARD_FLASH_SIZE || size > BOARD_FLASH_SIZE - offset)
        return ERR_DEVICE;
    memcpy(data, FILE_FLASH + offset, size);
    return ERR_OK;
}

static bool is_erased(const RTS_UI8 *data, RTS_UI32 size)
{
    while (size && *data == ERASED)
        data++, size--;
    return size == 0;
}

static RTS_RESULT flash_program(RTS_UI32 offset, const void *data, RTS_UI32 size)
{
    if (offset > BOARD_FLASH_SIZE || size > BOARD_FLASH_SIZE - offset)
        return ERR_DEVICE;
    if (offset % PROGRAM_SIZE || size % PROGRAM_SIZE || !is_erased(FILE_FLASH + offset, size))
        return ERR_DEVICE;
    protect(MPU_WRITE_PRIVILEGED);
    for (RTS_UI32 done = 0; done < size; done += sizeof(RTS_UI32)) {
        RTS_UI32 word;
        memcpy(&word, (const RTS_UI8 *)data + done, sizeof(word));
        *(volatile RTS_UI32 *)(uintptr_t)(FILE_FLASH + offset + done) = word;
    }
    protect(MPU_READ_ONLY);
    return ERR_OK;
}

static RTS_RESULT flash_erase(RTS_UI32 offset)
{
    if (offset >= BOARD_FLASH_SIZE || offset % SECTOR_SIZE)
        return ERR_DEVICE;
    protect(MPU_WRITE_PRIVILEGED);
    for (RTS_UI32 done = 0; done < SECTOR_SIZE; done += sizeof(RTS_UI32))
        *(volatile RTS_UI32 *)(uintptr_t)(FILE_FLASH + offset + done) = ERASED_WORD;
    protect(MPU_READ_ONLY);
    return ERR_OK;
}

/* Every store is in the file at once. */
static RTS_RESULT flash_sync(void)
{
    CpuBarrier();
    return ERR_OK;
}

void FlashInit(void)
{
    protect(MPU_READ_ONLY);
}

const SYS_FLASH *SysFlashGet(void)
{
    static const SYS_FLASH flash = {
        .size = BOARD_FLASH_SIZE,
        .sector_size = SECTOR_SIZE,
        .program_size = PROGRAM_SIZE,
        .erased = ERASED,
        .mapped = FILE_FLASH,
        .read = flash_read,
        .program = flash_program,
        .erase = flash_erase,
        .sync = flash_sync,
    };
    return &flash;
}
