/*
 * SimEvent.c - external events of the simulated device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpScheduleTimer.h"
#include "Sim.h"
#include "rts_config.h"
#include "sim_port.h"

/* The hardware's, so they survive a loss of power. */
static struct {
    RTS_UI32 count;
    struct {
        char name[SIM_EVENT_NAME_SIZE];
        RTS_HANDLE event;
    } list[SCHED_MAX_EXTERNAL_EVENTS];
} events;

static RTS_RESULT register_event(RTS_UI32 index)
{
    RTS_RESULT result;

    events.list[index].event = SchedRegisterExternalEvent(events.list[index].name, &result);
    return result;
}

static RTS_UI32 find_event(const char *name)
{
    RTS_UI32 i = 0;

    while (i < events.count && strcmp(events.list[i].name, name) != 0)
        i++;
    return i;
}

RTS_RESULT SimAddEvent(const char *name)
{
    RTS_SIZE size = strlen(name) + 1;

    if (find_event(name) < events.count)
        return ERR_OK;
    if (size < 2 || size > SIM_EVENT_NAME_SIZE)
        return ERR_PARAMETER;
    if (events.count == SCHED_MAX_EXTERNAL_EVENTS)
        return ERR_NOMEMORY;
    memcpy(events.list[events.count].name, name, size);
    events.count++;
    return SimIsOn() ? register_event(events.count - 1) : ERR_OK;
}

RTS_RESULT SimPostEvent(const char *name)
{
    RTS_UI32 index = find_event(name);

    if (index >= events.count)
        return ERR_NO_OBJECT;
    return SchedPostExternalEvent(events.list[index].event);
}

void SimForgetEvents(void)
{
    for (; events.count > 0; events.count--) {
        if (SimIsOn())
            (void)SchedUnregisterExternalEvent(events.list[events.count - 1].event);
    }
}

RTS_RESULT SimEventRegisterAll(void)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    for (i = 0; i < events.count && result == ERR_OK; i++)
        result = register_event(i);
    return result;
}
