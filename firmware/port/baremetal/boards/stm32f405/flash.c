/*
 * flash.c - SysFlash on the flash of an STM32F4: one bank, sectors of three sizes.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The bank that is erased is the one that the runtime runs from: until the erase ends (16 KiB: 0.25 s to 0.5 s, 128 KiB: 1 s
 * to 2 s) the processor gets no instruction and serves no interrupt, so tasks stand still. The ticks that the clock has
 * missed meanwhile are counted by a timer. QEMU has no flash controller: there each call ends in ERR_DEVICE, because what
 * is read afterwards is not what was written.
 */
#include <string.h>

#include "BareMetal.h"
#include "SysFlash.h"
#include "SysTime.h"

#define FLASH ((const RTS_UI8 *)(uintptr_t)BOARD_FLASH_ADDRESS)
#define FLASH_ACR REG32(0x40023C00u)
#define FLASH_KEYR REG32(0x40023C04u)
#define FLASH_SR REG32(0x40023C0Cu)
#define FLASH_CR REG32(0x40023C10u)

#define KEY_1 0x45670123u
#define KEY_2 0xCDEF89ABu
enum { SR_BUSY = 1 << 16, SR_ERRORS = 0xF2 };
enum { CR_PROGRAM = 1, CR_ERASE = 1 << 1, CR_SECTOR = 3, CR_BY_WORDS = 2 << 8, CR_START = 1 << 16 };
enum { ACR_INSTRUCTION_CACHE = 1 << 9, ACR_DATA_CACHE = 1 << 10, ACR_RESET_CACHES = 3 << 11 };
#define CR_LOCK 0x80000000u
enum { PROGRAM_SIZE = 4, ERASED = BOARD_FLASH_ERASED, NS_PER_US = 1000, NS_PER_MS = 1000000 };

static bool is_inside(RTS_UI32 offset, RTS_UI32 size)
{
    return offset <= BOARD_FLASH_SIZE && size <= BOARD_FLASH_SIZE - offset;
}

static RTS_RESULT flash_read(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    if (!is_inside(offset, size))
        return ERR_DEVICE;
    memcpy(data, FLASH + offset, size);
    return ERR_OK;
}

static bool is_erased(RTS_UI32 offset, RTS_UI32 size)
{
    while (size != 0 && FLASH[offset] == ERASED)
        offset++, size--;
    return size == 0;
}

static void unlock(RTS_UI32 what)
{
    FLASH_KEYR = KEY_1;
    FLASH_KEYR = KEY_2;
    FLASH_SR = SR_ERRORS;
    FLASH_CR = CR_BY_WORDS | what;
}

static bool wait_for_end(void)
{
    while ((FLASH_SR & SR_BUSY) != 0)
        ;
    return (FLASH_SR & SR_ERRORS) == 0;
}

static RTS_RESULT flash_program(RTS_UI32 offset, const void *data, RTS_UI32 size)
{
    if (!is_inside(offset, size) || offset % PROGRAM_SIZE || size % PROGRAM_SIZE || !is_erased(offset, size))
        return ERR_DEVICE;
    bool works = true;
    unlock(CR_PROGRAM);
    for (RTS_UI32 done = 0; done < size && works; done += PROGRAM_SIZE) {
        RTS_UI32 word;
        memcpy(&word, (const RTS_UI8 *)data + done, sizeof(word));
        REG32(FLASH + offset + done) = word;
        CpuBarrier();
        works = wait_for_end();
    }
    FLASH_CR = CR_LOCK;
    return works && memcmp(FLASH + offset, data, size) == 0 ? ERR_OK : ERR_DEVICE;
}

/* The number of the sector that begins there, -1: none does. */
static RTS_I32 find_sector(RTS_UI32 offset)
{
    RTS_UI32 at = 0;
    RTS_I32 number = 0;
    while (at < offset) {
        at += FLASH_SECTOR_AT(at);
        number++;
    }
    return at == offset && offset < BOARD_FLASH_SIZE ? number : -1;
}

/* The caches may have what was there before. */
static void empty_caches(void)
{
    RTS_UI32 control = FLASH_ACR;
    FLASH_ACR = control & ~(RTS_UI32)(ACR_INSTRUCTION_CACHE | ACR_DATA_CACHE);
    FLASH_ACR = (control & ~(RTS_UI32)(ACR_INSTRUCTION_CACHE | ACR_DATA_CACHE)) | ACR_RESET_CACHES;
    FLASH_ACR = control;
}

/* One tick may be pending after the erase; the others were missed. */
static void count_missed_ticks(RTS_I64 before_ns, RTS_UI32 took_us)
{
    RTS_I64 missed_ns = before_ns + (RTS_I64)took_us * NS_PER_US - SysTimeGetNs();
    if (missed_ns > 0)
        ClockSkip((RTS_UI32)((missed_ns + NS_PER_MS / 2) / NS_PER_MS));
}

static RTS_RESULT flash_erase(RTS_UI32 offset)
{
    RTS_I32 sector = find_sector(offset);
    if (sector < 0)
        return ERR_DEVICE;
    RTS_UI32 mask = CpuMask();
    RTS_I64 before_ns = SysTimeGetNs();
    RTS_UI32 from = BoardMicroseconds();
    unlock(CR_ERASE | (RTS_UI32)sector << CR_SECTOR);
    FLASH_CR |= CR_START;
    CpuBarrier();
    bool works = wait_for_end();
    FLASH_CR = CR_LOCK;
    empty_caches();
    count_missed_ticks(before_ns, BoardMicroseconds() - from);
    CpuRestore(mask);
    return works && is_erased(offset, FLASH_SECTOR_AT(offset)) ? ERR_OK : ERR_DEVICE;
}

/* Each call has ended before the next. */
static RTS_RESULT flash_sync(void)
{
    return ERR_OK;
}

const SYS_FLASH *SysFlashGet(void)
{
    static const SYS_FLASH flash = {
        .size = BOARD_FLASH_SIZE,
        .sector_size = BOARD_FLASH_SECTOR_SIZE,
        .program_size = PROGRAM_SIZE,
        .erased = ERASED,
        .mapped = FLASH,
        .read = flash_read,
        .program = flash_program,
        .erase = flash_erase,
        .sync = flash_sync,
    };
    return &flash;
}
