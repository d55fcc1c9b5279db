/*
 * SimSupervise.c - aborts endless loops; what else takes threads.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * In an endless loop virtual time stands still, so the watchdog of the runtime never expires. A thread looks, in time
 * of the processor, which does not depend on what else the machine does, whether one and the same cycle has been
 * running for too long.
 */
#define _GNU_SOURCE
#include <pthread.h>
#include <signal.h>
#include <time.h>
#include <unistd.h>

#include "CmpAppBP.h"
#include "CmpIecTask.h"
#include "Sim.h"
#include "SysAtomic.h"
#include "SysExcept.h"
#include "rts_config.h"
#include "sim_port.h"

enum { LOOK_EVERY_MS = 20 };

/* A cycle that was seen running. Serials begin again in each runtime, and when tasks are created; virtual time begins
 * again in each runtime. */
typedef struct {
    RTS_UI32 runtime;
    RTS_UI32 serial;
    RTS_I64 start_ns;
    RTS_I64 since_ms;
} SEEN;

static struct {
    pid_t process;     /* whose thread it is: a fork does not have it */
    RTS_UI32 runtimes; /* started in this process */
    RTS_UI32 limit_ms;
    RTS_UI32 is_held; /* main serves a task that waits for it */
} supervisor = {0, 0, SIM_CYCLE_LIMIT_MS, false};

static RTS_I64 processor_ms(void)
{
    struct timespec now;

    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (RTS_I64)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

static void look(RTS_UI32 index, SEEN *seen)
{
    RTS_UI32 runtime = SysAtomicLoad(&supervisor.runtimes);
    IEC_GUARD guard = {0};

    if (!IecTaskReadGuard(index, &guard) || AppBpIsHalted() || runtime != seen->runtime ||
        guard.serial != seen->serial || guard.start_ns != seen->start_ns) {
        *seen = (SEEN){runtime, guard.serial, guard.start_ns, processor_ms()};
    } else if (processor_ms() - seen->since_ms > SysAtomicLoad(&supervisor.limit_ms) &&
               !SysAtomicLoad(&supervisor.is_held)) {
        SysExceptBreak(guard.arg, RTSEXCPT_WATCHDOG);
    }
}

static void *supervise(void *unused)
{
    SEEN seen[APP_MAX_TASKS + 1] = {{0, 0, 0, 0}};
    const struct timespec pause = {0, LOOK_EVERY_MS * 1000000L};

    RTS_UNUSED(unused);
    for (;;) {
        RTS_UI32 count = IecTaskGetCount();
        RTS_UI32 i;
        for (i = 0; i <= count; i++)
            look(i, &seen[i]);
        nanosleep(&pause, NULL);
    }
    return NULL;
}

/* What SysLock costs on Linux, while a cycle is measured. */
static pthread_mutex_t mutex;

static void make_mutex(void)
{
    pthread_mutexattr_t attributes;

    pthread_mutexattr_init(&attributes);
    pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
    pthread_mutex_init(&mutex, &attributes);
    pthread_mutexattr_destroy(&attributes);
}

void SimSuperviseStart(void)
{
    pthread_t thread;

    (void)SysAtomicAdd(&supervisor.runtimes, 1);
    if (supervisor.process == getpid())
        return;
    make_mutex();
    if (pthread_create(&thread, NULL, supervise, NULL) == 0) {
        pthread_detach(thread);
        supervisor.process = getpid();
    }
}

static void hold_signals(bool hold)
{
#ifdef _WIN32
    RTS_UNUSED(hold); /* there, SysExceptBreak() stops the thread instead */
#else
    static __thread sigset_t before;
    sigset_t all;

    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, hold ? &all : &before, hold ? &before : NULL);
#endif
}

void SimSuperviseHold(bool hold)
{
    if (hold)
        hold_signals(true);
    SysAtomicStore(&supervisor.is_held, hold);
    if (!hold)
        hold_signals(false);
}

void SimSetCycleLimit(RTS_UI32 ms)
{
    SysAtomicStore(&supervisor.limit_ms, ms ? ms : SIM_CYCLE_LIMIT_MS);
}

void SimMutexLock(void)
{
    pthread_mutex_lock(&mutex);
}

void SimMutexUnlock(void)
{
    pthread_mutex_unlock(&mutex);
}
