/*
 * SysCan.c - the one CAN controller of the Linux port: an interface of the kernel, or SLCAN on a serial line.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * An interface or adapter may go away and come back: it is opened again. A pseudo terminal stays open.
 *
 * With an urgent handler a thread receives (SysCanSetUrgent): 11-bit frames go to the handler, all others to a ring for
 * main, which then waits for the ring instead of the line. `lock` is held where the line is used: main, tasks that send,
 * the thread; the log is written without it.
 */
#define _GNU_SOURCE
#include "SysCan.h"

#include "CanSocket.h"
#include "CmpLog.h"
#include "CmpSrvNumbers.h"
#include "Slcan.h"
#include "SysAtomic.h"
#include "SysTime.h"
#include "port.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

enum { FILTERS = CAN_FILTERS, RING = 512, LOOK_MS = 100, SLCAN_BACKLOG = 256 };

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
    pthread_t main;
} can = {.line = {.file = -1}, .slave = -1};

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static struct {
    PF_CAN_URGENT handler;
    pthread_t thread;
    bool runs;
    RTS_UI32 ends;
    int nudge;         /* makes the thread look at the line and `ends` */
    PORT_SOURCE ready; /* frames are in the ring */
    RTS_UI32 written;
    RTS_UI32 read;
    RTS_UI32 lost;
    CAN_FRAME ring[RING];
} urgent = {.nudge = -1, .ready = {.file = -1, .events = POLLIN}};

/* What main waits for is main's. */
static bool is_main(void)
{
    return pthread_equal(pthread_self(), can.main) != 0;
}

static void not_now(void)
{
    if (is_main()) {
        PortWaitNotNow();
    }
}

static void signal_event(int event)
{
    const RTS_UI64 one = 1;
    if (event >= 0 && write(event, &one, sizeof(one)) < 0 && errno != EAGAIN) {
        SysAtomicAdd(&urgent.lost, 1);
    }
}

static void clear_event(int event)
{
    RTS_UI64 count;
    while (read(event, &count, sizeof(count)) > 0) {
    }
}

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
        not_now();
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
    if (taken < size && urgent.runs) {
        signal_event(urgent.nudge);
    }
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
    close_line();
    can.state.bus = CAN_BUS_STOPPED;
    can.tried_ms = SysTimeGetMs();
}

/* True if it is back. */
static bool look_for_line(void)
{
    if (SysTimeGetMs() - can.tried_ms < PORT_REOPEN_MS) {
        return false;
    }
    can.tried_ms = SysTimeGetMs();
    return open_line() && begin() == ERR_OK;
}

/* In main: opens the line again, and says what has become of it. */
static void mind_line(void)
{
    pthread_mutex_lock(&lock);
    bool gone = can.line.file >= 0 && can.state.bus == CAN_BUS_STOPPED;
    if (gone) {
        lose_line();
    }
    bool back = can.line.file < 0 && look_for_line();
    pthread_mutex_unlock(&lock);
    if (gone) {
        LogAdd(CMPID_SysCan, LOG_WARNING, ERR_DEVICE, "CAN %s is gone", can.name);
    }
    if (back) {
        LogAdd(CMPID_SysCan, LOG_INFO, ERR_OK, "CAN %s is back", can.name);
        signal_event(urgent.nudge);
    }
}

