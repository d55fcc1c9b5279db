/*
 * SysTime.c - the clock of the Linux port: CLOCK_MONOTONIC from the start of the runtime.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "SysTime.h"
#include "SysTimeRtc.h"
#include "port.h"

#include <errno.h>
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

/* ---- the wall clock ---- */

static bool may_set_clock;

void PortClockMaySet(void)
{
    may_set_clock = true;
}

RTS_RESULT SysTimeRtcGet(RTS_I64 *utc_ns)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    *utc_ns = (RTS_I64)now.tv_sec * 1000000000 + now.tv_nsec;
    return ERR_OK;
}

RTS_RESULT SysTimeRtcSet(RTS_I64 utc_ns)
{
    struct timespec wanted = {(time_t)(utc_ns / 1000000000), (long)(utc_ns % 1000000000)};
    if (!may_set_clock) {
        return ERR_NO_ACCESS_RIGHTS;
    }
    if (clock_settime(CLOCK_REALTIME, &wanted) == 0) {
        return ERR_OK;
    }
    return errno == EPERM ? ERR_NO_ACCESS_RIGHTS : ERR_PARAMETER;
}

RTS_RESULT SysTime_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT_SYSTEM) {
        state.start_ns = monotonic_ns();
    }
    return ERR_OK;
}
