/*
 * test_modbus_client.c - a Modbus client on a serial line: what it asks, and when.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "modbus_remotes.h"
#include "rts_config.h"
#include "test.h"

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

/* Its frame begins some ms before ours is due. */
static void a_request_waits_for_the_silence_of_another_master(void)
{
    static const RTS_UI8 frame[] = {9, 3, 0, 0, 0, 1};

    begin(1);
    add(0, read_job(50));
    run_ms(60);
    for (RTS_UI32 i = 0; i < 5; i++) {
        RTS_I64 end_ns;
        while (fakes.now_ns < states[0][0].due_ns - 3 * MS)
            run_ms(1);
        line_send_frame(frame, sizeof(frame));
        end_ns = fakes.to_device.time_ns[fakes.to_device.size - 1];
        while (fakes.from_device.size == 0)
            run_ms(1);
        CHECK(fakes.from_device.time_ns[0] - fakes.char_ns - end_ns >= client.link.silence_ns);
        run_ms(20);
    }
    CHECK(ModbusDeviceIsGood(&devices[0]));
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
    static const RTS_UI8 written[][2] = {{1, 0}, {0xFF, 7}, {0x0F, 0}, {0, 0x0F}};

    for (RTS_UI32 i = 0; i < RTS_COUNT(each); i++) {
        begin(1);
        add(0, each[i]);
        memcpy(out[0][0], written[i], sizeof(written[i]));
        memset(remotes[0].data + 8, 0x30, 2);
        states[0][0].has_out = true;
        run_ms(60);
        CHECK(ModbusDeviceIsGood(&devices[0]));
        CHECK_EQUAL(devices[0].counters.unverified, 0);
    }
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
    RUN(a_request_waits_for_the_silence_of_another_master);
    RUN(what_is_written_is_read_back);
    RUN(what_is_not_kept_is_an_error_and_written_again);
    RUN(bits_that_are_not_written_are_not_verified);
    return test_result();
}
