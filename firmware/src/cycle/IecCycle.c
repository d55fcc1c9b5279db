/*
 * IecCycle.c - the cycle of a task, its statistics and its watchdog.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A task record is written by the context the task runs in; main, monitoring and the supervisor read it. Times are kept
 * in ns and 32 bits, which saturate at 4.29 s: no division in a cycle.
 */
#include "IecCycle.h"

#include <string.h>

#include "AppException.h"
#include "AppImage.h"
#include "CmpItf.h"
#include "CyclePhases.h"
#include "SchedEvents.h"
#include "SettingValues.h"
#include "SysAtomic.h"
#include "SysDebug.h"
#include "SysLock.h"
#include "SysTime.h"
#include "TaskTime.h"
#include "rts_config.h"

/* IEC code that may be running. `phase` is odd while it does, and the other fields do not change then. */
typedef struct {
    RTS_UI32 phase;
    RTS_I64 start_ns;
    RTS_I64 limit_ns;
#if IEC_TASK_CALLS
    RTS_UI32 is_lifted; /* for this cycle */
    RTS_UI32 more_ns;   /* for this cycle: how long it was lifted */
#endif
} GUARD;

typedef struct {
    IEC_CONTEXT context;
    IEC_ENTRY entry;
    const CDL_TASK *record;
    GUARD guard;
    RTS_I64 watchdog_ns; /* 0: none */
    RTS_UI16 sensitivity;
    RTS_UI8 beside; /* its code: what there is to do */
#if IEC_TASK_CALLS
    RTS_UI16 exceeded; /* cycles in a row longer than watchdog_ns */
    bool ends_series;  /* this cycle, of long ones, if it is long as well */
#else
    RTS_UI32 exceeded;
#endif
    RTS_UI32 ms_rest; /* ns of context.time_ns beyond context.time_ms */
    RTS_UI32 cycles;
    RTS_UI32 last_ns;
    RTS_UI32 min_ns;
    RTS_UI32 max_ns;
    RTS_UI32 jitter_ns;
    RTS_UI64 sum_ns;
#if TRACE_BUFFER > 0
    RTS_I64 due_ns; /* of this cycle, while it is recorded */
#endif
#if IEC_TASK_CALLS
    RTS_I64 lifted_ns; /* when its watchdog was lifted */
#endif
#if IEC_TASK_CALLS
    RTS_UI32 is_off; /* no cycle begins */
#endif
#if IEC_TASK_HANDLER
    RTS_UI32 failures; /* cycles in a row that ended with an exception */
    uintptr_t handler; /* what runs after it */
#endif
#if TASK_LOAD
    RTS_UI32 long_cycles; /* longer than the interval */
#endif
#if IEC_LATENESS
    RTS_UI32 late[IEC_LATENESS_CLASSES];
#endif
} TASK;

/* May cycles start? */
enum { TASKS_STOP, TASKS_RUN, TASKS_HELD /* by a debugger, but for one task */ };

static struct {
    RTS_UI32 running; /* TASKS_* */
#if BP_MAX > 0
    RTS_UI32 not_held; /* the one task, while the others are held */
#endif
    RTS_UI32 count;
#if TASK_LOAD
    RTS_UI32 starts;
    RTS_UI32 blamed; /* the task that ends because of the load, from 1; 0: none */
#endif
    bool time_started;
    RTS_I64 time_zero; /* SysTimeGetNs at which the time of the application is 0 */
    GUARD init_guard;
    const void *init_arg;
    TASK list[APP_MAX_TASKS];
} tasks;

enum { NS_PER_MS = 1000000, NS_PER_US = 1000 };

#if IEC_TASK_CALLS
/* How long a cycle may take that has disabled its watchdog: as long as that of a task without one. */
#define LIFTED_NS ((RTS_I64)APP_DEFAULT_WATCHDOG_US * NS_PER_US)
#endif

/* ---- guards: a few instructions, shorter than a call ---- */

static RTS_INLINE void guard_begin(GUARD *guard, RTS_I64 now_ns)
{
    guard->start_ns = now_ns;
    SysAtomicStore(&guard->phase, guard->phase + 1);
    SysAtomicFence(); /* what sees a write of the cycle sees that it runs */
}

static RTS_INLINE void guard_end(GUARD *guard)
{
    SysAtomicStore(&guard->phase, guard->phase + 1);
}

bool IecTaskReadGuard(RTS_UI32 index, IEC_GUARD *out)
{
    const GUARD *guard = &tasks.init_guard;

    out->arg = tasks.init_arg;
    if (index < tasks.count) {
        guard = &tasks.list[index].guard;
        out->arg = &tasks.list[index];
    }
    out->serial = SysAtomicLoad(&guard->phase);
    if ((out->serial & 1) == 0)
        return false;
    out->start_ns = guard->start_ns;
    out->limit_ns = guard->limit_ns;
#if IEC_TASK_CALLS
    if (index < tasks.count && tasks.list[index].ends_series)
        out->limit_ns = tasks.list[index].watchdog_ns; /* aborted where it becomes too long, it has a location */
    out->limit_ns += SysAtomicLoad(&guard->more_ns);
    if (SysAtomicLoad(&guard->is_lifted) && out->limit_ns < LIFTED_NS)
        out->limit_ns = LIFTED_NS;
#endif
    SysAtomicFence();
    return SysAtomicLoad(&guard->phase) == out->serial;
}

