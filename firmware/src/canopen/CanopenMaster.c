/*
 * CanopenMaster.c - brings CANopen nodes into operation, and back after a loss.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenMaster.h"

#include <string.h>

#include "CmpBytes.h"

enum {
    BOOT_MS = 1000,     /* then it is asked anyway: it may be up already */
    MAX_WAIT_MS = 8000, /* between two attempts */
    FIRST_WAIT_MS = 1000,
    LEAST_GRACE_MS = 50,
    START_MS = 1000, /* until the first heartbeat of a node that is started, if its period is shorter */
    AGAIN_MS = 10,   /* after a frame that could not be sent */
    ENTRY_HEAD = 7,  /* of a concise DCF: index, sub-index, size */
    COUNT_SIZE = 4,
    EMCY_MIN = 2,
    STEADY_MS = 10000,   /* a run of so long ends a series of restarts */
    DUPLICATE_MS = 200,  /* two boot-ups within it are those of two devices */
    BEATS = 8,           /* periods in which heartbeats are counted, */
    TOO_MANY_BEATS = 13, /* and those of more than one device */
};

static const struct {
    RTS_UI16 index;
    RTS_UI8 sub;
    RTS_UI8 why;
} identity[EXPECTED_COUNT] = {
    {OBJECT_TYPE, 0, MASTER_WHY_TYPE},
    {OBJECT_IDENTITY, 1, MASTER_WHY_VENDOR},
    {OBJECT_IDENTITY, 2, MASTER_WHY_PRODUCT},
    {OBJECT_IDENTITY, 3, MASTER_WHY_REVISION},
};

static void enter(CANOPEN_NODE *node, MASTER_STATE state, RTS_UI32 now_ms)
{
    node->state = state;
    node->since_ms = now_ms;
    node->step = 0;
    node->repeated = false;
    node->sdo.state = SDO_IDLE;
}

void CanopenNodeBegin(CANOPEN_NODE *node, RTS_UI32 timeout_ms, RTS_UI32 now_ms)
{
    node->sdo.timeout_ms = timeout_ms;
    node->sdo.in = node->reply;
    node->sdo.room = sizeof(node->reply);
    node->command = NMT_START;
    enter(node, MASTER_RESET, now_ms);
}

/* At once after the first restart, then later each time. */
static RTS_UI32 wait_of_restart_ms(CANOPEN_NODE *node)
{
    RTS_UI32 doubled = node->restarts;

    if (node->restarts < UINT8_MAX)
        node->restarts++;
    if (doubled == 0)
        return 0;
    return doubled > 3 ? MAX_WAIT_MS : (RTS_UI32)FIRST_WAIT_MS << (doubled - 1);
}

/* The next attempt: at once after a loss, then later each time. */
static void fail(CANOPEN_NODE *node, RTS_UI8 why, RTS_UI32 now_ms)
{
    bool ran = node->state == MASTER_RUNS || node->state == MASTER_HELD;

    if (ran && now_ms - node->ran_ms >= STEADY_MS)
        node->restarts = 0;
    node->counters.lost += ran;
    node->failures++;
    node->why = why;
    if (why == MASTER_WHY_RESTARTED)
        node->wait_ms = wait_of_restart_ms(node);
    else if (ran && why != MASTER_WHY_DUPLICATE)
        node->wait_ms = 0;
    else
        node->wait_ms = node->wait_ms == 0 ? FIRST_WAIT_MS : 2 * node->wait_ms;
    if (node->wait_ms > MAX_WAIT_MS)
        node->wait_ms = MAX_WAIT_MS;
    enter(node, MASTER_WAITS, now_ms);
}

void CanopenNodeLose(CANOPEN_NODE *node, RTS_UI8 why, RTS_UI32 now_ms)
{
    if (node->state == MASTER_RUNS)
        fail(node, why, now_ms);
}

bool CanopenSendNmt(PF_CANOPEN_SEND send, void *owner, RTS_UI8 command, RTS_UI8 node)
{
    const CAN_FRAME frame = {.id = CANOPEN_NMT, .size = 2, .data = {command, node}};

    return send(owner, &frame);
}

