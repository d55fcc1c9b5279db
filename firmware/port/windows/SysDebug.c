/*
 * SysDebug.c - traps in IEC code on Windows: INT3 in memory that can otherwise only be executed.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysDebug.h"

#include <sys/mman.h>
#include <windows.h>

enum { TRAP = 0xCC, PAGE = 4096 };

static DWORD main_thread;

void SysDebugIsMain(void)
{
    main_thread = GetCurrentThreadId();
}

bool SysDebugMayWait(void)
{
    return GetCurrentThreadId() != main_thread;
}

bool SysDebugCanTrap(void)
{
    return true;
}

/* Code stays executable, since other tasks may execute it. */
static bool store_code(uintptr_t address, RTS_UI8 unit)
{
    void *page = (void *)(address & ~(uintptr_t)(PAGE - 1));
    if (mprotect(page, PAGE, PROT_READ | PROT_WRITE | PROT_EXEC) != 0) {
        return false;
    }
    __atomic_store_n((RTS_UI8 *)address, unit, __ATOMIC_SEQ_CST);
    (void)mprotect(page, PAGE, PROT_READ | PROT_EXEC);
    FlushInstructionCache(GetCurrentProcess(), (const void *)address, sizeof unit);
    return true;
}

RTS_UI32 SysDebugTrapSize(uintptr_t address)
{
    RTS_UNUSED(address);
    return 1;
}

RTS_RESULT SysDebugWriteTrap(uintptr_t address, RTS_UI32 *original)
{
    *original = *(const RTS_UI8 *)address;
    return store_code(address, TRAP) ? ERR_OK : ERR_NO_ACCESS_RIGHTS;
}

void SysDebugRestore(uintptr_t address, RTS_UI32 original)
{
    (void)store_code(address, (RTS_UI8)original);
}

bool SysDebugIsTrap(uintptr_t address)
{
    return *(const RTS_UI8 *)address == TRAP;
}

/* As short as Sleep lets it be: in the simulator, tasks run in main, which does not wait here. */
void SysDebugWait(const RTS_UI32 *word, RTS_UI32 value)
{
    if (__atomic_load_n(word, __ATOMIC_SEQ_CST) == value) {
        Sleep(1);
    }
}

void SysDebugWake(RTS_UI32 *word)
{
    RTS_UNUSED(word);
}