RTS_UI32 IecTaskGetActivity(bool *busy)
{
    RTS_UI32 sum = 0;
    RTS_UI32 i;

    *busy = false;
    SysAtomicFence(); /* a copy taken before is complete */
    for (i = 0; i < tasks.count; i++) {
        RTS_UI32 phase = SysAtomicLoad(&tasks.list[i].guard.phase);
        sum += phase;
        *busy = *busy || (phase & 1) != 0;
    }
    return sum;
}

bool IecTaskRunGuarded(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    bool ended;

    tasks.init_arg = arg;
    guard_begin(&tasks.init_guard, SysTimeGetNs());
    ended = SysExceptTry(fn, arg, exception);
    guard_end(&tasks.init_guard);
    return ended;
}

/* ---- the cycle ---- */

static RTS_UI32 saturate(RTS_I64 ns)
{
    if (ns >> 32 == 0)
        return (RTS_UI32)ns;
    return ns < 0 ? 0 : 0xFFFFFFFFu;
}

/* The low half of a quotient. Bit by bit, since the compiler's own division takes 1 KiB on cores that have none. */
static RTS_UI32 divide(RTS_UI64 dividend, RTS_UI32 divisor, RTS_UI32 *rest)
{
    RTS_UI64 part = 0;
    RTS_UI32 quotient = 0;
    int bit;

    for (bit = 0; bit < 64; bit++) {
        part = part << 1 | dividend >> 63;
        dividend <<= 1;
        quotient <<= 1;
        if (part >= divisor) {
            part -= divisor;
            quotient |= 1;
        }
    }
    *rest = (RTS_UI32)part;
    return quotient;
}

/* Sets the time of the cycle. Milliseconds are accumulated, since dividing 64 bits is slow on small cores. */
static void set_time(TASK *task, RTS_I64 time_ns)
{
    IEC_CONTEXT *context = &task->context;
    RTS_UI64 sum = (RTS_UI64)(time_ns - context->time_ns) + task->ms_rest;
    RTS_UI32 ms = (RTS_UI32)sum / NS_PER_MS;

    context->time_ns = time_ns;
    task->ms_rest = (RTS_UI32)sum % NS_PER_MS;
    if (sum > 0xFFFFFFFF)
        ms = divide(sum, NS_PER_MS, &task->ms_rest);
    context->time_ms = (RTS_I32)((RTS_UI32)context->time_ms + ms);
}

static RTS_UI32 index_of(const TASK *task)
{
#if IEC_TASK_CALLS
    return task->context.task - 1; /* one instruction instead of a multiplication */
#else
    return (RTS_UI32)(task - tasks.list);
#endif
}

static void run_entry(void *arg)
{
    TASK *task = arg;

    APP_CALL_ENTRY(task->entry, &task->context);
}

#if IEC_LATENESS

enum { FIRST_BIT = 8, STEPS_BITS = 2, STEPS = 1 << STEPS_BITS }; /* of each power of 2 so many classes */
RTS_STATIC_ASSERT(IEC_LATENESS_FIRST_NS == 1 << FIRST_BIT && IEC_LATENESS_CLASSES == 1 + STEPS * (32 - FIRST_BIT),
                  classes_of_lateness_are_all_numbers);

static RTS_UI32 lateness_class(RTS_UI32 ns)
{
    RTS_UI32 top;

    if (ns < IEC_LATENESS_FIRST_NS)
        return 0;
    top = 31 - (RTS_UI32)__builtin_clz(ns);
    return 1 + STEPS * (top - FIRST_BIT) + (ns >> (top - STEPS_BITS) & (STEPS - 1));
}

static RTS_UI32 lateness_end(RTS_UI32 number)
{
    RTS_UI32 shift = FIRST_BIT - STEPS_BITS + (number - 1) / STEPS;

    if (number == 0)
        return IEC_LATENESS_FIRST_NS;
    return number < IEC_LATENESS_CLASSES - 1 ? (STEPS + 1 + (number - 1) % STEPS) << shift : 0xFFFFFFFFu;
}

RTS_RESULT IecCycleGetLateness(RTS_UI32 task, RTS_UI32 number, IEC_LATENESS_COUNT *lateness)
{
    if (task >= tasks.count || number >= IEC_LATENESS_CLASSES)
        return ERR_INVALIDID;
    lateness->below_ns = lateness_end(number);
    lateness->count = SysAtomicLoad(&tasks.list[task].late[number]);
    return ERR_OK;
}

