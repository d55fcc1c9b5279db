/*
 * test_modbus_pieces.c - Modbus on serial hardware that hands over what comes in groups: a frame may arrive in pieces,
 * with pauses that were not on the line, or together with the next one.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "modbus_remotes.h"
#include "test.h"

static const FAKE_HARDWARE both[] = {FAKE_16550, FAKE_USB};

/* ---- a client ---- */

static void begin_on(FAKE_HARDWARE hardware)
{
    begin(1);
    fakes.hardware = hardware;
}

/* Replies of these many bytes: each is taken, and the next request leaves at once. */
static void replies_of_any_length_are_taken(void)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(both); i++) {
        for (RTS_UI16 count = 1; count <= REGISTERS; count++) {
            begin_on(both[i]);
            add(0, (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 0, count, 0, 0, 0, 100});
            remotes[0].data[2 * count - 1] = 0x55;
            run_ms(2000);
            CHECK(ModbusDeviceIsGood(&devices[0]));
            CHECK_EQUAL(devices[0].counters.timeouts, 0);
            CHECK_EQUAL(in[0][0][2 * count - 1], 0x55);
            CHECK_EQUAL(client.link.bad_frames, 0);
            CHECK(remotes[0].asked >= 20);
        }
    }
}

/* The reply has 5 + 2 * 30 bytes, which come in groups of 27. */
static void a_long_reply_is_taken(void)
{
    static RTS_UI8 data[60];
    static RTS_UI8 long_reply[3 + sizeof(data)] = {1, MODBUS_READ_HOLDING_REGISTERS, sizeof(data)};

    for (RTS_UI32 i = 0; i < RTS_COUNT(both); i++) {
        begin_on(both[i]);
        add(0, (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 0, 30, 0, 0, 0, 100});
        remotes[0].fault = SILENT;
        states[0][0].in = data;
        memset(data, 0, sizeof(data));
        long_reply[sizeof(long_reply) - 1] = 0x77;
        while (remotes[0].asked == 0)
            run_ms(1);
        line_send_frame(long_reply, sizeof(long_reply));
        run_ms(80);
        CHECK_EQUAL(data[sizeof(data) - 1], 0x77);
        CHECK_EQUAL(devices[0].counters.timeouts, 0);
    }
}

static void an_exception_is_taken(void)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(both); i++) {
        begin_on(both[i]);
        add(0, read_job(100));
        remotes[0].fault = EXCEPTION;
        run_ms(500);
        CHECK_EQUAL(devices[0].counters.last_exception, MODBUS_DEVICE_FAILURE);
        CHECK_EQUAL(devices[0].counters.timeouts, 0);
    }
}

/* A driver that is switched on or off is a byte or two on the bus. */
static void noise_around_a_reply_does_not_spoil_it(void)
{
    static const RTS_UI8 noise[] = {0x00, 0xFF};

    for (RTS_UI32 i = 0; i < RTS_COUNT(both); i++) {
        begin_on(both[i]);
        add(0, read_job(100));
        for (RTS_UI32 k = 0; k < 2000; k++) {
            RTS_UI32 asked = remotes[0].asked;
            RTS_UI32 waiting = reply_size;
            run_ms(1);
            if (remotes[0].asked != asked)
                line_send(noise, sizeof(noise)); /* before the reply */
            if (waiting != 0 && reply_size == 0)
                line_send(noise, 1); /* after it */
        }
        CHECK_EQUAL(devices[0].counters.timeouts, 0);
        CHECK(remotes[0].asked >= 19);
        CHECK(ModbusDeviceIsGood(&devices[0]));
    }
}

/* A half is not taken for a frame that has ended, however long its other half is away, until the time-out. */
static void half_a_reply_waits_for_the_other_half(void)
{
    static const RTS_UI8 whole[] = {1, MODBUS_READ_HOLDING_REGISTERS, 4, 0, 1, 0, 0x22, 0x2B, 0xEA};

    begin_on(FAKE_EACH);
    CHECK_EQUAL(ModbusCrc(whole, sizeof(whole)), 0);
    add(0, read_job(1000));
    remotes[0].fault = SILENT;
    while (remotes[0].asked == 0)
        run_ms(1);
    line_send(whole, 4);
    run_ms(TIMEOUT_MS - 20);
    line_send(whole + 4, sizeof(whole) - 4);
    run_ms(10);
    CHECK_EQUAL(in[0][0][3], 0x22);
    CHECK_EQUAL(devices[0].counters.timeouts, 0);
    CHECK_EQUAL(client.link.bad_frames, 0);
}

