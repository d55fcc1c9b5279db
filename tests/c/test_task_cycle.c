/*
 * test_task_cycle.c - the cycle of a task: its time, statistics and watchdog.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Tasks are driven by hand here: the clock of the simulator stands still but for the `cycle_us` that each cycle takes.
 */
#define _GNU_SOURCE
#include <pthread.h>
#include <time.h>

#include "CmpLog.h"
#include "CmpScheduleTimer.h"
#include "SysAtomic.h"
#include "app_image.h"
#include "test.h"

static APP_SPEC spec;
static APP_BYTES image;
static RTS_UI32 cycle_us;

/* Lets virtual time pass. */
static void burn(RTS_UI32 us)
{
    ((void (*)(RTS_UI32))CMFindExternal("simburn")->function)(us);
}

static void burn_cycle(RTS_UI32 unused)
{
    RTS_UNUSED(unused);
    burn(cycle_us);
}

static const CMP_EXT_FUNCTION burner[] = {{"burncycle", 1, 0x00010000, (RTS_PFN)burn_cycle}};

/* An application with one task that counts, stores its time, and whose cycles take `burn_us` until a test changes
 * that. */
static CDL_TASK *begin(RTS_UI32 interval_us, RTS_UI32 burn_us)
{
    CDL_TASK *task;

    cycle_us = burn_us;
    CHECK_EQUAL(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(CMRegisterExternal(burner, 1), ERR_OK);
    spec_init(&spec);
    add_import(&spec, "burncycle", 1, 0x00010000);
    task = add_task(&spec, "Main", KIND_CYCLIC, interval_us, here(&spec));
    emit_store_time_ms(&spec, APP_AREA_DATA, 8);
    emit_add(&spec, APP_AREA_DATA, 0, 1);
    emit_call(&spec, 0, 0);
    emit_ret(&spec);
    return task;
}

/* A cycle that is due now and takes `us`. */
static int cycle_of(RTS_UI32 us)
{
    cycle_us = us;
    return IecTaskCycle(0, SimNow());
}

static void load(void)
{
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
}

static IEC_TASK_INFO info_of(RTS_UI32 task)
{
    IEC_TASK_INFO info;

    memset(&info, 0xEE, sizeof info);
    CHECK_EQUAL(IecTaskGetInfo(task, &info), ERR_OK);
    return info;
}

static void a_task_that_never_ran_has_empty_statistics(void)
{
    CDL_TASK *task = begin(2000, 0);
    IEC_TASK_INFO info;

    task->priority = 7;
    load();
    info = info_of(0);
    CHECK(strcmp(info.name, "Main") == 0);
    CHECK_EQUAL(info.kind, KIND_CYCLIC);
    CHECK_EQUAL(info.priority, 7);
    CHECK_EQUAL(info.interval_us, 2000);
    CHECK_EQUAL(info.cycles, 0);
    CHECK(info.last_us == 0 && info.avg_us == 0 && info.min_us == 0 && info.max_us == 0);
    CHECK(info.jitter_us == 0 && info.overruns == 0);
    CHECK_EQUAL(IecTaskGetInfo(1, &info), ERR_INVALIDID);
    CHECK_EQUAL(IecTaskGetInfo(0xFFFFFFFF, &info), ERR_INVALIDID);
}

static void statistics_count_what_cycles_take(void)
{
    IEC_TASK_INFO info;
    static const RTS_UI32 burns[] = {100, 300, 200};
    RTS_UI32 i;

    for (i = 0; i < 3; i++) {
        RTS_UI32 k;
        begin(1000, burns[i]);
        load();
        for (k = 0; k < 10; k++)
            CHECK_EQUAL(IecTaskCycle(0, SimNow()), 1);
        info = info_of(0);
        CHECK_EQUAL(info.cycles, 10);
        CHECK(info.last_us == burns[i] && info.min_us == burns[i] && info.max_us == burns[i]);
        CHECK_EQUAL(info.avg_us, burns[i]);
    }
}

static void minimum_maximum_and_average_differ(void)
{
    IEC_TASK_INFO info;

    begin(1000, 0);
    load();
    CHECK_EQUAL(cycle_of(100), 1);
    CHECK_EQUAL(cycle_of(500), 1);
    CHECK_EQUAL(cycle_of(150), 1);
    info = info_of(0);
    CHECK_EQUAL(info.cycles, 3);
    CHECK_EQUAL(info.min_us, 100);
    CHECK_EQUAL(info.max_us, 500);
    CHECK_EQUAL(info.last_us, 150);
    CHECK_EQUAL(info.avg_us, 250);
}

static void times_beyond_four_seconds_saturate(void)
{
    IEC_TASK_INFO info;

    begin(1000, 0);
    load();
    CHECK_EQUAL(cycle_of(9000000), 1);
    info = info_of(0);
    CHECK_EQUAL(info.max_us, 4294967);
}

static void jitter_is_the_largest_delay_of_a_start(void)
{
    begin(1000, 0);
    load();
    CHECK_EQUAL(IecTaskCycle(0, SimNow() - 7000), 1);
    CHECK_EQUAL(IecTaskCycle(0, SimNow() - 20000), 1);
    CHECK_EQUAL(IecTaskCycle(0, SimNow() - 3000), 1);
    CHECK_EQUAL(info_of(0).jitter_us, 20);
    CHECK_EQUAL(IecTaskCycle(0, SimNow() + 30000), 1); /* early does not count */
    CHECK_EQUAL(info_of(0).jitter_us, 20);
}

static void missed_due_times_are_counted_as_overruns(void)
{
    IEC_TASK_INFO info;

    begin(1000, 2500);
    load();
    CHECK_EQUAL(SimAdvance(ms(12)), ERR_OK); /* runs at 0, 3, 6, 9, 12 ms */
    info = info_of(0);
    CHECK_EQUAL(info.cycles, 5);
    CHECK_EQUAL(info.overruns, 10);
    CHECK_EQUAL(info.jitter_us, 0);
}

static void a_cycle_that_ends_when_the_next_is_due_misses_nothing(void)
{
    begin(1000, 1000);
    load();
    CHECK_EQUAL(SimAdvance(ms(9)), ERR_OK);
    CHECK_EQUAL(info_of(0).overruns, 0);
    CHECK_EQUAL(info_of(0).cycles, 10);
}

static void a_lower_task_that_waits_has_jitter(void)
{
    begin(10000, 3000);
    add_task(&spec, "Low", KIND_CYCLIC, 10000, spec.tasks[0].entry_offset)->priority = 20;
    load();
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(info_of(0).jitter_us, 0);
    CHECK_EQUAL(info_of(1).jitter_us, 3000);
    CHECK_EQUAL(info_of(1).overruns, 0);
}

static void the_time_of_the_application_starts_at_zero(void)
{
    begin(10000, 0);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(777)), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 8), 0);
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 8), 20);
}

