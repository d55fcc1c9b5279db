/*
 * AppPower.h - what main does when the power is about to fail.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main. Without APP_POWER_FAIL there is no code for it. AppPowerFails() is for the port.
 */
#ifndef APPPOWER_H
#define APPPOWER_H

#include "rts_config.h"

#if APP_POWER_FAIL
/* Stops the program and saves retain variables after AppPowerFails; starts it again if the power is still there
 * APP_POWER_BACK_MS later. In each pass. */
void AppPowerCheck(void);

/* A user decides what runs: the program is not started again. */
void AppPowerForget(void);
#else
#define AppPowerCheck() ((void)0)
#define AppPowerForget() ((void)0)
#endif

#endif