static void silence_before_a_request_stays(void)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(both); i++) {
        begin_on(both[i]);
        add(0, read_job(1));
        for (RTS_UI32 k = 0; k < 20; k++) {
            RTS_UI32 asked = remotes[0].asked;
            while (remotes[0].asked == asked || reply_size != 0 || fakes.to_device.size != 0)
                run_ms(1);
            while (fakes.from_device.size == 0)
                run_ms(1);
            CHECK(fakes.from_device.time_ns[0] - fakes.char_ns - fakes.last_byte_ns >= client.link.silence_ns);
        }
    }
}

/* ---- a server ---- */

enum { UNIT = 7, TICK_NS = 100000, WRITTEN = 40 };

static RTS_UI8 registers[512];
static const MODBUS_RANGE range = {MODBUS_HOLDING_REGISTERS, MODBUS_RANGE_WRITABLE, 0, 0, 1, 8 * sizeof(registers)};
static const MODBUS_MEMORY memory = {&range, registers};
static MODBUS_SERVER server;
static MODBUS_LINK link;
static RTS_UI8 replies[512];
static RTS_UI32 replies_size;

static void begin_server(FAKE_HARDWARE hardware, RTS_UI32 baud)
{
    const SYSCOM_SETTINGS settings = {baud, SYSCOM_PARITY_EVEN, 1, false};

    fakes_begin();
    fakes.hardware = hardware;
    fakes.char_ns = (RTS_I64)11 * 1000000000 / baud;
    memset(&server, 0, sizeof(server));
    memset(&link, 0, sizeof(link));
    memset(registers, 0, sizeof(registers));
    server.unit = UNIT;
    server.memory = &memory;
    server.range_count = 1;
    ModbusRtuBegin(&link, 1, &settings);
}

static void serve_ms(RTS_UI32 ms)
{
    RTS_I64 end = fakes.now_ns + (RTS_I64)ms * MS;

    replies_size = 0;
    for (; fakes.now_ns < end; fakes.now_ns += TICK_NS) {
        (void)ModbusServerPoll(&server, &link, fakes.now_ns);
        replies_size += line_take(replies + replies_size, sizeof(replies) - replies_size);
    }
}

/* A request that writes registers from 0 on; returns its size without the CRC. */
static RTS_UI32 make_write(RTS_UI8 *frame, RTS_UI8 unit, RTS_UI8 count, RTS_UI8 value)
{
    memset(frame, value, 7 + 2u * count);
    frame[0] = unit;
    frame[1] = MODBUS_WRITE_REGISTERS;
    frame[2] = frame[3] = frame[4] = 0;
    frame[5] = count;
    frame[6] = (RTS_UI8)(2 * count);
    return 7 + 2u * count;
}

static const RTS_UI8 read_two[] = {UNIT, MODBUS_READ_HOLDING_REGISTERS, 0, 0, 0, 2};

static bool works(void)
{
    line_send_frame(read_two, sizeof(read_two));
    serve_ms(100);
    return replies_size == 9 && replies[0] == UNIT && ModbusCrc(replies, 9) == 0;
}

static void requests_of_any_length_are_served(void)
{
    static const RTS_UI32 bauds[] = {1200, 9600, 19200, 115200};
    RTS_UI8 frame[300];

    for (RTS_UI32 i = 0; i < RTS_COUNT(both) * RTS_COUNT(bauds); i++) {
        for (RTS_UI8 count = 1; count <= MODBUS_MAX_WRITE_REGISTERS; count = (RTS_UI8)(count + 1 + count / 3)) {
            RTS_UI32 size = make_write(frame, UNIT, count, count);
            begin_server(both[i / RTS_COUNT(bauds)], bauds[i % RTS_COUNT(bauds)]);
            line_send_frame(frame, size);
            serve_ms((RTS_UI32)((size + 50) * fakes.char_ns / MS) + 40);
            CHECK_EQUAL(replies_size, 8);
            CHECK_EQUAL(server.errors, 0);
            CHECK_EQUAL(server.written, 1);
            CHECK_EQUAL(registers[2 * count - 1], count);
            CHECK_EQUAL(link.bad_frames, 0);
        }
    }
}

