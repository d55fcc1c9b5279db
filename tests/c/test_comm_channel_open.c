/*
 * test_comm_channel_open.c - CmpChannelServerEmbedded: who gets a channel, who may use it, and how it ends.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "channel_fixture.h"

/* ---- opening and closing ---- */

static void captured_open_request_is_answered(void)
{
    static const RTS_UI8 request[] = {0xC3, 0x00, 0x01, 0x01, 0x08, 0x92, 0x77, 0xAC, 0x81, 0xD4,
                                      0x21, 0x83, 0x00, 0x40, 0x1F, 0x00, 0x05, 0x00, 0x00, 0x00};

    fakes_start();
    client_init(&client, 0x0102);
    client_send_package(&client, request, sizeof(request));
    CHECK_EQUAL(take(CHANNEL_PKG_OPEN_RESP), 24);
    CHECK(memcmp(package, "\x83\x00\x01\x01", 4) == 0);
    CHECK(memcmp(package + 8, "\x81\xD4\x21\x83\x00\x00", 6) == 0);
    CHECK_EQUAL(BytesGet32(package + 16), NETSERVER_MESSAGE_SIZE);
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
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    CHECK_EQUAL(client.open_size, SRV_OTHER_CLIENTS ? CLIENT_OLD_RESPONSE : CLIENT_OLD_RESPONSE + 4);
    CHECK(works(&client));
}

static void granted_buffer_is_the_smaller_of_wanted_and_own(void)
{
    fakes_start();
    client_init(&client, 0x0102);
    client_send_open(&client, 1, 0xFFFFFFFF);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    CHECK_EQUAL(client.limit, NETSERVER_MESSAGE_SIZE);
    client_send_open(&client, 2, 500);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    CHECK_EQUAL(client.limit, 500);
}

