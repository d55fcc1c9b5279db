/*
 * test_comm_app.c - CmpAppSrv: application login, control, status, tasks.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpOperationControl.h"
#include "CmpSrv.h"
#include "SysExcept.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "test.h"

RTS_STATIC_ASSERT(NETSERVER_MESSAGE_SIZE >= TESTS_NEED_MESSAGE_SIZE, tests_have_room);

static CLIENT client;
static REPLY reply;
static RTS_UI8 content[NETSERVER_MESSAGE_SIZE];
static BTAG_WRITER writer;

static void setup(void)
{
    fakes_start();
    CHECK(client_connect(&client));
}

static BTAG_WRITER *begin_content(void)
{
    BTagWriterInit(&writer, content, sizeof(content) - 20);
    return &writer;
}

static bool call(RTS_UI16 service)
{
    return client_call(&client, SG_APPLICATION, service, &writer, &reply);
}

/* TAG_APP_DESCRIPTOR with the session and, unless it is NULL, a reset option. */
static void put_descriptor(RTS_UI32 session, const RTS_UI32 *option)
{
    begin_content();
    BTagOpen(&writer, TAG_APP_DESCRIPTOR, BTAG_ALIGN_0);
    BTagWrite32(&writer, TAG_APP_SESSION, session);
    if (option != NULL)
        BTagWrite32(&writer, TAG_APP_OPTION, *option);
    BTagClose(&writer);
}

/* ---- login ---- */

static bool take_login_reply(BTAG *option)
{
    BTAG_READER descriptor;

    return BTagFindContainer(&reply.tags, TAG_APP_DESCRIPTOR, &descriptor) == ERR_OK &&
           BTagFind(&descriptor, TAG_APP_OPTION, sizeof(APP_LOGIN_REPLY), sizeof(APP_LOGIN_REPLY), option) == ERR_OK;
}

static void login_gives_a_session_and_the_image_crc_as_guids(void)
{
    BTAG option;

    setup();
    BTagWriteText(begin_content(), TAG_APP_LOGIN_NAME, "Application", 20);
    CHECK(call(SRV_APP_LOGIN));
    CHECK(take_login_reply(&option));
    CHECK_EQUAL(BytesGet16(option.data), ERR_OK);
    CHECK(SrvIsAppSession(ChannelGetClient(0), BytesGet32(option.data + 2)));
    CHECK_EQUAL(BytesGet32(option.data + 6), FAKE_IMAGE_CRC);
    CHECK_EQUAL(BytesGet32(option.data + 22), FAKE_IMAGE_CRC);
    CHECK(memcmp(option.data + 10, "\0\0\0\0\0\0\0\0\0\0\0\0", 12) == 0);
    CHECK_EQUAL(((option.data - (reply.message + 20)) & 3), 2);
}

static void login_without_application_says_so(void)
{
    BTAG option;

    fakes_start();
    fakes.status.state = AS_NONE;
    fakes.status.image_crc = 0;
    client_init(&client, 1);
    CHECK(client_open(&client) && client_login(&client));
    BTagWriteText(begin_content(), TAG_APP_LOGIN_NAME, "Application", 20);
    CHECK(call(SRV_APP_LOGIN));
    CHECK(take_login_reply(&option));
    CHECK_EQUAL(BytesGet16(option.data), ERR_APP_NOT_EXIST);
    CHECK_EQUAL(BytesGet32(option.data + 2), 0);
    CHECK_EQUAL(BytesGet32(option.data + 6), 0);
}

static void names_are_bounded(void)
{
    static const char name[] = "0123456789012345678901234567890123456789012345678901234567890123456789";

    setup();
    BTagWriteText(begin_content(), TAG_APP_LOGIN_NAME, name, 59);
    CHECK(call(SRV_APP_LOGIN));
    CHECK_EQUAL(reply_error(&reply), ERR_OK);
    BTagWriteText(begin_content(), TAG_APP_LOGIN_NAME, name, 63);
    CHECK(call(SRV_APP_LOGIN));
    CHECK_EQUAL(reply_error(&reply), ERR_SIZE_MISMATCH);
    begin_content();
    CHECK(call(SRV_APP_LOGIN));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_TAG_MISSING);
}

