/*
 * test_comm_serial.c - CmpBlkDrvSimpleCom: frames, what is rejected, resynchronisation, partial sending.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBlkDrvSimpleCom.h"
#include "CmpBytes.h"
#include "CmpPackets.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "test.h"

/* RTSINFO request: the shortest package that is answered on its own. */
static const RTS_UI8 rts_info_package[] = {0xC2, 0x00, 0x01, 0x01, 0x36, 0x65, 0x9D, 0xAB};

/* Bit by bit and in the other usual form (16 zero bits appended), so that it is not the code under test. */
static RTS_UI16 reference_crc(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 crc = 0xFFFF;

    for (RTS_UI32 i = 0; i < 8 * (size + 2); i++) {
        RTS_UI32 bit = i / 8 < size ? data[i / 8] >> (7 - i % 8) & 1u : 0;
        crc = crc << 1 | bit;
        if (crc & 0x10000)
            crc ^= 0x11021;
    }
    return (RTS_UI16)crc;
}

static void put_byte(RTS_UI8 byte)
{
    fakes.line_in[fakes.line_in_size++] = byte;
}

static void put_bytes(const RTS_UI8 *data, RTS_UI32 size)
{
    for (RTS_UI32 i = 0; i < size; i++)
        put_byte(data[i]);
}

static void put_escaped(RTS_UI8 byte)
{
    put_byte(byte);
    if (byte == '#')
        put_byte('_');
}

/* A frame around `data`, its CRC changed by `crc_error`. */
static void put_frame(const RTS_UI8 *data, RTS_UI32 size, RTS_UI16 crc_error)
{
    RTS_UI16 crc = reference_crc(data, size) ^ crc_error;

    put_byte('#');
    put_byte('<');
    for (RTS_UI32 i = 0; i < size; i++)
        put_escaped(data[i]);
    put_escaped((RTS_UI8)crc);
    put_escaped((RTS_UI8)(crc >> 8));
    put_byte('#');
    put_byte('>');
}

/* A packet that gets an answer when it arrives whole. */
static void put_question(void)
{
    RTS_UI8 packet[20] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x00, 0x01, 0x00, 0x23, 0x00, 0x00};

    memcpy(packet + 12, rts_info_package, sizeof(rts_info_package));
    put_frame(packet, sizeof(packet), 0);
}

static RTS_UI32 answers(void)
{
    RTS_UI32 count = 0;

    for (RTS_UI32 i = 0; i + 1 < fakes.line_out_size; i++)
        count += fakes.line_out[i] == '#' && fakes.line_out[i + 1] == '<';
    return count;
}

/* Decodes frame `*position` of the output; returns the packet's size, 0 when it is not a good frame. */
static RTS_UI32 take_frame(RTS_UI32 *position, RTS_UI8 *packet)
{
    RTS_UI32 size = 0;
    RTS_UI32 i = *position;

    if (i + 2 > fakes.line_out_size || memcmp(fakes.line_out + i, "#<", 2) != 0)
        return 0;
    for (i += 2; i < fakes.line_out_size; i++) {
        RTS_UI8 byte = fakes.line_out[i];
        if (byte == '#' && fakes.line_out[++i] == '>')
            break;
        if (byte == '#' && fakes.line_out[i] != '_')
            return 0;
        packet[size++] = byte;
    }
    *position = i + 1;
    if (size < 3 || reference_crc(packet, size - 2) != BytesGet16(packet + size - 2))
        return 0;
    return size - 2;
}

static const COM_COUNTERS *counters(void)
{
    return BlkDrvComGetCounters(0);
}

static void a_crc_with_its_high_byte_first_is_taken_if_that_is_wanted(void)
{
    RTS_UI8 packet[20] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x00, 0x01, 0x00, 0x23, 0x00, 0x00};

    fakes_start();
    memcpy(packet + 12, rts_info_package, sizeof(rts_info_package));
    RTS_UI16 crc = reference_crc(packet, sizeof(packet));
    put_frame(packet, sizeof(packet), (RTS_UI16)(crc ^ (crc << 8 | crc >> 8)));
    fakes_cycle(1);
    CHECK_EQUAL(answers(), COM_CRC_EITHER_ORDER);
    CHECK_EQUAL(counters()->crc_errors, !COM_CRC_EITHER_ORDER);
}