/* ---- the concise DCF ---- */

/* The entry at a place: its data; NULL: it is not whole. */
static const RTS_UI8 *entry_at(const RTS_UI8 *config, RTS_UI32 config_size, RTS_UI32 place, RTS_UI32 *size)
{
    if (config_size - place < ENTRY_HEAD)
        return NULL;
    *size = BytesGet32(config + place + 3);
    return *size <= config_size - place - ENTRY_HEAD ? config + place + ENTRY_HEAD : NULL;
}

bool CanopenIsConfig(const RTS_UI8 *config, RTS_UI32 size)
{
    RTS_UI32 place = COUNT_SIZE;
    RTS_UI32 count = size >= COUNT_SIZE ? BytesGet32(config) : 1;
    RTS_UI32 bytes;

    if (size < COUNT_SIZE)
        return false;
    for (; count > 0 && entry_at(config, size, place, &bytes) != NULL; count--)
        place += ENTRY_HEAD + bytes;
    return count == 0 && place == size;
}

/* ---- steps ---- */

static void identify(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    while (node->step > 0 && node->step < EXPECTED_COUNT && node->expected[node->step] == 0)
        node->step++;
    if (node->step == EXPECTED_COUNT) {
        enter(node, MASTER_CONFIGURE, now_ms);
        node->step = COUNT_SIZE;
    } else {
        SdoClientRead(&node->sdo, node->node, identity[node->step].index, identity[node->step].sub, now_ms);
    }
}

static void configure(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    const RTS_UI8 *at = node->config + node->step;
    RTS_UI32 size;
    const RTS_UI8 *data =
        node->step < node->config_size ? entry_at(node->config, node->config_size, node->step, &size) : NULL;

    if (data == NULL)
        enter(node, MASTER_START, now_ms);
    else
        SdoClientWrite(&node->sdo, node->node, BytesGet16(at), at[2], data, size, now_ms);
}

/* The revision of a device that fits has the same major number. */
static bool is_expected(const CANOPEN_NODE *node, RTS_UI32 found)
{
    RTS_UI32 expected = node->expected[node->step];

    if (node->step == EXPECTED_REVISION)
        return expected >> 16 == found >> 16;
    return expected == 0 || expected == found;
}

static void take_identity(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    RTS_UI32 found = SdoClientGetNumber(&node->sdo);

    if (!is_expected(node, found)) {
        node->found = found;
        fail(node, identity[node->step].why, now_ms);
        return;
    }
    node->step++;
    node->repeated = false;
    identify(node, now_ms);
}

static void take_written(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    RTS_UI32 size;

    if (entry_at(node->config, node->config_size, node->step, &size) != NULL)
        node->step += ENTRY_HEAD + size;
    node->repeated = false;
    configure(node, now_ms);
}

static void begin_step(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    if (node->state == MASTER_IDENTIFY)
        identify(node, now_ms);
    else
        configure(node, now_ms);
}

/* A transfer has failed: it is repeated once if there was no reply. */
static void fail_step(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    bool silent = node->sdo.state == SDO_SILENT;

    node->counters.timeouts += silent;
    node->counters.aborts += !silent;
    node->counters.last_abort = node->sdo.abort;
    if (silent && !node->repeated) {
        node->repeated = true;
        begin_step(node, now_ms);
        return;
    }
    node->index = node->sdo.index;
    node->sub = node->sdo.sub;
    if (silent)
        fail(node, MASTER_WHY_SILENT, now_ms);
    else
        fail(node, node->state == MASTER_IDENTIFY ? identity[node->step].why : MASTER_WHY_CONFIGURATION, now_ms);
}

static void follow_transfer(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    switch (node->sdo.state) {
    case SDO_IDLE:
        if (!node->is_asked_elsewhere)
            begin_step(node, now_ms);
        break;
    case SDO_DONE:
        if (node->state == MASTER_IDENTIFY)
            take_identity(node, now_ms);
        else
            take_written(node, now_ms);
        break;
    case SDO_ABORTED:
    case SDO_SILENT:
        fail_step(node, now_ms);
        break;
    default:
        break;
    }
}

