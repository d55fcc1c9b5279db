/*
 * CmpAppBP.c - breakpoints: the list, the traps in the code, and the task that is halted.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Main changes lists and traps under the lock; a task that met a trap looks into them under the lock. A trap is taken out
 * for the one instruction with which its task goes on: another task that executes it just then does not halt.
 */
#include "CmpAppBP.h"

#if BP_MAX > 0

#include <string.h>

#include "AppLife.h"
#include "CmpEventMgr.h"
#include "CmpIecTask.h"
#include "CmpLog.h"
#include "IecCycle.h"
#include "SysAtomic.h"
#include "SysDebug.h"
#include "SysExcept.h"
#include "SysLock.h"
#include "SysTime.h"

/* Whose trap it is. */
enum { TRAP_BREAKPOINT = 1, TRAP_TEMPORARY = 2, TRAP_WATCH = 4 };

typedef struct {
    RTS_UI32 offset;
    RTS_UI32 original;
    RTS_UI32 owners; /* TRAP_*; 0: none */
} TRAP;

typedef struct {
    APP_PLACE place;
    RTS_UI64 value; /* when it was compared last */
} WATCH;

#define NO_TASK 0xFFFFFFFFu
#define NOTHING 0xFFFFFFFFu

enum { BP_RUNS, BP_HALTED };

static struct {
    RTS_UI32 attached; /* atomic */
    bool keep;
    bool active; /* traps are in the code: the tasks run */
    RTS_UI32 alive_ms;
    RTS_UI32 crc; /* of the image that the breakpoints belong to */
    RTS_UI32 count;
    BP_BREAKPOINT list[BP_MAX];
    RTS_UI32 watch_count;
    WATCH watch[BP_WATCHES];
    RTS_UI32 trap_count;
    TRAP trap[BP_TRAPS];
    RTS_UI32 step_task;                  /* whose temporary traps; NO_TASK: any */
    RTS_UI32 passing[APP_MAX_TASKS + 1]; /* the trap that is out while a task executes its instruction */
    RTS_UI32 owner;                      /* 1 + the task that is halted or steps; 0: none; atomic */
    RTS_UI32 state;                      /* BP_RUNS, BP_HALTED; atomic */
    RTS_UI32 serial;
    SYS_DEBUG_STOP stop;
#if !SYS_DEBUG_WAITS
    bool left;     /* the halted task has left its context: main runs the rest of its cycle */
    bool releases; /* and then the other tasks go on */
    RTS_I64 since_ns;
#endif
} bp;

static uintptr_t address_of(RTS_UI32 offset)
{
    return (uintptr_t)AppGetContext()->area[APP_AREA_CODE] + offset;
}

/* ---- traps, with the lock ---- */

static TRAP *find_trap(RTS_UI32 offset)
{
    RTS_UI32 i;

    for (i = 0; i < bp.trap_count; i++) {
        if (bp.trap[i].offset == offset)
            return &bp.trap[i];
    }
    return NULL;
}

static bool reaches(const TRAP *trap, RTS_UI32 offset)
{
    return offset > trap->offset && offset - trap->offset < SysDebugTrapSize(address_of(trap->offset));
}

/* True if a trap would overwrite a part of another one: neither could be taken out alone. */
static bool overlaps(RTS_UI32 offset)
{
    TRAP added = {offset, 0, 0};
    RTS_UI32 i;

    for (i = 0; i < bp.trap_count; i++) {
        if (reaches(&bp.trap[i], offset) || reaches(&added, bp.trap[i].offset))
            return true;
    }
    return false;
}

static RTS_RESULT add_trap(RTS_UI32 offset, RTS_UI32 owner)
{
    TRAP *trap = find_trap(offset);
    RTS_RESULT result = ERR_OK;

    if (trap == NULL) {
        if (bp.trap_count == BP_TRAPS)
            return ERR_NOMEMORY;
        if (SYS_DEBUG_ALIGN < SYS_DEBUG_LONGEST && overlaps(offset))
            return ERR_OUT_OF_LIMITS;
        trap = &bp.trap[bp.trap_count];
        trap->offset = offset;
        trap->owners = 0;
        if (bp.active)
            result = SysDebugWriteTrap(address_of(offset), &trap->original);
        if (result != ERR_OK)
            return result;
        bp.trap_count++;
    }
    trap->owners |= owner;
    return ERR_OK;
}

