/*
 * test_comm_download.c - CmpAppSrv: an image arrives in blocks, which may be lost, repeated or wrong.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBytes.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "packer.h"
#include "rts_config.h"
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
    CHECK_EQUAL(reply_error(&reply), ERR_OK);
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
    CHECK_EQUAL(fakes.download_ends, 0);
    CHECK(put(600, 400, &next) == ERR_OK && next == TOTAL);
    CHECK(fakes.download_begins == 1 && fakes.download_writes == 3 && fakes.download_ends == 1);
    CHECK(memcmp(fakes.image, image, TOTAL) == 0);
}

static void image_is_started_with_its_last_block_if_that_says_so(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(download(DLF_START, 0, TOTAL, CRC, 600, &next), ERR_OK);
    CHECK_EQUAL(fakes.starts, 0);
    CHECK_EQUAL(download(DLF_CONTINUEDOWNLOAD | DLF_START, 600, TOTAL, CRC, 400, &next), ERR_OK);
    CHECK(fakes.download_ends == 1 && fakes.starts == 1);
    setup_image();
    CHECK_EQUAL(download(DLF_START, 0, TOTAL, CRC, 600, &next), ERR_OK);
    CHECK_EQUAL(put(600, 400, &next), ERR_OK);
    CHECK(fakes.download_ends == 1 && fakes.starts == 0);
}

static void last_block_that_is_repeated_starts_nothing_again(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(download(DLF_START, 0, TOTAL, CRC, TOTAL, &next), ERR_OK);
    fakes.status.image_crc = CRC;
    CHECK_EQUAL(download(DLF_CONTINUEDOWNLOAD | DLF_START, 0, TOTAL, CRC, TOTAL, &next), ERR_OK);
    CHECK_EQUAL(fakes.starts, 1);
}

static void refused_image_is_not_started(void)
{
    RTS_UI32 next;

    setup_image();
    fakes.end_result = ERR_APP_UNRESOLVED_REFERENCE;
    CHECK_EQUAL(download(DLF_START, 0, TOTAL, CRC, TOTAL, &next), ERR_APP_UNRESOLVED_REFERENCE);
    CHECK(fakes.download_ends == 1 && fakes.starts == 0);
}

static void image_in_one_block_is_complete_at_once(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(download(0, 0, 200, CRC, 200, &next) == ERR_OK && next == 200);
    CHECK_EQUAL(fakes.download_ends, 1);
}

static void repeated_block_is_acknowledged_and_not_written(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(put(0, 300, &next), ERR_OK);
    CHECK_EQUAL(put(300, 300, &next), ERR_OK);
    CHECK(put(300, 300, &next) == ERR_OK && next == 600);
    CHECK(download(DLF_CONTINUEDOWNLOAD, 0, TOTAL, CRC, 300, &next) == ERR_OK && next == 600);
    CHECK_EQUAL(fakes.download_writes, 2);
}

static void overlapping_block_is_written_from_where_it_is_new(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(put(0, 300, &next), ERR_OK);
    CHECK(put(100, 400, &next) == ERR_OK && next == 500);
    CHECK(put(500, 500, &next) == ERR_OK && next == TOTAL);
    CHECK(memcmp(fakes.image, image, TOTAL) == 0);
}

static void block_beyond_the_next_is_out_of_sequence(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(put(0, 300, &next), ERR_OK);
    CHECK(put(301, 10, &next) == ERR_INVALID_SEQUENCE && next == 300);
    CHECK(put(300, 10, &next) == ERR_OK && next == 310);
}

static void block_without_beginning_is_out_of_sequence(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put(300, 10, &next) == ERR_INVALID_SEQUENCE && next == 0);
    CHECK(download(DLF_CONTINUEDOWNLOAD, 0, TOTAL, CRC, 10, &next) == ERR_INVALID_SEQUENCE && next == 0);
    CHECK_EQUAL(fakes.download_begins, 0);
}

static void block_of_another_image_is_out_of_sequence(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(put(0, 300, &next), ERR_OK);
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
        CHECK_EQUAL(download(0, wrong[i][0], 200, CRC, wrong[i][1], &next), ERR_OUT_OF_LIMITS);
    CHECK(fakes.download_begins == 0 && fakes.download_writes == 0);
}

static void beginning_again_starts_from_zero(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(put(0, 300, &next), ERR_OK);
    CHECK(put(0, 100, &next) == ERR_OK && next == 100);
    CHECK_EQUAL(fakes.download_begins, 2);
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
    CHECK_EQUAL(put(0, 300, &next), ERR_OK);
    CHECK(ask(&next) == ERR_OK && next == 300);
    CHECK(download(0, 0, TOTAL, CRC, 0, &next) == ERR_OK && next == 300);
    CHECK(download(0, 0, TOTAL, CRC + 1, 0, &next) == ERR_OK && next == 0);
    CHECK_EQUAL(fakes.download_begins, 1);
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
    CHECK_EQUAL(put(0, 300, &next), ERR_OK);
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
    CHECK_EQUAL(put(0, TOTAL, &next), ERR_OK);
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
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_CDL_REASON, 1, 200, &reason), ERR_OK);
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
    CHECK_EQUAL(BTagFind(&reply.tags, TAG_CDL_REASON, 60, CHANNEL_MIN_MESSAGE, &reason), ERR_OK);
    CHECK(memcmp(reason.data, fakes.end_text, 60) == 0 && reason.data[reason.size - 1] == '\0');
}

static void flash_fault_ends_the_transfer(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(put(0, 300, &next), ERR_OK);
    fakes.write_result = ERR_DEVICE;
    CHECK(put(300, 300, &next) == ERR_DEVICE && next == 0);
    CHECK(put(300, 300, &next) == ERR_INVALID_SEQUENCE && next == 0);
}

static void malformed_position_is_an_error(void)
{
    setup_image();
    begin_content();
    CHECK(call(SRV_APP_DOWNLOAD_COMPACT));
    CHECK_EQUAL(reply_error(&reply), ERR_L7_TAG_MISSING);
    for (RTS_UI32 size = 1; size < 20; size++) {
        if (size == sizeof(CDL_POSITION))
            continue;
        BTagOpen(begin_content(), TAG_CDL_POSITION, BTAG_ALIGN_0);
        BTagAppendZeros(&writer, size);
        BTagClose(&writer);
        CHECK(call(SRV_APP_DOWNLOAD_COMPACT));
        CHECK_EQUAL(reply_error(&reply), ERR_SIZE_MISMATCH);
    }
    CHECK_EQUAL(fakes.download_begins, 0);
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
        CHECK_EQUAL(reply_number(&reply, TAG_CDL_NEXT), 250 * i);
    }
    CHECK_EQUAL(fakes.download_ends, 1);
    CHECK(memcmp(fakes.image, image, TOTAL) == 0);
}

/* ---- packed ---- */

