/*
 * Systemd.c - messages to systemd, without its library: datagrams to the socket that it names.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The worker sends them, since it is main of the worker that the watchdog is about. So the unit needs NotifyAccess=all.
 */
#define _GNU_SOURCE
#include "Systemd.h"

#include "AppState.h"
#include "CmpAppEmbedded.h"
#include "CmpStd.h"
#include "SysTime.h"

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum { NO_STATE = -1, MESSAGE_SIZE = 160 };

static struct {
    int file; /* -1: systemd wants to know nothing */
    struct sockaddr_un place;
    socklen_t place_size;
    RTS_UI32 watchdog_ms; /* how often it is fed, 0: there is none */
    RTS_UI32 fed_ms;
    int state; /* that was reported last */
} notify = {.file = -1, .state = NO_STATE};

/* A message that has no room now is lost: the next one comes. */
static void send_message(const char *text)
{
    if (notify.file >= 0) {
        (void)!sendto(notify.file, text, strlen(text), MSG_NOSIGNAL | MSG_DONTWAIT,
                      (const struct sockaddr *)&notify.place, notify.place_size);
    }
}

/* ---- the environment ---- */

/* A path, or with '@' a name that is not in the file system. */
static bool take_place(const char *path)
{
    size_t length = strlen(path);
    if ((path[0] != '/' && path[0] != '@') || length < 2 || length >= sizeof(notify.place.sun_path)) {
        return false;
    }
    notify.place.sun_family = AF_UNIX;
    memcpy(notify.place.sun_path, path, length + 1);
    if (path[0] == '@') {
        notify.place.sun_path[0] = '\0';
    }
    notify.place_size = (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length);
    return true;
}

/* Half of the time that systemd waits [ms], as it recommends; 0: there is no watchdog, or it is of another process. */
static RTS_UI32 read_watchdog(void)
{
    const char *time_us = getenv("WATCHDOG_USEC");
    const char *process = getenv("WATCHDOG_PID");
    unsigned long long value = time_us != NULL ? strtoull(time_us, NULL, 10) / 2000 : 0;
    if (process != NULL && strtol(process, NULL, 10) != (long)getpid()) {
        return 0;
    }
    return value < INT32_MAX ? (RTS_UI32)value : 0;
}

void PortSystemdInit(void)
{
    const char *path = getenv("NOTIFY_SOCKET");
    if (path == NULL || !take_place(path)) {
        return;
    }
    notify.file = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    notify.watchdog_ms = read_watchdog();
}

/* ---- what is reported ---- */

void PortSystemdReady(void)
{
    send_message("READY=1");
    notify.fed_ms = SysTimeGetMs() - notify.watchdog_ms;
}

static const char *describe(const APP_STATUS *status)
{
    if (status->state == AS_NONE) {
        return "No program";
    }
    if ((status->op_state & OS_EXCEPTION) != 0) {
        return "The program was stopped by an exception: see plctool status";
    }
    return status->state == AS_RUN ? "The program runs" : "The program is stopped";
}

static void report_state(void)
{
    char text[MESSAGE_SIZE];
    APP_STATUS status;
    AppGetStatus(&status);
    int state = (int)(status.state << 8 | (status.op_state & OS_EXCEPTION));
    if (state != notify.state) {
        (void)snprintf(text, sizeof(text), "STATUS=%s", describe(&status));
        send_message(text);
        notify.state = state;
    }
}

void PortSystemdPass(void)
{
    if (notify.file < 0) {
        return;
    }
    report_state();
    if (notify.watchdog_ms != 0 && SysTimeGetMs() - notify.fed_ms >= notify.watchdog_ms) {
        notify.fed_ms = SysTimeGetMs();
        send_message("WATCHDOG=1");
    }
}

void PortSystemdStopping(void)
{
    send_message("STOPPING=1");
}
