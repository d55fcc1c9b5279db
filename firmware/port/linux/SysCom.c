/*
 * SysCom.c - the serial line of the Linux port: a device, or a pseudo terminal for tests and local tools.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A device may go away (USB) and come back: it is opened again. The slave end of a pseudo terminal is held open here,
 * so clients may come and go.
 */
#define _GNU_SOURCE
#include "SysCom.h"

#include "CmpLog.h"
#include "SysTime.h"
#include "port.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

static struct {
    char path[256]; /* of the device, "" for a pseudo terminal */
    char pty_name[64];
    char link[256]; /* to the pseudo terminal, "" for none */
    speed_t speed;
    PORT_SOURCE line; /* what is read and written; no file while the device is away */
    int slave;        /* of a pseudo terminal */
    bool configured;
    bool open;
    RTS_UI32 tried_ms;
} state = {.line = {.file = -1}, .slave = -1};

/* ---- opening ---- */

static const struct {
    RTS_UI32 baud;
    speed_t speed;
} speeds[] = {
    {9600, B9600},       {19200, B19200},     {38400, B38400},     {57600, B57600},     {115200, B115200},
    {230400, B230400},   {460800, B460800},   {500000, B500000},   {921600, B921600},   {1000000, B1000000},
    {1500000, B1500000}, {2000000, B2000000}, {3000000, B3000000}, {4000000, B4000000},
};

static const speed_t *find_speed(RTS_UI32 baud)
{
    for (size_t i = 0; i < RTS_COUNT(speeds); i++) {
        if (speeds[i].baud == baud) {
            return &speeds[i].speed;
        }
    }
    return NULL;
}

bool PortComKnowsBaud(RTS_UI32 baud)
{
    return find_speed(baud) != NULL;
}

/* 8N1, raw, no modem lines. A device that cannot run at the speed keeps its own without saying so. */
static bool make_raw(int line)
{
    struct termios settings;
    struct termios taken;
    if (tcgetattr(line, &settings) != 0) {
        return false;
    }
    cfmakeraw(&settings);
    settings.c_cflag &= ~(tcflag_t)(CSTOPB | CRTSCTS);
    settings.c_cflag |= CLOCAL | CREAD;
    cfsetspeed(&settings, state.speed);
    if (tcsetattr(line, TCSANOW, &settings) != 0 || tcgetattr(line, &taken) != 0) {
        return false;
    }
    errno = EINVAL;
    return cfgetospeed(&taken) == state.speed;
}

/* TIOCEXCL keeps all out but root, the lock keeps other plcrt and plctool out. */
static bool make_exclusive(int line)
{
    (void)ioctl(line, TIOCEXCL);
    bool locked = flock(line, LOCK_EX | LOCK_NB) == 0;
    errno = EBUSY;
    return locked;
}

