/*
 * test_linux_events.c - tasks in threads: an event is a cycle, and a stop ends every task.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Scheduler, tasks and timers of the Linux port; functions of this file are the application. The machine may be loaded:
 * only a stop has to be there in time, with room to spare.
 */
#define _GNU_SOURCE
#include "../../firmware/src/cycle/AppAreas.h"
#include "AppException.h"
#include "../../firmware/src/cycle/AppImage.h"
#include "CmpAppEmbedded.h"
#include "CmpChecksum.h"
#include "CmpIecTask.h"
#include "CmpScheduleTimer.h"
#include "SysAtomic.h"
#include "SysTime.h"
#include "port.h"
#include "rts_config.h"
#include "test.h"

#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

RTS_RESULT SysWatchdog_Hook(CMP_HOOK hook);

enum { VARIABLES = 4, PATIENCE_S = 20, STOP_MS = 20000 };
#define NS_PER_MS 1000000LL

/* The code area: all functions of this program are within it. */
extern const char __executable_start[];
#define CODE ((uintptr_t)__executable_start)

typedef void (*PROGRAM)(const IEC_CONTEXT *context);

static struct {
    CDL_TASK task[APP_MAX_TASKS];
    RTS_UI32 count;
    RTS_UI8 variable[VARIABLES];
    RTS_UI32 rises[VARIABLES]; /* that cycles ended with */
    RTS_UI32 runs[VARIABLES];  /* of the tasks that wait for them */
    RTS_UI32 cycles;
    RTS_UI32 enough; /* rises after which a variable rests */
    RTS_UI32 entered;
    unsigned random[VARIABLES];
} app;

/* ---- the application ---- */

/* Changes a variable at random; its last value counts. */
static void change(RTS_UI32 i)
{
    RTS_UI8 before = __atomic_load_n(&app.variable[i], __ATOMIC_RELAXED);
    RTS_UI8 after = before;
    for (int k = rand_r(&app.random[i]) % 4; k > 0; k--) {
        after = rand_r(&app.random[i]) % 2 != 0;
        __atomic_store_n(&app.variable[i], after, __ATOMIC_RELAXED);
    }
    if (SysAtomicLoad(&app.rises[i]) >= app.enough) {
        __atomic_store_n(&app.variable[i], before, __ATOMIC_RELAXED);
    } else if (after > before) {
        (void)SysAtomicAdd(&app.rises[i], 1);
    }
}

static void change0(const IEC_CONTEXT *context)
{
    RTS_UNUSED(context);
    change(0);
}
static void change1(const IEC_CONTEXT *context)
{
    RTS_UNUSED(context);
    change(1);
}
static void change2(const IEC_CONTEXT *context)
{
    RTS_UNUSED(context);
    change(2);
}
static void run0(const IEC_CONTEXT *context)
{
    RTS_UNUSED(context);
    (void)SysAtomicAdd(&app.runs[0], 1);
}
static void run1(const IEC_CONTEXT *context)
{
    RTS_UNUSED(context);
    (void)SysAtomicAdd(&app.runs[1], 1);
}
static void run2(const IEC_CONTEXT *context)
{
    RTS_UNUSED(context);
    (void)SysAtomicAdd(&app.runs[2], 1);
}
static void count(const IEC_CONTEXT *context)
{
    RTS_UNUSED(context);
    (void)SysAtomicAdd(&app.cycles, 1);
}

static void loop(const IEC_CONTEXT *context)
{
    RTS_UNUSED(context);
    (void)SysAtomicAdd(&app.entered, 1);
    for (;;) {
        __asm__ volatile("" ::: "memory");
    }
}

static void set(const IEC_CONTEXT *context)
{
    RTS_UNUSED(context);
    __atomic_store_n(&app.variable[0], 1, __ATOMIC_RELAXED);
}

static CDL_TASK *add(RTS_UI8 kind, RTS_UI8 priority, PROGRAM program)
{
    CDL_TASK *task = &app.task[app.count++];
    memset(task, 0, sizeof *task);
    task->kind = kind;
    task->priority = priority;
    task->interval_us = kind == KIND_CYCLIC ? 1000 : 0;
    task->event_area = APP_AREA_NONE;
    task->watchdog_us = 0x7FFFFFFF;
    task->watchdog_sensitivity = 1000;
    task->entry_offset = (RTS_UI32)((uintptr_t)program - CODE);
    return task;
}

static CDL_TASK *add_event(RTS_UI32 variable, RTS_UI8 priority, PROGRAM program)
{
    CDL_TASK *task = add(KIND_EVENT, priority, program);
    task->event_area = APP_AREA_DATA;
    task->event_offset = variable;
    return task;
}

static void begin(void)
{
    memset(&app, 0, sizeof app);
    for (unsigned i = 0; i < VARIABLES; i++) {
        app.random[i] = i + 1;
    }
    AppExceptionClear();
}

