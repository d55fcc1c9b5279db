/*
 * can_client.c - tools on the simulated CAN bus of the device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "can_client.h"

#include <string.h>

#include "comm_fakes.h"

#define NS_PER_MS 1000000
enum { PATIENCE_MS = 5000, QUIET_MS = 150, SETTLE_STEPS = 4000 };

static struct {
    CAN_TOOL tool[CAN_TOOLS];
    RTS_UI32 tools;
    RTS_I64 start_ns;
    RTS_UI32 passed_ms;
    bool fd;
} bus;

/* ---- a tool ---- */

void can_frame(const CAN_TOOL *tool, RTS_UI8 target, const void *data, RTS_UI8 size)
{
    CAN_FRAME frame = {.id = CAN_ID_BASE | (RTS_UI32)target << CAN_TARGET_SHIFT | tool->address,
                       .flags = CAN_FLAG_EXTENDED | (bus.fd ? CAN_FLAG_FD | CAN_FLAG_FAST : 0),
                       .size = (RTS_UI8)CanRoundSize(size)};

    memcpy(frame.data, data, size);
    (void)SimCanSend(tool->node, &frame);
}

static void keep_packet(CAN_TOOL *tool, RTS_UI32 size)
{
    RTS_UI32 place = (tool->first + tool->count) % TOOL_PACKETS;

    if (tool->count == TOOL_PACKETS || size > BLK_MAX_SIZE)
        return;
    memcpy(tool->packet[place], tool->in, size);
    tool->size[place] = size;
    tool->count++;
}

static void take_frame(CAN_TOOL *tool, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    RTS_UI32 size;

    if ((frame->id & CAN_ADDRESS_MASK) != DEVICE_NODE)
        return;
    if (IsoTpKind(frame->data, frame->size) == ISOTP_FLOW)
        tool->failed += IsoTpTakeFlow(&tool->tx, frame->data, frame->size, now_ms) == ISOTP_TX_FAILED;
    else if (IsoTpReceive(&tool->rx, frame->data, frame->size, now_ms, &size) == ISOTP_RX_DONE)
        keep_packet(tool, size);
}

static void poll_tool(CAN_TOOL *tool)
{
    RTS_UI8 data[ISOTP_MAX_FRAME];
    CAN_FRAME frame;
    RTS_UI32 size;

    while (SimCanReceive(tool->node, &frame) == ERR_OK)
        take_frame(tool, &frame, fakes.now_ms);
    if (!tool->mute && IsoTpFlow(&tool->rx, data)) {
        can_frame(tool, DEVICE_NODE, data, ISOTP_FLOW_SIZE);
        IsoTpFlowSent(&tool->rx);
    }
    while ((size = IsoTpNext(&tool->tx, data, fakes.now_ms)) != 0) {
        can_frame(tool, DEVICE_NODE, data, (RTS_UI8)size);
        IsoTpSent(&tool->tx, fakes.now_ms);
    }
    tool->failed += IsoTpSendExpired(&tool->tx, fakes.now_ms);
    (void)IsoTpReceiveExpired(&tool->rx, fakes.now_ms);
}

void can_restart(CAN_TOOL *tool)
{
    memset(&tool->tx, 0, sizeof(tool->tx));
    memset(&tool->rx, 0, sizeof(tool->rx));
    tool->rx.buffer = tool->in;
    tool->rx.capacity = sizeof(tool->in);
    tool->count = 0;
}

bool can_put(CAN_TOOL *tool, const RTS_UI8 *packet, RTS_UI32 size)
{
    if (IsoTpIsSending(&tool->tx))
        return false;
    memcpy(tool->out, packet, size);
    return IsoTpStart(&tool->tx, tool->out, size, bus.fd ? CAN_FD_SIZE : CAN_CLASSIC_SIZE, fakes.now_ms) == ERR_OK;
}

RTS_UI32 can_take(CAN_TOOL *tool, RTS_UI8 *packet, RTS_UI32 capacity)
{
    if (tool->count == 0)
        return 0;
    RTS_UI32 size = tool->size[tool->first] < capacity ? tool->size[tool->first] : capacity;
    memcpy(packet, tool->packet[tool->first], size);
    tool->first = (tool->first + 1) % TOOL_PACKETS;
    tool->count--;
    return size;
}

void can_drain(CAN_TOOL *tool)
{
    can_pass(ISOTP_TIMEOUT_MS + 10);
    tool->count = 0;
}

/* ---- time ---- */

/* Up to the end of the next frame, or the next millisecond. */
static void step(void)
{
    RTS_I64 limit = SimCanNow() + NS_PER_MS;
    RTS_I64 next = SimCanNext();

    SimCanAdvance(next < limit ? next : limit);
    RTS_UI32 ms = (RTS_UI32)((SimCanNow() - bus.start_ns) / NS_PER_MS);
    RTS_UI32 more = ms - bus.passed_ms;
    bus.passed_ms = ms;
    fakes_cycle(more);
    for (RTS_UI32 i = 0; i < bus.tools; i++)
        poll_tool(&bus.tool[i]);
}

void can_pass(RTS_UI32 ms)
{
    RTS_UI32 end = bus.passed_ms + ms;

    while (bus.passed_ms < end)
        step();
}

void can_settle(void)
{
    for (RTS_UI32 idle = 0, steps = 0; idle < 2 && steps < SETTLE_STEPS; steps++) {
        idle = SimCanNext() == INT64_MAX ? idle + 1 : 0;
        step();
    }
}

/* ---- for comm_client.h ---- */

static void send_packet(void *instance, const RTS_UI8 *packet, RTS_UI32 size)
{
    CAN_TOOL *tool = instance;

    (void)can_put(tool, packet, size);
    for (RTS_UI32 end = bus.passed_ms + PATIENCE_MS; IsoTpIsSending(&tool->tx) && bus.passed_ms < end;)
        step();
}

static RTS_UI32 receive_packet(void *instance, RTS_UI8 *packet, RTS_UI32 capacity)
{
    CAN_TOOL *tool = instance;

    for (RTS_UI32 end = bus.passed_ms + QUIET_MS; tool->count == 0 && bus.passed_ms < end;)
        step();
    return can_take(tool, packet, capacity);
}

CAN_TOOL *can_tool(RTS_UI8 address)
{
    CAN_TOOL *tool = &bus.tool[bus.tools++];

    tool->node = bus.tools; /* the device is 0 */
    tool->address = address;
    can_restart(tool);
    tool->link = (CLIENT_LINK){send_packet, receive_packet, tool};
    SimCanStart(tool->node);
    const CAN_FILTER own = {CAN_ID_BASE | (RTS_UI32)address << CAN_TARGET_SHIFT, 0x1FFFFF00, true};
    (void)SimCanSetFilters(tool->node, &own, 1);
    return tool;
}

void can_client(CLIENT *client, CAN_TOOL *tool)
{
    client_init(client, tool->address);
    client->link = &tool->link;
}

void can_start(RTS_UI32 bit_rate, RTS_UI32 data_bit_rate)
{
    memset(&bus, 0, sizeof(bus));
    SimCanReset(bit_rate, data_bit_rate);
    SimCanSetAddress(DEVICE_NODE, CAN_ID_BASE);
    bus.fd = data_bit_rate != 0;
    fakes_start();
}

void can_end(void)
{
    fakes_hook(CH_EXIT_COMM);
    fakes_hook(CH_EXIT3);
}
