/*
 * test_comm_monitor_write.c - CmpMonitor2: which programs write, single bits, atomic writing.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "monitor_fixture.h"

/* ---- writing ---- */

static void begin_write(void)
{
    begin_request();
    BTagOpen(&writer, TAG_MON2_WRITE_LIST, BTAG_ALIGN_0);
}

static void add_write_program(RTS_UI32 size, const RTS_UI8 *value, const RTS_UI8 *code, RTS_UI32 code_size)
{
    BTagAppend16(&writer, 0);
    BTagAppend32(&writer, size);
    BTagAppend(&writer, value, size);
    BTagAppend16(&writer, code_size);
    BTagAppend(&writer, code, code_size);
}

static void add_write(RTS_UI32 size, const void *value, RTS_UI8 area, RTS_UI32 offset)
{
    RTS_UI8 code[] = {MON2_OP_LD16, 0, 0, MON2_OP_RAO, area};

    BytesPut16(code + 1, offset);
    add_write_program(size, value, code, sizeof(code));
}

/* Sends; returns TAG_ERROR, or TAG_MON2_ERROR, or ERR_OK when the reply is empty. */
static RTS_UI32 send_write(void)
{
    BTagClose(&writer);
    CHECK(client_call(&client, SG_MONITORING2, SRV_MON2_WRITE, &writer, &reply));
    if (reply.size == 20)
        return ERR_OK;
    return reply_error(&reply) != ERR_OK ? reply_error(&reply) : reply_number(&reply, TAG_MON2_ERROR);
}

static RTS_UI32 write_program(const RTS_UI8 *code, RTS_UI32 code_size)
{
    begin_write();
    add_write_program(2, (const RTS_UI8 *)"\xAA\xBB", code, code_size);
    return send_write();
}

#define WRITE_PROGRAM(code) write_program((const RTS_UI8 *)(code), sizeof(code) - 1)

static void variables_of_all_sizes_and_alignments_are_written(void)
{
    static const RTS_UI8 value[] = {0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA6, 0xA7, 0xA8, 0xA9};

    for (RTS_UI32 offset = 8; offset < 16; offset++) {
        for (RTS_UI32 size = 1; size <= sizeof(value); size++) {
            setup();
            begin_write();
            add_write(size, value, APP_AREA_DATA, offset);
            CHECK_EQUAL(send_write(), ERR_OK);
            CHECK(memcmp(fakes_area(APP_AREA_DATA) + offset, value, size) == 0);
            CHECK_EQUAL(fakes_area(APP_AREA_DATA)[offset - 1], offset - 1);
            CHECK_EQUAL(fakes_area(APP_AREA_DATA)[offset + size], offset + size);
        }
    }
}

static void several_variables_are_written_by_one_request(void)
{
    setup();
    begin_write();
    add_write(1, "\xA1", APP_AREA_RETAIN, 1);
    add_write(2, "\xA2\xA3", APP_AREA_INPUT, 2);
    add_write(4, "\xA4\xA5\xA6\xA7", APP_AREA_OUTPUT, 4);
    add_write(3, "\xA8\xA9\xAA", APP_AREA_MEMORY, 0);
    BTagPad(&writer);
    CHECK_EQUAL(send_write(), ERR_OK);
    CHECK_EQUAL(fakes_area(APP_AREA_RETAIN)[1], 0xA1);
    CHECK(memcmp(fakes_area(APP_AREA_INPUT) + 2, "\xA2\xA3", 2) == 0);
    CHECK(memcmp(fakes_area(APP_AREA_OUTPUT) + 4, "\xA4\xA5\xA6\xA7", 4) == 0);
    CHECK(memcmp(fakes_area(APP_AREA_MEMORY), "\xA8\xA9\xAA", 3) == 0);
}

