/*
 * test_task_moment.c - the retain area is copied as it is at a moment between the cycles of all tasks, also when these
 * never pause together.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * IecCycle is compiled a second time here, on fakes of what it calls. Each task is a thread that starts its next cycle
 * at once and fills a part of the area with one number per cycle: a copy taken within a cycle would hold two.
 */
#define _GNU_SOURCE
#define ONLINE_CHANGE 0 /* it needs more than the fakes below */
#include <pthread.h>
#include <time.h>

#include "../../firmware/src/cycle/IecCycle.c"

#include "test.h"

enum { TASKS = 4, PART = 1024, AREA_SIZE = TASKS * PART, COPIES = 300 };

static RTS_UI8 area[AREA_SIZE];
static RTS_UI8 copied[AREA_SIZE];
static CDL_TASK records[TASKS];
static RTS_UI32 length[TASKS]; /* of a cycle, in turns of a loop */
static RTS_UI32 rounds[TASKS]; /* cycles begun */
static __thread RTS_UI32 me;

static RTS_I64 fixed_ns; /* 0: time passes */
static RTS_UI32 pauses;
static RTS_UI32 last_pause; /* in which the cycle of task 1 ends; 0: it does not */

RTS_I64 SysTimeGetNs(void)
{
    struct timespec now;

    if (fixed_ns != 0)
        return fixed_ns;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (RTS_I64)now.tv_sec * 1000000000 + now.tv_nsec;
}

void SysTimePause(void)
{
    static const struct timespec pause = {0, 20000};

    if (fixed_ns == 0) {
        nanosleep(&pause, NULL);
        return;
    }
    pauses++;
    fixed_ns += 20000;
    if (pauses == last_pause)
        guard_end(&tasks.list[1].guard);
}

bool SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    RTS_UNUSED(exception);
    fn(arg);
    return true;
}

void AppHandleException(RTS_I32 task, RTS_UI32 code, uintptr_t address)
{
    RTS_UNUSED(task);
    RTS_UNUSED(code);
    RTS_UNUSED(address);
}

void SchedNoteEvents(void)
{
}

RTS_I64 SysTimeGetUsedNs(void)
{
    return 0;
}

void AppEnterSafeState(void)
{
}

RTS_UI32 CyclePhasesGet(void)
{
    return 0;
}

CYCLE_ENTRY *cycle_phases[CYCLE_SAFE_STATE + 1];

void CyclePhasesForget(void)
{
}

#if APP_IMAGE_SIZE > 0
bool AppImageSetContext(RTS_UI32 task, IEC_CONTEXT *context)
{
    RTS_UNUSED(task);
    RTS_UNUSED(context);
    return false;
}

void AppImageCopyIn(RTS_UI32 task)
{
    RTS_UNUSED(task);
}

void AppImageCopyOut(RTS_UI32 task, const RTS_UI32 *running)
{
    RTS_UNUSED(task);
    RTS_UNUSED(running);
}
#endif

/* The code of all tasks. */
static void fill_part(const IEC_CONTEXT *context)
{
    RTS_UI32 round = SysAtomicAdd(&rounds[me], 1);
    RTS_UI32 i;

    RTS_UNUSED(context);
    for (i = 0; i < PART; i++) {
        volatile RTS_UI32 turns = length[me] / PART;
        area[me * PART + i] = (RTS_UI8)round;
        while (turns > 0)
            turns--;
    }
}

static void copy_area(void)
{
    memcpy(copied, area, sizeof area);
}

static void *run_task(void *index)
{
    me = (RTS_UI32)(uintptr_t)index;
    while (SysAtomicLoad(&tasks.running))
        (void)IecTaskCycle(me, SysTimeGetNs());
    return NULL;
}

static pthread_t threads[TASKS];
static RTS_UI32 thread_count;

