/*
 * IoDrvCanopen.c - driver of CANopen nodes, whose manager this device is.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Nodes are managed in CH_COMM_CYCLE (CanopenMaster.h). PDOs are received in the context of the port and sent by the bus
 * cycle task; tasks copy from and to their data.
 */
#include "IoDrvCanopen.h"

#include <string.h>

#include "CMUtils.h"
#include "AppState.h"
#include "CanopenCalls.h"
#include "CanopenDriver.h"
#include "CanopenSync.h"
#include "CanopenTime.h"
#include "CmpIoMgrEmbedded.h"
#include "CmpLog.h"
#include "SysAtomic.h"
#include "SysLock.h"
#include "SysTime.h"
#include "SysTimeRtc.h"

#if CANOPEN_MAX_DEVICES > 0

enum { READ_TRIES = 4, NS_PER_MS = 1000000, EMCY_LOG_MS = 1000, OTHER_LOG_MS = 60000 };
enum { BITS_PER_SEGMENT_MS = 140000, DEFAULT_BURST = 2 }; /* bit/s at which a segment takes a millisecond */

static CANOPEN_SETUP setup;
static bool is_running; /* between IoDrvUpdateMapping and the next configuration */

static const ICmpIoDrv functions;
static IO_DRIVER driver = {.functions = &functions};

static const CAN_FILTER filters[] = {{0, 0, false}}; /* all frames of 11 bits */

#define FOR_EACH_LINE(line)                                                              \
    for (CANOPEN_LINE *line = setup.lines; line < setup.lines + CAN_CONTROLLERS; line++) \
        if (line->connector != NULL)
#define FOR_EACH_DEVICE(line, device)                                                                         \
    for (CANOPEN_DEVICE *device = (line)->devices; device < (line)->devices + (line)->device_count; device++) \
        if (device->used)

CANOPEN_SETUP *IoDrvCanopenGetSetup(void)
{
    return &setup;
}

static const IoDrvInfo *get_info(void)
{
    static const IoDrvInfo info = {"IoDrvCanopen", "CANopen", "Open PLC runtime", 0x00010000};

    return &info;
}

/* ---- frames ---- */

static bool send(void *owner, const CAN_FRAME *frame)
{
    const CANOPEN_LINE *line = owner;

    return CanSend(line->network, frame) == ERR_OK;
}

/* In the context of the port. */
static bool take_urgent(RTS_UI32 index, const CAN_FRAME *frame)
{
    CANOPEN_PDO_STATE *state = CanopenFindInput(&setup.lines[index], frame->id);

    if (frame->id == CANOPEN_SYNC && (frame->flags & CAN_FLAG_REMOTE) == 0)
        CanopenSyncTake(&setup.lines[index]);
    if (state == NULL || (frame->flags & CAN_FLAG_REMOTE) != 0)
        return false;
    if (frame->size < CanopenPdoSize(state))
        return false; /* main counts it */
    RTS_UI32 next = state->of.in.number + 1;
    memcpy(state->of.in.data[next % 2], frame->data, CANOPEN_PDO_SIZE); /* a frame has as many, wanted or not */
    if (state->within_ms != 0)
        SysAtomicStore(&state->of.in.received_ms, SysTimeGetMs());
    SysAtomicStore(&state->of.in.number, next);
    return true;
}

static void count_short(const CANOPEN_LINE *line, const CANOPEN_PDO_STATE *state)
{
    FOR_EACH_DEVICE (line, device)
        if (state >= device->pdos && state < device->pdos + device->pdo_count)
            device->node.counters.short_pdos++;
}

/* At most one entry a minute. */
static void log_other(CANOPEN_LINE *line, RTS_UI32 what, RTS_UI32 now_ms)
{
    const char *name = IoMgrConfigGetName(line->connector);

    if (line->noted_ms[what] != 0 && now_ms - line->noted_ms[what] < OTHER_LOG_MS)
        return;
    line->noted_ms[what] = now_ms | 1;
    if (what == CANOPEN_OTHER_MASTER)
        LogAdd(CMPID_IoDrvCanopen, LOG_WARNING, ERR_DUPLICATE, "%s: another NMT master sends commands", name);
    else
        LogAdd(CMPID_IoDrvCanopen, LOG_WARNING, ERR_DUPLICATE, "%s: another device has number %u, as we", name,
               (unsigned)line->own_node);
}

