/*
 * test_slcan.c - Slcan: frames become lines and lines frames, whatever comes between them and in whatever pieces.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "Slcan.h"
#include "test.h"

enum { LINE_SIZE = 1 << 14, BIT_RATE = 500000 };

static struct {
    char in[LINE_SIZE];
    RTS_UI32 in_size;
    RTS_UI32 in_read;
    RTS_UI32 read_limit; /* bytes a read gives at most */
    char out[LINE_SIZE];
    RTS_UI32 out_size;
    RTS_UI32 write_limit;
} line;

static SLCAN slcan;
static const CAN_FILTER all[] = {{0, 0, false}, {0, 0, true}};

static RTS_UI32 read_line(RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 there = line.in_size - line.in_read;

    size = size < there ? size : there;
    size = size < line.read_limit ? size : line.read_limit;
    memcpy(data, line.in + line.in_read, size);
    line.in_read += size;
    return size;
}

static RTS_UI32 write_line(const RTS_UI8 *data, RTS_UI32 size)
{
    size = size < line.write_limit ? size : line.write_limit;
    memcpy(line.out + line.out_size, data, size);
    line.out_size += size;
    return size;
}

static void start(void)
{
    memset(&line, 0, sizeof(line));
    line.read_limit = line.write_limit = LINE_SIZE;
    CHECK_EQUAL(SlcanOpen(&slcan, (SLCAN_LINE){read_line, write_line}, BIT_RATE, 0), ERR_OK);
    CHECK_EQUAL(SlcanSetFilters(&slcan, all, RTS_COUNT(all)), ERR_OK);
    line.out_size = 0;
}

static void arrives(const char *text)
{
    RTS_UI32 size = (RTS_UI32)strlen(text);

    memcpy(line.in + line.in_size, text, size);
    line.in_size += size;
}

static const struct {
    CAN_FRAME frame;
    const char *text;
} examples[] = {
    {{.id = 0x123}, "t1230\r"},
    {{.id = 0x7FF, .size = 3, .data = {0xAB, 0, 0xF}}, "t7FF3AB000F\r"},
    {{.id = 0x1F400580, .flags = CAN_FLAG_EXTENDED, .size = 8, .data = {1, 2, 3, 4, 5, 6, 7, 8}},
     "T1F40058080102030405060708\r"},
    {{.id = 5, .flags = CAN_FLAG_REMOTE, .size = 4}, "r0054\r"},
    {{.id = 5, .flags = CAN_FLAG_REMOTE | CAN_FLAG_EXTENDED}, "R000000050\r"},
    {{.id = 1, .flags = CAN_FLAG_FD, .size = 12, .data = {9}}, "d0019090000000000000000000000\r"},
    {{.id = 1, .flags = CAN_FLAG_FD | CAN_FLAG_FAST | CAN_FLAG_EXTENDED, .size = 1, .data = {7}}, "B00000001107\r"},
};

static bool is_same(const CAN_FRAME *a, const CAN_FRAME *b)
{
    RTS_UI32 data = (a->flags & CAN_FLAG_REMOTE) != 0 ? 0 : a->size;

    return a->id == b->id && a->flags == b->flags && a->size == b->size && memcmp(a->data, b->data, data) == 0;
}

static void frames_are_lines_and_lines_are_frames(void)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(examples); i++) {
        char text[SLCAN_TEXT_SIZE];
        CAN_FRAME frame;
        RTS_UI32 size = SlcanEncode(&examples[i].frame, text);
        CHECK(size == strlen(examples[i].text) && memcmp(text, examples[i].text, size) == 0);
        CHECK(SlcanDecode(text, size - 1, &frame) && is_same(&frame, &examples[i].frame));
    }
}