static void take_out(const TRAP *trap)
{
    if (bp.active && SysDebugIsTrap(address_of(trap->offset)))
        SysDebugRestore(address_of(trap->offset), trap->original);
}

/* A trap without an owner ends; the last one takes its place. */
static void disown(TRAP *trap, RTS_UI32 owners)
{
    trap->owners &= ~owners;
    if (trap->owners == 0) {
        take_out(trap);
        *trap = bp.trap[--bp.trap_count];
    }
}

/* From the end on, so that those that move have been looked at. */
static void disown_all(RTS_UI32 owners)
{
    RTS_UI32 i = bp.trap_count;

    while (i-- > 0)
        disown(&bp.trap[i], owners);
}

static void put_in_all(void)
{
    RTS_UI32 i;

    for (i = 0; i < bp.trap_count; i++)
        (void)SysDebugWriteTrap(address_of(bp.trap[i].offset), &bp.trap[i].original);
    bp.active = true;
}

static void take_out_all(void)
{
    RTS_UI32 i;

    for (i = 0; i < bp.trap_count; i++)
        take_out(&bp.trap[i]);
    bp.active = false;
}

/* ---- conditions ---- */

static bool compares(const BP_CONDITION *condition, RTS_UI64 value)
{
    enum { LESS = NUMBER_LESS, EQUAL = NUMBER_EQUAL, GREATER = NUMBER_GREATER };
    static const RTS_UI8 wanted[] = {
        [BP_EQUAL] = EQUAL,     [BP_NOT_EQUAL] = LESS | GREATER,     [BP_LESS] = LESS, [BP_LESS_EQUAL] = LESS | EQUAL,
        [BP_GREATER] = GREATER, [BP_GREATER_EQUAL] = GREATER | EQUAL};
    RTS_UI32 size = condition->place.size;
    RTS_I64 key, other;

    if (!AppNumberKey(value, size, condition->kind, &key) ||
        !AppNumberKey(condition->value, size, condition->kind, &other))
        return condition->relation == BP_NOT_EQUAL; /* NAN */
    return (wanted[condition->relation] & NUMBER_ORDER(key, other)) != 0;
}

/* False if a pointer leads nowhere. */
static bool read_place(const APP_PLACE *place, RTS_UI64 *value)
{
    AREA_ADDRESS address;
    RTS_UI8 *at;

    if (AppPlaceFind(place, &address, &at) != MONITORING_ERR_OK)
        return false;
    *value = 0;
    memcpy(value, at, place->size);
    if (place->mask != PLACE_ALL_BITS)
        *value = (*value & place->mask) != 0;
    return true;
}

static bool holds(const BP_CONDITION *condition)
{
    RTS_UI64 value;

    if (condition->relation == BP_ALWAYS)
        return true;
    return read_place(&condition->place, &value) && compares(condition, value);
}

static bool is_valid(const BP_CONDITION *condition)
{
    RTS_UI64 value;
    bool is_real = condition->kind == BP_REAL;

    if (condition->relation == BP_ALWAYS)
        return true;
    if (condition->relation > BP_GREATER_EQUAL || condition->kind > BP_REAL ||
        AppPlaceCheck(&condition->place) != MONITORING_ERR_OK || !read_place(&condition->place, &value))
        return false;
    return !is_real || condition->place.size >= sizeof(float);
}

/* ---- in the task ---- */

static BP_BREAKPOINT *find_breakpoint(RTS_UI32 offset)
{
    RTS_UI32 i;

    for (i = 0; i < bp.count; i++) {
        if (bp.list[i].offset == offset)
            return &bp.list[i];
    }
    return NULL;
}

/* With the lock: each change is seen once. */
static bool is_changed(void)
{
    bool changed = false;
    RTS_UI64 value;
    RTS_UI32 i;

    for (i = 0; i < bp.watch_count; i++) {
        if (!read_place(&bp.watch[i].place, &value) || value == bp.watch[i].value)
            continue;
        bp.watch[i].value = value;
        changed = true;
    }
    return changed;
}

