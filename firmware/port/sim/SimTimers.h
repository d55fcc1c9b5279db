/*
 * SimTimers.h - the timers of SysTimer.h, on the virtual clock.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SIMTIMERS_H
#define SIMTIMERS_H

#include "CmpStd.h"

/* Power on: there is no timer. */
void SimTimersForget(void);

/* When a timer is next due, INT64_MAX: never. */
RTS_I64 SimTimersGetDueNs(void);

/* Lets time pass until then, and runs all timers that are due at that time, in the order of their priority. */
void SimTimersRun(void);

/* Moves all due times, so that timers go on with the phase they had. */
void SimTimersShift(RTS_I64 ns);

#endif
