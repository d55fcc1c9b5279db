/*
 * SysTime.h - the clock a port gives.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SYSTIME_H
#define SYSTIME_H

#include "CmpStd.h"

/* Monotonic time in ns since start-up, never going back, resolution 1 us or better. From any context, below 1 us. */
RTS_I64 SysTimeGetNs(void);

/* Processor time the calling context has used so far [ns]; only differences count. Ports with SCHED_PROCESSOR_TIME. */
RTS_I64 SysTimeGetUsedNs(void);

/* Milliseconds of the same clock; wraps after 49 days, so compare differences only. */
RTS_UI32 SysTimeGetMs(void);

/* Main makes its next pass of CH_COMM_CYCLE after this many ms at most, although nothing comes that it waits for. From main,
 * in each pass again. Empty where main sleeps no longer than 1 ms; only a firmware with a field bus needs it. */
void SysTimeWantPass(RTS_UI32 ms);

/* Lets others run for some 20 us. By a task that waits for another one; only where several run at a time
 * (RTS_ONE_CORE 0). */
void SysTimePause(void);

#endif
