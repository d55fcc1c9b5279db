/*
 * CanopenCalls.c - what the blocks of CiA 405 do.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenCalls.h"

#include <string.h>

#include "AppState.h"
#include "CanopenDeviceDriver.h"
#include "CmpIoMgrEmbedded.h"
#include "CmpLog.h"
#include "SysAtomic.h"
#include "SysTime.h"

#if CANOPEN_MAX_CALLS > 0

enum {
    VERSION = 0x00010000,
    SLOTS = 256, /* in a number: its slot, and how often one was taken */
    WORD_SIZE = 8,
    EMERGENCIES = 16, /* of a network, that no block has taken */
    EMCY_SIZE = 8,
    NODES = CANOPEN_MAX_NODE + 1, /* in the number of an emergency: its node, and the entry of it */
    AGAIN_MS = 10,                /* for one that waits for the transfer of another */
    DEFAULT_TIMEOUT_MS = 1000,
    ABANDONED_MS = 60000,
    TOOL_MS = 5000, /* so long a tool may take to ask again */
};

/* Values of CIA405_CANOPEN_KERNEL_ERROR. */
enum {
    KERNEL_OTHER = 0x01, /* the abort code tells */
    KERNEL_OVERFLOW = 0x02,
    KERNEL_TIMEOUT = 0x03,
    KERNEL_BUS_OFF = 0x10,
    KERNEL_PASSIVE = 0x11,
    KERNEL_NO_NETWORK = 0x21, /* the description has no such network */
    KERNEL_NO_ROOM = 0x22,    /* as many transfers are on their way as there may be: again later */
    KERNEL_CANCELLED = 0x23,  /* the program was stopped */
};

enum { KIND_READ, KIND_WRITE, KIND_NMT };

/* CIA405_STATE */
enum {
    STATE_INIT = 0,
    STATE_PREOPERATIONAL = 3,
    STATE_STOPPED = 4,
    STATE_OPERATIONAL = 5,
    STATE_UNKNOWN = 6,
    STATE_NOT_AVAILABLE = 7,
};

/* States of a slot. */
enum {
    SLOT_FREE,
    SLOT_TAKEN, /* a task fills it, or takes its result */
    SLOT_WAITS,
    SLOT_ASKS, /* main is at it */
    SLOT_ENDED,
    SLOT_CANCELLED, /* the task does not want it any more, main is at it */
};

typedef struct {
    RTS_UI32 state;
    RTS_I32 number;
    RTS_UI8 network;
    RTS_UI8 node;
    RTS_UI8 kind;
    RTS_UI8 sub;
    RTS_UI16 index; /* KIND_NMT: the command */
    bool seen;      /* main knows that it waits */
    RTS_UI32 size;
    RTS_UI32 timeout_ms; /* 0: that of the node */
    RTS_UI32 sequence;   /* in which order they were sent */
    RTS_UI32 since_ms;
    RTS_I32 result;
    SDO_CLIENT sdo;
    RTS_UI8 data[CANOPEN_CALL_SIZE];
} CALL;

typedef struct {
    RTS_UI32 state; /* SLOT_FREE, SLOT_TAKEN, SLOT_FULL */
    RTS_UI32 sequence;
    RTS_UI8 node;
    RTS_UI8 data[EMCY_SIZE];
} EMERGENCY;

RTS_STATIC_ASSERT(CANOPEN_MAX_CALLS < SLOTS && EMERGENCIES < SLOTS, slots_fit_into_numbers);

static struct {
    CANOPEN_SETUP *setup;
    PF_CANOPEN_SEND send;
    RTS_UI32 sequence;
    RTS_UI32 lost[CAN_CONTROLLERS]; /* an emergency had no room, and no block knows */
    EMERGENCY emergencies[CAN_CONTROLLERS][EMERGENCIES];
    RTS_UI32 quiet_until_ms[CAN_CONTROLLERS][NODES]; /* it may still reply to a transfer that was given up; 0: no */
    CALL calls[CANOPEN_MAX_CALLS + 1];               /* the last one is that of tools */
} all;

static RTS_UI32 taken; /* slots ever */

#define TOOL (all.calls + CANOPEN_MAX_CALLS)
#define FOR_EACH_CALL(call) for (CALL *call = all.calls; call <= TOOL; call++)

