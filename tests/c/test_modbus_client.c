/*
 * test_modbus_client.c - a Modbus client on a serial line: its schedule, and what a bad line or a bad device does to it.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The devices are servers of this runtime, at the other end of the line, with faults that the tests give them.
 */
#include "ModbusClient.h"
#include "ModbusPdu.h"
#include "ModbusRtu.h"
#include "ModbusServer.h"
#include "modbus_fakes.h"
#include "rts_config.h"
#include "test.h"

enum { STEP_NS = 250000, MS = 1000000, DEVICES = 3, JOBS = 3, REGISTERS = 8, TIMEOUT_MS = 100 };

typedef enum { WELL, SILENT, LATE, WRONG_UNIT, TOO_SHORT, TOO_LONG, HALF, BAD_CRC, WRONG_FUNCTION, EXCEPTION } FAULT;

typedef struct {
    MODBUS_SERVER server;
    MODBUS_MEMORY memory;
    RTS_UI8 data[2 * REGISTERS];
    FAULT fault;
    RTS_UI32 delay_ms; /* before it replies; 2 */
    RTS_UI32 asked;
    RTS_I64 asked_ns;
    RTS_UI8 function; /* of the last request */
} REMOTE;

static const MODBUS_RANGE range = {MODBUS_HOLDING_REGISTERS | MODBUS_COILS | MODBUS_INPUT_REGISTERS |
                                       MODBUS_DISCRETE_INPUTS,
                                   MODBUS_RANGE_WRITABLE,
                                   0,
                                   0,
                                   1,
                                   REGISTERS * 16};

static REMOTE remotes[DEVICES];
static MODBUS_CLIENT client;
static MODBUS_DEVICE devices[DEVICES];
static MODBUS_JOB jobs[DEVICES][JOBS];
static MODBUS_JOB_STATE states[DEVICES][JOBS];
static RTS_UI8 in[DEVICES][JOBS][2 * REGISTERS];
static RTS_UI8 out[DEVICES][JOBS][2 * REGISTERS];
static RTS_UI8 written[DEVICES][JOBS][2 * REGISTERS];

/* what the devices have received, and what one of them is about to reply */
static RTS_UI8 request[300];
static RTS_UI32 request_size;
static RTS_I64 request_ns; /* of its last byte */
static RTS_UI8 reply[300];
static RTS_UI32 reply_size;
static RTS_I64 reply_ns;

static void begin(RTS_UI32 count)
{
    const SYSCOM_SETTINGS settings = {19200, SYSCOM_PARITY_EVEN, 1, false};

    fakes_begin();
    memset(remotes, 0, sizeof(remotes));
    memset(&client, 0, sizeof(client));
    memset(devices, 0, sizeof(devices));
    memset(jobs, 0, sizeof(jobs));
    memset(states, 0, sizeof(states));
    memset(in, 0, sizeof(in));
    memset(out, 0, sizeof(out));
    request_size = reply_size = 0;
    for (RTS_UI32 i = 0; i < DEVICES; i++) {
        remotes[i].server.unit = (RTS_UI8)(i + 1);
        remotes[i].server.memory = &remotes[i].memory;
        remotes[i].server.range_count = 1;
        remotes[i].memory = (MODBUS_MEMORY){&range, remotes[i].data};
        remotes[i].delay_ms = 2;
        devices[i].unit = (RTS_UI8)(i + 1);
        devices[i].timeout_ms = TIMEOUT_MS;
        devices[i].jobs = states[i];
    }
    ModbusRtuBegin(&client.link, 0, &settings);
    ModbusClientBegin(&client, devices, count);
}

static void add(RTS_UI32 device, MODBUS_JOB job)
{
    RTS_UI32 i = devices[device].job_count++;

    jobs[device][i] = job;
    states[device][i].job = &jobs[device][i];
    states[device][i].in = in[device][i];
    states[device][i].out = out[device][i];
    states[device][i].written = written[device][i];
}

static MODBUS_JOB read_job(RTS_UI32 interval_ms)
{
    return (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 0, 2, 0, 0, 0, interval_ms};
}

static MODBUS_JOB write_job(RTS_UI8 flags, RTS_UI32 interval_ms)
{
    return (MODBUS_JOB){MODBUS_WRITE_REGISTERS, flags, 0, 0, 4, 2, 0, interval_ms};
}

/* ---- the other end of the line ---- */

static void send_reply(void)
{
    line_send(reply, reply_size);
    reply_size = 0;
}

