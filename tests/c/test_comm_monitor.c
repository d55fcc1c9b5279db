/*
 * test_comm_monitor.c - CmpMonitor2: which programs read, bounds, errors, consistency.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "monitor_fixture.h"

/* ---- reading ---- */

static void begin_read(void)
{
    begin_request();
    BTagOpen(&writer, TAG_MON2_READ_LIST, BTAG_ALIGN_0);
}

/* A variable with all the tags a programming system sends. */
static void add_program(RTS_UI32 id, RTS_UI32 size, const RTS_UI8 *code, RTS_UI32 code_size)
{
    BTagOpen(&writer, TAG_MON2_READ_VAR, BTAG_ALIGN_0);
    BTagWrite16(&writer, TAG_MON2_VAR_ID, id);
    BTagWrite32(&writer, TAG_MON2_VAR_SIZE, size);
    BTagWrite32(&writer, TAG_MON2_VAR_TYPE_CLASS, 7);
    BTagWrite16(&writer, TAG_MON2_VAR_CODE_SIZE, code_size);
    BTagOpen(&writer, TAG_MON2_VAR_CODE, BTAG_ALIGN_0);
    BTagAppend(&writer, code, code_size);
    BTagPad(&writer);
    BTagClose(&writer);
    BTagClose(&writer);
}

static void add_read(RTS_UI32 id, RTS_UI32 size, RTS_UI8 area, RTS_UI32 offset)
{
    RTS_UI8 code[] = {MON2_OP_LD32, 0, 0, 0, 0, MON2_OP_RAO, area};

    BytesPut32(code + 1, offset);
    add_program(id, size, code, sizeof(code));
}

static const RTS_UI8 *values;
static RTS_UI32 values_size;

static bool send_read(void)
{
    BTAG tag;

    BTagClose(&writer);
    values_size = 0;
    if (!client_call(&client, SG_MONITORING2, SRV_MON2_READ, &writer, &reply))
        return false;
    if (BTagFind(&reply.tags, TAG_MON2_VALUES, 1, NETSERVER_MESSAGE_SIZE, &tag) == ERR_OK) {
        values = tag.data;
        values_size = tag.size;
    }
    return true;
}

/* Takes the next value if it has this id and size. */
static const RTS_UI8 *take_value(RTS_UI32 id, RTS_UI32 size)
{
    const RTS_UI8 *value = values + 6;

    if (values_size < 6 || BytesGet16(values) != id || BytesGet32(values + 2) != size || size > values_size - 6)
        return NULL;
    values += 6 + size;
    values_size -= 6 + size;
    return value;
}

static bool take_failure(RTS_UI32 id, RTS_UI8 error)
{
    if (values_size < 6 || BytesGet16(values) != (id | MON2_ID_FAILED) || BytesGet32(values + 2) != error)
        return false;
    values += 6;
    values_size -= 6;
    return true;
}

/* Reads one variable by program and returns its error (0: it was read). */
static RTS_UI32 read_error(const RTS_UI8 *code, RTS_UI32 code_size, RTS_UI32 size)
{
    begin_read();
    add_program(5, size, code, code_size);
    CHECK(send_read());
    CHECK_EQUAL(reply_error(&reply), ERR_OK);
    if (take_value(5, size) != NULL)
        return 0;
    CHECK(values_size == 8 && BytesGet16(values) == (5 | MON2_ID_FAILED) && BytesGet16(values + 6) == 0);
    return BytesGet32(values + 2);
}

#define READ_ERROR(code, size) read_error((const RTS_UI8 *)(code), sizeof(code) - 1, size)

