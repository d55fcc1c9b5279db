/*
 * test_comm_bintag.c - CmpBinTagUtil: elements read from hostile bytes and written for picky readers.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <stdlib.h>
#include <string.h>

#include "CmpBinTagUtil.h"
#include "test.h"

#define READER(reader, bytes) BTagReaderInit(reader, (const RTS_UI8 *)(bytes), sizeof(bytes) - 1)

/* ---- reader ---- */

static void samples_of_the_specification_are_read(void)
{
    BTAG_READER reader;
    BTAG tag;

    READER(&reader, "\x01\x8C\x80\x00"
                    "abcdefghijkl"
                    "\x0A\x92\x80\x80\x80\x00"
                    "abcdefghijklmnopqr"
                    "\x82\xFF\x03\x04"
                    "wxyz");
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(tag.id == 0x01 && tag.size == 12);
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(tag.id == 0x0A && tag.size == 18);
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(tag.id == 0xFF82 && tag.size == 4);
    CHECK(memcmp(tag.data, "wxyz", 4) == 0);
    CHECK(BTagReadNext(&reader, &tag) == ERR_END_OF_OBJECT);
}

static void container_with_an_eight_byte_head_is_read(void)
{
    static RTS_UI8 data[8 + 32] = {0x82, 0x01, 0xA0, 0x80, 0x80, 0x80, 0x80, 0x00};
    BTAG_READER reader;
    BTAG tag;

    BTagReaderInit(&reader, data, sizeof(data));
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(tag.id == 0x82 && tag.size == 32 && tag.data == data + 8);
}

static void length_of_264_takes_two_bytes(void)
{
    static RTS_UI8 data[4 + 264] = {0x81, 0x01, 0x88, 0x02};
    BTAG_READER reader;
    BTAG tag;

    BTagReaderInit(&reader, data, sizeof(data));
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(tag.id == 0x81 && tag.size == 264);
}

static void elements_need_no_alignment(void)
{
    RTS_UI32 value = 0;
    BTAG_READER reader;

    READER(&reader, "\x22\x02\x01\x00\x05\x01\x07\x06\x04\x78\x56\x34\x12");
    CHECK(BTagFindUnsigned(&reader, 0x22, &value) == ERR_OK && value == 1);
    CHECK(BTagFindUnsigned(&reader, 0x05, &value) == ERR_OK && value == 7);
    CHECK(BTagFindUnsigned(&reader, 0x06, &value) == ERR_OK && value == 0x12345678);
}

static void over_long_numbers_are_read_up_to_ten_bytes(void)
{
    BTAG_READER reader;
    BTAG tag;

    READER(&reader, "\x90\x80\x80\x80\x80\x80\x80\x80\x80\x00\x81\x80\x80\x80\x80\x80\x80\x80\x80\x00x");
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(tag.id == 0x10 && tag.size == 1);
    READER(&reader, "\x90\x80\x80\x80\x80\x80\x80\x80\x80\x80\x00\x01x");
    CHECK(BTagReadNext(&reader, &tag) == ERR_BTAG_BUFFEROVERRUN);
}

static void numbers_beyond_32_bits_are_refused(void)
{
    BTAG_READER reader;
    BTAG tag;

    READER(&reader, "\xFF\xFF\xFF\xFF\x0F\x00");
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(tag.id == 0xFFFFFFFF);
    READER(&reader, "\xFF\xFF\xFF\xFF\x1F\x00");
    CHECK(BTagReadNext(&reader, &tag) == ERR_BTAG_BUFFEROVERRUN);
    READER(&reader, "\x01\x81\x80\x80\x80\x80\x01x");
    CHECK(BTagReadNext(&reader, &tag) == ERR_BTAG_BUFFEROVERRUN);
}

static void length_beyond_the_rest_is_refused(void)
{
    BTAG_READER reader;
    BTAG tag;

    READER(&reader, "\x01\x04"
                    "abc");
    CHECK(BTagReadNext(&reader, &tag) == ERR_BTAG_BUFFEROVERRUN);
    READER(&reader, "\x01\xFF\xFF\xFF\xFF\x0F"
                    "abc");
    CHECK(BTagReadNext(&reader, &tag) == ERR_BTAG_BUFFEROVERRUN);
}

static void every_cut_element_is_refused(void)
{
    static const RTS_UI8 data[] = {0x82, 0x01, 0xA0, 0x80, 0x00};

    for (RTS_UI32 size = 1; size < sizeof(data); size++) {
        RTS_UI8 *copy = malloc(size);
        BTAG_READER reader;
        BTAG tag;
        memcpy(copy, data, size);
        BTagReaderInit(&reader, copy, size);
        CHECK(BTagReadNext(&reader, &tag) == ERR_BTAG_BUFFEROVERRUN);
        free(copy);
    }
}

