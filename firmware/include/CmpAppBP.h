/*
 * CmpAppBP.h - breakpoints: where tasks of the application halt, what a debugger sees then, and how they go on (shared
 * with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Manual 3.3.6. A breakpoint is a trap in the code (SysDebug.h). The task that meets it halts in the middle of its cycle:
 * its stack and its variables stay as they are, the cycles of other tasks end, and no other starts. Communication goes on.
 * An exception halts as well while a debugger is attached, before it unwinds. Initialisation code, and a single cycle that
 * main runs, meet no breakpoint.
 *
 * A data breakpoint is a variable that is compared at traps, which the debugger sets at the statements of the program: the
 * task that finds it changed halts before that statement.
 *
 * A debugger steps by temporary traps at all places where the step may lead. It is attached from AppBpAttach on until
 * AppBpDetach, or until it has asked nothing for BP_ALIVE_MS: then all traps are taken out, and the task goes on.
 *
 * Breakpoints are in RAM, and belong to the image. They rest while the application is stopped. Without, the cycle of a task
 * costs what it costs without this component.
 */
#ifndef CMPAPPBP_H
#define CMPAPPBP_H

#include "CmpErrors.h"
#include "CmpForce.h"
#include "CmpIecAbi.h"
#include "CmpStd.h"
#include "SysStart.h"
#ifndef RTS_CFFI
#include "CmpItf.h"
#include "rts_config.h"
#endif

/* BP_CONDITION.relation: of the variable to the value. */
enum { BP_ALWAYS, BP_EQUAL, BP_NOT_EQUAL, BP_LESS, BP_LESS_EQUAL, BP_GREATER, BP_GREATER_EQUAL };
/* BP_CONDITION.kind. */
enum { BP_UNSIGNED = NUMBER_UNSIGNED, BP_SIGNED = NUMBER_SIGNED, BP_REAL = NUMBER_REAL };

/* The breakpoint counts while it holds: the device compares, in some microseconds. */
typedef struct {
    APP_PLACE place; /* of a single byte with a mask: one bit, and the value is 0 or not */
    RTS_UI8 relation;
    RTS_UI8 kind;
    RTS_UI64 value; /* as the variable, in its first `place.size` bytes */
} BP_CONDITION;

typedef struct {
    RTS_UI32 offset; /* of an instruction in the code */
    RTS_UI32 skip;   /* so many hits do not halt */
    RTS_UI32 hits;   /* so far */
    BP_CONDITION condition;
} BP_BREAKPOINT;

/* How a halted task goes on. */
enum {
    BP_GO,       /* until the next breakpoint */
    BP_STEP,     /* to a temporary trap; the other tasks stay held */
    BP_STEP_OUT, /* the same, perhaps in the next cycle: the other tasks go on if this one waits for an event */
};

/* Laid out as a BP_STATE. */
typedef struct {
    RTS_UI32 supported; /* 0: this device has no traps */
    RTS_UI32 attached;
    RTS_UI32 halted;
    RTS_UI32 serial;               /* counts the halts */
    RTS_UI32 code;                 /* RTSEXCPT_BREAKPOINT, or the exception that follows */
    RTS_UI32 task;                 /* that is halted, or steps */
    RTS_UI32 code_offset;          /* APP_NO_CODE_OFFSET: in no code of the application */
    RTS_UI32 stack_size;           /* bytes from the stack pointer on */
    RTS_UI64 stack;                /* the stack pointer */
    RTS_UI64 area[APP_AREA_COUNT]; /* where the areas are: what pointers hold */
    RTS_UI32 breakpoints;          /* set */
    RTS_UI32 room;                 /* BP_MAX */
    RTS_UI32 traps;                /* BP_TRAPS */
    RTS_UI32 link;                 /* code offset that the link register holds; APP_NO_CODE_OFFSET: none */
} BP_STATUS;

/* ---- from main ---- */

/* A debugger is here; `keep`: its silence does not end it. ERR_NOT_SUPPORTED: this device has no traps. */
RTS_RESULT AppBpAttach(bool keep);
/* All breakpoints end; what is halted goes on. */
void AppBpDetach(void);
/* It is still here. */
void AppBpAlive(void);
void AppBpGetStatus(BP_STATUS *status);
bool AppBpIsHalted(void);

/* Sets a breakpoint, in place of the one at its offset. ERR_APP_NOT_LOADED; ERR_OUT_OF_LIMITS: no code there;
 * ERR_PARAMETER: a condition that makes no sense; ERR_NOMEMORY above BP_MAX; ERR_NO_ACCESS_RIGHTS: the system does not let
 * code be written; ERR_INVALID_STATE: no debugger is attached. */
RTS_RESULT AppBpSet(const BP_BREAKPOINT *breakpoint);
/* ERR_APP_BP_BREAKPOINT_NOT_SET. */
RTS_RESULT AppBpClear(RTS_UI32 offset);
void AppBpClearAll(void);
/* In the order in which they were set. False after the last one. */
bool AppBpGet(RTS_UI32 index, BP_BREAKPOINT *breakpoint);

/* Ends the data breakpoints. */
void AppBpClearWatches(void);
/* A task halts when this variable differs from what it is now, or was at the last halt for it. ERR_INVALID_STATE,
 * ERR_APP_NOT_LOADED; ERR_PARAMETER: no such variable; ERR_NOMEMORY above BP_WATCHES. */
RTS_RESULT AppBpAddWatch(const APP_PLACE *place);
/* They are compared before this instruction, too; errors as AppBpSet. */
RTS_RESULT AppBpAddWatchTrap(RTS_UI32 offset);

/* Forgets the temporary traps, and adds one; errors as AppBpSet. */
void AppBpClearTemporary(void);
RTS_RESULT AppBpAddTemporary(RTS_UI32 offset);
/* The halted task goes on. `how`: BP_*. ERR_INVALID_STATE: none is halted. */
RTS_RESULT AppBpGo(RTS_UI32 how);
/* The next task that meets a temporary trap halts. ERR_INVALID_STATE: one is halted, or no debugger is attached. */
RTS_RESULT AppBpPause(void);

/* The stack of the halted task, `distance` bytes from its stack pointer on: NULL when not all of it is there. */
RTS_UI8 *AppBpGetStack(RTS_UI32 distance, RTS_UI32 size);

#ifndef RTS_CFFI
RTS_RESULT CmpAppBP_Hook(CMP_HOOK hook);
#endif

#endif