static bool is_guarded(const CANOPEN_NODE *node)
{
    return node->heartbeat_ms == 0 && node->guard_ms != 0;
}

bool CanopenNodeIsWatched(const CANOPEN_NODE *node)
{
    return node->heartbeat_ms != 0 || node->guard_ms != 0;
}

static RTS_UI32 grace_ms(const CANOPEN_NODE *node)
{
    RTS_UI32 grace = node->heartbeat_ms * 5 / 2;

    if (is_guarded(node))
        return node->guard_ms * node->guard_life;
    return grace >= node->heartbeat_ms + LEAST_GRACE_MS ? grace : node->heartbeat_ms + LEAST_GRACE_MS;
}

static RTS_UI32 start_ms(const CANOPEN_NODE *node)
{
    return grace_ms(node) > START_MS ? grace_ms(node) : START_MS;
}

static void run(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    node->counters.boots++;
    node->why = MASTER_WHY_NONE;
    node->wait_ms = 0;
    node->ran_ms = node->beats_ms = now_ms;
    node->beats = 0;
    enter(node, MASTER_RUNS, now_ms);
}

static void hold(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    node->failures++;
    node->why = MASTER_WHY_HELD;
    enter(node, MASTER_HELD, now_ms);
}

void CanopenNodeCommand(CANOPEN_NODE *node, RTS_UI8 command, RTS_UI32 now_ms)
{
    bool stops = command == NMT_STOP || command == NMT_PREOPERATIONAL;

    node->command = stops ? command : NMT_START; /* one that is reset is to run afterwards */
    if (stops && (node->state == MASTER_RUNS || node->state == MASTER_STARTS))
        hold(node, now_ms);
    else if (command == NMT_START && node->state == MASTER_HELD)
        enter(node, MASTER_STARTS, now_ms);
}

void CanopenNodeHalt(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    if (node->state != MASTER_RUNS && node->state != MASTER_STARTS)
        return;
    node->failures++;
    node->why = MASTER_WHY_HALTED;
    enter(node, MASTER_HALTS, now_ms);
}

bool CanopenNodeIsReady(const CANOPEN_NODE *node)
{
    return node->state >= MASTER_START && node->state != MASTER_WAITS;
}

bool CanopenNodeIsAsked(const CANOPEN_NODE *node)
{
    return node->state <= MASTER_CONFIGURE;
}

bool CanopenNodeIsHeard(const CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    return node->is_heard && now_ms - node->heard_ms < grace_ms(node);
}

/* ---- frames ---- */

/* A guarding reply that comes twice, or from a node that has missed a request, has the wrong toggle: it does not count. */
static bool is_expected_reply(CANOPEN_NODE *node, RTS_UI8 byte)
{
    if (byte == NODE_BOOTS) {
        node->guard_toggle = 0;
        return true;
    }
    if (is_guarded(node) && (byte & CANOPEN_GUARD_TOGGLE) != node->guard_toggle)
        return false;
    node->guard_toggle ^= CANOPEN_GUARD_TOGGLE;
    return true;
}

/* The boot-up of a node that waits for its next attempt: it has power again, so it need not wait. One that restarts again
 * and again, or is one of two, waits. */
static bool may_begin(const CANOPEN_NODE *node)
{
    if (node->state == MASTER_WAITS)
        return node->why != MASTER_WHY_DUPLICATE && (node->why != MASTER_WHY_RESTARTED || node->wait_ms == 0);
    return node->state == MASTER_BOOTS;
}

static void take_boot_up(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    bool is_second = node->has_booted && now_ms - node->booted_ms < DUPLICATE_MS;

    node->has_booted = true;
    node->booted_ms = now_ms;
    if (is_second && node->state != MASTER_WAITS)
        fail(node, MASTER_WHY_DUPLICATE, now_ms);
    else if (CanopenNodeIsReady(node) || node->state == MASTER_CONFIGURE)
        fail(node, MASTER_WHY_RESTARTED, now_ms);
    if (may_begin(node))
        enter(node, MASTER_IDENTIFY, now_ms); /* it has just been reset: no need to do it again */
}

