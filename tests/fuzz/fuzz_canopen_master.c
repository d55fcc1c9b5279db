/*
 * fuzz_canopen_master.c - any frames from a CANopen node, any concise DCF, and a bus without room.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The first byte is the size of a concise DCF, which follows. Then a row of steps: a byte whose two lowest bits choose a
 * heartbeat, an SDO reply, an EMCY or a pause, and whose others are their size, or the pause. Whatever comes, a node that
 * then does what it should comes into operation.
 */
#include <string.h>

#include "CanopenMaster.h"
#include "CmpBytes.h"
#include "fuzz.h"

enum { NODE = 5, TIMEOUT_MS = 100, HEARTBEAT_MS = 200, STEP_MS = 5, TYPE = 0x20192, RECOVERY_MS = 60000 };
enum { HEARTBEAT, REPLY, EMCY, PAUSE, WHOLE = 8, WRITE_BLOCK = 0xC6 };

static CANOPEN_NODE node;
static CAN_FRAME sent;
static bool has_sent;
static bool is_full;
static RTS_UI32 now_ms;

/* The node that does what it should. */
static struct {
    bool is_on;
    RTS_UI32 boot_ms; /* 0: it is up */
    RTS_UI32 heartbeat_ms;
    RTS_UI8 state;
    RTS_UI8 toggle;
    bool is_guarded; /* a request waits */
} server;

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const uint8_t seeds[][40] = {
        {0, 4 | HEARTBEAT, 0, 0x20 | REPLY, 0x43, 0x00, 0x10, 0, 0x92, 0x01, 2, 0},
        {0, 4 | HEARTBEAT, 0, 0x20 | REPLY, 0x41, 0x00, 0x10, 0, 4, 0, 0, 0, 0x20 | REPLY, 0x07, 0x92, 0x01, 2, 0},
        {0, 4 | HEARTBEAT, 0, 0x20 | REPLY, 0x80, 0x00, 0x10, 0, 0, 0, 2, 6, 0xFF, 0x20 | EMCY, 0x10, 0x81},
        {16, 1, 0, 0, 0, 0, 0x20, 1, 5, 0, 0, 0, 1, 2, 3, 4, 5, 4 | HEARTBEAT, 0, 0xFF, 4 | HEARTBEAT, 5},
        {12, 1, 0, 0, 0, 0x17, 0x10, 0, 2, 0, 0, 0, 1, 4 | HEARTBEAT, 0, 4 | HEARTBEAT, 0x7F},
    };
    static const uint8_t sizes[] = {12, 20, 16, 22, 17};

    if (index >= sizeof(sizes) || capacity < sizes[index])
        return 0;
    memcpy(data, seeds[index], sizes[index]);
    return sizes[index];
}

/* ---- the node that does what it should ---- */

static void say(RTS_UI32 id, const RTS_UI8 *data, RTS_UI8 size)
{
    CAN_FRAME frame = {.id = id + NODE, .size = size};

    memcpy(frame.data, data, size);
    CanopenNodeTake(&node, &frame, now_ms);
}

static void serve_command(RTS_UI8 command)
{
    if (command == NMT_RESET_COMMUNICATION) {
        server.boot_ms = now_ms + 50;
        server.toggle = 0;
    }
    if (command == NMT_START)
        server.state = NODE_OPERATIONAL;
    if (command == NMT_STOP)
        server.state = NODE_STOPPED;
}

static void serve_sdo(RTS_UI8 *data)
{
    if (data[0] == SDO_ABORT)
        return;
    if (data[0] == SDO_READ) {
        data[0] = 0x43;
        BytesPut32(data + 4, BytesGet16(data + 1) == OBJECT_TYPE ? TYPE : 0);
    } else if ((data[0] & SDO_KIND) == SDO_WRITE_SEGMENT) {
        data[0] = (RTS_UI8)(SDO_SEGMENT_DONE | (data[0] & SDO_TOGGLE));
    } else if (data[0] == WRITE_BLOCK) { /* it has no block transfer */
        data[0] = SDO_ABORT;
        BytesPut32(data + 4, SDO_ABORT_COMMAND);
    } else {
        data[0] = SDO_WRITE_DONE;
    }
    say(CANOPEN_SDO_REPLY, data, WHOLE);
}

static void serve_guarding(void)
{
    RTS_UI8 byte = server.state | server.toggle;

    server.is_guarded = false;
    server.toggle ^= CANOPEN_GUARD_TOGGLE;
    say(CANOPEN_HEARTBEAT, &byte, 1);
}