static void reference_crc_has_the_published_check_value(void)
{
    CHECK_EQUAL(reference_crc((const RTS_UI8 *)"123456789", 9), 0xE5CC);
}

static void worked_frames_of_the_specification_are_accepted(void)
{
    static const RTS_UI8 short_frame[] = {0x23, 0x3C, 0x12, 0x23, 0x5F, 0x34, 0x6D, 0x19, 0x23, 0x3E};
    static const RTS_UI8 address_request[] = {0x23, 0x3C, 0xC5, 0x0B, 0x40, 0x01, 0x00,
                                              0x10, 0x00, 0x01, 0xFA, 0x7A, 0x23, 0x3E};

    fakes_start();
    put_bytes(short_frame, sizeof(short_frame));
    put_bytes(address_request, sizeof(address_request));
    fakes_cycle(1);
    CHECK_EQUAL(counters()->frames, 2);
    CHECK_EQUAL(counters()->crc_errors, 0);
}

static void answer_is_sent_in_the_cycle_of_the_last_byte(void)
{
    RTS_UI8 packet[600];
    RTS_UI32 position = 0;

    fakes_start();
    put_question();
    fakes_cycle(1);
    CHECK_EQUAL(take_frame(&position, packet), 12 + 10);
    CHECK_EQUAL(position, fakes.line_out_size);
    CHECK(memcmp(packet, "\xC5\x73\x40\x40\x00\x11\x00\x23\x00\x01\x00\x00\x82", 13) == 0);
}

static void hash_bytes_are_escaped_on_the_line(void)
{
    fakes_start();
    put_question(); /* from address 0x0023 */
    fakes_cycle(1);
    CHECK(memcmp(fakes.line_out, "#<\xC5\x73\x40\x40\x00\x11\x00#_\x00\x01", 13) == 0);
}

static void receiver_address_does_not_matter_on_a_line_with_two_ends(void)
{
    RTS_UI8 packet[20] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x12, 0x34, 0x00, 0x02, 0x00, 0x00};

    fakes_start();
    memcpy(packet + 12, rts_info_package, sizeof(rts_info_package));
    put_frame(packet, sizeof(packet), 0);
    fakes_cycle(1);
    CHECK_EQUAL(answers(), 1);
}

static void bytes_may_arrive_one_per_cycle(void)
{
    fakes_start();
    put_question();
    RTS_UI32 size = fakes.line_in_size;
    for (fakes.line_in_size = 0; fakes.line_in_size < size;) {
        CHECK_EQUAL(answers(), 0);
        fakes.line_in_size++;
        fakes_cycle(1);
    }
    CHECK_EQUAL(answers(), 1);
}

static void frame_with_wrong_crc_is_dropped(void)
{
    static const RTS_UI8 data[] = {1, 2, 3};

    fakes_start();
    put_frame(data, sizeof(data), 0x0100);
    put_question();
    fakes_cycle(1);
    CHECK_EQUAL(counters()->crc_errors, 1);
    CHECK_EQUAL(answers(), 1);
}

static void every_single_bit_error_is_noticed(void)
{
    fakes_start();
    put_question();
    RTS_UI32 size = fakes.line_in_size;
    for (RTS_UI32 bit = 0; bit < 8 * size; bit++) {
        fakes_start();
        put_question();
        fakes.line_in[bit / 8] ^= (RTS_UI8)(1u << bit % 8);
        fakes_cycle(1);
        CHECK_EQUAL(answers(), 0);
        put_question();
        fakes_cycle(1);
        CHECK_EQUAL(answers(), 1);
    }
}

static void largest_packet_passes_and_one_byte_more_overflows(void)
{
    static RTS_UI8 data[COM_PACKET_SIZE + 1];

    fakes_start();
    memset(data, '#', sizeof(data));
    put_frame(data, COM_PACKET_SIZE, 0);
    put_frame(data, COM_PACKET_SIZE + 1, 0);
    put_question();
    while (fakes.line_in_read < fakes.line_in_size)
        fakes_cycle(1);
    CHECK_EQUAL(counters()->frames, 2);
    CHECK_EQUAL(counters()->overflows, 1);
    CHECK_EQUAL(answers(), 1);
}