static void program_of_the_programming_system_is_recognised(void)
{
    setup();
    CHECK_EQUAL(WRITE_PROGRAM("\x15\x0C\x00\x02\x10\x00\x06\x00\x17\x0C\x09\x04\x1B\x06\x00\x01\x00\x00\x17\x04\x09\x04"
                              "\x17\x08\x09\x04\x04"),
                ERR_OK);
    CHECK(memcmp(fakes_area(APP_AREA_DATA) + 0x10, "\xAA\xBB", 2) == 0);
    CHECK_EQUAL(WRITE_PROGRAM("\x15\x0C\x00\x03\x20\x00\x00\x00\x06\x00\x17\x0C\x09\x04\x1B\x06\x00\x01\x00\x00"
                              "\x17\x04\x09\x04\x17\x08\x09\x04\x04\x01"),
                ERR_OK);
    CHECK(memcmp(fakes_area(APP_AREA_DATA) + 0x20, "\xAA\xBB", 2) == 0);
}

static void that_of_64_bit_systems_is_recognised(void)
{
    setup();
    CHECK_EQUAL(WRITE_PROGRAM("\x15\x10\x00\x02\x10\x00\x06\x00\x17\x10\x09\x04\x1B\x06\x00\x01\x00\x00\x17\x08\x09\x08"
                              "\x17\x0C\x09\x04\x04"),
                ERR_OK);
    CHECK(memcmp(fakes_area(APP_AREA_DATA) + 0x10, "\xAA\xBB", 2) == 0);
    CHECK_EQUAL(WRITE_PROGRAM("\x15\x10\x00\x02\x20\x00\x06\x00\x17\x0C\x09\x04\x1B\x06\x00\x01\x00\x00\x17\x04\x09\x04"
                              "\x17\x08\x09\x04\x04"), /* the head of one, the tail of the other */
                MONITORING_ERR_UNSUPPORTED_OPERATOR);
    CHECK(memcmp(fakes_area(APP_AREA_DATA) + 0x20, "\x20\x21", 2) == 0);
}

static void every_other_write_program_is_refused(void)
{
    RTS_UI8 code[] = {0x15, 0x0C, 0x00, 0x02, 0x10, 0x00, 0x06, 0x00, 0x17, 0x0C, 0x09, 0x04, 0x1B, 0x06,
                      0x00, 0x01, 0x00, 0x00, 0x17, 0x04, 0x09, 0x04, 0x17, 0x08, 0x09, 0x04, 0x04};

    setup();
    for (RTS_UI32 i = 0; i < sizeof(code); i++) {
        if (i == 4 || i == 5 || i == 7) /* the address */
            continue;
        for (RTS_UI32 bit = 0; bit < 8; bit++) {
            code[i] ^= (RTS_UI8)(1u << bit);
            CHECK_EQUAL(write_program(code, sizeof(code)), MONITORING_ERR_UNSUPPORTED_OPERATOR);
            code[i] ^= (RTS_UI8)(1u << bit);
        }
    }
    for (RTS_UI32 size = 0; size < sizeof(code); size++)
        CHECK_EQUAL(write_program(code, size), MONITORING_ERR_UNSUPPORTED_OPERATOR);
    CHECK(memcmp(fakes_area(APP_AREA_DATA) + 0x10, "\x10\x11", 2) == 0);
    CHECK_EQUAL(write_program(code, sizeof(code)), ERR_OK);
}

/* ---- writing bits ---- */

static void add_write_bits(RTS_UI32 size, RTS_UI8 value, RTS_UI8 area, RTS_UI8 offset, RTS_UI8 mask)
{
    RTS_UI8 code[] = {MON2_OP_LD16, offset, 0, MON2_OP_RAO, area, MON2_OP_MASK, mask};

    add_write_program(size, (const RTS_UI8[]){value, value}, code, sizeof(code));
}

