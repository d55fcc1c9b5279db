/*
 * Supervisor.c - starts the process that runs the controller, and starts it again when it dies.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The supervisor runs no IEC code and none of the runtime, so nothing a program does can end it. What the two know of
 * each other is a page of shared memory: the worker notes there that it is up, and, in the handlers of the signals that
 * end it, where it was.
 */
#define _GNU_SOURCE
#include "Supervisor.h"

#include "CmpIecTask.h"
#include "IecStack.h"
#include "SysExcept.h"
#include "port.h"
#include "rts_config.h"

#include <errno.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

/* How often the supervisor looks for its worker without a signal that tells it to, should one be lost [ms]. */
enum { LOOK_MS = 1000 };

/* Written by the worker and read when it is gone. */
typedef struct {
    bool announced; /* one was up; stays */
    bool up;        /* it serves its line */
    bool ended;     /* in order */
    int number;     /* of the signal that it met, 0: none */
    bool running;   /* the application ran */
    bool ran;       /* the thread that died has run IEC code */
    bool in_code;   /* and was in it */
    RTS_I16 task;   /* whose cycle that thread was in, -1: none */
    RTS_UI32 code_offset;
} LIFE;

static struct {
    LIFE *life; /* NULL without supervisor */
    int (*work)(void);
    pid_t worker;
    RTS_I64 started_ms;
    unsigned failures;                          /* deaths in a row that no program can have caused */
    RTS_I64 restarts_ms[PORT_PROGRAM_RESTARTS]; /* when programs were started again; the oldest is replaced */
    unsigned restarts;                          /* in all */
    unsigned restart;                           /* PortProgramRestart */
    unsigned deaths;                            /* in all */
    unsigned end_signals;                       /* received */
    RTS_I64 kill_ms;                            /* when a worker that was asked to end has to be gone */
    char text[40];
    SYS_START start;
} state;

static RTS_I64 now_ms(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (RTS_I64)now.tv_sec * 1000 + now.tv_nsec / 1000000;
}

/* ---- in the worker: the signals that end it ---- */

static struct {
    int number;
    const char *name;
    RTS_UI32 exception;
    struct sigaction previous;
} deadly[] = {
    {.number = SIGSEGV, .name = "SIGSEGV", .exception = RTSEXCPT_ACCESS_VIOLATION},
    {.number = SIGBUS, .name = "SIGBUS", .exception = RTSEXCPT_ACCESS_VIOLATION},
    {.number = SIGFPE, .name = "SIGFPE", .exception = RTSEXCPT_DIVIDEBYZERO},
    {.number = SIGILL, .name = "SIGILL", .exception = RTSEXCPT_ILLEGAL_INSTRUCTION},
    {.number = SIGTRAP, .name = "SIGTRAP", .exception = RTSEXCPT_ILLEGAL_INSTRUCTION},
    {.number = SIGABRT, .name = "SIGABRT", .exception = RTSEXCPT_NOEXCEPTION},
};

/* The index of the task that was called with `arg`, -1 for none. */
static RTS_I16 find_task(const void *arg)
{
    IEC_GUARD guard;
    for (RTS_UI32 i = 0; i < IecTaskGetCount() && i < APP_MAX_TASKS; i++) {
        if (IecTaskReadGuard(i, &guard) && guard.arg == arg) {
            return (RTS_I16)i;
        }
    }
    return -1;
}

/* The handlers before are in force again first: what the memory holds may end the process here, too. */
static void on_death(int number, siginfo_t *info, void *ucontext)
{
    const void *arg;
    uintptr_t place;
    for (size_t i = 0; i < RTS_COUNT(deadly); i++) {
        sigaction(deadly[i].number, &deadly[i].previous, NULL);
    }
    state.life->number = number;
    place = IecStackLastPlace(ucontext, &arg);
    if (place != 0) {
        state.life->code_offset = SysExceptCodeOffset(place);
    }
    if (arg != NULL) {
        state.life->ran = true;
        state.life->task = find_task(arg);
    }
    state.life->in_code = place != 0 || state.life->task >= 0;
    if (info->si_code <= 0) {
        raise(number); /* it was sent; a fault comes again by itself */
    }
}

/* Below those of SysExcept, which hand on what is not IEC code's. */
static void take_deadly_signals(void)
{
    struct sigaction action = {.sa_flags = SA_SIGINFO | SA_ONSTACK | SA_NODEFER};
    action.sa_sigaction = on_death;
    sigemptyset(&action.sa_mask);
    for (size_t i = 0; i < RTS_COUNT(deadly); i++) {
        sigaction(deadly[i].number, &action, &deadly[i].previous);
    }
}

