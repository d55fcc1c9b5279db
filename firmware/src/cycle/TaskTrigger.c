/*
 * TaskTrigger.c - events that make a task run; external events.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Events are counted where they happen and handled where the task runs, each by one cycle. The count is a single
 * number: how often the variable was found changed, which is odd while it is TRUE. What looks at the variable looks
 * again when another context has counted meanwhile, so that looks of several tasks come in an order, and no edge that a
 * task has set at the end of its cycle is counted twice or not at all.
 */
#include "TaskTrigger.h"

#include <string.h>

#include "CmpChecksum.h"
#include "CmpItf.h"
#include "SchedEvents.h"
#include "SysAtomic.h"
#include "SysTimer.h"
#include "rts_config.h"

/* Events are counted modulo 65536: fewer may wait. */
typedef struct {
    RTS_UI32 changes;  /* of the variable, odd: it is TRUE; two for each post of an external event */
    RTS_UI16 answered; /* events that a cycle was for, and those lost */
    RTS_UI16 lost;
} TRIGGER;

static struct {
    const CDL_TASK *tasks;
    RTS_UI8 *const *areas;
    RTS_UI32 count;
    RTS_UI32 watched; /* tasks up to the last one that waits for a variable */
    TRIGGER list[APP_MAX_TASKS];
} triggers;

static const RTS_HANDLE *timers; /* of the tasks, where SCHED_EVENTS_IN_TIMERS */

enum { PLACES = SCHED_MAX_EXTERNAL_EVENTS > 0 ? SCHED_MAX_EXTERNAL_EVENTS : 1 };
static RTS_UI32 events[PLACES]; /* CRC of the name, 0: free */

void TriggerReset(void)
{
    CMP_CLEAR(triggers);
    if (SCHED_MAX_EXTERNAL_EVENTS > 0)
        CMP_CLEAR(events);
}

/* ---- counting ---- */

/* Where tasks that wait for events run in main, a pass of it comes soon. */
static void wake(RTS_UI32 task)
{
    if (SCHED_EVENTS_IN_TIMERS && timers != NULL)
        SysTimerTrigger(timers[task], 0);
}

static RTS_UI32 is_true(const CDL_TASK *task)
{
    const volatile RTS_UI8 *byte = triggers.areas[task->event_area] + task->event_offset;

    return (*byte & ~(RTS_UI32)task->event_ignored) != 0;
}

static void note(RTS_UI32 task)
{
    RTS_UI32 *changes = &triggers.list[task].changes;
    RTS_UI32 before = SysAtomicLoad(changes);

    for (; is_true(&triggers.tasks[task]) != (before & 1); before = SysAtomicLoad(changes)) {
        (void)SysAtomicReplace(changes, before, before + 1); /* or another context did; and may not have woken it yet */
        if ((before & 1) == 0)
            wake(task);
    }
}

static RTS_NOINLINE void note_all(void)
{
    RTS_UI32 i;

    for (i = 0; i < triggers.watched; i++) {
        if (SCHED_WAITS_FOR_VARIABLE(triggers.tasks[i].kind))
            note(i);
    }
}

/* In each cycle of every program, most of which have no such task. */
void SchedNoteEvents(void)
{
    if (triggers.watched != 0)
        note_all();
}

/* Events so far: a variable that is TRUE has risen once more than it fell. */
static RTS_UI32 count_events(const TRIGGER *trigger)
{
    return (SysAtomicLoad(&trigger->changes) + 1) / 2;
}

bool TriggerIsLevel(RTS_UI32 task)
{
    return SCHED_LEVEL_EVENTS && triggers.tasks[task].kind == KIND_LEVEL;
}

/* What it finds counts as noted, so the next rise wakes the task. */
static bool take_level(RTS_UI32 task)
{
    note(task);
    return (SysAtomicLoad(&triggers.list[task].changes) & 1) != 0;
}

bool TriggerTake(RTS_UI32 task)
{
    TRIGGER *trigger = &triggers.list[task];
    RTS_UI32 waiting = (RTS_UI16)(count_events(trigger) - trigger->answered);
    RTS_UI32 lost = waiting > SCHED_MAX_WAITING_EVENTS ? waiting - SCHED_MAX_WAITING_EVENTS : 0;

    if (TriggerIsLevel(task))
        return take_level(task);
    if (waiting == 0)
        return false;
    trigger->answered = (RTS_UI16)(trigger->answered + 1 + lost);
    trigger->lost = (RTS_UI16)(trigger->lost + lost);
    return true;
}