static void start(void)
{
    static const TASK_IMAGE no_copies[APP_MAX_TASKS];
    static IEC_CONTEXT context;
    AppImageAttach(no_copies);
    context.area[APP_AREA_DATA] = app.variable;
    context.area[APP_AREA_CODE] = (RTS_UI8 *)CODE;
    CHECK_EQUAL(IecTaskCreateAll(app.task, app.count, &context), ERR_OK);
    CHECK_EQUAL(IecTaskStartAll(), ERR_OK);
}

static void sleep_ms(long ms)
{
    struct timespec time = {.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000};
    nanosleep(&time, NULL);
}

/* Waits until *number is at least `least`. */
static bool reaches(RTS_UI32 *number, RTS_UI32 least)
{
    RTS_I64 end_ns = SysTimeGetNs() + PATIENCE_S * 1000 * NS_PER_MS;
    while (SysAtomicLoad(number) < least && SysTimeGetNs() < end_ns) {
        sleep_ms(1);
    }
    return SysAtomicLoad(number) >= least;
}

static RTS_UI32 lost_by(RTS_UI32 task)
{
    IEC_TASK_INFO info;
    CHECK_EQUAL(IecTaskGetInfo(task, &info), ERR_OK);
    return info.overruns;
}

/* ---- events ---- */

/* Three tasks that interrupt and outpace each other, above, between and below those that answer. */
static void every_rise_at_the_end_of_a_cycle_is_a_run_or_counted_as_lost(void)
{
    begin();
    app.enough = 300;
    (void)add_event(0, 0, run0);
    (void)add_event(1, 10, run1);
    (void)add_event(2, 31, run2);
    (void)add(KIND_CYCLIC, 5, change0);
    (void)add(KIND_FREEWHEELING, 20, change1);
    add(KIND_CYCLIC, 6, change2)->interval_us = 300;
    start();
    for (RTS_UI32 i = 0; i < 3; i++) {
        CHECK(reaches(&app.rises[i], app.enough));
    }
    for (RTS_UI32 i = 0; i < 3; i++) {
        RTS_I64 end_ns = SysTimeGetNs() + PATIENCE_S * 1000 * NS_PER_MS;
        while (SysAtomicLoad(&app.runs[i]) + lost_by(i) < app.enough && SysTimeGetNs() < end_ns) {
            sleep_ms(1);
        }
    }
    IecTaskStopAll();
    for (RTS_UI32 i = 0; i < 3; i++) {
        CHECK(app.runs[i] + lost_by(i) >= app.rises[i]); /* more, where another task looks within a cycle */
    }
}

static void several_tasks_may_write_and_several_answer(void)
{
    begin();
    app.enough = 200;
    (void)add_event(0, 3, run0);
    (void)add_event(0, 20, run1);
    (void)add(KIND_CYCLIC, 5, change0);
    (void)add(KIND_CYCLIC, 5, change0);
    (void)add(KIND_FREEWHEELING, 20, change1);
    start();
    CHECK(reaches(&app.rises[0], app.enough));
    CHECK(reaches(&app.runs[0], 1));
    CHECK(reaches(&app.runs[1], 1));
    IecTaskStopAll();
    /* How many of the rises each sees is not known: the other writer may undo one between the two looks at it. */
    CHECK(app.rises[0] >= app.enough);
}

enum { POSTERS = 3, POSTS = 2000 };
static RTS_HANDLE posted;

static void *post(void *unused)
{
    RTS_UNUSED(unused);
    for (int i = 0; i < POSTS; i++) {
        CHECK_EQUAL(SchedPostExternalEvent(posted), ERR_OK);
    }
    return NULL;
}

static void posts_of_several_threads_are_all_answered(void)
{
    pthread_t thread[POSTERS];
    RTS_I64 end_ns = SysTimeGetNs() + PATIENCE_S * 1000 * NS_PER_MS;
    begin();
    add(KIND_EXTERNAL, 0, run0)->event_offset = CRC32Update(0, "post", 4);
    posted = SchedRegisterExternalEvent("post", NULL);
    start();
    for (int i = 0; i < POSTERS; i++) {
        CHECK(pthread_create(&thread[i], NULL, post, NULL) == 0);
    }
    for (int i = 0; i < POSTERS; i++) {
        pthread_join(thread[i], NULL);
    }
    while (SysAtomicLoad(&app.runs[0]) + lost_by(0) < POSTERS * POSTS && SysTimeGetNs() < end_ns) {
        sleep_ms(1);
    }
    IecTaskStopAll();
    CHECK_EQUAL(app.runs[0] + lost_by(0), POSTERS * POSTS);
    CHECK_EQUAL(SchedUnregisterExternalEvent(posted), ERR_OK);
}

/* ---- stops ---- */

