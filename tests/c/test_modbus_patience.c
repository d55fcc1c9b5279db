/*
 * test_modbus_patience.c - how long a Modbus client waits for a device: pauses, retries, devices that are lost or busy;
 * and what it says of one that is lost.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "modbus_remotes.h"
#include "rts_config.h"
#include "test.h"

enum { READ_MS = 50, PAUSE_MS = 40 };

static void read_from_two(void)
{
    begin(2);
    add(0, read_job(READ_MS));
    add(1, read_job(READ_MS));
}

/* ---- pauses ---- */

/* Two units in one box, which hears nothing for a while after it has replied. */
static void two_units_of_a_box_that_needs_a_pause(bool has_pause)
{
    read_from_two();
    for (RTS_UI32 i = 0; i < 2; i++) {
        remotes[i].deaf_ms = PAUSE_MS;
        devices[i].pause_ms = has_pause ? PAUSE_MS + 10 : 0;
    }
    run_ms(5000);
}

static void a_device_that_is_deaf_after_its_reply_is_well_with_a_pause(void)
{
    two_units_of_a_box_that_needs_a_pause(false);
    CHECK(devices[0].counters.timeouts + devices[1].counters.timeouts > 5);
    two_units_of_a_box_that_needs_a_pause(true);
    CHECK_EQUAL(devices[0].counters.timeouts + devices[1].counters.timeouts, 0);
    CHECK(remotes[0].asked >= 30 && remotes[1].asked >= 30);
}

