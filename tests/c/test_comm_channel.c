/*
 * test_comm_channel.c - CmpChannelServerEmbedded: opening, blocks, loss, duplicates, time, who may what.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpChecksum.h"
#include "CmpSrv.h"
#include "SimLink.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "test.h"

enum { FIRST = CHANNEL_FLAG_TO_SERVER | CHANNEL_FLAG_FIRST, NEXT = CHANNEL_FLAG_TO_SERVER };

RTS_STATIC_ASSERT(NETSERVER_MESSAGE_SIZE >= TESTS_NEED_MESSAGE_SIZE, tests_have_room);

static CLIENT client;
static RTS_UI8 message[NETSERVER_MESSAGE_SIZE + 512];
static RTS_UI8 reply[NETSERVER_MESSAGE_SIZE];
static RTS_UI8 package[BLK_MAX_SIZE];

static const CHANNEL_COUNTERS *counters(void)
{
    return ChannelGetCounters();
}

/* Fills the driver's queue with acknowledgements of block 1 of the message. */
static void fill_driver(RTS_UI32 size)
{
    for (int i = 0; i < SIM_LINK_PACKETS; i++)
        client_send_block(&client, 1, FIRST, message, size, 0, 480);
}

static void setup(void)
{
    fakes_start();
    client_init(&client, 0x0102);
    CHECK(client_open(&client));
}

/* An echo request with `data` bytes that wants as many back; returns its size. */
static RTS_UI32 echo_message(RTS_UI32 data)
{
    RTS_UI8 content[NETSERVER_MESSAGE_SIZE];
    BTAG_WRITER writer;

    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite32(&writer, TAG_DEV_ECHO_REPLY_LENGTH, data);
    BTagOpen(&writer, TAG_DEV_ECHO_DATA, BTAG_ALIGN_0);
    for (RTS_UI32 i = 0; i < data; i++)
        BTagAppend(&writer, &(RTS_UI8){(RTS_UI8)(i * 7)}, 1);
    BTagClose(&writer);
    return client_message(&client, SG_DEVICE, SRV_DEV_ECHO, content, writer.size, message);
}

/* The next package is this one for our channel. */
static RTS_UI32 take(RTS_UI8 type)
{
    RTS_UI32 size = client_take(&client, NULL, package);

    return size != 0 && package[0] == type ? size : 0;
}

static bool is_silent(void)
{
    return client_take(&client, NULL, package) == 0;
}

static bool is_ack(RTS_UI32 number, RTS_UI8 flags)
{
    return take(CHANNEL_PKG_ACK) == CHANNEL_ACK_SIZE && package[1] == flags &&
           BytesGet16(package + 2) == client.channel && BytesGet32(package + 4) == number;
}

static bool is_close(RTS_UI16 error)
{
    return take(CHANNEL_PKG_CLOSE) == CHANNEL_CLOSE_SIZE && BytesGet16(package + 10) == error;
}

static bool is_block(RTS_UI32 number)
{
    return take(CHANNEL_PKG_DATA) != 0 && BytesGet32(package + 4) == number;
}

static bool works(CLIENT *who)
{
    REPLY answer;

    return client_request(who, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &answer);
}

/* ---- opening and closing ---- */

static void captured_open_request_is_answered(void)
{
    static const RTS_UI8 request[] = {0xC3, 0x00, 0x01, 0x01, 0x08, 0x92, 0x77, 0xAC, 0x81, 0xD4,
                                      0x21, 0x83, 0x00, 0x40, 0x1F, 0x00, 0x05, 0x00, 0x00, 0x00};

    fakes_start();
    client_init(&client, 0x0102);
    client_send_package(&client, request, sizeof(request));
    CHECK(take(CHANNEL_PKG_OPEN_RESP) == 24);
    CHECK(memcmp(package, "\x83\x00\x01\x01", 4) == 0);
    CHECK(memcmp(package + 8, "\x81\xD4\x21\x83\x00\x00", 6) == 0);
    CHECK(BytesGet32(package + 16) == NETSERVER_MESSAGE_SIZE);
    CHECK(memcmp(package + 20, "\x00\x05\x00\x00", 4) == 0);
    /* The specification's worked response has channel DBD8 and buffer 2048. */
    BytesPut16(package + 14, 0xDBD8);
    BytesPut32(package + 16, 2048);
    client_seal(package, 24);
    CHECK(memcmp(package + 4, "\x11\x30\x18\x24", 4) == 0);
}

