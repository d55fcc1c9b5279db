/*
 * App.h - the loaded application, for the parts CmpAppEmbedded is made of.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * CmpAppEmbedded.c is its life: load, start, stop, reset, exceptions. AppDownload.c puts another one in its place,
 * AppBoot.c loads what is in flash; both call the life. All from main.
 */
#ifndef APP_H
#define APP_H

#include "AppLoader.h"

/* ---- life ---- */

/* Slot of the loaded application, SLOT_NONE without one. */
RTS_UI32 AppGetSlot(void);
bool AppHasException(void);

/* Makes the code of a checked image executable and returns where; NULL when the port cannot. */
const RTS_UI8 *AppMapCode(const APP_IMAGE *image);

/* Takes over a checked image with its code mapped at `code`, when nothing is loaded. Retain variables come from a
 * record up to number `retain_until`. The application is in AS_STOP then, and nothing of it was called. */
RTS_RESULT AppLoad(const APP_IMAGE *image, const RTS_UI8 *code, RTS_UI32 retain_until);
void AppUnload(void);

/* Gives the loaded application its initial values and its tasks; it is in AS_STOP then, perhaps with an exception. It
 * is given up when its tasks cannot be created: ERR_NOMEMORY. */
RTS_RESULT AppInitialise(void);

/* Starts the loaded application, initialised before if it was not yet. ERR_EXCEPTION: that failed. */
RTS_RESULT AppStart(void);

/* Stops the tasks; true when they ran. */
bool AppStopTasks(void);

/* Completes what AppHandleException has begun. */
void AppHandlePendingException(void);

void AppPostEvent(RTS_UI32 event);

/* ---- boot project ---- */

/* Loads what is in flash, and starts it unless it died before. */
void AppBoot(void);

/* Starts what was loaded and not started, because a user asks for it: also what died before, when there is none to go
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
