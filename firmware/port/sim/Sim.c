/*
 * Sim.c - the simulator: power, virtual clock, timers, measurements.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "Sim.h"

#include <setjmp.h>
#include <string.h>
#include <time.h>

#include "CmpAppCalls.h"
#include "CmpAppEmbedded.h"
#include "CmpIecTask.h"
#include "CmpScheduleTimer.h"
#include "CyclePhases.h"
#include "SimLink.h"
#include "SysAtomic.h"
#include "SysExcept.h"
#include "SysLock.h"
#include "SysMain.h"
#include "SysTime.h"
#include "SysTimeRtc.h"
#include "SysTimer.h"
#include "rts_config.h"
#include "sim_port.h"

#define NEVER INT64_MAX
#define NS_PER_US 1000
#define NS_PER_MS 1000000

/* How often background work runs: often while tasks run in it, else only for what watches the clock. */
#define COMM_BUSY_NS (10 * (RTS_I64)NS_PER_MS)
#define COMM_IDLE_NS (1000 * (RTS_I64)NS_PER_MS)
/* Nor does main of a controller come back sooner. */
#define COMM_PAUSE_NS ((RTS_I64)NS_PER_MS / 4)
#define RUN_LIMIT_NS (SIM_RUN_LIMIT_MS * (RTS_I64)NS_PER_MS)

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

static struct {
    bool on;
    bool power_lost; /* by a planned cut, until SimStart */
    bool landing;    /* `jump` is valid */
    jmp_buf jump;
    RTS_I64 now_ns;
    RTS_I64 next_comm_ns;
    RTS_I64 last_comm_ns;
    RTS_I64 group_ns; /* when the timers that run now were due; NEVER when none run */
    bool real_clock;  /* reading the clock costs what it costs on Linux */
    TIMER timer[MAX_TIMERS];
} sim;

/* ---- the wall clock ---- */

static RTS_I64 wall_clock_ns = SIM_CLOCK_FIRST_S * (RTS_I64)1000000000; /* at virtual time 0 */

RTS_RESULT SysTimeRtcGet(RTS_I64 *utc_ns)
{
    *utc_ns = wall_clock_ns + sim.now_ns;
    return ERR_OK;
}

RTS_RESULT SysTimeRtcSet(RTS_I64 utc_ns)
{
    wall_clock_ns = utc_ns - sim.now_ns;
    return ERR_OK;
}

void SimSetClock(RTS_I64 utc_ns)
{
    (void)SysTimeRtcSet(utc_ns);
}

/* ---- power ---- */

void SimPowerCut(void)
{
    sim.power_lost = true;
    sim.on = false;
    if (sim.landing)
        longjmp(sim.jump, 1);
}

/* Runs fn(arg); a power cut in it ends here. */
static RTS_RESULT with_landing(RTS_RESULT (*fn)(void *arg), void *arg)
{
    RTS_RESULT result;

    if (sim.power_lost)
        return SIM_POWER_CUT;
    if (sim.landing)
        return fn(arg);
    sim.landing = true;
    if (setjmp(sim.jump) == 0)
        result = fn(arg);
    else
        result = SIM_POWER_CUT;
    sim.landing = false;
    return sim.power_lost ? (RTS_RESULT)SIM_POWER_CUT : result;
}

/* ---- a task that waits for main ---- */

#if APP_CALL_WAIT_MS > 0

static RTS_UI32 serving;

bool SimIsServing(void)
{
    return SysAtomicLoad(&serving) != 0;
}

/* Main is the thread that the task runs in. A power cut ends what it does at once, and the cycle of the task at its end. No
 * cycle is aborted in between, as that would leave the work of main in its middle. */