static void old_short_open_request_is_answered(void)
{
    RTS_UI8 request[16] = {0xC3, 0x00, 0x00, 0x01, 0, 0, 0, 0, 1, 2, 3, 4, 0x00, 0x40, 0x1F, 0x00};

    fakes_start();
    client_init(&client, 0x0102);
    BytesPut32(request + 4, CRC32Update(0, request, sizeof(request)));
    client_send_package(&client, request, sizeof(request));
    CHECK(client_take_open(&client) == CHANNEL_OPEN_OK);
    CHECK(works(&client));
}

static void granted_buffer_is_the_smaller_of_wanted_and_own(void)
{
    fakes_start();
    client_init(&client, 0x0102);
    client_send_open(&client, 1, 0xFFFFFFFF);
    CHECK(client_take_open(&client) == CHANNEL_OPEN_OK);
    CHECK(client.limit == NETSERVER_MESSAGE_SIZE);
    client_send_open(&client, 2, 500);
    CHECK(client_take_open(&client) == CHANNEL_OPEN_OK);
    CHECK(client.limit == 500);
}

static void address_size_is_never_less_than_the_addresses(void)
{
    RTS_UI8 request[CHANNEL_OPEN_REQ_SIZE] = {CHANNEL_PKG_OPEN_REQ};

    fakes_start();
    client_init(&client, 0x0102);
    BytesPut32(request + 12, 2048);
    for (RTS_UI32 words = 0; words < 256; words++) {
        request[8] = (RTS_UI8)words;
        request[16] = (RTS_UI8)words;
        client_seal(request, sizeof(request));
        client_send_package(&client, request, sizeof(request));
        CHECK(take(CHANNEL_PKG_OPEN_RESP) != 0);
        CHECK(package[21] == (words < 2 ? 2 : words < 30 ? words : 30));
    }
}

static void buffer_too_small_for_any_reply_opens_nothing(void)
{
    fakes_start();
    client_init(&client, 0x0102);
    client_send_open(&client, 1, CHANNEL_MIN_MESSAGE - 1);
    CHECK(is_silent());
}

static void meta_packages_with_wrong_crc_version_or_length_are_dropped(void)
{
    RTS_UI8 request[CHANNEL_OPEN_REQ_SIZE] = {CHANNEL_PKG_OPEN_REQ};

    fakes_start();
    client_init(&client, 0x0102);
    BytesPut32(request + 12, 2048);
    client_seal(request, sizeof(request));
    request[9] ^= 1;
    client_send_package(&client, request, sizeof(request));
    for (RTS_UI32 size = 1; size < 16; size++) {
        client_seal(request, sizeof(request));
        if (size >= CHANNEL_META_SIZE)
            client_seal(request, size);
        client_send_package(&client, request, size);
    }
    BytesPut16(request + 2, 0x0201);
    BytesPut32(request + 4, 0);
    BytesPut32(request + 4, CRC32Update(0, request, sizeof(request)));
    client_send_package(&client, request, sizeof(request));
    CHECK(is_silent());
    CHECK(counters()->malformed == 17);
    CHECK(counters()->opened == 0);
}

static void channel_ids_are_valid_and_change(void)
{
    RTS_UI16 last = 0;

    fakes_start();
    client_init(&client, 0x0102);
    for (RTS_UI32 i = 0; i < 2000; i++) {
        fakes.random = i * 0x9E3779B9u;
        client_send_open(&client, i, 2048);
        CHECK(client_take_open(&client) == CHANNEL_OPEN_OK);
        CHECK(client.channel != 0 && client.channel <= CHANNEL_ID_MAX && client.channel != last);
        last = client.channel;
    }
}

static void repeated_open_request_gets_the_same_channel(void)
{
    CLIENT again;

    setup();
    client_init(&again, 0x0102);
    CHECK(client_open(&again));
    CHECK(again.channel == client.channel);
    CHECK(counters()->opened == 1);
}

static void same_request_id_after_traffic_is_a_new_client(void)
{
    RTS_UI16 old;

    setup();
    CHECK(works(&client));
    old = client.channel;
    CHECK(client_open(&client));
    CHECK(client.channel != old);
    CHECK(works(&client));
}

static void new_open_from_the_same_peer_replaces_its_channel(void)
{
    setup();
    CHECK(client_login(&client));
    client_send_open(&client, 8, 2048);
    CHECK(client_take_open(&client) == CHANNEL_OPEN_OK);
    CHECK(!SrvIsLoggedIn());
    CHECK(works(&client));
}

