/*
 * test_can_shared.c - CmpCan: several users of one controller: filters, order of frames, bus off.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpCan.h"
#include "can_client.h"
#include "comm_fakes.h"
#include "test.h"

enum { KBIT = 1000, OTHER = 9, MANY = 20 };

static struct {
    CAN_FRAME urgent[MANY];
    RTS_UI32 urgents;
    CAN_FRAME later[MANY];
    RTS_UI32 laters;
    bool leaves; /* urgent frames to `take` */
    RTS_UI32 changes;
    bool off;
} seen;

static bool take_urgent(RTS_UI32 index, const CAN_FRAME *frame)
{
    CHECK_EQUAL(index, 0);
    if (seen.urgents < MANY)
        seen.urgent[seen.urgents++] = *frame;
    return !seen.leaves;
}

static void take(RTS_UI32 index, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    CHECK_EQUAL(index, 0);
    CHECK_EQUAL(now_ms, fakes.now_ms);
    if (seen.laters < MANY)
        seen.later[seen.laters++] = *frame;
}

static void note_bus(RTS_UI32 index, bool off)
{
    CHECK_EQUAL(index, 0);
    seen.changes++;
    seen.off = off;
}

static CAN_FILTER filter[40];
static CAN_USER user = {
    .filters = filter, .filter_count = 1, .take_urgent = take_urgent, .take = take, .note_bus = note_bus};

static void start(RTS_UI32 id, RTS_UI32 mask, bool extended)
{
    can_start(500 * KBIT, 0);
    memset(&seen, 0, sizeof(seen));
    filter[0] = (CAN_FILTER){id, mask, extended};
    user.filter_count = 1;
    SimCanStart(OTHER);
    CHECK_EQUAL(CanAttach(0, &user), ERR_OK);
}

static void end(void)
{
    CanDetach(0, &user);
    can_end();
}

static void send_to_device(RTS_UI32 id, bool extended)
{
    const CAN_FRAME frame = {.id = id, .flags = extended ? CAN_FLAG_EXTENDED : 0, .size = 1, .data = {(RTS_UI8)id}};

    CHECK_EQUAL(SimCanSend(OTHER, &frame), ERR_OK);
}

static RTS_RESULT send_from_device(RTS_UI32 id, bool extended)
{
    const CAN_FRAME frame = {.id = id, .flags = extended ? CAN_FLAG_EXTENDED : 0, .size = 8};

    return CanSend(0, &frame);
}

static void an_11_bit_frame_is_handed_over_when_it_arrives(void)
{
    start(0x180, 0x780, false);
    send_to_device(0x185, false);
    SimCanAdvance(SimCanNow() + 1000000);
    CHECK_EQUAL(seen.urgents, 1);
    CHECK_EQUAL(seen.urgent[0].id, 0x185);
    can_pass(2);
    CHECK_EQUAL(seen.laters, 0);
    end();
}

static void a_frame_that_is_not_taken_at_once_comes_in_main(void)
{
    start(0x180, 0x780, false);
    seen.leaves = true;
    send_to_device(0x185, false);
    SimCanAdvance(SimCanNow() + 1000000);
    CHECK_EQUAL(seen.laters, 0);
    can_pass(2);
    CHECK_EQUAL(seen.urgents, 1);
    CHECK_EQUAL(seen.laters, 1);
    end();
}

static void users_get_what_passes_their_own_filters(void)
{
    CLIENT client;

    start(0x12340000, 0x1FFF0000, true);
    can_client(&client, can_tool(200));
    CHECK(client_open(&client) && client_login(&client));
    send_to_device(0x12340007, true);
    send_to_device(0x12350007, true);
    can_pass(5);
    CHECK_EQUAL(seen.laters, 1);
    CHECK_EQUAL(seen.later[0].id, 0x12340007);
    end();
}

static void more_filters_than_the_controller_has_let_all_frames_pass(void)
{
    start(0x100, 0x7FF, false);
    for (RTS_UI32 i = 0; i < RTS_COUNT(filter); i++)
        filter[i] = (CAN_FILTER){0x12340000 + i, 0x1FFFFFFF, true};
    user.filter_count = RTS_COUNT(filter);
    CHECK_EQUAL(CanUpdateFilters(0), ERR_OK);
    send_to_device(0x12340000 + RTS_COUNT(filter) - 1, true);
    send_to_device(0x12340000 + RTS_COUNT(filter), true);
    can_pass(5);
    CHECK_EQUAL(seen.laters, 1);
    CHECK_EQUAL(CanGetCounters(0)->unwanted, 1);
    end();
}

