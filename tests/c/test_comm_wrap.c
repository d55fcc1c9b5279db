/*
 * test_comm_wrap.c - CmpChannelServerEmbedded after four billion blocks: their numbers begin again at 0.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * No test can send so many, so this one sets the numbers.
 */
#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "test.h"

enum { FIRST = CHANNEL_FLAG_TO_SERVER | CHANNEL_FLAG_FIRST, NEXT = CHANNEL_FLAG_TO_SERVER };

static CLIENT client;
static RTS_UI8 message[NETSERVER_MESSAGE_SIZE];
static RTS_UI8 package[BLK_MAX_SIZE];
static RTS_UI32 message_size;

/* A channel whose next blocks have the numbers 0xFFFFFFFF, 0, 1 in both directions, and an echo of three blocks. */
static void setup(void)
{
    enum { DATA = 1200 };
    static RTS_UI8 content[DATA + 32];
    BTAG_WRITER writer;

    fakes_start();
    client_init(&client, 0x0102);
    CHECK(client_open(&client));
    CHANNEL *channel = &ChannelGetClient(0)->channel;
    channel->rx.block = client.sent = 0xFFFFFFFE;
    channel->tx.base = client.received = 0xFFFFFFFE;
    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite32(&writer, TAG_DEV_ECHO_REPLY_LENGTH, DATA);
    BTagOpen(&writer, TAG_DEV_ECHO_DATA, BTAG_ALIGN_0);
    BTagAppendZeros(&writer, DATA);
    BTagClose(&writer);
    message_size = client_message(&client, SG_DEVICE, SRV_DEV_ECHO, content, writer.size, message);
}

static RTS_UI32 take(RTS_UI8 type)
{
    RTS_UI32 size = client_take(&client, NULL, package);

    return size != 0 && package[0] == type ? size : 0;
}

static bool is_block(RTS_UI32 number)
{
    return take(CHANNEL_PKG_DATA) != 0 && BytesGet32(package + 4) == number;
}

static bool is_ack(RTS_UI32 number, RTS_UI8 flags)
{
    return take(CHANNEL_PKG_ACK) != 0 && package[1] == flags && BytesGet32(package + 4) == number;
}

static bool is_silent(void)
{
    return client_take(&client, NULL, package) == 0;
}

static void message_and_reply_pass(void)
{
    static RTS_UI8 reply[NETSERVER_MESSAGE_SIZE];

    setup();
    client_send_message(&client, message, message_size);
    CHECK_EQUAL(client.sent, 1);
    CHECK(client_take_message(&client, reply) > 1200);
    CHECK_EQUAL(client.received, 1);
    client_send_message(&client, message, message_size);
    CHECK(client_take_message(&client, reply) > 1200);
}

static void duplicate_of_a_block_before_the_wrap_is_one(void)
{
    setup();
    client_send_block(&client, 0xFFFFFFFF, FIRST, message, message_size, 0, 400);
    client_send_block(&client, 0, NEXT, message, message_size, 400, 400);
    CHECK(is_silent());
    client_send_block(&client, 0xFFFFFFFF, FIRST, message, message_size, 0, 400);
    CHECK(is_ack(0, 0));
}

static void gap_across_the_wrap_is_reported(void)
{
    setup();
    client_send_block(&client, 0, NEXT, message, message_size, 400, 400);
    CHECK(is_ack(0xFFFFFFFE, CHANNEL_FLAG_MISSING));
    client_send_block(&client, 1, NEXT, message, message_size, 800, 400);
    CHECK(is_silent());
}

static void reply_is_repeated_from_the_block_after_the_acknowledged_one(void)
{
    setup();
    client_send_message(&client, message, message_size);
    CHECK(is_block(0xFFFFFFFF) && is_block(0) && is_block(1) && is_silent());
    client_send_ack(&client, 0xFFFFFFFF, CHANNEL_FLAG_MISSING);
    CHECK(is_block(0) && is_block(1) && is_silent());
    client_send_ack(&client, 0xFFFFFFFE, 0); /* late, from before */
    fakes_cycle(1000);
    CHECK(is_block(0) && is_block(1) && is_silent());
    client_send_ack(&client, 1, 0);
    fakes_cycle(2000);
    CHECK(take(CHANNEL_PKG_KEEPALIVE) != 0 && is_silent());
}

int main(void)
{
    RUN(message_and_reply_pass);
    RUN(duplicate_of_a_block_before_the_wrap_is_one);
    RUN(gap_across_the_wrap_is_reported);
    RUN(reply_is_repeated_from_the_block_after_the_acknowledged_one);
    return test_result();
}