static void count_lateness(TASK *task, RTS_UI32 late)
{
    task->late[lateness_class(late)]++;
}

#else
#define count_lateness(task, late)
#endif

static RTS_INLINE void account(TASK *task, RTS_I64 late_ns, RTS_I64 elapsed_ns)
{
    RTS_UI32 elapsed = saturate(elapsed_ns);
    RTS_UI32 late = saturate(late_ns);
    RTS_UI32 cycles = task->cycles;

    if (cycles == 0)
        task->sum_ns = 0; /* after 2^32 cycles both start again, or the average would be wrong */
    task->last_ns = elapsed;
    task->sum_ns += elapsed;
    if (elapsed < task->min_ns)
        task->min_ns = elapsed;
    if (elapsed > task->max_ns)
        task->max_ns = elapsed;
    if (late > task->jitter_ns)
        task->jitter_ns = late;
    count_lateness(task, late);
#if TASK_LOAD
    if (elapsed_ns > (RTS_I64)task->record->interval_us * NS_PER_US)
        task->long_cycles++;
#endif
    SysAtomicStore(&task->cycles, cycles + 1);
}

/* What SysTimeGetNs does not give: how long this context had the processor. It costs more. */
static RTS_I64 used_ns(const TASK *task)
{
    return SCHED_PROCESSOR_TIME && task->watchdog_ns != 0 ? SysTimeGetUsedNs() : 0;
}

/* Both rules of manual 3.4: too many cycles in a row that are too long, or one that is far too long. */
static RTS_INLINE bool watchdog_expired(TASK *task, RTS_I64 elapsed_ns)
{
    if (task->watchdog_ns == 0)
        return false;
#if IEC_TASK_CALLS
    elapsed_ns -= task->guard.more_ns;
    if (task->guard.is_lifted)
        return elapsed_ns > LIFTED_NS && elapsed_ns > task->guard.limit_ns;
#endif
    if (elapsed_ns <= task->watchdog_ns) {
        task->exceeded = 0;
        return false;
    }
    task->exceeded++;
    return task->exceeded >= task->sensitivity || elapsed_ns > task->guard.limit_ns;
}

#if IEC_TASK_HANDLER
static const IEC_CYCLE_HANDLER *exception_handler;

void IecCycleSetHandler(const IEC_CYCLE_HANDLER *handler)
{
    exception_handler = handler;
}

static void run_handler(void *arg)
{
    TASK *task = arg;

    APP_CALL_ENTRY((IEC_ENTRY)(task->handler | APP_ENTRY_MODE_BIT), &task->context);
}

/* One that fails itself, or does not end, decides nothing. */
static bool goes_on_after(TASK *task, RTS_UI32 code)
{
    RTS_EXCEPTION exception;

    if (exception_handler == NULL || !SysAtomicLoad(&tasks.running) || code == RTSEXCPT_STOP_TIMEOUT ||
        code == RTSEXCPT_PROCESSORLOAD_WATCHDOG || task->failures >= IEC_TASK_MAX_FAILURES)
        return false;
    task->failures++;
    task->handler = exception_handler->begin(index_of(task), &task->context, code);
    if (task->handler == 0)
        return false;
    guard_end(&task->guard);
    guard_begin(&task->guard, SysTimeGetNs());
    return SysExceptTry(run_handler, task, &exception) && exception_handler->end(index_of(task), code) &&
           SysAtomicLoad(&tasks.running);
}
#endif

/* No other cycle starts, which is settled before the guard says that this one is over. Main completes the stop of the
 * application. */
static bool end_with_exception(TASK *task, RTS_UI32 code, uintptr_t address)
{
#if IEC_TASK_HANDLER
    if (goes_on_after(task, code)) {
        task->exceeded = 0;
        guard_end(&task->guard);
        return true;
    }
#endif
    SysAtomicStore(&tasks.running, TASKS_STOP);
#if BP_MAX > 0
    SysDebugWake(&tasks.running);
#endif
    guard_end(&task->guard);
    AppEnterSafeState(); /* at once: main may be busy with the flash */
    AppHandleException((RTS_I32)index_of(task), code, address);
    return false;
}

/* TASK.beside: a bit for the copies of inputs and outputs, and those of CyclePhasesGet. */
enum { HAS_COPIES = 1, PHASES_SHIFT = 1 };

/* Where phases do not change, the linker knows which ones are always empty, and their row is all that is looked at. */
static RTS_INLINE bool has_phase(RTS_UI32 beside, CYCLE_PHASE when)
{
    return CYCLE_PHASES_CHANGE ? (beside >> PHASES_SHIFT >> when & 1) != 0 : cycle_phases[when] != NULL;
}

/* Without phases a task is here because of its copies. */
static RTS_INLINE bool has_copies(RTS_UI32 beside)
{
    return (!CYCLE_PHASES_CHANGE && CyclePhasesGet() == 0) || (beside & HAS_COPIES) != 0;
}

