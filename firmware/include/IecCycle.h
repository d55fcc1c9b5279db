/*
 * IecCycle.h - the cycle of a task and its statistics (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A cycle is: the phases before the code (CyclePhases.h), with them a copy of the inputs and outputs that others use too,
 * IEC code, the phases after it, with them the changed outputs, statistics, watchdog (manual 3.4, 3.5, 8.9), events for
 * other tasks.
 */
#ifndef IECCYCLE_H
#define IECCYCLE_H

#include "CmpErrors.h"
#include "CmpIecAbi.h"
#include "CmpStd.h"
#ifndef RTS_CFFI
#include "SysExcept.h"
#include "rts_config.h"
#endif

/* Statistics of a task; times in us. Jitter is the largest deviation of a start from its due time. */
typedef struct {
    char name[CDL_TASK_NAME_SIZE];
    RTS_UI32 kind;
    RTS_UI32 priority;
    RTS_UI32 interval_us;
    RTS_UI32 cycles;
    RTS_UI32 last_us;
    RTS_UI32 avg_us;
    RTS_UI32 min_us;
    RTS_UI32 max_us;
    RTS_UI32 jitter_us;
    RTS_UI32 overruns; /* due times missed because the previous cycle took too long; of events, those that were lost */
} IEC_TASK_INFO;

/* One cycle of a task that is due since `due_ns` (SysTimeGetNs). Called by the scheduler in the context of the task.
 * Returns false when the task must not be scheduled again (exception). */
bool IecTaskCycle(RTS_UI32 task, RTS_I64 due_ns);

RTS_UI32 IecTaskGetCount(void);

#ifndef RTS_CFFI
/* ---- for CmpIecTask, from main ---- */

/* The tasks from now on, at most APP_MAX_TASKS; while none runs. As IecTaskCreateAll. */
void IecCycleCreate(const CDL_TASK *records, RTS_UI32 count, const IEC_CONTEXT *prototype);
/* Cycles may start from now on, and no more from now on. */
void IecCycleStart(void);
void IecCycleStop(void);
/* Between both; from any context. While they may not, outputs are in the safe state, or become so. */
bool IecCycleMayStart(void);
/* The moment that IecTaskBetweenCycles waits for does not come: no task runs any more. */
void IecCycleCallOff(void);
/* Notes that components have added or removed phases (CyclePhases.h): tasks run them, or none, from their next cycle on. */
void IecCycleFindPhases(void);
/* All but the overruns. ERR_INVALIDID when there is no such task. */
RTS_RESULT IecCycleGetInfo(RTS_UI32 task, IEC_TASK_INFO *info);

#if IEC_LATENESS
/* How late cycles of a task began. Classes are narrow where lateness is small: the first ends at 256 ns, and each next one
 * is at most a quarter wider than what it begins with. */
enum { IEC_LATENESS_FIRST_NS = 256, IEC_LATENESS_CLASSES = 1 + 4 * 24 };
typedef struct {
    RTS_UI32 below_ns; /* where the class ends, and the next one begins; 0xFFFFFFFF: never */
    RTS_UI32 count;    /* of starts since the application was loaded; wraps */
} IEC_LATENESS_COUNT;
/* ERR_INVALIDID when there is no such task or class. From main. */
RTS_RESULT IecCycleGetLateness(RTS_UI32 task, RTS_UI32 number, IEC_LATENESS_COUNT *lateness);
#endif

/* The share of the time since the tasks were first started that all of them took, of every kind [%]; with several
 * processors it may be above 100. From main. */
RTS_UI32 IecTaskGetLoad(void);
/* The state as after power on. */
void IecCycleForget(void);

/* ---- for all ---- */

/* Runs fn(arg), code of the application other than a task (initialisation), from main, watched and caught like a cycle.
 * Returns as SysExceptTry. */
bool IecTaskRunGuarded(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception);

/* Sets the time that a cycle would have which begins now. From main. */
void IecCycleSetTime(IEC_CONTEXT *context);

/* Counts starts and ends of cycles of all tasks, so that a reader can tell whether one ran meanwhile. *busy: a task is
 * in its cycle now. From any context. */
RTS_UI32 IecTaskGetActivity(bool *busy);

/* Has `copy` called at a moment when no task is in its cycle, so that what it copies is the work of whole cycles. True:
 * it was; when a cycle came in between, more than once. False: not yet, call again; where several tasks run at a time
 * they do it, in the context of one of them, as soon as there is such a moment. It is called off when the tasks are
 * stopped. From main. */
bool IecTaskBetweenCycles(void (*copy)(void));

/* False from the moment on at which the application stops: outputs are in the safe state then, or will be. From any
 * context. */
bool IecCycleMayRun(void);

/* How long the cycle has taken until now, and how long after it was due it began; both end at 4.29 s. With TRACE_BUFFER,
 * from CYCLE_RECORD of this task. */
void IecTaskGetTimes(RTS_UI32 task, RTS_UI32 *cycle_ns, RTS_UI32 *late_ns);