static bool open_device(void)
{
    state.line.file = open(state.path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (state.line.file < 0) {
        return false;
    }
    if (!make_exclusive(state.line.file) || !make_raw(state.line.file)) {
        int error = errno;
        close(state.line.file);
        state.line.file = -1;
        errno = error;
        return false;
    }
    (void)tcflush(state.line.file, TCIOFLUSH);
    return true;
}

static bool open_pty(void)
{
    state.line.file = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (state.line.file < 0 || grantpt(state.line.file) != 0 || unlockpt(state.line.file) != 0 ||
        ptsname_r(state.line.file, state.pty_name, sizeof(state.pty_name)) != 0) {
        return false;
    }
    state.slave = open(state.pty_name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    return state.slave >= 0 && make_raw(state.slave);
}

/* Whether the link is one to a pseudo terminal: ours, or left by a plcrt that was killed. */
static bool link_leads_to(const char *place)
{
    char found[sizeof(state.pty_name)];
    ssize_t length = readlink(state.link, found, sizeof(found) - 1);
    found[length > 0 ? length : 0] = '\0';
    return length > 0 && strncmp(found, place, strlen(place)) == 0;
}

/* Never replaces what is no such link. */
static bool make_link(PORT_REASON *reason)
{
    if (link_leads_to("/dev/pts/")) {
        (void)unlink(state.link);
    }
    if (symlink(state.pty_name, state.link) == 0) {
        return true;
    }
    PortReason(reason, "cannot make the link %s to the pseudo terminal: %s%s", state.link, strerror(errno),
               errno == EEXIST ? "; name another path, or remove it" : "");
    state.link[0] = '\0';
    return false;
}

static void remove_link(void)
{
    if (state.link[0] != '\0' && link_leads_to(state.pty_name)) {
        (void)unlink(state.link);
    }
    state.link[0] = '\0';
}

/* ---- what main opens ---- */

static const char pty_prefix[] = "pty:";

/* The path of the link in "pty:PATH", "" for "pty", NULL if it is a device. */
static const char *pty_link(const char *path)
{
    size_t length = sizeof(pty_prefix) - 1;
    if (strncmp(path, pty_prefix, length) == 0) {
        return path + length;
    }
    return strcmp(path, "pty") == 0 ? "" : NULL;
}

bool PortComOpen(const char *path, RTS_UI32 baud, PORT_REASON *reason)
{
    const char *link = pty_link(path);
    const speed_t *speed = find_speed(baud);
    if (speed == NULL || strlen(path) >= sizeof(state.path)) {
        PortReason(reason, "cannot use %s at %u baud", path, (unsigned)baud);
        return false;
    }
    memset(&state, 0, sizeof(state));
    state.line = (PORT_SOURCE){.file = -1, .events = POLLIN};
    state.slave = -1;
    state.speed = *speed;
    strcpy(link != NULL ? state.link : state.path, link != NULL ? link : path);
    if (link != NULL ? !open_pty() : !open_device()) {
        int error = errno;
        PortReason(reason, "cannot open serial line %s at %u baud: %s", path, (unsigned)baud, strerror(error));
        reason->busy = error == EBUSY;
        PortComClose();
        return false;
    }
    if (state.link[0] != '\0' && !make_link(reason)) {
        PortComClose();
        return false;
    }
    if (!PortWaitAdd(&state.line)) {
        PortReason(reason, "cannot wait for %s: PORT_MAX_SOURCES are in use", path);
        PortComClose();
        return false;
    }
    state.configured = true;
    return true;
}

void PortComClose(void)
{
    remove_link();
    PortWaitRemove(&state.line);
    if (state.line.file >= 0) {
        close(state.line.file);
    }
    if (state.slave >= 0) {
        close(state.slave);
    }
    state.line.file = -1;
    state.slave = -1;
    state.configured = false;
}

void PortComHandOver(void)
{
    if (state.line.file >= 0 && state.slave < 0) {
        close(state.line.file);
        state.line.file = -1;
    }
}

const char *PortComPtyName(void)
{
    if (!state.configured || state.pty_name[0] == '\0') {
        return NULL;
    }
    return state.link[0] != '\0' ? state.link : state.pty_name;
}

/* ---- a device that goes away ---- */

static void lose_device(void)
{
    LogAdd(CMPID_SysCom, LOG_WARNING, ERR_DEVICE, "Serial device %s is gone", state.path);
    close(state.line.file);
    state.line.file = -1;
    state.line.events = POLLIN;
    state.tried_ms = SysTimeGetMs();
}

static void look_for_device(void)
{
    if (SysTimeGetMs() - state.tried_ms < PORT_REOPEN_MS) {
        return;
    }
    state.tried_ms = SysTimeGetMs();
    if (open_device()) {
        LogAdd(CMPID_SysCom, LOG_INFO, ERR_OK, "Serial device %s is back", state.path);
    }
}

/* Whether line `index` can be used now. */
static bool ready(RTS_UI32 index)
{
    if (index != 0 || !state.open) {
        return false;
    }
    if (state.line.file < 0) {
        look_for_device();
    }
    return state.line.file >= 0;
}

/* The bytes a read or write moved. Nothing to read and no room are not errors; all else means that the device is
 * gone. */
static RTS_UI32 moved(ssize_t count)
{
    if (count > 0) {
        PortWaitNotNow();
        return (RTS_UI32)count;
    }
    bool later = count < 0 && (errno == EAGAIN || errno == EINTR);
    if (!later && state.slave < 0) {
        lose_device();
    }
    return 0;
}

/* ---- SysCom.h ---- */

RTS_UI32 SysComGetCount(void)
{
    return state.configured ? 1 : 0;
}

RTS_RESULT SysComOpen(RTS_UI32 index)
{
    if (index >= SysComGetCount()) {
        return ERR_DEVICE;
    }
    state.open = true;
    if (state.line.file < 0 && !open_device()) {
        LogAdd(CMPID_SysCom, LOG_WARNING, ERR_DEVICE, "Serial device %s is away: %s", state.path, strerror(errno));
    }
    return ERR_OK;
}

void SysComClose(RTS_UI32 index)
{
    if (index == 0) {
        state.open = false;
    }
}

RTS_UI32 SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    return size > 0 && ready(index) ? moved(read(state.line.file, data, size)) : 0;
}

RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    if (size == 0 || !ready(index)) {
        return 0;
    }
    RTS_UI32 taken = moved(write(state.line.file, data, size));
    state.line.events = taken < size ? POLLIN | POLLOUT : POLLIN;
    return taken;
}
