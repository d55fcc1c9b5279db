/*
 * CmpAppCalls.c - what a program asks for in one cycle and gets in a later one.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpAppCalls.h"

#if APP_CALLS > 0

#include <string.h>

#include "AppEventIds.h"
#include "CmpEventMgr.h"
#include "IecCycle.h"
#include "SysAtomic.h"
#include "SysMain.h"
#include "SysTime.h"

enum {
    VERSION = 0x00010000,
    SLOTS = 256, /* in the number of a call: its slot, and how many calls there were before */
    PART_WORDS = APP_CALL_PART / 8,
};

/* Who has a slot: no one, a task, main, the task that is to fetch the result. */
enum { FREE, TAKEN, SENT, ENDED };

RTS_STATIC_ASSERT(APP_CALLS < SLOTS, calls_have_numbers);

#define ABANDONED_NS ((RTS_I64)60000000000)

static struct {
    RTS_UI32 taken; /* calls ever */
    APP_CALL slot[APP_CALLS];
} calls;

/* ---- slots ---- */

static APP_CALL *take_free(void)
{
    for (RTS_UI32 i = 0; i < APP_CALLS; i++) {
        if (SysAtomicReplace(&calls.slot[i].state, FREE, TAKEN))
            return &calls.slot[i];
    }
    return NULL;
}

/* Returns the call of a number if it is in that state. */
static APP_CALL *find(RTS_I32 number, RTS_UI32 state)
{
    RTS_UI32 slot = (RTS_UI32)number % SLOTS;

    if (number <= 0 || slot >= APP_CALLS)
        return NULL;
    APP_CALL *call = &calls.slot[slot];
    return call->number == number && SysAtomicLoad(&call->state) == state ? call : NULL;
}

static RTS_I32 new_number(const APP_CALL *call)
{
    RTS_UI32 generation = SysAtomicAdd(&calls.taken, 1) % (INT32_MAX / SLOTS) + 1;

    return (RTS_I32)(generation * SLOTS + (RTS_UI32)(call - calls.slot));
}

RTS_I32 AppCallTake(PF_APP_CALL carry_out, const APP_CALL_ARGUMENTS *arguments)
{
    APP_CALL *call = take_free();

    if (call == NULL)
        return 0;
    call->number = new_number(call);
    call->carry_out = carry_out;
    call->operation = arguments->operation;
    call->handle = arguments->handle;
    call->value = arguments->value;
    call->error = 0;
    call->result = 0;
    call->size = 0;
    return call->number;
}

bool AppCallIsText(const APP_CALL *call)
{
    return memchr(call->data, '\0', call->size) != NULL;
}

/* ---- what the library calls, from tasks ---- */

/* Part `index` of the data. */
static RTS_UI8 call_put(RTS_I32 number, RTS_UI32 index, RTS_UI64 word0, RTS_UI64 word1, RTS_UI64 word2, RTS_UI64 word3)
{
    const RTS_UI64 words[PART_WORDS] = {word0, word1, word2, word3};
    APP_CALL *call = find(number, TAKEN);

    if (call == NULL || index >= APP_CALL_DATA / APP_CALL_PART)
        return 0;
    memcpy(call->data + index * APP_CALL_PART, words, sizeof words);
    return 1;
}

static RTS_UI8 call_send(RTS_I32 number, RTS_UI32 size)
{
    APP_CALL *call = find(number, TAKEN);

    if (call == NULL || size > APP_CALL_DATA)
        return 0;
    call->size = size;
    call->since_ns = SysTimeGetNs();
    SysAtomicStore(&call->state, SENT);
    return 1;
}

/* 0: it is on its way; 1: it has ended well; else the negative of an error, -1 without such a call. */
static RTS_I32 call_state(RTS_I32 number)
{
    APP_CALL *call = find(number, ENDED);

    if (call != NULL && SysAtomicReplace(&call->state, ENDED, TAKEN)) {
        if (call->number == number)
            return call->error == 0 ? 1 : -call->error;
        SysAtomicStore(&call->state, ENDED); /* it was abandoned, and taken by another block, in between */
    }
    return find(number, SENT) != NULL ? 0 : -1;
}

static RTS_UI32 call_result(RTS_I32 number)
{
    const APP_CALL *call = find(number, TAKEN);

    return call == NULL ? 0 : call->result;
}

/* Word `index` of the data of a call that has ended. */
static RTS_UI64 call_get(RTS_I32 number, RTS_UI32 index)
{
    const APP_CALL *call = find(number, TAKEN);
    RTS_UI64 word = 0;

    if (call != NULL && index < APP_CALL_DATA / sizeof word)
        memcpy(&word, call->data + index * sizeof word, sizeof word);
    return word;
}

