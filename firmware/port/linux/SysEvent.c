/*
 * SysEvent.c - external events of the Linux port: each byte that another process writes into a pipe is a post.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A thread reads each pipe, above all tasks, as an interrupt would be.
 */
#define _GNU_SOURCE
#include "CmpLog.h"
#include "CmpScheduleTimer.h"
#include "port.h"
#include "rts_config.h"

#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct {
    const char *name;
    int file;
    RTS_HANDLE event;
    pthread_t thread;
    int started;
} EVENT;

static struct {
    EVENT event[SCHED_MAX_EXTERNAL_EVENTS];
    RTS_UI32 count;
} state;

/* ---- before the runtime starts ---- */

/* Opened for writing too: so it never ends, whatever happens at the other end. */
static int open_pipe(const char *path, PORT_REASON *reason)
{
    struct stat status;
    if (mkfifo(path, 0660) != 0 && errno != EEXIST) {
        PortReason(reason, "%s cannot be created: %s", path, strerror(errno));
        return -1;
    }
    int file = open(path, O_RDWR | O_CLOEXEC);
    if (file < 0) {
        PortReason(reason, "%s cannot be opened: %s", path, strerror(errno));
    } else if (fstat(file, &status) != 0 || !S_ISFIFO(status.st_mode)) {
        PortReason(reason, "%s is not a pipe: remove it, or name another file", path);
        (void)close(file);
        file = -1;
    }
    return file;
}

bool PortEventOpen(char *name_and_path, PORT_REASON *reason)
{
    char *path = strchr(name_and_path, '=');
    EVENT *event = &state.event[state.count]; /* main.c counts them */
    if (path == NULL || path == name_and_path || path[1] == '\0') {
        PortReason(reason, "--event %s is not NAME=PIPE, such as door=/run/door", name_and_path);
        return false;
    }
    *path = '\0';
    event->name = name_and_path;
    event->file = open_pipe(path + 1, reason);
    state.count += event->file >= 0;
    return event->file >= 0;
}

void PortEventClose(void)
{
    while (state.count > 0) {
        (void)close(state.event[--state.count].file);
    }
}

/* ---- the threads ---- */

static void *run(void *param)
{
    const EVENT *event = param;
    char bytes[64];
    for (;;) {
        ssize_t count = read(event->file, bytes, sizeof(bytes)); /* where it is cancelled */
        for (; count > 0; count--) {
            (void)SchedPostExternalEvent(event->event);
        }
    }
    return NULL;
}

static int create_thread(EVENT *event, bool realtime)
{
    pthread_attr_t attributes;
    struct sched_param parameters = {.sched_priority = PORT_PRIORITY_EVENTS};
    sigset_t all, before;
    sigfillset(&all);
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, PORT_STACK_SIZE);
    if (realtime) {
        pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
        pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
        pthread_attr_setschedparam(&attributes, &parameters);
    }
    pthread_sigmask(SIG_SETMASK, &all, &before); /* signals are main's */
    int error = pthread_create(&event->thread, &attributes, run, event);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    pthread_attr_destroy(&attributes);
    return error;
}

static RTS_RESULT start(EVENT *event)
{
    RTS_RESULT result = ERR_OK;
    event->event = SchedRegisterExternalEvent(event->name, &result);
    if (result != ERR_OK) {
        LogAdd(CMPID_SysTimer, LOG_ERROR, result, "--event %s is there twice", event->name);
        return result;
    }
    event->started = create_thread(event, true) == 0 || create_thread(event, false) == 0;
    return event->started ? ERR_OK : ERR_NOMEMORY;
}

static void end(EVENT *event)
{
    if (event->started) {
        pthread_cancel(event->thread);
        pthread_join(event->thread, NULL);
        event->started = 0;
        (void)SchedUnregisterExternalEvent(event->event);
    }
}

RTS_RESULT SysEvent_Hook(CMP_HOOK hook)
{
    RTS_RESULT result = ERR_OK;
    for (RTS_UI32 i = 0; i < state.count && result == ERR_OK; i++) {
        if (hook == CH_INIT3) {
            result = start(&state.event[i]);
        }
        if (hook == CH_EXIT3) {
            end(&state.event[i]);
        }
    }
    return result;
}
