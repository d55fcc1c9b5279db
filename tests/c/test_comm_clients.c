/*
 * test_comm_clients.c - several connections at a time: each has its channel, its session, its buffers.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpSrv.h"
#include "SimLink.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "test.h"

enum { COUNT = COMM_MAX_CLIENTS, ECHO = 1200, TOTAL = 900, CRC = 0x11223344 };
RTS_STATIC_ASSERT(COUNT == 4, built_for_four_clients);

static CLIENT client[COUNT + 1];
static RTS_UI8 message[COUNT][NETSERVER_MESSAGE_SIZE];
static RTS_UI8 answer[NETSERVER_MESSAGE_SIZE];
static REPLY reply;

/* As many clients as there are places, none of them connected, and one more. */
static void setup(void)
{
    fakes_start();
    for (RTS_UI16 i = 0; i <= COUNT; i++)
        client_init(&client[i], (RTS_UI16)(0x0102 + i));
}

static bool connects(CLIENT *who)
{
    return client_open(who) && client_login(who) && client_login_app(who);
}

static void connect_all(void)
{
    setup();
    for (int i = 0; i < COUNT; i++)
        CHECK(connects(&client[i]));
}

static bool works(CLIENT *who)
{
    return client_request(who, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply);
}

static void all_places_are_used_and_the_next_client_is_refused(void)
{
    connect_all();
    CHECK(!client_open(&client[COUNT]));
    CHECK_EQUAL(ChannelGetCounters()->refused, 1);
    for (int i = 0; i < COUNT; i++) {
        CHECK(works(&client[i]));
        for (int j = 0; j < i; j++)
            CHECK(client[i].channel != client[j].channel && client[i].session != client[j].session);
    }
}

static void requests_that_arrive_block_by_block_do_not_mix(void)
{
    RTS_UI8 content[ECHO + 32];
    BTAG_WRITER writer;
    RTS_UI32 size = 0;

    connect_all();
    for (int i = 0; i < COUNT; i++) {
        BTagWriterInit(&writer, content, sizeof(content));
        BTagWrite32(&writer, TAG_DEV_ECHO_REPLY_LENGTH, ECHO);
        BTagOpen(&writer, TAG_DEV_ECHO_DATA, BTAG_ALIGN_0);
        memset(BTagReserve(&writer, ECHO), 'a' + i, ECHO);
        BTagClose(&writer);
        size = client_message(&client[i], SG_DEVICE, SRV_DEV_ECHO, content, writer.size, message[i]);
    }
    for (RTS_UI32 offset = 0; offset < size; offset += 400) {
        RTS_UI8 flags = CHANNEL_FLAG_TO_SERVER | (offset == 0 ? CHANNEL_FLAG_FIRST : 0);
        RTS_UI32 part = size - offset < 400 ? size - offset : 400;
        for (int i = 0; i < COUNT; i++) {
            client_send_block(&client[i], ++client[i].sent, flags, message[i], size, offset, part);
            if (offset + part == size) {
                CHECK(client_take_message(&client[i], answer) > ECHO);
                CHECK(answer[200] == 'a' + i && answer[ECHO] == 'a' + i);
            }
        }
    }
}

static void free_place_is_used_before_a_place_without_login(void)
{
    setup();
    CHECK(client_open(&client[0])); /* no login */
    for (int i = 1; i < COUNT; i++)
        CHECK(connects(&client[i]));
    CHECK(works(&client[0]));
}

static void of_the_places_without_login_the_one_silent_for_longest_is_given_away(void)
{
    setup();
    for (int i = 0; i < COUNT; i++) {
        CHECK(client_open(&client[i]));
        fakes.now_ms++;
    }
    CHECK(works(&client[0])); /* so number 1 is the most silent one */
    client_send_open(&client[COUNT], 1, 2048);
    CHECK(client_take(&client[1], NULL, answer) == sizeof(CHANNEL_CLOSE) && answer[0] == CHANNEL_PKG_CLOSE);
    CHECK_EQUAL(client_take_open(&client[COUNT]), CHANNEL_OPEN_OK);
    CHECK(works(&client[0]) && works(&client[2]) && works(&client[3]) && works(&client[COUNT]));
}

