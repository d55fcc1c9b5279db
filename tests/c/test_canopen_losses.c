/*
 * test_canopen_losses.c - the manager of CANopen nodes on a bus that loses, doubles and delays frames, and nodes that are
 * pulled at each millisecond of their boot.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The node is a model: it boots, has a heartbeat or guarding, and an SDO server for expedited and segmented writes, which
 * stores what it gets. In the end it has to run with exactly the objects of the configuration. With the argument "campaign"
 * three random faults a boot, until it is stopped or one is found (`meson compile -C build canopen_campaign`).
 */
#include "CanopenMaster.h"
#include "CmpBytes.h"
#include "test.h"

enum { NODE = 5, TIMEOUT_MS = 100, TYPE = 0x20192, BOOT_MS = 5, HEARTBEAT_MS = 20, REPLY_MS = 1, LONG = 20 };
enum { QUEUE = 64, NEVER = 0x7FFFFFFF, PATIENCE_MS = 40000, STEADY_MS = 500, FAULTS = 3, OFF = 0xFF };
enum { SMALL_INDEX = 0x2001, SMALL = 700, LONG_INDEX = 0x2000 };

typedef enum { FAULT_NONE, FAULT_LOST, FAULT_DOUBLED, FAULT_DELAYED } FAULT;

static CANOPEN_NODE node;
static RTS_UI32 now_ms;
static bool is_guarded;

/* ---- the bus: each frame arrives at its time ---- */

static struct {
    CAN_FRAME frame;
    RTS_UI32 at_ms;
    bool to_node;
    bool waits;
} queue[QUEUE];

static RTS_UI32 frames; /* since the beginning of the test */

static struct {
    FAULT kind;
    RTS_UI32 frame;
    RTS_UI32 ms;
} faults[FAULTS];

static void put(const CAN_FRAME *frame, bool to_node, RTS_UI32 delay_ms)
{
    for (RTS_UI32 i = 0; i < QUEUE; i++)
        if (!queue[i].waits) {
            queue[i].frame = *frame;
            queue[i].at_ms = now_ms + delay_ms;
            queue[i].to_node = to_node;
            queue[i].waits = true;
            return;
        }
    CHECK(false);
}

static bool boots_arrive; /* the frame after a reset is not lost */

static bool is_boot(const CAN_FRAME *frame)
{
    return frame->id == CANOPEN_HEARTBEAT + NODE && frame->flags == 0 && frame->data[0] == NODE_BOOTS;
}

/* A frame that comes twice comes twice in a row, as CAN may do it. */
static void transmit(const CAN_FRAME *frame, bool to_node, RTS_UI32 delay_ms)
{
    RTS_UI32 copies = 1;
    bool is_lost = false;

    for (RTS_UI32 i = 0; i < FAULTS; i++) {
        if (faults[i].kind == FAULT_NONE || faults[i].frame != frames)
            continue;
        is_lost = is_lost || (faults[i].kind == FAULT_LOST && !(boots_arrive && is_boot(frame)));
        copies += faults[i].kind == FAULT_DOUBLED;
        delay_ms += faults[i].kind == FAULT_DELAYED ? faults[i].ms : 0;
    }
    frames++;
    for (; copies > 0 && !is_lost; copies--)
        put(frame, to_node, delay_ms);
}

static bool send(void *owner, const CAN_FRAME *frame)
{
    RTS_UNUSED(owner);
    transmit(frame, true, 0);
    return true;
}

/* ---- the node ---- */

static struct {
    RTS_UI8 state;
    RTS_UI8 guard_toggle;
    RTS_UI32 boot_ms;
    RTS_UI32 heartbeat_ms;
    RTS_UI16 writing; /* the index of a segmented write, 0: none */
    RTS_UI8 toggle;
    RTS_UI32 size;
    RTS_UI8 bytes[64];
    RTS_UI32 small;
    RTS_UI32 long_size;
    RTS_UI8 long_bytes[64];
} server;