static void note_others(CANOPEN_LINE *line, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    if ((frame->flags & CAN_FLAG_REMOTE) != 0)
        return;
    if (frame->id == CANOPEN_NMT && frame->size == 2)
        log_other(line, CANOPEN_OTHER_MASTER, now_ms);
    else if (line->own_node != 0 && frame->id == CANOPEN_HEARTBEAT + (RTS_UI32)line->own_node)
        log_other(line, CANOPEN_OTHER_WITH_OUR_NUMBER, now_ms);
}

static void take(RTS_UI32 index, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    CANOPEN_LINE *line = &setup.lines[index];
    CANOPEN_DEVICE *device = CanopenFindNode(line, frame->id & CANOPEN_NODE_MASK);
    const CANOPEN_PDO_STATE *input = CanopenFindInput(line, frame->id);

    note_others(line, frame, now_ms);
    if (input != NULL) {
        if (frame->size < CanopenPdoSize(input))
            count_short(line, input);
    } else if (!CanopenCallsTake(index, frame, now_ms) && device != NULL) {
        CanopenNodeTake(&device->node, frame, now_ms);
    }
}

/* Programs must not send what the manager does. */
static bool is_reserved(RTS_UI32 network, RTS_UI32 id)
{
    const CANOPEN_LINE *line = &setup.lines[network];
    RTS_UI32 node = id & CANOPEN_NODE_MASK;
    RTS_UI32 function = id & CANOPEN_FUNCTION_MASK;

    if (line->connector == NULL)
        return false;
    for (RTS_UI32 i = 0; i < setup.pdo_count; i++)
        if (setup.pdos[i].cob == id)
            return true;
    return id == CANOPEN_NMT || id == CANOPEN_SYNC || (id == CANOPEN_TIME && line->time_ms != 0) ||
           ((function == CANOPEN_SDO_REPLY || function == CANOPEN_SDO_REQUEST || function == CANOPEN_HEARTBEAT ||
             function == CANOPEN_EMCY) &&
            (line->by_node[node] != 0 || node == line->own_node));
}

/* ---- configuration ---- */

static void release(CANOPEN_LINE *line)
{
    FOR_EACH_DEVICE (line, device)
        if (device->node.state == MASTER_RUNS || device->node.state == MASTER_START)
            (void)CanopenSendNmt(send, line, NMT_PREOPERATIONAL, device->node.node);
    if (line->attached)
        CanopenSyncEnd(line);
    if (line->attached)
        CanDetach(line->network, &line->user);
    line->attached = false;
}

static RTS_RESULT update_configuration(const IoConfigConnector *connectors, int count)
{
    RTS_UNUSED(connectors);
    RTS_UNUSED(count);
    FOR_EACH_LINE (line)
        release(line);
    is_running = false;
    memset(&setup, 0, sizeof(setup));
    CanopenCallsBegin(&setup, send);
    return ERR_OK;
}

static RTS_RESULT check_channel(const IoConfigConnector *connector, const IoConfigChannelMap *channel, RTS_UI32 type)
{
    const CANOPEN_PDO_STATE *state = CanopenFindPdo(&setup, connector, channel->parameter);

    if (CanopenFindDevice(&setup, connector) == NULL)
        return ERR_OK; /* an optional one that was refused */
    if (state == NULL || ((state->flags & CANOPEN_PDO_OUTPUT) != 0) != (type == IO_MAP_OUTPUTS) ||
        channel->parameter_bit + channel->bits > 8u * CanopenPdoSize(state))
        return IoMgrConfigRefuse(connector, ERR_PARAMETER, "a channel is not in its PDOs.");
    return ERR_OK;
}

static RTS_RESULT attach(CANOPEN_LINE *line)
{
    line->user = (CAN_USER){.filters = filters,
                            .filter_count = RTS_COUNT(filters),
                            .take_urgent = take_urgent,
                            .take = take,
                            .reserves = is_reserved};
    RTS_RESULT result = CanAttach(line->network, &line->user);
    line->attached = result == ERR_OK;
    if (!line->attached)
        return IoMgrConfigRefuse(line->connector, result, "the CAN network %u cannot be opened.",
                                 (unsigned)line->network);
    return ERR_OK;
}