static void session_of_one_client_is_not_valid_for_another(void)
{
    RTS_UI32 own;

    connect_all();
    own = client[1].session;
    client[1].session = client[0].session;
    CHECK(client_request(&client[1], SG_APPLICATION, SRV_APP_STOP, NULL, 0, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_INVALID_SESSION_ID);
    CHECK_EQUAL(fakes.stops, 0);
    client[1].session = own;
    CHECK(!SrvIsAppSession(ChannelGetClient(1), client[0].app_session));
    CHECK(SrvIsAppSession(ChannelGetClient(0), client[0].app_session));
}

static void close_of_one_leaves_the_others(void)
{
    connect_all();
    client_send_close(&client[2]);
    CHECK(works(&client[0]) && works(&client[1]) && works(&client[3]));
    CHECK(!SrvIsLoggedIn(ChannelGetClient(2)) && SrvIsLoggedIn(ChannelGetClient(3)));
    CHECK(connects(&client[COUNT]));
}

static void silent_client_ends_and_the_others_stay(void)
{
    connect_all();
    fakes.now_ms += CHANNEL_TIMEOUT_MS - 1;
    fakes_cycle(0);
    while (SimLinkReceive(answer, sizeof(answer)) != 0)
        continue; /* keepalives */
    for (int i = 1; i < COUNT; i++)
        CHECK(works(&client[i]));
    fakes_cycle(1);
    CHECK(!ChannelIsOpen(ChannelGetClient(0)));
    for (int i = 1; i < COUNT; i++)
        CHECK(ChannelIsOpen(ChannelGetClient((RTS_UI32)i)));
}

/* ---- download ---- */

/* Sends a part of an image; the result, with the reason in `reply`. */
static RTS_UI32 put(CLIENT *who, RTS_UI32 flags, RTS_UI32 offset, RTS_UI32 size)
{
    RTS_UI8 content[TOTAL];
    BTAG_WRITER writer;

    BTagWriterInit(&writer, content, sizeof(content));
    BTagOpen(&writer, TAG_CDL_POSITION, BTAG_ALIGN_0);
    BTagAppend32(&writer, flags);
    BTagAppend32(&writer, offset);
    BTagAppend32(&writer, TOTAL);
    BTagAppend32(&writer, CRC);
    BTagClose(&writer);
    BTagOpen(&writer, TAG_CDL_DATA, BTAG_ALIGN_0);
    BTagAppendZeros(&writer, size);
    BTagClose(&writer);
    CHECK(client_call(who, SG_APPLICATION, SRV_APP_DOWNLOAD_COMPACT, &writer, &reply));
    return reply_number(&reply, TAG_SERVICE_RESULT);
}

static void download_of_one_is_neither_replaced_nor_continued_by_another(void)
{
    BTAG reason;

    connect_all();
    CHECK_EQUAL(put(&client[0], 0, 0, 300), ERR_OK);
    CHECK_EQUAL(put(&client[1], 0, 0, 300), ERR_INVALID_STATE);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_CDL_REASON, 10, 200, &reason), ERR_OK);
    CHECK_EQUAL(put(&client[1], DLF_CONTINUEDOWNLOAD, 300, 300), ERR_INVALID_STATE);
    CHECK_EQUAL(put(&client[0], DLF_CONTINUEDOWNLOAD, 300, 300), ERR_OK);
    CHECK(fakes.download_begins == 1 && fakes.download_offset == 600);
}

static void download_whose_client_is_gone_can_be_continued_by_another(void)
{
    connect_all();
    CHECK_EQUAL(put(&client[0], 0, 0, 300), ERR_OK);
    client_send_close(&client[0]);
    CHECK_EQUAL(put(&client[1], DLF_CONTINUEDOWNLOAD, 300, 300), ERR_OK);
    CHECK(connects(&client[COUNT])); /* in the place of the first one */
    CHECK_EQUAL(put(&client[COUNT], DLF_CONTINUEDOWNLOAD, 600, 300), ERR_OK);
    CHECK_EQUAL(fakes.download_ends, 1);
}

int main(void)
{
    RUN(all_places_are_used_and_the_next_client_is_refused);
    RUN(requests_that_arrive_block_by_block_do_not_mix);
    RUN(free_place_is_used_before_a_place_without_login);
    RUN(of_the_places_without_login_the_one_silent_for_longest_is_given_away);
    RUN(session_of_one_client_is_not_valid_for_another);
    RUN(close_of_one_leaves_the_others);
    RUN(silent_client_ends_and_the_others_stay);
    RUN(download_of_one_is_neither_replaced_nor_continued_by_another);
    RUN(download_whose_client_is_gone_can_be_continued_by_another);
    return test_result();
}