static void say(RTS_UI32 id, const RTS_UI8 *data, RTS_UI8 size, RTS_UI32 delay_ms)
{
    CAN_FRAME frame = {.id = id + NODE, .size = size};

    memcpy(frame.data, data, size);
    transmit(&frame, false, delay_ms);
}

static void reset(void)
{
    memset(&server, 0, sizeof server);
    server.boot_ms = now_ms + BOOT_MS;
    server.heartbeat_ms = NEVER;
}

static void power_off(void)
{
    reset();
    server.state = OFF;
    server.boot_ms = NEVER;
}

static void refuse(RTS_UI8 *data, RTS_UI32 code)
{
    if (server.writing != 0) {
        BytesPut16(data + 1, server.writing);
        data[3] = 0;
    }
    server.writing = 0;
    data[0] = SDO_ABORT;
    BytesPut32(data + 4, code);
}

static void store_segment(RTS_UI8 *data)
{
    RTS_UI32 size = 7 - (data[0] >> 1 & 7u);

    if (server.writing == 0 || (data[0] & SDO_TOGGLE) != server.toggle || server.size + size > sizeof server.bytes) {
        refuse(data, SDO_ABORT_TOGGLE);
        return;
    }
    memcpy(server.bytes + server.size, data + 1, size);
    server.size += size;
    if ((data[0] & 1) != 0) {
        memcpy(server.long_bytes, server.bytes, server.size);
        server.long_size = server.size;
        server.writing = 0;
    }
    data[0] = (RTS_UI8)(SDO_SEGMENT_DONE | server.toggle);
    server.toggle ^= SDO_TOGGLE;
}

static void serve_sdo(RTS_UI8 *data)
{
    RTS_UI16 index = BytesGet16(data + 1);

    if (data[0] == SDO_ABORT) {
        server.writing = 0;
        return;
    }
    if (data[0] == SDO_READ) {
        server.writing = 0;
        data[0] = 0x43;
        BytesPut32(data + 4, index == OBJECT_TYPE ? TYPE : 0);
    } else if ((data[0] & SDO_KIND) == SDO_WRITE_SEGMENT) {
        store_segment(data);
    } else if ((data[0] & 2) != 0) {
        server.small = index == SMALL_INDEX ? BytesGet16(data + 4) : server.small;
        server.writing = 0;
        data[0] = SDO_WRITE_DONE;
    } else {
        server.writing = index;
        server.toggle = 0;
        server.size = 0;
        data[0] = SDO_WRITE_DONE;
    }
    say(CANOPEN_SDO_REPLY, data, 8, REPLY_MS);
}

static void command(RTS_UI8 what)
{
    if (what == NMT_RESET_COMMUNICATION)
        reset();
    else if (what == NMT_START)
        server.state = NODE_OPERATIONAL;
}

static void serve(CAN_FRAME *frame)
{
    if (server.state == OFF || server.boot_ms != NEVER)
        return;
    if (frame->id == CANOPEN_NMT) {
        command(frame->data[0]);
    } else if ((frame->flags & CAN_FLAG_REMOTE) != 0) {
        RTS_UI8 byte = server.state | server.guard_toggle;
        server.guard_toggle ^= CANOPEN_GUARD_TOGGLE;
        say(CANOPEN_HEARTBEAT, &byte, 1, REPLY_MS);
    } else {
        serve_sdo(frame->data);
    }
}

static void run_node(void)
{
    if (server.boot_ms == now_ms) {
        server.boot_ms = NEVER;
        server.state = NODE_BOOTS;
        say(CANOPEN_HEARTBEAT, &server.state, 1, 0);
        server.state = NODE_PREOPERATIONAL;
        server.heartbeat_ms = is_guarded ? (RTS_UI32)NEVER : now_ms;
    }
    if (server.heartbeat_ms == now_ms) {
        server.heartbeat_ms += HEARTBEAT_MS;
        say(CANOPEN_HEARTBEAT, &server.state, 1, 0);
    }
}

/* ---- a boot ---- */