/* An optional node that was refused is not started. */
static void leave_out_refused(CANOPEN_LINE *line)
{
    for (CANOPEN_DEVICE *device = line->devices; device < line->devices + line->device_count; device++) {
        device->used = IoMgrConfigIsMine(device->connector, &driver);
        if (!device->used)
            line->by_node[device->node.node] = 0;
    }
}

static RTS_RESULT update_mapping(const IoConfigTaskMap *task_maps, int count)
{
    RTS_RESULT result = CanopenSetUp(&setup, &driver);

    if (result == ERR_OK)
        result = IoMgrConfigEachChannel(task_maps, count, &driver, check_channel);
    FOR_EACH_LINE (line)
        if (result == ERR_OK) {
            leave_out_refused(line);
            result = attach(line);
            if (result == ERR_OK)
                result = CanopenSyncBegin(line);
        }
    is_running = result == ERR_OK;
    return result;
}

/* ---- tasks ---- */

/* The newest data of an input; a frame that arrives meanwhile writes the other copy. */
static void read_newest(const CANOPEN_PDO_STATE *state, RTS_UI8 *data)
{
    RTS_UI32 number;
    RTS_UI32 tries = 0;

    do {
        number = SysAtomicLoad(&state->of.in.number);
        memcpy(data, state->of.in.data[number % 2], CANOPEN_PDO_SIZE);
        SysAtomicFence();
    } while (SysAtomicLoad(&state->of.in.number) != number && ++tries < READ_TRIES);
}

static void copy_output(const IoConfigConnector *connector, const IoConfigChannelMap *channel, CANOPEN_PDO_STATE *state)
{
    if (SysAtomicLoad(&CanopenFindDevice(&setup, connector)->line->is_safe) != 0)
        IoMgrCopySafeOutputLE(channel, state->of.out.data);
    else
        IoMgrCopyOutputLE(channel, state->of.out.data);
}

static void copy(const IoConfigConnectorMap *map, bool is_output)
{
    const IoConfigConnector *connector = IoMgrConfigGetConnector(map->connector);
    const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(map);
    RTS_UI8 data[CANOPEN_PDO_SIZE];
    RTS_UI32 last = 0;

    for (RTS_UI32 count = map->channel_map_count; count > 0; count--, channel++) {
        CANOPEN_PDO_STATE *state = CanopenFindPdo(&setup, connector, channel->parameter);
        if (state == NULL)
            continue;
        if (is_output) {
            copy_output(connector, channel, state);
            continue;
        }
        if (channel->parameter != last)
            read_newest(state, data);
        last = channel->parameter;
        IoMgrCopyInputLE(channel, data);
    }
}

static RTS_RESULT copy_all(const IoConfigConnectorMap *maps, int count, bool is_output)
{
    RTS_UI32 lock = SysLockEnter();

    for (; count > 0; count--, maps++)
        copy(maps, is_output);
    SysLockLeave(lock);
    return ERR_OK;
}

static RTS_RESULT read_inputs(const IoConfigConnectorMap *maps, int count)
{
    return copy_all(maps, count, false);
}

static RTS_RESULT write_outputs(const IoConfigConnectorMap *maps, int count)
{
    return copy_all(maps, count, true);
}

static bool is_due(const CANOPEN_PDO_STATE *state, const RTS_UI8 *out, RTS_UI32 run, RTS_UI32 now_ms)
{
    if ((state->flags & CANOPEN_PDO_SYNC) != 0 || state->of.out.sent_run != run)
        return true;
    return memcmp(out, state->of.out.sent, CanopenPdoSize(state)) != 0 ||
           (state->within_ms != 0 && now_ms - state->of.out.sent_ms >= state->within_ms);
}

static void send_output(CANOPEN_LINE *line, CANOPEN_PDO_STATE *state, RTS_UI32 run, RTS_UI32 now_ms)
{
    CAN_FRAME frame = {.id = state->cob, .size = (RTS_UI8)CanopenPdoSize(state)};
    RTS_UI32 lock = SysLockEnter();

    memcpy(frame.data, state->of.out.data, CANOPEN_PDO_SIZE);
    SysLockLeave(lock);
    if (!is_due(state, frame.data, run, now_ms) || !send(line, &frame))
        return;
    memcpy(state->of.out.sent, frame.data, CANOPEN_PDO_SIZE);
    state->of.out.sent_run = run;
    state->of.out.sent_ms = now_ms;
}