/* Stops while tasks loop; the watchdog times of all are half an hour. */
static void stop_in_time(RTS_UI32 loops)
{
    APP_RAISED raised;
    start();
    CHECK(reaches(&app.entered, loops));
    RTS_I64 start_ns = SysTimeGetNs();
    IecTaskStopAll();
    CHECK(SysTimeGetNs() - start_ns < STOP_MS * NS_PER_MS);
    CHECK(AppExceptionTake(&raised));
    CHECK_EQUAL(raised.code, RTSEXCPT_STOP_TIMEOUT);
    CHECK_EQUAL(app.task[raised.task].entry_offset, (RTS_UI32)((uintptr_t)loop - CODE));
    CHECK(raised.address - (uintptr_t)loop < 256); /* where it was */
}

static void a_stop_breaks_an_endless_cyclic_task(void)
{
    begin();
    (void)add(KIND_CYCLIC, 0, loop);
    stop_in_time(1);
}

static void a_stop_breaks_an_endless_freewheeling_task(void)
{
    begin();
    (void)add(KIND_FREEWHEELING, 31, loop);
    (void)add(KIND_CYCLIC, 0, count);
    stop_in_time(1);
}

static void a_stop_breaks_an_endless_event_task(void)
{
    begin();
    (void)add_event(0, 0, loop);
    (void)add(KIND_CYCLIC, 1, set);
    stop_in_time(1);
}

static void a_stop_breaks_several_endless_tasks(void)
{
    begin();
    (void)add(KIND_FREEWHEELING, 31, loop);
    (void)add_event(0, 0, loop);
    (void)add(KIND_CYCLIC, 1, set);
    (void)add(KIND_CYCLIC, 0, loop);
    stop_in_time(2); /* real-time threads may take all processors */
}

static void a_cycle_that_ends_in_time_is_not_broken_by_a_stop(void)
{
    APP_RAISED raised;
    begin();
    (void)add(KIND_CYCLIC, 0, count);
    (void)add(KIND_FREEWHEELING, 31, count);
    for (int i = 0; i < 20; i++) {
        start();
        CHECK(reaches(&app.cycles, 2));
        IecTaskStopAll();
        CHECK(!AppExceptionTake(&raised));
    }
}

static void *run_init(void *broken)
{
    RTS_EXCEPTION exception;
    *(bool *)broken = !IecTaskRunGuarded((void (*)(void *))(uintptr_t)loop, NULL, &exception) &&
                      exception.code == RTSEXCPT_STOP_TIMEOUT;
    return NULL;
}

/* Last: the runtime ends only once. */
static void the_end_of_the_runtime_breaks_initialisation_too(void)
{
    pthread_t thread;
    bool broken = false;
    begin();
    CHECK(pthread_create(&thread, NULL, run_init, &broken) == 0);
    CHECK(reaches(&app.entered, 1));
    RTS_I64 start_ns = SysTimeGetNs();
    SchedRequestEnd();
    pthread_join(thread, NULL);
    CHECK(SysTimeGetNs() - start_ns < STOP_MS * NS_PER_MS);
    CHECK(broken);
}

int main(void)
{
    static const CMP_HOOK hooks[] = {CH_INIT_SYSTEM, CH_INIT, CH_INIT_SYSTEM_TASKS};
    CHECK_EQUAL(AppAreasInit(), ERR_OK);
    for (size_t i = 0; i < RTS_COUNT(hooks); i++) {
        CHECK_EQUAL(SysTime_Hook(hooks[i]), ERR_OK);
        CHECK_EQUAL(SysTimer_Hook(hooks[i]), ERR_OK);
        CHECK_EQUAL(CmpIecTask_Hook(hooks[i]), ERR_OK);
        CHECK_EQUAL(CmpScheduleTimer_Hook(hooks[i]), ERR_OK);
        CHECK_EQUAL(SysWatchdog_Hook(hooks[i]), ERR_OK);
    }
    RUN(every_rise_at_the_end_of_a_cycle_is_a_run_or_counted_as_lost);
    RUN(several_tasks_may_write_and_several_answer);
    RUN(posts_of_several_threads_are_all_answered);
    RUN(a_stop_breaks_an_endless_cyclic_task);
    RUN(a_stop_breaks_an_endless_freewheeling_task);
    RUN(a_stop_breaks_an_endless_event_task);
    RUN(a_stop_breaks_several_endless_tasks);
    RUN(a_cycle_that_ends_in_time_is_not_broken_by_a_stop);
    RUN(the_end_of_the_runtime_breaks_initialisation_too);
    CHECK_EQUAL(SysWatchdog_Hook(CH_EXIT_SYSTEM_TASKS), ERR_OK);
    CHECK_EQUAL(SysTimer_Hook(CH_EXIT_SYSTEM), ERR_OK);
    return test_result();
}