static RTS_UI8 call_free(RTS_I32 number)
{
    APP_CALL *call = find(number, TAKEN);

    if (call != NULL)
        SysAtomicStore(&call->state, FREE);
    return call != NULL;
}

/* Bytes of data that a call has room for. */
static RTS_UI32 call_room(void)
{
    return APP_CALL_DATA;
}

#if APP_CALL_WAIT_MS > 0
/* Waits until a call has ended. False: it has not, since the program is stopped, or for too long. */
static RTS_UI8 call_wait(RTS_I32 number)
{
    RTS_UI32 since_ms = SysTimeGetMs();
    const APP_CALL *call = find(number, SENT);

    while (call != NULL && find(number, SENT) != NULL && IecCycleMayRun() &&
           SysTimeGetMs() - since_ms < APP_CALL_WAIT_MS) {
        if (!SysMainWait(&call->state, SENT))
            return 0;
    }
    return find(number, ENDED) != NULL;
}

APP_GATE(call_wait);
#endif

APP_GATE(call_put);
APP_GATE(call_send);
APP_GATE(call_state);
APP_GATE(call_result);
APP_GATE(call_get);
APP_GATE(call_free);

static const CMP_EXT_FUNCTION functions[] = {
    /* The signatures are those of stdlib/calls.st. */
    {"call_put", 0x1F456128, VERSION, (RTS_PFN)APP_GATED(call_put)},
    {"call_send", 0x7922E6C2, VERSION, (RTS_PFN)APP_GATED(call_send)},
    {"call_state", 0xDE13D0C3, VERSION, (RTS_PFN)APP_GATED(call_state)},
    {"call_result", 0x0C7843AC, VERSION, (RTS_PFN)APP_GATED(call_result)},
    {"call_get", 0x8AB81E45, VERSION, (RTS_PFN)APP_GATED(call_get)},
    {"call_free", 0x1B521845, VERSION, (RTS_PFN)APP_GATED(call_free)},
    {"call_room", 0x3B585A62, VERSION, (RTS_PFN)call_room},
#if APP_CALL_WAIT_MS > 0
    {"call_wait", 0xF11F5D3D, VERSION, (RTS_PFN)APP_GATED(call_wait)},
#endif
};

/* ---- main ---- */

bool AppCallsWait(void)
{
    for (RTS_UI32 i = 0; i < APP_CALLS; i++) {
        if (SysAtomicLoad(&calls.slot[i].state) == SENT)
            return true;
    }
    return false;
}

static void carry_out(APP_CALL *call)
{
    RTS_I32 error = call->carry_out(call);

    if (error == APP_CALL_PENDING)
        return;
    call->error = error;
    call->since_ns = SysTimeGetNs();
    SysAtomicStore(&call->state, ENDED);
#if APP_CALL_WAIT_MS > 0
    SysMainWake(&call->state);
#endif
}

/* Frees what has ended and has not been fetched: the block is not called any more. Without a number no task finds it. */
static void free_abandoned(APP_CALL *call)
{
    if (SysTimeGetNs() - call->since_ns <= ABANDONED_NS || !SysAtomicReplace(&call->state, ENDED, TAKEN))
        return;
    call->number = 0;
    if (call->error == 0) {
        call->error = APP_CALL_ABANDONED;
        (void)call->carry_out(call);
    }
    SysAtomicStore(&call->state, FREE);
}

void AppCallsServe(void)
{
    for (RTS_UI32 i = 0; i < APP_CALLS; i++) {
        APP_CALL *call = &calls.slot[i];
        RTS_UI32 state = SysAtomicLoad(&call->state);
        if (state == SENT)
            carry_out(call);
        else if (state == ENDED)
            free_abandoned(call);
    }
}

/* No task runs. */
static void end_with_variables(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    for (RTS_UI32 i = 0; i < APP_CALLS; i++)
        calls.slot[i].state = FREE;
}

RTS_RESULT CmpAppCalls_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(calls);
    else if (hook == CH_COMM_CYCLE)
        AppCallsServe();
    if (hook != CH_INIT3)
        return ERR_OK;
#if APP_CALL_WAIT_MS > 0 && ONLINE_CHANGE && BP_MAX > 0
    IecCycleServeWaiting(AppCallsServe);
#endif
    RTS_RESULT result = EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_PrepareExit, end_with_variables, NULL);
    return result == ERR_OK ? CMRegisterExternal(functions, RTS_COUNT(functions)) : result;
}

#endif
