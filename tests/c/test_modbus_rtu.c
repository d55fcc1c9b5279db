/*
 * test_modbus_rtu.c - Modbus frames on a serial line: silence, CRC, unit, and what a bad line does to them.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusPdu.h"
#include "ModbusRtu.h"
#include "ModbusServer.h"
#include "modbus_fakes.h"
#include "test.h"

enum { STEP_NS = 100000, MS = 1000000 };

static RTS_UI8 registers[20];
static const MODBUS_RANGE range = {MODBUS_HOLDING_REGISTERS, MODBUS_RANGE_WRITABLE, 0, 0, 1, 160};
static const MODBUS_MEMORY memory = {&range, registers};
static MODBUS_SERVER server;
static MODBUS_LINK link;
static RTS_UI8 reply[512];
static RTS_UI32 reply_size;
static RTS_I64 reply_ns; /* when its first byte was on the line */

static void begin_at(RTS_UI32 baud, RTS_UI8 parity, RTS_UI8 stop_bits)
{
    const SYSCOM_SETTINGS settings = {baud, parity, stop_bits, false};

    fakes_begin();
    memset(&server, 0, sizeof(server));
    memset(&link, 0, sizeof(link));
    memset(registers, 0, sizeof(registers));
    server.unit = 7;
    server.memory = &memory;
    server.range_count = 1;
    fakes.char_ns = (RTS_I64)1000000000 * (10 + (parity != SYSCOM_PARITY_NONE) + stop_bits - 1) / baud;
    ModbusRtuBegin(&link, 1, &settings);
}

static void begin(void)
{
    begin_at(19200, SYSCOM_PARITY_EVEN, 1);
}

/* The server runs for a while; what it sends is in `reply`. */
static void run_ms(RTS_UI32 ms)
{
    RTS_I64 end = fakes.now_ns + (RTS_I64)ms * MS;

    reply_size = 0;
    reply_ns = 0;
    for (; fakes.now_ns < end; fakes.now_ns += STEP_NS) {
        (void)ModbusServerPoll(&server, &link, fakes.now_ns);
        if (fakes.from_device.size != 0 && reply_ns == 0)
            reply_ns = fakes.from_device.time_ns[0] - fakes.char_ns;
        reply_size += line_take(reply + reply_size, sizeof(reply) - reply_size);
    }
}

static const RTS_UI8 read_two[] = {7, 3, 0, 0, 0, 2};

/* Whether a good request is replied to now. */
static bool works(void)
{
    line_send_frame(read_two, sizeof(read_two));
    run_ms(300);
    return reply_size == 9 && reply[0] == 7 && reply[1] == 3 && reply[2] == 4 && ModbusCrc(reply, 9) == 0;
}

static void crc_is_that_of_the_standard(void)
{
    CHECK_EQUAL(ModbusCrc((const RTS_UI8 *)"123456789", 9), 0x4B37);
    CHECK_EQUAL(ModbusCrc((const RTS_UI8 *)"\x02\x07", 2), 0x1241); /* example of the standard: 41 12 on the line */
}

static void a_request_is_replied_to_after_silence(void)
{
    RTS_I64 last_ns;

    begin();
    line_send_frame(read_two, sizeof(read_two));
    last_ns = fakes.to_device.time_ns[7];
    run_ms(100);
    CHECK_EQUAL(reply_size, 9);
    CHECK(reply_ns - last_ns >= fakes.char_ns * 7 / 2);
    CHECK(reply_ns - last_ns < fakes.char_ns * 7 / 2 + 2 * STEP_NS);
}