static void every_bit_is_written_and_no_other_changes(void)
{
    static const RTS_UI8 areas[] = {APP_AREA_DATA, APP_AREA_RETAIN, APP_AREA_INPUT, APP_AREA_OUTPUT, APP_AREA_MEMORY};

    for (RTS_UI32 test = 0; test < RTS_COUNT(areas) * 8 * 2; test++) {
        RTS_UI8 area = areas[test % RTS_COUNT(areas)];
        RTS_UI8 mask = (RTS_UI8)(1u << test / RTS_COUNT(areas) % 8);
        RTS_UI8 before = test & 1 ? 0xA5 : 0x5A;
        for (RTS_UI32 on = 0; on < 2; on++) {
            setup();
            fakes_area(area)[5] = before;
            begin_write();
            add_write_bits(1, on ? 0xFF : 0x00, area, 5, mask);
            CHECK_EQUAL(send_write(), ERR_OK);
            CHECK_EQUAL(fakes_area(area)[5], (on ? before | mask : before & ~mask));
            CHECK(fakes_area(area)[4] == 4 + 16 * area && fakes_area(area)[6] == 6 + 16 * area);
        }
    }
}

static void bits_are_written_through_pointers(void)
{
    setup();
    put_pointer(APP_AREA_DATA, POINTER_AT, (uintptr_t)fakes_area(APP_AREA_MEMORY) + TARGET_AT);
    begin_write();
    add_write_program(1, (const RTS_UI8 *)"\xFF",
                      (const RTS_UI8 *)"\x02\x10\x00\x06\x00\x09\x08\x02\x04\x00\x0E\x40\x80", 13);
    CHECK_EQUAL(send_write(), ERR_OK);
    CHECK_EQUAL(fakes_area(APP_AREA_MEMORY)[TARGET_AT + 4], (0x80 | (TARGET_AT + 4 + 16 * APP_AREA_MEMORY)));
}

static void bits_are_those_of_one_byte_of_what_may_be_written(void)
{
    setup();
    begin_write();
    add_write_bits(2, 0xFF, APP_AREA_DATA, 5, 0x01);
    CHECK_EQUAL(send_write(), ERR_OK);
    CHECK(fakes_area(APP_AREA_DATA)[5] == 5 && fakes_area(APP_AREA_DATA)[6] == 6);
    CHECK_EQUAL(WRITE_PROGRAM("\x02\x05\x00\x06\x00\x40"), MONITORING_ERR_UNSUPPORTED_OPERATOR);
    CHECK_EQUAL(WRITE_PROGRAM("\x02\x05\x00\x06\x00\x40\x01\x01\x01"), MONITORING_ERR_UNSUPPORTED_OPERATOR);
    begin_write();
    add_write_bits(1, 0xFF, APP_AREA_CODE, 5, 0x01);
    CHECK_EQUAL(send_write(), MONITORING_ERR_OPERATION_DENIED);
    CHECK(fakes_area(APP_AREA_DATA)[5] == 5 && fakes_area(APP_AREA_CODE)[5] == 0x55);
}

/* Tasks do not have to wait for what is long. */
static void what_is_written_in_one_step(void)
{
    static const RTS_UI8 value[MON2_ONE_STEP_SIZE + 1];

    for (RTS_UI32 size = 1; size <= sizeof(value); size++) {
        setup();
        fakes.locks = 0;
        begin_write();
        add_write(size, value, APP_AREA_INPUT, 0);
        CHECK_EQUAL(send_write(), ERR_OK);
        CHECK(fakes.locks == (size <= MON2_ONE_STEP_SIZE) && fakes.lock_depth == 0);
    }
}

static void code_cannot_be_written(void)
{
    setup();
    begin_write();
    add_write(1, "\xEE", APP_AREA_CODE, 0);
    CHECK_EQUAL(send_write(), MONITORING_ERR_OPERATION_DENIED);
    CHECK_EQUAL(fakes_area(APP_AREA_CODE)[0], 0x50);
}