/* The reply with its fault. */
static void spoil(FAULT fault)
{
    RTS_UI16 crc;

    if (fault == WRONG_UNIT)
        reply[0] ^= 0x40;
    else if (fault == WRONG_FUNCTION)
        reply[1] ^= 1;
    else if (fault == TOO_SHORT)
        reply_size -= 1;
    else if (fault == TOO_LONG)
        reply[reply_size++] = 0;
    crc = ModbusCrc(reply, reply_size);
    reply[reply_size++] = (RTS_UI8)crc;
    reply[reply_size++] = (RTS_UI8)(crc >> 8);
    if (fault == HALF)
        reply_size /= 2;
    else if (fault == BAD_CRC)
        reply[reply_size - 1] ^= 0x10;
}

static void serve(REMOTE *remote)
{
    remote->asked++;
    remote->asked_ns = fakes.now_ns;
    remote->function = request[1];
    if (remote->fault == SILENT)
        return;
    memcpy(reply, request, request_size);
    reply_size = 1 + ModbusServerReply(&remote->server, reply + 1, request_size - 3);
    if (remote->fault == EXCEPTION) {
        reply[1] = request[1] | MODBUS_EXCEPTION;
        reply[2] = MODBUS_DEVICE_BUSY;
        reply_size = 3;
    }
    spoil(remote->fault);
    reply_ns = fakes.now_ns + (RTS_I64)(remote->fault == LATE ? TIMEOUT_MS + 50 : remote->delay_ms) * MS;
}

static void run_remotes(void)
{
    RTS_UI32 size = line_take(request + request_size, sizeof(request) - request_size);

    request_size += size;
    if (size != 0)
        request_ns = fakes.now_ns;
    if (request_size != 0 && fakes.now_ns - request_ns > 2 * fakes.char_ns) {
        CHECK_EQUAL(ModbusCrc(request, request_size), 0);
        for (RTS_UI32 i = 0; i < DEVICES; i++) {
            if (request[0] == i + 1 || request[0] == MODBUS_BROADCAST)
                serve(&remotes[i]);
        }
        if (request[0] == MODBUS_BROADCAST)
            reply_size = 0;
        request_size = 0;
    }
    if (reply_size != 0 && fakes.now_ns >= reply_ns)
        send_reply();
}

static void run_ms(RTS_UI32 ms)
{
    RTS_I64 end = fakes.now_ns + (RTS_I64)ms * MS;

    for (; fakes.now_ns < end; fakes.now_ns += STEP_NS) {
        ModbusClientPoll(&client, fakes.now_ns);
        run_remotes();
    }
}

static void set(RTS_UI32 device, RTS_UI32 first, RTS_UI8 value)
{
    remotes[device].data[first] = value;
}

/* ---- what is asked, and when ---- */

static void registers_are_read_every_interval(void)
{
    begin(1);
    add(0, read_job(50));
    set(0, 1, 0x11);
    run_ms(1000);
    CHECK_EQUAL(in[0][0][1], 0x11);
    CHECK(remotes[0].asked >= 20 && remotes[0].asked <= 21);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK_EQUAL(devices[0].counters.timeouts, 0);
    CHECK_EQUAL(devices[0].counters.requests, remotes[0].asked);
    set(0, 1, 0x22);
    run_ms(80);
    CHECK_EQUAL(in[0][0][1], 0x22);
}

