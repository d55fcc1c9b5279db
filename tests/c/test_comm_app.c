/*
 * test_comm_app.c - CmpAppSrv: application login, control, status, tasks, download.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
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
    CHECK(BytesGet16(option.data) == ERR_OK);
    CHECK(SrvIsAppSession(ChannelGetClient(0), BytesGet32(option.data + 2)));
    CHECK(BytesGet32(option.data + 6) == FAKE_IMAGE_CRC);
    CHECK(BytesGet32(option.data + 22) == FAKE_IMAGE_CRC);
    CHECK(memcmp(option.data + 10, "\0\0\0\0\0\0\0\0\0\0\0\0", 12) == 0);
    CHECK(((option.data - (reply.message + 20)) & 3) == 2);
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
    CHECK(BytesGet16(option.data) == ERR_APP_NOT_EXIST);
    CHECK(BytesGet32(option.data + 2) == 0);
    CHECK(BytesGet32(option.data + 6) == 0);
}

static void names_are_bounded(void)
{
    static const char name[] = "0123456789012345678901234567890123456789012345678901234567890123456789";

    setup();
    BTagWriteText(begin_content(), TAG_APP_LOGIN_NAME, name, 59);
    CHECK(call(SRV_APP_LOGIN));
    CHECK(reply_error(&reply) == ERR_OK);
    BTagWriteText(begin_content(), TAG_APP_LOGIN_NAME, name, 63);
    CHECK(call(SRV_APP_LOGIN));
    CHECK(reply_error(&reply) == ERR_SIZE_MISMATCH);
    begin_content();
    CHECK(call(SRV_APP_LOGIN));
    CHECK(reply_error(&reply) == ERR_L7_TAG_MISSING);
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
    CHECK(BytesGet16(option.data) == ERR_OK);
    CHECK(BytesGet32(option.data + 2) != 0);
}

static void create_without_a_name_is_an_error(void)
{
    setup();
    put_descriptor(1, NULL);
    CHECK(call(SRV_APP_CREATE));
    CHECK(reply_error(&reply) == ERR_L7_TAG_MISSING);
    begin_content();
    CHECK(call(SRV_APP_CREATE));
    CHECK(reply_error(&reply) == ERR_L7_TAG_MISSING);
}

static void logout_ends_the_application_session_only(void)
{
    setup();
    BTagWrite32(begin_content(), TAG_APP_LOGOUT, client.app_session ^ 2);
    CHECK(call(SRV_APP_LOGOUT));
    CHECK(reply_number(&reply, TAG_APP_LOGOUT) == ERR_APP_INVALID_SESSIONID);
    BTagWrite32(begin_content(), TAG_APP_LOGOUT, client.app_session);
    CHECK(call(SRV_APP_LOGOUT));
    CHECK(reply_number(&reply, TAG_APP_LOGOUT) == ERR_OK);
    put_descriptor(client.app_session, NULL);
    CHECK(call(SRV_APP_START));
    CHECK(reply_number(&reply, TAG_SERVICE_RESULT) == ERR_APP_INVALID_SESSIONID);
    CHECK(SrvIsLoggedIn(ChannelGetClient(0)));
}

/* ---- control ---- */

static void start_and_stop_reach_the_application(void)
{
    setup();
    put_descriptor(client.app_session, NULL);
    CHECK(call(SRV_APP_START));
    CHECK(reply_number(&reply, TAG_SERVICE_RESULT) == ERR_OK);
    CHECK(fakes.starts == 1);
    put_descriptor(client.app_session, NULL);
    CHECK(call(SRV_APP_STOP));
    CHECK(fakes.stops == 1);
}

static void refusal_of_the_application_is_the_result(void)
{
    setup();
    fakes.control_result = ERR_INVALID_STATE;
    put_descriptor(client.app_session, NULL);
    CHECK(call(SRV_APP_START));
    CHECK(reply_number(&reply, TAG_SERVICE_RESULT) == ERR_INVALID_STATE);
    CHECK(reply_error(&reply) == ERR_OK);
}

