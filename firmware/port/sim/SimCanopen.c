/*
 * SimCanopen.c - the CANopen nodes of the description, on the CAN bus of the simulator.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A node boots, is what the description expects, has the objects that were written to it, and exchanges those PDOs that
 * were configured: so a configuration that is not written shows. It knows the place of a channel from the description.
 */
#include "SimCanopen.h"

#include <string.h>

#include "../../src/io/CanopenDriver.h"
#include "CmpBytes.h"
#include "IoDrvSim.h"
#include "SimCan.h"
#include "SimTimes.h"

#define BOOT_NS (50 * NS_PER_MS)
#define REPLY_NS ((RTS_I64)200000)

enum { OBJECTS = 512, OBJECT_SIZE = 32, OFF = 0xFF, TPDO_PARAMETERS = 0x1800, LAST_PDO = 0x1FF, EVENT_TIMER = 5 };

typedef struct {
    RTS_UI16 index;
    RTS_UI8 sub;
    RTS_UI8 size; /* of more bytes the first ones are kept */
    RTS_UI8 data[OBJECT_SIZE];
} OBJECT;

typedef struct {
    RTS_UI8 state;  /* NODE_*, OFF */
    RTS_UI8 toggle; /* of the next guarding reply */
    RTS_I64 boot_ns;
    RTS_I64 heartbeat_ns;
    RTS_I64 reply_ns;
    CAN_FRAME reply;
    OBJECT writing; /* in segments */
    RTS_UI32 written;
    OBJECT reading; /* in segments */
    RTS_UI32 read;
    RTS_UI32 count;
    OBJECT objects[OBJECTS];
    bool has_new_objects; /* what `pdos` has of them may be old */
    RTS_UI32 faults[IO_SIM_FAULTS];
} NODE;

static NODE nodes[CANOPEN_MAX_DEVICES];

static struct {
    RTS_UI8 data[CANOPEN_PDO_SIZE]; /* what the node measures, or has got */
    bool changed;
    bool is_sent;      /* an input that was configured */
    RTS_UI32 event_ms; /* its event timer */
    RTS_I64 event_ns;  /* when an input is sent next though nothing changes */
} pdos[CANOPEN_MAX_PDOS];

/* A bus has thousands of frames a second, so what they need is found by number. */
static struct {
    RTS_UI16 output[CANOPEN_COB_ID + 1]; /* the PDO with an identifier that a node receives, from 1 on; 0: none */
    NODE *node[CANOPEN_MAX_NODE + 1];
    NODE *of_pdo[CANOPEN_MAX_PDOS];
    bool is_due_known;
    RTS_I64 due_ns;
} find;

static CANOPEN_SETUP *setup(void)
{
    return IoDrvCanopenGetSetup();
}

static CANOPEN_DEVICE *device_of(const NODE *node)
{
    return &setup()->devices[node - nodes];
}

static RTS_UI32 fault_of(const NODE *node, RTS_UI32 id)
{
    return node->faults[id - IO_SIM_ABSENT];
}

#define FOR_EACH_NODE(node) for (NODE *node = nodes; node < nodes + setup()->device_count; node++)

/* ---- objects ---- */

static OBJECT *find_object(NODE *node, RTS_UI32 index, RTS_UI32 sub)
{
    for (RTS_UI32 i = 0; i < node->count; i++)
        if (node->objects[i].index == index && node->objects[i].sub == sub)
            return &node->objects[i];
    return NULL;
}

static RTS_UI32 number_of(NODE *node, RTS_UI32 index, RTS_UI32 sub)
{
    const OBJECT *object = find_object(node, index, sub);

    return object != NULL ? BytesGet32(object->data) : 0;
}