static void captured_create_request_gives_a_session(void)
{
    static const RTS_UI8 request[] = {0x81, 0x01, 0x90, 0x00, 0x10, 0x0E, 'A', 'p', 'p', 'l',
                                      'i',  'c',  'a',  't',  'i',  'o',  'n', 0,   0,   0};
    BTAG option;

    fakes_start();
    fakes.status.state = AS_NONE;
    client_init(&client, 1);
    CHECK(client_open(&client) && client_login(&client));
    CHECK(client_request(&client, SG_APPLICATION, SRV_APP_CREATE, request, sizeof(request), &reply));
    CHECK(take_login_reply(&option));
    CHECK_EQUAL(BytesGet16(option.data), ERR_OK);
    CHECK(BytesGet32(option.data + 2) != 0);
}

static void create_without_a_name_is_an_error(void)
{
    setup();
    put_descriptor(1, NULL);
    CHECK(call(SRV_APP_CREATE));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_TAG_MISSING);
    begin_content();
    CHECK(call(SRV_APP_CREATE));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_TAG_MISSING);
}

static void logout_ends_the_application_session_only(void)
{
    setup();
    BTagWrite32(begin_content(), TAG_APP_LOGOUT, client.app_session ^ 2);
    CHECK(call(SRV_APP_LOGOUT));
    CHECK_EQUAL(reply_number(&reply, TAG_APP_LOGOUT), ERR_APP_INVALID_SESSIONID);
    BTagWrite32(begin_content(), TAG_APP_LOGOUT, client.app_session);
    CHECK(call(SRV_APP_LOGOUT));
    CHECK_EQUAL(reply_number(&reply, TAG_APP_LOGOUT), ERR_OK);
    put_descriptor(client.app_session, NULL);
    CHECK(call(SRV_APP_START));
    CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_APP_INVALID_SESSIONID);
    CHECK(SrvIsLoggedIn(ChannelGetClient(0)));
}

/* ---- control ---- */

static void start_and_stop_reach_the_application(void)
{
    setup();
    put_descriptor(client.app_session, NULL);
    CHECK(call(SRV_APP_START));
    CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_OK);
    CHECK_EQUAL(fakes.starts, 1);
    put_descriptor(client.app_session, NULL);
    CHECK(call(SRV_APP_STOP));
    CHECK_EQUAL(fakes.stops, 1);
}

static RTS_UI32 control(RTS_UI16 service, const RTS_UI32 *option)
{
    put_descriptor(client.app_session, option);
    CHECK(call(service));
    return reply_number(&reply, TAG_SERVICE_RESULT);
}

static void what_the_program_forbids_is_refused_but_not_start_and_origin(void)
{
    RTS_UI32 cold = RESET_OPTION_COLD;
    RTS_UI32 origin = RESET_OPTION_ORIGIN;

    setup();
    fakes.forbidden = 1 << OPERATION_STOP | 1 << OPERATION_RESET;
    CHECK_EQUAL(control(SRV_APP_STOP, NULL), ERR_OPERATION_DENIED);
    CHECK_EQUAL(control(SRV_APP_RESET, &cold), ERR_OPERATION_DENIED);
    CHECK_EQUAL(fakes.stops + fakes.resets, 0);
    CHECK_EQUAL(control(SRV_APP_START, NULL), ERR_OK);
    CHECK_EQUAL(control(SRV_APP_RESET, &origin), ERR_OK);
    CHECK_EQUAL(fakes.starts + fakes.resets, 2);
}

static void a_component_that_denies_says_why(void)
{
    RTS_UI32 cold = RESET_OPTION_COLD;
    BTAG reason;

    setup();
    fakes.reason = "words of an earlier denial";
    fakes.control_result = ERR_INVALID_STATE;
    CHECK_EQUAL(control(SRV_APP_START, NULL), ERR_INVALID_STATE);
    CHECK(BTagFind(&reply.tags, TAG_APP_REASON, 1, 200, &reason) == ERR_L7_TAG_MISSING);
    fakes.denial = "the door is open";
    CHECK_EQUAL(control(SRV_APP_STOP, NULL), ERR_INVALID_STATE);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_APP_REASON, 1, 200, &reason), ERR_OK);
    CHECK(strcmp((const char *)reason.data, "the door is open") == 0);
    CHECK_EQUAL(control(SRV_APP_RESET, &cold), ERR_INVALID_STATE);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_APP_REASON, 1, 200, &reason), ERR_OK);
    fakes.control_result = ERR_OK;
    CHECK_EQUAL(control(SRV_APP_STOP, NULL), ERR_OK);
    CHECK(BTagFind(&reply.tags, TAG_APP_REASON, 1, 200, &reason) == ERR_L7_TAG_MISSING);
}