static RTS_I32 new_number(const CALL *call)
{
    RTS_UI32 generation = SysAtomicAdd(&taken, 1) & (INT32_MAX / SLOTS);

    return (RTS_I32)(generation * SLOTS + (RTS_UI32)(call - all.calls) + 1);
}

/* The slot of a number; NULL: it is that of another block now. */
static CALL *find(RTS_I32 number)
{
    RTS_UI32 slot = (RTS_UI32)number % SLOTS - 1;

    return slot < CANOPEN_MAX_CALLS && all.calls[slot].number == number ? &all.calls[slot] : NULL;
}

static CALL *find_taken(RTS_I32 number)
{
    CALL *call = find(number);

    return call != NULL && SysAtomicLoad(&call->state) == SLOT_TAKEN ? call : NULL;
}

/* NULL: the description has no such network. */
static CANOPEN_LINE *line_of(RTS_UI32 network)
{
    CANOPEN_LINE *line = all.setup != NULL && network < CAN_CONTROLLERS ? &all.setup->lines[network] : NULL;

    return line != NULL && line->connector != NULL && line->attached ? line : NULL;
}

/* ---- transfers: what the library calls, from tasks ---- */

static RTS_I32 check(RTS_UI32 network, RTS_UI8 node, RTS_UI8 kind, RTS_UI32 size)
{
    if (line_of(network) == NULL)
        return KERNEL_NO_NETWORK;
    if (kind > KIND_NMT || node > CANOPEN_MAX_NODE)
        return KERNEL_OTHER;
    return size > CANOPEN_CALL_SIZE ? KERNEL_OVERFLOW : 0;
}

static CALL *find_free(void)
{
    for (CALL *call = all.calls; call < TOOL; call++)
        if (SysAtomicReplace(&call->state, SLOT_FREE, SLOT_TAKEN))
            return call;
    return NULL;
}

/* The number of a transfer, or the negative of a CIA405_CANOPEN_KERNEL_ERROR. `size`: bytes that are written. */
static RTS_I32 canopen_take(RTS_UI8 network, RTS_UI8 node, RTS_UI16 index, RTS_UI8 sub, RTS_UI8 kind, RTS_UI32 size,
                            RTS_UI32 timeout_ms)
{
    RTS_I32 error = check(network, node, kind, size);
    CALL *call = error == 0 ? find_free() : NULL;

    if (call == NULL)
        return error != 0 ? -error : -KERNEL_NO_ROOM;
    call->network = network;
    call->node = node;
    call->index = index;
    call->sub = sub;
    call->kind = kind;
    call->size = size;
    call->timeout_ms = timeout_ms;
    call->result = 0;
    call->sdo.abort = 0;
    call->sdo.done = 0;
    call->number = new_number(call);
    memset(call->data, 0, sizeof(call->data));
    return call->number;
}

/* Eight bytes from `at` on, the lowest first. */
static RTS_UI8 canopen_put(RTS_I32 number, RTS_UI32 at, RTS_UI64 value)
{
    CALL *call = find_taken(number);

    for (RTS_UI32 i = 0; call != NULL && i < WORD_SIZE && at < sizeof(call->data) && at + i < sizeof(call->data); i++)
        call->data[at + i] = (RTS_UI8)(value >> 8 * i);
    return call != NULL;
}

static RTS_UI8 canopen_send(RTS_I32 number)
{
    CALL *call = find_taken(number);

    if (call == NULL)
        return 0;
    call->seen = false;
    call->sequence = SysAtomicAdd(&all.sequence, 1);
    call->since_ms = SysTimeGetMs();
    SysAtomicStore(&call->state, SLOT_WAITS);
    return 1;
}

/* 0: it waits or is on its way; 1: it has ended well; else the negative of a CIA405_CANOPEN_KERNEL_ERROR. */
static RTS_I32 canopen_state(RTS_I32 number)
{
    CALL *call = find(number);
    RTS_UI32 state = call != NULL ? SysAtomicLoad(&call->state) : SLOT_FREE;

    if (state == SLOT_WAITS || state == SLOT_ASKS)
        return 0;
    if (state == SLOT_ENDED && SysAtomicReplace(&call->state, SLOT_ENDED, SLOT_TAKEN)) {
        if (call->number == number)
            return call->result;
        SysAtomicStore(&call->state, SLOT_ENDED); /* it became that of another block meanwhile */
    }
    return -KERNEL_CANCELLED;
}