/* What the open response says of the longest packet to a client that would send `wanted` bytes. */
static RTS_UI32 granted_packet(RTS_UI32 wanted)
{
    static RTS_UI8 answer[BLK_MAX_SIZE + 2];
    RTS_UI8 packet[12 + sizeof(CHANNEL_OPEN_REQUEST)] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11,
                                                         0x00, 0x01, 0x00, 0x23, 0x00, 0x00};
    CHANNEL_OPEN_REQUEST *open = (CHANNEL_OPEN_REQUEST *)(packet + 12);
    RTS_UI32 position = 0;

    fakes_start();
    open->meta.type = CHANNEL_PKG_OPEN_REQ;
    BytesPut32(open->limit, NETSERVER_MESSAGE_SIZE);
    BytesPut16(open->packet, wanted);
    client_seal(packet + 12, sizeof(*open));
    put_frame(packet, sizeof(packet), 0);
    fakes_cycle(1);
    CHECK_EQUAL(take_frame(&position, answer), 12 + sizeof(CHANNEL_OPEN_RESPONSE));
    return BytesGet16(((const CHANNEL_OPEN_RESPONSE *)(answer + 12))->packet);
}

static void a_client_that_asks_is_told_the_longest_packet(void)
{
    CHECK_EQUAL(granted_packet(0), 0);
    CHECK_EQUAL(granted_packet(600), BLK_LONG_PACKETS ? 600 : 0);
    CHECK_EQUAL(granted_packet(COM_PACKET_SIZE), BLK_LONG_PACKETS ? COM_PACKET_SIZE : 0);
    CHECK_EQUAL(granted_packet(0xFFFF), BLK_LONG_PACKETS ? COM_PACKET_SIZE : 0);
}

static void frame_without_end_never_overflows_the_buffer(void)
{
    fakes_start();
    put_bytes((const RTS_UI8 *)"#<", 2);
    for (int i = 0; i < 3000; i++)
        put_byte('x');
    put_question();
    fakes_cycle(1);
    fakes_cycle(1);
    CHECK_EQUAL(counters()->overflows, 1);
    CHECK_EQUAL(answers(), 1);
}

static void wrong_escape_ends_the_frame(void)
{
    fakes_start();
    put_bytes((const RTS_UI8 *)"#<abc#xdef#>", 12);
    put_question();
    fakes_cycle(1);
    CHECK_EQUAL(counters()->bad_escapes, 1);
    CHECK_EQUAL(counters()->ends_without_start, 1);
    CHECK_EQUAL(answers(), 1);
}

static void doubled_hash_is_a_wrong_escape_and_may_begin_a_frame(void)
{
    fakes_start();
    put_bytes((const RTS_UI8 *)"#<abc#", 6);
    put_question();
    fakes_cycle(1);
    CHECK_EQUAL(counters()->bad_escapes, 1);
    CHECK_EQUAL(answers(), 1);
}

static void start_within_a_frame_begins_again(void)
{
    fakes_start();
    put_bytes((const RTS_UI8 *)"#<abc", 5);
    put_question();
    fakes_cycle(1);
    CHECK_EQUAL(counters()->unfinished, 1);
    CHECK_EQUAL(answers(), 1);
}

static void end_without_start_is_counted(void)
{
    fakes_start();
    put_bytes((const RTS_UI8 *)"noise#>##>", 10);
    fakes_cycle(1);
    CHECK_EQUAL(counters()->ends_without_start, 2);
}

static void frames_too_short_for_a_crc_are_counted(void)
{
    fakes_start();
    put_bytes((const RTS_UI8 *)"#<#>#<a#>#<ab#>", 15);
    fakes_cycle(1);
    CHECK_EQUAL(counters()->too_short, 3);
}

static void port_that_takes_a_byte_at_a_time_gets_the_same_bytes(void)
{
    RTS_UI8 whole[256];
    RTS_UI32 size;

    fakes_start();
    put_question();
    fakes_cycle(1);
    size = fakes.line_out_size;
    memcpy(whole, fakes.line_out, size);
    fakes_start();
    fakes.line_write_limit = 1;
    put_question();
    for (int i = 0; i < 200; i++)
        fakes_cycle(1);
    CHECK_EQUAL(fakes.line_out_size, size);
    CHECK(memcmp(fakes.line_out, whole, size) == 0);
}