static RTS_RESULT start_bus_cycle(const IoConfigConnector *connector)
{
    RTS_UI32 now_ms = SysTimeGetMs();

    FOR_EACH_LINE (line) {
        if (line->connector != connector || !line->attached)
            continue;
        CanopenSyncInBusCycle(line);
        FOR_EACH_DEVICE (line, device) {
            RTS_UI32 run = SysAtomicLoad(&device->runs);
            for (RTS_UI32 i = 0; i < device->pdo_count && run != 0; i++)
                if ((device->pdos[i].flags & CANOPEN_PDO_OUTPUT) != 0)
                    send_output(line, &device->pdos[i], run, now_ms);
        }
    }
    return ERR_OK;
}

/* ---- main ---- */

/* How long it is until an input of a node that runs is late [ms]; UINT32_MAX: never. */
static RTS_UI32 get_deadline_ms(const CANOPEN_DEVICE *device, RTS_UI32 now_ms, bool *has_all)
{
    RTS_UI32 wait_ms = UINT32_MAX;

    *has_all = true;
    for (RTS_UI32 i = 0; i < device->pdo_count; i++) {
        const CANOPEN_PDO_STATE *state = &device->pdos[i];
        if ((state->flags & CANOPEN_PDO_OUTPUT) != 0 || state->within_ms == 0)
            continue;
        RTS_UI32 since_ms = now_ms - SysAtomicLoad(&state->of.in.received_ms);
        RTS_UI32 left_ms = since_ms < state->within_ms ? state->within_ms - since_ms : 0;
        *has_all = *has_all && left_ms != 0;
        wait_ms = left_ms < wait_ms ? left_ms : wait_ms;
    }
    return wait_ms;
}

static const char *describe_step(const CANOPEN_NODE *node)
{
    switch (node->why) {
    case MASTER_WHY_SILENT:
        return "it does not reply";
    case MASTER_WHY_NO_HEARTBEAT:
        return "it sends no heartbeat after its start";
    case MASTER_WHY_LOST:
        return node->heartbeat_ms != 0 ? "its heartbeat is missing" : "it does not reply to guarding";
    case MASTER_WHY_RESTARTED:
        return "it has restarted";
    case MASTER_WHY_STATE:
        return "it has left the operational state";
    case MASTER_WHY_LATE:
        return "one of its PDOs is late";
    case MASTER_WHY_BUS:
        return "the bus is off";
    case MASTER_WHY_DUPLICATE:
        return "two devices have its number";
    case MASTER_WHY_HALTED:
        return "it waits for a node that is lost";
    case MASTER_WHY_HELD:
        return "the program has taken it out of operation";
    default:
        return "it is not in operation yet";
    }
}

enum { HEX_DIGITS = 4, PLACE_SIZE = sizeof("2001:00") };

static char *put_hex(char *text, RTS_UI32 value, RTS_UI32 digits)
{
    while (digits-- > 0)
        *text++ = "0123456789ABCDEF"[value >> 4 * digits & 0x0F];
    *text = '\0';
    return text;
}

/* What it is instead of what is expected; NULL: that is not why. */
static const char *find_other(const CANOPEN_NODE *node)
{
    switch (node->why) {
    case MASTER_WHY_TYPE:
        return "device type";
    case MASTER_WHY_VENDOR:
        return "vendor";
    case MASTER_WHY_PRODUCT:
        return "product";
    case MASTER_WHY_REVISION:
        return "revision";
    default:
        return NULL;
    }
}

