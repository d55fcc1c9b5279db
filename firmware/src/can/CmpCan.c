/*
 * CmpCan.c - the CAN controllers, shared by their users.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpCan.h"

#if CAN_SHARED

#include <string.h>

#include "CanWatch.h"
#include "SysAtomic.h"
#include "SysLock.h"
#include "SysTime.h"

enum { READ_MAX = 64 }; /* frames per cycle, so that a busy bus does not stop the rest of the runtime */

typedef struct {
    bool open;
    bool has_urgent; /* an 11-bit frame passes the filters */
    CAN_WATCH watch;
    CAN_USER *first_user;
    CAN_BUS_COUNTERS counters;
    RTS_UI32 first; /* of the frames that wait, under SysLock */
    RTS_UI32 count;
    CAN_FRAME waiting[CAN_URGENT_FRAMES];
} CONTROLLER;

static CONTROLLER controllers[CAN_CONTROLLERS];

/* The context of the port reads it while main changes it: a user that is detached keeps its `next`. */
#define NEXT(place) (*(CAN_USER *volatile *)&(place))
#define FOR_EACH_USER(controller, user) \
    for (CAN_USER *user = NEXT((controller)->first_user); user != NULL; user = NEXT(user->next))

/* ---- sending ---- */

/* True if no 11-bit frame waits any more. */
static bool send_waiting(RTS_UI32 index, CONTROLLER *controller)
{
    while (controller->count != 0) {
        if (SysCanSend(index, &controller->waiting[controller->first]) == ERR_NOBUFFER)
            return false;
        controller->first = (controller->first + 1) % CAN_URGENT_FRAMES;
        controller->count--;
    }
    return true;
}

static RTS_RESULT add_waiting(CONTROLLER *controller, const CAN_FRAME *frame)
{
    if (controller->count == CAN_URGENT_FRAMES)
        return ERR_NOBUFFER;
    controller->waiting[(controller->first + controller->count) % CAN_URGENT_FRAMES] = *frame;
    controller->count++;
    return ERR_OK;
}

static RTS_RESULT send(RTS_UI32 index, CONTROLLER *controller, const CAN_FRAME *frame)
{
    bool urgent = (frame->flags & CAN_FLAG_EXTENDED) == 0;
    RTS_RESULT result = ERR_NOBUFFER;

    if (send_waiting(index, controller))
        result = SysCanSend(index, frame);
    return result == ERR_NOBUFFER && urgent ? add_waiting(controller, frame) : result;
}

RTS_RESULT CanSend(RTS_UI32 index, const CAN_FRAME *frame)
{
    if (index >= CAN_CONTROLLERS || !controllers[index].open)
        return ERR_DEVICE;
    if (!CanIsFrame(frame))
        return ERR_PARAMETER;
    RTS_UI32 lock = SysLockEnter();
    RTS_RESULT result = send(index, &controllers[index], frame);
    SysLockLeave(lock);
    return result;
}

/* ---- receiving ---- */

/* In the context of the port. */
static bool take_urgent(RTS_UI32 index, const CAN_FRAME *frame)
{
    bool is_done = true;

    FOR_EACH_USER (&controllers[index], user) {
        if (user->take_urgent != NULL)
            is_done = user->take_urgent(index, frame) && is_done;
        else
            is_done = is_done && !user->has_short; /* main looks whether it passes */
    }
    return is_done;
}

static void take(RTS_UI32 index, CONTROLLER *controller, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    bool is_wanted = false;

    FOR_EACH_USER (controller, user) {
        if (user->take == NULL || !CanPasses(user->filters, user->filter_count, frame))
            continue;
        user->take(index, frame, now_ms);
        is_wanted = true;
    }
    controller->counters.unwanted += !is_wanted;
}

/* Each frame at its own time: a service that the previous one has completed may take long. */
static void receive(RTS_UI32 index, CONTROLLER *controller)
{
    CAN_FRAME frame;

    for (RTS_UI32 i = 0; i < READ_MAX && controller->open && SysCanReceive(index, &frame) == ERR_OK; i++)
        take(index, controller, &frame, SysTimeGetMs());
}

/* ---- filters ---- */

typedef struct {
    CAN_FILTER filter[CAN_FILTERS];
    RTS_UI32 count;
    bool has_urgent;
} FILTERS;

static bool is_same(const CAN_FILTER *a, const CAN_FILTER *b)
{
    return a->extended == b->extended && a->mask == b->mask && ((a->id ^ b->id) & a->mask) == 0;
}

static bool add_filter(FILTERS *filters, const CAN_FILTER *filter)
{
    filters->has_urgent = filters->has_urgent || !filter->extended;
    for (RTS_UI32 i = 0; i < filters->count; i++)
        if (is_same(&filters->filter[i], filter))
            return true;
    if (filters->count == CAN_FILTERS)
        return false;
    filters->filter[filters->count++] = *filter;
    return true;
}

