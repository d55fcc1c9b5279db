/*
 * SysDebug.c - traps in IEC code on Armv7-M: UDF in code that is in RAM.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Not BKPT, which stops a processor without a debugging probe. What catches them is in SysExcept.c.
 */
#include "SysDebug.h"

#include "BareMetal.h"
#include "ThumbStep.h"
#include "rts_config.h"

#if BP_MAX > 0

/* CodeInRam.c. */
bool SysDebugCanTrap(void)
{
    return APP_MAX_CODE_SIZE > 0;
}

static bool store(uintptr_t address, RTS_UI16 half)
{
    *(volatile RTS_UI16 *)address = half;
    CpuBarrier();
    return true;
}

RTS_RESULT SysDebugWriteTrap(uintptr_t address, RTS_UI32 *original)
{
    *original = ThumbRead(address);
    (void)ThumbWriteTrap(address, store);
    return ERR_OK;
}

void SysDebugRestore(uintptr_t address, RTS_UI32 original)
{
    ThumbRestore(address, original, store);
}

RTS_UI32 SysDebugTrapSize(uintptr_t address)
{
    return ThumbSize(*(const RTS_UI16 *)address);
}

bool SysDebugIsTrap(uintptr_t address)
{
    return ThumbIsTrap(address);
}

bool SysDebugMayWait(void)
{
    return true;
}

void SysDebugIsMain(void)
{
}

void SysDebugWait(const RTS_UI32 *word, RTS_UI32 value)
{
    RTS_UNUSED(word);
    RTS_UNUSED(value);
}

void SysDebugWake(RTS_UI32 *word)
{
    RTS_UNUSED(word);
}

#endif
