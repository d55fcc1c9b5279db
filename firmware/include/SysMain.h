/*
 * SysMain.h - a task that waits for main: where tasks are threads, and in the simulator.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Of a port with APP_CALL_WAIT_MS. A task that waits holds nothing, so it may be aborted.
 */
#ifndef SYSMAIN_H
#define SYSMAIN_H

#include "CmpStd.h"

/* Has main make a pass soon, and waits until *word differs from `value`, or a millisecond, or without reason. False in main
 * itself, which cannot wait for its own work. From a task. */
bool SysMainWait(const RTS_UI32 *word, RTS_UI32 value);
/* What waits for the word goes on. From main. */
void SysMainWake(const RTS_UI32 *word);

#endif