static void silence_is_shorter_at_higher_speeds_down_to_a_limit(void)
{
    static const struct {
        RTS_UI32 baud;
        RTS_UI8 parity;
        RTS_UI8 stop_bits;
        RTS_I64 silence_us;
    } rows[] = {
        {1200, SYSCOM_PARITY_EVEN, 1, 32083},   {9600, SYSCOM_PARITY_NONE, 2, 4010},
        {9600, SYSCOM_PARITY_NONE, 1, 3645},    {19200, SYSCOM_PARITY_ODD, 1, 2005},
        {38400, SYSCOM_PARITY_EVEN, 1, 1750},   {115200, SYSCOM_PARITY_EVEN, 1, 1750},
        {4000000, SYSCOM_PARITY_NONE, 1, 1750},
    };

    for (RTS_UI32 i = 0; i < RTS_COUNT(rows); i++) {
        begin_at(rows[i].baud, rows[i].parity, rows[i].stop_bits);
        CHECK_EQUAL(link.silence_ns / 1000, rows[i].silence_us);
        CHECK(works());
    }
}

static void other_units_and_broadcasts_get_no_reply(void)
{
    static const RTS_UI8 other[] = {8, 3, 0, 0, 0, 2};
    static const RTS_UI8 broadcast[] = {0, 6, 0, 1, 0x12, 0x34};

    begin();
    line_send_frame(other, sizeof(other));
    run_ms(100);
    CHECK_EQUAL(reply_size, 0);
    line_send_frame(broadcast, sizeof(broadcast));
    run_ms(100);
    CHECK_EQUAL(reply_size, 0);
    CHECK_EQUAL(registers[2], 0x12); /* it was done all the same */
    CHECK_EQUAL(server.requests, 1);
    CHECK_EQUAL(link.bad_frames, 0);
    CHECK(works());
}

static void two_masters_are_both_served_and_disturb_only_each_other(void)
{
    static const RTS_UI8 to_another[] = {8, 16, 0, 1, 0, 1, 2, 0x12, 0x34};
    static const RTS_UI8 its_reply[] = {8, 16, 0, 1, 0, 1};
    static const RTS_UI8 ours[] = {7, 6, 0, 1, 0x12, 0x34};

    begin();
    for (RTS_UI32 i = 0; i < 10; i++) {
        RTS_UI32 bad = link.bad_frames;

        line_send_frame(to_another, sizeof(to_another));
        run_ms(100);
        line_send_frame(its_reply, sizeof(its_reply));
        run_ms(100);
        CHECK(reply_size == 0 && registers[2] == 0 && link.bad_frames == bad);
        CHECK(works());
        line_send(ours, sizeof(ours)); /* both at a time: the bytes of one frame within those of the other */
        line_send_frame(its_reply, sizeof(its_reply));
        run_ms(100);
        CHECK(reply_size == 0 && registers[2] == 0);
        CHECK_EQUAL(link.bad_frames, bad + 1);
        CHECK(works());
    }
}

static void a_wrong_crc_gets_no_reply(void)
{
    static const RTS_UI8 bad[] = {7, 6, 0, 1, 0x12, 0x34, 0, 0};

    begin();
    line_send(bad, sizeof(bad));
    run_ms(100);
    CHECK_EQUAL(reply_size, 0);
    CHECK_EQUAL(registers[2], 0);
    CHECK_EQUAL(link.bad_frames, 1);
    CHECK(works());
}

static void half_a_frame_is_forgotten_after_silence(void)
{
    begin();
    line_send(read_two, 4);
    run_ms(20);
    CHECK_EQUAL(link.bad_frames, 1);
    CHECK(works());
    line_send(read_two, 1);
    run_ms(20);
    CHECK_EQUAL(link.bad_frames, 2);
    CHECK(works());
}

static void a_frame_that_is_too_long_is_forgotten(void)
{
    static RTS_UI8 noise[1000];

    begin();
    memset(noise, 0x55, sizeof(noise));
    line_send(noise, sizeof(noise));
    run_ms(1000);
    CHECK_EQUAL(reply_size, 0);
    CHECK_EQUAL(link.bad_frames, 1);
    CHECK(works());
}

