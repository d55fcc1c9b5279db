/*
 * TaskTrigger.h - events that make a task run, for both schedulers.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef TASKTRIGGER_H
#define TASKTRIGGER_H

#include "CmpStd.h"
#include "CompactDownload.h"

typedef struct {
    const CDL_TASK *record;
    const volatile RTS_UI8 *flag; /* event tasks: their BOOL */
    RTS_UI32 seen; /* event tasks: that BOOL at the last look; external event tasks: posts that were answered */
} TRIGGER;

void TriggerInit(TRIGGER *trigger, const CDL_TASK *record, RTS_UI8 *const *areas);
/* Events that happened before the start do not count, nor does a BOOL that is TRUE already. */
void TriggerForget(TRIGGER *trigger);
/* Whether a task that is not cyclic shall run now; asked once in each pass of main. */
bool TriggerFired(TRIGGER *trigger);
/* Forgets all external events. */
void TriggerReset(void);

#endif
