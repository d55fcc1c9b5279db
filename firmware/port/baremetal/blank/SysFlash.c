/*
 * SysFlash.c - the flash for applications and files. Contract: SysFlash.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysFlash.h"

/* Write here: the real geometry. At least one sector for each slot and two for each of the two record logs; programs
 * are and run in the slots, so `mapped` is where the processor sees them. */
enum { FLASH_SIZE = 64 * 1024, SECTOR_SIZE = 4096, PROGRAM_SIZE = 8, ERASED = 0xFF };

/* Write here: copy from flash; with `mapped` this is a memcpy. */
static RTS_RESULT flash_read(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    RTS_UNUSED(offset);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    return ERR_DEVICE;
}

/* Write here: program whole units, check what was programmed. Interrupts go on: tasks must not wait for this, so code
 * that runs meanwhile is in another bank or in RAM when the chip cannot read while it programs. */
static RTS_RESULT flash_program(RTS_UI32 offset, const void *data, RTS_UI32 size)
{
    RTS_UNUSED(offset);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    return ERR_DEVICE;
}

/* Write here: erase the sector that starts at offset. May take as long as the chip takes. */
static RTS_RESULT flash_erase(RTS_UI32 offset)
{
    RTS_UNUSED(offset);
    return ERR_DEVICE;
}

/* Write here: wait until everything programmed so far would survive a power cut; usually nothing. */
static RTS_RESULT flash_sync(void)
{
    return ERR_OK;
}

const SYS_FLASH *SysFlashGet(void)
{
    static const SYS_FLASH flash = {
        .size = FLASH_SIZE,
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

/* Write here: return mapped + offset to run in place, or copy to a buffer of the slot and make it executable (clean the
 * data cache, invalidate the instruction cache). */
const RTS_UI8 *SysFlashMapCode(RTS_UI32 slot, RTS_UI32 offset, RTS_UI32 size)
{
    RTS_UNUSED(slot);
    RTS_UNUSED(offset);
    RTS_UNUSED(size);
    return NULL;
}

/* Write here: the buffer of the slot is free again. Nothing when code runs in place. */
void SysFlashReleaseCode(RTS_UI32 slot)
{
    RTS_UNUSED(slot);
}