/* Of a transfer that has ended: how many bytes were read, from bit 32 on the abort code. */
static RTS_UI64 canopen_result(RTS_I32 number)
{
    const CALL *call = find_taken(number);

    return call != NULL ? call->sdo.done | (RTS_UI64)call->sdo.abort << 32 : 0;
}

static RTS_UI64 canopen_get(RTS_I32 number, RTS_UI32 at)
{
    const CALL *call = find_taken(number);
    RTS_UI64 value = 0;

    for (RTS_UI32 i = 0; call != NULL && i < WORD_SIZE && at < sizeof(call->data) && at + i < sizeof(call->data); i++)
        value |= (RTS_UI64)call->data[at + i] << 8 * i;
    return value;
}

/* Gives a transfer back; one that is on its way is aborted. */
static RTS_UI8 canopen_free(RTS_I32 number)
{
    CALL *call = find(number);

    if (call == NULL)
        return 0;
    return SysAtomicReplace(&call->state, SLOT_TAKEN, SLOT_FREE) ||
           SysAtomicReplace(&call->state, SLOT_WAITS, SLOT_FREE) ||
           SysAtomicReplace(&call->state, SLOT_ASKS, SLOT_CANCELLED) ||
           SysAtomicReplace(&call->state, SLOT_ENDED, SLOT_FREE);
}

/* ---- states: what the library calls, from tasks ---- */

/* The number of this controller on a network as a device, 0: it is none. */
static RTS_UI8 get_device_node(RTS_UI32 network)
{
#if CANOPEN_DEVICE_DATA > 0
    return IoDrvCanopenDeviceGetNode(network);
#else
    RTS_UNUSED(network);
    return 0;
#endif
}

static bool is_own_node(RTS_UI32 network, RTS_UI8 node)
{
    return node == 0 || node == all.setup->lines[network].own_node || node == get_device_node(network);
}

static RTS_UI8 state_of_heartbeat(RTS_UI8 state)
{
    switch (state) {
    case NODE_BOOTS:
        return STATE_INIT;
    case NODE_STOPPED:
        return STATE_STOPPED;
    case NODE_OPERATIONAL:
        return STATE_OPERATIONAL;
    case NODE_PREOPERATIONAL:
        return STATE_PREOPERATIONAL;
    default:
        return STATE_UNKNOWN;
    }
}

static RTS_UI8 own_state(const CANOPEN_LINE *line, RTS_UI32 network)
{
    if (line->was_off)
        return STATE_NOT_AVAILABLE;
#if CANOPEN_DEVICE_DATA > 0
    if (get_device_node(network) != 0)
        return state_of_heartbeat(IoDrvCanopenDeviceGetState());
#else
    RTS_UNUSED(network);
#endif
    return STATE_OPERATIONAL;
}

static RTS_UI8 state_of(const CANOPEN_LINE *line, RTS_UI32 network, RTS_UI8 node)
{
    const CANOPEN_DEVICE *device = node <= CANOPEN_MAX_NODE ? CanopenFindNode(line, node) : NULL;

    if (is_own_node(network, node))
        return own_state(line, network);
    if (device == NULL || !CanopenNodeIsWatched(&device->node))
        return STATE_UNKNOWN;
    if (!CanopenNodeIsHeard(&device->node, SysTimeGetMs()))
        return STATE_NOT_AVAILABLE;
    return state_of_heartbeat(device->node.nmt_state);
}

static RTS_UI32 kernel_of(const CANOPEN_LINE *line)
{
    if (line->was_off)
        return KERNEL_BUS_OFF;
    return line->is_passive ? KERNEL_PASSIVE : 0;
}

/* State of a node, from bit 8 on our own number, from bit 16 on that of the network. */
static RTS_UI32 canopen_status(RTS_UI8 network, RTS_UI8 node)
{
    const CANOPEN_LINE *line = line_of(network);

    if (line == NULL)
        return STATE_UNKNOWN | (RTS_UI32)KERNEL_NO_NETWORK << 16;
    RTS_UI8 own = line->own_node != 0 ? line->own_node : get_device_node(network);
    return state_of(line, network, node) | (RTS_UI32)own << 8 | kernel_of(line) << 16;
}