static void run_phases_before(TASK *task)
{
    RTS_UI32 beside = task->beside;
    RTS_UI32 index = index_of(task);

    if (has_phase(beside, CYCLE_INPUTS))
        CyclePhasesRun(CYCLE_INPUTS, index, &task->context);
    if (has_copies(beside))
        AppImageCopyIn(index);
    if (has_phase(beside, CYCLE_BEFORE_CODE))
        CyclePhasesRun(CYCLE_BEFORE_CODE, index, &task->context);
}

static RTS_INLINE void record(TASK *task, RTS_UI32 index, RTS_I64 due_ns)
{
#if TRACE_BUFFER > 0
    task->due_ns = due_ns;
#else
    RTS_UNUSED(due_ns);
#endif
    CyclePhasesRun(CYCLE_RECORD, index, &task->context);
}

static RTS_INLINE void run_phases_after(TASK *task, RTS_I64 due_ns)
{
    RTS_UI32 beside = task->beside;
    RTS_UI32 index = index_of(task);

    if (has_phase(beside, CYCLE_AFTER_CODE))
        CyclePhasesRun(CYCLE_AFTER_CODE, index, &task->context);
    if (has_copies(beside))
        AppImageCopyOut(index, &tasks.running);
    if ((!has_phase(beside, CYCLE_OUTPUTS) && !has_phase(beside, CYCLE_RECORD)) || !SysAtomicLoad(&tasks.running))
        return;
    CyclePhasesRun(CYCLE_OUTPUTS, index, &task->context);
    record(task, index, due_ns);
}

/* After its code. */
static RTS_INLINE bool finish_cycle(TASK *task, RTS_I64 start_ns, RTS_I64 due_ns, RTS_I64 used_before_ns)
{
    RTS_I64 elapsed_ns;

    if (task->beside != 0)
        run_phases_after(task, due_ns);
    elapsed_ns = SysTimeGetNs() - (BP_MAX > 0 && SYS_DEBUG_WAITS ? task->guard.start_ns : start_ns);
    account(task, start_ns - due_ns, elapsed_ns);
    if (watchdog_expired(task, SCHED_PROCESSOR_TIME ? used_ns(task) - used_before_ns : elapsed_ns))
        return end_with_exception(task, RTSEXCPT_WATCHDOG, 0);
#if TASK_LOAD
    if (SysAtomicLoad(&tasks.blamed) == index_of(task) + 1)
        return end_with_exception(task, RTSEXCPT_PROCESSORLOAD_WATCHDOG, 0);
#endif
#if IEC_TASK_HANDLER
    task->failures = 0;
#endif
    guard_end(&task->guard);
    SchedNoteEvents();
    return true;
}

/* A halted one is still in its cycle. */
static bool end_code(TASK *task, const RTS_EXCEPTION *exception)
{
    if (!SYS_DEBUG_WAITS && exception->code == SYS_DEBUG_HALTED)
        return true;
    return end_with_exception(task, exception->code, exception->address);
}

#if ONLINE_CHANGE && !RTS_ONE_CORE && BP_HOLDS_TASKS
static RTS_NOINLINE bool wait_for_turn(TASK *task, RTS_I64 due_ns);

/* True if main has held the tasks after this one was let begin its cycle, and before that showed. */
static RTS_INLINE bool is_held(const TASK *task)
{
    return SysAtomicLoad(&tasks.running) == TASKS_HELD && SysAtomicLoad(&tasks.not_held) != index_of(task);
}
#endif

/* Not inlined, because the compiler then computes the place of the task in the list again for each field. */
static RTS_NOINLINE bool run_cycle(TASK *task, RTS_I64 due_ns)
{
    RTS_I64 start_ns = SysTimeGetNs();
    RTS_I64 used_before_ns = used_ns(task);
    RTS_EXCEPTION exception;

    set_time(task, start_ns - tasks.time_zero);
#if IEC_TASK_CALLS
    task->guard.is_lifted = false;
    task->guard.more_ns = 0;
    task->ends_series = task->exceeded != 0 && task->exceeded + 1 == task->sensitivity;
#endif
    guard_begin(&task->guard, start_ns);
#if ONLINE_CHANGE && !RTS_ONE_CORE && BP_HOLDS_TASKS
    if (is_held(task)) {
        guard_end(&task->guard);
        return wait_for_turn(task, due_ns);
    }
#endif
    if (task->beside != 0)
        run_phases_before(task);
    if (!SysExceptTry(run_entry, task, &exception))
        return end_code(task, &exception);
    return finish_cycle(task, start_ns, due_ns, used_before_ns);
}

/* ---- a moment between all cycles ---- */

