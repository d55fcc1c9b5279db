/*
 * test_comm_channel_loss.c - CmpChannelServerEmbedded: what is lost, repeated, delayed or doubled.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "channel_fixture.h"

static void duplicate_blocks_are_acknowledged_again_and_not_taken_twice(void)
{
    setup();
    RTS_UI32 size = echo_message(600);
    client_send_block(&client, 1, FIRST, message, size, 0, 300);
    CHECK(is_silent());
    client_send_block(&client, 1, FIRST, message, size, 0, 300);
    CHECK(is_ack(1, 0));
    client_send_block(&client, 2, NEXT, message, size, 300, size - 300);
    CHECK(client_take_message(&client, reply) > 600);
    CHECK_EQUAL(counters()->duplicates, 1);
}

static void gap_is_reported_at_once_and_only_once(void)
{
    setup();
    RTS_UI32 size = echo_message(1200);
    client_send_block(&client, 1, FIRST, message, size, 0, 300);
    client_send_block(&client, 3, NEXT, message, size, 600, 300);
    CHECK(is_ack(1, CHANNEL_FLAG_MISSING));
    client_send_block(&client, 4, NEXT, message, size, 900, size - 900);
    CHECK(is_silent());
    client_send_block(&client, 2, NEXT, message, size, 300, 300);
    client_send_block(&client, 3, NEXT, message, size, 600, 300);
    client_send_block(&client, 4, NEXT, message, size, 900, size - 900);
    CHECK(client_take_message(&client, reply) > 1200);
    CHECK_EQUAL(counters()->gaps, 2);
}

static void each_gap_is_reported(void)
{
    setup();
    RTS_UI32 size = echo_message(1200);
    client_send_block(&client, 1, FIRST, message, size, 0, 300);
    client_send_block(&client, 3, NEXT, message, size, 600, 300);
    CHECK(is_ack(1, CHANNEL_FLAG_MISSING));
    client_send_block(&client, 2, NEXT, message, size, 300, 300);
    client_send_block(&client, 4, NEXT, message, size, 900, 300);
    CHECK(is_ack(2, CHANNEL_FLAG_MISSING));
}

static void gap_is_reported_again_when_the_repetition_is_lost_too(void)
{
    setup();
    RTS_UI32 size = echo_message(1200);
    client_send_block(&client, 1, FIRST, message, size, 0, 300);
    client_send_block(&client, 3, NEXT, message, size, 600, 300);
    CHECK(is_ack(1, CHANNEL_FLAG_MISSING));
    client_send_block(&client, 3, NEXT, message, size, 600, 300);
    CHECK(is_ack(1, CHANNEL_FLAG_MISSING));
}

static void reply_is_repeated_until_acknowledged(void)
{
    setup();
    RTS_UI32 size = echo_message(600);
    client_send_message(&client, message, size);
    CHECK(is_block(1));
    CHECK(is_block(2));
    CHECK(is_silent());
    fakes_cycle(999);
    CHECK(is_silent());
    fakes_cycle(1);
    CHECK(is_block(1));
    CHECK(is_block(2));
    client_send_ack(&client, 2, 0);
    for (int i = 0; i < 20; i++)
        fakes_cycle(900);
    while (client_take(&client, NULL, package) != 0)
        CHECK_EQUAL(package[0], CHANNEL_PKG_KEEPALIVE);
    CHECK_EQUAL(counters()->repeats, 1);
}

static void reply_of_a_slow_service_is_not_repeated_before_its_time(void)
{
    RTS_UI8 content[32];
    BTAG_WRITER writer;
    REPLY answer;

    setup();
    CHECK(client_login(&client) && client_login_app(&client));
    fakes.control_ms = 5000;
    BTagWriterInit(&writer, content, sizeof(content));
    BTagOpen(&writer, TAG_APP_DESCRIPTOR, BTAG_ALIGN_0);
    BTagWrite32(&writer, TAG_APP_SESSION, client.app_session);
    BTagClose(&writer);
    CHECK(client_call(&client, SG_APPLICATION, SRV_APP_STOP, &writer, &answer));
    CHECK_EQUAL(fakes.stops, 1);
    fakes_cycle(999);
    CHECK(is_silent());
}

static void repetitions_become_rarer_and_end(void)
{
    RTS_UI32 blocks = 0;

    setup();
    client_send_message(&client, message, echo_message(4));
    for (int i = 0; i < 290; i++) {
        fakes_cycle(100);
        while (client_take(&client, NULL, package) != 0)
            blocks += package[0] == CHANNEL_PKG_DATA;
    }
    CHECK_EQUAL(blocks, 1 + 4);
}

static void partly_acknowledged_reply_is_repeated_from_there(void)
{
    setup();
    client_send_message(&client, message, echo_message(1200));
    CHECK(is_block(1) && is_block(2) && is_block(3) && is_silent());
    client_send_ack(&client, 1, CHANNEL_FLAG_MISSING);
    CHECK(is_block(2) && is_block(3) && is_silent());
    client_send_ack(&client, 2, 0);
    CHECK(is_silent());
    fakes_cycle(2000);
    CHECK(is_block(3));
}

static void asking_again_and_again_brings_one_repetition(void)
{
    setup();
    client_send_message(&client, message, echo_message(1200));
    CHECK(is_block(1) && is_block(2) && is_block(3) && is_silent());
    for (int i = 0; i < 5; i++)
        client_send_ack(&client, 1, CHANNEL_FLAG_MISSING);
    CHECK(is_block(2) && is_block(3) && is_silent());
    fakes.now_ms += 100;
    client_send_ack(&client, 1, CHANNEL_FLAG_MISSING);
    CHECK(is_block(2) && is_block(3) && is_silent());
}

static void acknowledgement_overtakes_a_waiting_repetition(void)
{
    RTS_UI8 drop[BLK_MAX_SIZE];

    setup();
    RTS_UI32 size = echo_message(1200);
    client_send_message(&client, message, size);
    CHECK(is_block(1) && is_block(2) && is_block(3) && is_silent());
    fill_driver(size);
    fakes_cycle(1000); /* time to repeat, but there is no room */
    client_send_ack(&client, 2, 0);
    while (client_take(&client, NULL, drop) != 0)
        CHECK_EQUAL(drop[0], CHANNEL_PKG_ACK);
    fakes_cycle(1);
    CHECK(is_block(3) && is_silent());
}

