/*
 * SysTimer.c - timers of the Linux port: one thread each, SCHED_RR: those of one priority take turns.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A thread lives from SysTimerStart to SysTimerStop, on a stack that was reserved at start-up. It sleeps on a condition
 * variable with an absolute CLOCK_MONOTONIC time, which wakes as precisely as clock_nanosleep and can be cut short by
 * SysTimerStop and SysTimerTrigger. Its lock passes on priority, since tasks trigger each other.
 */
#define _GNU_SOURCE
#include "SysTimer.h"

#include "CmpLog.h"
#include "SysAtomic.h"
#include "SysExcept.h"
#include "SysTime.h"
#include "port.h"

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <time.h>

enum {
    MAX_TIMERS = APP_MAX_TASKS + 1 + 2 * CAN_CONTROLLERS, /* the watchdog; SYNC and its window */
    STACK_STEP = PORT_STACK_GUARD + PORT_STACK_SIZE,
};
#define NEVER INT64_MAX

typedef struct {
    SYS_TIMER_CALLBACK callback; /* NULL when the timer is free */
    void *param;
    RTS_I64 interval_ns; /* 0: calls when it is triggered */
    RTS_UI32 overruns;   /* atomic */
    int priority;
    int started;
    pthread_t thread;
    pthread_mutex_t lock;
    pthread_cond_t changed;
    RTS_I64 due_ns; /* of the next call, NEVER without one; of timers without interval under `lock` */
    int stop;       /* under `lock`; also while there is no thread */
} TIMER;

static struct {
    TIMER timer[MAX_TIMERS];
    char *stacks;
    bool realtime; /* false after the system has refused SCHED_RR */
} state;

/* ---- in the thread ---- */

/* With the lock: sleeps until the time `due_ns` has come or something has changed. */
static void sleep_towards(TIMER *timer)
{
    if (timer->due_ns == NEVER) {
        pthread_cond_wait(&timer->changed, &timer->lock);
        return;
    }
    RTS_I64 at = PortMonotonicNs(timer->due_ns);
    struct timespec until = {.tv_sec = (time_t)(at / 1000000000), .tv_nsec = (long)(at % 1000000000)};
    pthread_cond_timedwait(&timer->changed, &timer->lock, &until);
}

/* Sleeps until the next call is due; false when the timer was stopped instead. */
static bool wait_until_due(TIMER *timer, RTS_I64 *due_ns)
{
    pthread_mutex_lock(&timer->lock);
    while (!timer->stop && timer->due_ns > SysTimeGetNs()) {
        sleep_towards(timer);
    }
    bool go_on = !timer->stop;
    *due_ns = timer->due_ns;
    if (timer->interval_ns == 0) {
        timer->due_ns = NEVER;
    }
    pthread_mutex_unlock(&timer->lock);
    return go_on;
}

/* How many due times, `due_ns` the first, have passed at `now_ns`. */
static RTS_UI32 count_missed(RTS_I64 due_ns, RTS_I64 now_ns, RTS_I64 interval_ns)
{
    return now_ns <= due_ns ? 0 : (RTS_UI32)((now_ns - due_ns - 1) / interval_ns + 1);
}

static void set_next_due(TIMER *timer)
{
    timer->due_ns += timer->interval_ns;
    RTS_UI32 missed = count_missed(timer->due_ns, SysTimeGetNs(), timer->interval_ns);
    (void)SysAtomicAdd(&timer->overruns, missed);
    timer->due_ns += missed * timer->interval_ns;
}

static void do_nothing(void *arg)
{
    RTS_UNUSED(arg);
}

static void *run(void *param)
{
    TIMER *timer = param;
    RTS_I64 due_ns;
    RTS_EXCEPTION none;
    (void)SysExceptTry(do_nothing, NULL, &none); /* takes what catching needs now, not in the first cycle */
    prctl(PR_SET_TIMERSLACK, 1UL);               /* matters without SCHED_RR only: else 50 us late */
    while (wait_until_due(timer, &due_ns)) {
        timer->callback(timer->param, due_ns);
        if (timer->interval_ns != 0) {
            set_next_due(timer);
        }
    }
    return NULL;
}

/* ---- starting and stopping it ---- */

static TIMER *get_timer(RTS_HANDLE handle)
{
    return handle < MAX_TIMERS && state.timer[handle].callback != NULL ? &state.timer[handle] : NULL;
}

/* The thread leaves SIGTERM and the like to main; what SysExcept needs it unblocks itself. */
static int create_thread(TIMER *timer, bool realtime)
{
    pthread_attr_t attributes;
    struct sched_param parameters = {.sched_priority = timer->priority};
    sigset_t all, before;
    sigfillset(&all);
    pthread_attr_init(&attributes);
    pthread_attr_setstack(&attributes, state.stacks + (timer - state.timer) * STACK_STEP + PORT_STACK_GUARD,
                          PORT_STACK_SIZE);
    if (realtime) {
        pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
        pthread_attr_setschedpolicy(&attributes, SCHED_RR);
        pthread_attr_setschedparam(&attributes, &parameters);
    }
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int error = pthread_create(&timer->thread, &attributes, run, timer);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    pthread_attr_destroy(&attributes);
    return error;
}

RTS_RESULT SysTimerStart(RTS_HANDLE handle)
{
    TIMER *timer = get_timer(handle);
    if (timer == NULL) {
        return ERR_INVALID_HANDLE;
    }
    if (timer->started) {
        return ERR_INVALID_STATE;
    }
    pthread_mutex_lock(&timer->lock);
    timer->stop = 0;
    timer->due_ns = SysTimeGetNs();
    pthread_mutex_unlock(&timer->lock);
    int error = create_thread(timer, state.realtime);
    if (error == EPERM && state.realtime) {
        state.realtime = false;
        LogAdd(CMPID_SysTimer, LOG_WARNING, ERR_NO_ACCESS_RIGHTS,
               "No CAP_SYS_NICE: tasks run without real-time priority");
        error = create_thread(timer, false);
    }
    timer->started = error == 0;
    if (error != 0) {
        timer->stop = 1; /* there is no thread that a trigger could be for */
    }
    return error == 0 ? ERR_OK : ERR_NOMEMORY;
}