/* 80 frames of a download wait: one is on the bus, and then the SYNC goes. */
static void an_11_bit_frame_goes_before_those_of_29_bits(void)
{
    CAN_FRAME frame;
    RTS_UI32 sent = 0;

    start(0, 0x7FF, false);
    while (send_from_device(0x1F4001FF, true) == ERR_OK)
        sent++;
    CHECK(sent >= SIM_CAN_QUEUE);
    (void)SimCanNext();
    CHECK_EQUAL(send_from_device(0x080, false), ERR_OK);
    can_pass(2);
    CHECK(SimCanReceive(OTHER, &frame) == ERR_OK && frame.id == 0x1F4001FF);
    CHECK(SimCanReceive(OTHER, &frame) == ERR_OK && frame.id == 0x1F4001FF); /* its place was the one that got free */
    CHECK(SimCanReceive(OTHER, &frame) == ERR_OK && frame.id == 0x080);
    end();
}

static void an_11_bit_frame_without_room_waits_and_keeps_others_waiting(void)
{
    start(0, 0x7FF, false);
    while (send_from_device(0x1F4001FF, true) == ERR_OK)
        ;
    for (RTS_UI32 i = 0; i < CAN_URGENT_FRAMES; i++)
        CHECK_EQUAL(send_from_device(0x180 + i, false), ERR_OK);
    CHECK_EQUAL(send_from_device(0x700, false), ERR_NOBUFFER);
    CHECK_EQUAL(send_from_device(0x1F4001FF, true), ERR_NOBUFFER);
    for (RTS_UI32 i = 0; i < 200; i++)
        can_pass(1);
    CHECK_EQUAL(send_from_device(0x700, false), ERR_OK);
    end();
}

static void users_notice_bus_off_once(void)
{
    start(0x180, 0x780, false);
    SimCanDestroy(SIM_CAN_DEVICE, 32);
    CHECK_EQUAL(send_from_device(0x181, false), ERR_OK);
    for (RTS_UI32 i = 0; i < 100 && !CanIsOff(0); i++)
        can_pass(1);
    CHECK(CanIsOff(0) && seen.off && seen.changes == 1);
    CHECK_EQUAL(CanGetCounters(0)->bus_off, 1);
    for (RTS_UI32 i = 0; i < 2 * CAN_RESTART_MS && CanIsOff(0); i++)
        can_pass(1);
    CHECK(!CanIsOff(0) && !seen.off && seen.changes == 2);
    end();
}

enum { USERS = 9 };

static bool reserves(RTS_UI32 index, RTS_UI32 id)
{
    CHECK_EQUAL(index, 0);
    return id == 0x123;
}

static void there_may_be_any_number_of_users(void)
{
    static CAN_USER users[USERS];

    start(0x180, 0x780, false); /* beside the block driver */
    for (RTS_UI32 i = 0; i < USERS; i++) {
        users[i] = (CAN_USER){.filters = filter, .filter_count = 1, .take = take, .reserves = i == 2 ? reserves : NULL};
        CHECK_EQUAL(CanAttach(0, &users[i]), ERR_OK);
        CHECK_EQUAL(CanAttach(0, &users[i]), ERR_DUPLICATE);
        CHECK_EQUAL(CanAttach(1, &users[i]), ERR_DEVICE);
    }
    send_to_device(0x181, false);
    can_pass(1);
    CHECK_EQUAL(seen.laters, 1 + USERS);
    CHECK(CanIsReserved(0, 0x123) && !CanIsReserved(0, 0x124));
    for (RTS_UI32 i = 0; i < USERS; i += 2)
        CanDetach(0, &users[i]);
    CanDetach(0, &users[0]); /* is not there any more */
    CHECK(!CanIsReserved(0, 0x123));
    send_to_device(0x182, false);
    can_pass(1);
    CHECK_EQUAL(seen.laters, 1 + USERS + 1 + USERS / 2);
    for (RTS_UI32 i = 1; i < USERS; i += 2)
        CanDetach(0, &users[i]);
    end();
}

static void a_closed_controller_sends_nothing(void)
{
    start(0x180, 0x780, false);
    end();
    CHECK_EQUAL(send_from_device(0x181, false), ERR_DEVICE);
}

int main(void)
{
    RUN(an_11_bit_frame_is_handed_over_when_it_arrives);
    RUN(a_frame_that_is_not_taken_at_once_comes_in_main);
    RUN(users_get_what_passes_their_own_filters);
    RUN(more_filters_than_the_controller_has_let_all_frames_pass);
    RUN(an_11_bit_frame_goes_before_those_of_29_bits);
    RUN(an_11_bit_frame_without_room_waits_and_keeps_others_waiting);
    RUN(users_notice_bus_off_once);
    RUN(there_may_be_any_number_of_users);
    RUN(a_closed_controller_sends_nothing);
    return test_result();
}
