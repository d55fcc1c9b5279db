/*
 * SysWatchdog.c - the thread that supervises IEC code, and main: a timer above all tasks.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Main is below all tasks, so tasks that take all processors (endless loops that their watchdog allows) leave it none,
 * and then they could not be stopped. When it starves, it gets a priority above them for a while.
 */
#define _GNU_SOURCE
#include "CmpScheduleTimer.h"
#include "SysAtomic.h"
#include "SysTime.h"
#include "port.h"
#include "rts_config.h"

#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static struct {
    RTS_HANDLE timer;
    pthread_t main;
    char main_stat[40]; /* the file that says what main does */
    int policy;         /* what main has otherwise */
    struct sched_param parameters;
    RTS_UI32 passes; /* of the main loop; atomic */
    RTS_UI32 urgent; /* main has priority; atomic */
    RTS_I64 urgent_until_ns;
    RTS_UI32 seen; /* passes at the last look */
    RTS_I64 seen_ns;
} state;

/* ---- in the thread ---- */

/* Whether main could run now; it runs, then, or waits for a processor. */
static bool is_ready(void)
{
    char text[128] = "";
    int file = open(state.main_stat, O_RDONLY | O_CLOEXEC);
    ssize_t size = file < 0 ? 0 : read(file, text, sizeof(text) - 1);
    const char *name_end = size > 0 ? strrchr(text, ')') : NULL;
    if (file >= 0) {
        (void)close(file);
    }
    return name_end != NULL && strncmp(name_end, ") R", 3) == 0;
}

static void watch_main(RTS_I64 now_ns)
{
    const struct sched_param urgent = {.sched_priority = PORT_PRIORITY_URGENT_MAIN};
    RTS_UI32 passes = SysAtomicLoad(&state.passes);
    if (passes != state.seen) {
        state.seen = passes;
        state.seen_ns = now_ns;
    } else if (passes != 0 && now_ns - state.seen_ns > (RTS_I64)PORT_MAIN_STARVES_US * 1000 &&
               !SysAtomicLoad(&state.urgent) && is_ready() &&
               pthread_setschedparam(state.main, SCHED_FIFO, &urgent) == 0) {
        SysAtomicStore(&state.urgent, 1);
    }
}

static void check(void *param, RTS_I64 due_ns)
{
    RTS_I64 now_ns = SysTimeGetNs();
    RTS_UNUSED(param);
    RTS_UNUSED(due_ns);
    SchedWatchdogCheck(now_ns);
    watch_main(now_ns);
}

/* ---- in main ---- */

static void end_urgency(void)
{
    (void)pthread_setschedparam(state.main, state.policy, &state.parameters);
    SysAtomicStore(&state.urgent, 0);
}

void PortMainPass(void)
{
    RTS_I64 now_ns;
    (void)SysAtomicAdd(&state.passes, 1);
    if (!SysAtomicLoad(&state.urgent)) {
        state.urgent_until_ns = 0;
        return;
    }
    now_ns = SysTimeGetNs();
    if (state.urgent_until_ns == 0) {
        state.urgent_until_ns = now_ns + (RTS_I64)PORT_MAIN_URGENT_US * 1000;
    } else if (now_ns > state.urgent_until_ns) {
        end_urgency();
    }
}

static void know_main(void)
{
    memset(&state, 0, sizeof(state));
    state.main = pthread_self();
    (void)pthread_getschedparam(state.main, &state.policy, &state.parameters);
    snprintf(state.main_stat, sizeof(state.main_stat), "/proc/self/task/%d/stat", (int)gettid());
}

/* It runs before the boot application is initialised and until the last task has been stopped. */
RTS_RESULT SysWatchdog_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT_SYSTEM_TASKS) {
        know_main();
        RTS_RESULT result = PortTimerCreate(check, NULL, PORT_WATCHDOG_US, PORT_PRIORITY_WATCHDOG, &state.timer);
        return result == ERR_OK ? SysTimerStart(state.timer) : result;
    }
    if (hook == CH_EXIT_SYSTEM_TASKS) {
        (void)SysTimerDelete(state.timer);
    }
    return ERR_OK;
}