static void the_time_goes_on_over_stop_and_start(void)
{
    begin(10000, 0);
    load();
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 8), 120);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 8), 0);
}

/* Milliseconds are accumulated from cycle to cycle; they must be those of the division, whatever the steps are. */
static void milliseconds_follow_the_nanoseconds(void)
{
    static const RTS_I64 steps[] = {1,          999999,     1000000,    1234567,      10000000,
                                    4294967295, 4294967296, 4300000000, 3600000000000};
    RTS_I64 zero;
    RTS_UI32 i;
    RTS_UI32 k;

    begin(1000, 0);
    load();
    zero = SimNow();
    for (i = 0; i < RTS_COUNT(steps); i++) {
        for (k = 0; k < 50; k++) {
            IecTaskStopAll(); /* no cycle while time passes */
            CHECK_EQUAL(SimAdvance(steps[i]), ERR_OK);
            CHECK_EQUAL(IecTaskStartAll(), ERR_OK);
            CHECK_EQUAL(IecTaskCycle(0, SimNow()), 1);
            CHECK_EQUAL(read_u32(APP_AREA_DATA, 8), (RTS_UI32)((SimNow() - zero) / 1000000));
        }
    }
}

/* ---- watchdog, manual 3.4 ---- */

/* How many cycles of `burn_us` run before the watchdog trips; 0 when it does not within 100. */
static RTS_UI32 cycles_until_trip(RTS_UI32 watchdog_us, RTS_UI16 sensitivity, RTS_UI32 burn_us)
{
    CDL_TASK *task = begin(100000, burn_us);
    RTS_UI32 i;

    task->watchdog_us = watchdog_us;
    task->watchdog_sensitivity = sensitivity;
    load();
    for (i = 1; i <= 100; i++) {
        if (!IecTaskCycle(0, SimNow())) {
            CHECK_EQUAL(app_exception(), RTSEXCPT_WATCHDOG);
            return i;
        }
    }
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
    return 0;
}

