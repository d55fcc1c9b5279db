/*
 * test_isotp.c - IsoTp: every size arrives, whatever block size; what is lost, doubled or out of order is never a packet.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "IsoTp.h"
#include "test.h"

enum { CLASSIC = 8, PACKET_MAX = ISOTP_MAX_PACKET, STEPS = 20000 };

typedef struct {
    RTS_UI8 data[ISOTP_MAX_FRAME];
    RTS_UI32 size;
} FRAME;

/* What the line between both ends does. */
typedef struct {
    RTS_UI32 lose; /* one frame in so many; 0: none */
    RTS_UI32 twice;
    RTS_UI32 swap;
    RTS_UI32 seed;
} LINE;

typedef struct {
    ISOTP_TX tx;
    ISOTP_RX rx;
    RTS_UI8 in[PACKET_MAX];
    RTS_UI8 out[PACKET_MAX];
    RTS_UI32 now_ms;
    RTS_UI32 arrived; /* size of the packet that is complete; 0: none */
    RTS_UI32 frames;
    RTS_UI32 flows;
    RTS_UI32 flow[32]; /* after how many frames */
    FRAME held;        /* by the line, to swap it with the next one */
    bool failed;
    bool aborted;
} PAIR;

static PAIR pair;

static bool happens(LINE *line, RTS_UI32 one_in)
{
    line->seed = line->seed * 1664525u + 1013904223u;
    return one_in != 0 && (line->seed >> 8) % one_in == 0;
}

static void start_pair(RTS_UI32 size, RTS_UI32 frame_max, RTS_UI8 block_size, RTS_UI8 separation)
{
    memset(&pair, 0, sizeof(pair));
    pair.now_ms = 0xFFFFFE00; /* it wraps */
    pair.rx.buffer = pair.in;
    pair.rx.capacity = sizeof(pair.in);
    pair.rx.block_size = block_size;
    pair.rx.separation = separation;
    for (RTS_UI32 i = 0; i < sizeof(pair.out); i++)
        pair.out[i] = (RTS_UI8)(i * 7 + (i >> 8));
    CHECK_EQUAL(IsoTpStart(&pair.tx, pair.out, size, frame_max, pair.now_ms), ERR_OK);
}

static void arrive(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 arrived;
    ISOTP_RX_RESULT result = IsoTpReceive(&pair.rx, data, size, pair.now_ms, &arrived);

    pair.aborted |= result == ISOTP_RX_ABORTED || result == ISOTP_RX_TOO_LONG;
    CHECK((result == ISOTP_RX_DONE) == (arrived != 0));
    if (result == ISOTP_RX_DONE)
        pair.arrived = arrived;
}

static void carry(LINE *line, const FRAME *frame)
{
    FRAME held = pair.held;

    if (happens(line, line->lose))
        return;
    if (held.size == 0 && happens(line, line->swap)) {
        pair.held = *frame;
        return;
    }
    arrive(frame->data, frame->size);
    if (happens(line, line->twice))
        arrive(frame->data, frame->size);
    pair.held.size = 0;
    if (held.size != 0)
        arrive(held.data, held.size);
}

static void carry_flow(LINE *line)
{
    RTS_UI8 flow[ISOTP_FLOW_SIZE];

    if (!IsoTpFlow(&pair.rx, flow))
        return;
    IsoTpFlowSent(&pair.rx);
    pair.flow[pair.flows++ % RTS_COUNT(pair.flow)] = pair.frames;
    if (!happens(line, line->lose))
        pair.failed |= IsoTpTakeFlow(&pair.tx, flow, sizeof(flow), pair.now_ms) == ISOTP_TX_FAILED;
}