static void begin(RTS_UI32 count)
{
    IEC_CONTEXT context = {0};
    RTS_UI32 i;

    IecCycleForget();
    context.area[APP_AREA_CODE] = (RTS_UI8 *)(uintptr_t)fill_part;
    memset(rounds, 0, sizeof rounds);
    IecCycleCreate(records, count, &context);
    IecCycleStart();
    thread_count = count;
    for (i = 0; i < count; i++)
        CHECK(pthread_create(&threads[i], NULL, run_task, (void *)(uintptr_t)i) == 0);
    for (i = 0; i < count; i++) {
        while (SysAtomicLoad(&rounds[i]) < 2)
            SysTimePause();
    }
}

static void end(void)
{
    RTS_UI32 i;

    SysAtomicStore(&tasks.running, 0);
    for (i = 0; i < thread_count; i++)
        pthread_join(threads[i], NULL);
    IecCycleStop();
    IecCycleCallOff();
}

static bool copy_now(void)
{
    RTS_UI32 tries;

    for (tries = 0; tries < 100000; tries++) {
        if (IecTaskBetweenCycles(copy_area))
            return true;
        SysTimePause();
    }
    return false;
}

static RTS_UI32 count_torn(void)
{
    RTS_UI32 torn = 0;
    RTS_UI32 i;

    for (i = 0; i < AREA_SIZE; i++)
        torn += copied[i] != copied[i / PART * PART];
    return torn;
}

static void take_copies(RTS_UI32 count)
{
    RTS_UI32 i;

    for (i = 0; i < count; i++) {
        memset(copied, 0xEE, sizeof copied);
        CHECK(copy_now());
        CHECK_EQUAL(count_torn(), 0);
    }
}

static void tasks_that_never_pause_are_not_torn(void)
{
    RTS_UI32 i;

    for (i = 0; i < TASKS; i++)
        length[i] = 150000 + 10000 * i;
    begin(TASKS);
    take_copies(COPIES);
    end();
    for (i = 0; i < TASKS; i++)
        CHECK(rounds[i] > 0);
}

/* Two tasks stand still in time: task 1 has been in its cycle since `since_ms` ms; their last cycles took as long as
 * given. Returns how often task 0 pauses before it begins while a copy is wanted. */
static RTS_UI32 pauses_of(RTS_UI32 own_ms, RTS_UI32 other_ms, RTS_UI32 since_ms, RTS_UI32 ends_in)
{
    enum { MS = 1000000 };
    IEC_CONTEXT context = {0};

    IecCycleForget();
    IecCycleCreate(records, 2, &context);
    fixed_ns = 1000 * (RTS_I64)MS;
    IecCycleStart();
    tasks.list[0].last_ns = own_ms * MS;
    tasks.list[1].last_ns = other_ms * MS;
    guard_begin(&tasks.list[1].guard, fixed_ns - (RTS_I64)since_ms * MS);
    pauses = 0;
    last_pause = ends_in;
    CHECK(!IecTaskBetweenCycles(copy_area));
    make_moment(&tasks.list[0]);
    CHECK_EQUAL(is_wanted(), (ends_in == 0 || pauses < ends_in));
    fixed_ns = 0;
    return pauses;
}

static void a_long_task_waits_for_a_short_one(void)
{
    CHECK_EQUAL(pauses_of(10, 1, 0, 7), 7);
}

static void a_short_task_does_not_wait_for_a_long_one(void)
{
    CHECK_EQUAL(pauses_of(1, 10, 0, 7), 0);
}

static void a_task_does_not_wait_for_one_that_takes_longer_this_time(void)
{
    CHECK_EQUAL(pauses_of(10, 1, 11, 7), 0);
}

static void a_task_waits_no_longer_than_its_own_cycle_takes(void)
{
    CHECK_EQUAL(pauses_of(10, 1, 0, 0), 501);
    CHECK_EQUAL(pauses_of(10, 1, 9, 0), 51);
}

static void a_first_cycle_waits_for_no_other(void)
{
    CHECK_EQUAL(pauses_of(0, 1, 0, 7), 0);
}

static void a_copy_of_stopped_tasks_is_taken_at_once(void)
{
    IEC_CONTEXT context = {0};

    IecCycleForget();
    IecCycleCreate(records, TASKS, &context);
    memset(area, 7, sizeof area);
    CHECK(IecTaskBetweenCycles(copy_area));
    CHECK(memcmp(copied, area, sizeof area) == 0);
}

