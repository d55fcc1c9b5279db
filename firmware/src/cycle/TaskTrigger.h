/*
 * TaskTrigger.h - events that make a task run, for both schedulers. Tasks have the index they have in the application.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef TASKTRIGGER_H
#define TASKTRIGGER_H

#include "CmpStd.h"
#include "CompactDownload.h"
#include "rts_config.h"

/* Replaces all triggers by those of `count` tasks; nothing has happened yet. Records and areas (base addresses by
 * APP_AREA_*) stay valid until the next call, as do the timers of the tasks, which an event triggers on ports with
 * SCHED_EVENTS_IN_TIMERS (NULL: there are none). The memory of the records is readable for good: an external event may
 * come at any time, on another core as well. From main, while no task runs. */
void TriggerCreate(const CDL_TASK *tasks, RTS_UI32 count, RTS_UI8 *const *areas, const RTS_HANDLE *timers);

#if ONLINE_CHANGE
/* The triggers of the tasks of another program, as after TriggerForget; of those in `kept`, a bit each, events that wait go
 * on waiting. While no task is in its cycle. */
void TriggerChange(const CDL_TASK *tasks, RTS_UI32 count, RTS_UI32 kept);
#endif

const CDL_TASK *TriggerGetTask(RTS_UI32 task);

/* Whether a task runs as long as its variable is TRUE. */
bool TriggerIsLevel(RTS_UI32 task);

/* Events that happened before the start do not count, nor does a BOOL that is TRUE already, but for a level. From main, while no task
 * runs. */
void TriggerForget(void);

/* Takes one of the events that wait for a task; false when none does. Of a level: whether the variable is TRUE. From where the task runs. */
bool TriggerTake(RTS_UI32 task);

/* Events that were lost since TriggerCreate, because SCHED_MAX_WAITING_EVENTS waited already. */
RTS_UI32 TriggerGetLost(RTS_UI32 task);

/* Forgets all external events. */
void TriggerReset(void);

#endif