static void new_request_abandons_a_reply_that_still_waits(void)
{
    RTS_UI8 drop[BLK_MAX_SIZE];

    setup();
    RTS_UI32 size = echo_message(1200);
    client_send_message(&client, message, size);
    CHECK(is_block(1) && is_block(2) && is_block(3) && is_silent());
    fill_driver(size);
    client_send_message(&client, message, size);
    client_send_message(&client, message, size);
    while (client_take(&client, NULL, drop) != 0)
        CHECK_EQUAL(drop[0], CHANNEL_PKG_ACK);
    fakes_cycle(1);
    CHECK(is_block(7) && is_block(8) && is_block(9) && is_silent());
}

static void repetitions_stay_few_while_the_client_lives(void)
{
    RTS_UI32 blocks = 0;

    setup();
    client_send_message(&client, message, echo_message(4));
    for (int i = 0; i < 900; i++) {
        fakes_cycle(100);
        client_send_ack(&client, 0, 0);
        while (client_take(&client, NULL, package) != 0)
            blocks += package[0] == CHANNEL_PKG_DATA;
    }
    CHECK_EQUAL(blocks, 1 + 4);
}

static void nonsense_acknowledgements_change_nothing(void)
{
    setup();
    client_send_message(&client, message, echo_message(1200));
    CHECK(is_block(1) && is_block(2) && is_block(3) && is_silent());
    client_send_ack(&client, 4, CHANNEL_FLAG_MISSING);
    client_send_ack(&client, 0xFFFFFFFF, CHANNEL_FLAG_MISSING);
    CHECK(is_silent());
    client_send_ack(&client, 3, CHANNEL_FLAG_MISSING);
    client_send_ack(&client, 0, CHANNEL_FLAG_MISSING);
    CHECK(is_silent());
    fakes_cycle(1);
    CHECK(is_silent());
    client.received = 3;
    CHECK(works(&client));
}