static bool store(NODE *node, const OBJECT *object, RTS_I64 now_ns)
{
    OBJECT *place = find_object(node, object->index, object->sub);

    if (place == NULL && node->count == OBJECTS)
        return false;
    if (place == NULL)
        place = &node->objects[node->count++];
    *place = *object;
    node->has_new_objects = true;
    if (object->index == OBJECT_HEARTBEAT) {
        RTS_UI32 ms = BytesGet16(object->data);
        node->heartbeat_ns = ms != 0 ? now_ns + ms * NS_PER_MS : NEVER;
    }
    return true;
}

/* What every node has. */
static bool read_fixed(const NODE *node, OBJECT *object)
{
    const RTS_UI32 *expected = device_of(node)->node.expected;
    RTS_UI32 other = fault_of(node, IO_SIM_TYPE) != 0;

    object->size = 4;
    if (object->index == OBJECT_TYPE && object->sub == 0)
        BytesPut32(object->data, expected[EXPECTED_TYPE] + other);
    else if (object->index == OBJECT_IDENTITY && object->sub >= 1 && object->sub < EXPECTED_COUNT)
        BytesPut32(object->data, expected[object->sub]);
    else
        return false;
    return true;
}

/* The parameters of the TPDO with this identifier, if it was configured; 0: none. */
static RTS_UI32 find_tpdo(NODE *node, RTS_UI32 cob)
{
    for (RTS_UI32 i = 0; i < node->count; i++)
        if (node->objects[i].index >= TPDO_PARAMETERS && node->objects[i].index <= TPDO_PARAMETERS + LAST_PDO &&
            node->objects[i].sub == 1 && BytesGet32(node->objects[i].data) == cob)
            return node->objects[i].index;
    return 0;
}

/* ---- frames to the bus ---- */

static void send(RTS_UI32 id, const void *data, RTS_UI32 size)
{
    CAN_FRAME frame = {.id = id, .size = (RTS_UI8)size};

    memcpy(frame.data, data, size);
    (void)SimCanSend(SIM_CANOPEN_NODE, &frame);
}

static void send_state(const NODE *node)
{
    send(CANOPEN_HEARTBEAT + (RTS_UI32)device_of(node)->node.node, &node->state, 1);
}

/* Reads from the objects of a node which PDOs it sends, and how often. */
static void follow_objects(NODE *node)
{
    const CANOPEN_DEVICE *device = device_of(node);
    RTS_UI32 first = (RTS_UI32)(device->pdos - setup()->pdos);

    for (RTS_UI32 i = first; i < first + device->pdo_count && node->has_new_objects; i++) {
        RTS_UI32 parameters = find_tpdo(node, setup()->pdos[i].cob);
        pdos[i].is_sent = parameters != 0;
        pdos[i].event_ms = parameters != 0 ? number_of(node, parameters, EVENT_TIMER) : 0;
    }
    node->has_new_objects = false;
}

static void send_input(RTS_UI32 pdo, RTS_I64 now_ns)
{
    const CANOPEN_PDO_STATE *described = &setup()->pdos[pdo];

    pdos[pdo].changed = false;
    if ((described->flags & CANOPEN_PDO_SYNC) == 0) {
        pdos[pdo].event_ns = pdos[pdo].event_ms != 0 ? now_ns + pdos[pdo].event_ms * NS_PER_MS : NEVER;
        find.is_due_known = false;
    }
    if (pdos[pdo].is_sent)
        send(described->cob, pdos[pdo].data, CanopenPdoSize(described));
}

static void send_inputs(NODE *node, bool of_sync, bool all, RTS_I64 now_ns)
{
    const CANOPEN_DEVICE *device = device_of(node);
    RTS_UI32 first = (RTS_UI32)(device->pdos - setup()->pdos);

    follow_objects(node);
    for (RTS_UI32 i = first; i < first + device->pdo_count && node->state == NODE_OPERATIONAL; i++) {
        RTS_UI32 flags = setup()->pdos[i].flags;
        bool is_synchronous = (flags & CANOPEN_PDO_SYNC) != 0;
        if ((flags & CANOPEN_PDO_OUTPUT) != 0 || is_synchronous != of_sync)
            continue;
        if (all || pdos[i].changed || pdos[i].event_ns <= now_ns)
            send_input(i, now_ns);
    }
}

