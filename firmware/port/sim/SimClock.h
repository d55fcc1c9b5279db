/*
 * SimClock.h - the virtual clock: it stands still unless one of these functions moves it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SIMCLOCK_H
#define SIMCLOCK_H

#include "CmpStd.h"

/* Power on: virtual time starts at 0, the wall clock goes on. */
void SimClockStart(void);

/* Lets `ns` pass. */
void SimClockPass(RTS_I64 ns);

/* Lets time pass until `time_ns`; does nothing if it is past. */
void SimClockReach(RTS_I64 time_ns);

/* From now on clock and lock cost what they cost on Linux, or nothing. */
void SimClockMakeReal(bool real);

#endif