/* Lets both ends work until the packet is sent, or given up, and received, or given up. Returns the milliseconds. */
static RTS_UI32 run(LINE line)
{
    RTS_UI32 start = pair.now_ms;

    for (int i = 0; i < STEPS && (IsoTpIsSending(&pair.tx) || IsoTpIsReceiving(&pair.rx)); i++) {
        FRAME frame;
        frame.size = IsoTpNext(&pair.tx, frame.data, pair.now_ms);
        CHECK(frame.size <= pair.tx.frame_max);
        if (frame.size != 0) {
            IsoTpSent(&pair.tx, pair.now_ms);
            pair.frames++;
            carry(&line, &frame);
        } else {
            pair.now_ms++;
        }
        carry_flow(&line);
        pair.failed |= IsoTpSendExpired(&pair.tx, pair.now_ms);
        pair.aborted |= IsoTpReceiveExpired(&pair.rx, pair.now_ms);
    }
    CHECK(!IsoTpIsSending(&pair.tx) && !IsoTpIsReceiving(&pair.rx));
    return pair.now_ms - start;
}

static bool is_whole(RTS_UI32 size)
{
    return pair.arrived == size && memcmp(pair.in, pair.out, size) == 0;
}

static void every_size_arrives_on_classic_can_and_fd(void)
{
    static const RTS_UI32 frames[] = {8, 12, 16, 20, 24, 32, 48, 64};
    const LINE good = {0};

    for (RTS_UI32 f = 0; f < RTS_COUNT(frames); f++) {
        for (RTS_UI32 size = 1; size <= PACKET_MAX; size += size < 200 ? 1 : 61) {
            start_pair(size, frames[f], 0, 0);
            (void)run(good);
            CHECK(is_whole(size) && !pair.failed && !pair.aborted);
        }
    }
}

static void a_packet_of_wrong_length_is_not_begun(void)
{
    ISOTP_TX tx = {.state = ISOTP_TX_IDLE};

    CHECK_EQUAL(IsoTpStart(&tx, pair.out, 0, CLASSIC, 0), ERR_NET_MSGSIZE);
    CHECK_EQUAL(IsoTpStart(&tx, pair.out, PACKET_MAX + 1, CLASSIC, 0), ERR_NET_MSGSIZE);
    CHECK_EQUAL(IsoTpStart(&tx, pair.out, 20, CLASSIC, 0), ERR_OK);
    CHECK_EQUAL(IsoTpStart(&tx, pair.out, 20, CLASSIC, 0), ERR_NOBUFFER);
}

static void the_frames_are_those_of_the_standard(void)
{
    RTS_UI8 frame[ISOTP_MAX_FRAME];
    ISOTP_TX tx = {.state = ISOTP_TX_IDLE};

    (void)IsoTpStart(&tx, (const RTS_UI8 *)"abc", 3, CLASSIC, 0);
    CHECK(IsoTpNext(&tx, frame, 0) == 4 && memcmp(frame,
                                                  "\x03"
                                                  "abc",
                                                  4) == 0);
    IsoTpSent(&tx, 0);
    CHECK(!IsoTpIsSending(&tx));
    (void)IsoTpStart(&tx, (const RTS_UI8 *)"abcdefghij", 10, CLASSIC, 0);
    CHECK(IsoTpNext(&tx, frame, 0) == 8 && memcmp(frame,
                                                  "\x10\x0A"
                                                  "abcdef",
                                                  8) == 0);
    IsoTpSent(&tx, 0);
    CHECK_EQUAL(IsoTpNext(&tx, frame, 0), 0);
    (void)IsoTpTakeFlow(&tx, (const RTS_UI8 *)"\x30\0\0", 3, 0);
    CHECK(IsoTpNext(&tx, frame, 0) == 5 && memcmp(frame,
                                                  "\x21"
                                                  "ghij",
                                                  5) == 0);
    IsoTpSent(&tx, 0);
    (void)IsoTpStart(&tx, (const RTS_UI8 *)"abcdefghij", 10, ISOTP_MAX_FRAME, 0); /* FD */
    CHECK(IsoTpNext(&tx, frame, 0) == 12 && memcmp(frame,
                                                   "\0\x0A"
                                                   "abcdefghij",
                                                   12) == 0);
}

