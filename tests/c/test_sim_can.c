/*
 * test_sim_can.c - the simulated CAN bus: the time of frames, arbitration, filters, errors, bus off.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "SimCan.h"
#include "test.h"

enum { MS = 1000000, BIT_NS = 2000, A = 1, B = 2, C = 3 };

static CAN_FRAME frame_of(RTS_UI32 id, RTS_UI8 flags, RTS_UI8 size, RTS_UI8 byte)
{
    CAN_FRAME frame = {.id = id, .flags = flags, .size = size};

    memset(frame.data, byte, size);
    return frame;
}

static void start(void)
{
    SimCanReset(500000, 2000000);
    for (RTS_UI32 node = A; node <= C; node++)
        SimCanStart(node);
}

static void send(RTS_UI32 node, RTS_UI32 id, RTS_UI8 byte)
{
    CAN_FRAME frame = frame_of(id, CAN_FLAG_EXTENDED, 8, byte);

    CHECK_EQUAL(SimCanSend(node, &frame), ERR_OK);
}

/* The identifier of the next frame a node got; 0: none. */
static RTS_UI32 got(RTS_UI32 node)
{
    CAN_FRAME frame;

    return SimCanReceive(node, &frame) == ERR_OK ? frame.id : 0;
}

static void pass(RTS_I64 ns)
{
    SimCanAdvance(SimCanNow() + ns);
}

static CAN_STATE state_of(RTS_UI32 node)
{
    CAN_STATE state;

    SimCanGetState(node, &state);
    return state;
}

/* 47 + 8n bits and those that are stuffed with 11-bit identifiers, 67 + 8n with 29; see ISO 11898-1. */
static void a_frame_takes_the_time_of_its_bits(void)
{
    start();
    CAN_FRAME frame = frame_of(0x555, 0, 0, 0);
    CHECK_EQUAL(SimCanFrameNs(&frame) % BIT_NS, 0);
    CHECK(SimCanFrameNs(&frame) >= 47 * BIT_NS && SimCanFrameNs(&frame) <= (47 + 8) * BIT_NS);
    frame = frame_of(0x15555555, CAN_FLAG_EXTENDED, 8, 0x55); /* nothing to be stuffed but in length and check sum */
    CHECK(SimCanFrameNs(&frame) >= 131 * BIT_NS && SimCanFrameNs(&frame) <= (131 + 4) * BIT_NS);
    frame = frame_of(0, CAN_FLAG_EXTENDED, 8, 0); /* every fifth bit of 118 at most */
    CHECK(SimCanFrameNs(&frame) > (131 + 18) * BIT_NS && SimCanFrameNs(&frame) <= (131 + 29) * BIT_NS);
    CAN_FRAME slow = frame_of(0x15555555, CAN_FLAG_EXTENDED | CAN_FLAG_FD, 64, 0x55);
    CAN_FRAME fast = frame_of(0x15555555, CAN_FLAG_EXTENDED | CAN_FLAG_FD | CAN_FLAG_FAST, 64, 0x55);
    CHECK(SimCanFrameNs(&fast) < SimCanFrameNs(&slow) / 3);
    CHECK(SimCanFrameNs(&fast) > 35 * BIT_NS + 550 * BIT_NS / 4);
}

static void all_others_get_it_when_it_ends_and_not_before(void)
{
    start();
    send(A, 0x1234, 1);
    CAN_FRAME frame = frame_of(0x1234, CAN_FLAG_EXTENDED, 8, 1);
    RTS_I64 takes = SimCanFrameNs(&frame);
    CHECK_EQUAL(SimCanNext(), takes);
    pass(takes - 1);
    CHECK_EQUAL(got(B), 0);
    pass(1);
    CHECK(got(A) == 0 && got(B) == 0x1234 && got(C) == 0x1234);
    CHECK_EQUAL(SimCanBusyNs(), takes);
    CHECK_EQUAL(SimCanNext(), INT64_MAX);
}

static void the_lowest_identifier_goes_first(void)
{
    CAN_FRAME standard = frame_of(0x600, 0, 1, 0);

    start();
    send(A, 0x7FF, 0);
    (void)SimCanNext(); /* it has begun */
    send(A, 0x1F400000, 0);
    send(B, 0x18000001, 0); /* its first 11 bits are those of the standard frame, which goes before it */
    CHECK_EQUAL(SimCanSend(C, &standard), ERR_OK);
    pass(10 * MS);
    CHECK(got(B) == 0x7FF && got(B) == 0x600 && got(B) == 0x1F400000);
    CHECK(got(C) == 0x7FF && got(C) == 0x18000001 && got(C) == 0x1F400000);
}