static void wrong_application_session_changes_nothing(void)
{
    RTS_UI32 option = RESET_OPTION_ORIGIN;

    setup();
    put_descriptor(client.app_session ^ 2, NULL);
    CHECK(call(SRV_APP_START));
    CHECK(reply_number(&reply, TAG_SERVICE_RESULT) == ERR_APP_INVALID_SESSIONID);
    put_descriptor(0, &option);
    CHECK(call(SRV_APP_RESET));
    CHECK(reply_number(&reply, TAG_SERVICE_RESULT) == ERR_APP_INVALID_SESSIONID);
    begin_content();
    CHECK(call(SRV_APP_STOP));
    CHECK(reply_error(&reply) == ERR_L7_TAG_MISSING);
    CHECK(fakes.starts + fakes.stops + fakes.resets == 0);
}

static void reset_passes_its_option(void)
{
    setup();
    for (RTS_UI32 option = 0; option <= 2; option++) {
        put_descriptor(client.app_session, &option);
        CHECK(call(SRV_APP_RESET));
        CHECK(reply_number(&reply, TAG_SERVICE_RESULT) == ERR_OK);
        CHECK(fakes.reset_option == option);
    }
    RTS_UI32 unknown = 3;
    put_descriptor(client.app_session, &unknown);
    CHECK(call(SRV_APP_RESET));
    CHECK(reply_number(&reply, TAG_SERVICE_RESULT) == ERR_NOT_SUPPORTED);
    put_descriptor(client.app_session, NULL);
    CHECK(call(SRV_APP_RESET));
    CHECK(reply_error(&reply) == ERR_L7_TAG_MISSING);
    CHECK(fakes.resets == 3);
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
    CHECK(BTagFind(&status, TAG_APP_STATE, 10, 10, &tag) == ERR_OK);
    CHECK(((tag.data - (reply.message + 20)) & 3) == 2);
    CHECK(memcmp(tag.data, "\0\0\x02\0\0\0\x01\x10\0\0", 10) == 0);
    CHECK(BTagFind(&status, TAG_APP_IMAGE, 8, 8, &tag) == ERR_OK);
    CHECK(BytesGet32(tag.data) == FAKE_IMAGE_CRC && BytesGet32(tag.data + 4) == 3000);
    CHECK(BTagFind(&status, TAG_APP_EXECUTION_POSITION, 0, 99, &tag) == ERR_L7_TAG_MISSING);
    CHECK(BTagFind(&status, TAG_APP_LAST_EXCEPTION, 12, 12, &tag) == ERR_OK);
    CHECK(BytesGet32(tag.data) == RTSEXCPT_NOEXCEPTION);
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
    CHECK(BTagFind(&status, TAG_APP_EXECUTION_POSITION, 6, 6, &tag) == ERR_OK);
    CHECK(memcmp(tag.data, "\x05\0\x34\x12\0\0", 6) == 0);
    CHECK(BTagFind(&status, TAG_APP_LAST_EXCEPTION, 12, 12, &tag) == ERR_OK);
    CHECK(memcmp(tag.data, "\x02\x01\0\0\x34\x12\0\0\xFF\xFF\xFF\xFF", 12) == 0);
    fakes.status.exception.code_offset = 0xFFFFFFFF;
    CHECK(take_status(&status));
    CHECK(BTagFind(&status, TAG_APP_EXECUTION_POSITION, 0, 99, &tag) == ERR_L7_TAG_MISSING);
}

static void status_tells_what_the_stack_had_when_there_is_an_exception(void)
{
    BTAG_READER status;
    BTAG tag;

    setup();
    fakes.trace = (EXCEPT_TRACE){.count = 2, .call = {{0x1234, EXCEPT_LINK}, {0x5678, 12}}};
    CHECK(take_status(&status));
    CHECK(BTagFind(&status, TAG_APP_CALLS, 0, 99, &tag) == ERR_L7_TAG_MISSING);
    fakes.status.exception.code = RTSEXCPT_DIVIDEBYZERO;
    CHECK(take_status(&status));
    CHECK(BTagFind(&status, TAG_APP_CALLS, 16, 16, &tag) == ERR_OK);
    CHECK(memcmp(tag.data, "\x34\x12\0\0\xFF\xFF\xFF\0\x78\x56\0\0\x0C\0\0\0", 16) == 0);
}