/* ---- emergencies ---- */

static EMERGENCY *find_oldest(RTS_UI32 network, RTS_UI8 node)
{
    EMERGENCY *oldest = NULL;

    for (EMERGENCY *e = all.emergencies[network]; e < all.emergencies[network] + EMERGENCIES; e++)
        if (SysAtomicLoad(&e->state) == SLOT_WAITS && (node == 0 || e->node == node) &&
            (oldest == NULL || (RTS_I32)(e->sequence - oldest->sequence) < 0))
            oldest = e;
    return oldest;
}

/* The oldest emergency of a node, 0: of any: a number that tells the node, modulo 128. 0: there is none; else the
 * negative of a CIA405_CANOPEN_KERNEL_ERROR. */
static RTS_I32 canopen_emcy(RTS_UI8 network, RTS_UI8 node)
{
    EMERGENCY *found;

    if (line_of(network) == NULL)
        return -KERNEL_NO_NETWORK;
    if (SysAtomicReplace(&all.lost[network], 1, 0))
        return -KERNEL_OVERFLOW;
    while ((found = find_oldest(network, node)) != NULL)
        if (SysAtomicReplace(&found->state, SLOT_WAITS, SLOT_TAKEN)) {
            RTS_I32 entry = (RTS_I32)(network * EMERGENCIES) + (RTS_I32)(found - all.emergencies[network]);
            return entry * NODES + found->node;
        }
    return 0;
}

/* Its eight bytes, the first one lowest. It is free then. */
static RTS_UI64 canopen_emcy_data(RTS_I32 number)
{
    RTS_UI32 entry = (RTS_UI32)number / NODES;
    RTS_UI64 value = 0;

    if (entry >= CAN_CONTROLLERS * EMERGENCIES)
        return 0;
    EMERGENCY *found = &all.emergencies[entry / EMERGENCIES][entry % EMERGENCIES];
    for (RTS_UI32 i = 0; i < EMCY_SIZE; i++)
        value |= (RTS_UI64)found->data[i] << 8 * i;
    (void)SysAtomicReplace(&found->state, SLOT_TAKEN, SLOT_FREE);
    return value;
}

/* Of the newest ones those that have room stay. */
static void keep_emergency(RTS_UI32 network, const CAN_FRAME *frame)
{
    EMERGENCY *place = NULL;

    for (EMERGENCY *e = all.emergencies[network]; place == NULL && e < all.emergencies[network] + EMERGENCIES; e++)
        if (SysAtomicReplace(&e->state, SLOT_FREE, SLOT_TAKEN))
            place = e;
    if (place == NULL) {
        SysAtomicStore(&all.lost[network], 1);
        place = find_oldest(network, 0);
        if (place == NULL || !SysAtomicReplace(&place->state, SLOT_WAITS, SLOT_TAKEN))
            return; /* a task is taking it: the next one finds room */
    }
    place->node = frame->id & CANOPEN_NODE_MASK;
    memset(place->data, 0, sizeof(place->data));
    memcpy(place->data, frame->data, frame->size < EMCY_SIZE ? frame->size : EMCY_SIZE);
    place->sequence = SysAtomicAdd(&all.sequence, 1);
    SysAtomicStore(&place->state, SLOT_WAITS);
}

APP_GATE(canopen_take);
APP_GATE(canopen_put);
APP_GATE(canopen_send);
APP_GATE(canopen_state);
APP_GATE(canopen_result);
APP_GATE(canopen_get);
APP_GATE(canopen_free);
APP_GATE(canopen_status);
APP_GATE(canopen_emcy);
APP_GATE(canopen_emcy_data);