static void frames_of_a_node_stay_in_order(void)
{
    start();
    for (RTS_UI32 i = 0; i < SIM_CAN_QUEUE; i++)
        send(A, 0x1000 - i, 0);
    CAN_FRAME more = frame_of(1, 0, 0, 0);
    CHECK_EQUAL(SimCanSend(A, &more), ERR_NOBUFFER);
    pass(100 * MS);
    for (RTS_UI32 i = 0; i < SIM_CAN_QUEUE; i++)
        CHECK_EQUAL(got(B), 0x1000 - i);
}

static void filters_let_pass_what_they_say(void)
{
    const CAN_FILTER filters[] = {{0x1F400500, 0x1FFFFF00, true}, {0x123, 0x7FF, false}};
    static const struct {
        RTS_UI32 id;
        RTS_UI8 flags;
        bool passes;
    } frames[] = {{0x1F4005AA, CAN_FLAG_EXTENDED, true},
                  {0x1F4006AA, CAN_FLAG_EXTENDED, false},
                  {0x123, 0, true},
                  {0x123, CAN_FLAG_EXTENDED, false},
                  {0x122, 0, false},
                  {0x500, 0, false}};

    start();
    CHECK_EQUAL(SimCanSetFilters(B, filters, RTS_COUNT(filters)), ERR_OK);
    for (RTS_UI32 i = 0; i < RTS_COUNT(frames); i++) {
        CAN_FRAME frame = frame_of(frames[i].id, frames[i].flags, 1, 0);
        CHECK_EQUAL(SimCanSend(A, &frame), ERR_OK);
        pass(1 * MS);
        CHECK_EQUAL(got(B), frames[i].passes ? frames[i].id : 0);
    }
}

static void what_cannot_be_a_frame_is_refused(void)
{
    static const CAN_FRAME frames[] = {
        {.id = 0x800},
        {.id = 0x20000000, .flags = CAN_FLAG_EXTENDED},
        {.size = 9},
        {.size = 12},
        {.size = 9, .flags = CAN_FLAG_FD},
        {.size = 65, .flags = CAN_FLAG_FD},
        {.flags = CAN_FLAG_FAST},
        {.flags = CAN_FLAG_FD | CAN_FLAG_REMOTE},
    };

    start();
    for (RTS_UI32 i = 0; i < RTS_COUNT(frames); i++)
        CHECK_EQUAL(SimCanSend(A, &frames[i]), ERR_PARAMETER);
}

static void a_destroyed_frame_is_sent_again_and_counted(void)
{
    start();
    SimCanDestroy(A, 3);
    send(A, 5, 0);
    pass(10 * MS);
    CHECK(got(B) == 5 && got(B) == 0);
    CHECK_EQUAL(state_of(A).tx_errors, 3 * 8 - 1);
    CHECK_EQUAL(state_of(B).rx_errors, 3 - 1);
    CHECK_EQUAL(state_of(A).bus, CAN_BUS_ACTIVE);
    CHECK_EQUAL(SimCanFrames(), 1);
}

static void a_node_passes_all_states_to_bus_off_and_comes_back(void)
{
    CAN_FRAME frame = frame_of(5, 0, 0, 0);

    start();
    SimCanDestroy(A, 1000);
    send(A, 5, 0);
    CAN_BUS_STATE seen = CAN_BUS_ACTIVE;
    RTS_UI32 changes = 0;
    for (int i = 0; i < 100; i++) {
        pass(MS / 2);
        changes += state_of(A).bus != seen;
        seen = state_of(A).bus;
    }
    CHECK(changes == 3 && seen == CAN_BUS_OFF);
    CHECK_EQUAL(SimCanSend(A, &frame), ERR_DEVICE);
    pass(1000 * MS); /* not by itself */
    CHECK_EQUAL(state_of(A).bus, CAN_BUS_OFF);
    SimCanDestroy(A, 0);
    SimCanRestart(A);
    pass(128 * 11 * BIT_NS - 1);
    CHECK_EQUAL(state_of(A).bus, CAN_BUS_OFF);
    pass(1);
    CHECK(state_of(A).bus == CAN_BUS_ACTIVE && state_of(A).tx_errors == 0);
    send(A, 6, 0);
    pass(1 * MS);
    CHECK(got(B) == 6 && got(B) == 0); /* what waited is forgotten */
}

