/*
 * test_comm_srv.c - CmpSrv, CmpDevice, CmpLogSrv: layer-7 headers, sessions, who may call what.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <stdlib.h>
#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpDevice.h"
#include "CmpSrv.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "test.h"

RTS_STATIC_ASSERT(NETSERVER_MESSAGE_SIZE >= TESTS_NEED_MESSAGE_SIZE, tests_have_room);

static CLIENT client;
static REPLY reply;

static void setup(void)
{
    fakes_start();
    client_init(&client, 0x0102);
    CHECK(client_open(&client));
}

/* Calls without a channel; returns the size of the reply. */
static RTS_UI32 handle(const RTS_UI8 *message, RTS_UI32 size)
{
    RTS_UI8 *copy = malloc(size + 1); /* of exactly this size, for the sanitizer */
    memcpy(copy, message, size);
    RTS_UI32 result = SrvHandleMessage(ChannelGetClient(0), copy, size, reply.message, sizeof(reply.message));
    free(copy);
    return result;
}

/* A request for the target's identity. */
static RTS_UI8 ident[20 + 64] = {0x55, 0xCD, 0x10, 0x00, 0x01, 0x00, 0x01, 0x00, 0x11};

static RTS_UI16 error_of(RTS_UI32 header)
{
    static const RTS_UI8 tag[] = {0xFF, 0xFE, 0x03, 0x82, 0x80, 0x00};

    return memcmp(reply.message + header, tag, sizeof(tag)) == 0 ? BytesGet16(reply.message + header + sizeof(tag)) : 0;
}

/* ---- headers ---- */

static void cut_headers_are_not_answered(void)
{
    fakes_start();
    for (RTS_UI32 size = 0; size < 20; size++)
        CHECK_EQUAL(handle(ident, size), 0);
    CHECK(handle(ident, 20) > 20);
}

static void other_protocols_are_not_answered(void)
{
    RTS_UI8 message[20];

    fakes_start();
    memcpy(message, ident, 20);
    BytesPut16(message, 0x7557);
    CHECK_EQUAL(handle(message, 20), 0);
}

static void header_length_is_checked(void)
{
    RTS_UI8 message[100] = {0};

    fakes_start();
    memcpy(message, ident, 20);
    for (RTS_UI32 length = 0; length < 0x10000; length += length < 100 ? 1 : 97) {
        BytesPut16(message + 2, length);
        CHECK_EQUAL((handle(message, sizeof(message)) != 0), (length >= 12 && length <= 64));
    }
}

static void short_header_is_answered_with_a_short_header(void)
{
    RTS_UI8 message[16];

    fakes_start();
    memcpy(message, ident, 16);
    message[2] = 12;
    CHECK(handle(message, 16) > 16);
    CHECK_EQUAL(BytesGet16(reply.message + 2), 12);
    CHECK_EQUAL(reply.message[16], TAG_DEV_RESULT);
}

static void content_longer_than_the_message_is_an_error(void)
{
    RTS_UI8 message[24] = {0};

    fakes_start();
    memcpy(message, ident, 20);
    BytesPut32(message + 12, 5);
    CHECK_EQUAL(handle(message, 24), 28);
    CHECK_EQUAL(error_of(20), ERR_L7_INCOMPLETE);
    BytesPut32(message + 12, 0xFFFFFFFF);
    CHECK_EQUAL(handle(message, 24), 28);
    CHECK_EQUAL(error_of(20), ERR_L7_INCOMPLETE);
}

