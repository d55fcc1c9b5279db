/*
 * test_task_used_time.c - the watchdog where the port knows the processor time of each task.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * CmpScheduleTimer.c alone, with guards of this file in place of those of real cycles. A guard's number is odd while its
 * cycle runs, and so small that those of different programs are often the same.
 */
#include "CmpScheduleTimer.h"
#include "IecCycle.h"
#include "SysExcept.h"
#include "SysTime.h"
#include "SysTimer.h"
#include "../../firmware/src/cycle/TaskTrigger.h"
#include "rts_config.h"
#include "test.h"

#include <string.h>

#define NS_PER_S 1000000000LL

static struct {
    RTS_UI32 count; /* of tasks */
    RTS_UI32 runs;  /* the index of the guard whose cycle runs */
    IEC_GUARD guard;
    RTS_I64 used_ns;
    RTS_UI32 breaks;
} fake;

/* ---- what it calls ---- */

RTS_UI32 IecTaskGetCount(void)
{
    return fake.count;
}

bool IecTaskReadGuard(RTS_UI32 index, IEC_GUARD *out)
{
    *out = fake.guard;
    return index == fake.runs;
}

bool IecTaskCycle(RTS_UI32 index, RTS_I64 due_ns)
{
    return index > 0 && due_ns > 0;
}

RTS_I64 SysExceptGetUsedNs(const void *arg)
{
    RTS_UNUSED(arg);
    return fake.used_ns;
}

void SysExceptBreak(const void *arg, RTS_UI32 code)
{
    RTS_UNUSED(arg);
    CHECK_EQUAL(code, RTSEXCPT_WATCHDOG);
    fake.breaks++;
}

RTS_I64 SysTimeGetNs(void)
{
    return test_result();
}

RTS_RESULT SysTimerCreate(SYS_TIMER_CALLBACK callback, void *param, RTS_UI32 interval_us, RTS_UI32 priority,
                          RTS_HANDLE *timer)
{
    RTS_UNUSED(param);
    *timer = 0;
    return callback != NULL && interval_us + priority < 0xFFFFFFFF ? ERR_OK : ERR_PARAMETER;
}

RTS_I64 SysTimerGetUsedNs(RTS_HANDLE timer)
{
    return timer;
}

RTS_RESULT SysTimerStart(RTS_HANDLE timer)
{
    RTS_UNUSED(timer);
    return ERR_OK;
}

RTS_RESULT SysTimerStop(RTS_HANDLE timer)
{
    RTS_UNUSED(timer);
    return ERR_OK;
}

RTS_RESULT SysTimerDelete(RTS_HANDLE timer)
{
    RTS_UNUSED(timer);
    return ERR_OK;
}

void SysTimerTrigger(RTS_HANDLE timer, RTS_I64 due_ns)
{
    RTS_UNUSED(timer);
    RTS_UNUSED(due_ns);
}

RTS_UI32 SysTimerGetOverruns(RTS_HANDLE timer)
{
    RTS_UNUSED(timer);
    return test_result();
}

/* ---- tests ---- */

/* A program of `count` tasks, whose guard `runs` has this number and limit. */
static void load(RTS_UI32 count, RTS_UI32 runs, RTS_UI32 serial, RTS_I64 limit_ns)
{
    static CDL_TASK tasks[APP_MAX_TASKS];
    static RTS_UI8 *const areas[1];

    fake.count = count;
    CHECK_EQUAL(SchedCreateTasks(tasks, count, areas), ERR_OK);
    fake.runs = runs;
    fake.guard.serial = serial;
    fake.guard.limit_ns = limit_ns;
}

/* Has the watchdog look when the context has had this much of the processor; whether it broke something off. */
static bool breaks_at(RTS_I64 used_ns)
{
    RTS_UI32 before = fake.breaks;

    fake.used_ns = used_ns;
    SchedWatchdogCheck(NS_PER_S);
    return fake.breaks != before;
}

static void a_cycle_is_charged_with_what_it_used_since_it_was_seen(void)
{
    load(1, 0, 1, NS_PER_S);
    CHECK(!breaks_at(100 * NS_PER_S) && !breaks_at(101 * NS_PER_S) && breaks_at(101 * NS_PER_S + 1));
    fake.guard.serial += 2;
    CHECK(!breaks_at(102 * NS_PER_S) && !breaks_at(103 * NS_PER_S) && breaks_at(104 * NS_PER_S));
}

static void an_initialisation_is_not_charged_with_what_a_task_used(void)
{
    load(2, 1, 5, 5 * NS_PER_S);
    CHECK(!breaks_at(NS_PER_S / 100));
    load(1, 1, 5, 5 * NS_PER_S); /* the guard past the last task */
    CHECK(!breaks_at(60 * NS_PER_S) && !breaks_at(65 * NS_PER_S) && breaks_at(66 * NS_PER_S));
}

static void a_task_is_not_charged_with_less_because_of_an_initialisation(void)
{
    load(1, 1, 7, 5 * NS_PER_S);
    CHECK(!breaks_at(3600 * NS_PER_S));
    load(2, 1, 7, NS_PER_S);
    CHECK(!breaks_at(NS_PER_S) && breaks_at(3 * NS_PER_S));
}

static void nor_because_of_a_task_of_the_program_before(void)
{
    load(1, 0, 9, NS_PER_S);
    CHECK(!breaks_at(3600 * NS_PER_S));
    load(1, 0, 9, NS_PER_S);
    CHECK(!breaks_at(NS_PER_S) && breaks_at(3 * NS_PER_S));
}

int main(void)
{
    CHECK_EQUAL(CmpScheduleTimer_Hook(CH_INIT), ERR_OK);
    RUN(a_cycle_is_charged_with_what_it_used_since_it_was_seen);
    RUN(an_initialisation_is_not_charged_with_what_a_task_used);
    RUN(a_task_is_not_charged_with_less_because_of_an_initialisation);
    RUN(nor_because_of_a_task_of_the_program_before);
    return test_result();
}