static void a_node_that_is_alone_becomes_passive_and_no_worse(void)
{
    start();
    SimCanStop(B);
    SimCanStop(C);
    send(A, 5, 0);
    pass(1000 * MS);
    CHECK(state_of(A).bus == CAN_BUS_PASSIVE && state_of(A).tx_errors == 128);
    SimCanStart(B);
    pass(1 * MS);
    CHECK_EQUAL(got(B), 5);
}

/* Two nodes of one address are found out because their data differ. */
static void the_same_identifier_from_two_nodes_is_an_error(void)
{
    start();
    send(A, 5, 0x0F);
    send(B, 5, 0xF0);
    pass(1 * MS);
    CHECK(state_of(A).tx_errors != 0 && state_of(B).tx_errors != 0);
    start();
    send(A, 5, 0x0F);
    send(B, 5, 0x0F); /* no node can tell */
    pass(1 * MS);
    CHECK(got(C) == 5 && got(C) == 0 && state_of(A).tx_errors == 0);
}

static void what_finds_no_room_is_counted(void)
{
    start();
    SimCanLose(B, 4);
    for (RTS_UI32 i = 1; i <= 8; i++)
        send(A, i, 0);
    pass(10 * MS);
    CHECK_EQUAL(state_of(B).lost, 2);
    CHECK(got(B) == 1 && got(B) == 2 && got(B) == 3 && got(B) == 5);
}

static void the_device_is_node_0(void)
{
    CAN_FRAME frame = frame_of(0x77, 0, 2, 9);
    const CAN_FILTER all = {0, 0, false};
    CAN_STATE state;

    start();
    SimCanSetAddress(9, 0x1E000000);
    CAN_ADDRESS address;
    SysCanGetAddress(0, &address);
    CHECK(address.node == 9 && address.base == 0x1E000000);
    CHECK_EQUAL(SysCanGetCount(), 1);
    CHECK_EQUAL(SysCanOpen(1, 0, 0), ERR_DEVICE);
    CHECK_EQUAL(SysCanOpen(0, 125000, 0), ERR_NOT_SUPPORTED);
    CHECK_EQUAL(SysCanSend(0, &frame), ERR_DEVICE);
    CHECK_EQUAL(SysCanOpen(0, 500000, 0), ERR_OK);
    CHECK(SysCanIsFd(0));
    CHECK_EQUAL(SysCanSend(0, &frame), ERR_OK);
    pass(1 * MS);
    CHECK_EQUAL(got(A), 0x77);
    CHECK_EQUAL(SimCanSend(A, &frame), ERR_OK);
    pass(1 * MS);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_NOTHING_TO_DO); /* no filters yet */
    CHECK_EQUAL(SysCanSetFilters(0, &all, 1), ERR_OK);
    CHECK_EQUAL(SimCanSend(A, &frame), ERR_OK);
    pass(1 * MS);
    CHECK_EQUAL(SysCanReceive(0, &frame), ERR_OK);
    CHECK(frame.time_us > 2000 && frame.time_us < 3000);
    SysCanGetState(0, &state);
    CHECK(state.bus == CAN_BUS_ACTIVE && state.bit_rate == 500000);
    SysCanClose(0);
    CHECK_EQUAL(SysCanSend(0, &frame), ERR_DEVICE);
}

int main(void)
{
    RUN(a_frame_takes_the_time_of_its_bits);
    RUN(all_others_get_it_when_it_ends_and_not_before);
    RUN(the_lowest_identifier_goes_first);
    RUN(frames_of_a_node_stay_in_order);
    RUN(filters_let_pass_what_they_say);
    RUN(what_cannot_be_a_frame_is_refused);
    RUN(a_destroyed_frame_is_sent_again_and_counted);
    RUN(a_node_passes_all_states_to_bus_off_and_comes_back);
    RUN(a_node_that_is_alone_becomes_passive_and_no_worse);
    RUN(the_same_identifier_from_two_nodes_is_an_error);
    RUN(what_finds_no_room_is_counted);
    RUN(the_device_is_node_0);
    return test_result();
}
