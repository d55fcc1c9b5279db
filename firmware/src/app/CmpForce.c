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

/* How a value is stored: in one access of so many bytes, or one of these. */
enum { STORE_END = 0, STORE_BITS = 3, STORE_MISFIT = 5, STORE_SEARCHED = 6 };

typedef struct {
    RTS_UI32 store;
    RTS_UI8 *at; /* of those that are not searched */
    FORCED_VALUE forced;
} ENTRY;

#define NO_TASK 0xFFFFFFFFu

static struct {
    RTS_UI32 count;
    RTS_UI32 serial;
    ENTRY list[FORCE_MAX + 1]; /* after the last one STORE_END */
} force;

static void put_all(RTS_UI32 task, const IEC_CONTEXT *context);

static CYCLE_ENTRY before_code = {put_all, NULL};
static CYCLE_ENTRY after_code = {put_all, NULL};

/* ---- one value ---- */

static RTS_UI32 store_of(const APP_PLACE *place, const RTS_UI8 *at)
{
    if (place->mask != PLACE_ALL_BITS)
        return STORE_BITS;
    return ((uintptr_t)at & (place->size - 1u)) == 0 ? place->size : STORE_MISFIT;
}

/* The other bits may be changed by tasks of a higher priority. */
static void set_bits(RTS_UI8 *at, const FORCED_VALUE *forced)
{
    RTS_UI32 lock = RTS_ONE_CORE ? SysLockEnter() : 0;

    SysAtomicSetBits(at, forced->place.mask, (RTS_UI8)forced->value);
    if (RTS_ONE_CORE)
        SysLockLeave(lock);
}

/* Inlined where `store` is a constant. */
static RTS_INLINE void put(RTS_UI32 store, RTS_UI8 *at, const FORCED_VALUE *forced)
{
    switch (store) {
    case 1:
        *(volatile RTS_UI8 *)at = (RTS_UI8)forced->value;
        break;
    case 2:
        *(volatile RTS_UI16 *)(void *)at = (RTS_UI16)forced->value;
        break;
    case 4:
        *(volatile RTS_UI32 *)(void *)at = (RTS_UI32)forced->value;
        break;
    case 8:
        *(volatile RTS_UI64 *)(void *)at = forced->value;
        break;
    case STORE_BITS:
        set_bits(at, forced);
        break;
    default:
        memcpy(at, &forced->value, forced->place.size);
        break;
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
    put(store_of(&forced->place, at), at, forced);
    if (task == NO_TASK || !is_image(address.area))
        return;
    at = AppImageGetCopy(task, address.area, address.offset, size);
    if (at != NULL)
        put(store_of(&forced->place, at), at, forced);
}

/* ---- the cycle ---- */

/* A run of entries that are stored the same way costs a few instructions for each. */
#define PUT_RUN(kind)                             \
    case kind:                                    \
        do                                        \
            put(kind, entry->at, &entry->forced); \
        while ((++entry)->store == (kind));       \
        break

/* Before and after the code of each task. At most some us for 16 values, unless pointers lead to them. */
static void put_all(RTS_UI32 task, const IEC_CONTEXT *context)
{
    RTS_UI32 lock = RTS_ONE_CORE ? 0 : SysLockEnter();
    const ENTRY *entry = force.list;

    RTS_UNUSED(context);
    while (entry->store != STORE_END) {
        switch (entry->store) {
            PUT_RUN(1);
            PUT_RUN(2);
            PUT_RUN(4);
        case STORE_SEARCHED:
            search_and_put(task, &entry->forced);
            entry++;
            break;
        default:
            put(entry->store, entry->at, &entry->forced);
            entry++;
            break;
        }
    }
    if (!RTS_ONE_CORE)
        SysLockLeave(lock);
}

/* ---- the list ---- */

/* Whether a task works on a copy of it, may do so after an online change, or may change it after the safe state. */
static bool needs_search(const APP_PLACE *place)
{
    RTS_UI32 task;

    if (place->pointers > 0)
        return true;
    if (!is_image(place->area))
        return false;
    for (task = 0; task < IecTaskGetCount(); task++) {
        if (AppImageGetCopy(task, place->area, place->offset[0], place->size) != NULL)
            return true;
    }
    return !RTS_ONE_CORE || ONLINE_CHANGE;
}

MON_RESULT ForceCheck(const APP_PLACE *place)
{
    MON_RESULT result = AppPlaceCheck(place);
    AREA_ADDRESS address;
    RTS_UI8 *at;

    return result == MONITORING_ERR_OK ? find(place, &address, &at) : result;
}

static bool is_same(const APP_PLACE *a, const APP_PLACE *b)
{
    return memcmp(a, b, sizeof *a) == 0;
}

static RTS_UI32 index_of(const APP_PLACE *place)
{
    RTS_UI32 i = 0;

    while (i < force.count && !is_same(&force.list[i].forced.place, place))
        i++;
    return i;
}

bool ForceHas(const APP_PLACE *place)
{
    return index_of(place) < force.count;
}

static void remove_place(const APP_PLACE *place)
{
    RTS_UI32 i = index_of(place);

    if (i == force.count)
        return;
    memmove(&force.list[i], &force.list[i + 1], (force.count - i) * sizeof force.list[0]);
    force.count--;
}

/* Registers the phases when there are values, and only then. */
static void note_change(bool had_some)
{
    bool has_some = force.count > 0;

    force.serial++;
    if (has_some == had_some)
        return;
    if (has_some) {
        CyclePhaseAdd(CYCLE_BEFORE_CODE, &before_code);
        CyclePhaseAdd(CYCLE_AFTER_CODE, &after_code);
    } else {
        CyclePhaseRemove(CYCLE_BEFORE_CODE, &before_code);
        CyclePhaseRemove(CYCLE_AFTER_CODE, &after_code);
    }
    IecCycleFindPhases();
}

static void append(const APP_PLACE *place, RTS_UI64 value)
{
    ENTRY *entry = &force.list[force.count];

    entry->forced.place = *place;
    entry->forced.value = value;
    entry->at = NULL;
    entry->store = STORE_SEARCHED;
    if (!needs_search(place)) {
        entry->at = AppGetAreaAddress(place->area, place->offset[0], place->size);
        entry->store = store_of(place, entry->at);
    }
    force.list[++force.count].store = STORE_END;
}

MON_RESULT ForceSet(const APP_PLACE *place, RTS_UI64 value)
{
    bool had_some = force.count > 0;
    bool has_room;
    RTS_UI32 lock = SysLockEnter();

    remove_place(place);
    has_room = force.count < FORCE_MAX;
    if (has_room) {
        append(place, value);
        search_and_put(NO_TASK, &force.list[force.count - 1].forced);
    }
    SysLockLeave(lock);
    note_change(had_some);
    return has_room ? MONITORING_ERR_OK : MONITORING_ERR_FORCE_FAILED;
}

void ForceEnd(const APP_PLACE *place)
{
    bool had_some = force.count > 0;
    RTS_UI32 lock = SysLockEnter();

    remove_place(place);
    SysLockLeave(lock);
    note_change(had_some);
}

void ForceEndAll(void)
{
    bool had_some = force.count > 0;
    RTS_UI32 lock = SysLockEnter();

    force.count = 0;
    force.list[0].store = STORE_END;
    SysLockLeave(lock);
    note_change(had_some);
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