static void unknown_groups_and_services_have_their_errors(void)
{
    setup();
    CHECK(client_request(&client, 0x77, 1, NULL, 0, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_UNKNOWNCMDGROUP);
    CHECK(client_request(&client, SG_DEVICE, 0x77, NULL, 0, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_UNKNOWNCMD);
    CHECK(client_request(&client, SG_DEVICE | L7_REPLY, 1, NULL, 0, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_UNKNOWNCMDGROUP);
}

static void reply_echoes_the_session_of_the_request(void)
{
    setup();
    client.session = 0x12345678;
    CHECK(client_request(&client, SG_APPLICATION, SRV_APP_READ_STATUS, NULL, 0, &reply));
    CHECK_EQUAL(reply.session, 0x12345678);
}

static void too_small_reply_buffer_is_not_overrun(void)
{
    fakes_start();
    for (RTS_UI32 capacity = 0; capacity < 300; capacity++) {
        RTS_UI8 *buffer = malloc(capacity + 1);
        RTS_UI32 size = SrvHandleMessage(ChannelGetClient(0), ident, 20, buffer, capacity);
        CHECK(size <= capacity);
        CHECK_EQUAL((size == 0), (capacity < 28));
        free(buffer);
    }
}

/* Every service, without session and with garbage: an answer, no crash, no effect. */
static void every_service_survives_missing_session_and_content(void)
{
    static const RTS_UI16 groups[] = {SG_DEVICE, SG_APPLICATION, SG_LOG, SG_MONITORING2};
    RTS_UI8 message[20 + 32];

    fakes_start();
    fakes.status.state = AS_NONE;
    memset(message, 0x81, sizeof(message));
    memcpy(message, ident, 20);
    for (RTS_UI32 g = 0; g < RTS_COUNT(groups); g++) {
        for (RTS_UI32 service = 0; service < 0x100; service++) {
            for (RTS_UI32 content = 0; content <= 32; content += 16) {
                BytesPut16(message + 4, groups[g]);
                BytesPut16(message + 6, service);
                BytesPut32(message + 12, content);
                CHECK(handle(message, 20 + content) >= 20);
            }
        }
    }
    CHECK_EQUAL(fakes.starts + fakes.stops + fakes.resets + fakes.download_begins, 0);
}

/* ---- sessions ---- */

/* Whether a service is for clients without a login: the identity of the device, the login. */
static bool is_for_all(const SRV_SERVICE *service)
{
    return service->right == RIGHT_NONE || service->right == RIGHT_STATE;
}

static void needs_a_login(RTS_UI16 group, RTS_UI16 service)
{
    static const RTS_UI32 sessions[] = {0, 1, L7_SESSION_INITIAL, 0x80000000, 0xFFFFFFFF};

    for (RTS_UI32 i = 0; i < RTS_COUNT(sessions); i++) {
        client.session = sessions[i];
        CHECK(client_request(&client, group, service, NULL, 0, &reply));
        CHECK_EQUAL(reply_error(&reply), ERR_INVALID_SESSION_ID);
    }
}

/* All that components have registered. */
static void services_with_a_right_need_a_login(void)
{
    RTS_UI32 checked = 0;

    setup();
    for (const SRV_GROUP *group = srv_groups; group < srv_groups + srv_group_room; group++) {
        for (RTS_SIZE i = 0; i < group->count; i++) {
            if (is_for_all(&group->services[i]))
                continue;
            needs_a_login(group->group, group->services[i].service);
            checked++;
        }
    }
    CHECK(checked > 20);
}

static void session_without_login_has_no_rights(void)
{
    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_SESSION_CREATE, NULL, 0, &reply));
    CHECK_EQUAL(reply.session, L7_SESSION_INITIAL);
    client.session = reply_number(&reply, TAG_DEV_SESSION_ID);
    CHECK_EQUAL(client.session >> 31, 1);
    CHECK_EQUAL(reply_number(&reply, TAG_DEV_AUTH_TYPE), DEV_CRYPT_XOR);
    CHECK(client_request(&client, SG_APPLICATION, SRV_APP_START, NULL, 0, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_NO_ACCESS_RIGHTS);
}

static void login_with_a_created_session_keeps_its_id(void)
{
    RTS_UI32 created;

    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_SESSION_CREATE, NULL, 0, &reply));
    created = client.session = reply_number(&reply, TAG_DEV_SESSION_ID);
    CHECK(client_login(&client));
    CHECK_EQUAL(client.session, created);
    CHECK(client_login_app(&client));
}

