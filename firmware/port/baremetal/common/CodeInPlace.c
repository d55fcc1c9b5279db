/*
 * CodeInPlace.c - application code runs where it is in flash: no RAM, no copy. The usual choice; the other is
 * CodeInRam.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "SysFlash.h"

const RTS_UI8 *SysFlashMapCode(RTS_UI32 slot, RTS_UI32 offset, RTS_UI32 size)
{
    const SYS_FLASH *flash = SysFlashGet();
    RTS_UNUSED(slot);
    if (offset % APP_CODE_ALIGN || offset > flash->size || size > flash->size - offset)
        return NULL;
    return flash->mapped + offset;
}

void SysFlashReleaseCode(RTS_UI32 slot)
{
    RTS_UNUSED(slot);
}