/*
 * A copy counts when no task was in its cycle from its beginning to its end. On one core main finds such a moment by
 * itself, unless cycles follow each other faster than the copy takes: tasks only interrupt it. Elsewhere tasks may never
 * pause together, so they make such a moment: while it is wanted, a task whose cycle is due waits as long as others are
 * in theirs, unless one of them takes longer than its own. So the longest wait first and the shortest not at all, and
 * none waits longer than its own cycle lasts for each of the others.
 */
enum { MOMENT_NONE, MOMENT_WANTED, MOMENT_USED };

static struct {
    RTS_UI32 state;  /* MOMENT_* */
    RTS_UI32 claims; /* who wants to copy now; the first one may */
    void (*copy)(void);
} moment;

/* Between cycles; true when there was none meanwhile. */
static bool copy_alone(void (*copy)(void))
{
    bool busy;
    RTS_UI32 before = IecTaskGetActivity(&busy);

    if (busy)
        return false;
    copy();
    return IecTaskGetActivity(&busy) == before;
}

static bool is_wanted(void)
{
    return SysAtomicLoad(&moment.state) == MOMENT_WANTED;
}

static void use_moment(void)
{
    if (SysAtomicAdd(&moment.claims, 1) == 0 && is_wanted() && copy_alone(moment.copy))
        SysAtomicStore(&moment.state, MOMENT_USED);
    (void)SysAtomicAdd(&moment.claims, 0xFFFFFFFF);
}

/* Whether a cycle that lasts longer than that of `task` is running. */
static bool longer_runs(const TASK *task, RTS_I64 now_ns)
{
    IEC_GUARD guard;
    RTS_UI32 i;

    for (i = 0; i < tasks.count; i++) {
        if (IecTaskReadGuard(i, &guard) &&
            (tasks.list[i].last_ns > task->last_ns || now_ns - guard.start_ns > task->last_ns))
            return true;
    }
    return false;
}

static RTS_NOINLINE void make_moment(const TASK *task)
{
    use_moment();
    while (is_wanted() && SysAtomicLoad(&tasks.running) && !longer_runs(task, SysTimeGetNs())) {
        SysTimePause();
        use_moment();
    }
}

bool IecTaskBetweenCycles(void (*copy)(void))
{
    if (RTS_ONE_CORE)
        return copy_alone(copy);
    if (moment.state == MOMENT_NONE) {
        moment.copy = copy;
        SysAtomicStore(&moment.state, MOMENT_WANTED);
    }
    use_moment();
    if (is_wanted())
        return false;
    moment.state = MOMENT_NONE;
    return true;
}

/* ---- a debugger holds the tasks ---- */

#if BP_MAX > 0
RTS_UI32 IecCycleFindTask(const void *arg)
{
    RTS_UI32 i = 0;

    while (i < tasks.count && arg != &tasks.list[i])
        i++;
    return i;
}

void IecCycleHold(RTS_UI32 task)
{
    SysAtomicStore(&tasks.not_held, task);
    if (BP_HOLDS_TASKS)
        (void)SysAtomicReplace(&tasks.running, TASKS_RUN, TASKS_HELD);
}

void IecCycleRelease(void)
{
    (void)SysAtomicReplace(&tasks.running, TASKS_HELD, TASKS_RUN);
    SysDebugWake(&tasks.running);
}

void IecCycleStoodStill(RTS_UI32 task, RTS_I64 ns)
{
    tasks.list[task].guard.start_ns += ns;
}

#if SYS_DEBUG_WAITS
/* Not in main, which has to serve the debugger. What waited is due when the wait ends. */
static RTS_NOINLINE bool wait_for_turn(TASK *task, RTS_I64 due_ns)
{
    bool was_held = false;

    while (SysAtomicLoad(&tasks.running) == TASKS_HELD && SysAtomicLoad(&tasks.not_held) != index_of(task) &&
           SysDebugMayWait()) {
        was_held = true;
        SysDebugWait(&tasks.running, TASKS_HELD);
    }
    return SysAtomicLoad(&tasks.running) != TASKS_STOP ? run_cycle(task, was_held ? SysTimeGetNs() : due_ns) : false;
}
#else
/* What is due while tasks are held is left out. */
static RTS_NOINLINE bool wait_for_turn(TASK *task, RTS_I64 due_ns)
{
    bool is_halted = (task->guard.phase & 1) != 0;

    if (SysAtomicLoad(&tasks.running) == TASKS_STOP)
        return false;
    return is_halted || SysAtomicLoad(&tasks.not_held) != index_of(task) ? true : run_cycle(task, due_ns);
}

void IecCycleResume(RTS_UI32 index)
{
    TASK *task = &tasks.list[index];
    RTS_EXCEPTION exception;

    if (!SysDebugResume(&exception))
        (void)end_code(task, &exception);
    else
        (void)finish_cycle(task, task->guard.start_ns, task->guard.start_ns, 0);
}
#endif
#define run_if_not_stopped(task, due_ns) wait_for_turn(task, due_ns)
#else
#define run_if_not_stopped(task, due_ns) false
#endif