static void anonymous_login_gives_a_session_with_the_validation_bit(void)
{
    setup();
    CHECK(client_login(&client));
    CHECK_EQUAL(client.session >> 31, 1);
    CHECK(SrvIsLoggedIn(ChannelGetClient(0)));
}

static void login_reply_tells_the_settings(void)
{
    static const RTS_UI8 content[] = {0x22, 0x04, 1, 0, 0, 0};
    BTAG_READER login;
    RTS_UI32 value = 0;

    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_LOGIN, content, sizeof(content), &reply));
    CHECK_EQUAL(BTagFindContainer(&reply.tags, TAG_DEV_LOGIN_REPLY, &login), ERR_OK);
    CHECK(BTagFindUnsigned(&login, TAG_DEV_LOGIN_RESULT, &value) == ERR_OK && value == ERR_OK);
    CHECK(BTagFindUnsigned(&login, TAG_DEV_SETTINGS, &value) == ERR_OK && value == DEV_SETTING_MONITOR2);
}

static void malformed_empty_user_of_a_real_client_does_not_hurt(void)
{
    static const RTS_UI8 content[] = {0x22, 0x84, 0x80, 0x00, 1,    0,    0,    0,    0x23, 0x84, 0x80, 0x00,
                                      1,    2,    3,    4,    0x81, 0x01, 0x84, 0x00, 0x90, 0x80, 0x80, 0x00};

    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_LOGIN, content, sizeof(content), &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_OK);
    CHECK(SrvIsLoggedIn(ChannelGetClient(0)));
}

static void asymmetric_login_is_refused(void)
{
    static const RTS_UI8 content[] = {0x22, 0x04, 2, 0, 0, 0, 0x25, 0x04, 1, 0, 0, 0};
    BTAG_READER login;
    RTS_UI32 value = 0;

    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_LOGIN, content, sizeof(content), &reply));
    CHECK_EQUAL(BTagFindContainer(&reply.tags, SRV_OTHER_CLIENTS ? TAG_DEV_ONLINE_ACCESS : TAG_DEV_LOGIN_REPLY, &login),
                ERR_OK);
    CHECK(BTagFindUnsigned(&login, TAG_DEV_LOGIN_RESULT, &value) == ERR_OK && value == ERR_NOT_SUPPORTED);
    CHECK(!SrvIsLoggedIn(ChannelGetClient(0)));
}

static void settings_are_refused_to_everyone(void)
{
    setup();
    for (RTS_UI16 service = SRV_SETTG_GET_INT; service <= SRV_SETTG_WRITE; service++) {
        CHECK(client_request(&client, SG_SETTINGS, service, NULL, 0, &reply));
        CHECK_EQUAL(reply_error(&reply), ERR_INVALID_SESSION_ID);
    }
    CHECK(client_login(&client));
    for (RTS_UI16 service = SRV_SETTG_GET_INT; service <= SRV_SETTG_WRITE; service++) {
        CHECK(client_request(&client, SG_SETTINGS, service, NULL, 0, &reply));
        CHECK_EQUAL(reply_error(&reply), ERR_NO_ACCESS_RIGHTS);
    }
    CHECK(client_request(&client, SG_SETTINGS, SRV_SETTG_WRITE + 1, NULL, 0, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_UNKNOWNCMD);
}

static void login_without_type_is_an_error(void)
{
    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_LOGIN, NULL, 0, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_TAG_MISSING);
    CHECK(!SrvIsLoggedIn(ChannelGetClient(0)));
}

static void second_login_replaces_the_session(void)
{
    CLIENT before;

    setup();
    CHECK(client_login(&client) && client_login_app(&client));
    before = client;
    client.session = L7_SESSION_INITIAL;
    CHECK(client_login(&client));
    CHECK(client.session != before.session);
    CHECK(!SrvIsAppSession(ChannelGetClient(0), before.app_session));
    before.sent = client.sent;
    before.received = client.received;
    CHECK(!client_login_app(&before));
}