RTS_RESULT CanopenCallsRegister(void)
{
    /* The signatures are those of stdlib/cia405.st. */
    static const CMP_EXT_FUNCTION functions[] = {
        {"canopen_take", 0xFC53D083, VERSION, (RTS_PFN)APP_GATED(canopen_take)},
        {"canopen_put", 0x42A8F461, VERSION, (RTS_PFN)APP_GATED(canopen_put)},
        {"canopen_send", 0xC1AD7073, VERSION, (RTS_PFN)APP_GATED(canopen_send)},
        {"canopen_state", 0xC0C02B87, VERSION, (RTS_PFN)APP_GATED(canopen_state)},
        {"canopen_result", 0x6213C0E3, VERSION, (RTS_PFN)APP_GATED(canopen_result)},
        {"canopen_get", 0x2D22C5DC, VERSION, (RTS_PFN)APP_GATED(canopen_get)},
        {"canopen_free", 0xC95B34D7, VERSION, (RTS_PFN)APP_GATED(canopen_free)},
        {"canopen_status", 0x57E393C6, VERSION, (RTS_PFN)APP_GATED(canopen_status)},
        {"canopen_emcy", 0x2C576C02, VERSION, (RTS_PFN)APP_GATED(canopen_emcy)},
        {"canopen_emcy_data", 0x9BFE789C, VERSION, (RTS_PFN)APP_GATED(canopen_emcy_data)},
    };

    return CMRegisterExternal(functions, RTS_COUNT(functions));
}

/* ---- main ---- */

void CanopenCallsBegin(CANOPEN_SETUP *setup, PF_CANOPEN_SEND send)
{
    CMP_CLEAR(all);
    all.setup = setup;
    all.send = send;
}

static bool is_at_it(const CALL *call)
{
    RTS_UI32 state = SysAtomicLoad(&call->state);

    return (state == SLOT_ASKS || state == SLOT_CANCELLED) && call->kind != KIND_NMT;
}

static bool is_same_node(const CALL *a, RTS_UI32 network, RTS_UI32 node)
{
    return a->network == network && a->node == node;
}

bool CanopenCallsTake(RTS_UI32 network, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    RTS_UI32 node = frame->id & CANOPEN_NODE_MASK;
    RTS_UI32 function = frame->id & CANOPEN_FUNCTION_MASK;

    if (function == CANOPEN_EMCY && node != 0 && (frame->flags & CAN_FLAG_REMOTE) == 0)
        keep_emergency(network, frame);
    if (function != CANOPEN_SDO_REPLY)
        return false;
    FOR_EACH_CALL(call)
    if (is_at_it(call) && is_same_node(call, network, node)) {
        SdoClientTake(&call->sdo, frame, now_ms);
        return true;
    }
    bool was_late = all.quiet_until_ms[network][node] != 0;
    all.quiet_until_ms[network][node] = 0;
    return was_late;
}

/* The node may reply nevertheless, and to the next transfer of the same object by mistake. */
static void be_quiet(const CALL *call, RTS_UI32 now_ms)
{
    all.quiet_until_ms[call->network][call->node] = (now_ms + call->sdo.timeout_ms) | 1u;
}

static bool is_quiet(const CALL *call, RTS_UI32 now_ms)
{
    RTS_UI32 *until_ms = &all.quiet_until_ms[call->network][call->node];

    if (*until_ms != 0 && (RTS_I32)(now_ms - *until_ms) >= 0)
        *until_ms = 0;
    return *until_ms != 0;
}

/* Nothing else is on its way to the node, and nothing was sent before. */
static bool is_next(const CALL *call, RTS_UI32 now_ms)
{
    const CANOPEN_DEVICE *device = CanopenFindNode(&all.setup->lines[call->network], call->node);

    if (is_quiet(call, now_ms) || (device != NULL && CanopenNodeIsAsked(&device->node)))
        return false;
    FOR_EACH_CALL(other)
    {
        RTS_UI32 state = SysAtomicLoad(&other->state);
        if (other == call || !is_same_node(other, call->network, call->node) || other->kind == KIND_NMT)
            continue;
        if (state == SLOT_ASKS || state == SLOT_CANCELLED ||
            (state == SLOT_WAITS && (RTS_I32)(other->sequence - call->sequence) < 0))
            return false;
    }
    return true;
}

static void end(CALL *call, RTS_I32 result)
{
    call->result = result;
    if (!SysAtomicReplace(&call->state, SLOT_ASKS, SLOT_ENDED))
        SysAtomicStore(&call->state, SLOT_FREE); /* cancelled meanwhile */
}