/* With the lock. */
static bool is_hit(const TRAP *trap, RTS_UI32 task)
{
    BP_BREAKPOINT *breakpoint = find_breakpoint(trap->offset);
    bool halts = false;

    if (breakpoint != NULL && holds(&breakpoint->condition))
        halts = ++breakpoint->hits > breakpoint->skip;
    if ((trap->owners & TRAP_WATCH) != 0 && is_changed())
        halts = true;
    return halts || ((trap->owners & TRAP_TEMPORARY) != 0 && (bp.step_task == NO_TASK || bp.step_task == task));
}

/* The other tasks wait until the one that is halted has gone on. False when there is no debugger any more. */
static bool become_owner(RTS_UI32 task)
{
    RTS_UI32 owner;

    while (bp.active && SysAtomicLoad(&bp.attached)) {
        owner = SysAtomicLoad(&bp.owner);
        if (owner == task + 1 || (owner == 0 && SysAtomicReplace(&bp.owner, 0, task + 1)))
            return true;
        if (!SYS_DEBUG_WAITS)
            return false;
        SysDebugWait(&bp.owner, owner);
    }
    return false;
}

static void give_up_owner(void)
{
    SysAtomicStore(&bp.owner, 0);
    IecCycleRelease();
    SysDebugWake(&bp.owner);
}

/* False when there is no debugger any more, or another task is halted. */
static bool begin_halt(const SYS_DEBUG_STOP *stop, RTS_UI32 task)
{
    if (!become_owner(task))
        return false;
    bp.stop = *stop;
    bp.serial++;
    IecCycleHold(task);
    SysAtomicStore(&bp.state, BP_HALTED);
    return true;
}

#if SYS_DEBUG_WAITS
static bool halt(const SYS_DEBUG_STOP *stop, RTS_UI32 task)
{
    RTS_I64 since_ns = SysTimeGetNs();
    RTS_UI32 serial;

    if (!begin_halt(stop, task))
        return false;
    serial = bp.serial;
    if (!bp.active || !SysAtomicLoad(&bp.attached)) /* it ended just now */
        SysAtomicStore(&bp.state, BP_RUNS);
    while (SysAtomicLoad(&bp.state) == BP_HALTED && bp.serial == serial) /* not another one already */
        SysDebugWait(&bp.state, BP_HALTED);
    IecCycleStoodStill(task, SysTimeGetNs() - since_ns);
    if (!bp.active || !SysAtomicLoad(&bp.attached))
        give_up_owner();
    return false;
}
#else
/* True: the task is to leave its context. */
static bool halt(const SYS_DEBUG_STOP *stop, RTS_UI32 task)
{
    if (!begin_halt(stop, task))
        return false;
    bp.since_ns = SysTimeGetNs();
    bp.left = true;
    bp.releases = false;
    return true;
}
#endif

/* The trap of the instruction that was executed is put in again, unless it was removed meanwhile. */
static void put_back(RTS_UI32 task)
{
    RTS_UI32 lock = SysLockEnter();
    TRAP *trap = find_trap(bp.passing[task]);

    if (trap != NULL && bp.active && !SysDebugIsTrap(address_of(trap->offset)))
        (void)SysDebugWriteTrap(address_of(trap->offset), &trap->original);
    bp.passing[task] = NOTHING;
    SysLockLeave(lock);
}

static SYS_DEBUG_ACTION pass(RTS_UI32 offset, RTS_UI32 task)
{
    RTS_UI32 lock = SysLockEnter();
    const TRAP *trap = find_trap(offset);
    bool passes = trap != NULL && bp.active;

    if (passes) {
        take_out(trap);
        bp.passing[task] = offset;
    }
    SysLockLeave(lock);
    return passes ? SYS_DEBUG_PASS : SYS_DEBUG_GO;
}

static SYS_DEBUG_ACTION trapped(const SYS_DEBUG_STOP *stop, RTS_UI32 task, bool may_halt)
{
    RTS_UI32 offset = SysExceptCodeOffset(stop->address);
    RTS_UI32 lock = SysLockEnter();
    TRAP *trap = SysExceptIsCode(stop->address) ? find_trap(offset) : NULL;
    bool is_ours = trap != NULL;
    bool halts = is_ours && may_halt && is_hit(trap, task);

    SysLockLeave(lock);
    if (!is_ours) /* a trap of the compiler, or one that was taken out meanwhile */
        return SysDebugIsTrap(stop->address) ? SYS_DEBUG_LEAVE : SYS_DEBUG_GO;
    if (halts && halt(stop, task))
        return SYS_DEBUG_HALT;
    return pass(offset, task);
}