static void variables_of_all_sizes_are_read(void)
{
    const RTS_UI8 *value;

    setup();
    begin_read();
    add_read(1, 1, APP_AREA_DATA, 3);
    add_read(2, 2, APP_AREA_RETAIN, 4);
    add_read(3, 4, APP_AREA_INPUT, 8);
    add_read(4, 8, APP_AREA_OUTPUT, 16);
    add_read(5, 13, APP_AREA_MEMORY, 5);
    add_read(6, 4, APP_AREA_CODE, 1);
    CHECK(send_read());
    CHECK((value = take_value(1, 1)) != NULL && value[0] == 3);
    CHECK((value = take_value(2, 2)) != NULL && memcmp(value, fakes_area(APP_AREA_RETAIN) + 4, 2) == 0);
    CHECK((value = take_value(3, 4)) != NULL && memcmp(value, fakes_area(APP_AREA_INPUT) + 8, 4) == 0);
    CHECK((value = take_value(4, 8)) != NULL && memcmp(value, fakes_area(APP_AREA_OUTPUT) + 16, 8) == 0);
    CHECK((value = take_value(5, 13)) != NULL && memcmp(value, fakes_area(APP_AREA_MEMORY) + 5, 13) == 0);
    CHECK((value = take_value(6, 4)) != NULL && memcmp(value, fakes_area(APP_AREA_CODE) + 1, 4) == 0);
    CHECK(values_size < 4); /* padding */
}

static void every_alignment_and_size_is_read_right(void)
{
    setup();
    for (RTS_UI32 offset = 0; offset < 8; offset++) {
        for (RTS_UI32 size = 1; size <= 9; size++) {
            begin_read();
            add_read(1, size, APP_AREA_DATA, offset);
            CHECK(send_read());
            const RTS_UI8 *value = take_value(1, size);
            CHECK(value != NULL && memcmp(value, fakes_area(APP_AREA_DATA) + offset, size) == 0);
        }
    }
}

static void recognised_read_programs(void)
{
    setup();
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06\x00", 2), 0);
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06\x00\x01", 2), 0);
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06\x00\x01\x00\x00", 2), 0);
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06\x00\x00\x00", 2), 0);
    CHECK_EQUAL(READ_ERROR("\x03\x10\x00\x00\x00\x06\x00", 2), 0);
    CHECK_EQUAL(READ_ERROR("\x03\x10\x00\x00\x00\x06\x00\x01", 2), 0);
}

static void every_other_program_is_refused(void)
{
    setup();
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00", 2), MONITORING_ERR_UNSUPPORTED_OPERATOR);
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06", 2), MONITORING_ERR_INVALID_AREA);
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x07\x00", 2), MONITORING_ERR_UNSUPPORTED_OPERATOR);
    CHECK_EQUAL(READ_ERROR("\x1C\x10\x00\x06\x00", 2), MONITORING_ERR_UNSUPPORTED_OPERATOR);
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06\x00\x09\x04", 2), MONITORING_ERR_UNSUPPORTED_OPERATOR); /* Der */
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06\x00\x01\x18", 2),
                MONITORING_ERR_UNSUPPORTED_OPERATOR); /* Call after Halt */
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06\x00\x01\x01", 2), MONITORING_ERR_UNSUPPORTED_OPERATOR);
    CHECK_EQUAL(READ_ERROR("\x03\x10\x00\x00\x00", 2), MONITORING_ERR_UNSUPPORTED_OPERATOR);
    CHECK_EQUAL(READ_ERROR("\x03\x10\x00\x00\x00\x06", 2), MONITORING_ERR_INVALID_AREA);
    CHECK_EQUAL(READ_ERROR("\x18\x00\x00\x00\x00\x00\x01", 2), MONITORING_ERR_UNSUPPORTED_OPERATOR);
    CHECK_EQUAL(READ_ERROR("\x00", 2), MONITORING_ERR_UNSUPPORTED_OPERATOR);
}

static void single_bytes_of_a_program_cannot_be_changed_unnoticed(void)
{
    RTS_UI8 code[] = {MON2_OP_LD16, 0x10, 0x00, MON2_OP_RAO, 0x00, MON2_OP_HALT};

    setup();
    for (RTS_UI32 i = 0; i < sizeof(code); i++) {
        RTS_UI8 right = code[i];
        for (RTS_UI32 byte = 0; byte < 256; byte++) {
            code[i] = (RTS_UI8)byte;
            RTS_UI32 error = read_error(code, sizeof(code), 2);
            bool legal = i == 1 || i == 2 || i == 4 /* the address */ || byte == right || (i == 5 && byte == 0);
            CHECK_EQUAL((error == MONITORING_ERR_UNSUPPORTED_OPERATOR), !legal);
        }
        code[i] = right;
    }
}