static void full_queue_loses_whole_packets_only(void)
{
    RTS_UI8 packet[600];
    RTS_UI32 position = 0;
    RTS_UI32 frames = 0;

    fakes_start();
    fakes.line_write_limit = 0;
    for (int i = 0; i < 60; i++)
        put_question();
    for (int i = 0; i < 3; i++)
        fakes_cycle(1);
    fakes.line_write_limit = FAKE_LINE_SIZE;
    fakes_cycle(1);
    while (take_frame(&position, packet) == 22)
        frames++;
    CHECK_EQUAL(position, fakes.line_out_size);
    CHECK(frames >= COM_QUEUE_SIZE / 26); /* length, packet, CRC */
    CHECK(frames < 60);
}

static void babbling_line_does_not_hold_the_cycle(void)
{
    fakes_start();
    memset(fakes.line_in, 'x', FAKE_LINE_SIZE);
    fakes.line_in_size = FAKE_LINE_SIZE;
    fakes_cycle(1);
    CHECK(fakes.line_in_read < FAKE_LINE_SIZE);
}

static void line_that_cannot_be_opened_is_logged_and_left_alone(void)
{
    fakes_init();
    fakes.line_open_result = ERR_DEVICE;
    fakes_run_init_hooks();
    CHECK(fakes.log_added == 1 && fakes.hook_errors == 0);
    put_question();
    fakes_cycle(1);
    CHECK(fakes.line_in_read == 0 && answers() == 0);
}

static void closing_the_line_sends_what_is_queued(void)
{
    fakes_start();
    fakes.line_write_limit = 0;
    put_question();
    fakes_cycle(1);
    fakes.line_write_limit = FAKE_LINE_SIZE;
    for (int hook = CH_EXIT_COMM; hook <= CH_EXIT_SYSTEM; hook++)
        fakes_hook((CMP_HOOK)hook);
    CHECK_EQUAL(answers(), 1);
    put_question();
    fakes_cycle(1);
    CHECK_EQUAL(answers(), 1);
}

static void restart_forgets_half_a_frame_and_the_counters(void)
{
    fakes_start();
    put_bytes((const RTS_UI8 *)"#>#<ab", 6);
    fakes_cycle(1);
    CHECK_EQUAL(counters()->ends_without_start, 1);
    fakes_start();
    put_bytes((const RTS_UI8 *)"#>", 2);
    fakes_cycle(1);
    CHECK_EQUAL(counters()->ends_without_start, 1);
    CHECK_EQUAL(counters()->too_short, 0);
}

int main(void)
{
    RUN(a_crc_with_its_high_byte_first_is_taken_if_that_is_wanted);
    RUN(reference_crc_has_the_published_check_value);
    RUN(worked_frames_of_the_specification_are_accepted);
    RUN(answer_is_sent_in_the_cycle_of_the_last_byte);
    RUN(hash_bytes_are_escaped_on_the_line);
    RUN(receiver_address_does_not_matter_on_a_line_with_two_ends);
    RUN(bytes_may_arrive_one_per_cycle);
    RUN(frame_with_wrong_crc_is_dropped);
    RUN(every_single_bit_error_is_noticed);
    RUN(largest_packet_passes_and_one_byte_more_overflows);
    RUN(a_client_that_asks_is_told_the_longest_packet);
    RUN(frame_without_end_never_overflows_the_buffer);
    RUN(wrong_escape_ends_the_frame);
    RUN(doubled_hash_is_a_wrong_escape_and_may_begin_a_frame);
    RUN(start_within_a_frame_begins_again);
    RUN(end_without_start_is_counted);
    RUN(frames_too_short_for_a_crc_are_counted);
    RUN(port_that_takes_a_byte_at_a_time_gets_the_same_bytes);
    RUN(full_queue_loses_whole_packets_only);
    RUN(babbling_line_does_not_hold_the_cycle);
    RUN(line_that_cannot_be_opened_is_logged_and_left_alone);
    RUN(closing_the_line_sends_what_is_queued);
    RUN(restart_forgets_half_a_frame_and_the_counters);
    return test_result();
}
