/*
 * AppException.c - the exception of the application, and how it gets from a task to main.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppException.h"

#include <string.h>

#include "CmpLog.h"
#include "SysAtomic.h"
#include "SysExcept.h"

static struct {
    APP_EXCEPTION current;
    RTS_UI32 claims;  /* how many contexts had an exception since the last was cleared */
    RTS_UI32 pending; /* `raised` is complete and waits for main */
    APP_RAISED raised;
} state;

const char *AppExceptionName(RTS_UI32 code)
{
    static const struct {
        RTS_UI32 code;
        const char *name;
    } names[] = {
        {RTSEXCPT_BOOTPROJECT_CRASH, "crash"},
        {RTSEXCPT_WATCHDOG, "watchdog expired"},
        {RTSEXCPT_DIVIDEBYZERO, "division by zero"},
        {RTSEXCPT_ARRAYBOUNDS, "index out of range"},
        {RTSEXCPT_ACCESS_VIOLATION, "access violation"},
        {RTSEXCPT_ILLEGAL_INSTRUCTION, "illegal instruction"},
        {RTSEXCPT_PRIV_INSTRUCTION, "privileged instruction"},
#if !RTS_ONE_CORE
        {RTSEXCPT_STOP_TIMEOUT, "did not end in time for a stop, aborted"},
#endif
        {RTSEXCPT_STACK_OVERFLOW, "stack overflow"},
        {RTSEXCPT_MISALIGNMENT, "misaligned access"},
        {RTSEXCPT_OVERFLOW, "overflow"},
        {RTSEXCPT_FPU_ERROR, "floating point error"},
#if TASK_LOAD
        {RTSEXCPT_PROCESSORLOAD_WATCHDOG, "processor load above MaxProcessorLoad"},
#endif
    };
    RTS_SIZE i;

    for (i = 0; i < RTS_COUNT(names); i++) {
        if (names[i].code == code)
            return names[i].name;
    }
    return "exception";
}

void AppHandleException(RTS_I32 task, RTS_UI32 code, uintptr_t address)
{
    if (SysAtomicAdd(&state.claims, 1) != 0)
        return; /* another task was first: one exception stops everything */
    state.raised.task = task;
    state.raised.code = code;
    state.raised.address = address;
    SysAtomicStore(&state.pending, 1);
}

bool AppExceptionTake(APP_RAISED *raised)
{
    if (!SysAtomicLoad(&state.pending))
        return false;
    *raised = state.raised;
    SysAtomicStore(&state.pending, 0);
    return true;
}

void AppExceptionSet(const APP_EXCEPTION *exception, const char *where)
{
    const char *name = AppExceptionName(exception->code);

    if (where[0] == '\0')
        where = "Before this start";

    state.current = *exception;
    if (exception->code_offset == APP_NO_CODE_OFFSET)
        LogAdd(CMPID_CmpAppEmbedded, LOG_EXCEPTION, exception->code, "%s: %s", where, name);
    else
        LogAdd(CMPID_CmpAppEmbedded, LOG_EXCEPTION, exception->code, "%s: %s at code offset 0x%X", where, name,
               (unsigned)exception->code_offset);
}

const APP_EXCEPTION *AppExceptionGet(void)
{
    return &state.current;
}

void AppExceptionClear(void)
{
    memset(&state.current, 0, sizeof state.current);
    SysExceptForgetTrace();
    SysAtomicStore(&state.pending, 0);
    SysAtomicStore(&state.claims, 0);
}