/* Its beginning, too, has a right CRC: 8 bytes, as the reply to it has. */
static void a_piece_that_looks_like_a_frame_does_not_end_the_request(void)
{
    RTS_UI8 frame[300];
    RTS_UI32 size = 0;

    begin_server(FAKE_16550, 19200);
    for (RTS_UI8 count = 10; size == 0 && count < 60; count++) {
        size = make_write(frame, UNIT, count, 0x33);
        for (frame[3] = 0; frame[3] < 100 && (ModbusCrc(frame, 6) & 0xFF) != frame[6];)
            frame[3]++;
        frame[7] = (RTS_UI8)(ModbusCrc(frame, 6) >> 8);
        size = ModbusCrc(frame, 8) == 0 ? size : 0;
    }
    CHECK(size != 0);
    line_send_frame(frame, size);
    serve_ms(150);
    CHECK_EQUAL(replies_size, 8);
    CHECK_EQUAL(server.errors, 0);
    CHECK_EQUAL(server.written, 1);
}

/* What others say comes with the end of it, and the request after it. */
static void a_request_after_the_frames_of_others_is_served(void)
{
    static const RTS_UI8 to_other[] = {8, MODBUS_READ_HOLDING_REGISTERS, 0, 0, 0, 30};
    static RTS_UI8 of_other[63] = {8, MODBUS_READ_HOLDING_REGISTERS, 60};
    static const RTS_UI8 others[][8] = {{8, 16, 0, 1, 0, 20},      /* a reply, whose request would be longer */
                                        {8, 43, 14, 1, 0},         /* one whose length is not known */
                                        {8, 99, 1, 2, 3, 4, 5, 6}, /* an unknown function */
                                        {8, 0x83, 2}};             /* an exception */
    static const RTS_UI8 sizes[] = {6, 5, 8, 3};

    for (RTS_UI32 baud = 19200; baud <= 115200; baud *= 6) {
        for (RTS_UI32 i = 0; i < 3 * RTS_COUNT(sizes); i++) {
            begin_server(i % 3 == 0 ? FAKE_USB : i % 3 == 1 ? FAKE_16550 : FAKE_EACH, baud);
            serve_ms(i);
            line_send_frame(to_other, sizeof(to_other));
            line_send_frame(of_other, sizeof(of_other));
            line_send_frame(others[i / 3], sizes[i / 3]);
            line_send_frame(read_two, sizeof(read_two)); /* without silence: hardware may hide it */
            serve_ms(150);
            CHECK_EQUAL(replies_size, 9);
            CHECK_EQUAL(server.requests, 1);
            CHECK(works());
        }
    }
}

/* More of them than the buffer has room for, and no pause between. */
static void a_request_after_a_lot_of_others_is_served(void)
{
    RTS_UI8 frame[300];
    RTS_UI32 size = make_write(frame, 9, MODBUS_MAX_WRITE_REGISTERS, 1);

    for (RTS_UI32 i = 0; i < RTS_COUNT(both); i++) {
        begin_server(both[i], 115200);
        for (RTS_UI32 k = 0; k < 3; k++)
            line_send_frame(frame, size);
        line_send_frame(read_two, sizeof(read_two));
        serve_ms(200);
        CHECK_EQUAL(replies_size, 9);
        CHECK_EQUAL(server.written, 0);
    }
}

static void noise_does_not_keep_the_next_request_from_its_reply(void)
{
    static const RTS_UI8 noise[] = {0xFF, 0x00, 0xA7, 0x07, 0x03};
    RTS_UI32 pauses_ms[] = {0, 3, 10, 100};

    for (RTS_UI32 i = 0; i < RTS_COUNT(both); i++) {
        for (RTS_UI32 k = 0; k < RTS_COUNT(noise) * RTS_COUNT(pauses_ms); k++) {
            begin_server(both[i], 19200);
            line_send(noise + k % RTS_COUNT(noise), 1);
            serve_ms(pauses_ms[k / RTS_COUNT(noise)]);
            CHECK(works());
        }
    }
}

/* The beginning of a frame that never ends, and a master that asks again before it is given up: soon it is served. */
static void half_a_request_does_not_lock_up_the_line(void)
{
    RTS_UI8 frame[300];
    RTS_UI32 size = make_write(frame, UNIT, MODBUS_MAX_WRITE_REGISTERS, 0x66);

    for (RTS_UI32 i = 0; i < RTS_COUNT(both); i++) {
        RTS_UI32 asked = 0;
        begin_server(both[i], 19200);
        line_send(frame, size / 4);
        serve_ms(40);
        for (replies_size = 0; replies_size != 9 && asked < 40; asked++) {
            line_send_frame(read_two, sizeof(read_two));
            serve_ms(25);
        }
        CHECK(asked <= 26); /* as many as the frame may still have bytes */
        CHECK_EQUAL(server.written, 0);
        CHECK(works());
    }
}