#if ONLINE_CHANGE && !RTS_ONE_CORE && BP_HOLDS_TASKS
RTS_STATIC_ASSERT(BP_MAX > 0, set_BP_MAX_or_no_ONLINE_CHANGE_where_tasks_run_beside_main);
#endif

static RTS_INLINE bool cycle_of(RTS_UI32 index, RTS_I64 due_ns)
{
    TASK *task = &tasks.list[index];

#if IEC_TASK_CALLS
    if (SysAtomicLoad(&task->is_off))
        return true;
#endif
    if (!RTS_ONE_CORE && APP_RETAIN_SIZE > 0 && is_wanted())
        make_moment(task);
    if (BP_MAX > 0)
        return SysAtomicLoad(&tasks.running) == TASKS_RUN ? run_cycle(task, due_ns) : run_if_not_stopped(task, due_ns);
    return SysAtomicLoad(&tasks.running) ? run_cycle(task, due_ns) : false;
}

#if TASK_LOAD && RTS_ONE_CORE
bool IecTaskCycle(RTS_UI32 index, RTS_I64 due_ns)
{
    RTS_UI32 before = TaskTimeSwitch(index);
    bool runs_again = cycle_of(index, due_ns);

    (void)TaskTimeSwitch(before);
    return runs_again;
}
#else
bool IecTaskCycle(RTS_UI32 index, RTS_I64 due_ns)
{
    return cycle_of(index, due_ns);
}
#endif

/* ---- an online change ---- */

#if ONLINE_CHANGE

/* Tasks that interrupt main have ended when it runs, and so have those that it calls. */
enum { TASKS_RUN_BESIDE_MAIN = !RTS_ONE_CORE && BP_HOLDS_TASKS };

#if BP_MAX > 0
#define NO_TASK 0xFFFFFFFFu

#if APP_CALL_WAIT_MS > 0
static void (*serve_waiting)(void);

void IecCycleServeWaiting(void (*serve)(void))
{
    serve_waiting = serve;
}
#define serve_tasks_that_wait() (serve_waiting != NULL ? serve_waiting() : (void)0)
#else
#define serve_tasks_that_wait() ((void)0)
#endif

static bool hold_all(void)
{
    RTS_UI32 since_ms = SysTimeGetMs();
    bool busy;

    for (;;) {
        IecCycleHold(NO_TASK);
        (void)IecTaskGetActivity(&busy);
        if (!busy && SysAtomicLoad(&tasks.running) != TASKS_RUN) /* a debugger's task that ends releases all */
            return true;
        if (SysTimeGetMs() - since_ms > ONLINE_CHANGE_WAIT_MS)
            break;
        serve_tasks_that_wait();
        SysTimePause();
    }
    IecCycleRelease();
    return false;
}
#define release_all() IecCycleRelease()
#else
#define hold_all() true
#define release_all() ((void)0)
#endif

/* On one core tasks only begin later, unless there is something to initialise: that runs like a task, so due cycles are
 * left out. */
static bool exchange_all(const CYCLE_EXCHANGE *exchange)
{
    RTS_UI32 lock = TASKS_RUN_BESIDE_MAIN ? 0 : SysLockEnter();
    RTS_UI32 running = tasks.running; /* with the lock: the exception of a task is not undone below */
    bool done = exchange->begin(exchange->arg);

    if (!TASKS_RUN_BESIDE_MAIN && exchange->init != NULL)
        SysAtomicStore(&tasks.running, TASKS_STOP);
    if (!TASKS_RUN_BESIDE_MAIN)
        SysLockLeave(lock);
    if (done && exchange->init != NULL)
        done = exchange->init(exchange->arg);
    if (!TASKS_RUN_BESIDE_MAIN && exchange->init != NULL)
        SysAtomicStore(&tasks.running, running);
    return done;
}

RTS_RESULT IecCycleExchange(const CYCLE_EXCHANGE *exchange)
{
    bool done;

    if (TASKS_RUN_BESIDE_MAIN && !hold_all())
        return ERR_TIMEOUT;
    done = exchange_all(exchange);
    IecCycleCallOff();
    if (TASKS_RUN_BESIDE_MAIN)
        release_all();
    return done ? ERR_OK : ERR_FAILED;
}

#endif

/* ---- all tasks ---- */

/* Of a task that has no watchdog of its own. */
static RTS_I64 default_limit(RTS_I64 most_ns)
{
    RTS_I64 limit_ns = (RTS_I64)SETTING(Watchdog) * 1000 * NS_PER_US;

    if (limit_ns == 0)
        return (RTS_I64)APP_DEFAULT_WATCHDOG_US * NS_PER_US;
    return most_ns != 0 && limit_ns > most_ns ? most_ns : limit_ns;
}

/* How long a cycle of the task may take. */
static RTS_I64 limit_of(const TASK *task)
{
    const RTS_I64 most_ns = (RTS_I64)APP_MAX_CYCLE_US * NS_PER_US;
    RTS_I64 limit_ns = task->watchdog_ns * (RTS_I64)task->sensitivity;

    if (limit_ns == 0)
        return default_limit(most_ns);
    return most_ns != 0 && limit_ns > most_ns ? most_ns : limit_ns;
}

