/*
 * IecTaskHandler.c - a function of the program that decides what follows an exception of a task.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Main looks for the function before tasks start, because reading the image takes long. After an online change the code is
 * elsewhere until main has looked again: an exception that comes in between ends the program.
 */
#include "IecTaskHandler.h"

#if IEC_TASK_HANDLER

#include <string.h>

#include "../load/AppFunctions.h"
#include "AppEventIds.h"
#include "AppException.h"
#include "AppLife.h"
#include "CmpEventMgr.h"
#include "CmpIecTask.h"
#include "CmpLog.h"
#include "IecTaskCalls.h"
#include "SysAtomic.h"

enum { VERSION = 0x00010000 };
RTS_STATIC_ASSERT(IEC_TASK_CALLS, set_IEC_TASK_CALLS_or_no_IEC_TASK_HANDLER);

static struct {
    const RTS_UI8 *code; /* in which `offset` is */
    RTS_UI32 offset;     /* IMAGE_NO_ENTRY: the program has no such function */
    bool goes_on[APP_MAX_TASKS];
} handler;

static RTS_UI8 task_answer(RTS_UI32 task, RTS_UI8 goes_on)
{
    if (task != 0 && task <= APP_MAX_TASKS)
        handler.goes_on[task - 1] = goes_on != 0;
    return goes_on;
}

APP_GATE(task_answer);

static const CMP_EXT_FUNCTION functions[] = {
    {"task_answer", 0xBC382BDC, VERSION, (RTS_PFN)APP_GATED(task_answer)}, /* task_answer(UDINT,BOOL):BOOL */
};

static uintptr_t begin(RTS_UI32 task, const IEC_CONTEXT *context, RTS_UI32 code)
{
    if (handler.offset == IMAGE_NO_ENTRY || handler.code != context->area[APP_AREA_CODE])
        return 0;
    handler.goes_on[task] = false;
    IecTaskCallsNote(task, code);
    return (uintptr_t)handler.code + handler.offset;
}

static bool end(RTS_UI32 task, RTS_UI32 code)
{
    IEC_TASK_INFO info;

    if (handler.goes_on[task] && IecCycleGetInfo(task, &info) == ERR_OK)
        LogAdd(CMPID_IecTaskHandler, LOG_ERROR, code, "%s: %s; the program goes on", info.name, AppExceptionName(code));
    return handler.goes_on[task];
}

static const IEC_CYCLE_HANDLER callbacks = {begin, end};

static void look(EVENT_PARAM *event)
{
    const RTS_UI8 *code = AppGetContext()->area[APP_AREA_CODE];

    if (event->event != EVT_PrepareStart && event->event != EVT_OnlineChangeDone)
        return;
    if (AppGetState() == AS_NONE)
        return;
    handler.code = NULL;
    handler.offset = AppLoaderFindEvent(AppGetImage(), EVT_TaskException);
    handler.code = code;
}

RTS_RESULT IecTaskHandler_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(handler);
    if (hook != CH_INIT3)
        return ERR_OK;
    handler.offset = IMAGE_NO_ENTRY;
    IecCycleSetHandler(&callbacks);
    RTS_RESULT result = EventRegisterCallback(CMPID_CmpAppEmbedded, EVENT_ALL, look, NULL);
    return result == ERR_OK ? CMRegisterExternal(functions, RTS_COUNT(functions)) : result;
}

#endif