static void every_function_reads_and_writes(void)
{
    static const MODBUS_JOB each[] = {
        {MODBUS_READ_COILS, 0, 3, 10, 0, 0, 0, 50},
        {MODBUS_READ_DISCRETE_INPUTS, 0, 3, 10, 0, 0, 0, 50},
        {MODBUS_READ_HOLDING_REGISTERS, 0, 0, 2, 0, 0, 0, 50},
        {MODBUS_READ_INPUT_REGISTERS, 0, 0, 2, 0, 0, 0, 50},
        {MODBUS_WRITE_COIL, 0, 0, 0, 70, 1, 0, 50},
        {MODBUS_WRITE_REGISTER, 0, 0, 0, 4, 1, 0, 50},
        {MODBUS_WRITE_COILS, 0, 0, 0, 64, 12, 0, 50},
        {MODBUS_WRITE_REGISTERS, 0, 0, 0, 4, 2, 0, 50},
        {MODBUS_MASK_WRITE_REGISTER, 0, 0, 0, 4, 1, 0x0F00, 50},
        {MODBUS_READ_WRITE_REGISTERS, 0, 0, 2, 4, 2, 0, 50},
    };
    static const RTS_UI8 read_back[][4] = {
        {0x42, 0x02}, {0x42, 0x02}, {0x12, 0x34, 0x56, 0x78}, {0x12, 0x34, 0x56, 0x78}};
    static const RTS_UI8 device_has[][4] = {
        {0x00, 0x40}, {0xA5, 0xC3}, {0x03, 0xA5}, {0xA5, 0xC3, 0xE1, 0x0F}, {0x05, 0x00}, {0xA5, 0xC3, 0xE1, 0x0F}};

    for (RTS_UI32 i = 0; i < RTS_COUNT(each); i++) {
        begin(1);
        add(0, each[i]);
        memcpy(remotes[0].data, "\x12\x34\x56\x78", 4);
        remotes[0].data[1] = i < 2 ? 0x10 : 0x34; /* bits 3.. of 0x1210: 0x242 */
        memcpy(out[0][0], "\xA5\xC3\xE1\x0F", 4);
        states[0][0].has_out = true;
        run_ms(100);
        CHECK_EQUAL(remotes[0].function, each[i].function);
        CHECK(ModbusDeviceIsGood(&devices[0]));
        CHECK_EQUAL(remotes[0].server.errors, 0);
        if (i < 4)
            CHECK(memcmp(in[0][0], read_back[i], 4) == 0);
        else
            CHECK(memcmp(remotes[0].data + 8, device_has[i - 4], 4) == 0);
        if (each[i].function == MODBUS_READ_WRITE_REGISTERS)
            CHECK(memcmp(in[0][0], remotes[0].data, 4) == 0);
    }
}

static void numbers_are_put_into_the_order_of_memory(void)
{
    static const RTS_UI8 flags[] = {0, MODBUS_JOB_REVERSE_2, MODBUS_JOB_REVERSE_4, MODBUS_JOB_REVERSE_8};
    static const RTS_UI8 memory[][8] = {
        {1, 2, 3, 4, 5, 6, 7, 8}, {2, 1, 4, 3, 6, 5, 8, 7}, {4, 3, 2, 1, 8, 7, 6, 5}, {8, 7, 6, 5, 4, 3, 2, 1}};

    for (RTS_UI32 i = 0; i < RTS_COUNT(flags); i++) {
        begin(1);
        add(0, (MODBUS_JOB){MODBUS_READ_WRITE_REGISTERS, flags[i], 0, 4, 4, 4, 0, 50});
        memcpy(remotes[0].data, memory[0], 8);
        memcpy(out[0][0], memory[i], 8);
        states[0][0].has_out = true;
        run_ms(100);
        CHECK(memcmp(in[0][0], memory[i], 8) == 0);
        CHECK(memcmp(remotes[0].data + 8, memory[0], 8) == 0);
    }
}

static void nothing_is_written_before_the_program_has_run(void)
{
    begin(1);
    add(0, write_job(0, 50));
    add(0, write_job(MODBUS_JOB_ON_CHANGE, 0));
    run_ms(300);
    CHECK_EQUAL(remotes[0].asked, 0);
}

static void a_change_is_written_at_once_and_once(void)
{
    begin(1);
    add(0, write_job(MODBUS_JOB_ON_CHANGE, 0));
    states[0][0].has_out = true;
    run_ms(200);
    CHECK_EQUAL(remotes[0].asked, 1); /* the first value, although it is 0 */
    out[0][0][0] = 5;
    run_ms(20);
    CHECK_EQUAL(remotes[0].asked, 2);
    CHECK_EQUAL(remotes[0].data[8], 5);
    run_ms(10000);
    CHECK_EQUAL(remotes[0].asked, 2);
}

static void a_write_on_change_may_be_repeated_too(void)
{
    begin(1);
    add(0, write_job(MODBUS_JOB_ON_CHANGE, 100));
    states[0][0].has_out = true;
    run_ms(1000);
    CHECK(remotes[0].asked >= 10 && remotes[0].asked <= 11);
    set(0, 8, 99); /* the device has forgotten it */
    run_ms(150);
    CHECK_EQUAL(remotes[0].data[8], 0);
}

static void a_value_that_changes_all_the_time_leaves_time_for_reads(void)
{
    begin(1);
    add(0, write_job(MODBUS_JOB_ON_CHANGE, 0));
    add(0, read_job(100));
    states[0][0].has_out = true;
    for (RTS_UI32 i = 0; i < 1000; i++) {
        out[0][0][0]++;
        run_ms(1);
    }
    CHECK(states[0][1].done_ns > fakes.now_ns - 150 * (RTS_I64)MS);
    CHECK(remotes[0].asked >= 30);
}