static SYS_DEBUG_ACTION on_stop(const SYS_DEBUG_STOP *stop)
{
    RTS_UI32 task = IecCycleFindTask(stop->arg);
    bool may_halt = task < IecTaskGetCount() && SysDebugMayWait();

    if (task == IecTaskGetCount())
        task = APP_MAX_TASKS;
    if (stop->code == RTSEXCPT_NOEXCEPTION) {
        put_back(task);
        return SYS_DEBUG_GO;
    }
    if (!SYS_DEBUG_WAITS && stop->code == SYS_DEBUG_HALTED)
        return bp.stop.code == RTSEXCPT_BREAKPOINT ? pass(SysExceptCodeOffset(stop->address), task) : SYS_DEBUG_LEAVE;
    if (stop->code == RTSEXCPT_BREAKPOINT)
        return trapped(stop, task, may_halt);
    return may_halt && halt(stop, task) ? SYS_DEBUG_HALT : SYS_DEBUG_LEAVE;
}

/* ---- in main ---- */

static void go(void)
{
    SysAtomicStore(&bp.state, BP_RUNS);
    SysDebugWake(&bp.state);
}

/* The other tasks go on, too. */
static void release(void)
{
#if !SYS_DEBUG_WAITS
    if (bp.left) {
        bp.releases = true;
        return;
    }
#endif
    give_up_owner();
}

#if !SYS_DEBUG_WAITS
/* Runs the rest of the cycle of a task that goes on, to its end or the next halt. */
static void run_rest(void)
{
    if (!bp.left || SysAtomicLoad(&bp.state) == BP_HALTED)
        return;
    bp.left = false;
    IecCycleStoodStill(bp.owner - 1, SysTimeGetNs() - bp.since_ns);
    IecCycleResume(bp.owner - 1);
    if (bp.releases && !bp.left)
        give_up_owner();
}
#else
#define run_rest() ((void)0)
#endif

bool AppBpIsHalted(void)
{
    return SysAtomicLoad(&bp.state) == BP_HALTED;
}

/* Breakpoints of another image end. */
static void check_image(void)
{
    if (bp.crc != AppGetImage()->crc)
        AppBpClearAll();
    bp.crc = AppGetImage()->crc;
}

/* Ends what these owners of traps have. */
static void forget(RTS_UI32 owners)
{
    RTS_UI32 lock = SysLockEnter();

    if ((owners & TRAP_BREAKPOINT) != 0)
        bp.count = 0;
    if ((owners & TRAP_WATCH) != 0)
        bp.watch_count = 0;
    disown_all(owners);
    SysLockLeave(lock);
}

void AppBpClearAll(void)
{
    forget(TRAP_BREAKPOINT | TRAP_TEMPORARY | TRAP_WATCH);
}

RTS_RESULT AppBpAttach(bool keep)
{
    if (!SysDebugCanTrap())
        return ERR_NOT_SUPPORTED;
    check_image();
    bp.keep = keep;
    AppBpAlive();
    if (!bp.attached)
        bp.active = AppGetState() == AS_RUN;
    SysAtomicStore(&bp.attached, 1);
    SysDebugSetHandler(on_stop);
    return ERR_OK;
}

/* The handler stays: a task may be on its way to it. */
void AppBpDetach(void)
{
    SysAtomicStore(&bp.attached, 0);
    AppBpClearAll();
    go();
    release();
}

void AppBpAlive(void)
{
    bp.alive_ms = SysTimeGetMs();
}

static void check_alive(void)
{
    RTS_UI32 silent_ms = SysTimeGetMs() - bp.alive_ms;

    if (BP_ALIVE_MS == 0 || !bp.attached || bp.keep || silent_ms <= BP_ALIVE_MS)
        return;
    LogAdd(CMPID_CmpAppBP, LOG_WARNING, ERR_TIMEOUT, "The debugger is gone: its breakpoints end, tasks go on");
    AppBpDetach();
}

static bool is_in_code(RTS_UI32 offset)
{
    RTS_UI32 size = AppGetImage()->code.size;

    return offset % SYS_DEBUG_ALIGN == 0 && offset < size && size - offset >= SYS_DEBUG_ALIGN &&
           size - offset >= SysDebugTrapSize(address_of(offset));
}