static void flow_control_comes_after_the_first_frame_and_each_block(void)
{
    start_pair(8 * 7 + 6, CLASSIC, 3, 0);
    (void)run((LINE){0});
    CHECK(is_whole(62));
    CHECK(pair.flows == 3 && pair.flow[0] == 1 && pair.flow[1] == 4 && pair.flow[2] == 7);
    start_pair(6 + 3 * 7, CLASSIC, 3, 0); /* none after the last block */
    (void)run((LINE){0});
    CHECK_EQUAL(pair.flows, 1);
}

static void the_separation_time_is_kept(void)
{
    static const struct {
        RTS_UI8 code;
        RTS_UI32 ms;
    } times[] = {{0, 0}, {1, 1}, {0x7F, 127}, {0x80, 127}, {0xF0, 127}, {0xF1, 1}, {0xF9, 1}, {0xFA, 127}, {0xFF, 127}};

    for (RTS_UI32 i = 0; i < RTS_COUNT(times); i++) {
        start_pair(6 + 7 * 5, CLASSIC, 0, times[i].code);
        RTS_UI32 took = run((LINE){0});
        CHECK(took >= 4 * times[i].ms && took <= 4 * (times[i].ms + 2));
        CHECK(is_whole(41));
    }
}

static void a_packet_longer_than_the_buffer_is_refused_at_once(void)
{
    start_pair(300, CLASSIC, 0, 0);
    pair.rx.capacity = 299;
    CHECK(run((LINE){0}) < 10);
    CHECK(pair.failed && pair.arrived == 0 && pair.frames == 1);
    start_pair(5, CLASSIC, 0, 0);
    pair.rx.capacity = 4;
    (void)run((LINE){0});
    CHECK(pair.aborted && pair.arrived == 0);
}

static void a_receiver_that_says_wait_is_waited_for_but_not_for_ever(void)
{
    start_pair(100, CLASSIC, 0, 0);
    RTS_UI8 frame[ISOTP_MAX_FRAME];
    (void)IsoTpNext(&pair.tx, frame, 0);
    IsoTpSent(&pair.tx, 0);
    for (RTS_UI32 i = 1; i <= ISOTP_MAX_WAITS; i++) {
        CHECK(!IsoTpSendExpired(&pair.tx, i * (ISOTP_TIMEOUT_MS - 1)));
        CHECK_EQUAL(IsoTpTakeFlow(&pair.tx, (const RTS_UI8 *)"\x31\0\0", 3, i * (ISOTP_TIMEOUT_MS - 1)),
                    ISOTP_TX_NOTHING);
    }
    CHECK_EQUAL(IsoTpTakeFlow(&pair.tx, (const RTS_UI8 *)"\x31\0\0", 3, 0), ISOTP_TX_FAILED);
    CHECK(!IsoTpIsSending(&pair.tx));
}

static void without_flow_control_a_packet_is_given_up_after_a_second(void)
{
    start_pair(100, CLASSIC, 0, 0);
    RTS_UI32 took = run((LINE){.lose = 1});
    CHECK(pair.failed && took >= ISOTP_TIMEOUT_MS && took <= ISOTP_TIMEOUT_MS + 2);
}

static void a_receiver_that_says_nothing_is_noticed_before(void)
{
    RTS_UI8 frame[ISOTP_MAX_FRAME];

    start_pair(100, CLASSIC, 0, 0);
    CHECK(!IsoTpIsUnheard(&pair.tx, ISOTP_UNHEARD_MS)); /* the first frame waits for the bus */
    (void)IsoTpNext(&pair.tx, frame, 0);
    IsoTpSent(&pair.tx, 0);
    CHECK(!IsoTpIsUnheard(&pair.tx, ISOTP_UNHEARD_MS - 1) && IsoTpIsUnheard(&pair.tx, ISOTP_UNHEARD_MS));
    CHECK_EQUAL(IsoTpTakeFlow(&pair.tx, (const RTS_UI8 *)"\x31\0\0", 3, ISOTP_UNHEARD_MS), ISOTP_TX_NOTHING);
    CHECK(!IsoTpIsUnheard(&pair.tx, 2 * ISOTP_UNHEARD_MS - 1));
    CHECK_EQUAL(IsoTpTakeFlow(&pair.tx, (const RTS_UI8 *)"\x30\0\0", 3, ISOTP_UNHEARD_MS), ISOTP_TX_NOTHING);
    CHECK(!IsoTpIsUnheard(&pair.tx, 4 * ISOTP_UNHEARD_MS));
}