/* True if there were about twice as many heartbeats as one device sends. */
static bool are_of_two(CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    if (node->heartbeat_ms == 0)
        return false;
    if (now_ms - node->beats_ms >= BEATS * node->heartbeat_ms) {
        node->beats_ms = now_ms;
        node->beats = 0;
    }
    if (node->beats < UINT8_MAX)
        node->beats++;
    return node->beats >= TOO_MANY_BEATS;
}

static void take_heartbeat(CANOPEN_NODE *node, RTS_UI8 state, RTS_UI32 now_ms)
{
    node->nmt_state = state;
    node->is_heard = true;
    node->heard_ms = now_ms;
    if (state == NODE_BOOTS) {
        take_boot_up(node, now_ms);
    } else if (node->state == MASTER_RUNS && are_of_two(node, now_ms)) {
        fail(node, MASTER_WHY_DUPLICATE, now_ms);
    } else if (node->state == MASTER_STARTS && state == NODE_OPERATIONAL) {
        run(node, now_ms);
    } else if ((node->state == MASTER_RUNS && state == NODE_OPERATIONAL) || node->state == MASTER_HELD ||
               node->state == MASTER_START) {
        node->since_ms = now_ms;
    } else if (node->state == MASTER_RUNS) {
        fail(node, MASTER_WHY_STATE, now_ms);
    }
}

void CanopenNodeTake(CANOPEN_NODE *node, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    RTS_UI32 function = frame->id & CANOPEN_FUNCTION_MASK;

    if ((frame->flags & CAN_FLAG_REMOTE) != 0)
        return;
    if (function == CANOPEN_HEARTBEAT && frame->size == 1) {
        if (is_expected_reply(node, frame->data[0]))
            take_heartbeat(node, frame->data[0] & 0x7F, now_ms);
    } else if (function == CANOPEN_SDO_REPLY) {
        SdoClientTake(&node->sdo, frame, now_ms);
    } else if (function == CANOPEN_EMCY && frame->size >= EMCY_MIN) {
        node->counters.emcy++;
        node->counters.last_emcy = BytesGet16(frame->data);
    }
}

/* ---- time ---- */

static bool is_silent(const CANOPEN_NODE *node, RTS_UI32 limit_ms, RTS_UI32 now_ms)
{
    return CanopenNodeIsWatched(node) && now_ms - node->since_ms >= limit_ms;
}

static void start(CANOPEN_NODE *node, PF_CANOPEN_SEND send, void *owner, RTS_UI32 now_ms)
{
    if (node->must_wait) {
        if (is_silent(node, start_ms(node), now_ms))
            fail(node, MASTER_WHY_NO_HEARTBEAT, now_ms);
        return;
    }
    if (!CanopenSendNmt(send, owner, node->command, node->node))
        return;
    if (node->command == NMT_START)
        enter(node, MASTER_STARTS, now_ms);
    else
        hold(node, now_ms);
}

static void poll_state(CANOPEN_NODE *node, PF_CANOPEN_SEND send, void *owner, RTS_UI32 now_ms)
{
    RTS_UI32 since_ms = now_ms - node->since_ms;

    switch (node->state) {
    case MASTER_RESET:
        if (!CanopenSendNmt(send, owner, NMT_RESET_COMMUNICATION, node->node))
            break;
        node->guard_toggle = 0;
        node->has_booted = false;
        enter(node, MASTER_BOOTS, now_ms);
        break;
    case MASTER_BOOTS:
        if (since_ms >= BOOT_MS)
            enter(node, MASTER_IDENTIFY, now_ms);
        break;
    case MASTER_START:
        start(node, send, owner, now_ms);
        break;
    case MASTER_STARTS:
        if (!CanopenNodeIsWatched(node))
            run(node, now_ms);
        else if (is_silent(node, start_ms(node), now_ms))
            fail(node, MASTER_WHY_NO_HEARTBEAT, now_ms);
        break;
    case MASTER_RUNS:
    case MASTER_HELD:
        if (is_silent(node, grace_ms(node), now_ms))
            fail(node, MASTER_WHY_LOST, now_ms);
        break;
    case MASTER_HALTS:
        if (CanopenSendNmt(send, owner, NMT_STOP, node->node))
            enter(node, MASTER_START, now_ms);
        break;
    case MASTER_WAITS:
        if (since_ms >= node->wait_ms)
            enter(node, MASTER_RESET, now_ms);
        break;
    default:
        break;
    }
}