/* ---- NMT ---- */

static void power_on(NODE *node, RTS_I64 now_ns)
{
    node->state = NODE_BOOTS;
    node->toggle = 0;
    node->count = 0;
    node->has_new_objects = true;
    node->boot_ns = now_ns + BOOT_NS;
    node->heartbeat_ns = node->reply_ns = NEVER;
    find.is_due_known = false;
}

static void power_off(NODE *node)
{
    node->state = OFF;
    node->boot_ns = node->heartbeat_ns = node->reply_ns = NEVER;
    find.is_due_known = false;
}

static void command(NODE *node, RTS_UI8 command, RTS_I64 now_ns)
{
    if (node->state == OFF || node->state == NODE_BOOTS)
        return;
    find.is_due_known = false;
    switch (command) {
    case NMT_START:
        node->state = NODE_OPERATIONAL;
        send_inputs(node, false, true, now_ns);
        break;
    case NMT_STOP:
        node->state = NODE_STOPPED;
        break;
    case NMT_PREOPERATIONAL:
        node->state = NODE_PREOPERATIONAL;
        break;
    case NMT_RESET_NODE:
    case NMT_RESET_COMMUNICATION:
        power_on(node, now_ns);
        break;
    default:
        break;
    }
}

/* ---- SDO ---- */

static void reply(NODE *node, const RTS_UI8 *data, RTS_I64 now_ns)
{
    node->reply = (CAN_FRAME){.id = CANOPEN_SDO_REPLY + (RTS_UI32)device_of(node)->node.node, .size = 8};
    memcpy(node->reply.data, data, 8);
    node->reply_ns = now_ns + REPLY_NS + fault_of(node, IO_SIM_LATE) * NS_PER_MS;
}

static void refuse(NODE *node, RTS_UI8 *data, RTS_UI32 code, RTS_I64 now_ns)
{
    data[0] = SDO_ABORT;
    BytesPut32(data + 4, code);
    reply(node, data, now_ns);
}

static void serve_read(NODE *node, RTS_UI8 *data, OBJECT *object, RTS_I64 now_ns)
{
    const OBJECT *found = find_object(node, object->index, object->sub);

    if (found != NULL)
        *object = *found;
    else if (!read_fixed(node, object)) {
        refuse(node, data, SDO_ABORT_NO_OBJECT, now_ns);
        return;
    }
    if (object->size > 4) {
        node->reading = *object;
        node->read = 0;
        data[0] = SDO_READ | 1;
        BytesPut32(data + 4, object->size);
    } else {
        data[0] = (RTS_UI8)(0x43 | (4 - object->size) << 2);
        memset(data + 4, 0, 4);
        memcpy(data + 4, object->data, object->size);
    }
    reply(node, data, now_ns);
}

static void serve_read_segment(NODE *node, RTS_UI8 *data, RTS_I64 now_ns)
{
    RTS_UI32 left = node->reading.size - node->read;
    RTS_UI32 size = left < 7 ? left : 7;

    data[0] = (RTS_UI8)((data[0] & SDO_TOGGLE) | (7 - size) << 1 | (size == left));
    memset(data + 1, 0, 7);
    memcpy(data + 1, node->reading.data + node->read, size);
    node->read += size;
    reply(node, data, now_ns);
}

static void end_write(NODE *node, RTS_UI8 *data, const OBJECT *object, RTS_UI8 command, RTS_I64 now_ns)
{
    if (!store(node, object, now_ns)) {
        refuse(node, data, SDO_ABORT_MEMORY, now_ns);
        return;
    }
    data[0] = command;
    memset(data + 4, 0, 4);
    reply(node, data, now_ns);
}