/* Sends a block of packed data that are said to unpack to `unpacked` bytes. */
static RTS_UI32 download_packed(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 unpacked, RTS_UI32 *next)
{
    begin_content();
    BTagOpen(&writer, TAG_CDL_POSITION, BTAG_ALIGN_0);
    BTagAppend32(&writer, offset == 0 ? 0 : DLF_CONTINUEDOWNLOAD);
    BTagAppend32(&writer, offset);
    BTagAppend32(&writer, TOTAL);
    BTagAppend32(&writer, CRC);
    BTagClose(&writer);
    BTagOpen(&writer, TAG_CDL_PACKED, BTAG_ALIGN_0);
    BTagAppend32(&writer, unpacked);
    BTagAppend(&writer, data, size);
    BTagClose(&writer);
    CHECK(call(SRV_APP_DOWNLOAD_COMPACT));
    if (reply_error(&reply) != ERR_OK)
        return reply_error(&reply);
    *next = reply_number(&reply, TAG_CDL_NEXT);
    return reply_number(&reply, TAG_SERVICE_RESULT);
}

static RTS_UI32 put_packed(RTS_UI32 offset, RTS_UI32 size, RTS_UI32 *next)
{
    RTS_UI8 data[2 * TOTAL];

    return download_packed(offset, data, pack(image, offset, offset + size, data), size, next);
}