static void find_what_is_beside(TASK *task)
{
    task->beside = (RTS_UI8)(AppImageSetContext(index_of(task), &task->context) | CyclePhasesGet() << PHASES_SHIFT);
}

static void create(TASK *task, const CDL_TASK *record, const IEC_CONTEXT *prototype)
{
    RTS_UI32 phase = task->guard.phase;
    uintptr_t entry = (uintptr_t)prototype->area[APP_AREA_CODE] + record->entry_offset;

    memset(task, 0, sizeof *task);
    task->guard.phase = phase; /* goes on, so that a supervisor never takes a new cycle for an old one */
    task->context = *prototype;
#if IEC_TASK_CALLS
    task->context.task = (RTS_UI32)(task - tasks.list) + 1;
#endif
    find_what_is_beside(task);
    task->entry = (IEC_ENTRY)(entry | APP_ENTRY_MODE_BIT);
    task->record = record;
    task->min_ns = 0xFFFFFFFFu;
    task->watchdog_ns = (RTS_I64)record->watchdog_us * NS_PER_US;
    task->sensitivity = record->watchdog_sensitivity > 1 ? record->watchdog_sensitivity : 1;
    task->guard.limit_ns = limit_of(task);
}

void IecCycleCreate(const CDL_TASK *records, RTS_UI32 count, const IEC_CONTEXT *prototype)
{
    RTS_UI32 i;

    for (i = 0; i < count; i++)
        create(&tasks.list[i], &records[i], prototype);
    tasks.count = count;
    tasks.time_started = false;
}

void IecCycleFindPhases(void)
{
    RTS_UI32 i;

    for (i = 0; i < tasks.count; i++)
        tasks.list[i].beside = (RTS_UI8)((tasks.list[i].beside & HAS_COPIES) | CyclePhasesGet() << PHASES_SHIFT);
}

#if ONLINE_CHANGE
static void set_code(TASK *task, const CDL_TASK *record, const IEC_CONTEXT *prototype)
{
    uintptr_t entry = (uintptr_t)prototype->area[APP_AREA_CODE] + record->entry_offset;
    RTS_UI32 area;

    for (area = 0; area < APP_AREA_COUNT; area++)
        task->context.area[area] = prototype->area[area];
    task->context.imports = prototype->imports;
    find_what_is_beside(task);
    task->entry = (IEC_ENTRY)(entry | APP_ENTRY_MODE_BIT);
    task->record = record;
}

void IecCycleSetCode(const CDL_TASK *records, RTS_UI32 count, RTS_UI32 kept, const IEC_CONTEXT *prototype)
{
    RTS_UI32 i;

    for (i = 0; i < count; i++) {
        if ((kept >> i & 1) != 0)
            set_code(&tasks.list[i], &records[i], prototype);
        else
            create(&tasks.list[i], &records[i], prototype);
    }
    tasks.count = count;
#if TASK_LOAD
    SysAtomicStore(&tasks.starts, tasks.starts + 1); /* what is known of the load may be that of other tasks */
#endif
    IecCycleFindPhases();
}
#endif

void IecCycleStart(void)
{
    if (!tasks.time_started)
        tasks.time_zero = SysTimeGetNs();
    tasks.time_started = true;
#if TASK_LOAD
    SysAtomicStore(&tasks.blamed, 0);
    SysAtomicStore(&tasks.starts, tasks.starts + 1);
#endif
    SysAtomicStore(&tasks.running, TASKS_RUN);
}

bool IecCycleMayStart(void)
{
    return SysAtomicLoad(&tasks.running) != 0;
}

void IecCycleStop(void)
{
    SysAtomicStore(&tasks.running, TASKS_STOP);
#if BP_MAX > 0
    SysDebugWake(&tasks.running);
#endif
}

bool IecCycleMayRun(void)
{
    return SysAtomicLoad(&tasks.running) != 0;
}

void IecCycleCallOff(void)
{
    if (!RTS_ONE_CORE)
        moment.state = MOMENT_NONE;
}

void IecCycleForget(void)
{
    CMP_CLEAR(tasks);
    if (!RTS_ONE_CORE)
        CMP_CLEAR(moment);
    CyclePhasesForget();
#if TASK_LOAD && RTS_ONE_CORE
    TaskTimeForget();
#endif
    tasks.init_guard.limit_ns = (RTS_I64)APP_INIT_WATCHDOG_US * NS_PER_US;
}

void IecCycleSetTime(IEC_CONTEXT *context)
{
    RTS_UI32 rest;

    context->time_ns = tasks.time_started ? SysTimeGetNs() - tasks.time_zero : 0;
    context->time_ms = (RTS_I32)divide((RTS_UI64)context->time_ns, NS_PER_MS, &rest);
}