static void logout_ends_the_session(void)
{
    RTS_UI8 content[6] = {TAG_DEV_LOGOUT_SESSION, 4};

    setup();
    CHECK(client_login(&client));
    BytesPut32(content + 2, client.session ^ 1);
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_LOGOUT, content, sizeof(content), &reply));
    CHECK_EQUAL(reply_number(&reply, TAG_DEV_LOGOUT_REPLY), ERR_INVALID_SESSION_ID);
    CHECK(SrvIsLoggedIn(ChannelGetClient(0)));
    BytesPut32(content + 2, client.session);
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_LOGOUT, content, sizeof(content), &reply));
    CHECK_EQUAL(reply_number(&reply, TAG_DEV_LOGOUT_REPLY), ERR_OK);
    CHECK(!SrvIsLoggedIn(ChannelGetClient(0)));
    CHECK(!client_login_app(&client));
}

static void session_does_not_survive_its_channel(void)
{
    CLIENT old;

    setup();
    CHECK(client_login(&client));
    old = client;
    client_send_open(&client, 99, NETSERVER_MESSAGE_SIZE);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    client.session = old.session;
    CHECK(!client_login_app(&client));
    CHECK(reply_error(&reply) != ERR_OK || !SrvIsLoggedIn(ChannelGetClient(0)));
}

static void session_ids_differ(void)
{
    RTS_UI32 ids[50];

    setup();
    for (RTS_UI32 i = 0; i < RTS_COUNT(ids); i++) {
        ids[i] = SrvCreateSession(ChannelGetClient(0));
        for (RTS_UI32 k = 0; k < i; k++)
            CHECK(ids[k] != ids[i]);
    }
}

static void components_start_and_end_without_error(void)
{
    fakes_start();
    fakes_cycle(1);
    for (int hook = CH_EXIT_COMM; hook <= CH_EXIT_SYSTEM; hook++)
        fakes_hook((CMP_HOOK)hook);
    CHECK_EQUAL(fakes.hook_errors, 0);
}

static void a_full_group_table_is_an_error(void)
{
    static const SRV_SERVICE service;
    RTS_RESULT result = ERR_OK;

    fakes_start();
    for (int i = 0; i < 100 && result == ERR_OK; i++)
        result = SrvRegisterGroup(0x100, &service, 1);
    CHECK_EQUAL(result, ERR_NOMEMORY);
}

/* ---- device ---- */

static void identity_is_reported_in_the_layout_of_the_field(void)
{
    BTAG tag;

    setup();
    client.session = 0x12345678;
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply));
    CHECK_EQUAL(reply.session, 0);
    CHECK_EQUAL(reply_number(&reply, TAG_DEV_RESULT), ERR_OK);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_DEV_IDENT, 12, 12, &tag), ERR_OK);
    CHECK(BytesGet32(tag.data) == 0x1000 && BytesGet32(tag.data + 4) == 0x10002);
    CHECK_EQUAL(BytesGet32(tag.data + 8), 0x030E0514);
    CHECK_EQUAL(reply_number(&reply, TAG_DEV_RTS_VERSION), RTS_VERSION);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_DEV_NODE_NAME, 16, 16, &tag), ERR_OK);
    CHECK(memcmp(tag.data,
                 "\x0C\0\0\0N\0o\0d\0e\0"
                 "7\0\0\0",
                 16) == 0);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_DEV_VENDOR_NAME, 18, 20, &tag), ERR_OK);
    CHECK(memcmp(tag.data, "\x0E\0\0\0V\0e\0n\0d\0o\0r\0\0\0", 18) == 0);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_DEV_SERIAL_NUMBER, 8, 10, &tag), ERR_OK);
    CHECK(memcmp(tag.data, "\x05\0SN-42", 8) == 0);
    CHECK_EQUAL(reply_number(&reply, TAG_DEV_MAX_CHANNELS), 1);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_DEV_STACK, 8, 8, &tag), ERR_OK);
    CHECK(BytesGet32(tag.data) == 2000 && BytesGet32(tag.data + 4) == 500);
}