static void serve_segment(NODE *node, RTS_UI8 *data, RTS_I64 now_ns)
{
    RTS_UI8 toggle = data[0] & SDO_TOGGLE;
    RTS_UI32 size = 7 - (data[0] >> 1 & 7u);

    for (RTS_UI32 i = 0; i < size && node->written < OBJECT_SIZE; i++)
        node->writing.data[node->written++] = data[1 + i];
    node->writing.size = (RTS_UI8)node->written;
    if ((data[0] & 1) != 0)
        (void)store(node, &node->writing, now_ns);
    memset(data, 0, 8);
    data[0] = SDO_SEGMENT_DONE | toggle;
    reply(node, data, now_ns);
}

static void serve(NODE *node, RTS_UI8 *data, RTS_I64 now_ns)
{
    OBJECT object = {.index = BytesGet16(data + 1), .sub = data[3]};

    find.is_due_known = false;
    if (data[0] == SDO_ABORT)
        return;
    if (fault_of(node, IO_SIM_ANSWERS) != 0) {
        node->faults[IO_SIM_ANSWERS - IO_SIM_ABSENT]--;
        refuse(node, data, SDO_ABORT_GENERAL, now_ns);
    } else if (data[0] == SDO_READ) {
        serve_read(node, data, &object, now_ns);
    } else if ((data[0] & SDO_KIND) == SDO_READ_SEGMENT) {
        serve_read_segment(node, data, now_ns);
    } else if ((data[0] & SDO_KIND) == 0x20 && (data[0] & 2) != 0) {
        object.size = (RTS_UI8)(4 - (data[0] >> 2 & 3u));
        memcpy(object.data, data + 4, object.size);
        end_write(node, data, &object, SDO_WRITE_DONE, now_ns);
    } else if ((data[0] & SDO_KIND) == 0x20) {
        node->writing = object;
        node->written = 0;
        data[0] = SDO_WRITE_DONE;
        reply(node, data, now_ns);
    } else if ((data[0] & SDO_KIND) == SDO_WRITE_SEGMENT) {
        serve_segment(node, data, now_ns);
    } else {
        refuse(node, data, SDO_ABORT_COMMAND, now_ns);
    }
}

/* ---- frames from the bus ---- */

/* A guarding request. */
static void reply_state(NODE *node)
{
    RTS_UI8 byte = node->state | node->toggle;

    if (node->state == NODE_BOOTS)
        return;
    send(CANOPEN_HEARTBEAT + (RTS_UI32)device_of(node)->node.node, &byte, 1);
    node->toggle ^= CANOPEN_GUARD_TOGGLE;
}

static bool take_output(const CAN_FRAME *frame)
{
    RTS_UI32 place = find.output[frame->id];

    if (place == 0)
        return false;
    const CANOPEN_PDO_STATE *pdo = &setup()->pdos[place - 1];
    if (find.of_pdo[place - 1]->state == NODE_OPERATIONAL && frame->size >= CanopenPdoSize(pdo))
        memcpy(pdos[place - 1].data, frame->data, CanopenPdoSize(pdo));
    return true;
}

static void take_of_node(NODE *node, CAN_FRAME *frame, RTS_I64 now_ns)
{
    bool can_serve = node->state == NODE_OPERATIONAL || node->state == NODE_PREOPERATIONAL;
    RTS_UI32 function = frame->id & CANOPEN_FUNCTION_MASK;

    if (function == CANOPEN_HEARTBEAT && (frame->flags & CAN_FLAG_REMOTE) != 0 && node->state != OFF)
        reply_state(node);
    else if (function == CANOPEN_SDO_REQUEST && (frame->flags & CAN_FLAG_REMOTE) == 0 && frame->size == 8 && can_serve)
        serve(node, frame->data, now_ns);
}

