/*
 * tasks.c - the interrupts of tasks: one software interrupt, and levels that software keeps.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A task runs within the interrupt that began it, with interrupts on, so a task of a better level interrupts it by the
 * same interrupt. Those of its own level and worse ones wait until it ends.
 */
#include "BareMetal.h"

enum { LEVEL_MAIN = 255 };

static struct {
    RTS_UI32 pending; /* bit n: timer n */
    RTS_UI8 level[SYSTIMER_COUNT];
    volatile RTS_UI8 running; /* the best level that runs */
} waiting = {.running = LEVEL_MAIN};

void CpuTaskSetLevel(RTS_UI32 timer, RTS_UI32 level)
{
    waiting.level[timer] = (RTS_UI8)level;
}

void CpuTaskTrigger(RTS_UI32 timer)
{
    __atomic_fetch_or(&waiting.pending, 1u << timer, __ATOMIC_RELAXED);
    CLINT_MSIP = 1;
    (void)CLINT_MSIP; /* it has arrived: a better task runs before the caller goes on */
}

RTS_UI32 CpuTaskLevel(void)
{
    return waiting.running;
}

void CpuTaskForget(RTS_UI32 timer)
{
    __atomic_fetch_and(&waiting.pending, ~(1u << timer), __ATOMIC_RELAXED);
}

/* The pending timer of the best level, if that is better than `level`; else SYSTIMER_COUNT. */
static RTS_UI32 find_pending(RTS_UI32 level)
{
    RTS_UI32 found = SYSTIMER_COUNT;
    for (RTS_UI32 i = 0; i < SYSTIMER_COUNT; i++) {
        if ((waiting.pending >> i & 1) != 0 && waiting.level[i] < level) {
            level = waiting.level[i];
            found = i;
        }
    }
    return found;
}

RTS_NOINLINE void TasksInterrupt(void)
{
    RTS_UI8 interrupted = waiting.running;
    RTS_UI32 timer;

    CLINT_MSIP = 0;
    while ((timer = find_pending(interrupted)) < SYSTIMER_COUNT) {
        CpuTaskForget(timer);
        waiting.running = waiting.level[timer];
        CSR_SET("mstatus", MSTATUS_MIE);
        SysTimerRun(timer);
        CSR_CLEAR("mstatus", MSTATUS_MIE);
        waiting.running = interrupted;
    }
}