static void refusal_of_the_application_is_the_result(void)
{
    setup();
    fakes.control_result = ERR_INVALID_STATE;
    put_descriptor(client.app_session, NULL);
    CHECK(call(SRV_APP_START));
    CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_INVALID_STATE);
    CHECK_EQUAL(reply_error(&reply), ERR_OK);
}

static void wrong_application_session_changes_nothing(void)
{
    RTS_UI32 option = RESET_OPTION_ORIGIN;

    setup();
    put_descriptor(client.app_session ^ 2, NULL);
    CHECK(call(SRV_APP_START));
    CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_APP_INVALID_SESSIONID);
    put_descriptor(0, &option);
    CHECK(call(SRV_APP_RESET));
    CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_APP_INVALID_SESSIONID);
    begin_content();
    CHECK(call(SRV_APP_STOP));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_TAG_MISSING);
    CHECK_EQUAL(fakes.starts + fakes.stops + fakes.resets, 0);
}

/* Of a client that has not logged in to the application, the number of its session is 0. */
static void session_0_is_that_of_no_application(void)
{
    setup();
    SrvEndAppSession(ChannelGetClient(0));
    put_descriptor(0, NULL);
    CHECK(call(SRV_APP_START));
    CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_APP_INVALID_SESSIONID);
    CHECK_EQUAL(fakes.starts, 0);
}

static void reset_passes_its_option(void)
{
    setup();
    for (RTS_UI32 option = 0; option <= 2; option++) {
        put_descriptor(client.app_session, &option);
        CHECK(call(SRV_APP_RESET));
        CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_OK);
        CHECK_EQUAL(fakes.reset_option, option);
    }
    RTS_UI32 unknown = 3;
    put_descriptor(client.app_session, &unknown);
    CHECK(call(SRV_APP_RESET));
    CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_NOT_SUPPORTED);
    put_descriptor(client.app_session, NULL);
    CHECK(call(SRV_APP_RESET));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_TAG_MISSING);
    CHECK_EQUAL(fakes.resets, 3);
}

/* ---- what is there ---- */

static bool take_status(BTAG_READER *status)
{
    begin_content();
    return call(SRV_APP_READ_STATUS) && BTagFindContainer(&reply.tags, TAG_APP_STATUS, status) == ERR_OK;
}

static void status_needs_no_login_and_tells_state_and_image(void)
{
    BTAG_READER status;
    BTAG tag;

    fakes_start();
    client_init(&client, 1);
    CHECK(client_open(&client));
    CHECK(take_status(&status));
    CHECK_EQUAL(BTagFind(&status, TAG_APP_STATE, 10, 10, &tag), ERR_OK);
    CHECK_EQUAL(((tag.data - (reply.message + 20)) & 3), 2);
    CHECK(memcmp(tag.data, "\0\0\x02\0\0\0\x01\x10\0\0", 10) == 0);
    CHECK_EQUAL(BTagFind(&status, TAG_APP_IMAGE, 8, 8, &tag), ERR_OK);
    CHECK(BytesGet32(tag.data) == FAKE_IMAGE_CRC && BytesGet32(tag.data + 4) == 3000);
    CHECK_EQUAL(BTagFind(&status, TAG_APP_EXECUTION_POSITION, 0, 99, &tag), ERR_L7_TAG_MISSING);
    CHECK_EQUAL(BTagFind(&status, TAG_APP_LAST_EXCEPTION, 12, 12, &tag), ERR_OK);
    CHECK_EQUAL(BytesGet32(tag.data), RTSEXCPT_NOEXCEPTION);
}