static RTS_RESULT check_debugger(void)
{
    if (!bp.attached)
        return ERR_INVALID_STATE;
    if (AppGetState() == AS_NONE)
        return ERR_APP_NOT_LOADED;
    check_image();
    return ERR_OK;
}

static RTS_RESULT check_place(RTS_UI32 offset)
{
    RTS_RESULT result = check_debugger();

    return result == ERR_OK && !is_in_code(offset) ? (RTS_RESULT)ERR_OUT_OF_LIMITS : result;
}

/* With the lock. */
static RTS_RESULT set_breakpoint(const BP_BREAKPOINT *breakpoint)
{
    BP_BREAKPOINT *entry = find_breakpoint(breakpoint->offset);
    RTS_RESULT result;

    if (entry == NULL && bp.count == BP_MAX)
        return ERR_NOMEMORY;
    result = add_trap(breakpoint->offset, TRAP_BREAKPOINT);
    if (result != ERR_OK)
        return result;
    if (entry == NULL)
        entry = &bp.list[bp.count++];
    *entry = *breakpoint;
    return ERR_OK;
}

RTS_RESULT AppBpSet(const BP_BREAKPOINT *breakpoint)
{
    RTS_RESULT result = check_place(breakpoint->offset);
    RTS_UI32 lock;

    if (result == ERR_OK && !is_valid(&breakpoint->condition))
        result = ERR_PARAMETER;
    if (result != ERR_OK)
        return result;
    lock = SysLockEnter();
    result = set_breakpoint(breakpoint);
    SysLockLeave(lock);
    return result;
}

RTS_RESULT AppBpClear(RTS_UI32 offset)
{
    RTS_UI32 lock = SysLockEnter();
    BP_BREAKPOINT *entry = find_breakpoint(offset);

    if (entry != NULL) {
        bp.count--;
        memmove(entry, entry + 1, (RTS_SIZE)(&bp.list[bp.count] - entry) * sizeof *entry);
        disown(find_trap(offset), TRAP_BREAKPOINT); /* each breakpoint has one */
    }
    SysLockLeave(lock);
    return entry != NULL ? ERR_OK : ERR_APP_BP_BREAKPOINT_NOT_SET;
}

bool AppBpGet(RTS_UI32 index, BP_BREAKPOINT *breakpoint)
{
    if (index >= bp.count)
        return false;
    *breakpoint = bp.list[index];
    return true;
}

/* ---- traps that are no breakpoints ---- */

void AppBpClearTemporary(void)
{
    forget(TRAP_TEMPORARY);
}

/* A trap that is out while its task stands on it is no danger: the task is halted. */
static RTS_RESULT add_checked(RTS_UI32 offset, RTS_UI32 owner)
{
    RTS_RESULT result = check_place(offset);
    RTS_UI32 lock;

    if (result != ERR_OK)
        return result;
    lock = SysLockEnter();
    result = add_trap(offset, owner);
    SysLockLeave(lock);
    return result;
}

RTS_RESULT AppBpAddTemporary(RTS_UI32 offset)
{
    return add_checked(offset, TRAP_TEMPORARY);
}

/* ---- data breakpoints ---- */

void AppBpClearWatches(void)
{
    forget(TRAP_WATCH);
}

/* With the lock. */
static RTS_RESULT add_watch(const APP_PLACE *place)
{
    WATCH *watch = &bp.watch[bp.watch_count];

    if (bp.watch_count == BP_WATCHES)
        return ERR_NOMEMORY;
    if (!read_place(place, &watch->value))
        return ERR_PARAMETER;
    watch->place = *place;
    bp.watch_count++;
    return ERR_OK;
}

RTS_RESULT AppBpAddWatch(const APP_PLACE *place)
{
    RTS_RESULT result = check_debugger();
    RTS_UI32 lock;

    if (result == ERR_OK && AppPlaceCheck(place) != MONITORING_ERR_OK)
        result = ERR_PARAMETER;
    if (result != ERR_OK)
        return result;
    lock = SysLockEnter();
    result = add_watch(place);
    SysLockLeave(lock);
    return result;
}

RTS_RESULT AppBpAddWatchTrap(RTS_UI32 offset)
{
    return add_checked(offset, TRAP_WATCH);
}

/* ---- steps ---- */