/* This controller itself, which has an object dictionary if it is a device: no frame is sent. */
static RTS_I32 serve(CALL *call)
{
#if CANOPEN_DEVICE_DATA > 0
    const CANOPEN_OBJECT what = {.index = call->index, .sub = call->sub};
    bool is_write = call->kind == KIND_WRITE;
    RTS_UI32 size = is_write ? call->size : (RTS_UI32)sizeof(call->data);

    call->sdo.abort = IoDrvCanopenDeviceAccess(call->network, &what, is_write, call->data, &size);
    call->sdo.done = size;
    if (call->sdo.abort == 0)
        return 1;
    return !is_write && call->sdo.abort == SDO_ABORT_MEMORY ? -KERNEL_OVERFLOW : -KERNEL_OTHER;
#else
    call->sdo.abort = SDO_ABORT_NO_DICTIONARY;
    return -KERNEL_OTHER;
#endif
}

static void begin(CALL *call, RTS_UI32 now_ms)
{
    const CANOPEN_DEVICE *device = CanopenFindNode(&all.setup->lines[call->network], call->node);
    RTS_UI32 timeout_ms = device != NULL ? device->node.sdo.timeout_ms : DEFAULT_TIMEOUT_MS;

    call->sdo.timeout_ms = call->timeout_ms != 0 ? call->timeout_ms : timeout_ms;
    call->sdo.in = call->data;
    call->sdo.room = sizeof(call->data);
#if CANOPEN_SDO_BLOCK
    call->sdo.burst = all.setup->lines[call->network].burst;
#endif
    if (call->kind == KIND_READ)
        SdoClientRead(&call->sdo, call->node, call->index, call->sub, now_ms);
    else
        SdoClientWrite(&call->sdo, call->node, call->index, call->sub, call->data, call->size, now_ms);
}

static void command(CALL *call, RTS_UI32 now_ms)
{
    CANOPEN_LINE *line = &all.setup->lines[call->network];

    if (!CanopenSendNmt(all.send, line, (RTS_UI8)call->index, call->node))
        return; /* no room: in the next pass */
    for (RTS_UI32 i = 0; i < line->device_count; i++)
        if (call->node == 0 || line->devices[i].node.node == call->node)
            CanopenNodeCommand(&line->devices[i].node, (RTS_UI8)call->index, now_ms);
    end(call, 1);
}

static RTS_I32 result_of(const CALL *call)
{
    const SDO_CLIENT *sdo = &call->sdo;

    if (sdo->state == SDO_DONE)
        return 1;
    if (sdo->state == SDO_SILENT)
        return -KERNEL_TIMEOUT;
    return call->kind == KIND_READ && sdo->abort == SDO_ABORT_MEMORY && sdo->done == sdo->room ? -KERNEL_OVERFLOW
                                                                                               : -KERNEL_OTHER;
}

static void follow(CALL *call, RTS_UI32 now_ms)
{
    CANOPEN_LINE *line = &all.setup->lines[call->network];
    bool is_cancelled = SysAtomicLoad(&call->state) == SLOT_CANCELLED;

    if (!is_cancelled)
        SdoClientPoll(&call->sdo, now_ms);
    else if (SdoClientCancel(&call->sdo))
        be_quiet(call, now_ms);
    if (!SdoClientSend(&call->sdo, all.send, line, now_ms) || call->sdo.state == SDO_BUSY)
        return;
    if (call->sdo.state == SDO_SILENT)
        be_quiet(call, now_ms);
    end(call, result_of(call));
}

static void run(CALL *call, RTS_UI32 now_ms)
{
    if (SysAtomicLoad(&call->state) == SLOT_WAITS) {
        call->seen = true;
        if ((call->kind != KIND_NMT && !is_next(call, now_ms)) ||
            !SysAtomicReplace(&call->state, SLOT_WAITS, SLOT_ASKS))
            return;
        call->sdo.state = SDO_IDLE;
        call->sdo.has_request = false;
        if (all.setup->lines[call->network].was_off) {
            end(call, -KERNEL_BUS_OFF);
        } else if (call->kind == KIND_NMT) {
            command(call, now_ms);
        } else if (is_own_node(call->network, call->node)) {
            end(call, serve(call));
        } else {
            begin(call, now_ms);
        }
    }
    RTS_UI32 state = SysAtomicLoad(&call->state);
    if (state == SLOT_ASKS && call->kind == KIND_NMT && !call->sdo.has_request)
        command(call, now_ms);
    else if (state == SLOT_ASKS || state == SLOT_CANCELLED)
        follow(call, now_ms);
}

