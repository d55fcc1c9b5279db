/*
 * port.h - what main.c tells the Sys components of the Linux port, and they offer it beyond their Sys headers.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef PORT_H
#define PORT_H

#include "CmpItf.h"
#include "SysTimer.h"

/* Where a Port function writes why it failed: one sentence. */
typedef struct {
    char text[256];
    bool busy; /* another process has it: it may be free soon */
} PORT_REASON;

void PortReason(PORT_REASON *reason, const char *format, ...) __attribute__((format(printf, 2, 3)));

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

/* Opens the flash file, or creates it with erased bytes, and locks it. Before CMInit. */
bool PortFlashOpen(const char *path, PORT_REASON *reason);
void PortFlashClose(void);

/* ---- SysCom ---- */

bool PortComKnowsBaud(RTS_UI32 baud);
/* Opens the one serial line: a device, or with path "pty" a new pseudo terminal. Before CMInit. */
bool PortComOpen(const char *path, RTS_UI32 baud, PORT_REASON *reason);
void PortComClose(void);
/* For a process whose child has the line now: closes a device, which the child opens anew when it is lost. A pseudo
 * terminal stays open, so that it outlives the child. */
void PortComHandOver(void);
/* Name of the pseudo terminal, NULL when the line is none. */
const char *PortComPtyName(void);
/* Bytes read and written so far: main sees from it whether there may be more to do. */
RTS_UI32 PortComMoved(void);
/* Sleeps until the line has something to read (or takes more after it was full), `timeout_ms` at most. */
void PortComWait(int timeout_ms);

#endif