static void status_tells_where_the_exception_was(void)
{
    BTAG_READER status;
    BTAG tag;

    setup();
    fakes.status.exception.code = RTSEXCPT_DIVIDEBYZERO;
    fakes.status.exception.code_offset = 0x1234;
    fakes.status.exception.task = -1;
    CHECK(take_status(&status));
    CHECK_EQUAL(BTagFind(&status, TAG_APP_EXECUTION_POSITION, 6, 6, &tag), ERR_OK);
    CHECK(memcmp(tag.data, "\x05\0\x34\x12\0\0", 6) == 0);
    CHECK_EQUAL(BTagFind(&status, TAG_APP_LAST_EXCEPTION, 12, 12, &tag), ERR_OK);
    CHECK(memcmp(tag.data, "\x02\x01\0\0\x34\x12\0\0\xFF\xFF\xFF\xFF", 12) == 0);
    fakes.status.exception.code_offset = 0xFFFFFFFF;
    CHECK(take_status(&status));
    CHECK_EQUAL(BTagFind(&status, TAG_APP_EXECUTION_POSITION, 0, 99, &tag), ERR_L7_TAG_MISSING);
}

static void status_tells_what_the_stack_had_when_there_is_an_exception(void)
{
    BTAG_READER status;
    BTAG tag;

    setup();
    fakes.trace = (EXCEPT_TRACE){.count = 2, .call = {{0x1234, EXCEPT_LINK}, {0x5678, 12}}};
    CHECK(take_status(&status));
    CHECK_EQUAL(BTagFind(&status, TAG_APP_CALLS, 0, 99, &tag), ERR_L7_TAG_MISSING);
    fakes.status.exception.code = RTSEXCPT_DIVIDEBYZERO;
    CHECK(take_status(&status));
    CHECK_EQUAL(BTagFind(&status, TAG_APP_CALLS, 16, 16, &tag), ERR_OK);
    CHECK(memcmp(tag.data, "\x34\x12\0\0\xFF\xFF\xFF\0\x78\x56\0\0\x0C\0\0\0", 16) == 0);
}

static void status_fits_the_smallest_message_with_the_calls_it_has_room_for(void)
{
    BTAG_READER status;
    BTAG tag;

    fakes_start();
    client_init(&client, 1);
    client_send_open(&client, 1, CHANNEL_MIN_MESSAGE);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    fakes.status.exception = (APP_EXCEPTION){RTSEXCPT_DIVIDEBYZERO, 0x1234, 0};
    fakes.trace.count = EXCEPT_MAX_CALLS;
    CHECK(take_status(&status));
    CHECK_EQUAL(BTagFind(&status, TAG_APP_IMAGE, 8, 8, &tag), ERR_OK);
    CHECK(BTagFind(&status, TAG_APP_CALLS, 8, 8 * EXCEPT_MAX_CALLS - 1, &tag) == ERR_OK && tag.size % 8 == 0);
}

static bool list_has_application(const RTS_UI8 *range, RTS_UI32 size)
{
    BTAG_READER list;
    BTAG name;

    begin_content();
    if (size != 0) {
        BTagOpen(&writer, TAG_APP_LIST_RANGE, BTAG_ALIGN_0);
        BTagAppend(&writer, range, size);
        BTagClose(&writer);
    }
    return call(SRV_APP_READ_APPLICATION_LIST) && BTagFindContainer(&reply.tags, TAG_APP_LIST, &list) == ERR_OK &&
           BTagFind(&list, TAG_APP_LIST_NAME, 12, 16, &name) == ERR_OK &&
           strcmp((const char *)name.data, "Application") == 0;
}

static void list_names_the_application(void)
{
    setup();
    CHECK(list_has_application(NULL, 0));
    CHECK(list_has_application((const RTS_UI8 *)"\0\0\0\0\xFF\xFF\xFF\x7F", 8));
    CHECK(list_has_application((const RTS_UI8 *)"\0\0\0\0\0\xFF\xFF\xFF\x7F", 9)); /* as a real client sends it */
    CHECK(!list_has_application((const RTS_UI8 *)"\1\0\0\0\xFF\xFF\xFF\x7F", 8));
    CHECK(!list_has_application((const RTS_UI8 *)"\0\0\0\0\0\0\0\0", 8));
    CHECK(!list_has_application((const RTS_UI8 *)"\0\0\0\0", 4));
    fakes.status.state = AS_NONE;
    CHECK(!list_has_application(NULL, 0));
}

