/*
 * IecEvents.c - functions of the program that events call.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IecEvents.h"

#if IEC_EVENTS

#include <string.h>

#include "../load/AppFunctions.h"
#include "AppEventIds.h"
#include "AppException.h"
#include "AppLife.h"
#include "CmpEventMgr.h"
#include "CmpIecTask.h"
#include "SysAtomic.h"

enum {
    EVENT_CLASS = 16, /* an event has its class above its number */
    REGISTERED_CLASS = EVT_StartDone >> EVENT_CLASS,
    NUMBER_MASK = 0xFFFF,
    LARGEST_FUNCTION = 0x7FFF,
};

enum { VERSION = 0x00010000, REASON_SIZE = IEC_REASON_WORDS * 8 + 1, FIRST_PRINTABLE = ' ', DELETE = 0x7F };

static struct {
    IEC_CONTEXT context; /* of what is called */
    uintptr_t entry;
    RTS_UI32 event;
    bool denies;
    char reason[REASON_SIZE]; /* stays readable until the next event */
} program;

/* What the program has registered: the number of an event, and above it that of a function; 0: free. Tasks change it. */
static RTS_UI32 registered[IEC_CALLBACKS];

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

/* The event that calls the function. */
static RTS_UI32 event_current(void)
{
    return program.event;
}

static bool replace_registered(RTS_UI32 from, RTS_UI32 to)
{
    for (RTS_UI32 i = 0; i < IEC_CALLBACKS; i++) {
        if (SysAtomicReplace(&registered[i], from, to))
            return true;
    }
    return false;
}

/* Registers a function for an event, or takes that back. False without room, or if it is not registered. */
static RTS_UI8 event_register(RTS_UI32 event, RTS_UI32 function, RTS_UI8 on)
{
    RTS_UI32 entry = function << EVENT_CLASS | (event & NUMBER_MASK);

    if (event >> EVENT_CLASS != REGISTERED_CLASS || function == 0 || function > LARGEST_FUNCTION)
        return 0;
    if (on == 0)
        return replace_registered(entry, 0);
    return replace_registered(entry, entry) || replace_registered(0, entry);
}

APP_GATE(event_answer);
APP_GATE(event_reason);
APP_GATE(event_register);

static const CMP_EXT_FUNCTION functions[] = {
    {"event_current", 0x3ED1303E, VERSION, (RTS_PFN)event_current}, /* event_current():UDINT */
    /* event_register(UDINT,UDINT,BOOL):BOOL */
    {"event_register", 0xBF96A429, VERSION, (RTS_PFN)APP_GATED(event_register)},
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

/* Calls what the function table has under this identifier. */
static void call_entry(EVENT_PARAM *event, RTS_UI32 identifier)
{
    RTS_UI32 offset = may_be_called() ? AppLoaderFindEvent(AppGetImage(), identifier) : IMAGE_NO_ENTRY;
    RTS_EXCEPTION exception;

    if (offset == IMAGE_NO_ENTRY)
        return;
    program.denies = false;
    program.event = event->event;
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

/* After a function that denies, no other one is called: its reason counts. */
static void call_registered(EVENT_PARAM *event)
{
    for (RTS_UI32 i = 0; i < IEC_CALLBACKS && event->answer == ERR_OK; i++) {
        RTS_UI32 entry = SysAtomicLoad(&registered[i]);
        if (entry != 0 && (entry & NUMBER_MASK) == (event->event & NUMBER_MASK))
            call_entry(event, IEC_CALLBACK + (entry >> EVENT_CLASS));
    }
}

static void call_functions(EVENT_PARAM *event)
{
    call_entry(event, event->event);
    if (event->event >> EVENT_CLASS == REGISTERED_CLASS)
        call_registered(event);
    if (event->event == EVT_PrepareExit)
        CMP_CLEAR(registered);
}

static void clear(void)
{
    CMP_CLEAR(program);
    CMP_CLEAR(registered);
}

RTS_RESULT IecEvents_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        clear();
    if (hook != CH_INIT3)
        return ERR_OK;
    RTS_RESULT result = EventRegisterCallback(CMPID_CmpAppEmbedded, EVENT_ALL, call_functions, NULL);
    return result == ERR_OK ? CMRegisterExternal(functions, RTS_COUNT(functions)) : result;
}

#endif