static const RTS_UI8 config[] = {2, 0, 0, 0,  0x00,         0x20,      0,  LONG, 0,  0,  0,  1,  2,  3,  4,    5,    6,
                                 7, 8, 9, 10, 11,           12,        13, 14,   15, 16, 17, 18, 19, 20, 0x01, 0x20, 0,
                                 2, 0, 0, 0,  SMALL & 0xFF, SMALL >> 8};

static void begin(void)
{
    memset(&node, 0, sizeof node);
    memset(queue, 0, sizeof queue);
    frames = 0;
    now_ms = 1000;
    node.node = NODE;
    node.expected[EXPECTED_TYPE] = TYPE;
    node.config = config;
    node.config_size = sizeof config;
    node.heartbeat_ms = is_guarded ? 0 : HEARTBEAT_MS;
    node.guard_ms = HEARTBEAT_MS;
    node.guard_life = 4;
    reset();
    CanopenNodeBegin(&node, TIMEOUT_MS, now_ms);
}

static void pass(void)
{
    now_ms++;
    run_node();
    for (RTS_UI32 i = 0; i < QUEUE; i++) {
        if (!queue[i].waits || queue[i].at_ms > now_ms)
            continue;
        queue[i].waits = false;
        if (queue[i].to_node)
            serve(&queue[i].frame);
        else if (server.state != OFF)
            CanopenNodeTake(&node, &queue[i].frame, now_ms);
    }
    CanopenNodePoll(&node, send, NULL, now_ms);
}

static bool is_right(void)
{
    return server.state == NODE_OPERATIONAL && server.small == SMALL && server.long_size == LONG &&
           memcmp(server.long_bytes, config + 11, LONG) == 0;
}

/* True if the node runs, for a while, and as it should. */
static bool comes_into_operation(void)
{
    RTS_UI32 steady = 0;

    for (RTS_UI32 ms = 0; ms < PATIENCE_MS && steady < STEADY_MS; ms++) {
        pass();
        steady = node.state == MASTER_RUNS && is_right() ? steady + 1 : 0;
        if (node.state == MASTER_RUNS && !is_right() && server.state == NODE_OPERATIONAL)
            return false; /* with other objects */
    }
    return steady == STEADY_MS;
}

static RTS_UI32 count_frames(void)
{
    memset(faults, 0, sizeof faults);
    begin();
    CHECK(comes_into_operation());
    return frames;
}

static void check_fault(FAULT kind, RTS_UI32 ms)
{
    RTS_UI32 count = count_frames();

    for (RTS_UI32 i = 0; i < count; i++) {
        faults[0].kind = kind;
        faults[0].frame = i;
        faults[0].ms = ms;
        begin();
        if (!comes_into_operation())
            fprintf(stderr, "frame %u, fault %d, %u ms\n", (unsigned)i, (int)kind, (unsigned)ms);
        CHECK(node.state == MASTER_RUNS && is_right());
    }
    memset(faults, 0, sizeof faults);
}

static void check_faults(void)
{
    static const RTS_UI32 delays[] = {1, 2, 10, 60, 99, 100, 101, 250, 1000, 2000};

    check_fault(FAULT_LOST, 0);
    check_fault(FAULT_DOUBLED, 0);
    for (RTS_UI32 i = 0; i < RTS_COUNT(delays); i++)
        check_fault(FAULT_DELAYED, delays[i]);
}

/* ---- tests ---- */

static void each_frame_of_a_boot_may_be_lost_doubled_or_delayed(void)
{
    is_guarded = false;
    check_faults();
}

static void each_frame_of_the_boot_of_a_guarded_node_may_be_lost_doubled_or_delayed(void)
{
    is_guarded = true;
    check_faults();
}

static void check_pull(RTS_UI32 at, RTS_UI32 gone_ms)
{
    begin();
    for (RTS_UI32 ms = 0; ms < at; ms++)
        pass();
    power_off();
    for (RTS_UI32 ms = 0; ms < gone_ms; ms++)
        pass();
    reset();
    if (!comes_into_operation())
        fprintf(stderr, "pulled at %u ms, for %u ms\n", (unsigned)at, (unsigned)gone_ms);
    CHECK(node.state == MASTER_RUNS && is_right());
}