static void channel_without_login_is_given_to_another_peer(void)
{
    CLIENT other;

    setup();
    client_init(&other, 0x0203);
    client_send_open(&other, 1, 2048);
    CHECK(is_close(ERR_CHS_CLOSED)); /* the old owner is told */
    CHECK(client_take_open(&other) == CHANNEL_OPEN_OK);
    CHECK(works(&other));
}

static void channel_with_login_in_use_is_refused_to_another_peer(void)
{
    CLIENT other;

    setup();
    CHECK(client_login(&client));
    client_init(&other, 0x0203);
    client_send_open(&other, 1, 2048);
    CHECK(client_take_open(&other) == CHANNEL_OPEN_NO_CHANNEL);
    CHECK(other.channel == CHANNEL_ID_NONE);
    CHECK(counters()->refused == 1);
    CHECK(works(&client));
}

static void idle_channel_with_login_is_given_to_another_peer(void)
{
    CLIENT other;

    setup();
    CHECK(client_login(&client));
    fakes.now_ms += CHANNEL_IDLE_MS;
    client_init(&other, 0x0203);
    client_send_open(&other, 1, 2048);
    CHECK(is_close(ERR_CHS_CLOSED));
    CHECK(client_take_open(&other) == CHANNEL_OPEN_OK);
    CHECK(!SrvIsLoggedIn());
}

static void close_request_of_the_owner_ends_channel_and_session(void)
{
    setup();
    CHECK(client_login(&client));
    client_send_close(&client);
    CHECK(is_silent());
    CHECK(!SrvIsLoggedIn());
    CHECK(!works(&client));
}

static void captured_close_request_has_the_right_form(void)
{
    RTS_UI8 request[12] = {0xC4, 0x00, 0x00, 0x00, 0, 0, 0, 0, 0xD8, 0xDB, 0, 0};

    client_seal(request, sizeof(request));
    CHECK(memcmp(request, "\xC4\x00\x01\x01\xDA\x11\xF2\xB2\xD8\xDB\x00\x00", 12) == 0);
    setup();
    client.channel = 0xDBD8;
    client_send_package(&client, request, sizeof(request));
    CHECK(counters()->foreign == 1);
}

static void close_request_from_somebody_else_is_ignored(void)
{
    CLIENT other;

    setup();
    other = client;
    other.address = 0x0203;
    client_send_close(&other);
    CHECK(works(&client));
}

static void rts_info_tells_the_number_of_channels(void)
{
    RTS_UI8 request[CHANNEL_META_SIZE] = {CHANNEL_PKG_RTSINFO_REQ};

    fakes_start();
    client_init(&client, 0x0102);
    client_seal(request, sizeof(request));
    client_send_package(&client, request, sizeof(request));
    CHECK(take(CHANNEL_PKG_RTSINFO_RESP) == 10);
    CHECK(BytesGet16(package + 8) == 1);
}

/* ---- owner ---- */

static void blocks_from_another_peer_are_refused(void)
{
    CLIENT other;

    setup();
    other = client;
    other.address = 0x0203;
    RTS_UI32 size = echo_message(4);
    client_send_block(&other, 1, FIRST, message, size, 0, size);
    CHECK(counters()->foreign == 1);
    CHECK(client_take(&other, NULL, package) == CHANNEL_CLOSE_SIZE);
    CHECK(BytesGet16(package + 10) == ERR_CHS_CHINVALID);
    CHECK(works(&client));
}

static void complaints_about_unknown_channels_are_limited(void)
{
    setup();
    CLIENT lost = client;
    lost.channel ^= 1;
    for (int i = 0; i < 50; i++)
        client_send_ack(&lost, 0, 0);
    CHECK(is_close(ERR_CHS_CHINVALID));
    CHECK(is_silent());
    fakes.now_ms += CHANNEL_COMPLAINT_MS;
    client_send_ack(&lost, 0, 0);
    CHECK(is_close(ERR_CHS_CHINVALID));
    CHECK(counters()->foreign == 51);
    CHECK(works(&client));
}

static void packages_not_meant_for_a_server_are_dropped(void)
{
    setup();
    RTS_UI32 size = echo_message(4);
    client_send_block(&client, 1, CHANNEL_FLAG_FIRST, message, size, 0, size);
    CHECK(is_silent());
    CHECK(works(&client));
}

/* ---- blocks ---- */