static void consecutive_overruns_trip_in_the_cycle_of_the_sensitivity(void)
{
    CHECK_EQUAL(cycles_until_trip(1000, 0, 1001), 1);
    CHECK_EQUAL(cycles_until_trip(1000, 1, 1001), 1);
    CHECK_EQUAL(cycles_until_trip(1000, 2, 1001), 2);
    CHECK_EQUAL(cycles_until_trip(1000, 3, 1001), 3);
    CHECK_EQUAL(cycles_until_trip(1000, 10, 1001), 10);
}

static void a_single_cycle_longer_than_time_times_sensitivity_trips_at_once(void)
{
    CHECK_EQUAL(cycles_until_trip(10000, 5, 50000), 5);
    CHECK_EQUAL(cycles_until_trip(10000, 5, 50001), 1);
}

static void cycles_within_the_time_never_trip(void)
{
    CHECK_EQUAL(cycles_until_trip(1000, 1, 1000), 0);
    CHECK_EQUAL(cycles_until_trip(1000, 0, 999), 0);
}

static void without_a_watchdog_nothing_trips(void)
{
    CHECK_EQUAL(cycles_until_trip(0, 1, 60000000), 0);
}

static void one_good_cycle_starts_the_count_again(void)
{
    CDL_TASK *task = begin(100000, 1500);
    int i;

    task->watchdog_us = 1000;
    task->watchdog_sensitivity = 3;
    load();
    for (i = 0; i < 20; i++) {
        CHECK_EQUAL(cycle_of(1500), 1);
        CHECK_EQUAL(cycle_of(1500), 1);
        CHECK_EQUAL(cycle_of(500), 1);
    }
}

static void outputs_are_zero_when_the_failing_task_returns(void)
{
    CDL_TASK *task = begin(10000, 2000);

    task->watchdog_us = 1000;
    load();
    AppGetAreaAddress(APP_AREA_OUTPUT, 0, 1)[0] = 1;
    CHECK_EQUAL(IecTaskCycle(0, SimNow()), 0);
    CHECK_EQUAL(AppGetAreaAddress(APP_AREA_OUTPUT, 0, 1)[0], 0);
}

static void the_watchdog_stops_the_application_with_its_outputs_at_zero(void)
{
    CDL_TASK *task = begin(10000, 2000);
    LOG_ENTRY entry = {0};

    task->watchdog_us = 1000;
    load();
    AppGetAreaAddress(APP_AREA_OUTPUT, 0, 1)[0] = 1;
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(app_exception(), RTSEXCPT_WATCHDOG);
    CHECK_EQUAL(AppGetAreaAddress(APP_AREA_OUTPUT, 0, 1)[0], 0);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 0), 1);
    while (LogGetEntry(entry.handle + 1, &entry) == ERR_OK && entry.log_class != LOG_EXCEPTION)
        ;
    CHECK(strcmp(entry.text, "Main: watchdog expired") == 0);
}

static void reset_gives_the_watchdog_its_count_back(void)
{
    CDL_TASK *task = begin(100000, 1500);

    task->watchdog_us = 1000;
    task->watchdog_sensitivity = 3;
    load();
    CHECK_EQUAL(IecTaskCycle(0, SimNow()), 1);
    CHECK_EQUAL(IecTaskCycle(0, SimNow()), 1);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(IecTaskCycle(0, SimNow()), 1);
    CHECK_EQUAL(IecTaskCycle(0, SimNow()), 1);
    CHECK_EQUAL(IecTaskCycle(0, SimNow()), 0);
}

static void the_supervisor_sees_the_limits_of_running_code_only(void)
{
    CDL_TASK *task = begin(100000, 0);
    IEC_GUARD guard;
    bool busy;

    task->watchdog_us = 3000;
    task->watchdog_sensitivity = 4;
    load();
    CHECK(!IecTaskReadGuard(0, &guard));
    CHECK(!IecTaskReadGuard(1, &guard));
    CHECK_EQUAL(IecTaskGetActivity(&busy), 0);
    CHECK(!busy);
    CHECK_EQUAL(IecTaskCycle(0, 0), 1);
    CHECK_EQUAL(IecTaskGetActivity(&busy), 2);
    SchedWatchdogCheck(ms(1000000)); /* nothing runs: nothing happens */
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
}

static RTS_I64 look_ns;
static RTS_UI32 looked;
static RTS_UI32 long_us; /* of a cycle that nothing looks at */
static bool break_expected;