static void half_a_request_is_given_up_after_a_pause(void)
{
    RTS_UI8 frame[300];
    RTS_UI32 size = make_write(frame, UNIT, 20, 0x66);

    for (RTS_UI32 i = 0; i < RTS_COUNT(both); i++) {
        begin_server(both[i], 19200);
        line_send(frame, size / 2);
        serve_ms(100);
        CHECK_EQUAL(link.bad_frames, 1);
        CHECK_EQUAL(link.fill, 0);
        CHECK(works());
        CHECK_EQUAL(server.written, 0);
    }
}

/* One that has got no reply and is followed by another: the reply would be taken for that to the other one. */
static void only_the_last_request_is_replied_to(void)
{
    begin_server(FAKE_USB, 115200);
    line_send_frame(read_two, sizeof(read_two));
    CHECK(works());
    CHECK_EQUAL(server.requests, 1);
}

static void a_request_of_another_length_gets_its_exception(void)
{
    static const RTS_UI8 unknown[] = {UNIT, 99, 1, 2, 3, 4, 5, 6, 7, 8, 9};
    static const RTS_UI8 too_long[] = {UNIT, MODBUS_READ_HOLDING_REGISTERS, 0, 0, 0, 2, 0};
    static const RTS_UI8 too_short[] = {UNIT, MODBUS_READ_HOLDING_REGISTERS, 0, 0};

    for (RTS_UI32 i = 0; i < RTS_COUNT(both); i++) {
        begin_server(both[i], 19200);
        line_send_frame(unknown, sizeof(unknown));
        serve_ms(150);
        CHECK(replies_size == 5 && replies[2] == MODBUS_ILLEGAL_FUNCTION);
        line_send_frame(too_long, sizeof(too_long));
        serve_ms(150);
        CHECK(replies_size == 5 && replies[2] == MODBUS_ILLEGAL_VALUE);
        line_send_frame(too_short, sizeof(too_short));
        serve_ms(150);
        CHECK(replies_size == 5 && replies[2] == MODBUS_ILLEGAL_VALUE);
        CHECK(works());
    }
}

/* Data of others that are themselves a request to this device, right where a piece ends. */
static void a_request_within_the_data_of_others_is_not_served(void)
{
    RTS_UI8 of_other[3 + 32] = {8, MODBUS_READ_HOLDING_REGISTERS, 32};
    RTS_UI8 forged[8] = {UNIT, MODBUS_WRITE_REGISTER, 0, 1, 0x12, 0x34};
    RTS_UI16 crc = ModbusCrc(forged, 6);

    forged[6] = (RTS_UI8)crc;
    forged[7] = (RTS_UI8)(crc >> 8);
    memcpy(of_other + 8, forged, sizeof(forged));
    begin_server(FAKE_16550, 19200);
    line_send_frame(of_other, sizeof(of_other));
    serve_ms(200);
    CHECK_EQUAL(server.requests, 0);
    CHECK_EQUAL(registers[2], 0);
    CHECK(works());
}

static void silence_before_a_reply_stays(void)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(both); i++) {
        RTS_I64 last_ns;
        begin_server(both[i], 19200);
        line_send_frame(read_two, sizeof(read_two));
        last_ns = fakes.to_device.time_ns[7];
        while (fakes.from_device.size == 0) {
            (void)ModbusServerPoll(&server, &link, fakes.now_ns);
            fakes.now_ns += TICK_NS;
        }
        CHECK(fakes.from_device.time_ns[0] - fakes.char_ns - last_ns >= link.silence_ns);
    }
}

int main(void)
{
    RUN(replies_of_any_length_are_taken);
    RUN(a_long_reply_is_taken);
    RUN(an_exception_is_taken);
    RUN(noise_around_a_reply_does_not_spoil_it);
    RUN(half_a_reply_waits_for_the_other_half);
    RUN(silence_before_a_request_stays);
    RUN(requests_of_any_length_are_served);
    RUN(a_piece_that_looks_like_a_frame_does_not_end_the_request);
    RUN(a_request_after_the_frames_of_others_is_served);
    RUN(a_request_after_a_lot_of_others_is_served);
    RUN(noise_does_not_keep_the_next_request_from_its_reply);
    RUN(half_a_request_does_not_lock_up_the_line);
    RUN(half_a_request_is_given_up_after_a_pause);
    RUN(only_the_last_request_is_replied_to);
    RUN(a_request_of_another_length_gets_its_exception);
    RUN(a_request_within_the_data_of_others_is_not_served);
    RUN(silence_before_a_reply_stays);
    return test_result();
}
