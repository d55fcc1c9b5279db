/*
 * SysDebug.c - traps in IEC code on Linux: INT3 in memory that can otherwise only be executed.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Shared by the linux and the sim port. Only x86-64 has traps so far: elsewhere a process cannot execute a single
 * instruction of its own.
 */
#define _GNU_SOURCE
#include "SysDebug.h"

#include <linux/futex.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <unistd.h>

static pthread_t main_thread;

void SysDebugIsMain(void)
{
    main_thread = pthread_self();
}

bool SysDebugMayWait(void)
{
    return !pthread_equal(main_thread, pthread_self());
}

#if defined(__x86_64__)

enum { INT3 = 0xCC };

bool SysDebugCanTrap(void)
{
    return true;
}

/* Code stays executable meanwhile. */
static bool write_code(uintptr_t address, RTS_UI8 byte)
{
    size_t page = (size_t)sysconf(_SC_PAGESIZE);
    void *start = (void *)(address & ~(page - 1));
    if (mprotect(start, page, PROT_READ | PROT_WRITE | PROT_EXEC) != 0) {
        return false;
    }
    __atomic_store_n((RTS_UI8 *)address, byte, __ATOMIC_SEQ_CST);
    (void)mprotect(start, page, PROT_READ | PROT_EXEC);
    return true;
}

RTS_RESULT SysDebugWriteTrap(uintptr_t address, RTS_UI32 *original)
{
    *original = *(const RTS_UI8 *)address;
    return write_code(address, INT3) ? ERR_OK : ERR_NO_ACCESS_RIGHTS;
}

void SysDebugRestore(uintptr_t address, RTS_UI32 original)
{
    (void)write_code(address, (RTS_UI8)original);
}

bool SysDebugIsTrap(uintptr_t address)
{
    return *(const RTS_UI8 *)address == INT3;
}

#else

bool SysDebugCanTrap(void)
{
    return false;
}

RTS_RESULT SysDebugWriteTrap(uintptr_t address, RTS_UI32 *original)
{
    RTS_UNUSED(address);
    RTS_UNUSED(original);
    return ERR_NOT_SUPPORTED;
}

void SysDebugRestore(uintptr_t address, RTS_UI32 original)
{
    RTS_UNUSED(address);
    RTS_UNUSED(original);
}

bool SysDebugIsTrap(uintptr_t address)
{
    RTS_UNUSED(address);
    return false;
}

#endif

void SysDebugWait(const RTS_UI32 *word, RTS_UI32 value)
{
    (void)syscall(SYS_futex, word, FUTEX_WAIT_PRIVATE, value, NULL, NULL, 0);
}

void SysDebugWake(RTS_UI32 *word)
{
    (void)syscall(SYS_futex, word, FUTEX_WAKE_PRIVATE, INT32_MAX, NULL, NULL, 0);
}