static RTS_UI32 left_ms(RTS_UI32 since_ms, RTS_UI32 of_ms)
{
    return since_ms < of_ms ? of_ms - since_ms : 0;
}

/* How long it is until the next guarding request [ms]; UINT32_MAX: there is none. */
static RTS_UI32 guard_left_ms(const CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    if (!is_guarded(node) || !CanopenNodeIsReady(node))
        return UINT32_MAX;
    return left_ms(now_ms - node->guarded_ms, node->guard_ms);
}

static void ask_state(CANOPEN_NODE *node, PF_CANOPEN_SEND send, void *owner, RTS_UI32 now_ms)
{
    const CAN_FRAME frame = {.id = CANOPEN_HEARTBEAT + (RTS_UI32)node->node, .flags = CAN_FLAG_REMOTE, .size = 1};

    if (guard_left_ms(node, now_ms) == 0 && send(owner, &frame))
        node->guarded_ms = now_ms;
}

void CanopenNodePoll(CANOPEN_NODE *node, PF_CANOPEN_SEND send, void *owner, RTS_UI32 now_ms)
{
    MASTER_STATE before;

    do {
        before = node->state;
        SdoClientPoll(&node->sdo, now_ms);
        if (!SdoClientSend(&node->sdo, send, owner, now_ms))
            return;
        if (node->state == MASTER_IDENTIFY || node->state == MASTER_CONFIGURE)
            follow_transfer(node, now_ms);
        else
            poll_state(node, send, owner, now_ms);
        (void)SdoClientSend(&node->sdo, send, owner, now_ms);
    } while (node->state != before);
    ask_state(node, send, owner, now_ms);
}

/* The same without guarding requests. */
static RTS_UI32 get_wait_ms(const CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    RTS_UI32 since_ms = now_ms - node->since_ms;

    if (node->sdo.has_request)
        return SdoClientGetAgainMs(&node->sdo);
    switch (node->state) {
    case MASTER_BOOTS:
        return left_ms(since_ms, BOOT_MS);
    case MASTER_START:
        if (!node->must_wait)
            return AGAIN_MS;
        return CanopenNodeIsWatched(node) ? left_ms(since_ms, start_ms(node)) : UINT32_MAX;
    case MASTER_STARTS:
        return left_ms(since_ms, start_ms(node));
    case MASTER_RUNS:
    case MASTER_HELD:
        return CanopenNodeIsWatched(node) ? left_ms(since_ms, grace_ms(node)) : UINT32_MAX;
    case MASTER_WAITS:
        return left_ms(since_ms, node->wait_ms);
    case MASTER_IDENTIFY:
    case MASTER_CONFIGURE:
        return node->sdo.state == SDO_BUSY ? left_ms(now_ms - node->sdo.since_ms, node->sdo.timeout_ms) : AGAIN_MS;
    default:
        return AGAIN_MS;
    }
}

RTS_UI32 CanopenNodeGetWaitMs(const CANOPEN_NODE *node, RTS_UI32 now_ms)
{
    RTS_UI32 of_state = get_wait_ms(node, now_ms);
    RTS_UI32 of_guard = guard_left_ms(node, now_ms);

    if (of_guard == 0)
        of_guard = AGAIN_MS; /* there was no room */
    return of_state < of_guard ? of_state : of_guard;
}