static void every_length_of_fd_fits(void)
{
    for (RTS_UI32 size = 0; size <= CAN_FD_SIZE; size = CanRoundSize(size + 1)) {
        CAN_FRAME frame = {.id = 0x1FFFFFFF, .flags = CAN_FLAG_EXTENDED | CAN_FLAG_FD, .size = (RTS_UI8)size};
        CAN_FRAME back;
        char text[SLCAN_TEXT_SIZE];
        memset(frame.data, 0xA5, sizeof(frame.data));
        RTS_UI32 length = SlcanEncode(&frame, text);
        CHECK(length <= SLCAN_TEXT_SIZE - SLCAN_STAMP_SIZE);
        CHECK(SlcanDecode(text, length - 1, &back) && is_same(&frame, &back));
        if (size == CAN_FD_SIZE)
            break;
    }
}

static void what_is_no_frame_is_passed_over(void)
{
    static const char *const lines[] = {
        "",        "t",      "t12",        "t1239",    "t12",     "t123",  "t1231", "t12310",        "t123100A",
        "tXYZ0",   "t8000",  "T200000000", "T1F40058", "x0000",   "V1013", "z",     "t12300000FFFF", "r1239",
        "d123F00", "b1230A", "OK",         "t 230",    "t1231 0", "\a",    "t123@", "tt1230",        "T1F400580G",
        "d1239",   "t123F",  "t123A",      "d123A",    "t12319",
    };
    CAN_FRAME frame;

    start();
    for (RTS_UI32 i = 0; i < RTS_COUNT(lines); i++) {
        CHECK(!SlcanDecode(lines[i], (RTS_UI32)strlen(lines[i]), &frame));
        arrives(lines[i]);
        arrives("\r");
        arrives("t0011AA\r");
        CHECK(SlcanReceive(&slcan, &frame) == ERR_OK && frame.id == 1 && frame.data[0] == 0xAA);
        CHECK_EQUAL(SlcanReceive(&slcan, &frame), ERR_NOTHING_TO_DO);
    }
}

static void time_stamps_and_line_feeds_are_allowed(void)
{
    CAN_FRAME frame;

    start();
    arrives("t0012AABB1234\rt0020\r\nT000000030BEEF\r");
    CHECK(SlcanReceive(&slcan, &frame) == ERR_OK && frame.id == 1 && frame.size == 2);
    CHECK(SlcanReceive(&slcan, &frame) == ERR_OK && frame.id == 2);
    CHECK(SlcanReceive(&slcan, &frame) == ERR_OK && frame.id == 3);
}

static void frames_come_in_any_pieces_and_only_those_that_pass(void)
{
    const CAN_FILTER some = {0x100, 0x7F0, false};
    CAN_FRAME frame;

    for (RTS_UI32 piece = 1; piece < 40; piece += 3) {
        start();
        line.read_limit = piece;
        CHECK_EQUAL(SlcanSetFilters(&slcan, &some, 1), ERR_OK);
        arrives("t10511A\rT0000010580102030405060708\rt20510\rt10F0\r");
        RTS_UI32 got = 0;
        for (int i = 0; i < 200; i++)
            got += SlcanReceive(&slcan, &frame) == ERR_OK;
        CHECK(got == 2 && frame.id == 0x10F);
    }
}

static void a_line_that_never_ends_is_one_damaged_line(void)
{
    CAN_FRAME frame;

    start();
    for (int i = 0; i < 1000; i++)
        arrives("0123456789");
    arrives("\rt0010\r");
    while (SlcanReceive(&slcan, &frame) != ERR_OK)
        CHECK(line.in_read < line.in_size);
    CHECK(frame.id == 1 && slcan.lost == 1);
}

