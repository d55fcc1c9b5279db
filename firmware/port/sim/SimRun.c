/*
 * SimRun.c - lets virtual time pass: timers, background work and buses run when they are due.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpAppCalls.h"
#include "CmpAppEmbedded.h"
#include "CmpIecTask.h"
#include "CmpScheduleTimer.h"
#include "CyclePhases.h"
#include "Sim.h"
#include "SimClock.h"
#include "SimPower.h"
#include "SimTimers.h"
#include "SimTimes.h"
#include "rts_config.h"
#include "sim_port.h"

/* How often background work runs: often while tasks run in it, else only for what watches the clock. */
#define COMM_BUSY_NS (10 * NS_PER_MS)
#define COMM_IDLE_NS (1000 * NS_PER_MS)
/* Nor does main of a controller come back sooner. */
#define COMM_PAUSE_NS (NS_PER_MS / 4)
#define RUN_LIMIT_NS (SIM_RUN_LIMIT_MS * NS_PER_MS)

const SIM_BUS *SimBus;

static RTS_I64 next_comm_ns;
static RTS_I64 last_comm_ns;

void SimRunStart(void)
{
    next_comm_ns = 0;
    last_comm_ns = -COMM_PAUSE_NS;
}

static void want_pass(RTS_I64 due_ns)
{
    if (due_ns < last_comm_ns + COMM_PAUSE_NS)
        due_ns = last_comm_ns + COMM_PAUSE_NS;
    if (due_ns < next_comm_ns)
        next_comm_ns = due_ns;
}

/* The next pass is when a bus needs it, or a call of the program. */
static void serve_bus(void)
{
    RTS_I64 due_ns = SimBus != NULL ? SimBus->due_ns(SimNow()) : NEVER;

#if APP_CALLS > 0
    if (AppCallsWait())
        due_ns = SimNow();
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
    SimClockReach(due_ns);
    if (SimBus->run(SimNow()))
        want_pass(SimNow());
}

static void run_comm_cycle(void)
{
    last_comm_ns = SimNow();
    next_comm_ns = SimNow() + (SchedHasBackgroundTasks() ? COMM_BUSY_NS : COMM_IDLE_NS);
    (void)CMCallHook(CH_COMM_CYCLE);
    serve_bus();
}

/* Runs the timers that are due next, and the tasks that follow them. */
static void run_timers(void)
{
    SimTimersRun();
    if (SchedHasBackgroundTasks())
        SchedBackgroundCycle();
    serve_bus();
}

/* Does what comes next and is due before `end_ns`; false when nothing is. */
static bool run_next(RTS_I64 end_ns)
{
    RTS_I64 timer_ns = SimTimersGetDueNs();
    RTS_I64 bus_ns = next_of_bus();

    if (bus_ns < end_ns && bus_ns < next_comm_ns && bus_ns < timer_ns) {
        run_bus(bus_ns);
        return true;
    }
    if (timer_ns < end_ns && timer_ns <= next_comm_ns) {
        run_timers();
        return true;
    }
    if (next_comm_ns >= end_ns)
        return false;
    SimClockReach(next_comm_ns);
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
    SimClockReach(passage->end_ns);
    run_comm_cycle();
    return ERR_OK;
}

/* `beyond_ns`: how far past the end what is due still runs. */
static RTS_RESULT pass(RTS_I64 ns, RTS_I64 beyond_ns)
{
    PASSAGE passage;

    if (ns < 0 || ns >= NEVER - beyond_ns - SimNow())
        return ERR_PARAMETER;
    passage.end_ns = SimNow() + ns;
    passage.limit_ns = passage.end_ns + beyond_ns;
    return SimPowerRunStarted(advance, &passage);
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
    RTS_I64 limit_ns = SimNow() + RUN_LIMIT_NS;
    RTS_UI32 done = 0;
    RTS_RESULT result = running_state();

    SchedNoteEvents();
    serve_bus();
    while (result == ERR_OK && done < run->cycles) {
        if (!run_next(limit_ns < run->until_ns ? limit_ns : run->until_ns)) {
            if (limit_ns < run->until_ns)
                return ERR_TIMEOUT;
            SimClockReach(run->until_ns);
            result = ERR_PENDING;
            break;
        }
        if (cycles_of_first_task() - first != done) {
            done = cycles_of_first_task() - first;
            limit_ns = SimNow() + RUN_LIMIT_NS;
        }
        result = running_state();
    }
    run_comm_cycle();
    return result;
}

RTS_RESULT SimRunCyclesUntil(RTS_UI32 cycles, RTS_I64 until_ns)
{
    CYCLE_RUN run = {cycles, until_ns};

    return SimPowerRunStarted(run_cycles, &run);
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
    RTS_I64 due_ns = SimNow();

    while (SimNow() < end_ns) {
        if (SimNow() >= due_ns) {
            exchange(context);
            due_ns += interval_ns;
        }
        if (next_of_bus() <= SimNow())
            run_bus(SimNow());
        if (next_comm_ns <= SimNow())
            run_comm_cycle();
        SimClockReach(earlier(earlier(next_comm_ns, next_of_bus()), earlier(due_ns, end_ns)));
    }
    exchange(context);
}

RTS_RESULT SimRunDevices(RTS_I64 ns)
{
    IEC_CONTEXT *context;
    IEC_TASK_INFO info;
    IEC_ENTRY entry;

    if (ns < 0 || ns >= NEVER - SimNow())
        return ERR_PARAMETER;
    if (!SimIsOn())
        return ERR_NOTINITIALIZED;
    if (IecTaskGetInfo(0, &info) != ERR_OK || info.interval_us == 0 || IecTaskGetEntry(0, &entry, &context) != ERR_OK)
        return ERR_INVALID_STATE;
    run_devices_until(SimNow() + ns, info.interval_us * NS_PER_US, context);
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
    return SimPowerRunStarted(comm_cycle, NULL);
}