static bool is_ready(RTS_UI32 index)
{
    return index == 0 && can.open && can.line.file >= 0 && can.state.bus != CAN_BUS_STOPPED;
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
    can.main = pthread_self();
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

static RTS_RESULT set_filters(const CAN_FILTER *filters, RTS_UI32 count)
{
    memcpy(can.filter, filters, count * sizeof(*filters));
    can.filters = count;
    if (can.is_slcan) {
        return SlcanSetFilters(&can.slcan, filters, count);
    }
    return can.line.file < 0 || CanSocketSetFilters(can.line.file, filters, count) ? ERR_OK : ERR_DEVICE;
}

RTS_RESULT SysCanSetFilters(RTS_UI32 index, const CAN_FILTER *filters, RTS_UI32 count)
{
    if (index != 0 || count > FILTERS) {
        return ERR_DEVICE;
    }
    pthread_mutex_lock(&lock);
    RTS_RESULT result = set_filters(filters, count);
    pthread_mutex_unlock(&lock);
    return result;
}

/* ---- sending ---- */

/* True if the line has many bytes that it has not sent yet. */
static bool is_line_busy(void)
{
    int backlog = 0;
    return ioctl(can.line.file, TIOCOUTQ, &backlog) == 0 && backlog > SLCAN_BACKLOG;
}

/* What the line has taken leaves in order, so frames of 29 bits that would wait there for long wait here. */
static RTS_RESULT send_slcan(const CAN_FRAME *frame)
{
    if (urgent.runs && (frame->flags & CAN_FLAG_EXTENDED) != 0 && is_line_busy()) {
        return ERR_NOBUFFER;
    }
    return SlcanSend(&can.slcan, frame);
}

static RTS_RESULT send_socket(const CAN_FRAME *frame)
{
    RTS_RESULT result = CanSocketSend(can.line.file, frame);
    if (result == ERR_OK) {
        not_now();
    } else if (result == ERR_DEVICE) {
        can.state.bus = CAN_BUS_STOPPED;
    }
    return result;
}

RTS_RESULT SysCanSend(RTS_UI32 index, const CAN_FRAME *frame)
{
    if (!CanIsFrame(frame)) {
        return ERR_PARAMETER;
    }
    pthread_mutex_lock(&lock);
    RTS_RESULT result = ERR_DEVICE;
    if (is_ready(index) && can.state.bus != CAN_BUS_OFF) {
        result = can.is_slcan ? send_slcan(frame) : send_socket(frame);
    }
    pthread_mutex_unlock(&lock);
    if (result == ERR_NOBUFFER && is_main() && (urgent.runs || !can.is_slcan)) {
        SysTimeWantPass(1); /* poll does not know the queue of the interface: for it there is always room */
    }
    return result;
}

/* ---- receiving ---- */

/* A frame from the line, with `lock`. */
static RTS_RESULT receive(CAN_FRAME *frame)
{
    RTS_RESULT result =
        can.is_slcan ? SlcanReceive(&can.slcan, frame) : CanSocketReceive(can.line.file, frame, &can.state);
    frame->time_us = (RTS_UI32)(SysTimeGetNs() / 1000);
    if (result == ERR_DEVICE) {
        can.state.bus = CAN_BUS_STOPPED;
        return ERR_NOTHING_TO_DO;
    }
    if (result == ERR_OK && !can.is_slcan) {
        not_now();
    }
    return result;
}

static RTS_RESULT receive_locked(CAN_FRAME *frame)
{
    pthread_mutex_lock(&lock);
    RTS_RESULT result = ERR_NOTHING_TO_DO;
    if (is_ready(0)) {
        result = receive(frame);
    }
    pthread_mutex_unlock(&lock);
    return result;
}

static RTS_RESULT take_from_ring(CAN_FRAME *frame)
{
    if (SysAtomicLoad(&urgent.written) == urgent.read) {
        clear_event(urgent.ready.file);
    }
    if (SysAtomicLoad(&urgent.written) == urgent.read) {
        return ERR_NOTHING_TO_DO;
    }
    *frame = urgent.ring[urgent.read % RING];
    SysAtomicStore(&urgent.read, urgent.read + 1);
    PortWaitNotNow();
    return ERR_OK;
}

RTS_RESULT SysCanReceive(RTS_UI32 index, CAN_FRAME *frame)
{
    if (index != 0 || !can.open) {
        return ERR_NOTHING_TO_DO;
    }
    mind_line();
    RTS_RESULT result = urgent.runs ? take_from_ring(frame) : receive_locked(frame);
    if (result != ERR_OK && can.is_slcan && can.slave < 0) { /* at the other end of a pseudo terminal is a tool */
        pthread_mutex_lock(&lock);
        if (is_ready(index)) {
            SlcanAsk(&can.slcan, SysTimeGetMs());
        }
        pthread_mutex_unlock(&lock);
    }
    return result;
}

/* ---- the thread ---- */

static void add_to_ring(const CAN_FRAME *frame)
{
    if (urgent.written - SysAtomicLoad(&urgent.read) >= RING) {
        SysAtomicAdd(&urgent.lost, 1);
        return;
    }
    urgent.ring[urgent.written % RING] = *frame;
    SysAtomicStore(&urgent.written, urgent.written + 1);
    signal_event(urgent.ready.file);
}

static void deliver_all(void)
{
    CAN_FRAME frame;
    while (receive_locked(&frame) == ERR_OK) {
        if ((frame.flags & CAN_FLAG_EXTENDED) != 0 || !urgent.handler(0, &frame)) {
            add_to_ring(&frame);
        }
    }
}

static void *run_thread(void *unused)
{
    RTS_UNUSED(unused);
    while (SysAtomicLoad(&urgent.ends) == 0) {
        pthread_mutex_lock(&lock);
        struct pollfd polled[] = {{.fd = is_ready(0) ? can.line.file : -1, .events = can.line.events},
                                  {.fd = urgent.nudge, .events = POLLIN}};
        pthread_mutex_unlock(&lock);
        if (poll(polled, RTS_COUNT(polled), LOOK_MS) > 0 && polled[1].revents != 0) {
            clear_event(urgent.nudge);
        }
        deliver_all();
    }
    return NULL;
}

/* Without the right to SCHED_FIFO it has the priority of others, as the timers have then. */
static bool create_thread(bool realtime)
{
    const struct sched_param parameters = {.sched_priority = PORT_PRIORITY_EVENTS};
    pthread_attr_t attributes;
    sigset_t all, before;
    sigfillset(&all);
    pthread_attr_init(&attributes);
    if (realtime) {
        pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
        pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
        pthread_attr_setschedparam(&attributes, &parameters);
    }
    pthread_sigmask(SIG_SETMASK, &all, &before);
    int error = pthread_create(&urgent.thread, &attributes, run_thread, NULL);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    pthread_attr_destroy(&attributes);
    return error == 0;
}

static void close_event(int *event)
{
    if (*event >= 0) {
        close(*event);
    }
    *event = -1;
}

static void start_thread(void)
{
    urgent.ends = urgent.written = urgent.read = 0;
    urgent.nudge = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    urgent.ready.file = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
    urgent.runs = urgent.nudge >= 0 && urgent.ready.file >= 0 && PortWaitAdd(&urgent.ready);
    urgent.runs = urgent.runs && (create_thread(true) || create_thread(false));
    if (urgent.runs) {
        PortWaitRemove(&can.line);
        return;
    }
    LogAdd(CMPID_SysCan, LOG_ERROR, ERR_NOMEMORY, "CAN %s has no thread: 11-bit frames are lost", can.name);
    PortWaitRemove(&urgent.ready);
    close_event(&urgent.nudge);
    close_event(&urgent.ready.file);
}

static void stop_thread(void)
{
    SysAtomicStore(&urgent.ends, 1);
    signal_event(urgent.nudge);
    (void)pthread_join(urgent.thread, NULL);
    urgent.runs = false;
    PortWaitRemove(&urgent.ready);
    close_event(&urgent.nudge);
    close_event(&urgent.ready.file);
    if (can.configured) {
        (void)PortWaitAdd(&can.line); /* the place that it had */
    }
}

void SysCanSetUrgent(RTS_UI32 index, PF_CAN_URGENT handler)
{
    if (index != 0) {
        return;
    }
    if (urgent.runs) {
        stop_thread();
    }
    urgent.handler = handler;
    if (handler != NULL) {
        start_thread();
    }
}

/* ---- state ---- */

void SysCanGetState(RTS_UI32 index, CAN_STATE *state)
{
    pthread_mutex_lock(&lock);
    *state = can.state;
    if (can.is_slcan) {
        SlcanGetState(&can.slcan, state);
    }
    if (index != 0 || !can.open || can.state.bus == CAN_BUS_STOPPED) {
        state->bus = CAN_BUS_STOPPED;
    }
    pthread_mutex_unlock(&lock);
    state->lost += SysAtomicLoad(&urgent.lost);
}

/* The kernel restarts a controller, if its interface has a restart-ms; a process without rights cannot. */
void SysCanRestart(RTS_UI32 index)
{
    pthread_mutex_lock(&lock);
    if (can.is_slcan && is_ready(index)) {
        SlcanRestart(&can.slcan);
    }
    pthread_mutex_unlock(&lock);
}
