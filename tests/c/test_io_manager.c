/*
 * test_io_manager.c - what the I/O manager asks of a driver, and when.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "io_driver.h"

static void add_copying(void)
{
    add_copying_task("Main", 10000, 0);
    add_bytes(0, IO_MAP_INPUTS, 0, 4);
    add_bytes(0, IO_MAP_OUTPUTS, 0, 4);
}

static void inputs_reach_the_program_and_outputs_the_driver(void)
{
    begin_io();
    add_copying();
    start_io();
    memcpy(plant.in, "\x11\x22\x33\x44", 4);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK(memcmp(plant.out, "\x11\x22\x33\x44", 4) == 0);
}

static void a_cycle_has_one_call_of_each_kind(void)
{
    begin_io();
    add_copying();
    io_add_connector(&io, "More", "IoDrvTest");
    io_add_channel(&io, 0, IO_MAP_INPUTS, 1, DRIVER_INPUTS, 64, 64, 8);
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 1, DRIVER_OUTPUTS, 64, 64, 8);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK(strncmp(plant.calls, "CMw", 3) == 0); /* outputs are safe before the first cycle */
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    memset(plant.calls, 0, sizeof plant.calls);
    CHECK_EQUAL(SimRunCycles(1), ERR_OK);
    CHECK(strcmp(plant.calls, "rwbb") == 0);
}

static void tasks_have_their_own_channels(void)
{
    begin_io();
    add_copying_task("Slow", 100000, 0);
    add_copying_task("Fast", 10000, 4);
    add_bytes(0, IO_MAP_INPUTS, 0, 4);
    add_bytes(0, IO_MAP_OUTPUTS, 0, 4);
    add_bytes(1, IO_MAP_INPUTS, 4, 4);
    add_bytes(1, IO_MAP_OUTPUTS, 4, 4);
    start_io();
    memset(plant.in, 1, sizeof plant.in);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK(output_at(0) == 1 && output_at(4) == 1 && output_at(8) == 0);
    memset(plant.in, 2, sizeof plant.in);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK(output_at(0) == 1 && output_at(4) == 2);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(output_at(0), 2);
}

static void single_bits_leave_their_neighbours_alone(void)
{
    begin_io();
    add_copying_task("Main", 10000, 0);
    io_add_channel(&io, 0, IO_MAP_INPUTS, 0, DRIVER_INPUTS, 3, 6, 1);
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 0, DRIVER_OUTPUTS, 8 + 1, 6, 1);
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 0, DRIVER_OUTPUTS, 8 + 4, 4, 4);
    start_io();
    plant.out[1] = 0x09;
    plant.in[0] = 0x08;
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_INPUT, 0), 0x40);
    CHECK_EQUAL(plant.out[1], 0x40 | 0x02 | 0x09);
    plant.in[0] = 0xF7;
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(plant.out[1], 0x09);
}

static void channels_may_have_the_other_order_of_bytes(void)
{
    begin_io();
    add_copying();
    io.channels[0].map.flags |= IO_CHANNEL_BIG_ENDIAN;
    start_io();
    memcpy(plant.in, "\x11\x22\x33\x44", 4);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK(memcmp(plant.out, "\x44\x33\x22\x11", 4) == 0);
}

static void the_bus_cycle_is_in_the_fastest_task(void)
{
    begin_io();
    add_copying_task("Slow", 100000, 0);
    add_copying_task("Fast", 10000, 4);
    add_copying_task("Middle", 50000, 8);
    io_add_connector(&io, "Named", "IoDrvTest")->bus_task = 2;
    io_add_connector(&io, "Child", "IoDrvTest")->parent = 0;
    start_io();
    memset(plant.bus_cycles, 0, sizeof plant.bus_cycles);
    CHECK_EQUAL(SimRunFor(ms(100)), ERR_OK);
    CHECK_EQUAL(plant.bus_cycles[0], 10);
    CHECK_EQUAL(plant.bus_cycles[1], 2);
    CHECK_EQUAL(plant.bus_cycles[2], 0); /* its bus has it */
}

static void inputs_are_read_while_the_program_is_stopped(void)
{
    begin_io();
    add_copying();
    start_io();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    plant.in[0] = 7;
    CHECK_EQUAL(SimAdvance(ms(5)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_INPUT, 0), 7);
    CHECK_EQUAL(output_at(0), 0);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK(plant.calls[strlen(plant.calls) - 1] == 'c'); /* the driver gives everything back */
    plant.calls[0] = '\0';
    CHECK_EQUAL(SimAdvance(ms(5)), ERR_OK);
    CHECK(strcmp(plant.calls, "") == 0);
}

static void an_image_without_inputs_and_outputs_calls_no_driver(void)
{
    begin_io();
    add_copying_task("Main", 10000, 0);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK(strcmp(plant.calls, "") == 0);
}

static void a_driver_is_registered_once(void)
{
    begin_io();
    CHECK_EQUAL(IoMgrRegisterInstance(&test_driver), ERR_DUPLICATE);
    CHECK_EQUAL(IoMgrUnregisterInstance(&test_driver), ERR_OK);
    CHECK_EQUAL(IoMgrUnregisterInstance(&test_driver), ERR_NO_OBJECT);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(inputs_reach_the_program_and_outputs_the_driver);
    RUN(a_cycle_has_one_call_of_each_kind);
    RUN(tasks_have_their_own_channels);
    RUN(single_bits_leave_their_neighbours_alone);
    RUN(channels_may_have_the_other_order_of_bytes);
    RUN(the_bus_cycle_is_in_the_fastest_task);
    RUN(inputs_are_read_while_the_program_is_stopped);
    RUN(an_image_without_inputs_and_outputs_calls_no_driver);
    RUN(a_driver_is_registered_once);
    return test_result();
}