static void captured_message_gets_the_blocks_of_the_specification(void)
{
    static const RTS_UI8 request[] = {0x55, 0xCD, 0x10, 0x00, 0x01, 0x00, 0x07, 0x00, 0x0B, 0x56,
                                      0xEF, 0x8E, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00, 0x00};

    CHECK(CRC32Update(0, request, sizeof(request)) == 0x7DB2BDE7);
    setup();
    client_send_message(&client, request, sizeof(request));
    CHECK(client_take_message(&client, reply) == 28);
    CHECK(memcmp(reply, "\x55\xCD\x10\x00\x81\x00\x07\x00\x0B\x56\xEF\x8E\x08\x00\x00\x00\x00\x00\x00\x00", 20) == 0);
    CHECK(memcmp(reply + 20, "\xFF\xFE\x03\x82\x80\x00\x02\x03", 8) == 0);
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
    CHECK(echo_message(data) == NETSERVER_MESSAGE_SIZE);
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
    CHECK(client_take_open(&client) == CHANNEL_OPEN_OK);
    client_send_block(&client, 1, FIRST, message, 501, 0, 400);
    CHECK(is_close(ERR_CHS_MESSAGESIZE));
}

static void reply_larger_than_granted_is_an_error_reply(void)
{
    REPLY answer;

    fakes_start();
    client_init(&client, 0x0102);
    client_send_open(&client, 1, CHANNEL_MIN_MESSAGE);
    CHECK(client_take_open(&client) == CHANNEL_OPEN_OK);
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &answer));
    CHECK(reply_error(&answer) == ERR_BUFFERSIZE);
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
    CHECK(client_take_open(&client) == CHANNEL_OPEN_OK);
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
    for (RTS_UI32 size = 0; size < CHANNEL_DATA_SIZE; size++)
        client_send_package(&client, block, size);
    block[0] = CHANNEL_PKG_ACK;
    for (RTS_UI32 size = 0; size < CHANNEL_ACK_SIZE; size++)
        client_send_package(&client, block, size);
    CHECK(is_silent());
    CHECK(counters()->malformed == CHANNEL_DATA_SIZE + CHANNEL_ACK_SIZE);
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

/* ---- loss and repetition ---- */

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
    CHECK(counters()->duplicates == 1);
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
    CHECK(counters()->gaps == 2);
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
        CHECK(package[0] == CHANNEL_PKG_KEEPALIVE);
    CHECK(counters()->repeats == 1);
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
    CHECK(fakes.stops == 1);
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
    CHECK(blocks == 1 + 4);
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
        CHECK(drop[0] == CHANNEL_PKG_ACK);
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
        CHECK(drop[0] == CHANNEL_PKG_ACK);
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
    CHECK(blocks == 1 + 4);
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
        CHECK(package[0] == CHANNEL_PKG_ACK);
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
    CHECK(client.sent == 3);
    CHECK(is_block(1));
    CHECK(BytesGet32(package + 8) == 3);
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
        CHECK(SimLinkReceive(drop, sizeof(drop)) == 12 + CHANNEL_ACK_SIZE);
    fakes_cycle(1);
    CHECK(client_take_message(&client, reply) > 1200);
}

/* ---- time ---- */

static void keepalives_are_sent_when_there_is_nothing_else(void)
{
    setup();
    fakes_cycle(999);
    CHECK(is_silent());
    fakes_cycle(1);
    CHECK(take(CHANNEL_PKG_KEEPALIVE) == CHANNEL_KEEPALIVE_SIZE);
    CHECK(BytesGet16(package + 2) == client.channel && package[1] == 0);
    fakes_cycle(999);
    CHECK(is_silent());
}

static void silent_client_loses_the_channel_after_thirty_seconds(void)
{
    setup();
    CHECK(client_login(&client));
    for (int i = 0; i < 299; i++) {
        fakes_cycle(100);
        while (client_take(&client, NULL, package) != 0)
            CHECK(package[0] != CHANNEL_PKG_CLOSE);
    }
    fakes_cycle(100);
    CHECK(is_close(ERR_CHS_TIMEOUT));
    CHECK(!SrvIsLoggedIn());
}

static void keepalives_of_the_client_keep_the_channel(void)
{
    setup();
    RTS_UI8 keepalive[] = {CHANNEL_PKG_KEEPALIVE, CHANNEL_FLAG_TO_SERVER, 0, 0};
    BytesPut16(keepalive + 2, client.channel);
    for (int i = 0; i < 50; i++) {
        fakes_cycle(1000);
        client_send_package(&client, keepalive, sizeof(keepalive));
        while (client_take(&client, NULL, package) != 0)
            CHECK(package[0] == CHANNEL_PKG_KEEPALIVE);
    }
    CHECK(works(&client));
}