static void take(CAN_FRAME *frame, RTS_I64 now_ns)
{
    bool is_remote = (frame->flags & CAN_FLAG_REMOTE) != 0;
    NODE *addressed = find.node[frame->id & CANOPEN_NODE_MASK];

    if (frame->id == CANOPEN_SYNC && !is_remote) {
        FOR_EACH_NODE (node)
            send_inputs(node, true, true, now_ns);
    } else if (frame->id == CANOPEN_NMT && !is_remote && frame->size == 2) {
        FOR_EACH_NODE (node)
            if (frame->data[1] == 0 || frame->data[1] == device_of(node)->node.node)
                command(node, frame->data[0], now_ns);
    } else if ((is_remote || !take_output(frame)) && addressed != NULL) {
        take_of_node(addressed, frame, now_ns);
    }
}

static void run_node(NODE *node, RTS_I64 now_ns)
{
    find.is_due_known = false;
    if (node->boot_ns <= now_ns) {
        node->boot_ns = NEVER;
        send_state(node);
        node->state = NODE_PREOPERATIONAL;
    }
    if (node->reply_ns <= now_ns) {
        node->reply_ns = NEVER;
        (void)SimCanSend(SIM_CANOPEN_NODE, &node->reply);
    }
    if (node->heartbeat_ns <= now_ns) {
        node->heartbeat_ns += number_of(node, OBJECT_HEARTBEAT, 0) * NS_PER_MS;
        send_state(node);
    }
    send_inputs(node, false, false, now_ns);
}

void SimCanopenRun(RTS_I64 now_ns)
{
    CAN_FRAME frame;

    while (SimCanReceive(SIM_CANOPEN_NODE, &frame) == ERR_OK)
        if ((frame.flags & CAN_FLAG_EXTENDED) == 0)
            take(&frame, now_ns);
    if (SimCanopenGetDueNs() > now_ns)
        return;
    FOR_EACH_NODE (node)
        run_node(node, now_ns);
}

static RTS_I64 earlier(RTS_I64 a, RTS_I64 b)
{
    return a < b ? a : b;
}

static RTS_I64 find_due_ns(void)
{
    RTS_I64 due_ns = NEVER;

    FOR_EACH_NODE (node) {
        const CANOPEN_DEVICE *device = device_of(node);
        RTS_UI32 first = (RTS_UI32)(device->pdos - setup()->pdos);
        due_ns = earlier(due_ns, earlier(node->boot_ns, earlier(node->heartbeat_ns, node->reply_ns)));
        for (RTS_UI32 i = first; i < first + device->pdo_count && node->state == NODE_OPERATIONAL; i++)
            due_ns = earlier(due_ns, pdos[i].event_ns);
    }
    return due_ns;
}

RTS_I64 SimCanopenGetDueNs(void)
{
    if (!find.is_due_known)
        find.due_ns = find_due_ns();
    find.is_due_known = true;
    return find.due_ns;
}

/* ---- channels and faults ---- */

/* The PDO of a channel; CANOPEN_MAX_PDOS: none. */
static RTS_UI32 find_pdo(const IoConfigConnector *connector, const SIM_IO_PLACE *place, RTS_RESULT *result)
{
    const CANOPEN_PDO_STATE *state = CanopenFindPdo(setup(), connector, place->parameter);

    *result = state != NULL ? ERR_OK : ERR_NOT_SUPPORTED;
    if (state != NULL &&
        (place->bits > 8u * CanopenPdoSize(state) || place->bit > 8u * CanopenPdoSize(state) - place->bits))
        *result = ERR_OUT_OF_LIMITS;
    return state != NULL ? (RTS_UI32)(state - setup()->pdos) : CANOPEN_MAX_PDOS;
}