static void bounds_of_the_area_are_kept(void)
{
    setup();
    begin_read();
    add_read(1, 1, APP_AREA_DATA, FAKE_AREA_SIZE - 1);
    add_read(2, 2, APP_AREA_DATA, FAKE_AREA_SIZE - 1);
    add_read(3, 1, APP_AREA_DATA, FAKE_AREA_SIZE);
    add_read(4, 0xFFFFFFFF, APP_AREA_DATA, 1);
    add_read(5, 2, APP_AREA_DATA, 0xFFFFFFFF);
    CHECK(send_read());
    CHECK(take_value(1, 1) != NULL);
    for (RTS_UI32 id = 2; id <= 5; id++)
        CHECK(take_failure(id, MONITORING_ERR_INVALID_INDEX));
}

static void unknown_areas_and_size_zero_are_refused(void)
{
    setup();
    fakes.area_size[APP_AREA_RETAIN] = 0;
    begin_read();
    add_read(1, 1, APP_AREA_COUNT, 0);
    add_read(2, 1, 0xFF, 0);
    add_read(3, 1, APP_AREA_RETAIN, 0);
    add_read(4, 0, APP_AREA_DATA, 0);
    CHECK(send_read());
    CHECK(take_failure(1, MONITORING_ERR_INVALID_AREA));
    CHECK(take_failure(2, MONITORING_ERR_INVALID_AREA));
    CHECK(take_failure(3, MONITORING_ERR_INVALID_AREA));
    CHECK(take_failure(4, MONITORING_ERR_SIZE_0));
}

static void compact_form_reads_150_variables_at_once(void)
{
    enum { COUNT = 150 };
    RTS_UI8 message[2048];
    RTS_UI32 size;
    RTS_UI8 *place = content;

    setup();
    begin_request();
    place = content + writer.size;
    BytesPut16(place, 0x0181);
    BytesPut16(place + 2, (COUNT * 13 & 0x7F) | 0x80 | COUNT * 13 >> 7 << 8);
    place += 4;
    for (RTS_UI32 i = 0; i < COUNT; i++, place += 13) {
        memcpy(place, "\x82\x01\x0A\x02\x01\x04\x05\x05\x02\x00\x00\x06\x00", 13);
        BytesPut16(place + 9, 4 * i);
    }
    size = (RTS_UI32)(place - content);
    CHECK(size + 20 <= sizeof(message));
    CHECK(client_request(&client, SG_MONITORING2, SRV_MON2_READ, content, size, &reply));
    CHECK(reply.size <= 2048);
    BTAG tag;
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_MON2_VALUES, 10 * COUNT, 10 * COUNT, &tag), ERR_OK);
    values = tag.data;
    values_size = tag.size;
    for (RTS_UI32 i = 0; i < COUNT; i++) {
        const RTS_UI8 *value = take_value(i, 4);
        CHECK(value != NULL && memcmp(value, fakes_area(APP_AREA_DATA) + 4 * i, 4) == 0);
    }
}

static void what_does_not_fit_fails_alone(void)
{
    RTS_UI32 large = FAKE_AREA_SIZE;

    fakes_start();
    client_init(&client, 1);
    client_send_open(&client, 1, 700);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    CHECK(client_login(&client) && client_login_app(&client));
    begin_read();
    add_read(1, 600, APP_AREA_DATA, 0);
    add_read(2, large, APP_AREA_DATA, 0);
    add_read(3, 4, APP_AREA_DATA, 0);
    for (RTS_UI32 id = 4; id < 12; id++)
        add_read(id, 4, APP_AREA_DATA, 0);
    CHECK(send_read());
    CHECK_EQUAL(reply_error(&reply), ERR_OK);
    CHECK(reply.size <= 700);
    CHECK(take_failure(1, MONITORING_ERR_BUFFERSIZE_EXCEEDED) || values_size > 600);
}

