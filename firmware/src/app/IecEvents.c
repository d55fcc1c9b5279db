/*
 * IecEvents.c - functions of the program that events call.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IecEvents.h"

#if IEC_EVENTS

#include <string.h>

#include "../load/AppFunctions.h"
#include "AppException.h"
#include "AppLife.h"
#include "CmpEventMgr.h"
#include "CmpIecTask.h"

enum { VERSION = 0x00010000, REASON_SIZE = IEC_REASON_WORDS * 8 + 1, FIRST_PRINTABLE = ' ', DELETE = 0x7F };

static struct {
    IEC_CONTEXT context; /* of what is called */
    uintptr_t entry;
    bool denies;
    char reason[REASON_SIZE]; /* stays readable until the next event */
} program;

/* ---- what the program calls ---- */

static RTS_UI8 event_answer(RTS_UI8 denies)
{
    program.denies = denies != 0;
    return denies;
}

/* The words come by value, so no address of the program is read with the rights of the runtime. */
static RTS_UI8 event_reason(RTS_UI64 word0, RTS_UI64 word1, RTS_UI64 word2, RTS_UI64 word3, RTS_UI64 word4,
                            RTS_UI64 word5, RTS_UI64 word6, RTS_UI64 word7)
{
    const RTS_UI64 words[IEC_REASON_WORDS] = {word0, word1, word2, word3, word4, word5, word6, word7};
    RTS_SIZE i;

    memcpy(program.reason, words, sizeof words);
    for (i = 0; program.reason[i] != '\0'; i++) {
        if ((RTS_UI8)program.reason[i] < FIRST_PRINTABLE || program.reason[i] == DELETE)
            program.reason[i] = ' ';
    }
    return 1;
}

APP_GATE(event_answer);
APP_GATE(event_reason);

static const CMP_EXT_FUNCTION functions[] = {
    {"event_answer", 0xAF97D9BD, VERSION, (RTS_PFN)APP_GATED(event_answer)}, /* event_answer(BOOL):BOOL */
    /* event_reason(LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD,LWORD):BOOL */
    {"event_reason", 0x40D3C57E, VERSION, (RTS_PFN)APP_GATED(event_reason)},
};

/* ---- the call ---- */

static void call(void *arg)
{
    RTS_UNUSED(arg);
    APP_CALL_ENTRY((IEC_ENTRY)program.entry, &program.context);
}

static bool may_be_called(void)
{
    return AppGetState() != AS_NONE && AppIsInitialised() && !AppHasException();
}

/* The exception is complete at once: what follows the event goes by it. */
static void fail(const RTS_EXCEPTION *exception)
{
    AppHandleException(APP_IN_EVENT, exception->code, exception->address);
    AppHandlePendingException();
}

static void call_function(EVENT_PARAM *event)
{
    RTS_UI32 offset = may_be_called() ? AppLoaderFindEvent(AppGetImage(), event->event) : IMAGE_NO_ENTRY;
    RTS_EXCEPTION exception;

    if (offset == IMAGE_NO_ENTRY)
        return;
    program.denies = false;
    program.reason[0] = '\0';
    program.context = *AppGetContext();
    program.entry = ((uintptr_t)program.context.area[APP_AREA_CODE] + offset) | APP_ENTRY_MODE_BIT;
    IecCycleSetTime(&program.context);
    if (!IecTaskRunGuarded(call, &program, &exception)) {
        fail(&exception);
    } else if (program.denies) {
        event->answer = ERR_OPERATION_DENIED;
        event->reason = program.reason[0] != '\0' ? program.reason : "the program denies it";
    }
}

RTS_RESULT IecEvents_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(program);
    if (hook != CH_INIT3)
        return ERR_OK;
    RTS_RESULT result = EventRegisterCallback(CMPID_CmpAppEmbedded, EVENT_ALL, call_function, NULL);
    return result == ERR_OK ? CMRegisterExternal(functions, RTS_COUNT(functions)) : result;
}

#endif