static void *look(void *unused)
{
    RTS_UNUSED(unused);
    SchedWatchdogCheck(look_ns);
    SysAtomicStore(&looked, 1);
    return NULL;
}

/* The cycle waits here until a supervisor in another thread has looked, at a time `us` after its start; and, when it is
 * to be broken, for that (10 s at most). */
static void supervise(RTS_UI32 us)
{
    time_t start = time(NULL);
    pthread_t thread;

    if (long_us != 0) {
        burn(long_us);
        return;
    }
    look_ns = SimNow() + (RTS_I64)us * 1000;
    SysAtomicStore(&looked, 0);
    CHECK(pthread_create(&thread, NULL, look, NULL) == 0);
    CHECK_EQUAL(pthread_detach(thread), 0);
    while ((SysAtomicLoad(&looked) == 0 || break_expected) && time(NULL) - start < 10)
        ;
}

static const CMP_EXT_FUNCTION supervisor[] = {{"supervise", 1, 0x00010000, (RTS_PFN)supervise}};

/* An application with one task that lets the supervisor look `us` after its start. */
static CDL_TASK *begin_supervised(RTS_UI32 us, bool expect_break)
{
    CDL_TASK *task;

    break_expected = expect_break;
    CHECK_EQUAL(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(CMRegisterExternal(supervisor, 1), ERR_OK);
    spec_init(&spec);
    add_import(&spec, "supervise", 1, 0x00010000);
    task = add_task(&spec, "Main", KIND_CYCLIC, 1000, here(&spec));
    emit_call(&spec, 0, us);
    emit_add(&spec, APP_AREA_DATA, 0, 1);
    emit_ret(&spec);
    return task;
}

static void the_supervisor_breaks_a_cycle_beyond_time_times_sensitivity(void)
{
    static const RTS_UI32 us[] = {12000, 12001};
    RTS_UI32 i;

    for (i = 0; i < 2; i++) {
        CDL_TASK *task = begin_supervised(us[i], i == 1);
        task->watchdog_us = 3000;
        task->watchdog_sensitivity = 4;
        load();
        CHECK_EQUAL(SimAdvance(0), ERR_OK);
        CHECK_EQUAL(app_exception(), (i == 0 ? RTSEXCPT_NOEXCEPTION : RTSEXCPT_WATCHDOG));
        CHECK_EQUAL(read_u32(APP_AREA_DATA, 0), 1 - i);
    }
}

static void the_supervisor_breaks_the_cycle_that_completes_a_series_where_it_becomes_too_long(void)
{
    static const RTS_UI32 us[] = {3000, 3001};
    RTS_UI32 i;

    for (i = 0; i < 2; i++) {
        CDL_TASK *task = begin_supervised(us[i], i == 1);
        task->watchdog_us = 3000;
        task->watchdog_sensitivity = 3;
        load();
        long_us = 3001;
        CHECK_EQUAL(IecTaskCycle(0, SimNow()), 1);
        CHECK_EQUAL(IecTaskCycle(0, SimNow()), 1);
        long_us = 0;
        CHECK_EQUAL(IecTaskCycle(0, SimNow()), 1 - i);
        CHECK_EQUAL(app_exception(), (i == 0 ? RTSEXCPT_NOEXCEPTION : RTSEXCPT_WATCHDOG));
        CHECK_EQUAL(read_u32(APP_AREA_DATA, 0), 3 - i); /* broken in the midst */
    }
}

static void the_supervisor_leaves_a_series_alone_that_one_cycle_does_not_complete(void)
{
    CDL_TASK *task = begin_supervised(9000, false);

    task->watchdog_us = 3000;
    task->watchdog_sensitivity = 3;
    load();
    long_us = 3001;
    CHECK_EQUAL(IecTaskCycle(0, SimNow()), 1);
    long_us = 0;
    CHECK_EQUAL(IecTaskCycle(0, SimNow()), 1);
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
}

static void the_supervisor_breaks_a_task_without_watchdog_after_the_default(void)
{
    begin_supervised(APP_DEFAULT_WATCHDOG_US, false);
    load();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
    begin_supervised(APP_DEFAULT_WATCHDOG_US + 1, true);
    load();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_WATCHDOG);
}

/* ---- two tasks, each in a thread, that loop until they are broken or released ---- */

typedef struct {
    pthread_t thread;
    RTS_UI32 inside;
    RTS_UI32 released;
    int result; /* of the cycle */
} LOOPER;

static LOOPER loopers[2];