/* The only task is in its cycle: the copy is taken when that is over, and only once. */
static void what_runs_is_waited_for(void)
{
    IEC_CONTEXT context = {0};

    IecCycleForget();
    context.area[APP_AREA_CODE] = (RTS_UI8 *)(uintptr_t)fill_part;
    IecCycleCreate(records, 1, &context);
    IecCycleStart();
    length[0] = 0;
    rounds[0] = 0; /* a cycle fills the area with its number: none of these is 77 */
    me = 0;
    guard_begin(&tasks.list[0].guard, 0);
    memset(copied, 0xEE, sizeof copied);
    CHECK(!IecTaskBetweenCycles(copy_area));
    CHECK(!IecTaskBetweenCycles(copy_area));
    CHECK_EQUAL(copied[0], 0xEE);
    guard_end(&tasks.list[0].guard);
    memset(area, 77, sizeof area);
    CHECK_EQUAL(IecTaskCycle(0, SysTimeGetNs()), 1); /* takes it before it begins */
    CHECK(copied[0] == 77 && copied[AREA_SIZE - 1] == 77);
    CHECK_EQUAL(IecTaskCycle(0, SysTimeGetNs()), 1);
    CHECK(IecTaskBetweenCycles(copy_area));
    CHECK_EQUAL(copied[0], 77);
    CHECK(IecTaskBetweenCycles(copy_area)); /* another one */
    CHECK(copied[0] == area[0] && area[0] != 77);
}

static void stopping_calls_a_copy_off(void)
{
    what_runs_is_waited_for();
    guard_begin(&tasks.list[0].guard, 0);
    CHECK(!IecTaskBetweenCycles(copy_area));
    guard_end(&tasks.list[0].guard);
    IecCycleStop();
    IecCycleCallOff();
    memset(copied, 0xEE, sizeof copied);
    CHECK_EQUAL(IecTaskCycle(0, SysTimeGetNs()), 0);
    CHECK_EQUAL(copied[0], 0xEE);
}

static RTS_UI32 interruptions;

/* The copy, and a task that comes in the middle of it. */
static void copy_interrupted(void)
{
    memcpy(copied, area, sizeof area / 2);
    if (interruptions > 0) {
        interruptions--;
        CHECK_EQUAL(IecTaskCycle(0, SysTimeGetNs()), 1);
        memset(area, area[0], sizeof area);
    }
    memcpy(copied + sizeof area / 2, area + sizeof area / 2, sizeof area / 2);
}

static void a_cycle_that_interrupts_the_copy_spoils_it(void)
{
    IEC_CONTEXT context = {0};
    RTS_UI32 i;

    IecCycleForget();
    context.area[APP_AREA_CODE] = (RTS_UI8 *)(uintptr_t)fill_part;
    IecCycleCreate(records, 1, &context);
    IecCycleStart();
    length[0] = 0;
    me = 0;
    for (i = 0; i < 20; i++) {
        interruptions = i;
        while (!IecTaskBetweenCycles(copy_interrupted))
            ;
        CHECK_EQUAL(interruptions, 0);
        CHECK(memcmp(copied, area, sizeof area) == 0);
    }
    IecCycleStop();
    IecCycleCallOff();
}

int main(void)
{
    if (RTS_ONE_CORE) { /* there tasks interrupt each other */
        RUN(a_cycle_that_interrupts_the_copy_spoils_it);
        return test_result();
    }
    RUN(tasks_that_never_pause_are_not_torn);
    RUN(a_long_task_waits_for_a_short_one);
    RUN(a_short_task_does_not_wait_for_a_long_one);
    RUN(a_task_does_not_wait_for_one_that_takes_longer_this_time);
    RUN(a_task_waits_no_longer_than_its_own_cycle_takes);
    RUN(a_first_cycle_waits_for_no_other);
    RUN(a_copy_of_stopped_tasks_is_taken_at_once);
    RUN(what_runs_is_waited_for);
    RUN(stopping_calls_a_copy_off);
    return test_result();
}