static void a_clock_that_was_read_earlier_ends_nothing(void)
{
    start_pair(100, CLASSIC, 0, 0);
    CHECK(!IsoTpSendExpired(&pair.tx, pair.now_ms - 1));
    RTS_UI8 frame[ISOTP_MAX_FRAME];
    arrive(frame, IsoTpNext(&pair.tx, frame, pair.now_ms));
    CHECK(IsoTpIsReceiving(&pair.rx) && !IsoTpReceiveExpired(&pair.rx, pair.now_ms - 1));
}

/* Flow control that is not one, and frames that belong to no packet. */
static void what_is_out_of_place_changes_nothing(void)
{
    static const struct {
        const char *data;
        RTS_UI32 size;
    } frames[] = {{"", 0},
                  {"\x21zzzzzzz", 8},
                  {"\x30", 1},
                  {"\x30\0", 2},
                  {"\x00", 1},
                  {"\x08"
                   "1234567",
                   8},
                  {"\x40"
                   "1234567",
                   8},
                  {"\xF0", 1},
                  {"\x10\x05"
                   "abcdef",
                   8},
                  {"\x10", 1},
                  {"\x10\x64"
                   "abc",
                   5}};
    ISOTP_RX rx = {.buffer = pair.in, .capacity = sizeof(pair.in)};
    RTS_UI8 flow[ISOTP_FLOW_SIZE];
    RTS_UI32 size;

    for (RTS_UI32 i = 0; i < RTS_COUNT(frames); i++) {
        CHECK(IsoTpReceive(&rx, (const RTS_UI8 *)frames[i].data, frames[i].size, 0, &size) != ISOTP_RX_DONE);
        CHECK(!IsoTpIsReceiving(&rx) && !IsoTpFlow(&rx, flow) && size == 0);
    }
    start_pair(100, CLASSIC, 0, 0);
    CHECK_EQUAL(IsoTpTakeFlow(&pair.tx, (const RTS_UI8 *)"\x32\0\0", 3, 0), ISOTP_TX_NOTHING); /* not waited for */
    CHECK(IsoTpIsSending(&pair.tx));
}

static void a_new_packet_takes_the_place_of_one_that_did_not_end(void)
{
    RTS_UI32 size;
    ISOTP_RX rx = {.buffer = pair.in, .capacity = sizeof(pair.in)};

    CHECK_EQUAL(IsoTpReceive(&rx,
                             (const RTS_UI8 *)"\x10\x64"
                                              "abcdef",
                             8, 0, &size),
                ISOTP_RX_NOTHING);
    CHECK_EQUAL(IsoTpReceive(&rx,
                             (const RTS_UI8 *)"\x10\x0A"
                                              "ABCDEF",
                             8, 0, &size),
                ISOTP_RX_ABORTED);
    CHECK_EQUAL(IsoTpReceive(&rx,
                             (const RTS_UI8 *)"\x21"
                                              "GHIJ",
                             5, 0, &size),
                ISOTP_RX_DONE);
    CHECK(size == 10 && memcmp(pair.in, "ABCDEFGHIJ", 10) == 0);
    (void)IsoTpReceive(&rx,
                       (const RTS_UI8 *)"\x10\x64"
                                        "abcdef",
                       8, 0, &size);
    CHECK_EQUAL(IsoTpReceive(&rx, (const RTS_UI8 *)"\x03xyz", 4, 0, &size), ISOTP_RX_DONE);
    CHECK(!IsoTpIsReceiving(&rx));
}