static void element_without_a_length_is_refused(void)
{
    BTAG_READER reader;
    BTAG tag;

    READER(&reader, "\x90\x80\x80\x00"); /* what a real client sends for an empty user name */
    CHECK(BTagReadNext(&reader, &tag) == ERR_BTAG_BUFFEROVERRUN);
}

static void element_of_length_zero_is_legal(void)
{
    BTAG_READER reader;
    BTAG tag;

    READER(&reader, "\x01\x00\x02\x01x");
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(tag.size == 0);
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(tag.id == 2);
}

static void missing_element_is_distinguished_from_one_of_wrong_size(void)
{
    BTAG_READER reader;
    BTAG tag;

    READER(&reader, "\x01\x03"
                    "abc");
    CHECK(BTagFind(&reader, 2, 0, 100, &tag) == ERR_L7_TAG_MISSING);
    CHECK(BTagFind(&reader, 1, 4, 100, &tag) == ERR_SIZE_MISMATCH);
    CHECK(BTagFind(&reader, 1, 0, 2, &tag) == ERR_SIZE_MISMATCH);
    CHECK(BTagFind(&reader, 1, 3, 3, &tag) == ERR_OK);
}

static void integers_have_one_two_or_four_bytes(void)
{
    RTS_UI32 value = 5;
    BTAG_READER reader;

    READER(&reader, "\x01\x03"
                    "abc"
                    "\x02\x08"
                    "abcdefgh"
                    "\x03\x00");
    CHECK(BTagFindUnsigned(&reader, 1, &value) == ERR_SIZE_MISMATCH);
    CHECK(BTagFindUnsigned(&reader, 2, &value) == ERR_SIZE_MISMATCH);
    CHECK(BTagFindUnsigned(&reader, 3, &value) == ERR_SIZE_MISMATCH);
    CHECK(value == 5);
}

static void optional_integer_keeps_its_default_when_absent(void)
{
    RTS_UI32 value = 5;
    BTAG_READER reader;

    READER(&reader, "\x01\x03"
                    "abc");
    CHECK(BTagFindOptional(&reader, 9, &value) == ERR_OK && value == 5);
    CHECK(BTagFindOptional(&reader, 1, &value) == ERR_SIZE_MISMATCH);
}

static void find_begins_at_the_start_wherever_the_reader_stands(void)
{
    BTAG_READER reader;
    BTAG tag;

    READER(&reader, "\x01\x01"
                    "a"
                    "\x02\x01"
                    "b");
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(BTagFind(&reader, 1, 1, 1, &tag) == ERR_OK);
    CHECK(tag.data[0] == 'a');
}

static void find_stops_at_a_broken_element(void)
{
    BTAG_READER reader;
    BTAG tag;

    READER(&reader, "\x01\x01"
                    "a"
                    "\x02\x09"
                    "b");
    CHECK(BTagFind(&reader, 1, 1, 1, &tag) == ERR_OK);
    CHECK(BTagFind(&reader, 3, 1, 1, &tag) == ERR_BTAG_BUFFEROVERRUN);
}

static void data_element_is_no_container(void)
{
    BTAG_READER reader;
    BTAG_READER content;
    BTAG tag;

    READER(&reader, "\x7F\x01"
                    "a"
                    "\xFF\xFE\x03\x00"
                    "\x82\xFF\x03\x00");
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(BTagReadContainer(&reader, &tag, &content) == ERR_BTAG_NOCONTAINERTAG);
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(tag.id == 0xFF7F);
    CHECK(BTagReadContainer(&reader, &tag, &content) == ERR_BTAG_NOCONTAINERTAG);
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(BTagReadContainer(&reader, &tag, &content) == ERR_OK);
}

static void content_ends_with_its_container(void)
{
    RTS_UI32 value;
    BTAG_READER reader;
    BTAG_READER content;

    READER(&reader, "\x81\x01\x03\x10\x01\x05\x11\x01\x06");
    CHECK(BTagFindContainer(&reader, 0x81, &content) == ERR_OK);
    CHECK(BTagFindUnsigned(&content, 0x10, &value) == ERR_OK && value == 5);
    CHECK(BTagFindUnsigned(&content, 0x11, &value) == ERR_L7_TAG_MISSING);
    /* An inner length may not reach beyond the container. */
    READER(&reader, "\x81\x01\x03\x10\x02\x05\x11\x01\x06");
    CHECK(BTagFindContainer(&reader, 0x81, &content) == ERR_OK);
    CHECK(BTagFindUnsigned(&content, 0x10, &value) == ERR_BTAG_BUFFEROVERRUN);
}