static void large_value_leaves_room_for_the_answers_after_it(void)
{
    RTS_UI32 failures = 0;

    fakes_start();
    client_init(&client, 1);
    client_send_open(&client, 1, 700);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    CHECK(client_login(&client) && client_login_app(&client));
    for (RTS_UI32 size = 560; size < 700; size++) {
        begin_read();
        add_read(1, size, APP_AREA_DATA, 0);
        for (RTS_UI32 id = 2; id < 9; id++)
            add_read(id, 8, APP_AREA_DATA, 0);
        CHECK(send_read());
        CHECK(reply_error(&reply) == ERR_OK && reply.size <= 700);
        if (take_value(1, size) == NULL)
            CHECK(take_failure(1, MONITORING_ERR_BUFFERSIZE_EXCEEDED));
        for (RTS_UI32 id = 2; id < 9; id++) {
            if (take_value(id, 8) != NULL)
                continue;
            CHECK(take_failure(id, MONITORING_ERR_BUFFERSIZE_EXCEEDED));
            failures++;
        }
        CHECK(values_size < 4); /* padding */
    }
    CHECK(failures > 0);
}

static void empty_list_has_no_values(void)
{
    setup();
    begin_request();
    BTagAppend(&writer, "\x81\x01\x00", 3);
    CHECK(client_call(&client, SG_MONITORING2, SRV_MON2_READ, &writer, &reply));
    BTAG tag;
    CHECK_EQUAL(reply_error(&reply), ERR_OK);
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_MON2_VALUES, 0, NETSERVER_MESSAGE_SIZE, &tag), ERR_L7_TAG_MISSING);
}

static void mask_is_for_writing_only(void)
{
    setup();
    CHECK_EQUAL(READ_ERROR("\x02\x05\x00\x06\x00\x40\x01", 1), MONITORING_ERR_UNSUPPORTED_OPERATOR);
}

/* ---- pointers ---- */

/* What reading 2 bytes through the pointer at POINTER_AT of the data area ends with. */
static RTS_UI32 read_behind(uintptr_t pointer)
{
    setup();
    put_pointer(APP_AREA_DATA, POINTER_AT, pointer);
    return READ_ERROR("\x02\x10\x00\x06\x00\x09\x08\x02\x04\x00\x0E", 2);
}

static void pointers_are_followed_into_every_area(void)
{
    for (RTS_UI32 area = 0; area < APP_AREA_COUNT; area++) {
        CHECK_EQUAL(read_behind((uintptr_t)fakes_area(area) + TARGET_AT), 0);
        CHECK(memcmp(values - 2, fakes_area(area) + TARGET_AT + 4, 2) == 0);
    }
}

static void pointers_to_pointers_are_followed(void)
{
    setup();
    put_pointer(APP_AREA_DATA, POINTER_AT, (uintptr_t)fakes_area(APP_AREA_MEMORY) + TARGET_AT);
    put_pointer(APP_AREA_MEMORY, TARGET_AT + 8, (uintptr_t)fakes_area(APP_AREA_RETAIN));
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06\x00\x09\x08\x02\x08\x00\x0E\x09\x08\x03\x30\x00\x00\x00\x0E\x01", 2), 0);
    CHECK(memcmp(values - 2, fakes_area(APP_AREA_RETAIN) + 0x30, 2) == 0);
}

static void pointers_that_lead_outside_are_refused(void)
{
    RTS_UI32 outside = 0;

    CHECK_EQUAL(read_behind(0), MONITORING_ERR_INVALID_POINTER);
    CHECK_EQUAL(read_behind((uintptr_t)&outside), MONITORING_ERR_INVALID_POINTER);
    CHECK_EQUAL(read_behind((uintptr_t)&fakes), MONITORING_ERR_INVALID_POINTER);
    CHECK_EQUAL(read_behind(UINTPTR_MAX), MONITORING_ERR_INVALID_POINTER);
    CHECK_EQUAL(read_behind((uintptr_t)fakes_area(0) - 1), MONITORING_ERR_INVALID_POINTER);
    CHECK_EQUAL(read_behind((uintptr_t)fakes_area(APP_AREA_COUNT - 1) + FAKE_AREA_SIZE),
                MONITORING_ERR_INVALID_POINTER);
}

