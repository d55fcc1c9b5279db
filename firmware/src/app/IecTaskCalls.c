/*
 * IecTaskCalls.c - what a program asks about its tasks, and the watchdog of one that it disables.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IecTaskCalls.h"

#if IEC_TASK_CALLS

#include <string.h>

#include "AppEventIds.h"
#include "AppException.h"
#include "CmpEventMgr.h"
#include "CmpIecTask.h"
#include "CmpTaskLoad.h"

enum { VERSION = 0x00010000, PART_SIZE = 8 };

static struct {
    RTS_UI32 code;
    RTS_UI32 task; /* from 1 */
} last_exception;

#if TASK_LOAD
#define load_of_all() TaskLoadGet(IecTaskGetCount())
#define load_of(task) TaskLoadGet(task)
#define status_of(word) TaskLoadGetStatus(word)
#else
#define load_of_all() IecTaskGetLoad()
#define load_of(task) 0
#define status_of(word) 0
#endif

static RTS_UI32 sum_of_cyclic(bool overruns)
{
    RTS_UI32 sum = 0;
    IEC_TASK_INFO info;

    for (RTS_UI32 i = 0; IecTaskGetInfo(i, &info) == ERR_OK; i++)
        sum += info.kind != KIND_CYCLIC ? 0 : overruns ? info.overruns : info.cycles;
    return sum;
}

static RTS_UI32 value_of_all(RTS_UI32 what)
{
    switch (what) {
    case TASK_VALUE_COUNT:
        return IecTaskGetCount();
    case TASK_VALUE_LOAD:
        return load_of_all();
    case TASK_VALUE_EXCEPTION:
        return last_exception.code;
    case TASK_VALUE_EXCEPTION_TASK:
        return last_exception.task;
    case TASK_VALUE_STATUS:
    case TASK_VALUE_STATUS_MORE:
        return status_of(what - TASK_VALUE_STATUS);
    case TASK_VALUE_ALL_CYCLES:
    case TASK_VALUE_ALL_OVERRUNS:
        return sum_of_cyclic(what == TASK_VALUE_ALL_OVERRUNS);
    default:
        return 0;
    }
}

static RTS_UI32 task_value(RTS_UI32 task, RTS_UI32 what)
{
    IEC_TASK_INFO info;

    if (task == 0)
        return value_of_all(what);
    if (what == TASK_VALUE_WATCHDOG_US)
        return IecCycleGetWatchdog(task - 1);
    if (what == TASK_VALUE_TASK_LOAD)
        return task <= IecTaskGetCount() ? load_of(task - 1) : 0;
    if (IecTaskGetInfo(task - 1, &info) != ERR_OK || what > TASK_VALUE_INTERVAL_US)
        return 0;
    {
        const RTS_UI32 values[] = {info.cycles,    info.last_us,  info.avg_us, info.min_us,   info.max_us,
                                   info.jitter_us, info.overruns, info.kind,   info.priority, info.interval_us};
        return values[what];
    }
}

static RTS_UI64 task_name(RTS_UI32 task, RTS_UI32 part)
{
    RTS_UI64 characters = 0;
    IEC_TASK_INFO info;

    if (task != 0 && IecTaskGetInfo(task - 1, &info) == ERR_OK && part < sizeof info.name / PART_SIZE)
        memcpy(&characters, info.name + PART_SIZE * part, sizeof characters);
    return characters;
}

static RTS_UI8 task_watchdog(RTS_UI32 task, RTS_UI8 on)
{
    return task != 0 && IecCycleLiftWatchdog(task - 1, on == 0);
}

static RTS_UI8 task_schedule(RTS_UI32 task, RTS_UI8 on)
{
    return task != 0 && IecCycleSetScheduled(task - 1, on != 0);
}

APP_GATE(task_value);
APP_GATE(task_name);
APP_GATE(task_watchdog);
APP_GATE(task_schedule);

static const CMP_EXT_FUNCTION functions[] = {
    {"task_value", 0x00423083, VERSION, (RTS_PFN)APP_GATED(task_value)},       /* task_value(UDINT,UDINT):UDINT */
    {"task_name", 0x1E0CD5DF, VERSION, (RTS_PFN)APP_GATED(task_name)},         /* task_name(UDINT,UDINT):LWORD */
    {"task_watchdog", 0x8507EB82, VERSION, (RTS_PFN)APP_GATED(task_watchdog)}, /* task_watchdog(UDINT,BOOL):BOOL */
    {"task_schedule", 0xC0CF238B, VERSION, (RTS_PFN)APP_GATED(task_schedule)}, /* task_schedule(UDINT,BOOL):BOOL */
};

void IecTaskCallsNote(RTS_UI32 task, RTS_UI32 code)
{
    last_exception.code = code;
    last_exception.task = task + 1;
}

static void keep_exception(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    last_exception.code = AppExceptionGet()->code;
    last_exception.task = AppExceptionGet()->task < 0 ? 0 : (RTS_UI32)AppExceptionGet()->task + 1;
}

RTS_RESULT IecTaskCalls_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(last_exception);
    if (hook != CH_INIT3)
        return ERR_OK;
    RTS_RESULT result = EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_CmpApp_Exception, keep_exception, NULL);
    return result == ERR_OK ? CMRegisterExternal(functions, RTS_COUNT(functions)) : result;
}

#endif