static void loop(RTS_UI32 task)
{
    time_t start = time(NULL);

    SysAtomicStore(&loopers[task].inside, 1);
    while (SysAtomicLoad(&loopers[task].released) == 0 && time(NULL) - start < 10)
        ;
}

static const CMP_EXT_FUNCTION looping[] = {{"loop", 1, 0x00010000, (RTS_PFN)loop}};

enum { LOOP_LIMIT_US = 5000 };

/* Two tasks with a limit of LOOP_LIMIT_US. */
static void begin_looping(void)
{
    CDL_TASK *task;
    RTS_UI32 i;

    CHECK_EQUAL(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(CMRegisterExternal(looping, 1), ERR_OK);
    SimSetCycleLimit(30000); /* the simulator's own supervisor, in real time, stays out of it */
    spec_init(&spec);
    add_import(&spec, "loop", 1, 0x00010000);
    for (i = 0; i < 2; i++) {
        loopers[i].inside = loopers[i].released = 0;
        task = add_task(&spec, i == 0 ? "Slow" : "Fast", KIND_CYCLIC, 1000, here(&spec));
        task->watchdog_us = LOOP_LIMIT_US;
        task->watchdog_sensitivity = 1;
        emit_call(&spec, 0, i);
        emit_ret(&spec);
    }
    load();
}

static void *run_cycle_of(void *arg)
{
    LOOPER *looper = arg;

    looper->result = IecTaskCycle((RTS_UI32)(looper - loopers), SimNow());
    SysAtomicStore(&looper->inside, 1);
    return NULL;
}

/* Starts a cycle, and returns when it loops, or is over because none may start any more. */
static void start_looping(RTS_UI32 task)
{
    CHECK(pthread_create(&loopers[task].thread, NULL, run_cycle_of, &loopers[task]) == 0);
    while (SysAtomicLoad(&loopers[task].inside) == 0)
        ;
}

static int result_of(RTS_UI32 task)
{
    CHECK(pthread_join(loopers[task].thread, NULL) == 0);
    return loopers[task].result;
}

/* Checks every millisecond, at the same virtual time as the tasks see, as the port does. */
static void supervise_for(RTS_UI32 us)
{
    for (; us > 0; us -= 1000) {
        burn(1000);
        SchedWatchdogCheck(SimNow());
    }
}

/* A broken thread may take its time. */
static bool is_broken(RTS_UI32 task)
{
    time_t start = time(NULL);
    IEC_GUARD guard;

    while (IecTaskReadGuard(task, &guard) && time(NULL) - start < 5)
        ;
    return !IecTaskReadGuard(task, &guard);
}

static RTS_I32 exception_task(void)
{
    APP_STATUS status;

    AppGetStatus(&status);
    return status.exception.task;
}

static bool is_running(RTS_UI32 task)
{
    IEC_GUARD guard;

    return IecTaskReadGuard(task, &guard) != 0;
}

static void only_the_later_of_two_loops_is_broken_and_the_other_cycle_finishes(void)
{
    begin_looping();
    start_looping(0);
    supervise_for(2000);
    start_looping(1);
    supervise_for(LOOP_LIMIT_US + 1000);
    CHECK(is_broken(1));
    CHECK_EQUAL(result_of(1), 0);
    supervise_for(2000);
    CHECK(is_running(0)); /* it had 2 ms before the other began and 2 since */
    SysAtomicStore(&loopers[0].released, 1);
    (void)result_of(0);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(exception_task(), 1);
}

static void of_two_endless_loops_both_are_broken_one_limit_after_the_other(void)
{
    begin_looping();
    start_looping(0);
    supervise_for(1000);
    start_looping(1);
    supervise_for(LOOP_LIMIT_US + 1000);
    CHECK(is_broken(1));
    CHECK(is_running(0));
    supervise_for(LOOP_LIMIT_US + 1000);
    CHECK(is_broken(0));
    CHECK(result_of(0) == 0 && result_of(1) == 0);
}

/* A fast task that is in its cycle whenever the watchdog looks, but never for long, hides nothing. */
static void short_cycles_of_another_task_do_not_protect_a_loop(void)
{
    RTS_UI32 i;

    begin_looping();
    start_looping(0);
    for (i = 0; i < LOOP_LIMIT_US / 1000 + 2; i++) {
        burn(900);
        loopers[1].inside = loopers[1].released = 0;
        start_looping(1);
        burn(100);
        SchedWatchdogCheck(SimNow());
        SysAtomicStore(&loopers[1].released, 1);
        (void)result_of(1);
    }
    CHECK(is_broken(0));
    CHECK_EQUAL(result_of(0), 0);
}

static void the_supervisor_breaks_initialisation_code_too(void)
{
    begin_supervised(APP_DEFAULT_WATCHDOG_US + 1, true);
    spec.function[CDL_FUNCTION_CODE_INIT] = 0;
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_WATCHDOG);
}

