/*
 * AppException.h - the exception of the application, and how it gets from a task to main.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main only; AppHandleException, which tasks call, is in CmpAppEmbedded.h.
 */
#ifndef APPEXCEPTION_H
#define APPEXCEPTION_H

#include "CmpAppEmbedded.h"

/* What has happened. `task`: index, -1 in initialisation code. */
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
