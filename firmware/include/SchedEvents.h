/*
 * SchedEvents.h - what makes event tasks run: variables and external events.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef SCHEDEVENTS_H
#define SCHEDEVENTS_H

#include "CmpErrors.h"
#include "CmpStd.h"

/* Whether a task of this kind waits for a variable. */
#define SCHED_WAITS_FOR_VARIABLE(kind) ((kind) == KIND_EVENT || (SCHED_LEVEL_EVENTS && (kind) == KIND_LEVEL))

/* Looks at the variables of event tasks. From any context, when they may have changed: the cycle (IecCycle.c) calls it at the end
 * of each cycle; code that copies inputs calls it afterwards. */
void SchedNoteEvents(void);

/*
 * External events. A KIND_EXTERNAL task runs once for each post of the event it names. Register and unregister from main
 * (CH_INIT3, CH_EXIT3); `result` may be NULL. RTS_INVALID_HANDLE with ERR_NOMEMORY or ERR_DUPLICATE.
 */
RTS_HANDLE SchedRegisterExternalEvent(const char *name, RTS_RESULT *result);
RTS_RESULT SchedUnregisterExternalEvent(RTS_HANDLE event);
/* From any context, interrupts too. ERR_INVALID_HANDLE when it is not registered. */
RTS_RESULT SchedPostExternalEvent(RTS_HANDLE event);
/* Whether an event is registered whose name has this CRC-32, see CDL_TASK. From main. */
bool SchedHasExternalEvent(RTS_UI32 id);

#endif