static void no_cycle_starts_while_the_application_is_stopped(void)
{
    begin(1000, 0);
    load();
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(IecTaskCycle(0, 0), 0);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 0), 0);
}

static void the_bench_measures_real_time_and_keeps_the_schedule(void)
{
    double code_ns = -1;
    double cycle_ns = -1;
    RTS_UI32 before;

    begin(10000, 0);
    load();
    CHECK_EQUAL(SimAdvance(ms(25)), ERR_OK);
    CHECK_EQUAL(SimBench(0, 1000, &code_ns, &cycle_ns), ERR_OK);
    CHECK(code_ns > 0);
    CHECK(cycle_ns > 0);
    before = info_of(0).cycles;
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(info_of(0).cycles, before + 10);
    CHECK_EQUAL(info_of(0).overruns, 0);
    CHECK_EQUAL(SimBench(1, 1000, &code_ns, &cycle_ns), ERR_INVALIDID);
}

/* The sanitizer sees an index that is used before it is checked. */
static void the_watchdog_of_a_task_that_there_is_not_is_not_lifted(void)
{
    static const RTS_UI32 wrong[] = {0, APP_MAX_TASKS, APP_MAX_TASKS + 1, 0x7FFFFFFF, 0xFFFFFFFF};
    RTS_UI8 (*task_watchdog)(RTS_UI32 task, RTS_UI8 on);
    RTS_SIZE i;

    CHECK_EQUAL(SimStart(), ERR_OK);
    task_watchdog = (RTS_UI8(*)(RTS_UI32, RTS_UI8))CMFindExternal("task_watchdog")->function;
    for (i = 0; i < RTS_COUNT(wrong); i++) {
        CHECK_EQUAL(task_watchdog(wrong[i], 0), 0);
        CHECK_EQUAL(task_watchdog(wrong[i], 1), 0);
    }
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_task_that_never_ran_has_empty_statistics);
    RUN(statistics_count_what_cycles_take);
    RUN(minimum_maximum_and_average_differ);
    RUN(times_beyond_four_seconds_saturate);
    RUN(jitter_is_the_largest_delay_of_a_start);
    RUN(missed_due_times_are_counted_as_overruns);
    RUN(a_cycle_that_ends_when_the_next_is_due_misses_nothing);
    RUN(a_lower_task_that_waits_has_jitter);
    RUN(the_time_of_the_application_starts_at_zero);
    RUN(the_time_goes_on_over_stop_and_start);
    RUN(milliseconds_follow_the_nanoseconds);
    RUN(consecutive_overruns_trip_in_the_cycle_of_the_sensitivity);
    RUN(a_single_cycle_longer_than_time_times_sensitivity_trips_at_once);
    RUN(cycles_within_the_time_never_trip);
    RUN(without_a_watchdog_nothing_trips);
    RUN(one_good_cycle_starts_the_count_again);
    RUN(outputs_are_zero_when_the_failing_task_returns);
    RUN(the_watchdog_stops_the_application_with_its_outputs_at_zero);
    RUN(reset_gives_the_watchdog_its_count_back);
    RUN(the_supervisor_sees_the_limits_of_running_code_only);
    RUN(the_supervisor_breaks_a_cycle_beyond_time_times_sensitivity);
    RUN(the_supervisor_breaks_the_cycle_that_completes_a_series_where_it_becomes_too_long);
    RUN(the_supervisor_leaves_a_series_alone_that_one_cycle_does_not_complete);
    RUN(the_supervisor_breaks_a_task_without_watchdog_after_the_default);
    RUN(only_the_later_of_two_loops_is_broken_and_the_other_cycle_finishes);
    RUN(of_two_endless_loops_both_are_broken_one_limit_after_the_other);
    RUN(short_cycles_of_another_task_do_not_protect_a_loop);
    RUN(the_supervisor_breaks_initialisation_code_too);
    RUN(the_watchdog_of_a_task_that_there_is_not_is_not_lifted);
    RUN(no_cycle_starts_while_the_application_is_stopped);
    RUN(the_bench_measures_real_time_and_keeps_the_schedule);
    return test_result();
}
