/*
 * SysFlash.h - the flash a port gives: one struct it fills.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * NOR rules: a byte is programmed once after an erase; an erase sets whole sectors to `erased`. Only SysFileFlash and
 * the loader call these, from main, never from an interrupt.
 */
#ifndef SYSFLASH_H
#define SYSFLASH_H

#include "CmpErrors.h"
#include "CmpStd.h"

typedef struct {
    RTS_UI32 size;        /* bytes, a multiple of sector_size */
    RTS_UI32 sector_size; /* smallest erasable unit, bytes; a power of two. Sectors may differ: FLASH_SECTOR_AT */
    RTS_UI32
    program_size;   /* smallest programmable unit, bytes: 1, 2, 4, 8, 16; offsets and sizes are multiples of it */
    RTS_UI8 erased; /* value of an erased byte, usually 0xFF */

    /* The flash as memory for reading, size bytes; NULL when it cannot be mapped. */
    const RTS_UI8 *mapped;

    /* ERR_OK, or ERR_DEVICE when the hardware failed or the flash has no such bytes; of program also when offset or size
     * is not a multiple of program_size, or a unit is not erased (even if it is to keep its value); of erase also when
     * no sector starts at offset. What is refused changes nothing: it is a mistake in the runtime or in the file map.
     * SysFileFlash programs 16 bytes (FILE_ALIGN) at a time. */
    RTS_RESULT (*read)(RTS_UI32 offset, void *data, RTS_UI32 size);
    RTS_RESULT (*program)(RTS_UI32 offset, const void *data, RTS_UI32 size);
    RTS_RESULT (*erase)(RTS_UI32 offset); /* the sector that starts at offset */
    RTS_RESULT (*sync)(void);             /* returns when everything programmed so far would survive a power cut */
} SYS_FLASH;

/* The port's flash; ready at CH_INIT_SYSTEM2. */
const SYS_FLASH *SysFlashGet(void);

/*
 * Makes `size` bytes of application code at flash `offset` executable for slot `slot` (0 or 1) and returns where they
 * run: the flash itself (execute in place), or RAM the port copies them to. 16-aligned. NULL when it is not possible:
 * when they reach past the end of the flash, say, or are more than the RAM takes. Until SysFlashReleaseCode of that slot
 * the code stays valid; the other slot may be mapped at the same time. From main.
 */
const RTS_UI8 *SysFlashMapCode(RTS_UI32 slot, RTS_UI32 offset, RTS_UI32 size);
void SysFlashReleaseCode(RTS_UI32 slot); /* does nothing when it is not mapped */

#endif
