/*
 * CmpAppCalls.h - what a program asks for in one cycle and gets in a later one: main does the work between.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A task takes a slot (AppCallTake), puts bytes into it and sends it. Main carries the call out, in one pass or several. The
 * task polls the state of the call by its number, gets the bytes and frees the slot (host/plctool/stdlib/calls.st). No
 * address of the program is kept. Slots change hands by their state, without a lock: a task may be aborted at any place.
 * All of them are free again when the variables of the program end. APP_CALLS of them; needs HAS_CmpAppCalls in cmp_list.c.
 */
#ifndef CMPAPPCALLS_H
#define CMPAPPCALLS_H

#include "CmpItf.h"
#include "rts_config.h"

#if APP_CALLS > 0

enum {
    APP_CALL_PENDING = -1,   /* the call needs another pass */
    APP_CALL_ABANDONED = -2, /* `error` of a call that ended well, and whose result no task has fetched */
    APP_CALL_PART = 32,      /* bytes that a task puts at once */
};

RTS_STATIC_ASSERT(APP_CALL_DATA % APP_CALL_PART == 0, call_data_is_whole_parts);

typedef struct APP_CALL APP_CALL;

/* Carries out a call, in main. Returns 0 with `result`, the number of an error, or APP_CALL_PENDING: then it is called again
 * in the next pass. A call with the error APP_CALL_ABANDONED is undone: `result` is that of its end. */
typedef RTS_I32 (*PF_APP_CALL)(APP_CALL *call);

struct APP_CALL {
    RTS_UI32 state;
    RTS_I32 number;
    RTS_I64 since_ns; /* when it was sent, later when it ended */
    PF_APP_CALL carry_out;
    RTS_UI32 operation; /* and its arguments, as the program gives them */
    RTS_UI32 handle;
    RTS_UI32 value;
    RTS_I32 error; /* 0: none */
    RTS_UI32 result;
    RTS_UI32 size; /* of the data, in bytes: at most APP_CALL_DATA */
    RTS_UI8 data[APP_CALL_DATA];
};

typedef struct {
    RTS_UI32 operation;
    RTS_UI32 handle;
    RTS_UI32 value;
} APP_CALL_ARGUMENTS;

/* From a task: the number of a new call, above 0; 0 when all slots are taken. */
RTS_I32 AppCallTake(PF_APP_CALL carry_out, const APP_CALL_ARGUMENTS *arguments);

/* True if a call waits for main. From any context. */
bool AppCallsWait(void);

/* Carries out what waits; part of CH_COMM_CYCLE. */
void AppCallsServe(void);

/* The data of a call as a string; false if it has no end within them. */
bool AppCallIsText(const APP_CALL *call);

RTS_RESULT CmpAppCalls_Hook(CMP_HOOK hook);

#endif

#endif
