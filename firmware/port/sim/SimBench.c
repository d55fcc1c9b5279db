/*
 * SimBench.c - measures the real time that a cycle takes.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include <time.h>

#include "CmpAppEmbedded.h"
#include "CmpIecTask.h"
#include "Sim.h"
#include "SimClock.h"
#include "SimTimers.h"
#include "SimTimes.h"
#include "SysExcept.h"

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
    SimClockPass(bench->interval_ns * bench->cycles);
}

static void cycle_batch(BENCH *bench)
{
    RTS_UI32 i;

    SimClockMakeReal(true);
    for (i = 0; i < bench->cycles && !bench->failed; i++) {
        SimClockPass(bench->interval_ns);
        bench->failed = !IecTaskCycle(bench->task, SimNow());
    }
    SimClockMakeReal(false);
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

RTS_RESULT SimBench(RTS_UI32 task, RTS_UI32 cycles, double *code_ns, double *cycle_ns)
{
    BENCH bench = {task, cycles / BENCH_BATCHES + 1, NS_PER_MS, NULL, NULL, false};
    RTS_I64 start_ns = SimNow();
    IEC_TASK_INFO info;
    RTS_RESULT result;

    if (!SimIsOn())
        return ERR_NOTINITIALIZED;
    result = AppStartApplication();
    if (result != ERR_OK)
        return result;
    if (IecTaskGetInfo(task, &info) != ERR_OK || IecTaskGetEntry(task, &bench.entry, &bench.context) != ERR_OK)
        return ERR_INVALIDID;
    if (info.interval_us != 0)
        bench.interval_ns = info.interval_us * NS_PER_US;
    *cycle_ns = best_of(cycle_batch, &bench); /* first, because an endless loop is aborted here */
    *code_ns = best_of(code_batch, &bench);
    SimTimersShift(SimNow() - start_ns);
    return bench.failed ? ERR_EXCEPTION : ERR_OK;
}
