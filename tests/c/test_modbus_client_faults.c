/*
 * test_modbus_client_faults.c - what a bad line or a bad device does to a Modbus client on a serial line.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "modbus_remotes.h"
#include "rts_config.h"
#include "test.h"

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

static void begin_exception(RTS_UI8 exception)
{
    begin(1);
    add(0, read_job(100));
    remotes[0].fault = EXCEPTION;
    remotes[0].exception = exception;
}

static void both_exceptions_of_a_gateway_count_as_silence(void)
{
    static const RTS_UI8 exceptions[] = {MODBUS_NO_PATH, MODBUS_NO_TARGET};

    for (RTS_UI32 i = 0; i < RTS_COUNT(exceptions); i++) {
        begin_exception(exceptions[i]);
        run_ms(1000);
        CHECK(ModbusDeviceIsLost(&devices[0]));
        CHECK_EQUAL(devices[0].miss, MODBUS_MISS_GATEWAY);
        CHECK_EQUAL(devices[0].counters.last_exception, exceptions[i]);
        CHECK_EQUAL(devices[0].counters.exceptions, 0);
    }
}

/* Also before the first good reply. */
static void a_device_that_acknowledges_is_asked_again_as_one_that_is_busy(void)
{
    begin_exception(MODBUS_ACKNOWLEDGE);
    run_ms(50);
    CHECK_EQUAL(devices[0].busy, 1);
    CHECK_EQUAL(devices[0].counters.exceptions, 0);
    remotes[0].fault = WELL;
    run_ms(200);
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

/* Each minute the others wait for it six times at most. */
static void a_dead_device_costs_the_others_one_time_out_in_ten_seconds(void)
{
    RTS_UI32 asked;
    RTS_UI32 expected = 60000 / 50;

    begin(3);
    add(0, read_job(50));
    add(1, read_job(50));
    add(2, read_job(50));
    remotes[1].fault = SILENT;
    run_ms(60000);
    CHECK(devices[1].counters.timeouts <= 3 + 6);
    for (RTS_UI32 minute = 0; minute < 10; minute++) {
        RTS_UI32 timeouts = devices[1].counters.timeouts;
        asked = remotes[0].asked;
        run_ms(60000);
        CHECK(devices[1].counters.timeouts <= timeouts + 6);
        CHECK(remotes[0].asked - asked >= expected - 6 * 4);
        CHECK(remotes[0].asked - asked <= expected + 6 * 4);
    }
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK(ModbusDeviceIsGood(&devices[2]));
    remotes[1].fault = WELL;
    run_ms(MODBUS_RETRY_MS + 1000);
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

/* One that was dead before would be asked once in ten seconds. */
static void a_line_that_comes_back_asks_all_its_devices_at_once(void)
{
    begin(2);
    add(0, read_job(50));
    add(1, read_job(50));
    remotes[1].fault = SILENT;
    run_ms(20000);
    while (devices[1].retry_ns - fakes.now_ns < (RTS_I64)8000 * MS)
        run_ms(1);
    fakes.pulled = true;
    run_ms(3000);
    remotes[1].fault = WELL;
    fakes.pulled = false;
    run_ms(1500);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK(ModbusDeviceIsGood(&devices[1]));
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
    CHECK(ModbusDeviceIsGood(&devices[0]) && ModbusDeviceIsGood(&devices[1]));
    CHECK_EQUAL(devices[0].counters.timeouts, 0);
}

/* None replies, and the line is left to them for less than the silence that ends a frame. */
static void frames_after_a_broadcast_are_apart(void)
{
    RTS_I64 first_ns = 0;
    RTS_I64 end_ns = 0;
    RTS_UI32 frames = 0;

    begin(1);
    devices[0].unit = MODBUS_BROADCAST;
    devices[0].timeout_ms = 1;
    add(0, write_job(0, 1));
    states[0][0].has_out = true;
    for (RTS_UI32 i = 0; i < 200; i++) {
        run_ms(1);
        if (fakes.from_device.size == 0 || fakes.from_device.time_ns[0] == first_ns)
            continue;
        first_ns = fakes.from_device.time_ns[0];
        CHECK(end_ns == 0 || first_ns - fakes.char_ns - end_ns >= client.link.silence_ns);
        end_ns = fakes.from_device.time_ns[fakes.from_device.size - 1];
        frames++;
    }
    CHECK(frames > 10);
}

/* They are asked again at once when one of them replies, as if there were no broadcasts. */
static void a_broadcast_says_nothing_of_devices_that_are_lost(void)
{
    begin(3);
    devices[0].unit = MODBUS_BROADCAST;
    add(0, write_job(0, 20));
    add(1, read_job(20));
    add(2, read_job(20));
    states[0][0].has_out = true;
    remotes[1].fault = remotes[2].fault = SILENT;
    run_ms(20000);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK(ModbusDeviceIsLost(&devices[1]) && ModbusDeviceIsLost(&devices[2]));
    remotes[1].fault = remotes[2].fault = WELL;
    for (RTS_UI32 ms = 0; ModbusDeviceIsLost(&devices[1]) && ModbusDeviceIsLost(&devices[2]); ms++) {
        CHECK(ms < 20000);
        run_ms(1);
    }
    run_ms(500);
    CHECK(ModbusDeviceIsGood(&devices[1]) && ModbusDeviceIsGood(&devices[2]));
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
    RUN(a_silent_device_is_lost_and_comes_back);
    RUN(a_late_reply_is_not_taken_for_another);
    RUN(a_reply_of_another_unit_is_passed_over);
    RUN(a_reply_of_another_function_is_passed_over);
    RUN(a_reply_that_is_too_short_is_passed_over);
    RUN(a_reply_that_is_too_long_is_passed_over);
    RUN(half_a_reply_is_none);
    RUN(a_reply_with_a_wrong_crc_is_none);
    RUN(one_reply_that_is_lost_is_asked_for_again);
    RUN(both_exceptions_of_a_gateway_count_as_silence);
    RUN(a_device_that_acknowledges_is_asked_again_as_one_that_is_busy);
    RUN(an_exception_does_not_make_a_device_lost);
    RUN(a_write_that_is_refused_is_tried_once_a_second);
    RUN(a_dead_device_costs_the_others_one_time_out_in_ten_seconds);
    RUN(a_short_loss_is_over_after_some_seconds);
    RUN(a_line_that_was_pulled_comes_back_with_all_devices);
    RUN(a_line_that_comes_back_asks_all_its_devices_at_once);
    RUN(a_line_that_takes_no_bytes_is_lost_and_comes_back);
    RUN(a_broadcast_that_does_not_leave_is_no_success);
    RUN(a_slow_line_is_not_late);
    RUN(a_device_that_comes_back_gets_all_outputs_again);
    RUN(a_broadcast_waits_for_no_reply);
    RUN(frames_after_a_broadcast_are_apart);
    RUN(a_broadcast_says_nothing_of_devices_that_are_lost);
    RUN(data_are_taken_and_given_under_the_lock);
    RUN(what_has_got_no_reply_is_taken_back_from_the_port);
    return test_result();
}