static void address_size_is_never_less_than_the_addresses(void)
{
    RTS_UI8 request[sizeof(CHANNEL_OPEN_REQUEST)] = {CHANNEL_PKG_OPEN_REQ};

    fakes_start();
    client_init(&client, 0x0102);
    BytesPut32(request + 12, 2048);
    for (RTS_UI32 words = 0; words < 256; words++) {
        request[8] = (RTS_UI8)words;
        request[16] = (RTS_UI8)words;
        client_seal(request, sizeof(request));
        client_send_package(&client, request, sizeof(request));
        CHECK(take(CHANNEL_PKG_OPEN_RESP) != 0);
        CHECK_EQUAL(package[21], (words < 2 ? 2 : words < 30 ? words : 30));
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
    RTS_UI8 request[sizeof(CHANNEL_OPEN_REQUEST)] = {CHANNEL_PKG_OPEN_REQ};

    fakes_start();
    client_init(&client, 0x0102);
    BytesPut32(request + 12, 2048);
    client_seal(request, sizeof(request));
    request[9] ^= 1;
    client_send_package(&client, request, sizeof(request));
    for (RTS_UI32 size = 1; size < 16; size++) {
        client_seal(request, sizeof(request));
        if (size >= sizeof(CHANNEL_META_HEADER))
            client_seal(request, size);
        client_send_package(&client, request, size);
    }
    BytesPut16(request + 2, 0x0201);
    BytesPut32(request + 4, 0);
    BytesPut32(request + 4, CRC32Update(0, request, sizeof(request)));
    client_send_package(&client, request, sizeof(request));
    CHECK(is_silent());
    CHECK_EQUAL(counters()->malformed, 17);
    CHECK_EQUAL(counters()->opened, 0);
}

static void channel_ids_are_valid_and_change(void)
{
    RTS_UI16 last = 0;

    fakes_start();
    client_init(&client, 0x0102);
    for (RTS_UI32 i = 0; i < 2000; i++) {
        fakes.random = i * 0x9E3779B9u;
        client_send_open(&client, i, 2048);
        CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
        CHECK(client.channel != 0 && client.channel <= CHANNEL_ID_MAX && client.channel != last);
        last = client.channel;
    }
}

/* From the same id: what comes next is of the entropy alone. */
static void a_channel_id_does_not_follow_from_the_one_before(void)
{
    RTS_UI16 ids[64];

    for (RTS_UI32 i = 0; i < RTS_COUNT(ids); i++) {
        fakes_start();
        fakes.random = i * 0x9E3779B9u;
        client_init(&client, 0x0102);
        CHECK(client_open(&client));
        ids[i] = client.channel;
        for (RTS_UI32 k = 0; k < i; k++)
            CHECK(ids[k] != ids[i]);
    }
}

static void id_zero_is_that_of_no_channel_not_even_of_the_last_one(void)
{
    setup();
    client_send_close(&client);
    client.channel = 0;
    client_send_block(&client, 1, FIRST, message, echo_message(4), 0, 16);
    CHECK(is_close(ERR_CHS_CHINVALID));
    CHECK_EQUAL(counters()->foreign, 1);
    CHECK(is_silent());
}

static void repeated_open_request_gets_the_same_channel(void)
{
    CLIENT again;

    setup();
    client_init(&again, 0x0102);
    CHECK(client_open(&again));
    CHECK_EQUAL(again.channel, client.channel);
    CHECK_EQUAL(counters()->opened, 1);
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
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    CHECK(!SrvIsLoggedIn(ChannelGetClient(0)));
    CHECK(works(&client));
}

static void channel_without_login_is_given_to_another_peer(void)
{
    CLIENT other;

    setup();
    client_init(&other, 0x0203);
    client_send_open(&other, 1, 2048);
    CHECK(is_close(ERR_CHS_CLOSED)); /* the old owner gets a close */
    CHECK_EQUAL(client_take_open(&other), CHANNEL_OPEN_OK);
    CHECK(works(&other));
}

static void channel_with_login_in_use_is_refused_to_another_peer(void)
{
    CLIENT other;

    setup();
    CHECK(client_login(&client));
    client_init(&other, 0x0203);
    client_send_open(&other, 1, 2048);
    CHECK_EQUAL(client_take_open(&other), CHANNEL_OPEN_NO_CHANNEL);
    CHECK_EQUAL(other.channel, CHANNEL_ID_NONE);
    CHECK_EQUAL(counters()->refused, 1);
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
    CHECK_EQUAL(client_take_open(&other), CHANNEL_OPEN_OK);
    CHECK(!SrvIsLoggedIn(ChannelGetClient(0)));
}

static void close_request_of_the_owner_ends_channel_and_session(void)
{
    setup();
    CHECK(client_login(&client));
    client_send_close(&client);
    CHECK(is_silent());
    CHECK(!SrvIsLoggedIn(ChannelGetClient(0)));
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
    CHECK_EQUAL(counters()->foreign, 1);
}

static void close_request_from_another_peer_is_ignored(void)
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
    RTS_UI8 request[sizeof(CHANNEL_META_HEADER)] = {CHANNEL_PKG_RTSINFO_REQ};

    fakes_start();
    client_init(&client, 0x0102);
    client_seal(request, sizeof(request));
    client_send_package(&client, request, sizeof(request));
    CHECK_EQUAL(take(CHANNEL_PKG_RTSINFO_RESP), 10);
    CHECK_EQUAL(BytesGet16(package + 8), 1);
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
    CHECK_EQUAL(counters()->foreign, 1);
    CHECK(client_take(&other, NULL, package) == sizeof(CHANNEL_CLOSE));
    CHECK_EQUAL(BytesGet16(package + 10), ERR_CHS_CHINVALID);
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
    CHECK_EQUAL(counters()->foreign, 51);
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

int main(void)
{
    RUN(captured_open_request_is_answered);
    RUN(old_short_open_request_is_answered);
    RUN(granted_buffer_is_the_smaller_of_wanted_and_own);
    RUN(address_size_is_never_less_than_the_addresses);
    RUN(buffer_too_small_for_any_reply_opens_nothing);
    RUN(meta_packages_with_wrong_crc_version_or_length_are_dropped);
    RUN(channel_ids_are_valid_and_change);
    RUN(a_channel_id_does_not_follow_from_the_one_before);
    RUN(id_zero_is_that_of_no_channel_not_even_of_the_last_one);
    RUN(repeated_open_request_gets_the_same_channel);
    RUN(same_request_id_after_traffic_is_a_new_client);
    RUN(new_open_from_the_same_peer_replaces_its_channel);
    RUN(channel_without_login_is_given_to_another_peer);
    RUN(channel_with_login_in_use_is_refused_to_another_peer);
    RUN(idle_channel_with_login_is_given_to_another_peer);
    RUN(close_request_of_the_owner_ends_channel_and_session);
    RUN(captured_close_request_has_the_right_form);
    RUN(close_request_from_another_peer_is_ignored);
    RUN(rts_info_tells_the_number_of_channels);
    RUN(blocks_from_another_peer_are_refused);
    RUN(complaints_about_unknown_channels_are_limited);
    RUN(packages_not_meant_for_a_server_are_dropped);
    return test_result();
}