bool SysMainWait(const RTS_UI32 *word, RTS_UI32 value)
{
    jmp_buf before;

    SimSignalsHold(true);
    RTS_UNUSED(word);
    RTS_UNUSED(value);
    SysAtomicStore(&serving, 1);
    memcpy(&before, &sim.jump, sizeof before);
    if (setjmp(sim.jump) == 0)
        AppCallsServe();
    memcpy(&sim.jump, &before, sizeof before);
    SysAtomicStore(&serving, 0);
    SimSignalsHold(false);
    return !sim.power_lost;
}

void SysMainWake(const RTS_UI32 *word)
{
    RTS_UNUSED(word);
}

#endif

static void forget_timers(void)
{
    RTS_UI32 i;

    memset(sim.timer, 0, sizeof sim.timer);
    for (i = 0; i < MAX_TIMERS; i++)
        sim.timer[i].due_ns = NEVER;
}

static RTS_RESULT power_on(void *unused)
{
    RTS_RESULT result = SimFlashPowerOn();

    RTS_UNUSED(unused);
    if (result == ERR_OK)
        result = CMInit();
    sim.on = result == ERR_OK;
    return result;
}

enum { START_TEXT_SIZE = 32 };
static const SYS_START power_came = {SYS_START_POWER, 0, -1, RTSEXCPT_NOEXCEPTION, APP_NO_CODE_OFFSET, ""};
static struct {
    SYS_START now;
    SYS_START next; /* NULL for its text: nothing was set */
    char text[START_TEXT_SIZE];
} starting;

void SimSetStart(const SYS_START *start)
{
    strncpy(starting.text, start->text, START_TEXT_SIZE - 1);
    starting.next = *start;
    starting.next.text = starting.text;
}

const SYS_START *SysStartGet(void)
{
    return &starting.now;
}

RTS_RESULT SimStart(void)
{
    wall_clock_ns += sim.now_ns; /* its battery goes on */
    starting.now = starting.next.text != NULL ? starting.next : power_came;
    starting.next.text = NULL;
    sim.on = false;
    sim.power_lost = false;
    sim.now_ns = 0;
    sim.next_comm_ns = 0;
    sim.last_comm_ns = -COMM_PAUSE_NS;
    sim.group_ns = NEVER;
    forget_timers();
    SimComPowerOn();
    SimNetPowerOn();
    SimLinkReset();
    SimSuperviseStart();
    return with_landing(power_on, NULL);
}

static RTS_RESULT shut_down(void *unused)
{
    RTS_UNUSED(unused);
    return CMExit();
}

void SimStop(void)
{
    if (sim.on)
        (void)with_landing(shut_down, NULL);
    sim.on = false;
    SysExceptShutdown();
}

typedef struct {
    void (*fn)(void *arg);
    void *arg;
} CALL;

static RTS_RESULT call(void *arg)
{
    const CALL *c = arg;

    c->fn(c->arg);
    return ERR_OK;
}

RTS_RESULT SimCall(void (*fn)(void *arg), void *arg)
{
    CALL c = {fn, arg};

    return with_landing(call, &c);
}

/* ---- clock ---- */

/* The virtual time, at the price of a real clock. */
static RTS_I64 read_real_clock(void)
{
    struct timespec now = {0, 0};

    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_nsec >= 0 ? sim.now_ns : 0;
}

RTS_I64 SysTimeGetNs(void)
{
    return sim.real_clock ? read_real_clock() : sim.now_ns;
}

RTS_UI32 SysTimeGetMs(void)
{
    return (RTS_UI32)(sim.now_ns / NS_PER_MS);
}

/* SimBus says when passes are due. */
void SysTimeWantPass(RTS_UI32 ms)
{
    RTS_UNUSED(ms);
}

void SysTimePause(void)
{
    static const struct timespec pause = {0, 20000};

    nanosleep(&pause, NULL);
}

RTS_I64 SimNow(void)
{
    return sim.now_ns;
}

/* ---- lock ---- */

/* There is no other thread; while a cycle is measured it costs what it costs on Linux. */
RTS_UI32 SysLockEnter(void)
{
    if (sim.real_clock)
        SimMutexLock();
    return 0;
}

