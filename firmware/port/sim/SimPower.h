/*
 * SimPower.h - power of the simulated device: what runs while it is cut ends at once.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SIMPOWER_H
#define SIMPOWER_H

#include "CmpErrors.h"
#include "CmpStd.h"

/* Power is back after a cut, and the runtime not started yet. */
void SimPowerReturn(void);

/* The runtime is started, or shut down. */
void SimPowerSetOn(bool on);

/* Power goes off now: back to SimPowerRun, which returns SIM_POWER_CUT. Returns if nothing runs. */
void SimPowerCut(void);

/* Runs fn(arg). SIM_POWER_CUT: power was cut in it, or is still away. */
RTS_RESULT SimPowerRun(RTS_RESULT (*fn)(void *arg), void *arg);

/* The same for what needs a runtime that is started: ERR_NOTINITIALIZED. */
RTS_RESULT SimPowerRunStarted(RTS_RESULT (*fn)(void *arg), void *arg);

/* Runs a part that comes back here after a cut, so that what called it ends its work first. False if power was cut. */
bool SimPowerRunPart(void (*fn)(void));

/* Ends what runs if power was cut in a part of it. */
void SimPowerCheck(void);

#endif