static void question_tells_how_much_a_packed_block_may_unpack_to(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(ask(&next), ERR_OK);
    CHECK_EQUAL(reply_number(&reply, TAG_CDL_UNPACKS), APP_UNPACK_SIZE);
}

static void packed_and_plain_blocks_make_an_image(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK(put_packed(0, 300, &next) == ERR_OK && next == 300);
    CHECK(put(300, 300, &next) == ERR_OK && next == 600);
    CHECK(put_packed(600, 400, &next) == ERR_OK && next == TOTAL);
    CHECK(fakes.download_begins == 1 && fakes.download_ends == 1);
    CHECK(memcmp(fakes.image, image, TOTAL) == 0);
}

static void repeated_packed_block_is_acknowledged_and_not_written(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(put_packed(0, 300, &next), ERR_OK);
    CHECK_EQUAL(put_packed(300, 300, &next), ERR_OK);
    CHECK(put_packed(300, 300, &next) == ERR_OK && next == 600);
    CHECK(put_packed(301, 300, &next) == ERR_INVALID_SEQUENCE && next == 600);
    CHECK(put_packed(601, 300, &next) == ERR_INVALID_SEQUENCE && next == 600);
    CHECK_EQUAL(fakes.download_writes, 2);
}

static void packed_block_that_unpacks_to_too_much_is_refused(void)
{
    static const RTS_UI32 wrong[] = {0, TOTAL + 1, APP_UNPACK_SIZE + 1, 0x7FFFFFFF, 0xFFFFFFFF};
    RTS_UI8 data[2 * TOTAL];
    RTS_UI32 size;
    RTS_UI32 next;

    setup_image();
    size = pack(image, 0, TOTAL, data);
    for (RTS_UI32 i = 0; i < RTS_COUNT(wrong); i++)
        CHECK_EQUAL(download_packed(0, data, size, wrong[i], &next), ERR_OUT_OF_LIMITS);
    CHECK(fakes.download_begins == 0 && fakes.download_writes == 0);
}

static void wrong_packed_data_end_the_transfer(void)
{
    RTS_UI8 data[2 * TOTAL];
    RTS_UI32 size;
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(put(0, 300, &next), ERR_OK);
    size = pack(image, 300, 600, data);
    CHECK(download_packed(300, data, size - 1, 300, &next) == ERR_NO_CONSISTENCY && next == 0);
    CHECK(put(300, 300, &next) == ERR_INVALID_SEQUENCE && next == 0);
    CHECK_EQUAL(fakes.download_ends, 0);
}

static void packed_data_without_a_byte_are_malformed(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(download_packed(0, image, 0, 10, &next), ERR_SIZE_MISMATCH);
}

static void restart_forgets_the_transfer(void)
{
    RTS_UI32 next;

    setup_image();
    CHECK_EQUAL(put(0, 300, &next), ERR_OK);
    setup();
    CHECK(ask(&next) == ERR_OK && next == 0);
    CHECK_EQUAL(download(DLF_CONTINUEDOWNLOAD, 0, TOTAL, CRC, 10, &next), ERR_INVALID_SEQUENCE);
}

int main(void)
{
    RUN(image_arrives_block_by_block);
    RUN(image_in_one_block_is_complete_at_once);
    RUN(image_is_started_with_its_last_block_if_that_says_so);
    RUN(last_block_that_is_repeated_starts_nothing_again);
    RUN(refused_image_is_not_started);
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
    RUN(question_tells_how_much_a_packed_block_may_unpack_to);
    RUN(packed_and_plain_blocks_make_an_image);
    RUN(repeated_packed_block_is_acknowledged_and_not_written);
    RUN(packed_block_that_unpacks_to_too_much_is_refused);
    RUN(wrong_packed_data_end_the_transfer);
    RUN(packed_data_without_a_byte_are_malformed);
    RUN(restart_forgets_the_transfer);
    return test_result();
}
