/*
 * SysCan.c - the one CAN controller of the Linux port: an interface of the kernel, or SLCAN on a serial line.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * An interface or adapter may go away and come back: it is opened again. A pseudo terminal stays open.
 */
#define _GNU_SOURCE
#include "SysCan.h"

#include "CanSocket.h"
#include "CmpLog.h"
#include "CmpSrvNumbers.h"
#include "Slcan.h"
#include "SysTime.h"
#include "port.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

enum { FILTERS = 4 };

static const char slcan_prefix[] = "slcan:";

static struct {
    char name[256]; /* of the interface, or the path of the line; "" for a pseudo terminal */
    char pty_name[64];
    PORT_CAN_OPTIONS options;
    PORT_SOURCE line; /* no file while it is away */
    int slave;        /* of a pseudo terminal */
    int away;         /* errno of the opening by main */
    bool is_slcan;
    bool configured;
    bool open;
    RTS_UI32 tried_ms;
    CAN_STATE state;
    CAN_FILTER filter[FILTERS];
    RTS_UI32 filters;
    SLCAN slcan;
} can = {.line = {.file = -1}, .slave = -1};

/* ---- a serial line ---- */

/* Adapters on USB have no bit rate of the line; those on a real one have this. */
static bool make_raw(int file)
{
    struct termios settings;
    if (tcgetattr(file, &settings) != 0) {
        return false;
    }
    cfmakeraw(&settings);
    settings.c_cflag &= ~(tcflag_t)(CSTOPB | CRTSCTS);
    settings.c_cflag |= CLOCAL | CREAD;
    cfsetspeed(&settings, B115200);
    return tcsetattr(file, TCSANOW, &settings) == 0;
}