static void repeated_request_brings_the_lost_reply_again(void)
{
    setup();
    RTS_UI32 size = echo_message(4);
    client_send_message(&client, message, size);
    CHECK(is_block(1));
    fakes.now_ms += 200;
    client_send_block(&client, 1, FIRST, message, size, 0, size);
    CHECK(is_ack(1, 0));
    CHECK(is_block(1));
    CHECK(is_silent());
    /* A burst of duplicates does not bring a burst of replies. */
    for (int i = 0; i < 5; i++)
        client_send_block(&client, 1, FIRST, message, size, 0, size);
    while (client_take(&client, NULL, package) != 0)
        CHECK_EQUAL(package[0], CHANNEL_PKG_ACK);
}

static void new_request_acknowledges_the_reply_before(void)
{
    setup();
    CHECK(works(&client));
    client.received = 0; /* as a client that never acknowledges */
    client_send_message(&client, message, echo_message(4));
    CHECK(is_block(2));
    client_send_ack(&client, 2, 0);
    fakes_cycle(2000);
    CHECK(take(CHANNEL_PKG_KEEPALIVE) && is_silent());
}

static void acknowledgement_in_a_block_is_one(void)
{
    setup();
    CHECK(works(&client));
    client_send_block(&client, ++client.sent, FIRST, message, 600, 0, 300);
    fakes_cycle(1000);
    CHECK(take(CHANNEL_PKG_KEEPALIVE) && is_silent());
}

static void acknowledgement_travels_with_the_reply(void)
{
    setup();
    client_send_message(&client, message, echo_message(1200));
    CHECK_EQUAL(client.sent, 3);
    CHECK(is_block(1));
    CHECK_EQUAL(BytesGet32(package + 8), 3);
}

static void full_driver_delays_blocks_and_loses_none(void)
{
    setup();
    RTS_UI32 size = echo_message(1200);
    RTS_UI8 drop[BLK_MAX_SIZE];
    client_send_block(&client, 1, FIRST, message, size, 0, 480);
    fill_driver(size);
    client_send_block(&client, 2, NEXT, message, size, 480, 480);
    client_send_block(&client, 3, NEXT, message, size, 960, size - 960);
    for (int i = 0; i < SIM_LINK_PACKETS; i++)
        CHECK_EQUAL(SimLinkReceive(drop, sizeof(drop)), 12 + sizeof(CHANNEL_ACK));
    fakes_cycle(1);
    CHECK(client_take_message(&client, reply) > 1200);
}

int main(void)
{
    RUN(duplicate_blocks_are_acknowledged_again_and_not_taken_twice);
    RUN(gap_is_reported_at_once_and_only_once);
    RUN(each_gap_is_reported);
    RUN(gap_is_reported_again_when_the_repetition_is_lost_too);
    RUN(reply_is_repeated_until_acknowledged);
    RUN(reply_of_a_slow_service_is_not_repeated_before_its_time);
    RUN(repetitions_become_rarer_and_end);
    RUN(partly_acknowledged_reply_is_repeated_from_there);
    RUN(asking_again_and_again_brings_one_repetition);
    RUN(acknowledgement_overtakes_a_waiting_repetition);
    RUN(new_request_abandons_a_reply_that_still_waits);
    RUN(repetitions_stay_few_while_the_client_lives);
    RUN(nonsense_acknowledgements_change_nothing);
    RUN(repeated_request_brings_the_lost_reply_again);
    RUN(new_request_acknowledges_the_reply_before);
    RUN(acknowledgement_in_a_block_is_one);
    RUN(acknowledgement_travels_with_the_reply);
    RUN(full_driver_delays_blocks_and_loses_none);
    return test_result();
}