static void variables_are_written_through_pointers(void)
{
    setup();
    put_pointer(APP_AREA_DATA, POINTER_AT, (uintptr_t)fakes_area(APP_AREA_MEMORY) + TARGET_AT);
    CHECK_EQUAL(WRITE_PROGRAM("\x02\x10\x00\x06\x00\x09\x08\x02\x04\x00\x0E"), ERR_OK);
    CHECK(memcmp(fakes_area(APP_AREA_MEMORY) + TARGET_AT + 4, "\xAA\xBB", 2) == 0);
    put_pointer(APP_AREA_DATA, POINTER_AT, 0);
    CHECK_EQUAL(WRITE_PROGRAM("\x02\x10\x00\x06\x00\x09\x08\x02\x04\x00\x0E"), MONITORING_ERR_INVALID_POINTER);
    put_pointer(APP_AREA_DATA, POINTER_AT, (uintptr_t)fakes_area(APP_AREA_CODE));
    CHECK_EQUAL(WRITE_PROGRAM("\x02\x10\x00\x06\x00\x09\x08\x02\x04\x00\x0E"), MONITORING_ERR_OPERATION_DENIED);
    CHECK_EQUAL(fakes_area(APP_AREA_CODE)[4], 0x54);
}

static void one_bad_entry_leaves_everything_unwritten(void)
{
    setup();
    begin_write();
    add_write(1, "\xA1", APP_AREA_DATA, 1);
    add_write(1, "\xA2", APP_AREA_DATA, 2);
    add_write(4, "\xA3\xA4\xA5\xA6", APP_AREA_DATA, FAKE_AREA_SIZE - 3);
    add_write(1, "\xA7", APP_AREA_DATA, 3);
    CHECK_EQUAL(send_write(), MONITORING_ERR_INVALID_INDEX);
    CHECK_EQUAL(reply_number(&reply, TAG_MON2_ERROR_INDEX), 2);
    CHECK(memcmp(fakes_area(APP_AREA_DATA), "\0\1\2\3", 4) == 0);
}

static void size_zero_is_refused(void)
{
    setup();
    begin_write();
    add_write(0, "", APP_AREA_DATA, 1);
    CHECK_EQUAL(send_write(), MONITORING_ERR_SIZE_0);
}

static void cut_entries_are_refused_and_nothing_is_written(void)
{
    RTS_UI8 entry[16] = {0, 0, 2, 0, 0, 0, 0xAA, 0xBB, 5, 0, MON2_OP_LD16, 0x10, 0, MON2_OP_RAO, 0};

    setup();
    for (RTS_UI32 size = 1; size < 15; size++) {
        begin_write();
        BTagAppend(&writer, entry, size);
        /* Up to three zeros are padding. */
        CHECK_EQUAL(send_write(), (size < 3 ? ERR_OK : ERR_L7_INCOMPLETE));
    }
    BytesPut32(entry + 2, 0xFFFFFFFF);
    begin_write();
    BTagAppend(&writer, entry, sizeof(entry));
    CHECK_EQUAL(send_write(), ERR_L7_INCOMPLETE);
    BytesPut32(entry + 2, 9);
    begin_write();
    BTagAppend(&writer, entry, sizeof(entry));
    CHECK_EQUAL(send_write(), ERR_L7_INCOMPLETE);
    CHECK(memcmp(fakes_area(APP_AREA_DATA) + 0x10, "\x10\x11", 2) == 0);
}

static void writing_needs_the_right_application(void)
{
    setup();
    client.app_session ^= 2;
    begin_write();
    add_write(1, "\xA1", APP_AREA_DATA, 1);
    CHECK_EQUAL(send_write(), ERR_APP_INVALID_SESSIONID);
    CHECK_EQUAL(fakes_area(APP_AREA_DATA)[1], 1);
}

int main(void)
{
    RUN(variables_of_all_sizes_and_alignments_are_written);
    RUN(several_variables_are_written_by_one_request);
    RUN(program_of_the_programming_system_is_recognised);
    RUN(that_of_64_bit_systems_is_recognised);
    RUN(every_other_write_program_is_refused);
    RUN(every_bit_is_written_and_no_other_changes);
    RUN(bits_are_written_through_pointers);
    RUN(bits_are_those_of_one_byte_of_what_may_be_written);
    RUN(what_is_written_in_one_step);
    RUN(code_cannot_be_written);
    RUN(variables_are_written_through_pointers);
    RUN(one_bad_entry_leaves_everything_unwritten);
    RUN(size_zero_is_refused);
    RUN(cut_entries_are_refused_and_nothing_is_written);
    RUN(writing_needs_the_right_application);
    return test_result();
}