static void a_node_that_is_pulled_at_each_millisecond_of_its_boot_comes_back(void)
{
    static const RTS_UI32 gone[] = {1, 10, 100, 1000, 10000};

    for (RTS_UI32 guarded = 0; guarded < 2; guarded++)
        for (RTS_UI32 i = 0; i < RTS_COUNT(gone); i++)
            for (RTS_UI32 at = 0; at < 60; at++) {
                is_guarded = guarded != 0;
                check_pull(at, gone[i]);
            }
}

/* Heartbeat x 2.5, at least 50 ms more. */
static void a_node_that_is_gone_is_lost_in_time(void)
{
    RTS_UI32 ms = 0;

    is_guarded = false;
    (void)count_frames();
    power_off();
    for (; node.state == MASTER_RUNS && ms < 1000; ms++)
        pass();
    CHECK(ms <= HEARTBEAT_MS + 50 + 1);
    CHECK_EQUAL(node.why, MASTER_WHY_LOST);
}

static void the_master_may_be_restarted_a_thousand_times(void)
{
    is_guarded = false;
    for (RTS_UI32 i = 0; i < 1000; i++) {
        RTS_UI32 boot = i % 80;
        begin();
        for (RTS_UI32 ms = 0; ms < boot; ms++)
            pass();
        memset(&node.sdo, 0, sizeof node.sdo);
        CanopenNodeBegin(&node, TIMEOUT_MS, now_ms);
        CHECK(comes_into_operation());
    }
}

/* ---- the campaign ---- */

static RTS_UI32 random_number(RTS_UI32 limit)
{
    static RTS_UI32 seed = 1;

    seed = seed * 1664525u + 1013904223u;
    return (seed >> 8) % limit;
}

/* What the protocol cannot show is left out. The reply to a segment says by a single bit of which it is: one of an earlier
 * transfer, after a time-out or a late reset, is taken for the reply to the same segment of the next one, if this is lost.
 * And a node that restarts during its configuration, whose boot-up is lost, lacks what was written before. */
static bool is_well(RTS_UI32 count)
{
    for (RTS_UI32 i = 0; i < FAULTS; i++) {
        faults[i].kind = (FAULT)(1 + random_number(3));
        faults[i].frame = 1 + random_number(count - 1);
        faults[i].ms = random_number(TIMEOUT_MS / FAULTS);
    }
    is_guarded = random_number(2) != 0;
    begin();
    if (comes_into_operation())
        return true;
    for (RTS_UI32 i = 0; i < FAULTS; i++)
        fprintf(stderr, "frame %u, fault %d, %u ms\n", (unsigned)faults[i].frame, (int)faults[i].kind,
                (unsigned)faults[i].ms);
    return false;
}

static void boots_with_three_random_faults(RTS_UI32 boots)
{
    RTS_UI32 count = count_frames();
    RTS_UI32 done = 0;

    boots_arrive = true;
    for (; done != boots && is_well(count); done++)
        if (boots > 1000000 && done % 10000 == 0)
            printf("%u boots\n", (unsigned)done), fflush(stdout);
    CHECK_EQUAL(done, boots);
    memset(faults, 0, sizeof faults);
    boots_arrive = false;
}

static void some_boots_with_three_faults_end_well(void)
{
    boots_with_three_random_faults(2000);
}

int main(int argc, char **argv)
{
    if (argc > 1 && strcmp(argv[1], "campaign") == 0) {
        boots_with_three_random_faults(UINT32_MAX);
        return test_result();
    }
    RUN(each_frame_of_a_boot_may_be_lost_doubled_or_delayed);
    RUN(each_frame_of_the_boot_of_a_guarded_node_may_be_lost_doubled_or_delayed);
    RUN(a_node_that_is_pulled_at_each_millisecond_of_its_boot_comes_back);
    RUN(a_node_that_is_gone_is_lost_in_time);
    RUN(the_master_may_be_restarted_a_thousand_times);
    RUN(some_boots_with_three_faults_end_well);
    return test_result();
}