static void nesting_ends_at_five_levels(void)
{
    RTS_UI8 data[3 * 8];
    BTAG_READER reader;
    BTAG tag;
    RTS_RESULT result = ERR_OK;
    int depth = 1;

    for (RTS_UI32 i = 0; i < 8; i++) {
        data[3 * i] = 0x81;
        data[3 * i + 1] = 0x01;
        data[3 * i + 2] = (RTS_UI8)(3 * (7 - i));
    }
    BTagReaderInit(&reader, data, sizeof(data));
    while (result == ERR_OK && BTagReadNext(&reader, &tag) == ERR_OK) {
        result = BTagReadContainer(&reader, &tag, &reader);
        depth += result == ERR_OK;
    }
    CHECK(result == ERR_BTAG_MAXNESTINGDEPTH);
    CHECK(depth == BTAG_MAX_NESTING);
}

/* ---- writer ---- */

static RTS_UI8 buffer[512];

static void integers_are_written_as_clients_expect_them(void)
{
    BTAG_WRITER writer;

    BTagWriterInit(&writer, buffer, sizeof(buffer));
    BTagWrite16(&writer, 0x46, 0x0102);
    BTagWrite32(&writer, 0x21, 0x11223344);
    CHECK(BTagIsComplete(&writer));
    CHECK(writer.size == 12);
    CHECK(memcmp(buffer, "\x46\x02\x02\x01\x21\x84\x80\x00\x44\x33\x22\x11", 12) == 0);
}

static void error_tag_with_its_long_id_is_aligned(void)
{
    BTAG_WRITER writer;

    BTagWriterInit(&writer, buffer, sizeof(buffer));
    BTagWrite16(&writer, 0xFF7F, 0x0301);
    CHECK(writer.size == 8);
    CHECK(memcmp(buffer, "\xFF\xFE\x03\x82\x80\x00\x01\x03", 8) == 0);
}

static void content_is_aligned_whatever_came_before(void)
{
    for (RTS_UI32 before = 0; before < 8; before++) {
        for (RTS_UI32 align = 0; align <= 2; align += 2) {
            static const RTS_UI32 ids[] = {0x01, 0x81, 0xFF82, 0x7FFFFFFF};
            for (RTS_UI32 i = 0; i < RTS_COUNT(ids); i++) {
                BTAG_WRITER writer;
                BTAG_READER reader;
                BTAG tag;
                BTagWriterInit(&writer, buffer, sizeof(buffer));
                BTagAppendZeros(&writer, before);
                BTagOpen(&writer, ids[i], (BTAG_ALIGN)align);
                CHECK((writer.size & 3) == align);
                BTagAppend(&writer, "abc", 3);
                BTagClose(&writer);
                BTagReaderInit(&reader, buffer + before, writer.size - before);
                CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
                CHECK(tag.id == ids[i] && tag.size == 3 && memcmp(tag.data, "abc", 3) == 0);
            }
        }
    }
}

static void containers_get_their_length_when_closed(void)
{
    BTAG_WRITER writer;

    BTagWriterInit(&writer, buffer, sizeof(buffer));
    BTagOpen(&writer, 0x81, BTAG_ALIGN_0);
    for (int i = 0; i < 33; i++)
        BTagWrite32(&writer, 0x21, 0);
    BTagClose(&writer);
    CHECK(memcmp(buffer, "\x81\x01\x88\x02", 4) == 0);
    CHECK(writer.size == 4 + 264);
}

static void empty_elements_vanish(void)
{
    BTAG_WRITER writer;

    BTagWriterInit(&writer, buffer, sizeof(buffer));
    BTagWrite16(&writer, 1, 1);
    BTagOpen(&writer, 0x81, BTAG_ALIGN_0);
    BTagOpen(&writer, 0x02, BTAG_ALIGN_2);
    BTagClose(&writer);
    BTagClose(&writer);
    CHECK(BTagIsComplete(&writer));
    CHECK(writer.size == 4);
}

