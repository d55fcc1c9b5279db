/*
 * CodeInRam.c - application code is copied to RAM: for a flash that cannot be mapped, is slow, or stops while it is
 * erased.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"
#include "SysFlash.h"

#ifndef BOARD_CODE_ALIGN
#define BOARD_CODE_ALIGN 16
#endif

enum { SLOT_COUNT = 2 };

RTS_STATIC_ASSERT(APP_MAX_CODE_SIZE > 0, set_APP_MAX_CODE_SIZE_or_compile_CodeInPlace_c_instead);
static RTS_UI8 code_ram[SLOT_COUNT][APP_MAX_CODE_SIZE] __attribute__((aligned(BOARD_CODE_ALIGN)));
RTS_STATIC_ASSERT(APP_MAX_CODE_SIZE % APP_CODE_ALIGN == 0, each_slot_is_aligned);

const RTS_UI8 *SysFlashMapCode(RTS_UI32 slot, RTS_UI32 offset, RTS_UI32 size)
{
    if (slot >= SLOT_COUNT || size > APP_MAX_CODE_SIZE || SysFlashGet()->read(offset, code_ram[slot], size) != ERR_OK)
        return NULL;
    CpuBarrier(); /* the first fetch sees the new code; a core with caches cleans and invalidates them here */
    return code_ram[slot];
}

void SysFlashReleaseCode(RTS_UI32 slot)
{
    RTS_UNUSED(slot);
}
