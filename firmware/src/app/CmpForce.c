/*
 * CmpForce.c - forced variables: the list, and what is done with it in each cycle.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Main changes the list under the lock. On one core no task runs then; elsewhere a task holds the lock while it goes
 * through the list.
 */
#include "CmpForce.h"

#if FORCE_MAX > 0

#include <string.h>

#include "../cycle/AppImage.h"
#include "AppState.h"
#include "CmpEventMgr.h"
#include "CyclePhases.h"
#include "IecCycle.h"
#include "SysAtomic.h"
#include "SysLock.h"

typedef struct {
    FORCED_VALUE forced;
    bool is_searched; /* where it is, in each cycle */
} ENTRY;

/* A value of 1, 2 or 4 bytes that is where it always is. */
typedef struct {
    RTS_UI8 *at;
    RTS_UI32 value;
} PUT;

#define NO_TASK 0xFFFFFFFFu

enum { LARGEST_PUT = 4 };

/* The puts are in the order of their sizes, the largest first. If those are odd, the last one of them is there twice. */
static struct {
    RTS_UI32 puts_of[LARGEST_PUT + 1]; /* by size */
    bool has_others;                   /* than the largest ones */
    PUT puts[FORCE_MAX + 1];
    RTS_UI32 count;
    RTS_UI32 serial;
    bool has_phases;
    ENTRY list[FORCE_MAX];
} force;

static void put_all(RTS_UI32 task, const IEC_CONTEXT *context);

static CYCLE_ENTRY before_code = {put_all, NULL};
static CYCLE_ENTRY after_code = {put_all, NULL};

/* ---- one value ---- */

static bool is_aligned(const RTS_UI8 *at, RTS_UI32 size)
{
    return ((uintptr_t)at & (size - 1u)) == 0;
}

/* In one access where the processor can. The other bits may be changed by tasks of a higher priority. */
static void put(RTS_UI8 *at, const FORCED_VALUE *forced)
{
    RTS_UI32 size = forced->place.size;
    RTS_UI32 value = forced->value[0];
    RTS_UI64 whole;
    RTS_UI32 lock;

    if (forced->place.mask != PLACE_ALL_BITS) {
        lock = RTS_ONE_CORE ? SysLockEnter() : 0;
        SysAtomicSetBits(at, forced->place.mask, (RTS_UI8)value);
        if (RTS_ONE_CORE)
            SysLockLeave(lock);
    } else if (size == 2 && is_aligned(at, size)) {
        *(volatile RTS_UI16 *)(void *)at = (RTS_UI16)value;
    } else if (size == 4 && is_aligned(at, size)) {
        *(volatile RTS_UI32 *)(void *)at = value;
    } else if (size == 8 && is_aligned(at, size)) {
        memcpy(&whole, forced->value, sizeof whole);
        *(volatile RTS_UI64 *)(void *)at = whole;
    } else {
        memcpy(at, forced->value, size);
    }
}

/* An error while a pointer leads to no variable, or to code. */
static MON_RESULT find(const APP_PLACE *place, AREA_ADDRESS *address, RTS_UI8 **at)
{
    MON_RESULT result = AppPlaceFind(place, address, at);

    return result == MONITORING_ERR_OK && address->area == APP_AREA_CODE ? MONITORING_ERR_OPERATION_DENIED : result;
}

static bool is_image(RTS_UI32 area)
{
    return area == APP_AREA_INPUT || area == APP_AREA_OUTPUT;
}

/* Where the application is not in its safe state, or on its way there: a cycle that ends meanwhile changes no outputs. */
static bool may_put(RTS_UI32 area)
{
    return area != APP_AREA_OUTPUT || IecCycleMayRun();
}

/* Finds a place, and puts its value there and into the copy that a task has of it. */
static RTS_NOINLINE void search_and_put(RTS_UI32 task, const FORCED_VALUE *forced)
{
    RTS_UI32 size = forced->place.size;
    AREA_ADDRESS address;
    RTS_UI8 *at;

    if (find(&forced->place, &address, &at) != MONITORING_ERR_OK || !may_put(address.area))
        return;
    put(at, forced);
    if (task == NO_TASK || !is_image(address.area))
        return;
    at = AppImageGetCopy(task, address.area, address.offset, size);
    if (at != NULL)
        put(at, forced);
}

/* ---- the cycle ---- */

static RTS_NOINLINE void put_others(RTS_UI32 task)
{
    const PUT *to = &force.puts[force.puts_of[LARGEST_PUT]];
    RTS_UI32 i;

    for (i = force.puts_of[2]; i != 0; i--, to++)
        *(volatile RTS_UI16 *)(void *)to->at = (RTS_UI16)to->value;
    for (i = force.puts_of[1]; i != 0; i--, to++)
        *(volatile RTS_UI8 *)to->at = (RTS_UI8)to->value;
    for (i = 0; i < force.count; i++) {
        if (force.list[i].is_searched)
            search_and_put(task, &force.list[i].forced);
    }
}

/* Before and after the code of each task. At most some us for 16 values, unless they are searched. */
static void put_all(RTS_UI32 task, const IEC_CONTEXT *context)
{
    RTS_UI32 lock = RTS_ONE_CORE ? 0 : SysLockEnter();
    RTS_UI32 left = force.puts_of[LARGEST_PUT];
    const PUT *to = force.puts;

    RTS_UNUSED(context);
    if (left != 0) {
        do { /* in pairs and counted down: less than four instructions each on a Cortex-M3 */
            *(volatile RTS_UI32 *)(void *)to[0].at = to[0].value;
            *(volatile RTS_UI32 *)(void *)to[1].at = to[1].value;
            to += 2;
        } while ((left -= 2) != 0);
    }
    if (force.has_others)
        put_others(task);
    if (!RTS_ONE_CORE)
        SysLockLeave(lock);
}