static void status_fits_the_smallest_message_with_the_calls_it_has_room_for(void)
{
    BTAG_READER status;
    BTAG tag;

    fakes_start();
    client_init(&client, 1);
    client_send_open(&client, 1, CHANNEL_MIN_MESSAGE);
    CHECK(client_take_open(&client) == CHANNEL_OPEN_OK);
    fakes.status.exception = (APP_EXCEPTION){RTSEXCPT_DIVIDEBYZERO, 0x1234, 0};
    fakes.trace.count = EXCEPT_MAX_CALLS;
    CHECK(take_status(&status));
    CHECK(BTagFind(&status, TAG_APP_IMAGE, 8, 8, &tag) == ERR_OK);
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
    CHECK(reply_error(&reply) == ERR_APP_NOT_LOADED);
}

static void tasks_are_reported_with_their_times(void)
{
    BTAG_READER list;
    BTAG tag;

    setup();
    begin_content();
    CHECK(call(SRV_APP_READ_TASK_INFO));
    CHECK(reply.size == 20);
    fakes.task_count = 2;
    memset(fakes.tasks[1].name, 'x', sizeof(fakes.tasks[1].name)); /* without NUL */
    strcpy(fakes.tasks[0].name, "Main");
    fakes.tasks[0].kind = 0x100;
    fakes.tasks[0].interval_us = 0x102;
    fakes.tasks[0].overruns = 0x109;
    begin_content();
    CHECK(call(SRV_APP_READ_TASK_INFO));
    list = reply.tags;
    CHECK(BTagReadNext(&list, &tag) == ERR_OK);
    CHECK(tag.id == TAG_TASK_INFO && tag.size == 48);
    CHECK(BytesGet32(tag.data) == 0x100 && BytesGet32(tag.data + 8) == 0x102 && BytesGet32(tag.data + 36) == 0x109);
    CHECK(strcmp((const char *)tag.data + 40, "Main") == 0);
    CHECK(BTagReadNext(&list, &tag) == ERR_OK);
    CHECK(tag.size == 72 && strlen((const char *)tag.data + 40) == 31);
    CHECK(BTagReadNext(&list, &tag) == ERR_END_OF_OBJECT);
}

/* ---- download ---- */

enum { TOTAL = 1000, CRC = 0x55667788 };
static RTS_UI8 image[TOTAL];

/* Sends a block (data NULL: asks) and returns the result; *next is TAG_CDL_NEXT. */
static RTS_UI32 download(RTS_UI32 flags, RTS_UI32 offset, RTS_UI32 total, RTS_UI32 crc, RTS_UI32 size, RTS_UI32 *next)
{
    begin_content();
    BTagOpen(&writer, TAG_CDL_POSITION, BTAG_ALIGN_0);
    BTagAppend32(&writer, flags);
    BTagAppend32(&writer, offset);
    BTagAppend32(&writer, total);
    BTagAppend32(&writer, crc);
    BTagClose(&writer);
    BTagOpen(&writer, TAG_CDL_DATA, BTAG_ALIGN_0);
    BTagAppend(&writer, image + offset % TOTAL, size);
    BTagClose(&writer);
    CHECK(call(SRV_APP_DOWNLOAD_COMPACT));
    CHECK(reply_error(&reply) == ERR_OK);
    *next = reply_number(&reply, TAG_CDL_NEXT);
    return reply_number(&reply, TAG_SERVICE_RESULT);
}

static RTS_UI32 put(RTS_UI32 offset, RTS_UI32 size, RTS_UI32 *next)
{
    return download(offset == 0 ? 0 : DLF_CONTINUEDOWNLOAD, offset, TOTAL, CRC, size, next);
}

static RTS_UI32 ask(RTS_UI32 *next)
{
    return download(DLF_CONTINUEDOWNLOAD, 0, TOTAL, CRC, 0, next);
}

