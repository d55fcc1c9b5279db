/*
 * AppBoot.h - what runs after a start-up, and instead of an application that failed.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main only.
 */
#ifndef APPBOOT_H
#define APPBOOT_H

#include "CmpErrors.h"
#include "CmpStd.h"

/* Loads what is in flash, and starts it unless it failed before. */
void AppBoot(void);

/* The same for what is loaded now, by hand: also for what failed before, when there is none to go back to. Nothing is
 * loaded after an error. */
RTS_RESULT AppBootAgain(void);

/* Starts what was loaded and not started, because a user asks for it: also what failed before, when there is none to go
 * back to. */
RTS_RESULT AppBootByHand(void);

/* Whether the slot that is not `failed` has an application that may run. */
bool AppCanRollBack(RTS_UI32 failed);

/*
 * Loads the other slot instead of `failed`, from now on, without calling anything of it; false when it holds nothing
 * that can run. Its retain variables are those it had when the failed application came.
 */
bool AppRollBack(RTS_UI32 failed);

#endif