RTS_RESULT SysTimerStop(RTS_HANDLE handle)
{
    TIMER *timer = get_timer(handle);
    if (timer == NULL) {
        return ERR_INVALID_HANDLE;
    }
    if (!timer->started) {
        return ERR_OK;
    }
    pthread_mutex_lock(&timer->lock);
    timer->stop = 1;
    pthread_cond_signal(&timer->changed);
    pthread_mutex_unlock(&timer->lock);
    pthread_join(timer->thread, NULL);
    timer->started = 0;
    return ERR_OK;
}

/* The timer may be created, started or stopped meanwhile by main: then the trigger has no meaning, but does no harm. */
void SysTimerTrigger(RTS_HANDLE handle, RTS_I64 due_ns)
{
    if (handle >= MAX_TIMERS) {
        return;
    }
    TIMER *timer = &state.timer[handle];
    pthread_mutex_lock(&timer->lock);
    if (!timer->stop && timer->interval_ns == 0 && due_ns < timer->due_ns) {
        timer->due_ns = due_ns;
        pthread_cond_signal(&timer->changed);
    }
    pthread_mutex_unlock(&timer->lock);
}

/* ---- creating and deleting ---- */

RTS_RESULT PortTimerCreate(SYS_TIMER_CALLBACK callback, void *param, RTS_UI32 interval_us, int fifo_priority,
                           RTS_HANDLE *timer)
{
    RTS_HANDLE i = 0;
    if (callback == NULL) {
        return ERR_PARAMETER;
    }
    while (i < MAX_TIMERS && state.timer[i].callback != NULL) {
        i++;
    }
    if (i == MAX_TIMERS || state.stacks == NULL) {
        return ERR_NOMEMORY;
    }
    state.timer[i].callback = callback;
    state.timer[i].param = param;
    state.timer[i].interval_ns = (RTS_I64)interval_us * 1000;
    state.timer[i].overruns = 0;
    state.timer[i].priority = fifo_priority;
    state.timer[i].started = 0;
    *timer = i;
    return ERR_OK;
}

RTS_RESULT SysTimerCreate(SYS_TIMER_CALLBACK callback, void *param, RTS_UI32 interval_us, RTS_UI32 priority,
                          RTS_HANDLE *timer)
{
    if (priority > 31) {
        return ERR_PARAMETER;
    }
    return PortTimerCreate(callback, param, interval_us, PORT_PRIORITY_HIGHEST - (int)priority, timer);
}

RTS_RESULT SysTimerDelete(RTS_HANDLE handle)
{
    RTS_RESULT result = SysTimerStop(handle);
    if (result == ERR_OK) {
        state.timer[handle].callback = NULL;
    }
    return result;
}

RTS_UI32 SysTimerGetOverruns(RTS_HANDLE handle)
{
    const TIMER *timer = get_timer(handle);
    return timer != NULL ? SysAtomicLoad(&timer->overruns) : 0;
}

RTS_I64 SysTimerGetUsedNs(RTS_HANDLE handle)
{
    const TIMER *timer = get_timer(handle);
    clockid_t clock;
    struct timespec used;
    if (timer == NULL || !timer->started || pthread_getcpuclockid(timer->thread, &clock) != 0 ||
        clock_gettime(clock, &used) != 0) {
        return 0;
    }
    return (RTS_I64)used.tv_sec * 1000000000 + used.tv_nsec;
}

/* ---- the component ---- */

static void init_timer(TIMER *timer)
{
    pthread_condattr_t attributes;
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_cond_init(&timer->changed, &attributes);
    pthread_condattr_destroy(&attributes);
    pthread_mutexattr_t passes_on_priority;
    pthread_mutexattr_init(&passes_on_priority);
    (void)pthread_mutexattr_setprotocol(&passes_on_priority, PTHREAD_PRIO_INHERIT);
    pthread_mutex_init(&timer->lock, &passes_on_priority);
    pthread_mutexattr_destroy(&passes_on_priority);
    timer->stop = 1;
}

static RTS_RESULT init(void)
{
    memset(&state, 0, sizeof(state));
    state.realtime = true;
    char *stacks =
        mmap(NULL, (size_t)MAX_TIMERS * STACK_STEP, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (stacks == MAP_FAILED) {
        return ERR_NOMEMORY;
    }
    for (size_t i = 0; i < MAX_TIMERS; i++) {
        init_timer(&state.timer[i]);
        if (mprotect(stacks + i * STACK_STEP + PORT_STACK_GUARD, PORT_STACK_SIZE, PROT_READ | PROT_WRITE) != 0) {
            munmap(stacks, (size_t)MAX_TIMERS * STACK_STEP);
            return ERR_NOMEMORY;
        }
    }
    state.stacks = stacks;
    return ERR_OK;
}

static void shut_down(void)
{
    for (RTS_HANDLE i = 0; i < MAX_TIMERS; i++) {
        (void)SysTimerDelete(i);
    }
    if (state.stacks != NULL) {
        munmap(state.stacks, (size_t)MAX_TIMERS * STACK_STEP);
        state.stacks = NULL;
    }
}

RTS_RESULT SysTimer_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT_SYSTEM) {
        return init();
    }
    if (hook == CH_EXIT_SYSTEM) {
        shut_down();
    }
    return ERR_OK;
}