static void setup_image(void)
{
    for (RTS_UI32 i = 0; i < TOTAL; i++)
        image[i] = (RTS_UI8)(i * 31 + 7);
    setup();
}

static void image_arrives_block_by_block(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(0, 300, &next) == ERR_OK && next == 300);
    CHECK(put(300, 300, &next) == ERR_OK && next == 600);
    CHECK(fakes.download_ends == 0);
    CHECK(put(600, 400, &next) == ERR_OK && next == TOTAL);
    CHECK(fakes.download_begins == 1 && fakes.download_writes == 3 && fakes.download_ends == 1);
    CHECK(memcmp(fakes.image, image, TOTAL) == 0);
}

static void image_in_one_block_is_complete_at_once(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(download(0, 0, 200, CRC, 200, &next) == ERR_OK && next == 200);
    CHECK(fakes.download_ends == 1);
}

static void repeated_block_is_acknowledged_and_not_written(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(0, 300, &next) == ERR_OK);
    CHECK(put(300, 300, &next) == ERR_OK);
    CHECK(put(300, 300, &next) == ERR_OK && next == 600);
    CHECK(download(DLF_CONTINUEDOWNLOAD, 0, TOTAL, CRC, 300, &next) == ERR_OK && next == 600);
    CHECK(fakes.download_writes == 2);
}

static void overlapping_block_is_written_from_where_it_is_new(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(0, 300, &next) == ERR_OK);
    CHECK(put(100, 400, &next) == ERR_OK && next == 500);
    CHECK(put(500, 500, &next) == ERR_OK && next == TOTAL);
    CHECK(memcmp(fakes.image, image, TOTAL) == 0);
}

static void block_beyond_the_next_is_out_of_sequence(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(0, 300, &next) == ERR_OK);
    CHECK(put(301, 10, &next) == ERR_INVALID_SEQUENCE && next == 300);
    CHECK(put(300, 10, &next) == ERR_OK && next == 310);
}

static void block_without_beginning_is_out_of_sequence(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(300, 10, &next) == ERR_INVALID_SEQUENCE && next == 0);
    CHECK(download(DLF_CONTINUEDOWNLOAD, 0, TOTAL, CRC, 10, &next) == ERR_INVALID_SEQUENCE && next == 0);
    CHECK(fakes.download_begins == 0);
}

static void block_of_another_image_is_out_of_sequence(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(0, 300, &next) == ERR_OK);
    CHECK(download(DLF_CONTINUEDOWNLOAD, 300, TOTAL, CRC + 1, 10, &next) == ERR_INVALID_SEQUENCE && next == 0);
    CHECK(download(DLF_CONTINUEDOWNLOAD, 300, TOTAL + 1, CRC, 10, &next) == ERR_INVALID_SEQUENCE && next == 0);
    CHECK(put(300, 10, &next) == ERR_OK && next == 310);
}

static void block_outside_the_image_is_refused(void)
{
    static const RTS_UI32 wrong[][2] = {{0, 201}, {1, 200}, {200, 1}, {201, 1}, {0xFFFFFFFF, 1}, {0xFFFFFF38, 200}};
    RTS_UI32 next;

    setup_image();
    for (RTS_UI32 i = 0; i < RTS_COUNT(wrong); i++)
        CHECK(download(0, wrong[i][0], 200, CRC, wrong[i][1], &next) == ERR_OUT_OF_LIMITS);
    CHECK(fakes.download_begins == 0 && fakes.download_writes == 0);
}

static void beginning_again_starts_from_zero(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(0, 300, &next) == ERR_OK);
    CHECK(put(0, 100, &next) == ERR_OK && next == 100);
    CHECK(fakes.download_begins == 2);
}

static void image_too_large_for_the_slot_is_refused(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(download(0, 0, FAKE_IMAGE_SIZE + 1, CRC, 10, &next) == ERR_NOMEMORY && next == 0);
}