static void serve(void)
{
    if (server.boot_ms != 0 && now_ms >= server.boot_ms) {
        server.boot_ms = 0;
        server.state = NODE_BOOTS;
        say(CANOPEN_HEARTBEAT, &server.state, 1);
        server.state = NODE_PREOPERATIONAL;
    }
    if (has_sent && sent.id == CANOPEN_NMT)
        serve_command(sent.data[0]);
    else if (has_sent && server.boot_ms == 0)
        serve_sdo(sent.data);
    has_sent = false;
    if (server.is_guarded)
        serve_guarding();
    if (node.heartbeat_ms != 0 && server.boot_ms == 0 && now_ms - server.heartbeat_ms >= HEARTBEAT_MS) {
        server.heartbeat_ms = now_ms;
        say(CANOPEN_HEARTBEAT, &server.state, 1);
    }
}

/* ---- the manager ---- */

static bool take_frame(void *owner, const CAN_FRAME *frame)
{
    (void)owner;
    bool is_guarding = frame->flags == CAN_FLAG_REMOTE && frame->id == CANOPEN_HEARTBEAT + NODE;

    FUZZ_CHECK(frame->size <= WHOLE);
    FUZZ_CHECK(is_guarding ||
               (frame->flags == 0 && (frame->id == CANOPEN_NMT || frame->id == CANOPEN_SDO_REQUEST + NODE)));
    if (is_full)
        return false;
    server.is_guarded = server.is_guarded || is_guarding;
    if (is_guarding)
        return true;
    sent = *frame;
    has_sent = true;
    return true;
}

static void pass(RTS_UI32 ms)
{
    now_ms += ms;
    CanopenNodePoll(&node, take_frame, NULL, now_ms);
    FUZZ_CHECK(CanopenNodeGetWaitMs(&node, now_ms) > 0); /* main does not spin */
}

static void begin(const RTS_UI8 *config, RTS_UI32 size)
{
    memset(&node, 0, sizeof(node));
    memset(&server, 0, sizeof(server));
    now_ms = 0xFFFFF000; /* it wraps */
    is_full = has_sent = false;
    node.node = NODE;
    node.expected[EXPECTED_TYPE] = TYPE;
    if (size % 2 != 0) {
        node.guard_ms = HEARTBEAT_MS;
        node.guard_life = 3;
    } else {
        node.heartbeat_ms = HEARTBEAT_MS;
    }
    if (CanopenIsConfig(config, size)) {
        node.config = config;
        node.config_size = size;
    }
    CanopenNodeBegin(&node, TIMEOUT_MS, now_ms);
    pass(0);
}

static size_t step(const uint8_t *input, size_t size)
{
    static const RTS_UI32 ids[] = {CANOPEN_HEARTBEAT, CANOPEN_SDO_REPLY, CANOPEN_EMCY};
    uint8_t head = input[0];
    RTS_UI8 data[WHOLE] = {0};
    RTS_UI8 length = (RTS_UI8)(head >> 2 & 0x0F);

    if ((head & 3) == PAUSE) {
        is_full = (head & 0x40) != 0;
        pass((head & 0x80) != 0 ? 500 : length);
        return 1;
    }
    if (length > WHOLE)
        length = WHOLE;
    node.must_wait = length == WHOLE && (head & 0x80) != 0;
    if (node.must_wait)
        CanopenNodeHalt(&node, now_ms);
    memcpy(data, input + 1, length < size - 1 ? length : size - 1);
    say(ids[head & 3], data, length);
    pass((head & 0x40) != 0);
    return 1 + (size_t)length;
}

static void check_recovery(void)
{
    is_full = has_sent = node.must_wait = false;
    server.state = NODE_PREOPERATIONAL;
    server.heartbeat_ms = now_ms;
    for (RTS_UI32 ms = 0; ms < RECOVERY_MS && node.state != MASTER_RUNS; ms += STEP_MS) {
        serve();
        pass(STEP_MS);
    }
    FUZZ_CHECK(node.state == MASTER_RUNS);
}

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size)
{
    RTS_UI32 config_size = size > 0 ? input[0] : 0;
    RTS_UI8 *config;

    if (size == 0)
        return 0;
    if (config_size > size - 1)
        config_size = (RTS_UI32)size - 1;
    config = malloc(config_size + 1u); /* the sanitizer sees its end */
    memcpy(config + 1, input + 1, config_size);
    begin(config + 1, config_size);
    for (size_t i = 1 + config_size; i < size;)
        i += step(input + i, size - i);
    check_recovery();
    free(config);
    return 0;
}