bool PortIsUp(void)
{
    if (state.life == NULL) {
        return true;
    }
    bool first = !state.life->announced;
    state.life->up = true;
    state.life->announced = true;
    return first;
}

void PortNoteRunning(bool running)
{
    if (state.life != NULL) {
        state.life->running = running;
    }
}

unsigned PortDeaths(void)
{
    return state.deaths;
}

unsigned PortProgramRestart(void)
{
    return state.restart;
}

static void be_worker(pid_t supervisor) __attribute__((noreturn));

static void be_worker(pid_t supervisor)
{
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != supervisor) {
        _exit(EXIT_FAILURE); /* it ended before that */
    }
    prctl(PR_SET_NAME, "plcrt-worker"); /* for ps */
    take_deadly_signals();
    int status = state.work();
    state.life->ended = true;
    exit(status);
}

/* ---- in the supervisor: starting ---- */

static bool start_worker(void)
{
    pid_t supervisor = getpid();
    bool announced = state.life->announced;
    *state.life = (LIFE){.announced = announced, .task = -1, .code_offset = APP_NO_CODE_OFFSET};
    (void)fflush(NULL);
    state.worker = fork();
    if (state.worker == 0) {
        be_worker(supervisor);
    }
    if (state.worker < 0) {
        PortPrint(PORT_ERROR, "cannot start a process: %s", strerror(errno));
    }
    PortComHandOver();
    PortCanHandOver();
    state.started_ms = now_ms();
    return state.worker > 0;
}

/* ---- when it has died ---- */

static RTS_UI32 describe_signal(int number)
{
    for (size_t i = 0; i < RTS_COUNT(deadly); i++) {
        if (deadly[i].number == number) {
            snprintf(state.text, sizeof(state.text), "signal %s", deadly[i].name);
            return deadly[i].exception;
        }
    }
    snprintf(state.text, sizeof(state.text), number == SIGKILL ? "signal SIGKILL" : "signal %d", number);
    return RTSEXCPT_NOEXCEPTION;
}

/* How many programs were started again of late. */
static unsigned recent_restarts(void)
{
    unsigned recent = 0;
    for (unsigned i = 0; i < state.restarts && i < PORT_PROGRAM_RESTARTS; i++) {
        recent += now_ms() - state.restarts_ms[i] < PORT_PROGRAM_RESTARTS_MS;
    }
    return recent;
}

static bool is_restart(void)
{
    return state.restart > 0 && state.restart <= PORT_PROGRAM_RESTARTS;
}

/* A program that ran goes on after what it did not cause, as after a loss of power. It may have caused it after all, by
 * what it wrote into memory earlier, so that is counted. */
static void plan_restart(void)
{
    state.restart = state.life->running && !state.life->in_code ? recent_restarts() + 1 : 0;
    if (is_restart()) {
        state.restarts_ms[state.restarts++ % PORT_PROGRAM_RESTARTS] = now_ms();
    }
}

/* SIGKILL comes from outside (a user, the system when memory is short): it is reported, and does not count. */
static void note_death(int status)
{
    int number = WIFSIGNALED(status) ? WTERMSIG(status) : state.life->number; /* a sanitizer exits */
    RTS_UI32 exception = RTSEXCPT_NOEXCEPTION;
    state.deaths++;
    if (number != 0) {
        exception = describe_signal(number);
    } else {
        snprintf(state.text, sizeof(state.text), "exit status %d", WEXITSTATUS(status));
    }
    plan_restart();
    state.start = (SYS_START){
        .cause = number == SIGKILL ? SYS_START_POWER : SYS_START_CRASH,
        .stay_stopped = is_restart() ? SYS_BOOT_PROVEN : SYS_BOOT_STOPPED,
        .exception = exception,
        .task = state.life->task,
        .code_offset = state.life->code_offset,
        .text = state.text,
    };
    PortSetStart(&state.start);
}

/* A worker that ran a program, lived for a while, or was up and killed from outside says nothing against the next. */
static void count_failure(void)
{
    bool innocent = state.life->ran || now_ms() - state.started_ms >= PORT_LIFE_MS ||
                    (state.life->up && state.start.cause == SYS_START_POWER);
    state.failures = innocent ? 0 : state.failures + 1;
}