/* ---- the list ---- */

/* True if a task works on a copy of it, may do so after an online change, or may change it after the safe state. */
static bool is_copied(const APP_PLACE *place)
{
    RTS_UI32 task;

    if (!RTS_ONE_CORE || ONLINE_CHANGE)
        return is_image(place->area);
    for (task = 0; is_image(place->area) && task < IecTaskGetCount(); task++) {
        if (AppImageGetCopy(task, place->area, place->offset[0], place->size) != NULL)
            return true;
    }
    return false;
}

static bool may_overlap(const APP_PLACE *a, const APP_PLACE *b)
{
    return a->pointers > 0 ||
           (a->area == b->area && a->offset[0] < b->offset[0] + b->size && b->offset[0] < a->offset[0] + a->size);
}

/* True if the place is not always the same, cannot be stored in one access, or one that was forced before may be part of
 * it: the puts come first, in any order. */
static bool needs_search(const APP_PLACE *place)
{
    RTS_UI32 i;

    if (place->pointers > 0 || place->mask != PLACE_ALL_BITS || place->size > LARGEST_PUT || is_copied(place))
        return true;
    for (i = 0; i < force.count; i++) {
        if (may_overlap(&force.list[i].forced.place, place))
            return true;
    }
    return !is_aligned(AppGetAreaAddress(place->area, place->offset[0], place->size), place->size);
}

static RTS_UI32 index_of(const APP_PLACE *place)
{
    RTS_UI32 i = 0;

    while (i < force.count && memcmp(&force.list[i].forced.place, place, sizeof *place) != 0)
        i++;
    return i;
}

MON_RESULT ForceCheck(const APP_PLACE *place, RTS_UI32 *added)
{
    MON_RESULT result = AppPlaceCheck(place);
    AREA_ADDRESS address;
    RTS_UI8 *at;

    if (result == MONITORING_ERR_OK)
        result = find(place, &address, &at);
    if (result == MONITORING_ERR_OK && index_of(place) == force.count && force.count + ++*added > FORCE_MAX)
        result = MONITORING_ERR_FORCE_FAILED;
    return result;
}

static void remove_place(const APP_PLACE *place)
{
    RTS_UI32 i = index_of(place);

    if (i == force.count)
        return;
    force.count--;
    memmove(&force.list[i], &force.list[i + 1], (force.count - i) * sizeof force.list[0]);
}

static void sort_puts(void)
{
    PUT *to = force.puts;
    RTS_UI32 size, i;

    for (size = LARGEST_PUT; size != 0; size /= 2) {
        const PUT *first = to;
        for (i = 0; i < force.count; i++) {
            const FORCED_VALUE *forced = &force.list[i].forced;
            if (force.list[i].is_searched || forced->place.size != size)
                continue;
            to->at = AppGetAreaAddress(forced->place.area, forced->place.offset[0], size);
            to->value = forced->value[0];
            to++;
        }
        if (size == LARGEST_PUT) {
            force.has_others = to != first + force.count;
            if ((to - first) % 2 != 0) {
                *to = to[-1];
                to++;
            }
        }
        force.puts_of[size] = (RTS_UI32)(to - first);
    }
}

/* With the lock, which it gives back. Registers the phases when there are values, and only then. */
static void end_change(RTS_UI32 lock)
{
    bool has_some = force.count > 0;

    sort_puts();
    SysLockLeave(lock);
    force.serial++;
    if (has_some == force.has_phases)
        return;
    force.has_phases = has_some;
    if (has_some) {
        CyclePhaseAdd(CYCLE_BEFORE_CODE, &before_code);
        CyclePhaseAdd(CYCLE_AFTER_CODE, &after_code);
    } else {
        CyclePhaseRemove(CYCLE_BEFORE_CODE, &before_code);
        CyclePhaseRemove(CYCLE_AFTER_CODE, &after_code);
    }
    IecCycleFindPhases();
}

MON_RESULT ForceSet(const FORCED_VALUE *value)
{
    RTS_UI32 lock = SysLockEnter();
    bool has_room;

    remove_place(&value->place);
    has_room = force.count < FORCE_MAX;
    if (has_room) {
        ENTRY *entry = &force.list[force.count];
        entry->forced = *value;
        entry->is_searched = needs_search(&value->place);
        force.count++;
        search_and_put(NO_TASK, value);
    }
    end_change(lock);
    return has_room ? MONITORING_ERR_OK : MONITORING_ERR_FORCE_FAILED;
}

void ForceEnd(const APP_PLACE *place)
{
    RTS_UI32 lock = SysLockEnter();

    remove_place(place);
    end_change(lock);
}

void ForceEndAll(void)
{
    RTS_UI32 lock = SysLockEnter();

    force.count = 0;
    end_change(lock);
}

const FORCED_VALUE *ForceGet(RTS_UI32 index)
{
    return index < force.count ? &force.list[index].forced : NULL;
}

RTS_UI32 ForceGetCount(void)
{
    return force.count;
}

RTS_UI32 ForceGetRoom(void)
{
    return FORCE_MAX;
}

RTS_UI32 ForceGetSerial(void)
{
    return force.serial;
}

/* ---- the component ---- */

static void end_with_variables(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    ForceEndAll();
}

RTS_RESULT CmpForce_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(force);
    if (hook == CH_INIT3)
        return EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_PrepareExit, end_with_variables, NULL);
    return ERR_OK;
}

#endif
