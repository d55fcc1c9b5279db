/*
 * SysTime.c - the clock of the Linux port: CLOCK_MONOTONIC from the start of the runtime.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "SysTime.h"
#include "port.h"

#include <time.h>

static struct {
    RTS_I64 start_ns;
} state;

static RTS_I64 monotonic_ns(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (RTS_I64)now.tv_sec * 1000000000 + now.tv_nsec;
}

RTS_I64 SysTimeGetNs(void)
{
    return monotonic_ns() - state.start_ns;
}

RTS_I64 SysTimeGetUsedNs(void)
{
    struct timespec used;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
    return (RTS_I64)used.tv_sec * 1000000000 + used.tv_nsec;
}

RTS_UI32 SysTimeGetMs(void)
{
    return (RTS_UI32)(SysTimeGetNs() / 1000000);
}

RTS_I64 PortMonotonicNs(RTS_I64 time_ns)
{
    return time_ns + state.start_ns;
}

void SysTimePause(void)
{
    static const struct timespec pause = {0, 20000};

    nanosleep(&pause, NULL);
}

RTS_RESULT SysTime_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT_SYSTEM) {
        state.start_ns = monotonic_ns();
    }
    return ERR_OK;
}
