/*
 * test_io_safe.c - what becomes of outputs when a program stops or fails: each holds, is zero, or has a value.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "io_driver.h"

enum { HELD = 0, ZERO = 1, VALUED = 2, BITS = 3 };

/* Outputs of all kinds, all ones; the task fails when input byte 4 is not 0. */
static void begin_outputs(void)
{
    begin_io();
    add_task(&spec, "Main", KIND_CYCLIC, 10000, here(&spec));
    emit_set(&spec, APP_AREA_OUTPUT, 0, 0xFFFFFFFF);
    emit_copy(&spec, APP_AREA_DATA, 0, APP_AREA_INPUT, 4);
    emit(&spec, "\x85\xC9\x74\x02\x0F\x0B", 6); /* test ecx, ecx; jz over; ud2 */
    emit_ret(&spec);
    add_bytes(0, IO_MAP_INPUTS, 4, 4);
    add_bytes(0, IO_MAP_OUTPUTS, HELD, 1)->flags = IO_HOLD;
    add_bytes(0, IO_MAP_OUTPUTS, ZERO, 1)->flags = IO_ZERO;
    add_bytes(0, IO_MAP_OUTPUTS, VALUED, 1)->flags = IO_VALUE;
    io.channels[io.channel_count - 1].map.value = 0x5A;
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 0, DRIVER_OUTPUTS, 8 * BITS, 8 * BITS, 1)->flags = IO_HOLD;
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 0, DRIVER_OUTPUTS, 8 * BITS + 1, 8 * BITS + 1, 1)->flags = IO_ZERO;
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 0, DRIVER_OUTPUTS, 8 * BITS + 2, 8 * BITS + 2, 1)->flags = IO_VALUE;
    io.channels[io.channel_count - 1].map.value = 1;
}

static void check_safe(void)
{
    CHECK_EQUAL(plant.out[HELD], 0xFF);
    CHECK_EQUAL(plant.out[ZERO], 0);
    CHECK_EQUAL(plant.out[VALUED], 0x5A);
    CHECK_EQUAL(plant.out[BITS], 0x05);
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, 0), 0x07FFFFFF); /* variables stay, what no device gets is zero */
}

static void a_stop_makes_outputs_safe(void)
{
    begin_outputs();
    start_io();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK(memcmp(plant.out, "\xFF\xFF\xFF\x07", 4) == 0);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    check_safe();
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK(memcmp(plant.out, "\xFF\xFF\xFF\x07", 4) == 0);
}

static void an_exception_makes_outputs_safe(void)
{
    begin_outputs();
    start_io();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    plant.in[4] = 1;
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK(app_exception() != RTSEXCPT_NOEXCEPTION);
    check_safe();
}

static void outputs_begin_with_their_safe_values(void)
{
    begin_outputs();
    memset(plant.out, 0xEE, sizeof plant.out);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(plant.out[HELD], 0xEE); /* of what was before */
    CHECK_EQUAL(plant.out[ZERO], 0);
    CHECK_EQUAL(plant.out[VALUED], 0x5A);
    CHECK_EQUAL(plant.out[BITS], 0xEC);
}

static void stop(void)
{
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
}

static void outputs_become_safe_when_the_driver_was_busy(void)
{
    begin_outputs();
    start_io();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    plant.within = stop;
    CHECK_EQUAL(AppStopApplication(), ERR_OK); /* the second stop comes within the first one's write */
    check_safe();
}

/* An output that no device has is zero. */
static void outputs_without_device_are_zero(void)
{
    begin_outputs();
    add_task(&spec, "Other", KIND_CYCLIC, 10000, here(&spec));
    emit_set(&spec, APP_AREA_OUTPUT, 16, 0x12345678);
    emit_ret(&spec);
    start_io();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, 16), 0x12345678);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, 16), 0);
    check_safe();
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_stop_makes_outputs_safe);
    RUN(an_exception_makes_outputs_safe);
    RUN(outputs_begin_with_their_safe_values);
    RUN(outputs_become_safe_when_the_driver_was_busy);
    RUN(outputs_without_device_are_zero);
    return test_result();
}