static void empty_names_are_empty(void)
{
    BTAG tag;

    setup();
    fakes.target.device_name = "";
    fakes.target.serial_number = "";
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply));
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_DEV_DEVICE_NAME, 8, 8, &tag), ERR_OK);
    CHECK(memcmp(tag.data, "\2\0\0\0\0\0\0\0", 8) == 0);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_DEV_SERIAL_NUMBER, 3, 6, &tag), ERR_OK);
    CHECK(memcmp(tag.data, "\0\0\0", 3) == 0);
}

static void other_expected_identity_is_a_type_mismatch(void)
{
    RTS_UI8 content[14] = {TAG_DEV_IDENT, 12, 0x00, 0x10, 0, 0, 0x02, 0, 0x01, 0, 9, 9, 9, 9};

    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, content, sizeof(content), &reply));
    CHECK_EQUAL(reply_number(&reply, TAG_DEV_RESULT), ERR_OK);
    content[6] = 3;
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, content, sizeof(content), &reply));
    CHECK_EQUAL(reply_number(&reply, TAG_DEV_RESULT), ERR_TYPE_MISMATCH);
    content[1] = 4;
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, content, 6, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_SIZE_MISMATCH);
}

static void echo_returns_the_data_and_zeros(void)
{
    static const RTS_UI8 content[] = {0x52, 0x04, 6, 0, 0, 0, 0x53, 0x03, 'a', 'b', 'c'};
    BTAG tag;

    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_ECHO, content, sizeof(content), &reply));
    CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_OK);
    CHECK_EQUAL(reply_number(&reply, TAG_DEV_ECHO_REPLY_LENGTH), 6);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_DEV_ECHO_DATA, 6, 6, &tag), ERR_OK);
    CHECK(memcmp(tag.data, "abc\0\0\0", 6) == 0);
}

static void echo_is_limited_to_the_message(void)
{
    static const RTS_UI8 content[] = {0x52, 0x04, 0xFF, 0xFF, 0xFF, 0xFF};

    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_ECHO, content, sizeof(content), &reply));
    RTS_UI32 length = reply_number(&reply, TAG_DEV_ECHO_REPLY_LENGTH);
    CHECK(length > NETSERVER_MESSAGE_SIZE - 60 && length < NETSERVER_MESSAGE_SIZE);
}

static void echo_without_wanted_length_is_empty(void)
{
    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_ECHO, NULL, 0, &reply));
    CHECK_EQUAL(reply.size, 20);
}

static void echo_of_nothing_has_no_data(void)
{
    static const RTS_UI8 content[] = {0x52, 0x01, 0};
    BTAG tag;

    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_ECHO, content, sizeof(content), &reply));
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_DEV_ECHO_DATA, 0, 9, &tag), ERR_L7_TAG_MISSING);
}

/* ---- log ---- */

static void fill_log(RTS_UI32 count)
{
    fakes.log_count = count;
    for (RTS_UI32 i = 0; i < count; i++) {
        LOG_ENTRY *entry = &fakes.log[i];
        entry->handle = 10 + i;
        entry->component = CMPID_CmpAppEmbedded;
        entry->log_class = LOG_ERROR;
        entry->error = 0x506;
        entry->time_ns = 0x0000001122334455;
        memset(entry->text, '%', LOG_TEXT_SIZE - 1); /* never a format string */
    }
}

static bool ask_log(RTS_UI32 handle, RTS_UI32 count)
{
    RTS_UI8 content[12] = {TAG_LOG_START_HANDLE, 4, 0, 0, 0, 0, TAG_LOG_COUNT, 4};

    BytesPut32(content + 2, handle);
    BytesPut32(content + 8, count);
    return client_request(&client, SG_LOG, SRV_LOG_GET_ENTRIES, content, sizeof(content), &reply);
}

