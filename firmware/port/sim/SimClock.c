/*
 * SimClock.c - the virtual clock, the wall clock that follows it, and the lock.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "SimClock.h"

#include <time.h>

#include "SimTimes.h"
#include "SysLock.h"
#include "SysTime.h"
#include "SysTimeRtc.h"
#include "sim_port.h"

static RTS_I64 now_ns;
static bool is_real; /* reading the clock costs what it costs on Linux */

RTS_I64 SimNow(void)
{
    return now_ns;
}

void SimClockPass(RTS_I64 ns)
{
    now_ns += ns;
}

void SimClockReach(RTS_I64 time_ns)
{
    if (time_ns > now_ns)
        now_ns = time_ns;
}

void SimClockMakeReal(bool real)
{
    is_real = real;
}

/* ---- the wall clock ---- */

static RTS_I64 wall_clock_ns = SIM_CLOCK_FIRST_S * (RTS_I64)1000000000; /* at virtual time 0 */

RTS_RESULT SysTimeRtcGet(RTS_I64 *utc_ns)
{
    *utc_ns = wall_clock_ns + now_ns;
    return ERR_OK;
}

RTS_RESULT SysTimeRtcSet(RTS_I64 utc_ns)
{
    wall_clock_ns = utc_ns - now_ns;
    return ERR_OK;
}

void SimSetClock(RTS_I64 utc_ns)
{
    (void)SysTimeRtcSet(utc_ns);
}

void SimClockStart(void)
{
    wall_clock_ns += now_ns; /* a battery keeps it running */
    now_ns = 0;
}

/* ---- what the runtime reads ---- */

/* The virtual time, at the price of a real clock. */
static RTS_I64 read_real_clock(void)
{
    struct timespec now = {0, 0};

    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_nsec >= 0 ? now_ns : 0;
}

RTS_I64 SysTimeGetNs(void)
{
    return is_real ? read_real_clock() : now_ns;
}

RTS_UI32 SysTimeGetMs(void)
{
    return (RTS_UI32)(now_ns / NS_PER_MS);
}

/* SimBus says when passes are due. */
void SysTimeWantPass(RTS_UI32 ms)
{
    RTS_UNUSED(ms);
}

void SysTimePause(void)
{
    static const struct timespec pause = {0, 20000};

    nanosleep(&pause, NULL);
}

/* ---- lock ---- */

/* There is no other thread; while a cycle is measured it costs what it costs on Linux. */
RTS_UI32 SysLockEnter(void)
{
    if (is_real)
        SimMutexLock();
    return 0;
}

void SysLockLeave(RTS_UI32 before)
{
    RTS_UNUSED(before);
    if (is_real)
        SimMutexUnlock();
}