/* What no task asks for any more is given back. */
static void free_abandoned(CALL *call, bool is_running, RTS_UI32 now_ms)
{
    RTS_UI32 state = SysAtomicLoad(&call->state);

    if (!is_running && (state == SLOT_ASKS || state == SLOT_WAITS))
        (void)SysAtomicReplace(&call->state, state, state == SLOT_ASKS ? SLOT_CANCELLED : SLOT_FREE);
    else if (!is_running && state != SLOT_CANCELLED)
        SysAtomicStore(&call->state, SLOT_FREE);
    else if (state == SLOT_ENDED && now_ms - call->since_ms > ABANDONED_MS)
        (void)SysAtomicReplace(&call->state, SLOT_ENDED, SLOT_FREE);
    if (!is_running)
        call->number = 0;
}

static void forget_emergencies(void)
{
    for (RTS_UI32 i = 0; i < CAN_CONTROLLERS; i++) {
        SysAtomicStore(&all.lost[i], 0);
        for (EMERGENCY *e = all.emergencies[i]; e < all.emergencies[i] + EMERGENCIES; e++)
            SysAtomicStore(&e->state, SLOT_FREE);
    }
}

void CanopenCallsPoll(bool is_running, RTS_UI32 now_ms)
{
    if (!is_running)
        forget_emergencies();
    FOR_EACH_CALL(call)
    {
        if (call != TOOL)
            free_abandoned(call, is_running, now_ms);
        run(call, now_ms);
    }
    for (RTS_UI32 i = 0; i < all.setup->device_count; i++)
        all.setup->devices[i].node.is_asked_elsewhere = false;
    FOR_EACH_CALL(call)
    {
        CANOPEN_DEVICE *device = CanopenFindNode(&all.setup->lines[call->network], call->node);
        if (device != NULL && is_at_it(call))
            device->node.is_asked_elsewhere = true;
    }
}

/* ---- tools ---- */

static bool is_same(const CALL *call, const CALL *other)
{
    return is_same_node(call, other->network, other->node) && call->index == other->index && call->sub == other->sub &&
           call->kind == other->kind && call->size == other->size && memcmp(call->data, other->data, other->size) == 0;
}

/* Begins what a tool asks for; true: it has ended. */
static bool ask(const CALL *wanted, RTS_RESULT *result)
{
    RTS_UI32 now_ms = SysTimeGetMs();
    bool is_known = TOOL->state != SLOT_FREE && is_same(TOOL, wanted);

    *result = ERR_PENDING;
    if (TOOL->state == SLOT_ENDED && is_known && now_ms - TOOL->since_ms < TOOL_MS)
        return true;
    if (TOOL->state == SLOT_FREE || TOOL->state == SLOT_ENDED) {
        *TOOL = *wanted;
        TOOL->state = SLOT_WAITS;
        TOOL->sequence = SysAtomicAdd(&all.sequence, 1);
        TOOL->since_ms = now_ms;
    } else if (!is_known) {
        *result = ERR_NOBUFFER;
    }
    return false;
}

/* What has become of it. */
static RTS_RESULT answer(CANOPEN_DEVICE *device)
{
    TOOL->state = SLOT_FREE;
    if (TOOL->result > 0)
        return ERR_OK;
    if (TOOL->result == -KERNEL_OVERFLOW)
        return ERR_OUT_OF_LIMITS;
    if (TOOL->result != -KERNEL_OTHER)
        return ERR_TIMEOUT;
    device->node.counters.aborts++;
    device->node.counters.last_abort = TOOL->sdo.abort;
    LogAdd(CMPID_IoDrvCanopen, LOG_WARNING, ERR_DEVICE, "%s refuses 0x%X:0x%X, 0x%X",
           IoMgrConfigGetName(device->connector), (unsigned)TOOL->index, (unsigned)TOOL->sub,
           (unsigned)TOOL->sdo.abort);
    return ERR_DEVICE;
}

static RTS_UI8 network_of(const CANOPEN_DEVICE *device)
{
    RTS_UI8 network = 0;

    while (CanopenFindNode(&all.setup->lines[network], device->node.node) != device)
        network++; /* one of them has it: it is used */
    return network;
}

