/*
 * test_canopen_master.c - the manager of CANopen nodes, and nodes that reply what they should not.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenMaster.h"
#include "CmpBytes.h"
#include "test.h"

enum { NODE = 5, TIMEOUT_MS = 100, TYPE = 0x20192, VENDOR = 0x123 };

static CANOPEN_NODE node;
static CAN_FRAME sent; /* the newest frame */
static RTS_UI32 sent_count;
static bool is_full;
static RTS_UI32 now_ms;

static bool take_frame(void *owner, const CAN_FRAME *frame)
{
    RTS_UNUSED(owner);
    if (is_full)
        return false;
    sent = *frame;
    sent_count++;
    return true;
}

static void poll(void)
{
    CanopenNodePoll(&node, take_frame, NULL, now_ms);
}

static void pass(RTS_UI32 ms)
{
    now_ms += ms;
    poll();
}

static void reply(RTS_UI8 command, RTS_UI16 index, RTS_UI8 sub, RTS_UI32 value)
{
    CAN_FRAME frame = {.id = CANOPEN_SDO_REPLY + NODE, .size = 8, .data = {command}};

    BytesPut16(frame.data + 1, index);
    frame.data[3] = sub;
    BytesPut32(frame.data + 4, value);
    CanopenNodeTake(&node, &frame, now_ms);
}

static void segment(RTS_UI8 command)
{
    const CAN_FRAME frame = {.id = CANOPEN_SDO_REPLY + NODE, .size = 8, .data = {command, 1, 2, 3, 4, 5, 6, 7}};

    CanopenNodeTake(&node, &frame, now_ms);
}

/* A node that has booted is asked for its type. */
static void begin(void)
{
    const CAN_FRAME boot = {.id = CANOPEN_HEARTBEAT + NODE, .size = 1, .data = {NODE_BOOTS}};

    memset(&node, 0, sizeof node);
    node.node = NODE;
    node.expected[EXPECTED_TYPE] = TYPE;
    node.expected[EXPECTED_VENDOR] = VENDOR;
    is_full = false;
    sent_count = 0;
    now_ms = 1000;
    CanopenNodeBegin(&node, TIMEOUT_MS, now_ms);
    poll();
    CHECK_EQUAL(sent.id, CANOPEN_NMT);
    CanopenNodeTake(&node, &boot, now_ms);
    poll();
    CHECK_EQUAL(node.state, MASTER_IDENTIFY);
    CHECK_EQUAL(sent.data[0], SDO_READ);
}

static void a_node_that_replies_comes_into_operation(void)
{
    begin();
    reply(0x43, OBJECT_TYPE, 0, TYPE);
    poll();
    CHECK_EQUAL(node.state, MASTER_IDENTIFY);
    CHECK_EQUAL(BytesGet16(sent.data + 1), OBJECT_IDENTITY);
    reply(0x43, OBJECT_IDENTITY, 1, VENDOR);
    poll();
    CHECK_EQUAL(node.state, MASTER_RUNS);
    CHECK_EQUAL(sent.id, CANOPEN_NMT);
    CHECK_EQUAL(sent.data[0], NMT_START);
}

static void replies_to_other_requests_do_not_lengthen_the_wait(void)
{
    begin();
    for (RTS_UI32 ms = 0; ms < 2 * TIMEOUT_MS + 20; ms += 10) {
        reply(0x43, 0x2000, 1, 0);
        pass(10);
    }
    CHECK_EQUAL(node.counters.timeouts, 2);
    CHECK_EQUAL(node.state, MASTER_WAITS);
    CHECK_EQUAL(node.why, MASTER_WHY_SILENT);
}

static void an_object_of_endless_empty_segments_is_refused(void)
{
    begin();
    reply(0x41, OBJECT_TYPE, 0, 4);
    for (RTS_UI32 i = 0; i < 100; i++) {
        pass(1);
        segment((RTS_UI8)((i % 2 != 0 ? SDO_TOGGLE : 0) | 7 << 1));
    }
    CHECK_EQUAL(node.counters.aborts, 1);
    CHECK_EQUAL(node.state, MASTER_WAITS);
    CHECK_EQUAL(node.why, MASTER_WHY_TYPE);
}

static void an_object_that_is_too_long_is_refused(void)
{
    begin();
    reply(0x41, OBJECT_TYPE, 0, 0xFFFFFFFF);
    for (RTS_UI32 i = 0; i < 100; i++) {
        pass(1);
        segment(i % 2 != 0 ? SDO_TOGGLE : 0);
    }
    CHECK_EQUAL(node.counters.last_abort, SDO_ABORT_MEMORY);
    CHECK_EQUAL(node.state, MASTER_WAITS);
}

/* The next request waits for room in the controller; the reply came twice. */
static void a_reply_to_a_request_that_was_not_sent_is_ignored(void)
{
    begin();
    is_full = true;
    reply(0x41, OBJECT_TYPE, 0, 14);
    segment(0);
    segment(SDO_TOGGLE | 1);
    CHECK_EQUAL(node.sdo.done, 0);
    is_full = false;
    poll();
    segment(0);
    CHECK_EQUAL(node.sdo.done, 7);
}

/* The node has refused the previous segment, sent twice, while the next one waits for room. */
static void an_abort_ends_a_transfer_whose_next_request_waits(void)
{
    begin();
    reply(0x41, OBJECT_TYPE, 0, 14);
    poll();
    is_full = true;
    segment(0);
    CHECK(node.sdo.has_request);
    reply(SDO_ABORT, OBJECT_TYPE, 0, SDO_ABORT_TOGGLE);
    CHECK_EQUAL(node.sdo.state, SDO_ABORTED);
    CHECK(!node.sdo.has_request);
}

int main(void)
{
    RUN(a_node_that_replies_comes_into_operation);
    RUN(replies_to_other_requests_do_not_lengthen_the_wait);
    RUN(an_object_of_endless_empty_segments_is_refused);
    RUN(an_object_that_is_too_long_is_refused);
    RUN(a_reply_to_a_request_that_was_not_sent_is_ignored);
    RUN(an_abort_ends_a_transfer_whose_next_request_waits);
    return test_result();
}