/* Another task may have to cause it. */
static bool waits_for_event(RTS_UI32 task)
{
    IEC_TASK_INFO info;

    return IecCycleGetInfo(task, &info) == ERR_OK && info.kind != KIND_CYCLIC && info.kind != KIND_FREEWHEELING;
}

RTS_RESULT AppBpGo(RTS_UI32 how)
{
    if (!AppBpIsHalted())
        return ERR_INVALID_STATE;
    if (how > BP_STEP_OUT)
        return ERR_PARAMETER;
    if (how == BP_GO)
        AppBpClearTemporary();
    bp.step_task = bp.owner - 1;
    SysAtomicStore(&bp.state, BP_RUNS);
    if (how == BP_GO || (how == BP_STEP_OUT && waits_for_event(bp.step_task)))
        release();
    SysDebugWake(&bp.state);
    return ERR_OK;
}

RTS_RESULT AppBpPause(void)
{
    if (!bp.attached || AppBpIsHalted())
        return ERR_INVALID_STATE;
    bp.step_task = NO_TASK;
    release(); /* a step that does not end, such as one that waits for an event */
    return ERR_OK;
}

/* ---- looking ---- */

void AppBpGetStatus(BP_STATUS *status)
{
    const RTS_UI32 *crc = &AppGetImage()->crc;
    RTS_UI32 i;

    memset(status, 0, sizeof *status);
    status->supported = SysDebugCanTrap();
    status->attached = bp.attached;
    status->serial = bp.serial;
    status->breakpoints = *crc == bp.crc ? bp.count : 0;
    status->room = BP_MAX;
    status->traps = BP_TRAPS;
    status->code_offset = APP_NO_CODE_OFFSET;
    status->link = APP_NO_CODE_OFFSET;
    for (i = 0; i < APP_AREA_COUNT && AppGetState() != AS_NONE; i++)
        status->area[i] = (uintptr_t)AppGetContext()->area[i];
    if (!AppBpIsHalted())
        return;
    status->halted = 1;
    status->code = bp.stop.code;
    status->task = bp.owner - 1;
    if (SysExceptIsCode(bp.stop.address))
        status->code_offset = SysExceptCodeOffset(bp.stop.address);
    if (SysExceptIsReturn(bp.stop.link))
        status->link = SysExceptCodeOffset(bp.stop.link - APP_ENTRY_MODE_BIT);
    status->stack = bp.stop.stack;
    status->stack_size = bp.stop.stack < bp.stop.end ? (RTS_UI32)(bp.stop.end - bp.stop.stack) : 0;
}

RTS_UI8 *AppBpGetStack(RTS_UI32 distance, RTS_UI32 size)
{
    BP_STATUS status;

    AppBpGetStatus(&status);
    if (size > status.stack_size || distance > status.stack_size - size || status.stack_size > RTS_IEC_STACK_SIZE)
        return NULL;
    return (RTS_UI8 *)(uintptr_t)status.stack + distance;
}

/* ---- tasks stop and start ---- */

static void tasks_stop(void)
{
    RTS_UI32 lock = SysLockEnter();

    if (bp.active)
        take_out_all();
    SysLockLeave(lock);
    go();
    SysDebugWake(&bp.owner);
    run_rest();
}

static void tasks_will_start(void)
{
    RTS_UI32 lock;

    if (!bp.attached)
        return;
    check_image();
    lock = SysLockEnter();
    give_up_owner(); /* before an online change a task may have stepped, and held the others */
    if (!bp.active)
        put_in_all();
    SysLockLeave(lock);
}

/* ---- the component ---- */

static void reset(void)
{
    RTS_UI32 i;

    CMP_CLEAR(bp);
    for (i = 0; i < RTS_COUNT(bp.passing); i++)
        bp.passing[i] = NOTHING;
    SysDebugSetHandler(NULL);
    SysDebugIsMain();
}

RTS_RESULT CmpAppBP_Hook(CMP_HOOK hook)
{
    static const IEC_TASK_WATCHER watcher = {tasks_will_start, tasks_stop};

    if (hook == CH_INIT) {
        reset();
        IecTaskSetWatcher(&watcher);
    }
    if (hook == CH_COMM_CYCLE) {
        check_alive();
        run_rest();
    }
    if (hook == CH_EXIT_TASKS || hook == CH_EXIT)
        AppBpDetach();
    return ERR_OK;
}

#endif