static void a_line_that_is_full_is_waited_for(void)
{
    CAN_FRAME frame;

    start();
    line.write_limit = 5;
    CHECK_EQUAL(SlcanSend(&slcan, &examples[2].frame), ERR_OK);
    CHECK_EQUAL(SlcanSend(&slcan, &examples[0].frame), ERR_NOBUFFER);
    for (int i = 0; i < 10; i++)
        (void)SlcanReceive(&slcan, &frame); /* each cycle looks for frames */
    CHECK_EQUAL(SlcanSend(&slcan, &examples[0].frame), ERR_OK);
    line.write_limit = LINE_SIZE;
    (void)SlcanReceive(&slcan, &frame);
    CHECK(line.out_size == 33 && memcmp(line.out, "T1F40058080102030405060708\rt1230\r", 33) == 0);
    CHECK_EQUAL(SlcanSend(&slcan, &(CAN_FRAME){.id = 0x800}), ERR_PARAMETER);
}

static void an_adapter_is_opened_at_the_bit_rate(void)
{
    start();
    CHECK_EQUAL(SlcanOpen(&slcan, (SLCAN_LINE){read_line, write_line}, 500000, 2000000), ERR_OK);
    CHECK(line.out_size == 11 && memcmp(line.out, "\rC\rS6\rY2\rO\r", 11) == 0);
    line.out_size = 0;
    CHECK_EQUAL(SlcanOpen(&slcan, (SLCAN_LINE){read_line, write_line}, 83300, 0), ERR_OK);
    CHECK(line.out_size == 8 && memcmp(line.out, "\rC\rS9\rO\r", 8) == 0);
    CHECK_EQUAL(SlcanOpen(&slcan, (SLCAN_LINE){read_line, write_line}, 123456, 0), ERR_NOT_SUPPORTED);
    CHECK_EQUAL(SlcanOpen(&slcan, (SLCAN_LINE){read_line, write_line}, 500000, 3000000), ERR_NOT_SUPPORTED);
}

/* After what the adapter has said. */
static CAN_STATE state_after(const char *text)
{
    CAN_FRAME frame;
    CAN_STATE state;

    arrives(text);
    CHECK_EQUAL(SlcanReceive(&slcan, &frame), ERR_NOTHING_TO_DO);
    SlcanGetState(&slcan, &state);
    return state;
}

static bool is_sent(const char *text)
{
    bool is = line.out_size == strlen(text) && memcmp(line.out, text, line.out_size) == 0;

    line.out_size = 0;
    return is;
}

static void an_adapter_that_reports_its_state_is_believed(void)
{
    start();
    CAN_STATE state = state_after("");
    CHECK(state.bus == CAN_BUS_ACTIVE && state.tx_errors == 0 && state.rx_errors == 0);
    CHECK(state.bit_rate == BIT_RATE && state.data_bit_rate == 0);
    state = state_after("sw057101\r");
    CHECK(state.bus == CAN_BUS_WARNING && state.rx_errors == 57 && state.tx_errors == 101);
    CHECK_EQUAL(state_after("sp000128\r").bus, CAN_BUS_PASSIVE);
    CHECK_EQUAL(state_after("sa000000\r").bus, CAN_BUS_ACTIVE);
    CHECK_EQUAL(state_after("sb256256\r").bus, CAN_BUS_OFF);
    CHECK_EQUAL(state_after("").lost, 0);
}

static void what_is_no_report_changes_no_state(void)
{
    static const char *const lines[] = {"sb25625\r",  "sb2562560\r", "sx000000\r", "s\r",  "sb25A256\r",
                                        "sb256 56\r", "sb256256\a",  "b256256\r",  "F2\r", "F200\r",
                                        "FX0\r",      "f20\r",       "F20\a",      "20\r"};

    start();
    for (RTS_UI32 i = 0; i < RTS_COUNT(lines); i++)
        CHECK_EQUAL(state_after(lines[i]).bus, CAN_BUS_ACTIVE);
}