static void a_pause_lies_between_a_write_and_its_verification(void)
{
    begin(1);
    devices[0].pause_ms = PAUSE_MS;
    remotes[0].deaf_ms = PAUSE_MS - 10;
    add(0, write_job(MODBUS_JOB_ON_CHANGE | MODBUS_JOB_VERIFY, 0));
    states[0][0].has_out = true;
    run_ms(500);
    CHECK_EQUAL(remotes[0].asked, 2);
    CHECK_EQUAL(devices[0].counters.timeouts, 0);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

static void a_pause_of_one_device_holds_for_the_line(void)
{
    read_from_two();
    devices[0].pause_ms = PAUSE_MS;
    run_ms(100);
    for (RTS_UI32 i = 0; i < 20; i++) {
        RTS_UI32 replies = remotes[0].asked;
        RTS_I64 end_ns;
        while (remotes[0].asked == replies || client.device != NULL)
            run_ms(1);
        end_ns = fakes.now_ns;
        replies = remotes[1].asked;
        while (remotes[1].asked == replies)
            run_ms(1);
        CHECK(fakes.now_ns - end_ns >= (PAUSE_MS - 1) * MS);
    }
}

/* ---- retries ---- */

static void a_device_is_lost_after_its_retries(void)
{
    for (RTS_UI8 retries = 0; retries <= 5; retries++) {
        begin(1);
        devices[0].retries = retries;
        add(0, read_job(READ_MS));
        run_ms(500);
        remotes[0].asked = 0;
        remotes[0].fault = SILENT;
        while (!ModbusDeviceIsLost(&devices[0]))
            run_ms(1);
        CHECK_EQUAL(remotes[0].asked, 1u + retries);
        CHECK_EQUAL(devices[0].counters.timeouts, 1u + retries);
    }
}

static void a_lost_device_is_asked_again_after_its_time(void)
{
    static const RTS_UI32 each_ms[] = {200, 1000, 4000, 10000, 61000};

    for (RTS_UI32 i = 0; i < RTS_COUNT(each_ms); i++) {
        RTS_UI32 asked;
        read_from_two();
        devices[1].ask_again_ms = each_ms[i];
        remotes[1].fault = SILENT;
        run_ms(20000);
        CHECK(ModbusDeviceIsLost(&devices[1]));
        asked = remotes[1].asked;
        run_ms(10 * each_ms[i]);
        CHECK(remotes[1].asked - asked >= 5 && remotes[1].asked - asked <= 11);
        remotes[1].fault = WELL;
        run_ms(each_ms[i] + TIMEOUT_MS + 2 * READ_MS);
        CHECK(ModbusDeviceIsGood(&devices[1]));
    }
}

/* ---- busy ---- */

/* `every`-th replies only are data. */
static void reply_busy(RTS_UI32 every, RTS_UI32 ms)
{
    RTS_UI32 asked = remotes[0].asked;

    for (; ms > 0; ms--) {
        if (remotes[0].asked != asked)
            remotes[0].fault = remotes[0].asked % every == 0 ? WELL : BUSY;
        asked = remotes[0].asked;
        run_ms(1);
        CHECK(devices[0].good_ns == 0 || ModbusDeviceIsGood(&devices[0]));
    }
}

static void a_device_that_is_busy_for_a_moment_is_well(void)
{
    begin(1);
    add(0, read_job(READ_MS));
    run_ms(500);
    reply_busy(MODBUS_BUSY_TRIES, 20000);
    CHECK_EQUAL(devices[0].counters.exceptions, 0);
    CHECK_EQUAL(devices[0].counters.timeouts, 0);
    CHECK(devices[0].busy > 20);
}

static void a_write_to_a_device_that_is_busy_for_a_moment_arrives(void)
{
    begin(1);
    add(0, write_job(MODBUS_JOB_ON_CHANGE, 0));
    states[0][0].has_out = true;
    out[0][0][0] = 1;
    run_ms(100);
    remotes[0].fault = BUSY;
    out[0][0][0] = 2;
    run_ms(MODBUS_BUSY_MS * 2);
    remotes[0].fault = WELL;
    memset(remotes[0].data, 0, sizeof(remotes[0].data));
    run_ms(MODBUS_BUSY_MS + 20);
    CHECK_EQUAL(remotes[0].data[8], 2);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

static void a_device_that_stays_busy_is_not_good(void)
{
    begin(1);
    add(0, read_job(READ_MS));
    run_ms(500);
    remotes[0].fault = BUSY;
    run_ms(MODBUS_BUSY_MS * MODBUS_BUSY_TRIES);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    run_ms(MODBUS_BUSY_MS * 2);
    CHECK(!ModbusDeviceIsGood(&devices[0]));
    CHECK(!ModbusDeviceIsLost(&devices[0]));
    CHECK_EQUAL(devices[0].counters.last_exception, MODBUS_DEVICE_BUSY);
    CHECK(devices[0].counters.exceptions != 0);
    CHECK_EQUAL(devices[0].busy, MODBUS_BUSY_TRIES);
    remotes[0].fault = WELL;
    run_ms(2 * READ_MS);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

/* ---- why ---- */

static void what_came_in_place_of_a_reply_is_known(void)
{
    static const struct {
        FAULT fault;
        MODBUS_MISS miss;
    } each[] = {
        {SILENT, MODBUS_MISS_SILENT},        {WRONG_UNIT, MODBUS_MISS_UNIT}, {TOO_SHORT, MODBUS_MISS_OTHER},
        {WRONG_FUNCTION, MODBUS_MISS_OTHER}, {BAD_CRC, MODBUS_MISS_DAMAGED},
    };

    for (RTS_UI32 i = 0; i < RTS_COUNT(each); i++) {
        begin(1);
        add(0, read_job(READ_MS));
        run_ms(300);
        remotes[0].fault = each[i].fault;
        while (!ModbusDeviceIsLost(&devices[0]))
            run_ms(1);
        CHECK_EQUAL(devices[0].miss, each[i].miss);
        if (each[i].miss == MODBUS_MISS_UNIT)
            CHECK_EQUAL(devices[0].missed_unit, 0x41);
    }
}

static void a_reply_after_the_timeout_is_known_as_late(void)
{
    read_from_two();
    run_ms(300);
    devices[0].retries = 3;
    remotes[0].fault = LATE;
    run_ms(TIMEOUT_MS + READ_MS + 60);
    CHECK_EQUAL(devices[0].miss, MODBUS_MISS_LATE);
    CHECK_EQUAL(devices[1].counters.timeouts, 0);
}

int main(void)
{
    RUN(a_device_that_is_deaf_after_its_reply_is_well_with_a_pause);
    RUN(a_pause_lies_between_a_write_and_its_verification);
    RUN(a_pause_of_one_device_holds_for_the_line);
    RUN(a_device_is_lost_after_its_retries);
    RUN(a_lost_device_is_asked_again_after_its_time);
    RUN(a_device_that_is_busy_for_a_moment_is_well);
    RUN(a_write_to_a_device_that_is_busy_for_a_moment_arrives);
    RUN(a_device_that_stays_busy_is_not_good);
    RUN(what_came_in_place_of_a_reply_is_known);
    RUN(a_reply_after_the_timeout_is_known_as_late);
    return test_result();
}