/* A line that is too slow for all that is to be asked: all get their turn. */
static void all_get_their_turn_on_a_slow_line(void)
{
    begin(3);
    for (RTS_UI32 i = 0; i < 3; i++)
        for (RTS_UI32 k = 0; k < 3; k++)
            add(i, read_job(10));
    run_ms(3000);
    for (RTS_UI32 i = 0; i < 3; i++) {
        CHECK(remotes[i].asked >= 40);
        CHECK(remotes[i].asked <= remotes[0].asked + 3 && remotes[i].asked + 3 >= remotes[0].asked);
    }
}

static void a_request_does_not_begin_within_silence(void)
{
    begin(1);
    add(0, read_job(1));
    for (RTS_UI32 i = 0; i < 20; i++) {
        RTS_I64 last_ns;
        RTS_UI32 asked = remotes[0].asked;
        while (reply_size != 0 || remotes[0].asked == asked)
            run_ms(1);
        while (reply_size != 0)
            run_ms(1);
        last_ns = fakes.to_device.size != 0 ? fakes.to_device.time_ns[fakes.to_device.size - 1] : fakes.last_byte_ns;
        while (fakes.from_device.size == 0)
            run_ms(1);
        CHECK(fakes.from_device.time_ns[0] - fakes.char_ns - last_ns >= client.link.silence_ns);
    }
}

/* ---- writing that is verified ---- */

static void what_is_written_is_read_back(void)
{
    begin(1);
    add(0, write_job(MODBUS_JOB_ON_CHANGE | MODBUS_JOB_VERIFY | MODBUS_JOB_REVERSE_4, 0));
    states[0][0].has_out = true;
    memcpy(out[0][0], "\x01\x02\x03\x04", 4);
    run_ms(100);
    CHECK_EQUAL(remotes[0].asked, 2);
    CHECK_EQUAL(remotes[0].function, MODBUS_READ_HOLDING_REGISTERS);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK(memcmp(remotes[0].data + 8, "\x04\x03\x02\x01", 4) == 0);
}

/* A device that does not keep what is written to it: it is written again, but not all the time. */
static void what_is_not_kept_is_an_error_and_written_again(void)
{
    begin(1);
    add(0, write_job(MODBUS_JOB_ON_CHANGE | MODBUS_JOB_VERIFY, 0));
    states[0][0].has_out = true;
    out[0][0][0] = 7;
    for (RTS_UI32 i = 0; i < 2400; i++) {
        if (remotes[0].function == MODBUS_WRITE_REGISTERS)
            set(0, 8, 1);
        run_ms(1);
    }
    CHECK(!ModbusDeviceIsGood(&devices[0]));
    CHECK(!ModbusDeviceIsLost(&devices[0]));
    CHECK_EQUAL(devices[0].counters.unverified, 3);
    run_ms(1500);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK_EQUAL(remotes[0].data[8], 7);
}

static void bits_that_are_not_written_are_not_verified(void)
{
    static const MODBUS_JOB each[] = {
        {MODBUS_WRITE_COIL, MODBUS_JOB_VERIFY, 0, 0, 70, 1, 0, 50},
        {MODBUS_WRITE_COILS, MODBUS_JOB_VERIFY, 0, 0, 64, 11, 0, 50},
        {MODBUS_MASK_WRITE_REGISTER, MODBUS_JOB_VERIFY, 0, 0, 4, 1, 0x0F00, 50},
        {MODBUS_MASK_WRITE_REGISTER, MODBUS_JOB_VERIFY | MODBUS_JOB_REVERSE_2, 0, 0, 4, 1, 0x0F00, 50},
    };

    for (RTS_UI32 i = 0; i < RTS_COUNT(each); i++) {
        begin(1);
        add(0, each[i]);
        memset(out[0][0], 0xFF, 4);
        memset(remotes[0].data + 8, 0x30, 2);
        states[0][0].has_out = true;
        run_ms(60);
        CHECK(ModbusDeviceIsGood(&devices[0]));
        CHECK_EQUAL(devices[0].counters.unverified, 0);
    }
}

/* ---- bad devices and lines ---- */

static void check_fault(FAULT fault, RTS_UI32 bad_frames, RTS_UI32 others)
{
    begin(1);
    add(0, read_job(200));
    run_ms(300);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    remotes[0].fault = fault;
    memset(remotes[0].data, 0x77, 4);
    run_ms(2000);
    CHECK(ModbusDeviceIsLost(&devices[0]));
    CHECK_EQUAL(in[0][0][0], 0); /* the last good ones */
    CHECK(devices[0].counters.timeouts >= 2);
    CHECK_EQUAL(client.link.bad_frames != 0, bad_frames != 0);
    CHECK_EQUAL(devices[0].counters.others != 0, others != 0);
    remotes[0].fault = WELL;
    run_ms(1500);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK_EQUAL(in[0][0][0], 0x77);
}

