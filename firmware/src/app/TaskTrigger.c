/*
 * TaskTrigger.c - events that make a task run; external events.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "TaskTrigger.h"

#include <string.h>

#include "CmpIecTask.h"
#include "CmpScheduleTimer.h"
#include "SysAtomic.h"
#include "rts_config.h"

typedef struct {
    const char *name; /* NULL: free */
    RTS_UI32 posts;
} EXTERNAL_EVENT;

enum { PLACES = SCHED_MAX_EXTERNAL_EVENTS > 0 ? SCHED_MAX_EXTERNAL_EVENTS : 1 };
static EXTERNAL_EVENT events[PLACES];

void TriggerReset(void)
{
    if (SCHED_MAX_EXTERNAL_EVENTS > 0)
        CMP_CLEAR(events);
}

static EXTERNAL_EVENT *find_event(const char *name)
{
    RTS_UI32 i;

    for (i = 0; SCHED_MAX_EXTERNAL_EVENTS > 0 && i < PLACES; i++) {
        if (events[i].name != NULL && strcmp(events[i].name, name) == 0)
            return &events[i];
    }
    return NULL;
}

void TriggerInit(TRIGGER *trigger, const CDL_TASK *record, RTS_UI8 *const *areas)
{
    memset(trigger, 0, sizeof *trigger);
    trigger->record = record;
    if (record->kind == KIND_EVENT)
        trigger->flag = areas[record->event_area] + record->event_offset;
}

void TriggerForget(TRIGGER *trigger)
{
    const EXTERNAL_EVENT *event;

    if (trigger->record->kind == KIND_EVENT)
        trigger->seen = *trigger->flag != 0;
    if (trigger->record->kind == KIND_EXTERNAL) {
        event = find_event(trigger->record->name);
        trigger->seen = event != NULL ? SysAtomicLoad(&event->posts) : 0;
    }
}

static bool has_rising_edge(TRIGGER *trigger)
{
    RTS_UI32 now = *trigger->flag != 0;
    bool rising = now > trigger->seen;

    trigger->seen = now;
    return rising;
}

/* One post, one cycle; posts that come while the task runs are answered in the next passes. */
static bool has_post(TRIGGER *trigger)
{
    const EXTERNAL_EVENT *event = find_event(trigger->record->name);

    if (event == NULL || SysAtomicLoad(&event->posts) == trigger->seen)
        return false;
    trigger->seen++;
    return true;
}

bool TriggerFired(TRIGGER *trigger)
{
    switch (trigger->record->kind) {
    case KIND_EVENT:
        return has_rising_edge(trigger);
    case KIND_EXTERNAL:
        return has_post(trigger);
    default:
        return true;
    }
}

/* ---- external events ---- */

static RTS_HANDLE no_event(RTS_RESULT *result, RTS_RESULT reason)
{
    if (result != NULL)
        *result = reason;
    return (RTS_HANDLE)RTS_INVALID_HANDLE;
}

RTS_HANDLE SchedRegisterExternalEvent(const char *name, RTS_RESULT *result)
{
    RTS_UI32 i;

    if (find_event(name) != NULL)
        return no_event(result, ERR_DUPLICATE);
    for (i = 0; SCHED_MAX_EXTERNAL_EVENTS > 0 && i < PLACES; i++) {
        if (events[i].name == NULL) {
            events[i].name = name;
            if (result != NULL)
                *result = ERR_OK;
            return i;
        }
    }
    return no_event(result, ERR_NOMEMORY);
}

static bool is_event(RTS_HANDLE event)
{
    return SCHED_MAX_EXTERNAL_EVENTS > 0 && event < PLACES && events[event].name != NULL;
}

RTS_RESULT SchedUnregisterExternalEvent(RTS_HANDLE event)
{
    if (!is_event(event))
        return ERR_INVALID_HANDLE;
    events[event].name = NULL;
    return ERR_OK;
}

RTS_RESULT SchedPostExternalEvent(RTS_HANDLE event)
{
    if (!is_event(event))
        return ERR_INVALID_HANDLE;
    (void)SysAtomicAdd(&events[event].posts, 1);
    return ERR_OK;
}