static void shutdown_closes_the_channel(void)
{
    setup();
    fakes_hook(CH_EXIT_COMM);
    CHECK(is_close(ERR_CHS_SHUTDOWN));
}

static void restart_of_the_runtime_forgets_the_channel(void)
{
    setup();
    CHECK(client_login(&client));
    fakes_start();
    CHECK(!SrvIsLoggedIn());
    CHECK(!works(&client));
    CHECK(client_open(&client));
    CHECK(works(&client));
}

/* Random loss in both directions with a client that repeats: the same message always comes through. */
static void messages_survive_random_loss(void)
{
    RTS_UI32 seed = 1;

    setup();
    for (int round = 0; round < 30; round++) {
        RTS_UI32 size = echo_message(900 + 20 * (RTS_UI32)round);
        RTS_UI32 first = client.sent + 1;
        RTS_UI32 expected = client.received + 1;
        RTS_UI32 acked = client.sent;
        RTS_UI32 blocks = (size + 399) / 400;
        RTS_UI32 fill = 0;
        RTS_UI32 length = 1;
        for (int attempt = 0; attempt < 200 && fill < length; attempt++) {
            for (RTS_UI32 i = acked + 1 - first; i < blocks; i++) {
                seed = seed * 1664525u + 1013904223u;
                if (seed >> 30 != 0)
                    client_send_block(&client, first + i, i == 0 ? FIRST : NEXT, message, size, 400 * i,
                                      i + 1 < blocks ? 400 : size - 400 * i);
            }
            fakes_cycle(250);
            RTS_UI32 got;
            while ((got = client_take(&client, NULL, package)) != 0) {
                seed = seed * 1664525u + 1013904223u;
                if (seed >> 30 == 0)
                    continue;
                if (package[0] == CHANNEL_PKG_ACK)
                    acked = BytesGet32(package + 4);
                if (package[0] != CHANNEL_PKG_DATA)
                    continue;
                acked = BytesGet32(package + 8);
                if (BytesGet32(package + 4) == expected) {
                    RTS_UI32 head = package[1] & CHANNEL_FLAG_FIRST ? 20 : 12;
                    if (head == 20)
                        length = BytesGet32(package + 12);
                    memcpy(reply + fill, package + head, got - head);
                    fill += got - head;
                    client.received = expected++;
                }
            }
            if (fill < length)
                client_send_ack(&client, client.received, fill != 0 ? CHANNEL_FLAG_MISSING : 0);
        }
        client.sent = first + blocks - 1;
        CHECK(fill == length);
        RTS_UI32 data = 900 + 20 * (RTS_UI32)round;
        CHECK(memcmp(reply + length - data, message + size - data, data) == 0);
        while (client_take(&client, NULL, package) != 0)
            ;
    }
}

int main(void)
{
    RUN(captured_open_request_is_answered);
    RUN(old_short_open_request_is_answered);
    RUN(granted_buffer_is_the_smaller_of_wanted_and_own);
    RUN(address_size_is_never_less_than_the_addresses);
    RUN(buffer_too_small_for_any_reply_opens_nothing);
    RUN(meta_packages_with_wrong_crc_version_or_length_are_dropped);
    RUN(channel_ids_are_valid_and_change);
    RUN(repeated_open_request_gets_the_same_channel);
    RUN(same_request_id_after_traffic_is_a_new_client);
    RUN(new_open_from_the_same_peer_replaces_its_channel);
    RUN(channel_without_login_is_given_to_another_peer);
    RUN(channel_with_login_in_use_is_refused_to_another_peer);
    RUN(idle_channel_with_login_is_given_to_another_peer);
    RUN(close_request_of_the_owner_ends_channel_and_session);
    RUN(captured_close_request_has_the_right_form);
    RUN(close_request_from_somebody_else_is_ignored);
    RUN(rts_info_tells_the_number_of_channels);
    RUN(blocks_from_another_peer_are_refused);
    RUN(complaints_about_unknown_channels_are_limited);
    RUN(packages_not_meant_for_a_server_are_dropped);
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
    RUN(keepalives_are_sent_when_there_is_nothing_else);
    RUN(silent_client_loses_the_channel_after_thirty_seconds);
    RUN(keepalives_of_the_client_keep_the_channel);
    RUN(shutdown_closes_the_channel);
    RUN(restart_of_the_runtime_forgets_the_channel);
    RUN(messages_survive_random_loss);
    return test_result();
}