/* Also if its beginning is a good one. */
static void a_frame_that_goes_on_is_not_taken(void)
{
    static RTS_UI8 frame[257];
    RTS_UI16 crc;

    for (RTS_UI32 limit = 1; limit <= FAKE_LINE_ROOM; limit *= 4) {
        begin();
        fakes.read_limit = limit;
        memcpy(frame, read_two, sizeof(read_two));
        crc = ModbusCrc(frame, 254);
        frame[254] = (RTS_UI8)crc;
        frame[255] = (RTS_UI8)(crc >> 8);
        line_send(frame, 256);
        run_ms(300);
        CHECK_EQUAL(server.requests, 1);
        line_send(frame, 257);
        run_ms(300);
        CHECK_EQUAL(server.requests, 1);
        CHECK_EQUAL(link.bad_frames, 1);
        CHECK(works());
    }
}

/* Its bytes come as fast as they are read: each pass ends all the same. */
static void a_line_that_babbles_holds_up_no_pass(void)
{
    static RTS_UI8 pdu[MODBUS_MAX_PDU];

    begin();
    fakes.babbles = true;
    for (RTS_UI32 i = 0; i < 10; i++, fakes.now_ns += STEP_NS) {
        fakes.reads = 0;
        CHECK(!ModbusServerPoll(&server, &link, fakes.now_ns));
        CHECK(!ModbusRtuReady(&link, fakes.now_ns));
        CHECK(fakes.reads <= 4);
    }
    memcpy(link.frame + MODBUS_AT_PDU, pdu, sizeof(pdu));
    fakes.reads = 0;
    ModbusRtuSend(&link, sizeof(pdu), fakes.now_ns);
    CHECK_EQUAL(fakes.reads, 1);
    fakes.babbles = false;
    run_ms(300);
    CHECK(works());
}

/* The longest frame there is has 256 bytes: a CRC that fits after more must not count. */
static void frames_have_256_bytes_at_most(void)
{
    static RTS_UI8 frame[258];

    for (RTS_UI32 size = 255; size <= 258; size++) {
        begin();
        frame[0] = 7;
        frame[1] = 99;
        line_send_frame(frame, size - MODBUS_CRC_SIZE);
        run_ms(300);
        CHECK_EQUAL(reply_size, size <= 256 ? 5 : 0); /* an exception */
        CHECK_EQUAL(link.bad_frames, size <= 256 ? 0 : 1);
    }
}

static void a_line_that_takes_few_bytes_at_a_time_sends_all(void)
{
    begin();
    fakes.write_limit = 2;
    CHECK(works());
    fakes.write_limit = 1;
    CHECK(works());
}

static void a_flood_does_not_stop_the_server(void)
{
    begin();
    for (int i = 0; i < 200; i++)
        line_send_frame(read_two, sizeof(read_two)); /* without silence between */
    run_ms(1500);
    CHECK(works());
}

static void every_reply_can_be_lost_and_the_next_comes(void)
{
    begin();
    fakes.pulled = true;
    CHECK(!works());
    fakes.pulled = false;
    CHECK(works());
}

/* The master would take it for the reply to what it has asked meanwhile. */
static void a_reply_that_does_not_leave_in_time_is_given_up(void)
{
    begin();
    fakes.write_limit = 0;
    CHECK(!works());
    fakes.write_limit = FAKE_LINE_ROOM;
    run_ms(300);
    CHECK_EQUAL(reply_size, 0);
    CHECK(works());
}

int main(void)
{
    RUN(crc_is_that_of_the_standard);
    RUN(a_request_is_replied_to_after_silence);
    RUN(silence_is_shorter_at_higher_speeds_down_to_a_limit);
    RUN(other_units_and_broadcasts_get_no_reply);
    RUN(two_masters_are_both_served_and_disturb_only_each_other);
    RUN(a_wrong_crc_gets_no_reply);
    RUN(half_a_frame_is_forgotten_after_silence);
    RUN(a_frame_that_is_too_long_is_forgotten);
    RUN(a_frame_that_goes_on_is_not_taken);
    RUN(a_line_that_babbles_holds_up_no_pass);
    RUN(frames_have_256_bytes_at_most);
    RUN(a_line_that_takes_few_bytes_at_a_time_sends_all);
    RUN(a_flood_does_not_stop_the_server);
    RUN(a_reply_that_does_not_leave_in_time_is_given_up);
    RUN(every_reply_can_be_lost_and_the_next_comes);
    return test_result();
}