RTS_RESULT SimCanopenSet(const IoConfigConnector *connector, const SIM_IO_PLACE *place, const RTS_UI8 *data)
{
    RTS_RESULT result;
    RTS_UI32 pdo = find_pdo(connector, place, &result);

    for (RTS_UI32 i = 0; result == ERR_OK && i < place->bits; i++) {
        RTS_UI32 at = place->bit + i;
        RTS_UI8 *byte = &pdos[pdo].data[at / 8];
        *byte = (RTS_UI8)((*byte & ~(1u << at % 8)) | (data[i / 8] >> i % 8 & 1u) << at % 8);
        pdos[pdo].changed = true;
        if ((setup()->pdos[pdo].flags & (CANOPEN_PDO_SYNC | CANOPEN_PDO_OUTPUT)) == 0)
            pdos[pdo].event_ns = SimNow(); /* at once */
        find.is_due_known = false;
    }
    return result;
}

RTS_RESULT SimCanopenGet(const IoConfigConnector *connector, const SIM_IO_PLACE *place, RTS_UI8 *data)
{
    RTS_RESULT result;
    RTS_UI32 pdo = find_pdo(connector, place, &result);

    if (result == ERR_OK)
        memset(data, 0, (place->bits + 7) / 8);
    for (RTS_UI32 i = 0; result == ERR_OK && i < place->bits; i++) {
        RTS_UI32 at = place->bit + i;
        data[i / 8] |= (RTS_UI8)((pdos[pdo].data[at / 8] >> at % 8 & 1u) << i % 8);
    }
    return result;
}

static bool is_line(const IoConfigConnector *connector)
{
    for (RTS_UI32 i = 0; i < CAN_CONTROLLERS; i++)
        if (setup()->lines[i].connector == connector)
            return true;
    return false;
}

RTS_RESULT SimCanopenFail(const IoConfigConnector *connector, RTS_UI32 fault, RTS_UI32 value)
{
    const CANOPEN_DEVICE *device = CanopenFindDevice(setup(), connector);

    if (device == NULL && fault == IO_SIM_CUT && is_line(connector)) {
        SimCanDestroy(SIM_CAN_DEVICE, value);
        return ERR_OK;
    }
    if (device == NULL)
        return ERR_NOT_SUPPORTED;
    if (fault - IO_SIM_ABSENT >= IO_SIM_FAULTS || fault == IO_SIM_CUT)
        return ERR_NO_OBJECT;
    NODE *node = &nodes[device - setup()->devices];
    node->faults[fault - IO_SIM_ABSENT] = value;
    if (fault == IO_SIM_ABSENT && value != 0)
        power_off(node);
    else if (fault == IO_SIM_ABSENT && node->state == OFF)
        power_on(node, SimNow());
    return ERR_OK;
}

/* ---- configurations ---- */

void SimCanopenForget(void)
{
    memset(nodes, 0, sizeof(nodes));
    memset(pdos, 0, sizeof(pdos));
    memset(&find, 0, sizeof(find));
    for (RTS_UI32 i = 0; i < CANOPEN_MAX_DEVICES; i++)
        power_off(&nodes[i]);
}

static void number_node(NODE *node)
{
    const CANOPEN_DEVICE *device = device_of(node);
    RTS_UI32 first = (RTS_UI32)(device->pdos - setup()->pdos);

    find.node[device->node.node & CANOPEN_NODE_MASK] = node;
    for (RTS_UI32 i = first; i < first + device->pdo_count; i++) {
        find.of_pdo[i] = node;
        if ((setup()->pdos[i].flags & CANOPEN_PDO_OUTPUT) != 0)
            find.output[setup()->pdos[i].cob] = (RTS_UI16)(i + 1);
    }
}

void SimCanopenMake(RTS_I64 now_ns)
{
    SimCanopenForget();
    if (setup()->device_count != 0)
        SimCanStart(SIM_CANOPEN_NODE);
    FOR_EACH_NODE (node)
        power_on(node, now_ns);
    for (RTS_UI32 i = 0; i < CANOPEN_MAX_PDOS; i++)
        pdos[i].event_ns = NEVER;
    FOR_EACH_NODE (node)
        number_node(node);
}
