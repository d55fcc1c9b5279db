/*
 * SimCanBus.c - the CAN bus of the simulator (SimCan.h), on the virtual clock.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Node 0 is the device, node 1 a test, which hears and sends everything, node 2 all CANopen nodes (SimCanopen.h).
 */
#include "SimCanBus.h"

#include <string.h>

#include "../../src/io/CanopenDeviceDriver.h"
#include "../../src/io/CanopenDriver.h"
#include "IecCan.h"
#include "Sim.h"
#include "SimCan.h"
#include "SimCanopen.h"
#include "SysTime.h"

enum { TEST = 1, HEARD = 4096 };

static struct {
    bool is_catching_up;
    CAN_BUS_STATE state; /* of the device when main made its last pass */
    RTS_UI32 first;
    RTS_UI32 count;
    CAN_FRAME heard[HEARD];
} sim_bus;

/* The newest frames stay. */
static void hear(void)
{
    CAN_FRAME frame;

    while (SimCanReceive(TEST, &frame) == ERR_OK) {
        if (sim_bus.count == HEARD) {
            sim_bus.first = (sim_bus.first + 1) % HEARD;
            sim_bus.count--;
        }
        sim_bus.heard[(sim_bus.first + sim_bus.count++) % HEARD] = frame;
    }
}

RTS_I64 SimCanBusGetNextNs(void)
{
    RTS_I64 of_bus = SimCanNext();
    RTS_I64 of_nodes = SimCanopenGetDueNs();

    return of_bus < of_nodes ? of_bus : of_nodes;
}

/* Each frame, and what nodes do on it, at its time. */
static void advance(RTS_I64 now_ns)
{
    RTS_I64 next;

    while ((next = SimCanBusGetNextNs()) <= now_ns) {
        SimCanAdvance(next > SimCanNow() ? next : SimCanNow());
        SimCanopenRun(SimCanNow());
        hear();
    }
    if (SimCanNow() < now_ns)
        SimCanAdvance(now_ns);
}

/* A frame that a task or a timer sends is not sent before its time. */
static void catch_up(void)
{
    if (sim_bus.is_catching_up)
        return;
    sim_bus.is_catching_up = true;
    advance(SimNow());
    sim_bus.is_catching_up = false;
}

static CAN_BUS_STATE get_state(void)
{
    CAN_STATE state;

    SimCanGetState(SIM_CAN_DEVICE, &state);
    return state.bus;
}

bool SimCanBusRun(RTS_I64 now_ns)
{
    advance(now_ns);
    return SimCanHasWork(SIM_CAN_DEVICE) || IoDrvCanopenDeviceGetDueNs(now_ns) <= now_ns ||
           get_state() != sim_bus.state;
}

RTS_I64 SimCanBusGetDueNs(RTS_I64 now_ns)
{
    if (SimCanBusRun(now_ns) || IecCanWaits())
        return now_ns;
    RTS_I64 of_manager = IoDrvCanopenGetDueNs(now_ns);
    RTS_I64 of_device = IoDrvCanopenDeviceGetDueNs(now_ns);
    return of_manager < of_device ? of_manager : of_device;
}

RTS_RESULT SimCanPut(const SIM_CAN_FRAME *frame)
{
    CAN_FRAME sent = {.id = frame->id, .flags = frame->flags, .size = frame->size};

    if (frame->size > CAN_CLASSIC_SIZE)
        return ERR_PARAMETER;
    memcpy(sent.data, frame->data, frame->size);
    return SimIsOn() ? SimCanSend(TEST, &sent) : (RTS_RESULT)ERR_NOTINITIALIZED;
}

RTS_RESULT SimCanGet(SIM_CAN_FRAME *frame)
{
    const CAN_FRAME *heard = &sim_bus.heard[sim_bus.first];

    if (sim_bus.count == 0)
        return ERR_NOTHING_TO_DO;
    *frame = (SIM_CAN_FRAME){heard->id, heard->time_us, heard->flags, heard->size, {0}};
    memcpy(frame->data, heard->data, heard->size);
    sim_bus.first = (sim_bus.first + 1) % HEARD;
    sim_bus.count--;
    return ERR_OK;
}

RTS_RESULT SimCanBus_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT_SYSTEM) {
        memset(&sim_bus, 0, sizeof(sim_bus));
        SimCanReset(CAN_BIT_RATE, 0);
        SimCanSetClock(catch_up);
        SimCanStart(TEST);
        SimCanopenForget();
    }
    if (hook == CH_COMM_CYCLE) {
        advance(SysTimeGetNs());
        sim_bus.state = get_state();
    }
    return ERR_OK;
}
