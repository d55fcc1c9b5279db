/*
 * SysStart.h - why the runtime starts, as far as the port knows.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * AppBoot.c decides by it whether the application that ran before may run again: only a failure of the program itself
 * counts against it, never the loss of power. From main only; constant after CH_INIT_SYSTEM.
 */
#ifndef SYSSTART_H
#define SYSSTART_H

#include "CmpStd.h"

enum {
    /* Power came, a button was pressed, the previous run ended in good order, or the whole process was killed from
     * outside: counts against nothing. */
    SYS_START_POWER = 0,
    /* The previous run crashed: a watchdog reset, a lockup, a signal in the worker. Counts against the application
     * that ran or was being initialised. */
    SYS_START_CRASH = 1,
    /* The port cannot tell the two apart. Counts only when the initialisation of the application was not finished, and
     * that twice in a row. */
    SYS_START_UNKNOWN = 2,
};

/* What becomes of the boot project. One that stays stopped is loaded but not called, until it is started by a user, or
 * until the next start. */
enum {
    SYS_BOOT_START = 0,
    SYS_BOOT_STOPPED = 1,
    SYS_BOOT_PROVEN = 2, /* started if it has proven itself, else it stays stopped */
};

/* The code offset is not known, or not that of application code. */
#ifdef RTS_CFFI
static const RTS_UI32 APP_NO_CODE_OFFSET;
#else
#define APP_NO_CODE_OFFSET 0xFFFFFFFFu
#endif

typedef struct {
    RTS_UI8 cause; /* SYS_START_* */
    /* SYS_BOOT_*. For a port whose restart after a crash is not a decision of the user (Linux), and for a button that
     * says so; with APP_MAY_STAY_STOPPED. */
    RTS_UI8 stay_stopped;
    /* What follows describes a crash. */
    RTS_I16 task;         /* index of the task, -1: in none, but in initialisation or the runtime itself */
    RTS_UI32 exception;   /* RTSEXCPT_*, RTSEXCPT_NOEXCEPTION when it is not known */
    RTS_UI32 code_offset; /* in the code segment of the application, APP_NO_CODE_OFFSET */
    const char *text;     /* "signal SIGSEGV", "hardware watchdog"; never NULL, "" when there is nothing to say */
} SYS_START;

const SYS_START *SysStartGet(void);

#endif