static void text_has_a_nul_and_ends_aligned(void)
{
    BTAG_READER reader;
    BTAG_WRITER writer;
    BTAG tag;

    for (RTS_UI32 length = 0; length < 6; length++) {
        char text[] = "abcdef";
        text[length] = '\0';
        BTagWriterInit(&writer, buffer, sizeof(buffer));
        BTagWriteText(&writer, 0x10, text, 100);
        CHECK((writer.size & 3) == 0);
        BTagReaderInit(&reader, buffer, writer.size);
        CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
        CHECK(tag.size >= length + 1 && strcmp((const char *)tag.data, text) == 0);
    }
}

static void text_is_cut_to_its_limit(void)
{
    BTAG_READER reader;
    BTAG_WRITER writer;
    BTAG tag;

    BTagWriterInit(&writer, buffer, sizeof(buffer));
    BTagWriteText(&writer, 0x10, "abcdef", 3);
    BTagReaderInit(&reader, buffer, writer.size);
    CHECK(BTagReadNext(&reader, &tag) == ERR_OK);
    CHECK(strcmp((const char *)tag.data, "abc") == 0);
}

static void write_something_of_each(BTAG_WRITER *writer)
{
    BTagOpen(writer, 0x82, BTAG_ALIGN_0);
    BTagWrite32(writer, 1, 0x12345678);
    BTagOpen(writer, 0x83, BTAG_ALIGN_0);
    BTagWriteText(writer, 3, "text", 10);
    BTagOpen(writer, 4, BTAG_ALIGN_2);
    BTagAppend16(writer, 1);
    BTagAppend32(writer, 2);
    BTagPad(writer);
    BTagClose(writer);
    BTagClose(writer);
    BTagWrite16(writer, 0xFF7F, 1);
    BTagClose(writer);
}

static void writer_never_passes_its_end_and_says_so(void)
{
    BTAG_WRITER writer;

    BTagWriterInit(&writer, buffer, sizeof(buffer));
    write_something_of_each(&writer);
    CHECK(BTagIsComplete(&writer));
    RTS_UI32 needed = writer.size;
    for (RTS_UI32 capacity = 0; capacity <= needed; capacity++) {
        RTS_UI8 *data = malloc(capacity + 1);
        BTagWriterInit(&writer, data, capacity);
        write_something_of_each(&writer);
        CHECK(BTagIsComplete(&writer) == (capacity == needed));
        CHECK(writer.size <= capacity);
        free(data);
    }
}

static void opening_too_deep_is_an_overflow(void)
{
    BTAG_WRITER writer;

    BTagWriterInit(&writer, buffer, sizeof(buffer));
    for (int i = 0; i <= BTAG_MAX_NESTING; i++)
        BTagOpen(&writer, 0x81, BTAG_ALIGN_0);
    for (int i = 0; i <= BTAG_MAX_NESTING; i++)
        BTagClose(&writer);
    CHECK(!BTagIsComplete(&writer));
}

static void element_left_open_is_incomplete(void)
{
    BTAG_WRITER writer;

    BTagWriterInit(&writer, buffer, sizeof(buffer));
    BTagOpen(&writer, 0x81, BTAG_ALIGN_0);
    CHECK(!BTagIsComplete(&writer));
}

int main(void)
{
    RUN(samples_of_the_specification_are_read);
    RUN(container_with_an_eight_byte_head_is_read);
    RUN(length_of_264_takes_two_bytes);
    RUN(elements_need_no_alignment);
    RUN(over_long_numbers_are_read_up_to_ten_bytes);
    RUN(numbers_beyond_32_bits_are_refused);
    RUN(length_beyond_the_rest_is_refused);
    RUN(every_cut_element_is_refused);
    RUN(element_without_a_length_is_refused);
    RUN(element_of_length_zero_is_legal);
    RUN(missing_element_is_distinguished_from_one_of_wrong_size);
    RUN(integers_have_one_two_or_four_bytes);
    RUN(optional_integer_keeps_its_default_when_absent);
    RUN(find_begins_at_the_start_wherever_the_reader_stands);
    RUN(find_stops_at_a_broken_element);
    RUN(data_element_is_no_container);
    RUN(content_ends_with_its_container);
    RUN(nesting_ends_at_five_levels);
    RUN(integers_are_written_as_clients_expect_them);
    RUN(error_tag_with_its_long_id_is_aligned);
    RUN(content_is_aligned_whatever_came_before);
    RUN(containers_get_their_length_when_closed);
    RUN(empty_elements_vanish);
    RUN(text_has_a_nul_and_ends_aligned);
    RUN(text_is_cut_to_its_limit);
    RUN(writer_never_passes_its_end_and_says_so);
    RUN(opening_too_deep_is_an_overflow);
    RUN(element_left_open_is_incomplete);
    return test_result();
}
