/*
 * SimTimers.c - timers on the virtual clock.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SimTimers.h"

#include <string.h>

#include "Sim.h"
#include "SimClock.h"
#include "SimPower.h"
#include "SimTimes.h"
#include "SysTimer.h"
#include "rts_config.h"

enum { MAX_TIMERS = APP_MAX_TASKS + 4 + 2 * CAN_CONTROLLERS };

typedef struct {
    SYS_TIMER_CALLBACK callback; /* NULL: free */
    void *param;
    RTS_I64 interval_ns; /* 0: triggered */
    RTS_I64 due_ns;      /* NEVER while stopped, or not triggered */
    RTS_UI32 priority;
    RTS_UI32 overruns;
    bool started;
} TIMER;

static TIMER timers[MAX_TIMERS];
static RTS_I64 group_ns; /* when the timers that run now were due; NEVER if none runs */

void SimTimersForget(void)
{
    RTS_UI32 i;

    group_ns = NEVER;
    memset(timers, 0, sizeof timers);
    for (i = 0; i < MAX_TIMERS; i++)
        timers[i].due_ns = NEVER;
}

static TIMER *get_timer(RTS_HANDLE handle)
{
    return handle < MAX_TIMERS && timers[handle].callback != NULL ? &timers[handle] : NULL;
}

RTS_RESULT SysTimerCreate(SYS_TIMER_CALLBACK callback, void *param, RTS_UI32 interval_us, RTS_UI32 priority,
                          RTS_HANDLE *timer)
{
    RTS_UI32 i;

    if (callback == NULL || priority > 31)
        return ERR_PARAMETER;
    for (i = 0; i < MAX_TIMERS; i++) {
        if (timers[i].callback == NULL) {
            TIMER created = {callback, param, interval_us * NS_PER_US, NEVER, priority, 0, false};
            timers[i] = created;
            *timer = i;
            return ERR_OK;
        }
    }
    return ERR_NOMEMORY;
}

RTS_RESULT SysTimerStart(RTS_HANDLE handle)
{
    TIMER *timer = get_timer(handle);

    if (timer == NULL)
        return ERR_INVALID_HANDLE;
    timer->due_ns = SimNow();
    timer->started = true;
    return ERR_OK;
}

/* What was due before is due with what runs now, also when that took its time: so priority decides what comes next. */
static RTS_I64 not_before_now(RTS_I64 due_ns)
{
    RTS_I64 now_ns = group_ns < SimNow() ? group_ns : SimNow();

    return due_ns > now_ns ? due_ns : now_ns;
}

void SysTimerTrigger(RTS_HANDLE handle, RTS_I64 due_ns)
{
    TIMER *timer = get_timer(handle);

    due_ns = not_before_now(due_ns);
    if (timer != NULL && timer->started && timer->interval_ns == 0 && due_ns < timer->due_ns)
        timer->due_ns = due_ns;
}

RTS_RESULT SysTimerStop(RTS_HANDLE handle)
{
    TIMER *timer = get_timer(handle);

    if (timer == NULL)
        return ERR_INVALID_HANDLE;
    timer->due_ns = NEVER;
    timer->started = false;
    return ERR_OK;
}

RTS_RESULT SysTimerDelete(RTS_HANDLE handle)
{
    RTS_RESULT result = SysTimerStop(handle);

    if (result == ERR_OK)
        timers[handle].callback = NULL;
    return result;
}

RTS_UI32 SysTimerGetOverruns(RTS_HANDLE handle)
{
    const TIMER *timer = get_timer(handle);

    return timer != NULL ? timer->overruns : 0;
}

/* ---- running ---- */

/* The timer that is due first, of these the one with the highest priority; NULL when none runs. */
static TIMER *next_timer(void)
{
    TIMER *next = NULL;
    TIMER *timer;

    for (timer = timers; timer < timers + MAX_TIMERS; timer++) {
        if (timer->due_ns == NEVER)
            continue;
        if (next == NULL || timer->due_ns < next->due_ns ||
            (timer->due_ns == next->due_ns && timer->priority < next->priority))
            next = timer;
    }
    return next;
}

/* Skips due times that went by while the callback ran. */
static void set_next_due(TIMER *timer)
{
    RTS_I64 late;

    if (timer->due_ns == NEVER)
        return; /* stopped by what it called */
    timer->due_ns += timer->interval_ns;
    late = SimNow() - timer->due_ns;
    if (late > 0) {
        RTS_UI32 missed = (RTS_UI32)((late + timer->interval_ns - 1) / timer->interval_ns);
        timer->overruns += missed;
        timer->due_ns += missed * timer->interval_ns;
    }
}

static void run_timer(TIMER *timer)
{
    RTS_I64 due_ns = timer->due_ns;

    SimClockReach(due_ns);
    if (timer->interval_ns == 0)
        timer->due_ns = NEVER; /* it may be triggered again now */
    timer->callback(timer->param, due_ns);
    SimPowerCheck();
    if (timer->interval_ns != 0)
        set_next_due(timer);
}

RTS_I64 SimTimersGetDueNs(void)
{
    const TIMER *timer = next_timer();

    return timer != NULL ? timer->due_ns : NEVER;
}

void SimTimersRun(void)
{
    TIMER *timer = next_timer();

    if (timer == NULL)
        return;
    group_ns = timer->due_ns;
    for (; timer != NULL && timer->due_ns == group_ns; timer = next_timer())
        run_timer(timer);
    group_ns = NEVER;
}

void SimTimersShift(RTS_I64 ns)
{
    TIMER *timer;

    for (timer = timers; timer < timers + MAX_TIMERS; timer++) {
        if (timer->due_ns != NEVER)
            timer->due_ns += ns;
    }
}