static void question_tells_how_much_has_arrived(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(ask(&next) == ERR_OK && next == 0);
    CHECK(put(0, 300, &next) == ERR_OK);
    CHECK(ask(&next) == ERR_OK && next == 300);
    CHECK(download(0, 0, TOTAL, CRC, 0, &next) == ERR_OK && next == 300);
    CHECK(download(0, 0, TOTAL, CRC + 1, 0, &next) == ERR_OK && next == 0);
    CHECK(fakes.download_begins == 1);
}

static void question_for_the_installed_image_tells_its_size(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(download(0, 0, 3000, FAKE_IMAGE_CRC, 0, &next) == ERR_OK && next == 3000);
    fakes.status.state = AS_NONE;
    CHECK(download(0, 0, 3000, FAKE_IMAGE_CRC, 0, &next) == ERR_OK && next == 0);
}

static void transfer_continues_on_a_new_channel(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(0, 300, &next) == ERR_OK);
    client_send_close(&client);
    CHECK(client_connect(&client));
    CHECK(ask(&next) == ERR_OK && next == 300);
    CHECK(put(300, 700, &next) == ERR_OK && next == TOTAL);
    CHECK(fakes.download_begins == 1 && fakes.download_ends == 1);
    CHECK(memcmp(fakes.image, image, TOTAL) == 0);
}

static void last_block_repeated_after_a_lost_reply_is_acknowledged(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(0, TOTAL, &next) == ERR_OK);
    fakes.status.image_crc = CRC; /* it is the application now */
    CHECK(ask(&next) == ERR_OK && next == TOTAL);
    CHECK(put(500, 500, &next) == ERR_OK && next == TOTAL);
    CHECK(fakes.download_begins == 1 && fakes.download_writes == 1 && fakes.download_ends == 1);
}

static void refused_image_is_reported_with_its_reason(void)
{
    RTS_UI32 next;
    BTAG reason;

    setup_image();
    fakes.end_result = ERR_TYPE_MISMATCH;
    CHECK(put(0, TOTAL, &next) == ERR_TYPE_MISMATCH && next == TOTAL);
    CHECK(BTagFind(&reply.tags, TAG_CDL_REASON, 1, 200, &reason) == ERR_OK);
    CHECK(strcmp((const char *)reason.data, "This image is for another device.") == 0);
    CHECK(ask(&next) == ERR_OK && next == 0);
}

static void long_reason_is_cut_to_the_message(void)
{
    RTS_UI32 next;
    BTAG reason;

    fakes_start();
    client_init(&client, 1);
    client_send_open(&client, 1, CHANNEL_MIN_MESSAGE);
    CHECK(client_take_open(&client) == CHANNEL_OPEN_OK && client_login(&client));
    fakes.end_result = ERR_APP_UNRESOLVED_REFERENCE;
    fakes.end_text = "This image needs functions that this runtime does not have: first, second, third, fourth, fifth, "
                     "sixth, seventh, eighth, ninth, tenth, eleventh; update the runtime.";
    CHECK(download(0, 0, 8, CRC, 8, &next) == ERR_APP_UNRESOLVED_REFERENCE && next == 8);
    CHECK(BTagFind(&reply.tags, TAG_CDL_REASON, 60, CHANNEL_MIN_MESSAGE, &reason) == ERR_OK);
    CHECK(memcmp(reason.data, fakes.end_text, 60) == 0 && reason.data[reason.size - 1] == '\0');
}

static void flash_fault_ends_the_transfer(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(0, 300, &next) == ERR_OK);
    fakes.write_result = ERR_DEVICE;
    CHECK(put(300, 300, &next) == ERR_DEVICE && next == 0);
    CHECK(put(300, 300, &next) == ERR_INVALID_SEQUENCE && next == 0);
}

