/*
 * SysCom.c - the serial lines of the Linux port: one to be reached by, a device or a pseudo terminal for tests and local
 * tools, and those of field buses.
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
#include "rts_config.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/serial.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <unistd.h>

enum {
    LINES = 1 + PORT_MAX_BUS_LINES + 1 + IEC_COMS, /* with that of --tunnel */
    PATH_SIZE = 256,
};

typedef struct {
    char path[PATH_SIZE]; /* of the device, "" for a pseudo terminal */
    SYSCOM_SETTINGS settings;
    PORT_SOURCE source; /* what is read and written; no file while the device is away */
    bool open;
    RTS_UI32 tried_ms;
    int error;       /* why it could not be opened */
    RTS_I64 byte_ns; /* when bytes were read last */
} LINE;

/* The first one is to be reached by. */
static LINE lines[LINES] = {{.source = {.file = -1}}};

static struct {
    char pty_name[64];
    char link[256]; /* to the pseudo terminal, "" for none */
    int slave;      /* of a pseudo terminal */
    bool configured;
} state = {.slave = -1};

static LINE *const own = &lines[0];

/* ---- opening ---- */

static const struct {
    RTS_UI32 baud;
    speed_t speed;
} speeds[] = {
    {1200, B1200},       {2400, B2400},       {4800, B4800},       {9600, B9600},       {19200, B19200},
    {38400, B38400},     {57600, B57600},     {115200, B115200},   {230400, B230400},   {460800, B460800},
    {500000, B500000},   {921600, B921600},   {1000000, B1000000}, {1500000, B1500000}, {2000000, B2000000},
    {3000000, B3000000}, {4000000, B4000000},
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

static tcflag_t frame_of(const SYSCOM_SETTINGS *wanted)
{
    tcflag_t frame = wanted->stop_bits == 2 ? CSTOPB : 0;
    frame |= wanted->parity != SYSCOM_PARITY_NONE ? PARENB : 0;
    return frame | (wanted->parity == SYSCOM_PARITY_ODD ? PARODD : 0);
}

/* Pseudo terminals have no bits on a line, and refuse a parity. */
static bool is_pty(int file)
{
    enum { FIRST_MAJOR = 136, LAST_MAJOR = 143 };
    struct stat found;
    return fstat(file, &found) == 0 && major(found.st_rdev) >= FIRST_MAJOR && major(found.st_rdev) <= LAST_MAJOR;
}

/* No modem lines. A device that cannot run like that keeps its own settings without saying so. */
static bool make_raw(int file, const SYSCOM_SETTINGS *wanted)
{
    const tcflag_t frame = CSTOPB | PARENB | PARODD;
    struct termios settings;
    struct termios taken;
    if (tcgetattr(file, &settings) != 0) {
        return false;
    }
    cfmakeraw(&settings);
    settings.c_cflag &= ~(CRTSCTS | frame);
    settings.c_cflag |= CLOCAL | CREAD | (is_pty(file) ? 0 : frame_of(wanted));
    cfsetspeed(&settings, *find_speed(wanted->baud));
    if (tcsetattr(file, TCSANOW, &settings) != 0 || tcgetattr(file, &taken) != 0) {
        return false;
    }
    errno = EINVAL;
    return cfgetospeed(&taken) == *find_speed(wanted->baud) && (taken.c_cflag & frame) == (settings.c_cflag & frame);
}

/* Delays, and the level of RTS that drives the bus, are those that the board has. Its own bytes are not heard. */
static void choose_drive(int file, struct serial_rs485 *rs485)
{
    const __u32 levels = SER_RS485_RTS_ON_SEND | SER_RS485_RTS_AFTER_SEND;
    memset(rs485, 0, sizeof(*rs485));
    (void)ioctl(file, TIOCGRS485, rs485);
    if ((rs485->flags & levels) != SER_RS485_RTS_AFTER_SEND) {
        rs485->flags = (rs485->flags & ~levels) | SER_RS485_RTS_ON_SEND;
    }
    rs485->flags = (rs485->flags & ~(__u32)SER_RS485_RX_DURING_TX) | SER_RS485_ENABLED;
}

/* The driver of the device switches RTS, which drives the bus; adapters that do it by themselves need none of it.
 * EOPNOTSUPP: the driver cannot, which some say only by what they have taken over. */
static bool drive_bus(int file, const SYSCOM_SETTINGS *wanted)
{
    struct serial_rs485 rs485;
    if (!wanted->rs485) {
        return true;
    }
    choose_drive(file, &rs485);
    bool taken = ioctl(file, TIOCSRS485, &rs485) == 0;
    if (taken || errno == ENOTTY || errno == EINVAL || errno == ENOSYS) {
        errno = EOPNOTSUPP;
    }
    return taken && (rs485.flags & SER_RS485_ENABLED) != 0;
}

/* A driver that can hands over bytes as they come: an FTDI adapter each 1 ms instead of each 16 ms. Others refuse. */
static void hand_over_at_once(int file)
{
    struct serial_struct port;
    memset(&port, 0, sizeof(port));
    if (ioctl(file, TIOCGSERIAL, &port) != 0 || (port.flags & ASYNC_LOW_LATENCY) != 0) {
        return;
    }
    port.flags |= ASYNC_LOW_LATENCY;
    (void)ioctl(file, TIOCSSERIAL, &port);
}

/* Whether a device that could not be opened is there, but cannot run as its line is to. */
static bool is_unable(int error)
{
    return error == EOPNOTSUPP || error == EINVAL || error == ENOTTY;
}

static const char *text_of(int error)
{
    return error == EOPNOTSUPP ? "its driver cannot switch the direction of the bus (drive); many adapters do it by "
                                 "themselves"
                               : strerror(error);
}

/* TIOCEXCL keeps all out but root, the lock keeps other plcrt and plctool out. */
static bool make_exclusive(int line)
{
    (void)ioctl(line, TIOCEXCL);
    bool locked = flock(line, LOCK_EX | LOCK_NB) == 0;
    errno = EBUSY;
    return locked;
}

static bool open_device(LINE *line)
{
    int file = open(line->path, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    if (file < 0) {
        return false;
    }
    if (!make_exclusive(file) || !make_raw(file, &line->settings) || !drive_bus(file, &line->settings)) {
        int error = errno;
        close(file);
        errno = error;
        return false;
    }
    hand_over_at_once(file);
    (void)tcflush(file, TCIOFLUSH);
    line->source.file = file;
    return true;
}

static bool open_pty(void)
{
    int file = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    own->source.file = file;
    if (file < 0 || grantpt(file) != 0 || unlockpt(file) != 0 ||
        ptsname_r(file, state.pty_name, sizeof(state.pty_name)) != 0) {
        return false;
    }
    state.slave = open(state.pty_name, O_RDWR | O_NOCTTY | O_CLOEXEC);
    return state.slave >= 0 && make_raw(state.slave, &own->settings);
}

/* Where the link leads to, "" if it is none. */
static const char *read_link(char *found, size_t size)
{
    ssize_t length = readlink(state.link, found, size - 1);
    found[length > 0 ? length : 0] = '\0';
    return found;
}

/* Never replaces what is no such link. */
static bool make_link(PORT_REASON *reason)
{
    static const char ptys[] = "/dev/pts/"; /* one left by a plcrt that was killed */
    char found[sizeof(state.pty_name)];
    if (strncmp(read_link(found, sizeof(found)), ptys, sizeof(ptys) - 1) == 0) {
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
    char found[sizeof(state.pty_name)];
    if (state.link[0] != '\0' && strcmp(read_link(found, sizeof(found)), state.pty_name) == 0) {
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

static void forget(LINE *line)
{
    memset(line, 0, sizeof(*line));
    line->source = (PORT_SOURCE){.file = -1, .events = POLLIN};
}

bool PortComOpen(const char *path, RTS_UI32 baud, PORT_REASON *reason)
{
    const char *link = pty_link(path);
    if (!PortComKnowsBaud(baud) || strlen(path) >= sizeof(own->path)) {
        PortReason(reason, "cannot use %s at %u baud", path, (unsigned)baud);
        return false;
    }
    memset(&state, 0, sizeof(state));
    state.slave = -1;
    forget(own);
    own->settings = (SYSCOM_SETTINGS){.baud = baud, .parity = SYSCOM_PARITY_NONE, .stop_bits = 1};
    strcpy(link != NULL ? state.link : own->path, link != NULL ? link : path);
    if (link != NULL ? !open_pty() : !open_device(own) && !PortMayCome(errno, path)) {
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
    if (!PortWaitAdd(&own->source)) {
        PortReason(reason, "cannot wait for %s: PORT_MAX_SOURCES are in use", path);
        PortComClose();
        return false;
    }
    state.configured = true;
    return true;
}

bool PortComIsThere(void)
{
    return own->source.file >= 0;
}

/* TIOCEXCL would hold as long as any process has the device open. */
static void close_device(const LINE *line)
{
    (void)ioctl(line->source.file, TIOCNXCL);
    close(line->source.file);
}

static void release(LINE *line)
{
    PortWaitRemove(&line->source);
    if (line->source.file >= 0) {
        close_device(line);
    }
    line->source.file = -1;
}

void PortComClose(void)
{
    remove_link();
    release(own);
    if (state.slave >= 0) {
        close(state.slave);
    }
    state.slave = -1;
    state.configured = false;
}

void PortComHandOver(void)
{
    if (own->source.file >= 0 && state.slave < 0) {
        close(own->source.file);
        own->source.file = -1;
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

static void lose_device(LINE *line)
{
    LogAdd(CMPID_SysCom, LOG_WARNING, ERR_DEVICE, "Serial device %s is gone", line->path);
    close(line->source.file);
    line->source.file = -1;
    line->source.events = POLLIN;
    line->tried_ms = SysTimeGetMs();
}

/* Once, while it is the same device. */
static void note_unable(LINE *line, int error)
{
    if (is_unable(error) && error != line->error) {
        LogAdd(CMPID_SysCom, LOG_ERROR, ERR_NOT_SUPPORTED, "Serial device %s cannot run with its settings: %s",
               line->path, text_of(error));
    }
    line->error = error;
}

static void look_for_device(LINE *line)
{
    if (SysTimeGetMs() - line->tried_ms < PORT_REOPEN_MS) {
        return;
    }
    line->tried_ms = SysTimeGetMs();
    if (open_device(line)) {
        LogAdd(CMPID_SysCom, LOG_INFO, ERR_OK, "Serial device %s is back", line->path);
    } else {
        note_unable(line, errno);
    }
}

/* The line if it can be used now, or NULL. */
static LINE *ready(RTS_UI32 index)
{
    LINE *line = &lines[index];
    if (index >= LINES || !line->open) {
        return NULL;
    }
    if (line->source.file < 0) {
        look_for_device(line);
    }
    return line->source.file >= 0 ? line : NULL;
}

/* The bytes a read or write moved. Nothing to read and no room are not errors; all else means that the device is
 * gone. */
static RTS_UI32 moved(LINE *line, ssize_t count)
{
    if (count > 0) {
        PortWaitNotNow();
        return (RTS_UI32)count;
    }
    bool later = count < 0 && (errno == EAGAIN || errno == EINTR);
    if (!later && line->path[0] != '\0') {
        lose_device(line);
    }
    return 0;
}

/* ---- SysCom.h ---- */

RTS_UI32 SysComGetCount(void)
{
    return state.configured ? 1 : 0;
}

/* A device that is away is looked for. False: it is there, but cannot run like that. */
static bool open_or_wait(LINE *line)
{
    line->open = true;
    line->tried_ms = SysTimeGetMs();
    if (line->source.file >= 0 || open_device(line)) {
        return true;
    }
    int error = errno;
    note_unable(line, error);
    if (!is_unable(error)) {
        LogAdd(CMPID_SysCom, LOG_WARNING, ERR_DEVICE, "Serial device %s is away: %s", line->path, text_of(error));
    }
    return !is_unable(error);
}

RTS_RESULT SysComOpen(RTS_UI32 index)
{
    if (index >= SysComGetCount()) {
        return ERR_DEVICE;
    }
    (void)open_or_wait(own);
    return ERR_OK;
}

/* Whether a line in use has this path, or the device that it leads to. */
static bool has_device(const LINE *line, const char *path)
{
    int file = line == own && state.slave >= 0 ? state.slave : line->source.file;
    return strcmp(line->path, path) == 0 || PortIsDevice(file, path);
}

static bool is_in_use(const char *path)
{
    bool used = PortCanHas(path) || (state.configured && has_device(own, path));
    for (const LINE *line = lines + 1; line < lines + LINES; line++) {
        used |= line->open && has_device(line, path);
    }
    return used;
}

/* NULL: there are too many. */
static LINE *find_free_line(void)
{
    LINE *line = lines + 1;
    while (line < lines + LINES && line->open) {
        line++;
    }
    return line < lines + LINES ? line : NULL;
}

bool PortComCheck(const char *path, const SYSCOM_SETTINGS *settings, PORT_REASON *reason)
{
    LINE line;
    forget(&line);
    line.settings = *settings;
    if (strlen(path) >= sizeof(line.path) || is_in_use(path)) {
        PortReason(reason, "the serial line %s cannot be used twice: name another one", path);
        return false;
    }
    strcpy(line.path, path);
    if (!open_device(&line)) {
        int error = errno;
        if (PortMayCome(error, path)) {
            return true;
        }
        PortReason(reason, "cannot open serial line %s at %u baud: %s", path, (unsigned)settings->baud, text_of(error));
        reason->busy = error == EBUSY;
        return false;
    }
    close_device(&line);
    return true;
}

RTS_RESULT SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index)
{
    LINE *line = find_free_line();
    if (strlen(name) >= sizeof(line->path) || name[0] == '\0' || line == NULL) {
        return ERR_NO_OBJECT;
    }
    if (!PortComKnowsBaud(settings->baud)) {
        return ERR_NOT_SUPPORTED;
    }
    if (is_in_use(name)) {
        return ERR_DUPLICATE;
    }
    forget(line);
    line->settings = *settings;
    strcpy(line->path, name);
    if (!PortWaitAdd(&line->source)) {
        return ERR_NO_OBJECT;
    }
    *index = (RTS_UI32)(line - lines);
    if (!open_or_wait(line)) {
        SysComClose(*index);
        return ERR_NOT_SUPPORTED;
    }
    return ERR_OK;
}

/* ---- lines of programs ---- */

static struct {
    RTS_UI32 count;
    char path[IEC_COMS][PATH_SIZE];
} program_lines;

bool PortComAllow(const char *list)
{
    program_lines.count = 0; /* those of the command line replace those of --config */
    do {
        size_t length = strcspn(list, ",");
        if (length == 0 || length >= PATH_SIZE || program_lines.count == IEC_COMS) {
            return false;
        }
        char *path = program_lines.path[program_lines.count++];
        memcpy(path, list, length);
        path[length] = '\0';
        list += length;
    } while (*list++ == ',');
    return true;
}

RTS_RESULT SysComOpenProgram(RTS_UI32 number, const SYSCOM_SETTINGS *settings, RTS_UI32 *index)
{
    if (number < 1 || number > program_lines.count) {
        return ERR_NO_OBJECT;
    }
    RTS_RESULT result = SysComOpenPort(program_lines.path[number - 1], settings, index);
    if (result == ERR_OK) { /* a program that does not read what comes would keep main busy */
        PortWaitRemove(&lines[*index].source);
    }
    return result;
}

void SysComClose(RTS_UI32 index)
{
    LINE *line = &lines[index];
    if (index >= LINES || !line->open) {
        return;
    }
    line->open = false;
    if (line != own) {
        release(line);
    }
}

RTS_UI32 SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    LINE *line = size > 0 ? ready(index) : NULL;
    if (line == NULL) {
        return 0;
    }
    RTS_UI32 count = moved(line, read(line->source.file, data, size));
    if (count > 0) {
        line->byte_ns = SysTimeGetNs();
    }
    return count;
}

RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    LINE *line = size > 0 ? ready(index) : NULL;
    if (line == NULL) {
        return 0;
    }
    RTS_UI32 taken = moved(line, write(line->source.file, data, size));
    line->source.events = taken < size ? POLLIN | POLLOUT : POLLIN;
    return taken;
}

/* A tty whose line is slow or away (a gateway in the network, a pseudo terminal) may keep pages of old requests. */
void SysComDiscard(RTS_UI32 index)
{
    LINE *line = index < LINES ? &lines[index] : NULL;
    if (line != NULL && line->open && line->source.file >= 0) {
        (void)tcflush(line->source.file, TCOFLUSH);
        line->source.events = POLLIN;
    }
}

RTS_I64 SysComGetByteNs(RTS_UI32 index)
{
    return index < LINES ? lines[index].byte_ns : 0;
}