/* Counts the records; *handle is the last one's. */
static RTS_UI32 records(RTS_UI32 *handle)
{
    BTAG_READER list = reply.tags;
    BTAG_READER record;
    BTAG tag;
    RTS_UI32 count = 0;

    for (; BTagReadNext(&list, &tag) == ERR_OK; count++) {
        CHECK_EQUAL(tag.id, TAG_LOG_RECORD);
        CHECK_EQUAL(BTagReadContainer(&list, &tag, &record), ERR_OK);
        CHECK_EQUAL(BTagFindUnsigned(&record, TAG_LOG_HANDLE, handle), ERR_OK);
    }
    return count;
}

static void log_record_has_all_its_parts(void)
{
    BTAG_READER record;
    BTAG tag;

    setup();
    fill_log(1);
    strcpy(fakes.log[0].text, "It is %s.");
    CHECK(client_request(&client, SG_LOG, SRV_LOG_GET_ENTRIES, NULL, 0, &reply));
    CHECK_EQUAL(BTagFindContainer(&reply.tags, TAG_LOG_RECORD, &record), ERR_OK);
    CHECK_EQUAL(BTagFind(&record, TAG_LOG_TIME_NS, 8, 8, &tag), ERR_OK);
    CHECK(memcmp(tag.data, "\x55\x44\x33\x22\x11\0\0\0", 8) == 0);
    CHECK_EQUAL(BTagFind(&record, TAG_LOG_ENTRY, 16, 16, &tag), ERR_OK);
    CHECK(memcmp(tag.data, "\x02\0\0\0\x04\0\0\0\x06\x05\0\0\0\0\0\0", 16) == 0);
    CHECK_EQUAL(BTagFind(&record, TAG_LOG_TEXT, 12, 12, &tag), ERR_OK);
    CHECK(strcmp((const char *)tag.data, "It is %s.") == 0);
    CHECK_EQUAL(BTagFind(&record, TAG_LOG_COMPONENT_NAME, 16, 16, &tag), ERR_OK);
    CHECK(strcmp((const char *)tag.data, "CmpAppEmbedded") == 0);
}

static void empty_log_is_an_empty_reply(void)
{
    setup();
    CHECK(ask_log(0, 100));
    CHECK_EQUAL(reply.size, 20);
}

static void log_is_read_in_pieces_that_fit(void)
{
    RTS_UI32 handle = 9;
    RTS_UI32 total = 0;
    RTS_UI32 got;

    fakes_start();
    client_init(&client, 0x0102);
    client_send_open(&client, 1, 1024);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    fill_log(16);
    do {
        CHECK(ask_log(handle + 1, 100));
        CHECK_EQUAL(reply_error(&reply), ERR_OK);
        got = records(&handle);
        total += got;
    } while (got != 0);
    CHECK_EQUAL(total, 16);
    CHECK_EQUAL(handle, 25);
}

static void log_request_is_limited_by_count_and_start(void)
{
    RTS_UI32 handle = 0;

    setup();
    fill_log(16);
    CHECK(ask_log(20, 2));
    CHECK_EQUAL(records(&handle), 2);
    CHECK_EQUAL(handle, 21);
    CHECK(ask_log(26, 2));
    CHECK_EQUAL(records(&handle), 0);
}

static bool ask_named_log(const char *name, RTS_UI32 length)
{
    RTS_UI8 content[40] = {TAG_LOG_NAME, (RTS_UI8)length};

    memcpy(content + 2, name, length);
    return client_request(&client, SG_LOG, SRV_LOG_GET_ENTRIES, content, 2 + length, &reply);
}