static bool merge(CONTROLLER *controller, FILTERS *filters)
{
    bool fits = true;

    FOR_EACH_USER (controller, user) {
        bool has_short = false;
        for (RTS_UI32 i = 0; i < user->filter_count; i++) {
            fits = add_filter(filters, &user->filters[i]) && fits;
            has_short = has_short || !user->filters[i].extended;
        }
        user->has_short = has_short;
    }
    return fits;
}

/* More filters than the controller has: it lets all frames pass, and their users look at them. */
static void merge_all(CONTROLLER *controller, FILTERS *filters)
{
    static const CAN_FILTER all[] = {{0, 0, false}, {0, 0, true}};

    memset(filters, 0, sizeof(*filters));
    if (merge(controller, filters))
        return;
    memcpy(filters->filter, all, sizeof(all));
    filters->count = RTS_COUNT(all);
    filters->has_urgent = true;
}

RTS_RESULT CanUpdateFilters(RTS_UI32 index)
{
    CONTROLLER *controller = &controllers[index];
    FILTERS filters;

    if (!controller->open)
        return ERR_DEVICE;
    merge_all(controller, &filters);
    if (filters.has_urgent != controller->has_urgent)
        SysCanSetUrgent(index, filters.has_urgent ? take_urgent : NULL);
    controller->has_urgent = filters.has_urgent;
    return SysCanSetFilters(index, filters.filter, filters.count);
}

/* ---- users ---- */

/* Where the list leads to the user; NULL: the end of the list. */
static CAN_USER **find_place(CONTROLLER *controller, const CAN_USER *user)
{
    CAN_USER **place = &controller->first_user;

    while (*place != user && *place != NULL)
        place = &(*place)->next;
    return place;
}

static RTS_RESULT open_controller(RTS_UI32 index, CONTROLLER *controller)
{
    RTS_RESULT result = controller->open ? ERR_OK : SysCanOpen(index, 0, 0);

    controller->open = result == ERR_OK;
    return result;
}

static void close_controller(RTS_UI32 index, CONTROLLER *controller)
{
    SysCanSetUrgent(index, NULL);
    SysCanClose(index);
    memset(controller, 0, sizeof(*controller));
}

RTS_RESULT CanAttach(RTS_UI32 index, CAN_USER *user)
{
    if (index >= CAN_CONTROLLERS || index >= SysCanGetCount())
        return ERR_DEVICE;
    CAN_USER **place = find_place(&controllers[index], user);
    if (*place != NULL)
        return ERR_DUPLICATE;
    RTS_RESULT result = open_controller(index, &controllers[index]);
    if (result != ERR_OK)
        return result;
    user->next = NULL;
    SysAtomicFence();
    NEXT(*place) = user;
    result = CanUpdateFilters(index);
    if (result != ERR_OK)
        CanDetach(index, user);
    return result;
}

void CanDetach(RTS_UI32 index, CAN_USER *user)
{
    CAN_USER **place = index < CAN_CONTROLLERS ? find_place(&controllers[index], user) : NULL;

    if (place == NULL || *place == NULL)
        return;
    NEXT(*place) = user->next;
    if (controllers[index].first_user != NULL)
        (void)CanUpdateFilters(index);
    else
        close_controller(index, &controllers[index]);
}

bool CanIsReserved(RTS_UI32 index, RTS_UI32 id)
{
    FOR_EACH_USER (&controllers[index], user)
        if (user->reserves != NULL && user->reserves(index, id))
            return true;
    return false;
}

/* ---- the bus ---- */

bool CanIsOff(RTS_UI32 index)
{
    return index < CAN_CONTROLLERS && controllers[index].watch.off;
}

const CAN_BUS_COUNTERS *CanGetCounters(RTS_UI32 index)
{
    return &controllers[index].counters;
}

static void watch_bus(RTS_UI32 index, CONTROLLER *controller)
{
    if (!CanWatchPoll(&controller->watch, index, CMPID_CmpCan, SysTimeGetMs()))
        return;
    controller->counters.bus_off += controller->watch.off;
    if (controller->watch.off) {
        RTS_UI32 lock = SysLockEnter();
        controller->count = 0;
        SysLockLeave(lock);
    }
    FOR_EACH_USER (controller, user)
        if (user->note_bus != NULL)
            user->note_bus(index, controller->watch.off);
}

static void cycle(RTS_UI32 index, CONTROLLER *controller)
{
    if (!controller->open)
        return;
    receive(index, controller);
    RTS_UI32 lock = SysLockEnter();
    bool waits = !send_waiting(index, controller);
    SysLockLeave(lock);
    if (waits)
        SysTimeWantPass(1);
    watch_bus(index, controller);
}

RTS_RESULT CmpCan_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(controllers);
    if (hook != CH_COMM_CYCLE)
        return ERR_OK;
    for (RTS_UI32 i = 0; i < CAN_CONTROLLERS; i++)
        cycle(i, &controllers[i]);
    return ERR_OK;
}

#endif