static CALL describe(const CANOPEN_DEVICE *device, RTS_UI32 id, RTS_UI8 kind)
{
    return (CALL){.network = network_of(device),
                  .node = device->node.node,
                  .index = (RTS_UI16)(id >> 8),
                  .sub = (RTS_UI8)id,
                  .kind = kind};
}

RTS_RESULT CanopenCallsRead(CANOPEN_DEVICE *device, RTS_UI32 id, void *data, RTS_UI32 bits)
{
    RTS_RESULT result;

    if (id >> 24 != 0 || !device->used)
        return ERR_NO_OBJECT;
    CALL wanted = describe(device, id, KIND_READ);
    if (!ask(&wanted, &result))
        return result;
    result = answer(device);
    if (result == ERR_OK && TOOL->sdo.done > bits / 8)
        return ERR_OUT_OF_LIMITS;
    if (result == ERR_OK) {
        memset(data, 0, (bits + 7) / 8);
        memcpy(data, TOOL->data, TOOL->sdo.done);
    }
    return result;
}

RTS_RESULT CanopenCallsWrite(CANOPEN_DEVICE *device, RTS_UI32 id, const void *data, RTS_UI32 bits)
{
    RTS_RESULT result;

    if (id >> 24 != 0 || !device->used)
        return ERR_NO_OBJECT;
    CALL wanted = describe(device, id, KIND_WRITE);
    if (bits == 0 || bits % 8 != 0 || bits / 8 > sizeof(wanted.data))
        return ERR_OUT_OF_LIMITS;
    wanted.size = bits / 8;
    memcpy(wanted.data, data, wanted.size);
    return ask(&wanted, &result) ? answer(device) : result;
}

/* ---- time ---- */

static RTS_UI32 wait_of(const CALL *call, RTS_UI32 now_ms)
{
    RTS_UI32 since_ms = now_ms - call->sdo.since_ms;

    switch (SysAtomicLoad(&call->state)) {
    case SLOT_WAITS:
        return call->seen ? AGAIN_MS : 0;
    case SLOT_CANCELLED:
        return 0;
    case SLOT_ASKS:
        if (call->kind == KIND_NMT || call->sdo.has_request)
            return call->kind == KIND_NMT ? AGAIN_MS : SdoClientGetAgainMs(&call->sdo);
        return since_ms < call->sdo.timeout_ms ? call->sdo.timeout_ms - since_ms : 0;
    default:
        return UINT32_MAX;
    }
}

RTS_UI32 CanopenCallsGetWaitMs(RTS_UI32 now_ms)
{
    RTS_UI32 wait_ms = UINT32_MAX;

    FOR_EACH_CALL(call)
    {
        RTS_UI32 of_call = wait_of(call, now_ms);
        wait_ms = of_call < wait_ms ? of_call : wait_ms;
    }
    return wait_ms;
}
#else
RTS_RESULT CanopenCallsRead(CANOPEN_DEVICE *device, RTS_UI32 id, void *data, RTS_UI32 bits)
{
    RTS_UNUSED(device);
    RTS_UNUSED(id);
    RTS_UNUSED(data);
    RTS_UNUSED(bits);
    return ERR_NOT_SUPPORTED;
}

RTS_RESULT CanopenCallsWrite(CANOPEN_DEVICE *device, RTS_UI32 id, const void *data, RTS_UI32 bits)
{
    RTS_UNUSED(device);
    RTS_UNUSED(id);
    RTS_UNUSED(data);
    RTS_UNUSED(bits);
    return ERR_NOT_SUPPORTED;
}

RTS_RESULT CanopenCallsRegister(void)
{
    return ERR_OK;
}

void CanopenCallsBegin(CANOPEN_SETUP *setup, PF_CANOPEN_SEND send)
{
    RTS_UNUSED(setup);
    RTS_UNUSED(send);
}

bool CanopenCallsTake(RTS_UI32 network, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    RTS_UNUSED(network);
    RTS_UNUSED(frame);
    RTS_UNUSED(now_ms);
    return false;
}

void CanopenCallsPoll(bool is_running, RTS_UI32 now_ms)
{
    RTS_UNUSED(is_running);
    RTS_UNUSED(now_ms);
}

RTS_UI32 CanopenCallsGetWaitMs(RTS_UI32 now_ms)
{
    RTS_UNUSED(now_ms);
    return UINT32_MAX;
}
#endif