static void malformed_position_is_an_error(void)
{
    setup_image();
    begin_content();
    CHECK(call(SRV_APP_DOWNLOAD_COMPACT));
    CHECK(reply_error(&reply) == ERR_L7_TAG_MISSING);
    for (RTS_UI32 size = 1; size < 20; size++) {
        if (size == sizeof(CDL_POSITION))
            continue;
        BTagOpen(begin_content(), TAG_CDL_POSITION, BTAG_ALIGN_0);
        BTagAppendZeros(&writer, size);
        BTagClose(&writer);
        CHECK(call(SRV_APP_DOWNLOAD_COMPACT));
        CHECK(reply_error(&reply) == ERR_SIZE_MISMATCH);
    }
    CHECK(fakes.download_begins == 0);
}

static void next_block_may_be_sent_before_the_reply_has_arrived(void)
{
    RTS_UI8 message[NETSERVER_MESSAGE_SIZE];
    RTS_UI8 answer[NETSERVER_MESSAGE_SIZE];

    setup_image();
    for (RTS_UI32 offset = 0; offset < TOTAL; offset += 250) {
        begin_content();
        BTagOpen(&writer, TAG_CDL_POSITION, BTAG_ALIGN_0);
        BTagAppend32(&writer, offset == 0 ? 0 : DLF_CONTINUEDOWNLOAD);
        BTagAppend32(&writer, offset);
        BTagAppend32(&writer, TOTAL);
        BTagAppend32(&writer, CRC);
        BTagClose(&writer);
        BTagOpen(&writer, TAG_CDL_DATA, BTAG_ALIGN_0);
        BTagAppend(&writer, image + offset, 250);
        BTagClose(&writer);
        RTS_UI32 size =
            client_message(&client, SG_APPLICATION, SRV_APP_DOWNLOAD_COMPACT, content, writer.size, message);
        client_send_message(&client, message, size);
    }
    for (RTS_UI32 i = 1; i <= 4; i++) {
        CHECK(client_take_message(&client, answer) != 0);
        BTagReaderInit(&reply.tags, answer + 20, BytesGet32(answer + 12));
        CHECK(reply_number(&reply, TAG_CDL_NEXT) == 250 * i);
    }
    CHECK(fakes.download_ends == 1);
    CHECK(memcmp(fakes.image, image, TOTAL) == 0);
}

static void restart_forgets_the_transfer(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(0, 300, &next) == ERR_OK);
    setup();
    CHECK(ask(&next) == ERR_OK && next == 0);
    CHECK(download(DLF_CONTINUEDOWNLOAD, 0, TOTAL, CRC, 10, &next) == ERR_INVALID_SEQUENCE);
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
    RUN(refusal_of_the_application_is_the_result);
    RUN(wrong_application_session_changes_nothing);
    RUN(reset_passes_its_option);
    RUN(status_needs_no_login_and_tells_state_and_image);
    RUN(status_tells_where_the_exception_was);
    RUN(status_tells_what_the_stack_had_when_there_is_an_exception);
    RUN(status_fits_the_smallest_message_with_the_calls_it_has_room_for);
    RUN(list_names_the_application);
    RUN(info_reports_the_strings_of_the_image);
    RUN(tasks_are_reported_with_their_times);
    RUN(image_arrives_block_by_block);
    RUN(image_in_one_block_is_complete_at_once);
    RUN(repeated_block_is_acknowledged_and_not_written);
    RUN(overlapping_block_is_written_from_where_it_is_new);
    RUN(block_beyond_the_next_is_out_of_sequence);
    RUN(block_without_beginning_is_out_of_sequence);
    RUN(block_of_another_image_is_out_of_sequence);
    RUN(block_outside_the_image_is_refused);
    RUN(beginning_again_starts_from_zero);
    RUN(image_too_large_for_the_slot_is_refused);
    RUN(question_tells_how_much_has_arrived);
    RUN(question_for_the_installed_image_tells_its_size);
    RUN(transfer_continues_on_a_new_channel);
    RUN(last_block_repeated_after_a_lost_reply_is_acknowledged);
    RUN(refused_image_is_reported_with_its_reason);
    RUN(long_reason_is_cut_to_the_message);
    RUN(flash_fault_ends_the_transfer);
    RUN(malformed_position_is_an_error);
    RUN(next_block_may_be_sent_before_the_reply_has_arrived);
    RUN(restart_forgets_the_transfer);
    return test_result();
}
