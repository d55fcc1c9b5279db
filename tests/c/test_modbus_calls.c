/*
 * test_modbus_calls.c - requests of once, beside the jobs of a Modbus client on a serial line.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "modbus_remotes.h"
#include "rts_config.h"
#include "test.h"

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
    CHECK_EQUAL(calls[0].exception, MODBUS_DEVICE_FAILURE);
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
    for (RTS_UI32 i = 0; i < 1 + MODBUS_RETRIES; i++) {
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
    CHECK_EQUAL(remotes[0].asked, 1 + MODBUS_RETRIES);
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

int main(void)
{
    RUN(a_call_reads_and_writes_as_every_function_does);
    RUN(a_refused_call_has_the_exception);
    RUN(a_call_without_reply_ends_with_the_time_out);
    RUN(calls_of_a_lost_device_cost_its_line_nothing);
    RUN(calls_and_jobs_take_turns_on_a_line_that_is_too_slow);
    RUN(a_device_says_what_it_is);
    return test_result();
}