static bool is_text(RTS_UI32 id, const char *text)
{
    BTAG tag;

    return BTagFind(&reply.tags, id, 4, 100, &tag) == ERR_OK && strcmp((const char *)tag.data, text) == 0;
}

static void info_reports_the_strings_of_the_image(void)
{
    setup();
    begin_content();
    CHECK(call(SRV_APP_READ_APPLICATION_INFO));
    CHECK(is_text(TAG_APP_INFO_PROJECT, "project"));
    CHECK(is_text(TAG_APP_INFO_VERSION, "1.2.3"));
    CHECK(is_text(TAG_APP_INFO_AUTHOR, "author"));
    CHECK(is_text(TAG_APP_INFO_DESCRIPTION, ""));
    CHECK(is_text(TAG_APP_INFO_PROFILE, "profile"));
    fakes.status.state = AS_NONE;
    begin_content();
    CHECK(call(SRV_APP_READ_APPLICATION_INFO));
    CHECK_EQUAL(reply_error(&reply), ERR_APP_NOT_LOADED);
}

static void tasks_are_reported_with_their_times(void)
{
    BTAG_READER list;
    BTAG tag;

    setup();
    begin_content();
    CHECK(call(SRV_APP_READ_TASK_INFO));
    CHECK_EQUAL(reply.size, 20);
    fakes.task_count = 2;
    fakes.task_load = 30;
    memset(fakes.tasks[1].name, 'x', sizeof(fakes.tasks[1].name)); /* without NUL */
    strcpy(fakes.tasks[0].name, "Main");
    fakes.tasks[0].kind = 0x100;
    fakes.tasks[0].interval_us = 0x102;
    fakes.tasks[0].overruns = 0x109;
    begin_content();
    CHECK(call(SRV_APP_READ_TASK_INFO));
    list = reply.tags;
    CHECK_EQUAL(BTagReadNext(&list, &tag), ERR_OK);
    CHECK(tag.id == TAG_TASK_INFO && tag.size == 48);
    CHECK(BytesGet32(tag.data) == 0x100 && BytesGet32(tag.data + 8) == 0x102 && BytesGet32(tag.data + 36) == 0x109);
    CHECK(strcmp((const char *)tag.data + 40, "Main") == 0);
    CHECK_EQUAL(BTagReadNext(&list, &tag), ERR_OK);
    CHECK(tag.id == TAG_TASK_LOAD && tag.size == 4 && BytesGet32(tag.data) == 30);
    CHECK_EQUAL(BTagReadNext(&list, &tag), ERR_OK);
    CHECK(tag.size == 72 && strlen((const char *)tag.data + 40) == 31);
    CHECK_EQUAL(BTagReadNext(&list, &tag), ERR_OK);
    CHECK(tag.id == TAG_TASK_LOAD && BytesGet32(tag.data) == 31);
    CHECK_EQUAL(BTagReadNext(&list, &tag), ERR_END_OF_OBJECT);
}

static void lateness_is_reported_of_each_task_without_empty_classes(void)
{
    BTAG_READER list;
    BTAG tag;

    setup();
    fakes.task_count = 2;
    begin_content();
    CHECK(call(SRV_APP_READ_TASK_LATENESS));
    list = reply.tags;
    CHECK_EQUAL(BTagReadNext(&list, &tag), ERR_OK);
    CHECK(tag.id == TAG_TASK_LATENESS && tag.size == 16);
    CHECK(BytesGet32(tag.data) == 2000 && BytesGet32(tag.data + 4) == 1);
    CHECK_EQUAL(BTagReadNext(&list, &tag), ERR_OK);
    CHECK(tag.size == 16 && BytesGet32(tag.data + 8) == 3000 && BytesGet32(tag.data + 12) == 4);
    CHECK_EQUAL(BTagReadNext(&list, &tag), ERR_END_OF_OBJECT);
}

/* ---- what clients of others ask for ---- */

