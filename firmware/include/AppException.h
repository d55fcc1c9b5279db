/*
 * AppException.h - the exception of the application, and how it gets from a task to main.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main only, unless said otherwise. (Shared with the host.)
 */
#ifndef APPEXCEPTION_H
#define APPEXCEPTION_H

#include "CmpStd.h"
#include "SysStart.h"

/* Code outside of tasks. */
enum { APP_IN_INITIALISATION = -1, APP_IN_EVENT = -2, APP_IN_CALL = -3 };

/* The last exception; code RTSEXCPT_NOEXCEPTION when there is none. */
typedef struct {
    RTS_UI32 code;
    RTS_UI32 code_offset; /* fault address in the code segment, APP_NO_CODE_OFFSET when it was elsewhere */
    RTS_I32 task;         /* index of the task, else APP_IN_... */
} APP_EXCEPTION;

#ifndef RTS_CFFI
/* Called by the cycle in the context of the task that failed, when the application is in its safe state: records the
 * exception. What remains (log, outputs that other tasks have written meanwhile, events) follows in CH_COMM_CYCLE. */
void AppHandleException(RTS_I32 task, RTS_UI32 code, uintptr_t address);

/* The words for an RTSEXCPT_* code, for the log. From any context. */
const char *AppExceptionName(RTS_UI32 code);

/* What has happened. `task`: index, else APP_IN_... */
typedef struct {
    RTS_I32 task;
    RTS_UI32 code; /* RTSEXCPT_* */
    uintptr_t address;
} APP_RAISED;

/* Hands over what a task has raised, once; false when there is nothing. */
bool AppExceptionTake(APP_RAISED *raised);

/* The exception the application is in from now on; `where` is for the log; "": not known,
 * because it was in an earlier run. */
void AppExceptionSet(const APP_EXCEPTION *exception, const char *where);

/* Its code is RTSEXCPT_NOEXCEPTION when there is none. */
const APP_EXCEPTION *AppExceptionGet(void);

/* Forgets it, and what a task may have raised; no task runs. */
void AppExceptionClear(void);
#endif

#endif
