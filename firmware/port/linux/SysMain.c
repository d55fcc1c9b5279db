/*
 * SysMain.c - a task that waits for main.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A system call that waits is left like any other place when a task is aborted.
 */
#define _GNU_SOURCE
#include "SysMain.h"

#include "SysDebug.h"
#include "port.h"

#include <limits.h>
#include <linux/futex.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

bool SysMainWait(const RTS_UI32 *word, RTS_UI32 value)
{
    const struct timespec longest = {.tv_nsec = 1000000};
    if (!SysDebugMayWait()) {
        return false;
    }
    PortWaitNudge();
    (void)syscall(SYS_futex, word, FUTEX_WAIT_PRIVATE, value, &longest, NULL, 0);
    return true;
}

void SysMainWake(const RTS_UI32 *word)
{
    (void)syscall(SYS_futex, word, FUTEX_WAKE_PRIVATE, INT_MAX, NULL, NULL, 0);
}