static void the_kept_log_comes_by_its_name_with_start_and_clock(void)
{
    BTAG_READER record;
    RTS_UI32 start = 0;
    BTAG tag;

    setup();
    fill_log(1);
    fakes.utc_ns = 0x1122334455667788;
    CHECK(ask_named_log("KeptLog", 8));
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_LOG_NAME, 8, 32, &tag), ERR_OK);
    CHECK(strcmp((const char *)tag.data, "KeptLog") == 0);
    CHECK_EQUAL(BTagFindContainer(&reply.tags, TAG_LOG_RECORD, &record), ERR_OK);
    CHECK(BTagFindUnsigned(&record, TAG_LOG_START, &start) == ERR_OK && start == 7);
    CHECK_EQUAL(BTagFind(&record, TAG_LOG_UTC_NS, 8, 8, &tag), ERR_OK);
    CHECK(memcmp(tag.data, "\x88\x77\x66\x55\x44\x33\x22\x11", 8) == 0);
    CHECK(ask_named_log("KeptLo", 6));
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_LOG_NAME, 0, 32, &tag), ERR_L7_TAG_MISSING);
    fakes.kept = ERR_NOT_SUPPORTED;
    CHECK(ask_named_log("KeptLog", 7));
    CHECK_EQUAL(reply_error(&reply), ERR_NOT_SUPPORTED);
}

static void the_clock_comes_to_a_client_that_asks_for_it(void)
{
    static const RTS_UI8 content[] = {TAG_LOG_CLOCK, 4, 1, 0, 0, 0};
    BTAG tag;

    setup();
    CHECK(client_request(&client, SG_LOG, SRV_LOG_GET_ENTRIES, content, sizeof content, &reply));
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_LOG_CLOCK, 8, 8, &tag), ERR_L7_TAG_MISSING);
    fakes.utc_ns = 0x1122334455667788;
    CHECK(client_request(&client, SG_LOG, SRV_LOG_GET_ENTRIES, content, sizeof content, &reply));
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_LOG_CLOCK, 8, 8, &tag), ERR_OK);
    CHECK(ask_log(0, 100));
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_LOG_CLOCK, 8, 8, &tag), ERR_L7_TAG_MISSING);
}

int main(void)
{
    RUN(cut_headers_are_not_answered);
    RUN(other_protocols_are_not_answered);
    RUN(header_length_is_checked);
    RUN(short_header_is_answered_with_a_short_header);
    RUN(content_longer_than_the_message_is_an_error);
    RUN(unknown_groups_and_services_have_their_errors);
    RUN(reply_echoes_the_session_of_the_request);
    RUN(too_small_reply_buffer_is_not_overrun);
    RUN(every_service_survives_missing_session_and_content);
    RUN(services_with_a_right_need_a_login);
    RUN(session_without_login_has_no_rights);
    RUN(login_with_a_created_session_keeps_its_id);
    RUN(anonymous_login_gives_a_session_with_the_validation_bit);
    RUN(login_reply_tells_the_settings);
    RUN(malformed_empty_user_of_a_real_client_does_not_hurt);
    RUN(asymmetric_login_is_refused);
    RUN(settings_are_refused_to_everyone);
    RUN(login_without_type_is_an_error);
    RUN(second_login_replaces_the_session);
    RUN(logout_ends_the_session);
    RUN(session_does_not_survive_its_channel);
    RUN(session_ids_differ);
    RUN(components_start_and_end_without_error);
    RUN(a_full_group_table_is_an_error);
    RUN(identity_is_reported_in_the_layout_of_the_field);
    RUN(empty_names_are_empty);
    RUN(other_expected_identity_is_a_type_mismatch);
    RUN(echo_returns_the_data_and_zeros);
    RUN(echo_is_limited_to_the_message);
    RUN(echo_without_wanted_length_is_empty);
    RUN(echo_of_nothing_has_no_data);
    RUN(log_record_has_all_its_parts);
    RUN(empty_log_is_an_empty_reply);
    RUN(log_is_read_in_pieces_that_fit);
    RUN(log_request_is_limited_by_count_and_start);
    RUN(the_kept_log_comes_by_its_name_with_start_and_clock);
    RUN(the_clock_comes_to_a_client_that_asks_for_it);
    return test_result();
}