static void explain_loss(const IoConfigConnector *connector, char *text, RTS_SIZE size)
{
    const CANOPEN_DEVICE *device = CanopenFindDevice(&setup, connector);
    char place[PLACE_SIZE];

    if (device == NULL) {
        CMUtlsnprintf(text, size, "the bus is off, or its adapter away");
    } else if (find_other(&device->node) != NULL) {
        CMUtlsnprintf(text, size, "its %s is 0x%X", find_other(&device->node), (unsigned)device->node.found);
    } else if (device->node.why == MASTER_WHY_CONFIGURATION) {
        char *end = put_hex(place, device->node.index, HEX_DIGITS);
        *end++ = ':';
        (void)put_hex(end, device->node.sub, 2);
        CMUtlsnprintf(text, size, "it refuses %s, 0x%X", place, (unsigned)device->node.counters.last_abort);
    } else {
        CMUtlsnprintf(text, size, "%s", describe_step(&device->node));
    }
}

/* At most one entry in a while, of the newest emergency: a node may send thousands. */
static void log_emcy(CANOPEN_DEVICE *device, RTS_UI32 now_ms)
{
    const CANOPEN_COUNTERS *counters = &device->node.counters;
    char code[HEX_DIGITS + 1];

    if (device->logged_emcy != 0 && now_ms - device->logged_emcy_ms < EMCY_LOG_MS)
        return;
    device->logged_emcy = counters->emcy;
    device->logged_emcy_ms = now_ms;
    (void)put_hex(code, counters->last_emcy, HEX_DIGITS);
    LogAdd(CMPID_IoDrvCanopen, LOG_WARNING, ERR_DEVICE, "%s reports emergency 0x%s",
           IoMgrConfigGetName(device->connector), code);
}

static void note_emcy(CANOPEN_DEVICE *device, RTS_UI32 now_ms)
{
    RTS_UI32 emcy = device->node.counters.emcy;

    if (device->noted_emcy != emcy)
        IoMgrConfigNoteError(device->connector);
    device->noted_emcy = emcy;
    if (device->logged_emcy != emcy)
        log_emcy(device, now_ms);
}

/* What the manager and the tasks see of a node. */
static void note(CANOPEN_DEVICE *device, bool has_all, RTS_UI32 now_ms)
{
    const CANOPEN_NODE *node = &device->node;
    bool runs = node->state == MASTER_RUNS;

    SysAtomicStore(&device->runs, runs ? node->counters.boots : 0);
    note_emcy(device, now_ms);
    if (node->failures != device->noted_failures) {
        device->noted_failures = node->failures;
        IoMgrConfigSetDiagnosis(device->connector, CF_CONNECTOR_BUS_ERROR);
    }
    if (runs && has_all)
        IoMgrConfigNoteData(device->connector);
}

static void poll_device(CANOPEN_LINE *line, CANOPEN_DEVICE *device, RTS_UI32 now_ms)
{
    bool has_all;
    bool ran = device->node.state == MASTER_RUNS;

    CanopenNodePoll(&device->node, send, line, now_ms);
    if (!ran && device->node.state == MASTER_RUNS)
        for (RTS_UI32 i = 0; i < device->pdo_count; i++)
            if ((device->pdos[i].flags & CANOPEN_PDO_OUTPUT) == 0)
                SysAtomicStore(&device->pdos[i].of.in.received_ms, now_ms); /* its time begins */
    (void)get_deadline_ms(device, now_ms, &has_all);
    if (!has_all)
        CanopenNodeLose(&device->node, MASTER_WHY_LATE, now_ms);
    note(device, has_all, now_ms);
}

static void send_heartbeat(CANOPEN_LINE *line, RTS_UI32 now_ms)
{
    const CAN_FRAME frame = {.id = CANOPEN_HEARTBEAT + (RTS_UI32)line->own_node, .size = 1, .data = {NODE_OPERATIONAL}};

    if (line->own_node == 0 || line->heartbeat_ms == 0 || now_ms - line->heartbeat_sent_ms < line->heartbeat_ms)
        return;
    line->heartbeat_sent_ms = now_ms;
    (void)send(line, &frame);
}

/* Only while the wall clock is set. */
static void send_time(CANOPEN_LINE *line, RTS_UI32 now_ms)
{
    RTS_I64 utc_ns;

    if (line->time_ms == 0 || now_ms - line->time_sent_ms < line->time_ms)
        return;
    line->time_sent_ms = now_ms;
    if (SysTimeRtcGet(&utc_ns) != ERR_OK)
        return;
    const CAN_FRAME frame = CanopenTimeMake(utc_ns);
    (void)send(line, &frame);
}