#if ONLINE_CHANGE
/* ---- for CmpIecTask ---- */

/* What an online change does. `begin` runs in a moment in which no task is in its cycle: false when it has changed nothing.
 * Then `init`, if there is one, before any begins: false when it failed, and has undone `begin`. */
typedef struct {
    bool (*begin)(void *arg);
    bool (*init)(void *arg);
    void *arg;
} CYCLE_EXCHANGE;

/* ERR_OK, ERR_FAILED: begin or init did, ERR_TIMEOUT: a cycle takes too long, and nothing was done. From main. */
RTS_RESULT IecCycleExchange(const CYCLE_EXCHANGE *exchange);

#if APP_CALL_WAIT_MS > 0
/* What it calls while it waits for the cycles to end: tasks may wait for main. From main. */
void IecCycleServeWaiting(void (*serve)(void));
#endif

/* Other code and other tasks, within `begin` and `init`. `kept`: a bit for each task that has the same record as before but
 * for its entry; the others begin as after IecCycleCreate. `prototype`: where the code is, and its imports. */
void IecCycleSetCode(const CDL_TASK *records, RTS_UI32 count, RTS_UI32 kept, const IEC_CONTEXT *prototype);
#endif

#if BP_MAX > 0
/* ---- for CmpAppBP ---- */

/* The task that runs SysExceptTry with `arg`; IecTaskGetCount() if it is initialisation code. From any context. */
RTS_UI32 IecCycleFindTask(const void *arg);
/* No cycle of a task other than `task` starts until IecCycleRelease: what is due waits, and is late. Cycles that run
 * end. From the context of a task. */
void IecCycleHold(RTS_UI32 task);
/* From any context. */
void IecCycleRelease(void);
/* The cycle of the task that calls it stood still for so long: statistics and watchdog do not count that. */
void IecCycleStoodStill(RTS_UI32 task, RTS_I64 ns);
#if !SYS_DEBUG_WAITS
/* Runs the rest of the cycle that is halted. From main, while the others are held. */
void IecCycleResume(RTS_UI32 task);
#endif
#endif

#if TASK_LOAD
/* ---- for CmpTaskLoad ---- */

/* How often tasks were started or exchanged. From any context. */
RTS_UI32 IecCycleGetStarts(void);
/* Ends the program at the end of the next cycle of the task, because of its load. From any context. */
void IecCycleBlame(RTS_UI32 task);

/* Of a task that exists: its cycles, those that took longer than its interval, and how long all took together [ns]; each
 * wraps. From any context. */
RTS_UI32 IecCycleGetCycles(RTS_UI32 task);
RTS_UI32 IecCycleGetLongCycles(RTS_UI32 task);
RTS_UI32 IecCycleGetUsedNs(RTS_UI32 task);
#endif

#if IEC_TASK_CALLS
/* ---- for IecTaskCalls ---- */

/* The watchdog time of a task [us]; 0: none, or no such task. */
RTS_UI32 IecCycleGetWatchdog(RTS_UI32 task);
/* Disables the watchdog of the task that calls it, or enables it again: only for this cycle, which may take as long as
 * one without watchdog. What was disabled does not count. False when there is no such task. */
bool IecCycleLiftWatchdog(RTS_UI32 task, bool lift);
#endif

#if IEC_TASK_CALLS
/* False: no cycle of the task begins until it is called with true, or the program gets its initial values again. Returns
 * false when there is no such task. From any context. */
bool IecCycleSetScheduled(RTS_UI32 task, bool on);
bool IecCycleIsScheduled(RTS_UI32 task);
#endif

#if IEC_TASK_HANDLER
/* ---- for IecTaskHandler ---- */

/* Called in the context of a task that failed, before its exception ends the program. */
typedef struct {
    uintptr_t (*begin)(RTS_UI32 task, const IEC_CONTEXT *context, RTS_UI32 code); /* what to run; 0: nothing */
    bool (*end)(RTS_UI32 task, RTS_UI32 code); /* after it returned: whether the program goes on */
} IEC_CYCLE_HANDLER;

/* There is one. From main, before tasks are started. */
void IecCycleSetHandler(const IEC_CYCLE_HANDLER *handler);
#endif

/* For measurements: the entry of a task and the context it gets. From main while the application is stopped or, on the
 * simulator, between cycles. */
RTS_RESULT IecTaskGetEntry(RTS_UI32 task, IEC_ENTRY *entry, IEC_CONTEXT **context);

/* IEC code that runs right now, for the watchdog. */
typedef struct {
    RTS_UI32 serial; /* differs from one cycle of the task to its next */
    RTS_I64 start_ns;
    RTS_I64 limit_ns; /* how long it may take */
    const void *arg;  /* for SysExceptBreak */
} IEC_GUARD;

/* Reads guard `index`: one for each task, and one at IecTaskGetCount() for code that IecTaskRunGuarded runs. False
 * when it does not run. From any context. */
bool IecTaskReadGuard(RTS_UI32 index, IEC_GUARD *guard);
#endif

#endif
