/*
 * test_modbus_due.c - when a Modbus client is needed next, and when a device is good, to the nanosecond.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "modbus_remotes.h"
#include "rts_config.h"
#include "test.h"

enum { NOW = 1000000 };

static MODBUS_CALL waiting[2];

/* Two devices with a read job each, due at these times. */
static void begin_due(RTS_I64 first_ns, RTS_I64 second_ns)
{
    begin(2);
    add(0, read_job(50));
    add(1, read_job(50));
    states[0][0].due_ns = first_ns;
    states[1][0].due_ns = second_ns;
}

static void the_earliest_job_of_all_devices_counts(void)
{
    begin_due(NOW + 5, NOW + 7);
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 5);
    begin_due(NOW + 7, NOW + 6);
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 6);
    client.device_count = 1;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 7);
    client.device_count = 0;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), INT64_MAX);
}

static void a_lost_device_is_not_needed_before_it_is_asked_again(void)
{
    begin_due(NOW + 5, NOW + 100);
    devices[0].failures = devices[0].retries + 1;
    devices[0].retry_ns = NOW + 6;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 6);
    devices[0].retry_ns = NOW + 4;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 5);
    devices[0].failures = devices[0].retries;
    devices[0].retry_ns = NOW + 50;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 5);
}

static void a_pause_ends_with_the_later_one_of_its_reasons(void)
{
    begin_due(NOW, NOW);
    client.late_ns = NOW + 3;
    client.free_ns = NOW + 9;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 9);
    client.free_ns = NOW + 2;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 3);
    client.late_ns = client.free_ns = NOW;
    states[0][0].due_ns = states[1][0].due_ns = NOW + 8;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 8);
    client.free_ns = NOW + 1;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 1);
    client.free_ns = NOW;
    client.late_ns = NOW + 1;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 1);
}

static void a_request_on_its_way_is_needed_at_its_time_out(void)
{
    begin_due(NOW + 5, NOW + 5);
    client.device = &devices[0];
    client.since_ns = NOW + 1;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW); /* it waits for the link */
    client.sent = true;
    CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 1 + devices[0].timeout_ms * 1000000LL);
}

static void a_call_of_this_line_that_waits_is_needed_at_once(void)
{
    RTS_UI32 last;

    for (last = 0; last < RTS_COUNT(waiting); last++) {
        begin_due(NOW + 5, NOW + 5);
        memset(waiting, 0, sizeof waiting);
        ModbusClientSetCalls(&client, waiting, last + 1);
        CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 5);
        waiting[last].client = &client;
        waiting[last].state = MODBUS_CALL_TAKEN;
        CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 5);
        waiting[last].state = MODBUS_CALL_WAITS;
        CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW);
        ModbusClientSetCalls(&client, waiting, last);
        CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 5);
        ModbusClientSetCalls(&client, waiting, last + 1);
        waiting[last].client = NULL; /* of another line */
        CHECK_EQUAL(ModbusClientGetDueNs(&client, NOW), NOW + 5);
    }
}

static void a_device_is_good_when_it_has_replied_to_all_that_it_was_asked(void)
{
    begin(1);
    add(0, read_job(50));
    add(0, read_job(50));
    CHECK(!ModbusDeviceIsGood(&devices[0])); /* it has never replied */
    devices[0].good_ns = NOW;
    CHECK(ModbusDeviceIsGood(&devices[0])); /* of its jobs none was tried */
    states[0][0].done_ns = NOW;
    CHECK(!ModbusDeviceIsGood(&devices[0]));
    states[0][0].good = true;
    CHECK(ModbusDeviceIsGood(&devices[0]));
    states[0][1].done_ns = NOW;
    CHECK(!ModbusDeviceIsGood(&devices[0]));
    states[0][1].good = true;
    states[0][0].good = false;
    CHECK(!ModbusDeviceIsGood(&devices[0])); /* the last job does not speak for the others */
    states[0][0].good = true;
    devices[0].failures = devices[0].retries;
    CHECK(ModbusDeviceIsGood(&devices[0]));
    devices[0].failures++;
    CHECK(!ModbusDeviceIsGood(&devices[0]));
}

/* ---- which one is asked ---- */

static void begin_call(RTS_I64 due_ns)
{
    begin(1);
    memset(waiting, 0, sizeof waiting);
    ModbusClientSetCalls(&client, waiting, 1);
    waiting[0].client = &client;
    waiting[0].device = &devices[0];
    waiting[0].request.function = ModbusFindFunction(MODBUS_READ_HOLDING_REGISTERS);
    waiting[0].request.read_count = 1;
    waiting[0].state = MODBUS_CALL_WAITS;
    waiting[0].due_ns = due_ns;
}

static void a_call_of_a_lost_device_fails_until_it_is_asked_again(void)
{
    begin_call(0);
    devices[0].failures = devices[0].retries + 1;
    devices[0].retry_ns = NOW;
    ModbusClientPoll(&client, NOW - 1);
    CHECK_EQUAL(waiting[0].state, MODBUS_CALL_ENDED);
    CHECK_EQUAL(waiting[0].result, ERR_TIMEOUT);
    waiting[0].state = MODBUS_CALL_WAITS;
    ModbusClientPoll(&client, NOW);
    CHECK_EQUAL(waiting[0].state, MODBUS_CALL_WAITS);
    CHECK_SAME(client.call, &waiting[0]);
}