static void a_silent_device_is_lost_and_comes_back(void)
{
    check_fault(SILENT, 0, 0);
}

static void a_late_reply_is_not_taken_for_another(void)
{
    check_fault(LATE, 0, 0);
}

static void a_reply_of_another_unit_is_passed_over(void)
{
    check_fault(WRONG_UNIT, 0, 1);
}

static void a_reply_of_another_function_is_passed_over(void)
{
    check_fault(WRONG_FUNCTION, 0, 1);
}

static void a_reply_that_is_too_short_is_passed_over(void)
{
    check_fault(TOO_SHORT, 0, 1);
}

static void a_reply_that_is_too_long_is_passed_over(void)
{
    check_fault(TOO_LONG, 0, 1);
}

static void half_a_reply_is_none(void)
{
    check_fault(HALF, 1, 0);
}

static void a_reply_with_a_wrong_crc_is_none(void)
{
    check_fault(BAD_CRC, 1, 0);
}

static void one_reply_that_is_lost_is_asked_for_again(void)
{
    begin(1);
    add(0, read_job(200));
    run_ms(300);
    remotes[0].fault = SILENT;
    run_ms(200);
    remotes[0].fault = WELL;
    run_ms(200);
    CHECK_EQUAL(devices[0].counters.timeouts, 1);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

static void an_exception_does_not_make_a_device_lost(void)
{
    begin(1);
    add(0, read_job(100));
    add(0, (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 500, 1, 0, 0, 0, 100});
    run_ms(1000);
    CHECK(!ModbusDeviceIsLost(&devices[0]));
    CHECK(!ModbusDeviceIsGood(&devices[0]));
    CHECK(states[0][0].good);
    CHECK(!states[0][1].good);
    CHECK_EQUAL(devices[0].counters.last_exception, MODBUS_ILLEGAL_ADDRESS);
    CHECK_EQUAL(devices[0].counters.timeouts, 0);
    CHECK(devices[0].counters.exceptions >= 9);
}

static void a_write_that_is_refused_is_tried_once_a_second(void)
{
    begin(1);
    add(0, write_job(MODBUS_JOB_ON_CHANGE, 0));
    states[0][0].has_out = true;
    remotes[0].fault = EXCEPTION;
    run_ms(5500);
    CHECK(remotes[0].asked >= 5 && remotes[0].asked <= 6);
    remotes[0].fault = WELL;
    run_ms(1100);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

/* ---- a dead device, and the others ---- */

/* In every minute after the first the others wait for it at most once; before, three times. */
static void a_dead_device_costs_the_others_less_than_one_time_out_a_minute(void)
{
    RTS_UI32 asked;
    RTS_UI32 expected = 60000 / 50;

    begin(3);
    add(0, read_job(50));
    add(1, read_job(50));
    add(2, read_job(50));
    remotes[1].fault = SILENT;
    run_ms(60000);
    CHECK(devices[1].counters.timeouts <= 4);
    for (RTS_UI32 minute = 0; minute < 10; minute++) {
        RTS_UI32 timeouts = devices[1].counters.timeouts;
        asked = remotes[0].asked;
        run_ms(60000);
        CHECK(devices[1].counters.timeouts <= timeouts + 1);
        CHECK(remotes[0].asked - asked >= expected - 4);
        CHECK(remotes[0].asked - asked <= expected + 4);
    }
    CHECK(devices[1].counters.timeouts <= 3 + 10);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK(ModbusDeviceIsGood(&devices[2]));
    remotes[1].fault = WELL;
    run_ms(62000);
    CHECK(ModbusDeviceIsGood(&devices[1]));
}

static void a_short_loss_is_over_after_some_seconds(void)
{
    begin(2);
    add(0, read_job(50));
    add(1, read_job(50));
    run_ms(500);
    remotes[1].fault = SILENT;
    run_ms(1000);
    CHECK(ModbusDeviceIsLost(&devices[1]));
    remotes[1].fault = WELL;
    run_ms(4500);
    CHECK(ModbusDeviceIsGood(&devices[1]));
}

static void a_line_that_was_pulled_comes_back_with_all_devices(void)
{
    begin(3);
    for (RTS_UI32 i = 0; i < 3; i++)
        add(i, read_job(50));
    run_ms(500);
    fakes.pulled = true;
    run_ms(200000);
    for (RTS_UI32 i = 0; i < 3; i++)
        CHECK(ModbusDeviceIsLost(&devices[i]));
    fakes.pulled = false;
    run_ms(2000);
    for (RTS_UI32 i = 0; i < 3; i++)
        CHECK(ModbusDeviceIsGood(&devices[i]));
}

/* An adapter that was pulled: the port takes nothing more. */
static void a_line_that_takes_no_bytes_is_lost_and_comes_back(void)
{
    begin(2);
    add(0, write_job(0, 50));
    add(1, read_job(50));
    states[0][0].has_out = true;
    out[0][0][0] = 1;
    run_ms(300);
    fakes.write_limit = 0;
    run_ms(3000);
    CHECK(ModbusDeviceIsLost(&devices[0]) && ModbusDeviceIsLost(&devices[1]));
    CHECK(devices[0].counters.requests > 2);
    out[0][0][0] = 2;
    fakes.write_limit = FAKE_LINE_ROOM;
    while (remotes[0].data[8] == 1)
        run_ms(1);
    CHECK_EQUAL(remotes[0].data[8], 2); /* nothing of the time before is sent */
    run_ms(2000);
    CHECK(ModbusDeviceIsGood(&devices[0]) && ModbusDeviceIsGood(&devices[1]));
}

static void a_broadcast_that_does_not_leave_is_no_success(void)
{
    begin(1);
    devices[0].unit = MODBUS_BROADCAST;
    add(0, write_job(0, 50));
    states[0][0].has_out = true;
    fakes.write_limit = 0;
    run_ms(1000);
    CHECK(ModbusDeviceIsLost(&devices[0]));
}

/* It takes longer than the time-out to send. */
static void a_slow_line_is_not_late(void)
{
    begin(1);
    devices[0].timeout_ms = 12;
    add(0, (MODBUS_JOB){MODBUS_WRITE_REGISTERS, 0, 0, 0, 0, REGISTERS, 0, 50});
    states[0][0].has_out = true;
    out[0][0][0] = 1;
    fakes.write_limit = 1;
    run_ms(1000);
    CHECK_EQUAL(devices[0].counters.timeouts, 0);
    CHECK_EQUAL(remotes[0].data[0], 1);
}

static void a_device_that_comes_back_gets_all_outputs_again(void)
{
    begin(1);
    add(0, write_job(MODBUS_JOB_ON_CHANGE, 0));
    add(0, read_job(100));
    states[0][0].has_out = true;
    out[0][0][0] = 9;
    run_ms(300);
    CHECK_EQUAL(remotes[0].data[8], 9);
    remotes[0].fault = SILENT;
    run_ms(1000);
    memset(remotes[0].data, 0, sizeof(remotes[0].data)); /* it was switched off and on */
    remotes[0].fault = WELL;
    run_ms(1500);
    CHECK_EQUAL(remotes[0].data[8], 9);
}

static void a_broadcast_waits_for_no_reply(void)
{
    begin(2);
    devices[0].unit = MODBUS_BROADCAST;
    add(0, write_job(0, 500));
    add(1, read_job(50));
    states[0][0].has_out = true;
    out[0][0][0] = 3;
    run_ms(1000);
    CHECK_EQUAL(remotes[0].data[8], 3);
    CHECK_EQUAL(remotes[2].data[8], 3);
    CHECK(ModbusDeviceIsGood(&devices[1]));
    CHECK_EQUAL(devices[0].counters.timeouts, 0);
}

static void data_are_taken_and_given_under_the_lock(void)
{
    begin(1);
    add(0, (MODBUS_JOB){MODBUS_READ_WRITE_REGISTERS, 0, 0, 2, 4, 2, 0, 5000});
    states[0][0].has_out = true;
    run_ms(50);
    CHECK_EQUAL(remotes[0].asked, 1);
    CHECK_EQUAL(fakes.locks, 2 + 1); /* the third is the device's own */
}

/* ---- calls ---- */

static MODBUS_CALL calls[2];

static void call(RTS_UI32 i, RTS_UI32 device, RTS_UI8 function, RTS_UI16 read_count, RTS_UI16 write_count)
{
    ModbusClientSetCalls(&client, calls, RTS_COUNT(calls));
    calls[i].client = &client;
    calls[i].device = &devices[device];
    calls[i].request = (MODBUS_REQUEST){ModbusFindFunction(function), 0, read_count, 4, write_count, NULL};
    calls[i].due_ns = fakes.now_ns;
    calls[i].state = MODBUS_CALL_WAITS;
}

static void a_call_reads_and_writes_as_every_function_does(void)
{
    static const struct {
        RTS_UI8 function;
        RTS_UI16 read_count;
        RTS_UI16 write_count;
        RTS_UI8 size; /* of the reply's data */
    } each[] = {
        {MODBUS_READ_COILS, 10, 0, 2},
        {MODBUS_READ_DISCRETE_INPUTS, 10, 0, 2},
        {MODBUS_READ_HOLDING_REGISTERS, 2, 0, 4},
        {MODBUS_READ_INPUT_REGISTERS, 2, 0, 4},
        {MODBUS_WRITE_COIL, 0, 1, 0},
        {MODBUS_WRITE_REGISTER, 0, 1, 0},
        {MODBUS_WRITE_COILS, 0, 12, 0},
        {MODBUS_WRITE_REGISTERS, 0, 2, 0},
        {MODBUS_MASK_WRITE_REGISTER, 0, 1, 0},
        {MODBUS_READ_WRITE_REGISTERS, 2, 2, 4},
    };

    for (RTS_UI32 i = 0; i < RTS_COUNT(each); i++) {
        begin(1);
        memcpy(calls[0].data, "\xFF\x00\xE1\x0F", 4);
        memcpy(remotes[0].data, "\x12\x34\x56\x78", 4);
        call(0, 0, each[i].function, each[i].read_count, each[i].write_count);
        run_ms(100);
        CHECK_EQUAL(calls[0].state, MODBUS_CALL_ENDED);
        CHECK_EQUAL(calls[0].result, ERR_OK);
        CHECK_EQUAL(calls[0].size, each[i].size);
        CHECK_EQUAL(remotes[0].function, each[i].function);
        CHECK_EQUAL(remotes[0].asked, 1);
        if (each[i].size == 4)
            CHECK(memcmp(calls[0].data, "\x12\x34\x56\x78", 4) == 0);
        if (each[i].function == MODBUS_WRITE_REGISTERS || each[i].function == MODBUS_READ_WRITE_REGISTERS)
            CHECK(memcmp(remotes[0].data + 8, "\xFF\x00\xE1\x0F", 4) == 0);
    }
}

static void a_refused_call_has_the_exception(void)
{
    begin(1);
    remotes[0].fault = EXCEPTION;
    call(0, 0, MODBUS_READ_HOLDING_REGISTERS, 2, 0);
    run_ms(100);
    CHECK_EQUAL(calls[0].result, ERR_FAILED);
    CHECK_EQUAL(calls[0].exception, MODBUS_DEVICE_BUSY);
}

/* Half a frame, another unit, a late reply: none of them is the reply to a call. */
static void a_call_without_reply_ends_with_the_time_out(void)
{
    static const FAULT faults[] = {SILENT, LATE, WRONG_UNIT, TOO_SHORT, TOO_LONG, HALF, BAD_CRC, WRONG_FUNCTION};

    for (RTS_UI32 i = 0; i < RTS_COUNT(faults); i++) {
        begin(1);
        remotes[0].fault = faults[i];
        call(0, 0, MODBUS_READ_HOLDING_REGISTERS, 2, 0);
        run_ms(TIMEOUT_MS);
        CHECK_EQUAL(calls[0].state, MODBUS_CALL_WAITS);
        run_ms(40);
        CHECK_EQUAL(calls[0].state, MODBUS_CALL_ENDED);
        CHECK_EQUAL(calls[0].result, ERR_TIMEOUT);
    }
}

static void calls_of_a_lost_device_cost_its_line_nothing(void)
{
    RTS_UI32 before;

    begin(2);
    add(1, read_job(20));
    remotes[0].fault = SILENT;
    for (RTS_UI32 i = 0; i < MODBUS_TRIES; i++) {
        call(0, 0, MODBUS_READ_HOLDING_REGISTERS, 2, 0);
        run_ms(2 * TIMEOUT_MS);
    }
    CHECK(ModbusDeviceIsLost(&devices[0]));
    before = remotes[1].asked;
    for (RTS_UI32 i = 0; i < 10; i++) {
        call(0, 0, MODBUS_READ_HOLDING_REGISTERS, 2, 0);
        run_ms(40);
        CHECK_EQUAL(calls[0].result, ERR_TIMEOUT);
    }
    CHECK_EQUAL(remotes[0].asked, MODBUS_TRIES);
    CHECK(remotes[1].asked - before >= 18);
}

static void calls_and_jobs_take_turns_on_a_line_that_is_too_slow(void)
{
    RTS_UI32 ended[2] = {0, 0};

    begin(2);
    for (RTS_UI32 i = 0; i < 3; i++)
        add(1, read_job(10));
    for (RTS_UI32 i = 0; i < 2; i++)
        call(i, 0, MODBUS_READ_HOLDING_REGISTERS, 2, 0);
    for (RTS_UI32 ms = 0; ms < 3000; ms++) {
        run_ms(1);
        for (RTS_UI32 i = 0; i < 2; i++) {
            if (calls[i].state != MODBUS_CALL_ENDED)
                continue;
            ended[i]++;
            call(i, 0, MODBUS_READ_HOLDING_REGISTERS, 2, 0);
        }
    }
    CHECK(ended[0] >= 25 && ended[1] >= 25);
    CHECK(remotes[1].asked >= 75);
}

static void a_device_says_what_it_is(void)
{
    begin(1);
    remotes[0].server.object[0] = "Acme";
    remotes[0].server.object[MODBUS_PRODUCT_NAME] = "Pump";
    memcpy(calls[0].data, "\x0E\x01\x00", 3);
    call(0, 0, MODBUS_ENCAPSULATED, 0, 0);
    run_ms(100);
    CHECK_EQUAL(calls[0].result, ERR_OK);
    CHECK(memcmp(calls[0].data + MODBUS_ID_HEAD - 1,
                 "\x00\x04"
                 "Acme",
                 6) == 0);
    call(0, 0, MODBUS_REPORT_SERVER_ID, 0, 0);
    run_ms(100);
    CHECK_EQUAL(calls[0].size, 1 + 2 + 4);
    CHECK(memcmp(calls[0].data + 3, "Pump", 4) == 0);
}

/* A tty in the network may still have it, and would send it after newer ones. */
static void what_has_got_no_reply_is_taken_back_from_the_port(void)
{
    begin(1);
    add(0, read_job(50));
    run_ms(200);
    CHECK_EQUAL(fakes.discards, 0);
    remotes[0].fault = SILENT;
    run_ms(TIMEOUT_MS + 100);
    CHECK_EQUAL(fakes.discards, 1);
}

int main(void)
{
    RUN(registers_are_read_every_interval);
    RUN(every_function_reads_and_writes);
    RUN(numbers_are_put_into_the_order_of_memory);
    RUN(nothing_is_written_before_the_program_has_run);
    RUN(a_change_is_written_at_once_and_once);
    RUN(a_write_on_change_may_be_repeated_too);
    RUN(a_value_that_changes_all_the_time_leaves_time_for_reads);
    RUN(all_get_their_turn_on_a_slow_line);
    RUN(a_request_does_not_begin_within_silence);
    RUN(what_is_written_is_read_back);
    RUN(what_is_not_kept_is_an_error_and_written_again);
    RUN(bits_that_are_not_written_are_not_verified);
    RUN(a_silent_device_is_lost_and_comes_back);
    RUN(a_late_reply_is_not_taken_for_another);
    RUN(a_reply_of_another_unit_is_passed_over);
    RUN(a_reply_of_another_function_is_passed_over);
    RUN(a_reply_that_is_too_short_is_passed_over);
    RUN(a_reply_that_is_too_long_is_passed_over);
    RUN(half_a_reply_is_none);
    RUN(a_reply_with_a_wrong_crc_is_none);
    RUN(one_reply_that_is_lost_is_asked_for_again);
    RUN(an_exception_does_not_make_a_device_lost);
    RUN(a_write_that_is_refused_is_tried_once_a_second);
    RUN(a_dead_device_costs_the_others_less_than_one_time_out_a_minute);
    RUN(a_short_loss_is_over_after_some_seconds);
    RUN(a_line_that_was_pulled_comes_back_with_all_devices);
    RUN(a_line_that_takes_no_bytes_is_lost_and_comes_back);
    RUN(a_broadcast_that_does_not_leave_is_no_success);
    RUN(a_slow_line_is_not_late);
    RUN(a_device_that_comes_back_gets_all_outputs_again);
    RUN(a_broadcast_waits_for_no_reply);
    RUN(data_are_taken_and_given_under_the_lock);
    RUN(a_call_reads_and_writes_as_every_function_does);
    RUN(a_refused_call_has_the_exception);
    RUN(a_call_without_reply_ends_with_the_time_out);
    RUN(calls_of_a_lost_device_cost_its_line_nothing);
    RUN(calls_and_jobs_take_turns_on_a_line_that_is_too_slow);
    RUN(a_device_says_what_it_is);
    RUN(what_has_got_no_reply_is_taken_back_from_the_port);
    return test_result();
}