/* ---- what others ask ---- */

RTS_UI32 IecTaskGetCount(void)
{
    return tasks.count;
}

/* Again when a cycle ended meanwhile: a 64-bit number may have been read in two halves. */
static RTS_UI64 read_sum_ns(const TASK *task, RTS_UI32 *cycles)
{
    RTS_UI64 sum_ns;

    do {
        *cycles = SysAtomicLoad(&task->cycles);
        sum_ns = task->sum_ns;
        SysAtomicFence();
    } while (SysAtomicLoad(&task->cycles) != *cycles);
    return sum_ns;
}

RTS_UI32 IecTaskGetLoad(void)
{
    RTS_I64 time_ns = tasks.time_started ? SysTimeGetNs() - tasks.time_zero : 0;
    RTS_UI64 busy_ns = 0;
    RTS_UI32 cycles;
    RTS_UI32 i;

    for (i = 0; i < tasks.count; i++)
        busy_ns += read_sum_ns(&tasks.list[i], &cycles);
    return time_ns < 100 ? 0 : (RTS_UI32)(busy_ns / ((RTS_UI64)time_ns / 100));
}

#if TASK_LOAD
RTS_UI32 IecCycleGetStarts(void)
{
    return SysAtomicLoad(&tasks.starts);
}

void IecCycleBlame(RTS_UI32 index)
{
    SysAtomicStore(&tasks.blamed, index + 1);
}

RTS_UI32 IecCycleGetCycles(RTS_UI32 index)
{
    return SysAtomicLoad(&tasks.list[index].cycles);
}

RTS_UI32 IecCycleGetLongCycles(RTS_UI32 index)
{
    return tasks.list[index].long_cycles;
}

RTS_UI32 IecCycleGetUsedNs(RTS_UI32 index)
{
    return (RTS_UI32)tasks.list[index].sum_ns;
}
#endif

RTS_RESULT IecCycleGetInfo(RTS_UI32 index, IEC_TASK_INFO *info)
{
    const TASK *task;
    RTS_UI64 sum_ns;
    RTS_UI32 rest;

    if (index >= tasks.count)
        return ERR_INVALIDID;
    task = &tasks.list[index];
    memset(info, 0, sizeof *info);
    memcpy(info->name, task->record->name, sizeof info->name);
    info->kind = task->record->kind;
    info->priority = task->record->priority;
    info->interval_us = task->record->interval_us;
    sum_ns = read_sum_ns(task, &info->cycles);
    if (info->cycles == 0)
        return ERR_OK;
    info->last_us = task->last_ns / NS_PER_US;
    info->avg_us = divide(sum_ns, info->cycles, &rest) / NS_PER_US;
    info->min_us = task->min_ns / NS_PER_US;
    info->max_us = task->max_ns / NS_PER_US;
    info->jitter_us = task->jitter_ns / NS_PER_US;
    return ERR_OK;
}

#if TRACE_BUFFER > 0
void IecTaskGetTimes(RTS_UI32 index, RTS_UI32 *cycle_ns, RTS_UI32 *late_ns)
{
    const TASK *task = &tasks.list[index];

    *cycle_ns = saturate(SysTimeGetNs() - task->guard.start_ns);
    *late_ns = saturate(task->guard.start_ns - task->due_ns);
}
#endif

#if IEC_TASK_CALLS
RTS_UI32 IecCycleGetWatchdog(RTS_UI32 index)
{
    return index < tasks.count ? tasks.list[index].record->watchdog_us : 0;
}

bool IecCycleLiftWatchdog(RTS_UI32 index, bool lift)
{
    GUARD *guard;

    if (index >= tasks.count)
        return false;
    guard = &tasks.list[index].guard;
    if (lift && !guard->is_lifted) {
        tasks.list[index].lifted_ns = SysTimeGetNs();
        SysAtomicStore(&guard->is_lifted, true);
    } else if (!lift && guard->is_lifted) {
        SysAtomicStore(&guard->more_ns, saturate(guard->more_ns + SysTimeGetNs() - tasks.list[index].lifted_ns));
        SysAtomicStore(&guard->is_lifted, false);
    }
    return true;
}
#endif

#if IEC_TASK_CALLS
bool IecCycleSetScheduled(RTS_UI32 index, bool on)
{
    if (index < tasks.count)
        SysAtomicStore(&tasks.list[index].is_off, !on);
    return index < tasks.count;
}

bool IecCycleIsScheduled(RTS_UI32 index)
{
    return !SysAtomicLoad(&tasks.list[index].is_off);
}
#endif

RTS_RESULT IecTaskGetEntry(RTS_UI32 index, IEC_ENTRY *entry, IEC_CONTEXT **context)
{
    if (index >= tasks.count)
        return ERR_INVALIDID;
    *entry = tasks.list[index].entry;
    *context = &tasks.list[index].context;
    return ERR_OK;
}