#if CANOPEN_SDO_BLOCK
/* Segments of a block leave at about the pace of the bus, so that PDOs need not wait after a queue of them. */
static RTS_UI8 get_burst(RTS_UI32 bit_rate)
{
    RTS_UI32 burst = bit_rate != 0 ? bit_rate / BITS_PER_SEGMENT_MS : DEFAULT_BURST;

    return (RTS_UI8)(burst > 0 ? burst : 1);
}
#endif

static void note_bus(CANOPEN_LINE *line, RTS_UI32 now_ms)
{
    CAN_STATE state;

    SysCanGetState(line->network, &state);
    bool off = state.bus == CAN_BUS_OFF || state.bus == CAN_BUS_STOPPED;
    if (off && !line->was_off)
        IoMgrConfigSetDiagnosis(line->connector, CF_CONNECTOR_BUS_ERROR);
    if (!off)
        IoMgrConfigNoteData(line->connector);
    FOR_EACH_DEVICE (line, device)
        if (off)
            CanopenNodeLose(&device->node, MASTER_WHY_BUS, now_ms);
    line->was_off = off;
#if CANOPEN_SDO_BLOCK
    line->burst = get_burst(state.bit_rate);
    FOR_EACH_DEVICE (line, device)
        device->node.sdo.burst = line->burst;
#endif
    line->is_passive = state.bus == CAN_BUS_PASSIVE;
}

static bool is_lost(const CANOPEN_NODE *node)
{
    return node->state != MASTER_RUNS && node->state != MASTER_HELD;
}

/* True if the other nodes wait for it. */
static bool holds_others(const CANOPEN_DEVICE *device)
{
    bool is_awaited = device->required && device->node.counters.boots == 0;

    return !CanopenNodeIsReady(&device->node) && (is_awaited || device->on_lost == CANOPEN_LOST_STOP);
}

/* What the loss of a node does to the others. */
static void follow_losses(CANOPEN_LINE *line, RTS_UI32 now_ms)
{
    bool must_wait = false;
    bool is_safe = false;

    FOR_EACH_DEVICE (line, device) {
        must_wait = must_wait || holds_others(device);
        is_safe = is_safe || (device->on_lost == CANOPEN_LOST_SAFE && is_lost(&device->node));
    }
    SysAtomicStore(&line->is_safe, is_safe);
    FOR_EACH_DEVICE (line, device) {
        device->node.must_wait = must_wait;
        if (must_wait)
            CanopenNodeHalt(&device->node, now_ms);
    }
}

static void poll_line(CANOPEN_LINE *line, RTS_UI32 now_ms)
{
    follow_losses(line, now_ms);
    FOR_EACH_DEVICE (line, device)
        poll_device(line, device, now_ms);
    send_heartbeat(line, now_ms);
    send_time(line, now_ms);
}

static RTS_UI32 get_wait_ms(const CANOPEN_LINE *line, RTS_UI32 now_ms)
{
    RTS_UI32 wait_ms = UINT32_MAX;
    bool has_all;

    if (line->own_node != 0 && line->heartbeat_ms != 0) {
        RTS_UI32 since_ms = now_ms - line->heartbeat_sent_ms;
        wait_ms = since_ms < line->heartbeat_ms ? line->heartbeat_ms - since_ms : 0;
    }
    if (line->time_ms != 0) {
        RTS_UI32 since_ms = now_ms - line->time_sent_ms;
        RTS_UI32 left_ms = since_ms < line->time_ms ? line->time_ms - since_ms : 0;
        wait_ms = left_ms < wait_ms ? left_ms : wait_ms;
    }
    FOR_EACH_DEVICE (line, device) {
        RTS_UI32 of_node = CanopenNodeGetWaitMs(&device->node, now_ms);
        RTS_UI32 of_pdo = UINT32_MAX;
        if (device->node.state == MASTER_RUNS)
            of_pdo = get_deadline_ms(device, now_ms, &has_all);
        wait_ms = of_node < wait_ms ? of_node : wait_ms;
        wait_ms = of_pdo < wait_ms ? of_pdo : wait_ms;
    }
    return wait_ms;
}

