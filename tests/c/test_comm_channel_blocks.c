/*
 * test_comm_channel_blocks.c - CmpChannelServerEmbedded: messages in blocks, and what is wrong with some.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "channel_fixture.h"

static void captured_message_gets_the_blocks_of_the_specification(void)
{
    static const RTS_UI8 request[] = {0x55, 0xCD, 0x10, 0x00, 0x01, 0x00, 0x07, 0x00, 0x0B, 0x56,
                                      0xEF, 0x8E, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00};

    CHECK_EQUAL(CRC32Update(0, request, sizeof(request)), 0x7DB2BDE7);
    setup();
    client_send_message(&client, request, sizeof(request));
    CHECK_EQUAL(client_take_message(&client, reply), 28);
    CHECK(memcmp(reply, "\x55\xCD\x10\x00\x81\x00\x07\x00\x0B\x56\xEF\x8E\x08\x00\x00\x00\x00\x00\x00\x00", 20) == 0);
    CHECK(memcmp(reply + 20, "\x54\x84\x80\x00\x01\x00\x00\x00", 8) == 0); /* the operation mode */
}

static void messages_of_every_size_up_to_the_buffer_pass(void)
{
    setup();
    for (RTS_UI32 data = 1; data + 40 <= NETSERVER_MESSAGE_SIZE - 24; data += data < 1100 ? 1 : 13) {
        RTS_UI32 size = echo_message(data);
        client_send_message(&client, message, size);
        RTS_UI32 got = client_take_message(&client, reply);
        CHECK(got > data);
        CHECK(got >= data && memcmp(reply + got - data, message + size - data, data) == 0);
    }
}

static void largest_message_fills_the_buffer_exactly(void)
{
    RTS_UI32 data = NETSERVER_MESSAGE_SIZE - 20 - 8 - 4;

    setup();
    CHECK_EQUAL(echo_message(data), NETSERVER_MESSAGE_SIZE);
    client_send_message(&client, message, NETSERVER_MESSAGE_SIZE);
    CHECK(client_take_message(&client, reply) > 0);
}

static void message_larger_than_granted_closes_the_channel(void)
{
    setup();
    client_send_block(&client, 1, FIRST, message, NETSERVER_MESSAGE_SIZE + 1, 0, 400);
    CHECK(is_close(ERR_CHS_MESSAGESIZE));
    CHECK(!works(&client));
    fakes_start();
    client_send_open(&client, 1, 500);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    client_send_block(&client, 1, FIRST, message, 501, 0, 400);
    CHECK(is_close(ERR_CHS_MESSAGESIZE));
}

static void reply_larger_than_granted_is_an_error_reply(void)
{
    REPLY answer;

    fakes_start();
    client_init(&client, 0x0102);
    client_send_open(&client, 1, CHANNEL_MIN_MESSAGE);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &answer));
    CHECK_EQUAL(reply_error(&answer), ERR_BUFFERSIZE);
}

static void wrong_message_crc_closes_the_channel(void)
{
    setup();
    RTS_UI32 size = echo_message(4);
    RTS_UI8 block[BLK_MAX_SIZE] = {CHANNEL_PKG_DATA, FIRST};
    BytesPut16(block + 2, client.channel);
    BytesPut32(block + 4, 1);
    BytesPut32(block + 12, size);
    BytesPut32(block + 16, CRC32Update(0, message, size) ^ 1);
    memcpy(block + 20, message, size);
    client_send_package(&client, block, 20 + size);
    CHECK(is_close(ERR_CHS_CHECKSUM));
}

static void more_bytes_than_announced_close_the_channel(void)
{
    setup();
    client_send_block(&client, 1, FIRST, message, 30, 0, 20);
    client_send_block(&client, 2, NEXT, message, 30, 20, 11);
    CHECK(is_close(ERR_CHS_PROTOCOL));
}

static void next_block_without_a_first_closes_the_channel(void)
{
    setup();
    client_send_block(&client, 1, NEXT, message, 30, 0, 20);
    CHECK(is_close(ERR_CHS_PROTOCOL));
}

static void new_channel_knows_nothing_of_half_a_message_before(void)
{
    setup();
    client_send_block(&client, 1, FIRST, message, 600, 0, 300);
    client_send_open(&client, 8, 2048);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    client_send_block(&client, 1, NEXT, message, 600, 300, 300);
    CHECK(is_close(ERR_CHS_PROTOCOL));
}

static void empty_block_after_a_message_does_not_repeat_it(void)
{
    setup();
    CHECK(works(&client));
    client_send_block(&client, 2, NEXT, message, 0, 0, 0);
    CHECK(is_close(ERR_CHS_PROTOCOL));
}

static void message_of_length_zero_closes_the_channel(void)
{
    setup();
    client_send_block(&client, 1, FIRST, message, 0, 0, 0);
    CHECK(is_close(ERR_CHS_PROTOCOL));
}

static void cut_packages_are_dropped(void)
{
    setup();
    RTS_UI8 block[CHANNEL_FIRST_SIZE] = {CHANNEL_PKG_DATA, NEXT};
    BytesPut16(block + 2, client.channel);
    BytesPut32(block + 4, 1);
    for (RTS_UI32 size = 0; size < sizeof(CHANNEL_DATA); size++)
        client_send_package(&client, block, size);
    block[0] = CHANNEL_PKG_ACK;
    for (RTS_UI32 size = 0; size < sizeof(CHANNEL_ACK); size++)
        client_send_package(&client, block, size);
    CHECK(is_silent());
    CHECK_EQUAL(counters()->malformed, sizeof(CHANNEL_DATA) + sizeof(CHANNEL_ACK));
    CHECK(works(&client));
}

static void first_block_too_short_for_its_header_closes_the_channel(void)
{
    setup();
    RTS_UI8 block[CHANNEL_FIRST_SIZE] = {CHANNEL_PKG_DATA, FIRST};
    BytesPut16(block + 2, client.channel);
    BytesPut32(block + 4, 1);
    client_send_package(&client, block, CHANNEL_FIRST_SIZE - 1);
    CHECK(is_close(ERR_CHS_PROTOCOL));
}

static void broken_layer_seven_header_closes_the_channel(void)
{
    setup();
    memset(message, 0, 30);
    client_send_message(&client, message, 30);
    CHECK(is_close(ERR_CHS_REQNOTHANDLED));
}

static void new_first_block_abandons_half_a_message(void)
{
    setup();
    client_send_block(&client, ++client.sent, FIRST, message, 900, 0, 400);
    CHECK(works(&client));
}

int main(void)
{
    RUN(captured_message_gets_the_blocks_of_the_specification);
    RUN(messages_of_every_size_up_to_the_buffer_pass);
    RUN(largest_message_fills_the_buffer_exactly);
    RUN(message_larger_than_granted_closes_the_channel);
    RUN(reply_larger_than_granted_is_an_error_reply);
    RUN(wrong_message_crc_closes_the_channel);
    RUN(more_bytes_than_announced_close_the_channel);
    RUN(next_block_without_a_first_closes_the_channel);
    RUN(new_channel_knows_nothing_of_half_a_message_before);
    RUN(empty_block_after_a_message_does_not_repeat_it);
    RUN(message_of_length_zero_closes_the_channel);
    RUN(cut_packages_are_dropped);
    RUN(first_block_too_short_for_its_header_closes_the_channel);
    RUN(broken_layer_seven_header_closes_the_channel);
    RUN(new_first_block_abandons_half_a_message);
    return test_result();
}
