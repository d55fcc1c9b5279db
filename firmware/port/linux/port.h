/*
 * port.h - what main.c passes to the Sys components of the Linux port, and they offer it beyond their Sys headers.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef PORT_H
#define PORT_H

#include "CmpItf.h"
#include "SysCom.h"
#include "SysSocket.h"
#include "SysTimer.h"

/* Where a Port function writes why it failed: one sentence. */
typedef struct {
    char text[256];
    bool busy; /* another process has it: it may be free soon */
} PORT_REASON;

void PortReason(PORT_REASON *reason, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* The priorities of syslog. */
typedef enum { PORT_CRITICAL = 2, PORT_ERROR = 3, PORT_WARNING = 4, PORT_INFO = 6, PORT_DEBUG = 7 } PORT_LEVEL;

/* Prints a line to stderr, in one write: "plcrt: ..." for a terminal, "<4>..." with the priority for the journal of
 * systemd. Control characters become blanks. */
void PortPrint(PORT_LEVEL level, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* True if stderr is the journal: JOURNAL_STREAM has its device and inode. */
bool PortIsJournal(void);

/* Whether what could not be opened, by errno, may come later: a device that is not plugged in. A path outside of /dev that
 * is not a link either leads to no device. */
bool PortMayCome(int error, const char *path);

/* Whether `path` leads to the device that is open as `file`: a device may have several names (links of udev). */
bool PortIsDevice(int file, const char *path);

/* ---- the wait of main ---- */

/*
 * Something that main waits for between two passes of CH_COMM_CYCLE: a serial line, a socket, an edge of an input. What
 * opened it keeps the record, may change it at any time, and looks in CH_COMM_CYCLE whether there is something to do.
 * So its latency is that of a pass, not PORT_IDLE_MS, which is how often main looks at time. All from main.
 */
typedef struct {
    int file;     /* -1: there is nothing to wait for now */
    short events; /* POLLIN; POLLOUT while it has to take more, POLLPRI for what says so */
} PORT_SOURCE;

/* False when PORT_MAX_SOURCES are there. Adding one again does nothing, as does removing one that is not there. */
bool PortWaitAdd(const PORT_SOURCE *source);
void PortWaitRemove(const PORT_SOURCE *source);
/* In this pass something was done after which there may be more to do: the next PortWait does not wait. */
void PortWaitNotNow(void);
/* The running PortWait ends, or the next one does not wait. From any thread; before the first one it does nothing. */
void PortWaitNudge(void);
/* Waits until one of them is ready, or a signal comes, `timeout_ms` at most, or less if a component wants it
 * (SysTimeWantPass). Returns whether there may be something to
 * do. */
bool PortWait(int timeout_ms);

/* ---- SysTime ---- */

/* Sets the start of SysTimeGetNs to now. */
RTS_RESULT SysTime_Hook(CMP_HOOK hook);
/* The CLOCK_MONOTONIC value of a SysTimeGetNs value. */
RTS_I64 PortMonotonicNs(RTS_I64 time_ns);

/* ---- SysTimer ---- */

RTS_RESULT SysTimer_Hook(CMP_HOOK hook);
/* SysTimerCreate with a SCHED_FIFO priority. */
RTS_RESULT PortTimerCreate(SYS_TIMER_CALLBACK callback, void *param, RTS_UI32 interval_us, int fifo_priority,
                           RTS_HANDLE *timer);

/* ---- SysWatchdog ---- */

/* Once in each pass of the main loop: it sees from it that main has a processor. */
void PortMainPass(void);

/* ---- SysEvent ---- */

/* Takes "NAME=PIPE", which stays, and opens the pipe; creates it when there is none. Before CMInit. */
bool PortEventOpen(char *name_and_path, PORT_REASON *reason);
void PortEventClose(void);

/* ---- SysFlash ---- */

/* Opens the flash file, or creates it with erased bytes, for its owner alone, and locks it. Before CMInit. */
bool PortFlashOpen(const char *path, PORT_REASON *reason);
/* Whether users other than its owner may read or write it. */
bool PortFlashIsShared(void);
void PortFlashClose(void);

/* ---- SysCom ---- */

bool PortComKnowsBaud(RTS_UI32 baud);
/* Opens the one serial line: a device, with path "pty" a new pseudo terminal, with "pty:LINK" one that the symbolic link
 * LINK leads to until PortComClose. A link to a pseudo terminal is replaced, another file is an error. A device that may
 * come later is looked for as one that is gone. Before CMInit. */
bool PortComOpen(const char *path, RTS_UI32 baud, PORT_REASON *reason);
/* Whether the line is open; false also without one. */
bool PortComIsThere(void);
void PortComClose(void);
/* For a process whose child has the line now: closes a device, which the child opens again when it is lost. A pseudo
 * terminal stays open, so that it outlives the child. */
void PortComHandOver(void);
/* Whether SysComOpenPort will be able to open a line like that, now or when its device comes. */
/* The lines that programs may open as ports 1, 2 ..: "PATH,PATH..". False if the list is not valid. */
bool PortComAllow(const char *list);
bool PortComCheck(const char *path, const SYSCOM_SETTINGS *settings, PORT_REASON *reason);
/* Name of the pseudo terminal, which is its link if it has one; NULL when the line is none. */
const char *PortComPtyName(void);

/* ---- SysCan ---- */

typedef struct {
    RTS_UI32 node;          /* 1..127 */
    RTS_UI32 base;          /* of the identifiers */
    RTS_UI32 bit_rate;      /* of an adapter; interfaces of the kernel have their own */
    RTS_UI32 data_bit_rate; /* not 0: FD frames are sent */
} PORT_CAN_OPTIONS;

/* Opens the one CAN controller: an interface of the kernel, "slcan:PATH" for an adapter on a serial line, "slcan:pty" for
 * a new pseudo terminal. An interface or adapter that may come later is looked for as one that is gone, an interface that
 * is down too. Before CMInit. */
bool PortCanOpen(const char *text, const PORT_CAN_OPTIONS *options, PORT_REASON *reason);
/* Why it is not open, in words; NULL if it is. */
const char *PortCanAway(void);
void PortCanClose(void);
/* As PortComHandOver. */
void PortCanHandOver(void);
/* Whether CAN is on the serial line of this path. */
bool PortCanHas(const char *path);
/* Name of the pseudo terminal, NULL when there is none. */
const char *PortCanPtyName(void);

/* ---- SysTime ---- */

/* Lets programs set the clock of the machine, if the system lets plcrt. Before CMInit. */
void PortClockMaySet(void);

/* ---- SysTarget ---- */

/* The name of the device in a scan; the text stays. Before CMInit. */
void PortTargetSetName(const char *name);
/* The board that this machine is; the text stays. Before CMInit. */
void PortTargetSetBoard(const char *name);

/* ---- SysSocket ---- */

/* For TCP "[ADDRESS:]PORT" or "ADDRESS", for UDP "ADDRESS[:PORT]" (UDP_PORT and the UDP_PORTS - 1 after it). Without an
 * address it is 127.0.0.1; 0.0.0.0 means all addresses of the machine. TCP port 0 is a free port; without a UDP port the
 * first free one is used. ...Knows: whether the text is valid; ...Open: opens the socket. Before CMInit. */
bool PortTcpKnows(const char *text, SOCKADDRESS *place);
bool PortUdpKnows(const char *text, SOCKADDRESS *place, bool *numbered);
bool PortTcpOpen(const char *text, PORT_REASON *reason);
bool PortUdpOpen(const char *text, PORT_REASON *reason);
void PortSockClose(void);
/* The address at which a socket listens, 0 for all of the machine; false if it is not open. */
bool PortSockAddress(SYSSOCK_PURPOSE purpose, SOCKADDRESS *own);
/* Binds a socket of a program (SysNet.h); errors as SysSockListen. */
RTS_RESULT PortSockBind(const SOCKADDRESS *own, RTS_HANDLE *socket);
/* Main no longer waits for a socket. */
void PortSockQuiet(RTS_HANDLE socket);
/* The events that poll() reports of a socket, without waiting; *waiting: bytes that can be read. */
short PortSockPoll(RTS_HANDLE socket, RTS_UI32 *waiting);
/* Does what SysNetPeek does (SysNet.h). */
RTS_RESULT PortSockPeek(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received);
/* Lets programs reach the addresses of a list "ADDRESS[/BITS][:PORT[-PORT]],..."; without one those of this machine. False
 * if the list is not valid. */
bool PortNetAllow(const char *text);
/* Where a socket listens, as "127.0.0.1:11740"; false if it is not open. */
bool PortSockName(SYSSOCK_PURPOSE purpose, char *name, size_t size);

/* ---- SysMdns ---- */

/* Opens the socket on which this device announces its TCP port by multicast DNS. Before CMInit. */
bool PortMdnsOpen(PORT_REASON *reason);
void PortMdnsClose(void);

#endif