static void a_single_cycle_and_deletion_need_the_session_of_the_application(void)
{
    setup();
    put_descriptor(client.app_session + 1, NULL);
    CHECK(call(SRV_APP_SINGLE_CYCLE) && reply_number(&reply, TAG_SERVICE_RESULT) == ERR_APP_INVALID_SESSIONID);
    CHECK(call(SRV_APP_DELETE) && reply_number(&reply, TAG_SERVICE_RESULT) == ERR_APP_INVALID_SESSIONID);
    CHECK(fakes.single_cycles == 0 && fakes.resets == 0);
    put_descriptor(client.app_session, NULL);
    CHECK(call(SRV_APP_SINGLE_CYCLE) && reply_number(&reply, TAG_SERVICE_RESULT) == ERR_OK);
    CHECK(fakes.single_cycles == 1 && fakes.starts == 0);
    fakes.control_result = ERR_CALL_AGAIN;
    CHECK(call(SRV_APP_SINGLE_CYCLE) && reply_number(&reply, TAG_SERVICE_RESULT) == ERR_CALL_AGAIN);
    fakes.control_result = ERR_OK;
    CHECK(call(SRV_APP_DELETE) && reply_number(&reply, TAG_SERVICE_RESULT) == ERR_OK);
    CHECK(fakes.resets == 1 && fakes.reset_option == RESET_OPTION_ORIGIN);
    begin_content();
    CHECK(call(SRV_APP_DELETE) && reply_error(&reply) == ERR_L7_TAG_MISSING);
}

static void ask_area(RTS_UI32 session, RTS_UI32 area)
{
    begin_content();
    BTagWrite32(&writer, TAG_APP_SESSION, session);
    BTagWrite32(&writer, TAG_APP_AREA, area);
    CHECK(call(SRV_APP_GET_AREA_ADDRESS));
}

static void the_address_of_an_area_is_that_which_pointers_have(void)
{
    uintptr_t address = 0;
    BTAG tag;

    setup();
    fakes.area_size[APP_AREA_MEMORY] = 0;
    ask_area(client.app_session, APP_AREA_RETAIN);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_APP_AREA_ADDRESS, sizeof(address), sizeof(address), &tag), ERR_OK);
    memcpy(&address, tag.data, sizeof(address));
    CHECK(address == (uintptr_t)fakes_area(APP_AREA_RETAIN));
    ask_area(client.app_session, APP_AREA_MEMORY);
    CHECK_EQUAL(reply_error(&reply), ERR_APP_MAPPED_AREA_NOT_FOUND);
    ask_area(client.app_session, APP_AREA_COUNT);
    CHECK_EQUAL(reply_error(&reply), ERR_APP_MAPPED_AREA_NOT_FOUND);
    ask_area(client.app_session, 0xFFFFFFFF);
    CHECK_EQUAL(reply_error(&reply), ERR_APP_MAPPED_AREA_NOT_FOUND);
    ask_area(client.app_session + 1, APP_AREA_RETAIN);
    CHECK_EQUAL(reply_error(&reply), ERR_APP_INVALID_SESSIONID);
}

int main(void)
{
    RUN(login_gives_a_session_and_the_image_crc_as_guids);
    RUN(login_without_application_says_so);
    RUN(names_are_bounded);
    RUN(captured_create_request_gives_a_session);
    RUN(create_without_a_name_is_an_error);
    RUN(logout_ends_the_application_session_only);
    RUN(start_and_stop_reach_the_application);
    RUN(what_the_program_forbids_is_refused_but_not_start_and_origin);
    RUN(a_component_that_denies_says_why);
    RUN(refusal_of_the_application_is_the_result);
    RUN(wrong_application_session_changes_nothing);
    RUN(session_0_is_that_of_no_application);
    RUN(reset_passes_its_option);
    RUN(status_needs_no_login_and_tells_state_and_image);
    RUN(status_tells_where_the_exception_was);
    RUN(status_tells_what_the_stack_had_when_there_is_an_exception);
    RUN(status_fits_the_smallest_message_with_the_calls_it_has_room_for);
    RUN(list_names_the_application);
    RUN(info_reports_the_strings_of_the_image);
    RUN(tasks_are_reported_with_their_times);
    RUN(lateness_is_reported_of_each_task_without_empty_classes);
    RUN(a_single_cycle_and_deletion_need_the_session_of_the_application);
    RUN(the_address_of_an_area_is_that_which_pointers_have);
    return test_result();
}
