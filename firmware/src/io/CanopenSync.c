/*
 * CanopenSync.c - SYNC of a CANopen network, and the events of tasks that run by it.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The events are posted also while the bus is off: tasks that run by SYNC keep their period.
 */
#include "CanopenSync.h"

#include "CmpIoMgrEmbedded.h"
#include "SchedEvents.h"
#include "SysAtomic.h"
#include "SysTime.h"
#include "SysTimer.h"

#if CANOPEN_MAX_DEVICES > 0

enum { HIGHEST = 0, NS_PER_US = 1000 };

/* ---- in the context of a timer, a task or the port ---- */

static void note_sync(CANOPEN_LINE *line)
{
    CANOPEN_SYNC_STATE *sync = &line->sync;

    (void)SchedPostExternalEvent(sync->sync_event);
    if (sync->window_us == 0)
        return;
    SysAtomicStore(&sync->is_open, 1);
    SysTimerTrigger(sync->window_timer, SysTimeGetNs() + (RTS_I64)sync->window_us * NS_PER_US);
}

static void send_sync(CANOPEN_LINE *line)
{
    CANOPEN_SYNC_STATE *sync = &line->sync;
    CAN_FRAME frame = {.id = CANOPEN_SYNC};

    if (sync->last != 0) {
        sync->counter = sync->counter < sync->last ? sync->counter + 1 : 1;
        frame.size = 1;
        frame.data[0] = sync->counter;
    }
    (void)CanSend(line->network, &frame);
    note_sync(line);
}

static void call_sync(void *param, RTS_I64 due_ns)
{
    RTS_UNUSED(due_ns);
    send_sync(param);
}

/* A timer without an interval may call without need. */
static void call_window(void *param, RTS_I64 due_ns)
{
    CANOPEN_SYNC_STATE *sync = &((CANOPEN_LINE *)param)->sync;

    RTS_UNUSED(due_ns);
    if (SysAtomicReplace(&sync->is_open, 1, 0))
        (void)SchedPostExternalEvent(sync->window_event);
}

void CanopenSyncInBusCycle(CANOPEN_LINE *line)
{
    if (line->sync.kind == CANOPEN_SYNC_IN_BUS_CYCLE)
        send_sync(line);
}

void CanopenSyncTake(CANOPEN_LINE *line)
{
    if (line->sync.kind == CANOPEN_SYNC_OF_OTHERS)
        note_sync(line);
}

/* ---- from main ---- */

static RTS_RESULT add_event(const CANOPEN_LINE *line, RTS_UI32 parameter, RTS_HANDLE *event)
{
    const char *name = IoMgrConfigGetParameterValueText(IoMgrConfigGetParameter(line->connector, parameter));
    RTS_RESULT result = ERR_OK;

    if (name == NULL)
        return ERR_OK;
    *event = SchedRegisterExternalEvent(name, &result);
    if (result == ERR_OK)
        return ERR_OK;
    return IoMgrConfigRefuse(line->connector, result,
                             result == ERR_DUPLICATE ? "there is an event %s already." : "no room for its event %s.",
                             name);
}

static RTS_RESULT add_timer(CANOPEN_LINE *line, SYS_TIMER_CALLBACK callback, RTS_UI32 every_us, RTS_HANDLE *timer)
{
    RTS_RESULT result = SysTimerCreate(callback, line, every_us, HIGHEST, timer);

    if (result == ERR_OK)
        result = SysTimerStart(*timer);
    return result == ERR_OK ? result : IoMgrConfigRefuse(line->connector, result, "no timer is left for its SYNC.");
}

RTS_RESULT CanopenSyncBegin(CANOPEN_LINE *line)
{
    CANOPEN_SYNC_STATE *sync = &line->sync;
    RTS_RESULT result = add_event(line, CANOPEN_PARAM_SYNC_EVENT, &sync->sync_event);

    if (sync->window_us != 0 && !SCHED_FREEWHEELING_IN_TIMERS)
        return IoMgrConfigRefuse(line->connector, ERR_NOT_SUPPORTED, "this device has no window of SYNC.");
    if (result == ERR_OK)
        result = add_event(line, CANOPEN_PARAM_WINDOW_EVENT, &sync->window_event);
    if (result == ERR_OK && sync->window_us != 0)
        result = add_timer(line, call_window, 0, &sync->window_timer);
    if (result == ERR_OK && sync->kind == CANOPEN_SYNC_BY_TIMER)
        result = add_timer(line, call_sync, sync->every_us, &sync->timer);
    return result;
}

void CanopenSyncEnd(CANOPEN_LINE *line)
{
    CANOPEN_SYNC_STATE *sync = &line->sync;

    (void)SysTimerDelete(sync->timer);
    (void)SysTimerDelete(sync->window_timer);
    (void)SchedUnregisterExternalEvent(sync->sync_event);
    (void)SchedUnregisterExternalEvent(sync->window_event);
    sync->timer = sync->window_timer = sync->sync_event = sync->window_event = RTS_INVALID_HANDLE;
}

#endif