static void a_job_of_a_lost_device_waits_until_it_is_asked_again(void)
{
    begin(1);
    add(0, read_job(50));
    devices[0].failures = devices[0].retries + 1;
    devices[0].retry_ns = NOW;
    ModbusClientPoll(&client, NOW - 1);
    CHECK(client.device == NULL);
    ModbusClientPoll(&client, NOW);
    CHECK_SAME(client.device, &devices[0]);
}

static void a_call_is_sent_when_it_is_due_and_on_its_line_only(void)
{
    begin_call(NOW + 1);
    ModbusClientPoll(&client, NOW);
    CHECK(client.device == NULL);
    ModbusClientPoll(&client, NOW + 1);
    CHECK_SAME(client.device, &devices[0]);
    begin_call(NOW);
    waiting[0].client = NULL;
    ModbusClientPoll(&client, NOW);
    CHECK(client.device == NULL);
}

static void a_call_comes_before_a_job_that_is_due_at_the_same_time(void)
{
    begin_call(NOW - 5);
    add(0, read_job(50));
    states[0][0].due_ns = NOW - 5;
    ModbusClientPoll(&client, NOW);
    CHECK(client.job == NULL);
    begin_call(NOW - 4);
    add(0, read_job(50));
    states[0][0].due_ns = NOW - 5;
    ModbusClientPoll(&client, NOW);
    CHECK_SAME(client.job, &states[0][0]);
}

/* ---- the last writes ---- */

static const MODBUS_JOB write_on_change = {MODBUS_WRITE_REGISTER, MODBUS_JOB_ON_CHANGE, 0, 0, 4, 1, 0, 50};

static void begin_write(void)
{
    begin(2);
    add(0, read_job(50));
    add(1, write_on_change);
    states[1][0].has_out = states[1][0].good = true;
    states[1][0].due_ns = states[1][0].done_ns = NOW;
    states[0][0].due_ns = NOW;
}

static void an_output_that_the_device_does_not_have_yet_is_hurried(void)
{
    begin_write();
    CHECK(ModbusClientHurryWrites(&client));
    CHECK_EQUAL(states[1][0].due_ns, 0);
    CHECK_EQUAL(states[1][0].done_ns, 0);
    CHECK_EQUAL(states[0][0].due_ns, NOW); /* what is read is not */
}

static void what_need_not_or_cannot_be_written_is_not_hurried(void)
{
    begin_write();
    states[1][0].has_out = false;
    CHECK(!ModbusClientHurryWrites(&client));
    begin_write();
    states[1][0].is_written = true; /* what it has is what it shall have */
    CHECK(!ModbusClientHurryWrites(&client));
    states[1][0].out[0] ^= 1;
    CHECK(ModbusClientHurryWrites(&client));
    begin_write();
    devices[1].failures = devices[1].retries + 1;
    CHECK(!ModbusClientHurryWrites(&client));
    begin_write();
    states[1][0].good = false; /* the device has refused it */
    CHECK(!ModbusClientHurryWrites(&client));
    devices[1].failures = 1; /* it was silent */
    CHECK(ModbusClientHurryWrites(&client));
    begin_write();
    states[1][0].good = false;
    states[1][0].done_ns = 0; /* it was not tried yet */
    CHECK(ModbusClientHurryWrites(&client));
}

static void every_job_of_every_device_is_hurried(void)
{
    begin(2);
    for (RTS_UI32 i = 0; i < 2; i++) {
        add(i, read_job(50));
        add(i, write_on_change);
        states[i][1].has_out = true;
        states[i][1].due_ns = NOW;
    }
    CHECK(ModbusClientHurryWrites(&client));
    CHECK_EQUAL(states[0][1].due_ns, 0);
    CHECK_EQUAL(states[1][1].due_ns, 0);
}

static void a_write_on_its_way_is_waited_for(void)
{
    begin_write();
    states[1][0].is_written = true;
    client.device = &devices[1];
    client.job = &states[1][0];
    CHECK(ModbusClientHurryWrites(&client));
    client.job = &states[0][0];
    CHECK(!ModbusClientHurryWrites(&client));
    client.job = NULL; /* a call */
    CHECK(!ModbusClientHurryWrites(&client));
    client.device = NULL;
    client.job = &states[1][0]; /* of before */
    CHECK(!ModbusClientHurryWrites(&client));
}

int main(void)
{
    RUN(the_earliest_job_of_all_devices_counts);
    RUN(a_lost_device_is_not_needed_before_it_is_asked_again);
    RUN(a_pause_ends_with_the_later_one_of_its_reasons);
    RUN(a_request_on_its_way_is_needed_at_its_time_out);
    RUN(a_call_of_this_line_that_waits_is_needed_at_once);
    RUN(a_device_is_good_when_it_has_replied_to_all_that_it_was_asked);
    RUN(a_call_of_a_lost_device_fails_until_it_is_asked_again);
    RUN(a_job_of_a_lost_device_waits_until_it_is_asked_again);
    RUN(a_call_is_sent_when_it_is_due_and_on_its_line_only);
    RUN(a_call_comes_before_a_job_that_is_due_at_the_same_time);
    RUN(an_output_that_the_device_does_not_have_yet_is_hurried);
    RUN(what_need_not_or_cannot_be_written_is_not_hurried);
    RUN(every_job_of_every_device_is_hurried);
    RUN(a_write_on_its_way_is_waited_for);
    return test_result();
}
