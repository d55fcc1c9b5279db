/*
 * SysTimer.c - timers as interrupts that pre-empt each other.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * One hardware timer of the board is the alarm for the earliest due time. When it fires, each timer that is due gets
 * its own interrupt set pending by software, and runs at its own level: any number of timers from one
 * hardware timer, and due times that never drift. Due times are the alarm's alone: it goes on while callbacks run, and
 * counts what they miss. Rank is by priority, among equals by place. A timer without an interval is set pending by
 * SysTimerTrigger; that it is due every 71 minutes too costs less than an exception from the rule.
 */
#include "SysTimer.h"

#include "BareMetal.h"
#include "SysTime.h"

enum { ALARM_MAX_NS = 1000000000, OVERDUE_NS = 1000000000, NS_PER_US = 1000 };

typedef enum { TIMER_FREE, TIMER_STOPPED, TIMER_WAITING, TIMER_FIRED } TIMER_STATE;

typedef struct {
    SYS_TIMER_CALLBACK callback;
    void *param;
    RTS_I64 next_ns; /* due time to come */
    RTS_I64 due_ns;  /* that the callback is called for */
    RTS_UI32 interval_us;
    volatile RTS_UI32 overruns;
    RTS_UI8 priority;
    volatile RTS_UI8 state; /* TIMER_STATE */
} TIMER;

static struct {
    TIMER timer[SYSTIMER_COUNT];
    TIMER *end; /* past the last one in use */
} state;

void SysTimerInit(void)
{
    for (RTS_UI32 i = 0; i < SYSTIMER_COUNT; i++) {
        state.timer[i].state = TIMER_FREE;
        CpuTaskEnable(i, LEVEL_TIMER + i);
    }
    state.end = state.timer;
}

static void fall_due(TIMER *timer, RTS_UI32 index)
{
    if (timer->state == TIMER_FIRED) {
        timer->overruns++;
    } else {
        timer->due_ns = timer->next_ns;
        timer->state = TIMER_FIRED;
        CpuTaskTrigger(index);
    }
    timer->next_ns += (RTS_I64)timer->interval_us * NS_PER_US;
}

/* A due time that has passed too is the next alarm's, which comes at once. */
void SysTimerAlarm(void)
{
    RTS_I64 now = SysTimeGetNs(), next = now + ALARM_MAX_NS;
    RTS_UI32 index = 0;
    for (TIMER *timer = state.timer; timer < state.end; timer++, index++) {
        if (timer->state < TIMER_WAITING)
            continue;
        if (timer->next_ns <= now)
            fall_due(timer, index);
        if (timer->next_ns < next)
            next = timer->next_ns;
    }
    BoardAlarmSet(next > now ? (RTS_UI32)(next - now) : 0);
}

void SysTimerRun(RTS_UI32 index)
{
    TIMER *timer = &state.timer[index];
    timer->callback(timer->param, timer->due_ns);
    timer->state = TIMER_WAITING;
}

/* Since when the timer's next call has been due. */
static RTS_I64 due_since(const TIMER *timer)
{
    return timer->state == TIMER_FIRED ? timer->due_ns : timer->next_ns;
}

bool SysTimersWork(void)
{
    RTS_UI32 mask = CpuMask();
    RTS_I64 overdue = SysTimeGetNs() - OVERDUE_NS;
    bool work = true;
    for (const TIMER *timer = state.timer; timer < state.end; timer++)
        work = work && (timer->state < TIMER_WAITING || due_since(timer) > overdue);
    CpuRestore(mask);
    return work;
}

static bool outranks(RTS_UI32 one, RTS_UI32 other)
{
    RTS_UI8 a = state.timer[one].priority, b = state.timer[other].priority;
    return a < b || (a == b && one < other);
}

/* Gives each timer in use the level of its rank. */
static void assign_levels(void)
{
    for (RTS_UI32 i = 0; i < SYSTIMER_COUNT; i++) {
        RTS_UI32 level = LEVEL_TIMER;
        for (RTS_UI32 k = 0; k < SYSTIMER_COUNT; k++)
            level += state.timer[k].state != TIMER_FREE && outranks(k, i);
        CpuTaskSetLevel(i, level);
    }
}

static TIMER *find_timer(RTS_HANDLE handle)
{
    return handle < SYSTIMER_COUNT && state.timer[handle].state != TIMER_FREE ? &state.timer[handle] : NULL;
}

RTS_RESULT SysTimerCreate(SYS_TIMER_CALLBACK callback, void *param, RTS_UI32 interval_us, RTS_UI32 priority,
                          RTS_HANDLE *timer)
{
    if (callback == NULL || priority > 31)
        return ERR_PARAMETER;
    for (RTS_UI32 i = 0; i < SYSTIMER_COUNT; i++) {
        if (state.timer[i].state != TIMER_FREE)
            continue;
        state.timer[i] = (TIMER){.callback = callback,
                                 .param = param,
                                 .interval_us = interval_us != 0 ? interval_us : UINT32_MAX,
                                 .priority = (RTS_UI8)priority,
                                 .state = TIMER_STOPPED};
        if (state.end <= &state.timer[i])
            state.end = &state.timer[i + 1];
        assign_levels();
        *timer = i;
        return ERR_OK;
    }
    return ERR_NOMEMORY;
}

RTS_RESULT SysTimerStart(RTS_HANDLE handle)
{
    TIMER *timer = find_timer(handle);
    if (timer == NULL)
        return ERR_INVALID_HANDLE;
    RTS_UI32 mask = CpuMask();
    timer->next_ns = SysTimeGetNs();
    timer->state = TIMER_WAITING;
    BoardAlarmSet(0);
    CpuRestore(mask);
    return ERR_OK;
}

/* While the interrupt is active, it is left pending, and comes again. */
void SysTimerTrigger(RTS_HANDLE handle, RTS_I64 due_ns)
{
    RTS_UNUSED(due_ns);
    if (handle < SYSTIMER_COUNT && state.timer[handle].state >= TIMER_WAITING)
        CpuTaskTrigger(handle);
}

/* Called from main, so no timer's interrupt is active: it is enough that none starts again, nor one that is pending. */
RTS_RESULT SysTimerStop(RTS_HANDLE handle)
{
    TIMER *timer = find_timer(handle);
    if (timer == NULL)
        return ERR_INVALID_HANDLE;
    timer->state = TIMER_STOPPED;
    CpuTaskForget(handle);
    return ERR_OK;
}

RTS_RESULT SysTimerDelete(RTS_HANDLE handle)
{
    if (SysTimerStop(handle) != ERR_OK)
        return ERR_INVALID_HANDLE;
    state.timer[handle].state = TIMER_FREE;
    while (state.end > state.timer && state.end[-1].state == TIMER_FREE)
        state.end--;
    return ERR_OK;
}

RTS_UI32 SysTimerGetOverruns(RTS_HANDLE handle)
{
    const TIMER *timer = find_timer(handle);
    return timer != NULL ? timer->overruns : 0;
}