void SysLockLeave(RTS_UI32 before)
{
    RTS_UNUSED(before);
    if (sim.real_clock)
        SimMutexUnlock();
}

/* ---- timers ---- */

static TIMER *get_timer(RTS_HANDLE handle)
{
    return handle < MAX_TIMERS && sim.timer[handle].callback != NULL ? &sim.timer[handle] : NULL;
}

RTS_RESULT SysTimerCreate(SYS_TIMER_CALLBACK callback, void *param, RTS_UI32 interval_us, RTS_UI32 priority,
                          RTS_HANDLE *timer)
{
    RTS_UI32 i;

    if (callback == NULL || priority > 31)
        return ERR_PARAMETER;
    for (i = 0; i < MAX_TIMERS; i++) {
        if (sim.timer[i].callback == NULL) {
            TIMER created = {callback, param, (RTS_I64)interval_us * NS_PER_US, NEVER, priority, 0, false};
            sim.timer[i] = created;
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
    timer->due_ns = sim.now_ns;
    timer->started = true;
    return ERR_OK;
}

/* What was due before is due with what runs now, also when that took its time: so priority decides what comes next. */
static RTS_I64 not_before_now(RTS_I64 due_ns)
{
    RTS_I64 now_ns = sim.group_ns < sim.now_ns ? sim.group_ns : sim.now_ns;

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
        sim.timer[handle].callback = NULL;
    return result;
}

RTS_UI32 SysTimerGetOverruns(RTS_HANDLE handle)
{
    const TIMER *timer = get_timer(handle);

    return timer != NULL ? timer->overruns : 0;
}

/* The timer that is due first, of these the one with the highest priority; NULL when none runs. */
static TIMER *next_timer(void)
{
    TIMER *next = NULL;
    TIMER *timer;

    for (timer = sim.timer; timer < sim.timer + MAX_TIMERS; timer++) {
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
    late = sim.now_ns - timer->due_ns;
    if (late > 0) {
        RTS_UI32 missed = (RTS_UI32)((late + timer->interval_ns - 1) / timer->interval_ns);
        timer->overruns += missed;
        timer->due_ns += missed * timer->interval_ns;
    }
}

static void run_timer(TIMER *timer)
{
    RTS_I64 due_ns = timer->due_ns;

    if (due_ns > sim.now_ns)
        sim.now_ns = due_ns;
    if (timer->interval_ns == 0)
        timer->due_ns = NEVER; /* it may be triggered again now */
    timer->callback(timer->param, due_ns);
    if (sim.power_lost && sim.landing)
        longjmp(sim.jump, 1);
    if (timer->interval_ns != 0)
        set_next_due(timer);
}

/* ---- the passing of time ---- */

const SIM_BUS *SimBus;

static void want_pass(RTS_I64 due_ns)
{
    if (due_ns < sim.last_comm_ns + COMM_PAUSE_NS)
        due_ns = sim.last_comm_ns + COMM_PAUSE_NS;
    if (due_ns < sim.next_comm_ns)
        sim.next_comm_ns = due_ns;
}

/* The next pass is when a bus needs it, or a call of the program. */
static void serve_bus(void)
{
    RTS_I64 due_ns = SimBus != NULL ? SimBus->due_ns(sim.now_ns) : NEVER;

#if APP_CALLS > 0
    if (AppCallsWait())
        due_ns = sim.now_ns;
#endif
    want_pass(due_ns);
}

static RTS_I64 next_of_bus(void)
{
    return SimBus != NULL ? SimBus->next_ns() : NEVER;
}

/* Frames of a bus pass without main, unless it has to look at one. */
static void run_bus(RTS_I64 due_ns)
{
    if (due_ns > sim.now_ns)
        sim.now_ns = due_ns;
    if (SimBus->run(sim.now_ns))
        want_pass(sim.now_ns);
}

static void run_comm_cycle(void)
{
    sim.last_comm_ns = sim.now_ns;
    sim.next_comm_ns = sim.now_ns + (SchedHasBackgroundTasks() ? COMM_BUSY_NS : COMM_IDLE_NS);
    (void)CMCallHook(CH_COMM_CYCLE);
    serve_bus();
}

/* Runs all timers that are due at the same time as `timer`, and the tasks that follow them. */
static void run_group(TIMER *timer)
{
    RTS_I64 due_ns = timer->due_ns;

    sim.group_ns = due_ns;
    for (; timer != NULL && timer->due_ns == due_ns; timer = next_timer())
        run_timer(timer);
    sim.group_ns = NEVER;
    if (SchedHasBackgroundTasks())
        SchedBackgroundCycle();
    serve_bus();
}

/* Does what comes next and is due before `end_ns`; false when nothing is. */
static bool run_next(RTS_I64 end_ns)
{
    TIMER *timer = next_timer();
    RTS_I64 bus_ns = next_of_bus();

    if (bus_ns < end_ns && bus_ns < sim.next_comm_ns && (timer == NULL || bus_ns < timer->due_ns)) {
        run_bus(bus_ns);
        return true;
    }
    if (timer != NULL && timer->due_ns < end_ns && timer->due_ns <= sim.next_comm_ns) {
        run_group(timer);
        return true;
    }
    if (sim.next_comm_ns >= end_ns)
        return false;
    if (sim.next_comm_ns > sim.now_ns)
        sim.now_ns = sim.next_comm_ns;
    run_comm_cycle();
    return true;
}

/* How far time shall go, and before when something must be due to run on the way. */
typedef struct {
    RTS_I64 end_ns;
    RTS_I64 limit_ns;
} PASSAGE;

static RTS_RESULT advance(void *arg)
{
    const PASSAGE *passage = arg;

    SchedNoteEvents(); /* of variables that were written before */
    serve_bus();       /* of outputs that a stop has set */
    while (run_next(passage->limit_ns))
        ;
    if (sim.now_ns < passage->end_ns)
        sim.now_ns = passage->end_ns;
    run_comm_cycle();
    return ERR_OK;
}

/* `beyond_ns`: how far past the end what is due still runs. */
static RTS_RESULT pass(RTS_I64 ns, RTS_I64 beyond_ns)
{
    PASSAGE passage;

    if (ns < 0 || ns >= NEVER - beyond_ns - sim.now_ns)
        return ERR_PARAMETER;
    passage.end_ns = sim.now_ns + ns;
    passage.limit_ns = passage.end_ns + beyond_ns;
    if (sim.power_lost)
        return SIM_POWER_CUT;
    if (!sim.on)
        return ERR_NOTINITIALIZED;
    return with_landing(advance, &passage);
}

RTS_RESULT SimAdvance(RTS_I64 ns)
{
    return pass(ns, 1);
}

RTS_RESULT SimRunFor(RTS_I64 ns)
{
    return pass(ns, 0);
}

static RTS_UI32 cycles_of_first_task(void)
{
    IEC_TASK_INFO info;

    return IecTaskGetInfo(0, &info) == ERR_OK ? info.cycles : 0;
}

/* Whether the application runs, as ERR_*. */
static RTS_RESULT running_state(void)
{
    APP_STATUS status;

    AppGetStatus(&status);
    if ((status.op_state & OS_EXCEPTION) != 0)
        return ERR_EXCEPTION;
    return status.state == AS_RUN ? ERR_OK : ERR_INVALID_STATE;
}

typedef struct {
    RTS_UI32 cycles;
    RTS_I64 until_ns;
} CYCLE_RUN;

static RTS_RESULT run_cycles(void *arg)
{
    const CYCLE_RUN *run = arg;
    RTS_UI32 first = cycles_of_first_task();
    RTS_I64 limit_ns = sim.now_ns + RUN_LIMIT_NS;
    RTS_UI32 done = 0;
    RTS_RESULT result = running_state();

    SchedNoteEvents();
    serve_bus();
    while (result == ERR_OK && done < run->cycles) {
        if (!run_next(limit_ns < run->until_ns ? limit_ns : run->until_ns)) {
            if (limit_ns < run->until_ns)
                return ERR_TIMEOUT;
            if (sim.now_ns < run->until_ns)
                sim.now_ns = run->until_ns;
            result = ERR_PENDING;
            break;
        }
        if (cycles_of_first_task() - first != done) {
            done = cycles_of_first_task() - first;
            limit_ns = sim.now_ns + RUN_LIMIT_NS;
        }
        result = running_state();
    }
    run_comm_cycle();
    return result;
}

RTS_RESULT SimRunCyclesUntil(RTS_UI32 cycles, RTS_I64 until_ns)
{
    CYCLE_RUN run = {cycles, until_ns};

    if (sim.power_lost)
        return SIM_POWER_CUT;
    if (!sim.on)
        return ERR_NOTINITIALIZED;
    return with_landing(run_cycles, &run);
}

RTS_RESULT SimRunCycles(RTS_UI32 cycles)
{
    return SimRunCyclesUntil(cycles, NEVER);
}

/* ---- time within a cycle ---- */

static void exchange(const IEC_CONTEXT *context)
{
    CyclePhasesRun(CYCLE_OUTPUTS, 0, context);
    CyclePhasesRun(CYCLE_INPUTS, 0, context);
    serve_bus();
}

static RTS_I64 earlier(RTS_I64 a, RTS_I64 b)
{
    return a < b ? a : b;
}

static void run_devices_until(RTS_I64 end_ns, RTS_I64 interval_ns, const IEC_CONTEXT *context)
{
    RTS_I64 due_ns = sim.now_ns;

    while (sim.now_ns < end_ns) {
        if (sim.now_ns >= due_ns) {
            exchange(context);
            due_ns += interval_ns;
        }
        if (next_of_bus() <= sim.now_ns)
            run_bus(sim.now_ns);
        if (sim.next_comm_ns <= sim.now_ns)
            run_comm_cycle();
        sim.now_ns = earlier(earlier(sim.next_comm_ns, next_of_bus()), earlier(due_ns, end_ns));
    }
    exchange(context);
}

RTS_RESULT SimRunDevices(RTS_I64 ns)
{
    IEC_CONTEXT *context;
    IEC_TASK_INFO info;
    IEC_ENTRY entry;

    if (ns < 0 || ns >= NEVER - sim.now_ns)
        return ERR_PARAMETER;
    if (!sim.on)
        return ERR_NOTINITIALIZED;
    if (IecTaskGetInfo(0, &info) != ERR_OK || info.interval_us == 0 || IecTaskGetEntry(0, &entry, &context) != ERR_OK)
        return ERR_INVALID_STATE;
    run_devices_until(sim.now_ns + ns, (RTS_I64)info.interval_us * NS_PER_US, context);
    return ERR_OK;
}

static RTS_RESULT comm_cycle(void *unused)
{
    RTS_UNUSED(unused);
    run_comm_cycle();
    return ERR_OK;
}

RTS_RESULT SimCommCycle(void)
{
    if (sim.power_lost)
        return SIM_POWER_CUT;
    if (!sim.on)
        return ERR_NOTINITIALIZED;
    return with_landing(comm_cycle, NULL);
}

/* ---- measurements ---- */

enum { BENCH_BATCHES = 10 };

typedef struct {
    RTS_UI32 task;
    RTS_UI32 cycles; /* per batch */
    RTS_I64 interval_ns;
    IEC_ENTRY entry;
    IEC_CONTEXT *context;
    bool failed;
} BENCH;

static double real_ns(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec * 1e9 + (double)now.tv_nsec;
}

static void call_entry(void *arg)
{
    BENCH *bench = arg;
    RTS_UI32 i;

    for (i = 0; i < bench->cycles; i++) {
        bench->context->time_ns += bench->interval_ns;
        bench->context->time_ms = (RTS_I32)(RTS_UI32)(bench->context->time_ns / NS_PER_MS);
        APP_CALL_ENTRY(bench->entry, bench->context);
    }
}

static void code_batch(BENCH *bench)
{
    RTS_EXCEPTION exception;

    bench->failed = !SysExceptTry(call_entry, bench, &exception);
    sim.now_ns += bench->interval_ns * bench->cycles;
}

static void cycle_batch(BENCH *bench)
{
    RTS_UI32 i;

    sim.real_clock = true;
    for (i = 0; i < bench->cycles && !bench->failed; i++) {
        sim.now_ns += bench->interval_ns;
        bench->failed = !IecTaskCycle(bench->task, sim.now_ns);
    }
    sim.real_clock = false;
}

/* Real time per cycle of the best batch. */
static double best_of(void (*batch)(BENCH *bench), BENCH *bench)
{
    double best = 0;
    int i;

    for (i = 0; i < BENCH_BATCHES && !bench->failed; i++) {
        double start_ns = real_ns();
        double per_cycle;
        batch(bench);
        per_cycle = (real_ns() - start_ns) / bench->cycles;
        if (i == 0 || per_cycle < best)
            best = per_cycle;
    }
    return best;
}

/* Timers go on from now, with the phase they had. */
static void shift_timers(RTS_I64 ns)
{
    TIMER *timer;

    for (timer = sim.timer; timer < sim.timer + MAX_TIMERS; timer++) {
        if (timer->due_ns != NEVER)
            timer->due_ns += ns;
    }
}

RTS_RESULT SimBench(RTS_UI32 task, RTS_UI32 cycles, double *code_ns, double *cycle_ns)
{
    BENCH bench = {task, cycles / BENCH_BATCHES + 1, NS_PER_MS, NULL, NULL, false};
    RTS_I64 start_ns = sim.now_ns;
    IEC_TASK_INFO info;
    RTS_RESULT result;

    if (!sim.on)
        return ERR_NOTINITIALIZED;
    result = AppStartApplication();
    if (result != ERR_OK)
        return result;
    if (IecTaskGetInfo(task, &info) != ERR_OK || IecTaskGetEntry(task, &bench.entry, &bench.context) != ERR_OK)
        return ERR_INVALIDID;
    if (info.interval_us != 0)
        bench.interval_ns = (RTS_I64)info.interval_us * NS_PER_US;
    *cycle_ns = best_of(cycle_batch, &bench); /* first, because an endless loop is aborted here */
    *code_ns = best_of(code_batch, &bench);
    shift_timers(sim.now_ns - start_ns);
    return bench.failed ? ERR_EXCEPTION : ERR_OK;
}

/* ---- what IEC code can call ---- */

/* Lets virtual time pass within a cycle: what a long cycle is on a real device. */
static void simburn(RTS_UI32 us)
{
    sim.now_ns += (RTS_I64)us * NS_PER_US;
}

static const CMP_EXT_FUNCTION externals[] = {
    {"simburn", 0x76DDCD81, 0x00010000, (RTS_PFN)simburn}, /* simburn(UDINT) */
};

bool SimHasExternal(const char *name)
{
    return sim.on && CMFindExternal(name) != NULL;
}

bool SimIsOn(void)
{
    return sim.on;
}

RTS_RESULT SysSim_Hook(CMP_HOOK hook)
{
    RTS_RESULT result;

    if (hook != CH_INIT3)
        return ERR_OK;
    result = SimEventRegisterAll();
    if (result == ERR_OK)
        result = SimFunctionsRegister();
    return result == ERR_OK ? CMRegisterExternal(externals, RTS_COUNT(externals)) : result;
}
