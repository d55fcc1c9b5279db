/*
 * test_canopen_transfers.c - SDO transfers of every size to a device and from it, also with a frame that is lost, doubled or
 * late.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "canopen_transfers.h"
#include "test.h"

typedef bool (*PF_WRITE)(const RTS_UI8 *data, RTS_UI32 size);
typedef bool (*PF_READ)(void);

static RTS_UI8 text[LONGEST];

static void make_text(RTS_UI32 seed)
{
    for (RTS_UI32 i = 0; i < LONGEST; i++)
        text[i] = (RTS_UI8)('!' + (i * 7 + i / 90 + seed) % 90);
}

static bool write_text(const RTS_UI8 *data, RTS_UI32 size)
{
    return write_segments(TEXT, data, size);
}

static bool read_text(void)
{
    return read_segments(TEXT);
}

static bool write_by_client(const RTS_UI8 *data, RTS_UI32 size)
{
    return write_object(TEXT, data, size);
}

static bool read_by_client(void)
{
    return read_object(TEXT);
}

static bool has_read(RTS_UI32 size)
{
    return received_size == size && memcmp(received, text, size) == 0;
}

static void check_sizes(PF_WRITE write, PF_READ read)
{
    begin();
    for (RTS_UI32 size = 1; size <= LONGEST; size++) {
        make_text(size);
        if (!write(text, size) || !read() || !has_read(size))
            fprintf(stderr, "%u bytes\n", (unsigned)size);
        CHECK(has_read(size) && strlen((const char *)values + TEXT_PLACE) == size);
    }
}

static void every_size_is_transferred_in_segments(void)
{
    check_sizes(write_text, read_text);
}

static void every_size_is_transferred_in_blocks(void)
{
    check_sizes(write_blocks, read_blocks);
}

static void every_size_is_transferred_by_the_client_of_the_manager(void)
{
    check_sizes(write_by_client, read_by_client);
}

/* Long values take a quarter of the frames less than in segments, and none is transferred in more of them. */
static void the_client_of_the_manager_takes_blocks_where_they_pay(void)
{
    begin();
    make_text(5);
    for (RTS_UI32 size = 1; size <= LONGEST; size += size < 2 * SDO_BLOCK_FROM ? 1 : 97) {
        RTS_UI32 before = frames;
        CHECK(write_text(text, size) && read_text());
        RTS_UI32 in_segments = frames - before;
        CHECK(write_by_client(text, size) && read_by_client() && has_read(size));
        RTS_UI32 by_client = frames - before - in_segments;
        CHECK(by_client <= in_segments);
        CHECK(size < SDO_BLOCK_FROM || 4 * by_client < 3 * in_segments);
    }
}

/* Frames 6 to 15 are segments of the first block, of a write and of a read. */
static void a_lost_segment_of_a_block_is_sent_again(void)
{
    for (RTS_UI32 frame = 6; frame <= 15; frame++) {
        begin();
        make_text(frame);
        lost_frame = frame;
        CHECK(write_by_client(text, 890));
        frames = 0;
        CHECK(read_by_client() && has_read(890));
    }
}

static void segments_of_a_block_are_sent_at_the_pace_of_the_owner(void)
{
    begin();
    make_text(6);
    client.burst = 1;
    RTS_UI32 begun_ms = now_ms();
    CHECK(write_by_client(text, 700));
    CHECK(now_ms() - begun_ms >= 99); /* of 100 segments */
    CHECK(read_by_client() && has_read(700));
}

static void one_byte_more_is_refused(void)
{
    static const RTS_UI8 longer[LONGEST + 1] = {'x'};

    begin();
    CHECK(!write_text(longer, sizeof longer));
    CHECK(!write_blocks(longer, sizeof longer));
    CHECK(!write_by_client(longer, sizeof longer));
    CHECK_EQUAL(client.abort, SDO_ABORT_TOO_LONG);
    CHECK(write_text(longer, 1));
}

static void a_request_right_after_a_block_upload_is_served(void)
{
    begin();
    make_text(1);
    CHECK(write_text(text, 100));
    for (RTS_UI32 i = 0; i < 50; i++) {
        CHECK(read_blocks() && has_read(100));
        CHECK(read_text() && has_read(100));
    }
}

static void an_acknowledgement_before_the_end_of_a_block_makes_no_wrong_data(void)
{
    static const RTS_UI8 request[8] = {0xA4, TEXT & 0xFF, TEXT >> 8, 0, BLOCK}, go[8] = {0xA3};
    CAN_FRAME frame;

    make_text(2);
    for (RTS_UI8 early = 0; early < 30; early++) {
        const RTS_UI8 acknowledgement[8] = {0xA2, early, BLOCK};
        begin();
        CHECK(write_text(text, LONGEST));
        say(request);
        CHECK(hears(0xC6, 0xFF, &frame));
        say(go);
        for (RTS_UI8 i = 0; i < early; i++)
            CHECK(receive(&frame) && frame.data[0] == i + 1);
        say(acknowledgement);
        become_quiet();
        give_up();
        CHECK(read_blocks() && has_read(LONGEST));
    }
}

static RTS_I64 time_of(PF_READ read)
{
    RTS_I64 begun = SimCanNow();

    CHECK(read() && has_read(LONGEST));
    return SimCanNow() - begun;
}

static void blocks_are_faster_than_segments(void)
{
    begin();
    make_text(3);
    CHECK(write_text(text, LONGEST));
    CHECK(3 * time_of(read_blocks) < 2 * time_of(read_text));
    CHECK(3 * time_of(read_by_client) < 2 * time_of(read_text));
}

