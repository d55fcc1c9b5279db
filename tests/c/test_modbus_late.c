/*
 * test_modbus_late.c - replies on a serial line that come after the time-out of their request: they do not say to which
 * request they are, and must not be taken for that to the next one.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "modbus_remotes.h"
#include "rts_config.h"
#include "test.h"

enum { ONE = 1, OTHER = 0xA4 };

/* Two reads of the same length of one device: only what is in them says which is which. */
static void begin_two(bool loses)
{
    begin(2);
    add(0, (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 0, 2, 0, 0, 0, 50});
    add(0, (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 4, 2, 0, 0, 0, 50});
    memset(remotes[0].data, ONE, 4);
    memset(remotes[0].data + 8, OTHER, 4);
    remotes[0].loses = loses;
    run_ms(500);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

static bool has_right_values(void)
{
    return in[0][0][0] == ONE && in[0][1][0] == OTHER;
}

/* Until the next request has been received. */
static void run_until_asked(RTS_UI32 device)
{
    RTS_UI32 asked = remotes[device].asked;

    for (RTS_UI32 ms = 0; remotes[device].asked == asked; ms++) {
        CHECK(ms < 70000);
        run_ms(1);
    }
}

/* Every 10 ms by which a reply may be late, but those after one more time-out. */
static void one_late_reply_is_not_taken_for_the_next(void)
{
    for (RTS_UI32 i = 0; i < 2 * 9; i++) {
        begin_two(i % 2 != 0);
        remotes[0].delay_ms = TIMEOUT_MS + 10 + i / 2 * 10;
        run_until_asked(0);
        remotes[0].delay_ms = 2;
        for (RTS_UI32 ms = 0; ms < 600; ms++) {
            run_ms(1);
            CHECK(has_right_values());
        }
        CHECK_EQUAL(devices[0].counters.timeouts, 1);
        CHECK_EQUAL(devices[0].counters.others, 0);
        CHECK(ModbusDeviceIsGood(&devices[0]));
    }
}

static void a_device_that_is_always_late_is_lost_and_its_values_stay(void)
{
    for (RTS_UI32 i = 0; i < 2; i++) {
        begin_two(i != 0);
        remotes[0].delay_ms = TIMEOUT_MS + 30;
        memset(remotes[0].data, 0x55, 16);
        run_ms(TIMEOUT_MS);
        for (RTS_UI32 ms = 0; ms < 20000; ms++) {
            run_ms(1);
            CHECK(has_right_values());
        }
        CHECK(ModbusDeviceIsLost(&devices[0]));
        CHECK(devices[0].counters.timeouts >= 10);
        remotes[0].delay_ms = 2;
        run_ms(1500);
        CHECK(ModbusDeviceIsGood(&devices[0]));
        CHECK_EQUAL(in[0][0][0], 0x55);
    }
}

/* Alone on its line it would be asked again each second, which is before it has replied. */
static void a_lost_device_is_not_asked_before_its_late_reply(void)
{
    begin_two(false);
    devices[0].timeout_ms = 3000;
    remotes[0].delay_ms = 5000;
    for (RTS_UI32 ms = 0; ms < 60000; ms++) {
        run_ms(1);
        CHECK(has_right_values());
    }
    CHECK(ModbusDeviceIsLost(&devices[0]));
    CHECK(devices[0].counters.timeouts >= 9);
}

/* Of one that was late from the first request on nothing is ever taken. */
static void a_device_that_never_was_in_time_is_never_good(void)
{
    begin(1);
    add(0, (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 0, 2, 0, 0, 0, 50});
    add(0, (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 4, 2, 0, 0, 0, 50});
    memset(remotes[0].data, ONE, 16);
    remotes[0].delay_ms = TIMEOUT_MS + 30;
    run_ms(20000);
    CHECK(ModbusDeviceIsLost(&devices[0]));
    CHECK(!ModbusDeviceIsGood(&devices[0]));
    CHECK(in[0][0][0] == 0 && in[0][1][0] == 0);
}

/* The next request leaves right after it. */
static void a_late_reply_ends_the_pause(void)
{
    RTS_I64 asked_ns;

    begin_two(false);
    remotes[0].delay_ms = TIMEOUT_MS + 20;
    run_until_asked(0);
    asked_ns = remotes[0].asked_ns;
    remotes[0].delay_ms = 2;
    run_until_asked(0);
    CHECK(remotes[0].asked_ns - asked_ns < (RTS_I64)(TIMEOUT_MS + 20 + 20) * MS);
}

/* A request that got no reply at all: one more time-out, and noise does not make it shorter. */
static void without_a_late_reply_the_pause_is_one_time_out(void)
{
    static const RTS_UI8 noise[] = {0xFF, 0x00};

    for (RTS_UI32 i = 0; i < 2; i++) {
        RTS_I64 asked_ns;
        begin_two(false);
        remotes[0].fault = SILENT;
        run_until_asked(0);
        asked_ns = remotes[0].asked_ns;
        remotes[0].fault = WELL;
        run_ms(TIMEOUT_MS + 20);
        if (i != 0)
            line_send(noise, sizeof(noise));
        run_until_asked(0);
        CHECK(remotes[0].asked_ns - asked_ns >= (RTS_I64)(2 * TIMEOUT_MS - 2) * MS);
        CHECK(remotes[0].asked_ns - asked_ns < (RTS_I64)(2 * TIMEOUT_MS + 30) * MS);
    }
}

/* No frame leaves while the late reply may come: on the bus they would meet. */
static void others_wait_too_while_a_device_that_was_there_may_be_late(void)
{
    begin_two(false);
    add(1, read_job(20));
    run_ms(200);
    remotes[0].delay_ms = TIMEOUT_MS + 60;
    run_until_asked(0);
    remotes[0].delay_ms = 2;
    run_ms(TIMEOUT_MS + 10);
    CHECK_EQUAL(devices[0].counters.timeouts, 1);
    while (reply_size != 0) {
        RTS_UI32 asked = remotes[1].asked;
        run_ms(1);
        CHECK_EQUAL(remotes[1].asked, asked);
    }
    run_ms(200);
    CHECK(ModbusDeviceIsGood(&devices[0]) && ModbusDeviceIsGood(&devices[1]));
    CHECK_EQUAL(devices[1].counters.timeouts, 0);
}

/* The pause is for a device that replied before. One that is lost costs its line a time-out a minute. */
static void a_dead_device_costs_no_more_than_its_time_out(void)
{
    RTS_UI32 before;

    begin_two(false);
    add(1, read_job(20));
    remotes[0].fault = SILENT;
    run_ms(20000);
    CHECK(ModbusDeviceIsLost(&devices[0]));
    run_until_asked(0);
    before = remotes[1].asked;
    run_ms(TIMEOUT_MS + 40);
    CHECK(remotes[1].asked > before);
}

/* Two names of one device, whose numbers have other orders of bytes. */
static void a_late_reply_is_not_taken_for_that_to_its_other_name(void)
{
    begin(3);
    add(0, (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 0, 2, 0, 0, 0, 50});
    add(1, (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, MODBUS_JOB_REVERSE_2, 4, 2, 0, 0, 0, 50});
    add(2, read_job(50));
    devices[1].unit = 1;
    memset(remotes[0].data, ONE, 4);
    memset(remotes[0].data + 8, OTHER, 4);
    run_ms(500);
    remotes[0].delay_ms = TIMEOUT_MS + 30;
    for (RTS_UI32 ms = 0; ms < 200000; ms++) {
        remotes[2].delay_ms = 2;
        run_ms(1);
        CHECK(in[0][0][0] == ONE && in[1][0][0] == OTHER);
    }
    CHECK(ModbusDeviceIsLost(&devices[0]) && ModbusDeviceIsLost(&devices[1]));
}

/* When the whole line was away, a device that was asked just before may still be about to reply. */
static void a_line_that_comes_back_does_not_ask_before_a_late_reply(void)
{
    begin_two(false);
    add(1, read_job(50));
    run_ms(200);
    remotes[0].fault = remotes[1].fault = SILENT;
    run_ms(3000);
    CHECK(ModbusDeviceIsLost(&devices[0]) && ModbusDeviceIsLost(&devices[1]));
    remotes[0].fault = WELL;
    remotes[0].delay_ms = TIMEOUT_MS + 60;
    run_until_asked(0);
    remotes[1].fault = WELL;
    for (RTS_UI32 ms = 0; ms < 5000; ms++) {
        run_ms(1);
        CHECK(has_right_values());
    }
}

static void a_call_does_not_get_the_late_reply_to_another(void)
{
    static MODBUS_CALL calls[2];

    begin(1);
    memset(calls, 0, sizeof(calls));
    memset(remotes[0].data, ONE, 4);
    memset(remotes[0].data + 8, OTHER, 4);
    ModbusClientSetCalls(&client, calls, RTS_COUNT(calls));
    remotes[0].delay_ms = TIMEOUT_MS + 30;
    for (RTS_UI32 i = 0; i < RTS_COUNT(calls); i++) {
        calls[i].client = &client;
        calls[i].device = &devices[0];
        calls[i].request =
            (MODBUS_REQUEST){ModbusFindFunction(MODBUS_READ_HOLDING_REGISTERS), (RTS_UI16)(4 * i), 2, 0, 0, NULL};
        calls[i].due_ns = fakes.now_ns;
        calls[i].state = MODBUS_CALL_WAITS;
        run_until_asked(0);
        remotes[0].delay_ms = 2;
    }
    run_ms(300);
    CHECK_EQUAL(calls[0].result, ERR_TIMEOUT);
    CHECK_EQUAL(calls[1].result, ERR_OK);
    CHECK_EQUAL(calls[1].data[0], OTHER);
}

/* Nothing to wait for: a line that takes no bytes, a broadcast, and the search for devices. */
static void only_a_request_that_has_left_can_have_a_late_reply(void)
{
    begin_two(false);
    fakes.write_limit = 0;
    while (devices[0].counters.timeouts == 0)
        run_ms(1);
    CHECK(client.late_ns <= fakes.now_ns);
    begin(1);
    devices[0].unit = MODBUS_BROADCAST;
    add(0, write_job(0, 10));
    states[0][0].has_out = true;
    run_ms(TIMEOUT_MS + 20);
    CHECK(client.late_ns <= fakes.now_ns);
}

static void the_search_for_devices_does_not_wait_for_units_that_are_not_there(void)
{
    static MODBUS_CALL call;
    static MODBUS_DEVICE guest;

    begin(1);
    memset(&call, 0, sizeof(call));
    guest = (MODBUS_DEVICE){.unit = 9, .timeout_ms = TIMEOUT_MS, .retries = MODBUS_RETRIES};
    ModbusClientSetCalls(&client, &call, 1);
    call.client = &client;
    call.device = &guest;
    call.request.function = ModbusFindFunction(MODBUS_REPORT_SERVER_ID);
    call.state = MODBUS_CALL_WAITS;
    while (call.state == MODBUS_CALL_WAITS)
        run_ms(1);
    CHECK_EQUAL(call.result, ERR_TIMEOUT);
    CHECK(client.late_ns <= fakes.now_ns);
}

/* For a clock that is virtual: there is something to do when the pause is over. */
static void the_end_of_the_pause_is_when_it_is_polled_next(void)
{
    begin_two(false);
    remotes[0].fault = SILENT;
    while (devices[0].counters.timeouts == 0)
        run_ms(1);
    CHECK_EQUAL(ModbusClientGetDueNs(&client, fakes.now_ns), client.late_ns);
    CHECK(client.late_ns > fakes.now_ns + (RTS_I64)(TIMEOUT_MS - 2) * MS);
}

int main(void)
{
    RUN(one_late_reply_is_not_taken_for_the_next);
    RUN(a_device_that_is_always_late_is_lost_and_its_values_stay);
    RUN(a_lost_device_is_not_asked_before_its_late_reply);
    RUN(a_device_that_never_was_in_time_is_never_good);
    RUN(a_late_reply_ends_the_pause);
    RUN(without_a_late_reply_the_pause_is_one_time_out);
    RUN(others_wait_too_while_a_device_that_was_there_may_be_late);
    RUN(a_dead_device_costs_no_more_than_its_time_out);
    RUN(a_late_reply_is_not_taken_for_that_to_its_other_name);
    RUN(a_line_that_comes_back_does_not_ask_before_a_late_reply);
    RUN(a_call_does_not_get_the_late_reply_to_another);
    RUN(only_a_request_that_has_left_can_have_a_late_reply);
    RUN(the_search_for_devices_does_not_wait_for_units_that_are_not_there);
    RUN(the_end_of_the_pause_is_when_it_is_polled_next);
    return test_result();
}