static int open_tty(const char *path)
{
    int file = open(path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (file >= 0 && (!make_raw(file) || flock(file, LOCK_EX | LOCK_NB) != 0)) {
        int error = errno == EWOULDBLOCK ? EBUSY : errno;
        close(file);
        errno = error;
        return -1;
    }
    return file;
}

static int open_pty(void)
{
    int file = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (file < 0 || grantpt(file) != 0 || unlockpt(file) != 0 ||
        ptsname_r(file, can.pty_name, sizeof(can.pty_name)) != 0) {
        return file;
    }
    can.slave = open(can.pty_name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (can.slave >= 0) {
        (void)make_raw(can.slave);
    }
    return file;
}

static RTS_UI32 moved(ssize_t count)
{
    if (count > 0) {
        PortWaitNotNow();
        return (RTS_UI32)count;
    }
    if (!(count < 0 && (errno == EAGAIN || errno == EINTR)) && can.slave < 0) {
        can.state.bus = CAN_BUS_STOPPED;
    }
    return 0;
}

static RTS_UI32 read_line(RTS_UI8 *data, RTS_UI32 size)
{
    return moved(read(can.line.file, data, size));
}

static RTS_UI32 write_line(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 taken = moved(write(can.line.file, data, size));
    can.line.events = taken < size ? POLLIN | POLLOUT : POLLIN;
    return taken;
}

/* ---- away and back ---- */

static bool open_line(void)
{
    can.line.events = POLLIN;
    if (can.slave >= 0) {
        return true;
    }
    can.line.file = can.is_slcan ? open_tty(can.name) : CanSocketOpen(can.name, can.options.data_bit_rate != 0);
    return can.line.file >= 0;
}

static RTS_RESULT begin(void)
{
    static const SLCAN_LINE line = {read_line, write_line};
    RTS_RESULT result = ERR_OK;
    can.state.bus = CAN_BUS_ACTIVE;
    if (can.is_slcan) {
        result = SlcanOpen(&can.slcan, line, can.options.bit_rate, can.options.data_bit_rate);
        (void)SlcanSetFilters(&can.slcan, can.filter, can.filters);
    } else if (!CanSocketSetFilters(can.line.file, can.filter, can.filters)) {
        result = ERR_DEVICE;
    }
    return result;
}

static void close_line(void)
{
    if (can.line.file >= 0 && can.slave < 0) {
        close(can.line.file);
        can.line.file = -1;
    }
}

static void lose_line(void)
{
    LogAdd(CMPID_SysCan, LOG_WARNING, ERR_DEVICE, "CAN %s is gone", can.name);
    close_line();
    can.state.bus = CAN_BUS_STOPPED;
    can.tried_ms = SysTimeGetMs();
}

static void look_for_line(void)
{
    if (SysTimeGetMs() - can.tried_ms < PORT_REOPEN_MS) {
        return;
    }
    can.tried_ms = SysTimeGetMs();
    if (open_line() && begin() == ERR_OK) {
        LogAdd(CMPID_SysCan, LOG_INFO, ERR_OK, "CAN %s is back", can.name);
    }
}

static bool ready(RTS_UI32 index)
{
    if (index != 0 || !can.open) {
        return false;
    }
    if (can.line.file >= 0 && can.state.bus == CAN_BUS_STOPPED) {
        lose_line();
    }
    if (can.line.file < 0) {
        look_for_line();
    }
    return can.line.file >= 0;
}

/* ---- what main opens ---- */

static const char *slcan_path(const char *text)
{
    size_t length = sizeof(slcan_prefix) - 1;
    return strncmp(text, slcan_prefix, length) == 0 ? text + length : NULL;
}

static const char *advice(int error)
{
    if (error == ENETDOWN) {
        return "; set it up, for example with: ip link set can0 up type can bitrate 500000";
    }
    return error == EPROTONOSUPPORT ? "; for CAN FD it needs mtu 72: ip link set can0 mtu 72" : "";
}

/* Interfaces are not in a folder of devices, so each name may come; one that is down may be set up. */
static bool may_come(int error)
{
    return can.is_slcan ? PortMayCome(error, can.name) : error == ENODEV || error == ENETDOWN;
}

const char *PortCanAway(void)
{
    static char words[128];
    if (can.line.file >= 0) {
        return NULL;
    }
    (void)snprintf(words, sizeof(words), "%s%s", strerror(can.away), advice(can.away));
    return words;
}

bool PortCanOpen(const char *text, const PORT_CAN_OPTIONS *options, PORT_REASON *reason)
{
    const char *path = slcan_path(text);
    bool pty = strcmp(text, "slcan:pty") == 0;
    if (strlen(text) >= sizeof(can.name)) {
        PortReason(reason, "cannot open CAN %s: the name is too long", text);
        return false;
    }
    if (path != NULL && !SlcanKnows(options->bit_rate, options->data_bit_rate)) {
        PortReason(reason, "cannot open CAN %s: SLCAN has no such %s; give for example --bitrate 500000%s", text,
                   SlcanKnows(options->bit_rate, 0) ? "data bit rate" : "bit rate",
                   options->data_bit_rate != 0 ? "/2000000" : "");
        return false;
    }
    memset(&can, 0, sizeof(can));
    can.slave = -1;
    can.options = *options;
    can.is_slcan = path != NULL;
    strcpy(can.name, path != NULL ? path : text);
    can.line = (PORT_SOURCE){.file = pty ? open_pty() : -1, .events = POLLIN};
    can.away = 0;
    if ((pty && can.slave < 0) || !open_line()) {
        can.away = errno;
    }
    if (can.away != 0 && (pty || !may_come(can.away))) {
        int error = can.away;
        PortReason(reason, "cannot open CAN %s: %s%s", text, strerror(error), advice(error));
        reason->busy = error == EBUSY;
        PortCanClose();
        return false;
    }
    if (!PortWaitAdd(&can.line)) {
        PortReason(reason, "cannot wait for CAN %s: PORT_MAX_SOURCES are in use", text);
        PortCanClose();
        return false;
    }
    can.configured = true;
    return true;
}

void PortCanClose(void)
{
    PortWaitRemove(&can.line);
    if (can.line.file >= 0) {
        close(can.line.file);
    }
    if (can.slave >= 0) {
        close(can.slave);
    }
    can.line.file = -1;
    can.slave = -1;
    can.configured = false;
}

void PortCanHandOver(void)
{
    close_line();
}

bool PortCanHas(const char *path)
{
    return can.configured && can.is_slcan &&
           (strcmp(can.name, path) == 0 || PortIsDevice(can.slave >= 0 ? can.slave : can.line.file, path));
}

const char *PortCanPtyName(void)
{
    return can.configured && can.pty_name[0] != '\0' ? can.pty_name : NULL;
}

/* ---- SysCan.h ---- */

RTS_UI32 SysCanGetCount(void)
{
    return can.configured ? 1 : 0;
}

void SysCanGetAddress(RTS_UI32 index, CAN_ADDRESS *address)
{
    RTS_UNUSED(index);
    address->base = can.options.base;
    address->node = can.options.node;
}

RTS_RESULT SysCanOpen(RTS_UI32 index, RTS_UI32 bit_rate, RTS_UI32 data_bit_rate)
{
    if (index >= SysCanGetCount()) {
        return ERR_DEVICE;
    }
    can.options.bit_rate = bit_rate != 0 ? bit_rate : can.options.bit_rate;
    can.options.data_bit_rate = data_bit_rate != 0 ? data_bit_rate : can.options.data_bit_rate;
    can.filters = 0;
    can.open = true;
    if (can.line.file < 0 && !open_line()) {
        can.state.bus = CAN_BUS_STOPPED;
        LogAdd(CMPID_SysCan, LOG_WARNING, ERR_DEVICE, "CAN %s is away: %s", can.name, strerror(errno));
        return ERR_OK;
    }
    return begin();
}

void SysCanClose(RTS_UI32 index)
{
    if (index == 0) {
        can.open = false;
    }
}

bool SysCanIsFd(RTS_UI32 index)
{
    return index == 0 && can.options.data_bit_rate != 0;
}

RTS_RESULT SysCanSetFilters(RTS_UI32 index, const CAN_FILTER *filters, RTS_UI32 count)
{
    if (index != 0 || count > FILTERS) {
        return ERR_DEVICE;
    }
    memcpy(can.filter, filters, count * sizeof(*filters));
    can.filters = count;
    if (can.is_slcan) {
        return SlcanSetFilters(&can.slcan, filters, count);
    }
    return can.line.file < 0 || CanSocketSetFilters(can.line.file, filters, count) ? ERR_OK : ERR_DEVICE;
}

RTS_RESULT SysCanSend(RTS_UI32 index, const CAN_FRAME *frame)
{
    if (!CanIsFrame(frame)) {
        return ERR_PARAMETER;
    }
    if (!ready(index) || can.state.bus == CAN_BUS_OFF) {
        return ERR_DEVICE;
    }
    if (can.is_slcan) {
        return SlcanSend(&can.slcan, frame);
    }
    RTS_RESULT result = CanSocketSend(can.line.file, frame);
    if (result == ERR_OK) {
        PortWaitNotNow();
    } else if (result == ERR_NOBUFFER) {
        SysTimeWantPass(1); /* poll does not know the queue of the interface: for it there is always room */
    } else if (result == ERR_DEVICE) {
        can.state.bus = CAN_BUS_STOPPED;
    }
    return result;
}

RTS_RESULT SysCanReceive(RTS_UI32 index, CAN_FRAME *frame)
{
    if (!ready(index)) {
        return ERR_NOTHING_TO_DO;
    }
    RTS_RESULT result =
        can.is_slcan ? SlcanReceive(&can.slcan, frame) : CanSocketReceive(can.line.file, frame, &can.state);
    frame->time_us = (RTS_UI32)(SysTimeGetNs() / 1000);
    if (can.is_slcan) {
        if (result != ERR_OK && can.slave < 0) { /* at the other end of a pseudo terminal is a tool */
            SlcanAsk(&can.slcan, SysTimeGetMs());
        }
        return result;
    }
    if (result == ERR_DEVICE) {
        can.state.bus = CAN_BUS_STOPPED;
        return ERR_NOTHING_TO_DO;
    }
    if (result == ERR_OK) {
        PortWaitNotNow();
    }
    return result;
}

void SysCanGetState(RTS_UI32 index, CAN_STATE *state)
{
    *state = can.state;
    if (can.is_slcan) {
        SlcanGetState(&can.slcan, state);
    }
    if (index != 0 || !can.open || can.state.bus == CAN_BUS_STOPPED) {
        state->bus = CAN_BUS_STOPPED;
    }
}

/* The kernel restarts a controller, if its interface has a restart-ms; a process without rights cannot. */
void SysCanRestart(RTS_UI32 index)
{
    if (can.is_slcan && ready(index)) {
        SlcanRestart(&can.slcan);
    }
}