/* Before the next start [ms]: the first at once, then longer and longer. */
static RTS_I64 pause_ms(void)
{
    unsigned longest = PORT_MAX_FAILURES - 2;
    unsigned doubled = state.failures < longest ? state.failures : longest;
    return state.failures < 2 ? 0 : (RTS_I64)PORT_RESTART_MS << (doubled - 2);
}

/* ---- waiting ---- */

static void signal_worker(int number)
{
    if (state.worker > 0) {
        (void)kill(state.worker, number);
    }
}

static void end_at_once(int number)
{
    sigset_t set;
    signal_worker(SIGKILL);
    (void)waitpid(-1, NULL, 0);
    sigemptyset(&set);
    sigaddset(&set, number);
    (void)signal(number, SIG_DFL);
    (void)raise(number);
    (void)sigprocmask(SIG_UNBLOCK, &set, NULL);
}

static void take_end_signal(int number)
{
    state.end_signals++;
    if (state.end_signals > 1) {
        end_at_once(number);
    }
    state.kill_ms = now_ms() + PORT_END_MS;
    signal_worker(SIGTERM);
}

/* Waits for a signal, until a time [ms], 0 for LOOK_MS; takes those that end plcrt. */
static void wait_for_signal(const sigset_t *set, RTS_I64 until_ms)
{
    siginfo_t info;
    RTS_I64 left = until_ms == 0 ? LOOK_MS : until_ms - now_ms();
    struct timespec timeout = {.tv_sec = left > 0 ? left / 1000 : 0, .tv_nsec = left > 0 ? left % 1000 * 1000000 : 0};
    int number = sigtimedwait(set, &info, &timeout);
    if (number == SIGTERM || number == SIGINT) {
        take_end_signal(number);
    } else if (number == SIGPWR) {
        signal_worker(SIGPWR);
    }
}

/* The status the worker ended with. One that does not end when it is asked to is killed. */
static int wait_for_worker(const sigset_t *set)
{
    int status;
    while (waitpid(state.worker, &status, WNOHANG) != state.worker) {
        wait_for_signal(set, state.kill_ms);
        if (state.kill_ms != 0 && now_ms() >= state.kill_ms) {
            PortPrint(PORT_ERROR, "the controller did not end when it was asked to and was killed");
            signal_worker(SIGKILL);
            state.kill_ms += PORT_END_MS;
        }
    }
    state.worker = 0;
    return status;
}

/* Waits before the next start; false when plcrt was asked to end meanwhile. */
static bool pause_before_start(const sigset_t *set)
{
    RTS_I64 until_ms = now_ms() + pause_ms();
    while (state.end_signals == 0 && now_ms() < until_ms) {
        wait_for_signal(set, until_ms);
    }
    return state.end_signals == 0;
}

/* Whether to go on after a death. */
static bool survives(int status, const sigset_t *set)
{
    note_death(status);
    count_failure();
    if (state.end_signals != 0) {
        PortPrint(PORT_ERROR, "the controller died while it ended (%s)", state.text);
        return false;
    }
    if (state.failures >= PORT_MAX_FAILURES && state.start.cause == SYS_START_CRASH) {
        PortPrint(PORT_CRITICAL, "the controller died %u times in a row without a program (%s): try another flash file",
                  state.failures, state.text);
        return false;
    }
    PortPrint(PORT_ERROR, "the controller died (%s) and is started again; its program %s", state.text,
              is_restart() ? "runs again if it is proven" : "stays stopped");
    return pause_before_start(set);
}

int PortSupervise(int (*work)(void))
{
    sigset_t set;
    int status = 0;
    state.work = work;
    state.life = mmap(NULL, sizeof(*state.life), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (state.life == MAP_FAILED) {
        PortPrint(PORT_ERROR, "not enough memory: %s", strerror(errno));
        return EXIT_FAILURE;
    }
    sigemptyset(&set);
    sigaddset(&set, SIGCHLD);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGPWR);
    sigprocmask(SIG_BLOCK, &set, NULL);
    (void)signal(SIGCHLD, SIG_DFL); /* if it is ignored, the exit status of a child is lost */
    do {
        if (!start_worker()) {
            return EXIT_FAILURE;
        }
        status = wait_for_worker(&set);
        if (state.life->ended && WIFEXITED(status)) {
            return WEXITSTATUS(status);
        }
    } while (survives(status, &set));
    return EXIT_FAILURE;
}