/* ---- with a fault ---- */

static const RTS_UI8 before[] = "before";

static bool is_old_or_new(RTS_UI32 size)
{
    return has_read(size) || (received_size == sizeof before - 1 && memcmp(received, before, sizeof before - 1) == 0);
}

static RTS_UI32 count_frames(PF_WRITE write, PF_READ read, RTS_UI32 size)
{
    begin();
    CHECK(write(text, size) && read() && has_read(size));
    return frames;
}

/* A transfer that says that it has succeeded has; after one that has failed there is the old or the new value. */
static void check_fault(PF_WRITE write, PF_READ read, RTS_UI32 size, RTS_UI32 frame, bool is_lost)
{
    begin();
    CHECK(write_text(before, sizeof before - 1));
    frames = 0;
    *(is_lost ? &lost_frame : &doubled_frame) = frame;
    bool is_written = write(text, size);
    bool is_read = read();
    CHECK(!is_read || (is_written ? has_read(size) : is_old_or_new(size)));
    lost_frame = doubled_frame = NO_FAULT;
    become_quiet();
    bool is_well = read_text() && (is_written ? has_read(size) : is_old_or_new(size));
    if (!is_well)
        fprintf(stderr, "%u bytes, frame %u %s\n", (unsigned)size, (unsigned)frame, is_lost ? "lost" : "twice");
    CHECK(is_well);
    CHECK(write(text, size) && read() && has_read(size));
}

static void check_faults(PF_WRITE write, PF_READ read, RTS_UI32 longest)
{
    static const RTS_UI32 sizes[] = {1, 4, 5, 7, 8, 14, 15, 50, 890};

    make_text(0);
    for (RTS_UI32 i = 0; i < RTS_COUNT(sizes) && sizes[i] <= longest; i++) {
        RTS_UI32 count = count_frames(write, read, sizes[i]);
        for (RTS_UI32 frame = 0; frame < count; frame++) {
            check_fault(write, read, sizes[i], frame, true);
            check_fault(write, read, sizes[i], frame, false);
        }
    }
}

static void a_lost_or_doubled_frame_of_segments_never_makes_wrong_data(void)
{
    check_faults(write_text, read_text, 50);
}

static void a_lost_or_doubled_frame_of_blocks_never_makes_wrong_data(void)
{
    check_faults(write_blocks, read_blocks, 890); /* more than a block */
}

static void a_lost_or_doubled_frame_never_makes_wrong_data_of_the_manager(void)
{
    check_faults(write_by_client, read_by_client, 890);
}

/* After a transfer that was given up its owner waits for a late reply, as CanopenCalls.c does. */
static void wait_for_late_reply(void)
{
    RTS_I64 end_ns = SimCanNow() + (RTS_I64)TIMEOUT_MS * 1000000;
    CAN_FRAME frame;

    while (receive_until(&frame, end_ns))
        ;
}

/* So late that the frame meets the next transfer, it may end that one, too, but by an error. */
static void check_delay(RTS_UI32 size, RTS_UI32 frame, RTS_UI32 ms)
{
    begin();
    CHECK(write_text(before, sizeof before - 1));
    frames = 0;
    delayed_frame = frame;
    delay_ms = ms;
    bool is_written = write_by_client(text, size);
    if (!is_written)
        wait_for_late_reply();
    bool is_read = read_by_client();
    bool is_well = !is_read || (is_written ? has_read(size) : is_old_or_new(size));
    if (!is_read || held.is_held)
        wait_for_late_reply();
    delayed_frame = NO_FAULT;
    is_well = is_well && write_by_client(text, size) && read_by_client() && has_read(size);
    if (!is_well)
        fprintf(stderr, "%u bytes, frame %u, %u ms\n", (unsigned)size, (unsigned)frame, (unsigned)ms);
    CHECK(is_well);
}

static void a_frame_that_is_late_never_makes_wrong_data(void)
{
    static const RTS_UI32 sizes[] = {4, 14, 50, 128, 300};
    static const RTS_UI32 delays_ms[] = {1, 3, 10, 100, 500, 900, 998, 999, 1000, 1001, 1500, 1900};

    make_text(4);
    for (RTS_UI32 i = 0; i < RTS_COUNT(sizes); i++) {
        RTS_UI32 count = count_frames(write_by_client, read_by_client, sizes[i]);
        for (RTS_UI32 frame = 0; frame < count; frame++)
            for (RTS_UI32 delay = 0; delay < RTS_COUNT(delays_ms); delay++)
                check_delay(sizes[i], frame, delays_ms[delay]);
    }
}

int main(void)
{
    RUN(every_size_is_transferred_in_segments);
    RUN(every_size_is_transferred_in_blocks);
    RUN(every_size_is_transferred_by_the_client_of_the_manager);
    RUN(the_client_of_the_manager_takes_blocks_where_they_pay);
    RUN(a_lost_segment_of_a_block_is_sent_again);
    RUN(segments_of_a_block_are_sent_at_the_pace_of_the_owner);
    RUN(one_byte_more_is_refused);
    RUN(a_request_right_after_a_block_upload_is_served);
    RUN(an_acknowledgement_before_the_end_of_a_block_makes_no_wrong_data);
    RUN(blocks_are_faster_than_segments);
    RUN(a_lost_or_doubled_frame_of_segments_never_makes_wrong_data);
    RUN(a_lost_or_doubled_frame_of_blocks_never_makes_wrong_data);
    RUN(a_lost_or_doubled_frame_never_makes_wrong_data_of_the_manager);
    RUN(a_frame_that_is_late_never_makes_wrong_data);
    return test_result();
}