static void bus_off_ends_when_the_adapter_is_opened_again(void)
{
    start();
    SlcanRestart(&slcan);
    CHECK(is_sent(""));
    CHECK_EQUAL(state_after("sb256256\r").bus, CAN_BUS_OFF);
    CHECK_EQUAL(SlcanSend(&slcan, &examples[0].frame), ERR_DEVICE);
    CHECK_EQUAL(state_after("F00\r").bus, CAN_BUS_OFF); /* flags do not say bus off */
    SlcanRestart(&slcan);
    CHECK(is_sent("\rC\rS6\rO\r"));
    CAN_STATE state = state_after("\r\r\r");
    CHECK(state.bus == CAN_BUS_ACTIVE && state.tx_errors == 0);
    CHECK_EQUAL(SlcanSend(&slcan, &examples[0].frame), ERR_OK);
    CHECK(is_sent(examples[0].text));
}

/* The adapter would take the first command for a part of it, and refuse the others while it is open. */
static void a_frame_that_was_cut_takes_no_command_with_it(void)
{
    start();
    line.write_limit = 5;
    CHECK_EQUAL(SlcanSend(&slcan, &examples[2].frame), ERR_OK);
    line.write_limit = 0;
    CHECK_EQUAL(state_after("sb256256\r").bus, CAN_BUS_OFF);
    line.write_limit = LINE_SIZE;
    SlcanRestart(&slcan);
    CHECK(is_sent("T1F40\rC\rS6\rO\r"));
}

static void the_flags_are_asked_for_now_and_then_and_their_answer_is_the_state(void)
{
    start();
    SlcanAsk(&slcan, SLCAN_ASK_MS - 1);
    CHECK(is_sent(""));
    SlcanAsk(&slcan, SLCAN_ASK_MS);
    CHECK(is_sent("F\r"));
    SlcanAsk(&slcan, 2 * SLCAN_ASK_MS - 1);
    CHECK(is_sent(""));
    CHECK_EQUAL(state_after("F04\r").bus, CAN_BUS_WARNING);
    CHECK_EQUAL(state_after("F24\r").bus, CAN_BUS_PASSIVE);
    CHECK_EQUAL(state_after("F80\r").bus, CAN_BUS_ACTIVE);
    CHECK_EQUAL(state_after("\a").bus, CAN_BUS_ACTIVE); /* it does not know F */
    CHECK_EQUAL(state_after("").lost, 0);
    CHECK_EQUAL(state_after("F08\r").lost, 1);
    CHECK_EQUAL(state_after("F01\r").lost, 2);
}

static void a_frame_that_the_line_has_not_taken_is_not_cut_by_a_question(void)
{
    CAN_FRAME frame;

    start();
    line.write_limit = 2;
    CHECK_EQUAL(SlcanSend(&slcan, &examples[0].frame), ERR_OK);
    SlcanAsk(&slcan, SLCAN_ASK_MS); /* four of six characters */
    CHECK(line.out_size == 4);
    line.write_limit = LINE_SIZE;
    SlcanAsk(&slcan, SLCAN_ASK_MS);
    CHECK_EQUAL(SlcanSend(&slcan, &examples[0].frame), ERR_OK);
    (void)SlcanReceive(&slcan, &frame);
    CHECK(is_sent("t1230\rF\rt1230\r"));
}

int main(void)
{
    RUN(frames_are_lines_and_lines_are_frames);
    RUN(every_length_of_fd_fits);
    RUN(what_is_no_frame_is_passed_over);
    RUN(time_stamps_and_line_feeds_are_allowed);
    RUN(frames_come_in_any_pieces_and_only_those_that_pass);
    RUN(a_line_that_never_ends_is_one_damaged_line);
    RUN(a_line_that_is_full_is_waited_for);
    RUN(an_adapter_is_opened_at_the_bit_rate);
    RUN(an_adapter_that_reports_its_state_is_believed);
    RUN(what_is_no_report_changes_no_state);
    RUN(bus_off_ends_when_the_adapter_is_opened_again);
    RUN(a_frame_that_was_cut_takes_no_command_with_it);
    RUN(the_flags_are_asked_for_now_and_then_and_their_answer_is_the_state);
    RUN(a_frame_that_the_line_has_not_taken_is_not_cut_by_a_question);
    return test_result();
}
