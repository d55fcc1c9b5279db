/*
 * SysDebug.c - the simulator on macOS has no breakpoints: code cannot be written while it may be executed.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysDebug.h"

#include <pthread.h>
#include <time.h>

static pthread_t main_thread;

void SysDebugIsMain(void)
{
    main_thread = pthread_self();
}

bool SysDebugMayWait(void)
{
    return !pthread_equal(main_thread, pthread_self());
}

bool SysDebugCanTrap(void)
{
    return false;
}

RTS_UI32 SysDebugTrapSize(uintptr_t address)
{
    RTS_UNUSED(address);
    return SYS_DEBUG_LONGEST;
}

RTS_RESULT SysDebugWriteTrap(uintptr_t address, RTS_UI32 *original)
{
    RTS_UNUSED(address);
    RTS_UNUSED(original);
    return ERR_NO_ACCESS_RIGHTS;
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

/* In the simulator, tasks run in main, which does not wait here. */
void SysDebugWait(const RTS_UI32 *word, RTS_UI32 value)
{
    const struct timespec ms = {.tv_nsec = 1000000};

    if (__atomic_load_n(word, __ATOMIC_SEQ_CST) == value)
        (void)nanosleep(&ms, NULL);
}

void SysDebugWake(RTS_UI32 *word)
{
    RTS_UNUSED(word);
}
