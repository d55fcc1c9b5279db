/*
 * AppChange.h - online change: an image takes the place of the one that runs, between two cycles.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The image says whose place it takes and what becomes of variables (CDL_BLOB_CHANGE); plctool builds it so that variables
 * which both have are at the same places. It is checked as for a download, and that it belongs to the image that runs.
 * Then, in a moment in which no task is in its cycle, its steps are done, its code takes over, and what it has to
 * initialise runs; only after that it is committed, as after a download. So a power cut at any time leaves the old program or
 * the new one, and what fails before the commit is taken back.
 */
#ifndef APPCHANGE_H
#define APPCHANGE_H

#include "../load/AppLoaded.h"
#include "AppRefusal.h"
#include "CmpErrors.h"

/* From main, of an image that has passed all checks, in the slot that does not run. On an error *refusal says why, and the
 * application goes on as it was. */
RTS_RESULT AppChange(const APP_IMAGE *image, APP_REFUSAL *refusal);

#endif