static void what_a_pointer_leads_to_ends_with_its_area(void)
{
    CHECK_EQUAL(read_behind((uintptr_t)fakes_area(APP_AREA_DATA) + FAKE_AREA_SIZE - 6), 0);
    CHECK_EQUAL(read_behind((uintptr_t)fakes_area(APP_AREA_DATA) + FAKE_AREA_SIZE - 5), MONITORING_ERR_INVALID_INDEX);
    CHECK_EQUAL(read_behind((uintptr_t)fakes_area(APP_AREA_DATA) + FAKE_AREA_SIZE - 1), MONITORING_ERR_INVALID_INDEX);
    setup();
    put_pointer(APP_AREA_DATA, POINTER_AT, (uintptr_t)fakes_area(APP_AREA_MEMORY) + TARGET_AT);
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06\x00\x09\x08\x03\x00\x00\x00\x80\x0E", 2), MONITORING_ERR_INVALID_INDEX);
}

static void pointer_itself_must_lie_in_an_area(void)
{
    setup();
    CHECK_EQUAL(READ_ERROR("\x02\xF9\x03\x06\x00\x09\x08\x02\x00\x00\x0E", 2), MONITORING_ERR_INVALID_INDEX);
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06\x06\x09\x08\x02\x00\x00\x0E", 2), MONITORING_ERR_INVALID_AREA);
    CHECK_EQUAL(READ_ERROR("\x02\x10\x00\x06\x09\x08\x02\x00\x00\x0E", 2), MONITORING_ERR_UNSUPPORTED_OPERATOR);
}

static void every_other_step_is_refused(void)
{
    RTS_UI8 code[] = {MON2_OP_LD16,      POINTER_AT,   0, MON2_OP_RAO, 0,          MON2_OP_DER,
                      MON2_POINTER_SIZE, MON2_OP_LD16, 4, 0,           MON2_OP_ADD};

    setup();
    put_pointer(APP_AREA_DATA, POINTER_AT, (uintptr_t)fakes_area(APP_AREA_MEMORY) + TARGET_AT);
    for (RTS_UI32 i = 5; i < sizeof(code); i++) {
        RTS_UI8 right = code[i];
        for (RTS_UI32 byte = 0; byte < 256; byte++) {
            code[i] = (RTS_UI8)byte;
            bool legal = i == 8 || i == 9 /* the offset */ || byte == right;
            CHECK_EQUAL((read_error(code, sizeof(code), 2) == MONITORING_ERR_UNSUPPORTED_OPERATOR), !legal);
        }
        code[i] = right;
    }
    for (RTS_UI32 size = 6; size < sizeof(code); size++)
        CHECK_EQUAL(read_error(code, size, 2), MONITORING_ERR_UNSUPPORTED_OPERATOR);
    CHECK_EQUAL(read_error(code, sizeof(code), 2), 0);
}

/* ---- consistency ---- */

static bool read_says_consistent(void)
{
    BTAG tag;

    begin_read();
    add_read(1, 4, APP_AREA_DATA, 0);
    CHECK(send_read());
    CHECK(take_value(1, 4) != NULL);
    return BTagFind(&reply.tags, TAG_MON2_CONSISTENT, 2, 2, &tag) == ERR_OK;
}

static void values_are_consistent_when_no_task_ran_meanwhile(void)
{
    setup();
    CHECK(read_says_consistent());
    fakes.task_activity = 77;
    CHECK(read_says_consistent());
}

static void values_are_not_consistent_when_a_task_ran_meanwhile(void)
{
    setup();
    fakes.task_busy = true;
    CHECK(!read_says_consistent());
    fakes.task_busy = false;
    fakes.activity_per_look = 2;
    CHECK(!read_says_consistent());
}