RTS_UI32 TriggerGetLost(RTS_UI32 task)
{
    return triggers.list[task].lost;
}

/* ---- the tasks ---- */

void TriggerCreate(const CDL_TASK *tasks, RTS_UI32 count, RTS_UI8 *const *areas, const RTS_HANDLE *task_timers)
{
    if (SCHED_MAX_EXTERNAL_EVENTS > 0)
        SysAtomicStore(&triggers.count, 0); /* an event that comes meanwhile is for no task */
    triggers.watched = 0;
    memset(triggers.list, 0, sizeof triggers.list);
    if (SCHED_MAX_EXTERNAL_EVENTS == 0 || count > 0)
        triggers.tasks = tasks; /* those of before stay readable */
    triggers.areas = areas;
    timers = task_timers;
    SysAtomicStore(&triggers.count, count);
}

const CDL_TASK *TriggerGetTask(RTS_UI32 task)
{
    return &triggers.tasks[task];
}

static RTS_INLINE void forget(RTS_UI32 task)
{
    RTS_UI32 changes = 0;

    if (SCHED_WAITS_FOR_VARIABLE(triggers.tasks[task].kind)) {
        triggers.watched = task + 1;
        changes = TriggerIsLevel(task) ? 0 : is_true(&triggers.tasks[task]);
    }
    SysAtomicStore(&triggers.list[task].changes, changes);
    triggers.list[task].answered = (RTS_UI16)changes; /* as many rises */
}

void TriggerForget(void)
{
    RTS_UI32 i;

    for (i = 0; i < triggers.count; i++)
        forget(i);
}

#if ONLINE_CHANGE
void TriggerChange(const CDL_TASK *tasks, RTS_UI32 count, RTS_UI32 kept)
{
    RTS_UI32 i;

    triggers.tasks = tasks;
    triggers.watched = 0;
    for (i = 0; i < count; i++) {
        if ((kept >> i & 1) == 0) {
            triggers.list[i].lost = 0;
            forget(i);
        } else if (SCHED_WAITS_FOR_VARIABLE(tasks[i].kind)) {
            triggers.watched = i + 1;
        }
    }
    SysAtomicStore(&triggers.count, count);
}
#endif

/* ---- external events ---- */

static RTS_UI32 id_of(const char *name)
{
    return CRC32Update(0, name, (RTS_SIZE)strlen(name));
}

/* The place of an event, or the first free one for 0; PLACES when there is none. */
static RTS_UI32 find_event(RTS_UI32 id)
{
    RTS_UI32 i = 0;

    while (i < PLACES && events[i] != id)
        i++;
    return i;
}

bool SchedHasExternalEvent(RTS_UI32 id)
{
    return SCHED_MAX_EXTERNAL_EVENTS > 0 && id != 0 && find_event(id) < PLACES;
}

static RTS_HANDLE no_event(RTS_RESULT *result, RTS_RESULT reason)
{
    if (result != NULL)
        *result = reason;
    return RTS_INVALID_HANDLE;
}

RTS_HANDLE SchedRegisterExternalEvent(const char *name, RTS_RESULT *result)
{
    RTS_UI32 place = find_event(0);

    if (SchedHasExternalEvent(id_of(name)))
        return no_event(result, ERR_DUPLICATE);
    if (SCHED_MAX_EXTERNAL_EVENTS == 0 || place == PLACES)
        return no_event(result, ERR_NOMEMORY);
    events[place] = id_of(name);
    if (result != NULL)
        *result = ERR_OK;
    return place;
}

static bool is_event(RTS_HANDLE event)
{
    return SCHED_MAX_EXTERNAL_EVENTS > 0 && event < PLACES && events[event] != 0;
}

RTS_RESULT SchedUnregisterExternalEvent(RTS_HANDLE event)
{
    if (!is_event(event))
        return ERR_INVALID_HANDLE;
    events[event] = 0;
    return ERR_OK;
}

RTS_RESULT SchedPostExternalEvent(RTS_HANDLE event)
{
    RTS_UI32 i;

    if (!is_event(event))
        return ERR_INVALID_HANDLE;
    for (i = 0; i < SysAtomicLoad(&triggers.count); i++) {
        const CDL_TASK *task = &triggers.tasks[i];
        if (task->kind == KIND_EXTERNAL && task->event_offset == events[event]) {
            (void)SysAtomicAdd(&triggers.list[i].changes, 2);
            wake(i);
        }
    }
    return ERR_OK;
}