RTS_I64 IoDrvCanopenGetDueNs(RTS_I64 now_ns)
{
    RTS_UI32 now_ms = (RTS_UI32)(now_ns / NS_PER_MS);
    RTS_UI32 wait_ms = is_running ? CanopenCallsGetWaitMs(now_ms) : UINT32_MAX;

    FOR_EACH_LINE (line)
        if (is_running && line->attached) {
            RTS_UI32 of_line = get_wait_ms(line, now_ms);
            wait_ms = of_line < wait_ms ? of_line : wait_ms;
        }
    return wait_ms == UINT32_MAX ? INT64_MAX : (now_ns / NS_PER_MS + wait_ms) * NS_PER_MS;
}

static void cycle(void)
{
    RTS_UI32 now_ms = SysTimeGetMs();

    FOR_EACH_LINE (line)
        if (line->attached)
            note_bus(line, now_ms);
    CanopenCallsPoll(AppGetState() == AS_RUN, now_ms);
    SysTimeWantPass(CanopenCallsGetWaitMs(now_ms));
    FOR_EACH_LINE (line) {
        if (!line->attached)
            continue;
        poll_line(line, now_ms);
        SysTimeWantPass(get_wait_ms(line, now_ms));
    }
}

/* ---- requests from the PC ---- */

static RTS_RESULT read_parameter(const IoConfigConnector *connector, RTS_UI32 id, void *data, RTS_UI32 bits,
                                 RTS_UI32 bit_offset)
{
    CANOPEN_DEVICE *device = CanopenFindDevice(&setup, connector);
    RTS_UI32 index = id - CANOPEN_PARAM_BOOTS;
    RTS_UI32 value;

    if (device != NULL && id >= CANOPEN_PARAM_OBJECT && bit_offset == 0)
        return CanopenCallsRead(device, id, data, bits);
    if (device == NULL || (index >= sizeof(CANOPEN_COUNTERS) / sizeof(value) && id != CANOPEN_PARAM_STATE))
        return ERR_NO_OBJECT;
    if (bit_offset != 0 || bits != 8 * sizeof(value))
        return ERR_PARAMETER;
    value = device->node.nmt_state;
    if (id != CANOPEN_PARAM_STATE)
        memcpy(&value, (const RTS_UI8 *)&device->node.counters + index * sizeof(value), sizeof(value));
    memcpy(data, &value, sizeof(value));
    return ERR_OK;
}

static RTS_RESULT write_parameter(const IoConfigConnector *connector, RTS_UI32 id, const void *data, RTS_UI32 bits,
                                  RTS_UI32 bit_offset)
{
    CANOPEN_DEVICE *device = CanopenFindDevice(&setup, connector);

    if (device == NULL || id < CANOPEN_PARAM_OBJECT || bit_offset != 0)
        return ERR_NO_OBJECT;
    return CanopenCallsWrite(device, id, data, bits);
}

/* ---- life ---- */

#if ONLINE_CHANGE
static void follow_configuration(const IoConfigTaskMap *task_maps, int count)
{
    RTS_UNUSED(task_maps);
    RTS_UNUSED(count);
    CanopenSetupFollow(&setup);
}
#endif

static const ICmpIoDrv functions = {
    .IoDrvGetInfo = get_info,
    .IoDrvUpdateConfiguration = update_configuration,
    .IoDrvUpdateMapping = update_mapping,
    .IoDrvReadInputs = read_inputs,
    .IoDrvWriteOutputs = write_outputs,
    .IoDrvStartBusCycle = start_bus_cycle,
    .IoDrvReadParameter = read_parameter,
    .IoDrvWriteParameter = write_parameter,
    .IoDrvExplainLoss = explain_loss,
#if ONLINE_CHANGE
    .IoDrvFollowConfiguration = follow_configuration,
#endif
};

RTS_RESULT IoDrvCanopen_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT2)
        return IoMgrRegisterInstance(&driver);
    if (hook == CH_INIT3) {
        CanopenCallsBegin(&setup, send);
        return CanopenCallsRegister();
    }
    if (hook == CH_COMM_CYCLE && is_running)
        cycle();
    else if (hook == CH_EXIT3)
        (void)update_configuration(NULL, 0);
    else if (hook == CH_EXIT2)
        (void)IoMgrUnregisterInstance(&driver);
    return ERR_OK;
}

#endif