static void malformed_variables_fail_the_request(void)
{
    static const RTS_UI8 code[] = {MON2_OP_LD16, 0, 0, MON2_OP_RAO, 0};

    setup();
    begin_read();
    BTagOpen(&writer, TAG_MON2_READ_VAR, BTAG_ALIGN_0);
    BTagWrite32(&writer, TAG_MON2_VAR_SIZE, 4);
    BTagClose(&writer);
    CHECK(send_read());
    CHECK_EQUAL(reply_error(&reply), ERR_L7_TAG_MISSING);
    begin_read();
    add_program(MON2_ID_FAILED, 1, code, sizeof(code));
    CHECK(send_read());
    CHECK_EQUAL(reply_error(&reply), ERR_PARAMETER);
    begin_read();
    BTagOpen(&writer, TAG_MON2_READ_VAR, BTAG_ALIGN_0);
    BTagWrite32(&writer, TAG_MON2_VAR_SIZE, 4);
    BTagWrite16(&writer, TAG_MON2_VAR_CODE_SIZE, 6);
    BTagOpen(&writer, TAG_MON2_VAR_CODE, BTAG_ALIGN_0);
    BTagAppend(&writer, code, sizeof(code));
    BTagClose(&writer);
    BTagClose(&writer);
    CHECK(send_read());
    CHECK_EQUAL(reply_error(&reply), ERR_PARAMETER);
    begin_request();
    BTagAppend(&writer, "\x81\x01\x05\x82\x01\x09", 6);
    CHECK(client_call(&client, SG_MONITORING2, SRV_MON2_READ, &writer, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_BTAG_BUFFEROVERRUN);
    begin_request();
    CHECK(client_call(&client, SG_MONITORING2, SRV_MON2_READ, &writer, &reply));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_TAG_MISSING);
}

/* ---- which application ---- */

static RTS_UI32 error_for(RTS_UI32 session, RTS_UI32 data_id)
{
    BTagWriterInit(&writer, content, sizeof(content) - 20);
    BTagOpen(&writer, TAG_MON2_APPLICATION, BTAG_ALIGN_0);
    BTagAppend32(&writer, session);
    BTagAppend32(&writer, data_id);
    BTagAppendZeros(&writer, 12);
    BTagClose(&writer);
    BTagOpen(&writer, TAG_MON2_READ_LIST, BTAG_ALIGN_0);
    add_read(1, 1, APP_AREA_DATA, 0);
    CHECK(send_read());
    CHECK_EQUAL(reply_error(&reply), ERR_OK);
    return values_size != 0 ? ERR_OK : reply_number(&reply, TAG_MON2_ERROR);
}

static void application_header_is_checked(void)
{
    setup();
    CHECK_EQUAL(error_for(client.app_session, FAKE_IMAGE_CRC), ERR_OK);
    CHECK_EQUAL(error_for(client.app_session ^ 2, FAKE_IMAGE_CRC), ERR_APP_INVALID_SESSIONID);
    CHECK_EQUAL(error_for(0, FAKE_IMAGE_CRC), ERR_APP_INVALID_SESSIONID);
    CHECK_EQUAL(error_for(client.app_session, FAKE_IMAGE_CRC + 1), ERR_APP_INVALID_DATAID);
    SrvEndAppSession(ChannelGetClient(0));
    CHECK_EQUAL(error_for(0, FAKE_IMAGE_CRC), ERR_APP_INVALID_SESSIONID);
    fakes.status.state = AS_NONE;
    CHECK_EQUAL(error_for(client.app_session, FAKE_IMAGE_CRC), ERR_APP_NOT_LOADED);
}

int main(void)
{
    RUN(variables_of_all_sizes_are_read);
    RUN(every_alignment_and_size_is_read_right);
    RUN(recognised_read_programs);
    RUN(every_other_program_is_refused);
    RUN(single_bytes_of_a_program_cannot_be_changed_unnoticed);
    RUN(mask_is_for_writing_only);
    RUN(bounds_of_the_area_are_kept);
    RUN(unknown_areas_and_size_zero_are_refused);
    RUN(compact_form_reads_150_variables_at_once);
    RUN(what_does_not_fit_fails_alone);
    RUN(large_value_leaves_room_for_the_answers_after_it);
    RUN(empty_list_has_no_values);
    RUN(pointers_are_followed_into_every_area);
    RUN(pointers_to_pointers_are_followed);
    RUN(pointers_that_lead_outside_are_refused);
    RUN(what_a_pointer_leads_to_ends_with_its_area);
    RUN(pointer_itself_must_lie_in_an_area);
    RUN(every_other_step_is_refused);
    RUN(values_are_consistent_when_no_task_ran_meanwhile);
    RUN(values_are_not_consistent_when_a_task_ran_meanwhile);
    RUN(malformed_variables_fail_the_request);
    RUN(application_header_is_checked);
    return test_result();
}