static void frames_filled_up_to_their_size_are_taken(void)
{
    RTS_UI32 size;
    ISOTP_RX rx = {.buffer = pair.in, .capacity = sizeof(pair.in)};

    CHECK_EQUAL(IsoTpReceive(&rx, (const RTS_UI8 *)"\x03xyz\xCC\xCC\xCC\xCC", 8, 0, &size), ISOTP_RX_DONE);
    CHECK_EQUAL(size, 3);
    (void)IsoTpReceive(&rx,
                       (const RTS_UI8 *)"\x10\x0A"
                                        "ABCDEF",
                       8, 0, &size);
    CHECK_EQUAL(IsoTpReceive(&rx,
                             (const RTS_UI8 *)"\x21"
                                              "GHIJ\xCC\xCC\xCC",
                             8, 0, &size),
                ISOTP_RX_DONE);
    CHECK_EQUAL(size, 10);
}

/* The property of a bad line: a packet that arrives is the packet, and both ends are ready for the next one. */
static void on_a_bad_line_a_packet_arrives_whole_or_not_at_all(void)
{
    RTS_UI32 whole = 0;
    RTS_UI32 runs = 0;

    for (RTS_UI32 seed = 1; seed <= 3000; seed++) {
        LINE line = {seed % 3 == 0 ? 0 : 5 + seed % 60, seed % 5 == 0 ? 3 : 0, seed % 7 == 0 ? 9 : 0, seed * 77777};
        RTS_UI32 size = 1 + seed * 31 % (seed % 4 == 0 ? PACKET_MAX : 300);
        start_pair(size, seed % 2 ? CLASSIC : ISOTP_MAX_FRAME, (RTS_UI8)(seed % 11), 0);
        (void)run(line);
        CHECK(pair.arrived == 0 || is_whole(size));
        whole += pair.arrived != 0;
        runs++;
        CHECK_EQUAL(IsoTpStart(&pair.tx, pair.out, size, CLASSIC, pair.now_ms), ERR_OK);
        pair.arrived = 0;
        pair.held.size = 0;
        (void)run((LINE){0});
        CHECK(is_whole(size));
    }
    CHECK(whole > runs / 10 && whole < runs); /* the line is bad, but not too bad */
}

static void frames_that_come_twice_do_no_harm(void)
{
    start_pair(1000, CLASSIC, 5, 0);
    RTS_UI8 frame[ISOTP_MAX_FRAME];
    (void)IsoTpNext(&pair.tx, frame, pair.now_ms);
    IsoTpSent(&pair.tx, pair.now_ms);
    arrive(frame, CLASSIC);
    carry_flow(&(LINE){0});
    for (int i = 0; i < STEPS && IsoTpIsSending(&pair.tx); i++) {
        RTS_UI32 size = IsoTpNext(&pair.tx, frame, pair.now_ms);
        IsoTpSent(&pair.tx, pair.now_ms);
        arrive(frame, size);
        arrive(frame, size);
        carry_flow(&(LINE){0});
    }
    CHECK(is_whole(1000) && !pair.aborted);
}

int main(void)
{
    RUN(every_size_arrives_on_classic_can_and_fd);
    RUN(a_packet_of_wrong_length_is_not_begun);
    RUN(the_frames_are_those_of_the_standard);
    RUN(flow_control_comes_after_the_first_frame_and_each_block);
    RUN(the_separation_time_is_kept);
    RUN(a_packet_longer_than_the_buffer_is_refused_at_once);
    RUN(a_receiver_that_says_wait_is_waited_for_but_not_for_ever);
    RUN(without_flow_control_a_packet_is_given_up_after_a_second);
    RUN(a_receiver_that_says_nothing_is_noticed_before);
    RUN(a_clock_that_was_read_earlier_ends_nothing);
    RUN(what_is_out_of_place_changes_nothing);
    RUN(a_new_packet_takes_the_place_of_one_that_did_not_end);
    RUN(frames_filled_up_to_their_size_are_taken);
    RUN(on_a_bad_line_a_packet_arrives_whole_or_not_at_all);
    RUN(frames_that_come_twice_do_no_harm);
    return test_result();
}
