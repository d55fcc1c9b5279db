/*
 * test_io_lost.c - a device that is lost, late, wrong or answers badly: what inputs, variables and log say.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * On IoDrvSim, with the faults of the simulator.
 */
#include "IoDrvSim.h"
#include "io_driver.h"

enum { HELD = 0, ZERO = 1, VALUED = 2, STATE = 16, INPUTS = 7 };

static RTS_UI32 inputs(void)
{
    return read_u32(APP_AREA_INPUT, 0);
}

static IO_DEVICE_STATE state(void)
{
    IO_DEVICE_STATE now;

    memcpy(&now, AppGetAreaAddress(APP_AREA_DATA, STATE, sizeof now), sizeof now);
    return now;
}

/* "Meter" measures 0x11, 0x22, 0x33, with a variable for its state. */
static void begin_meter(void)
{
    RTS_UI8 byte;

    begin_io();
    io_init(&io);
    io_add_connector(&io, "Line", "IoDrvSim");
    io_add_connector(&io, "Meter", "IoDrvOther")->state = STATE; /* the simulator has devices of all drivers */
    io.connectors[1].parent = 0;
    add_task(&spec, "Main", KIND_CYCLIC, 10000, here(&spec));
    emit_ret(&spec);
    for (byte = HELD; byte <= VALUED; byte++) {
        IoConfigChannelMap *map = io_add_channel(&io, 0, IO_MAP_INPUTS, 1, INPUTS, 8u * byte, 8u * byte, 8);
        map->flags = (RTS_UI16)(byte == HELD ? IO_HOLD : byte == ZERO ? IO_ZERO : IO_VALUE);
        map->value = 0xEE;
    }
    start_io();
    CHECK_EQUAL(SimIoWrite("Meter", &(SIM_IO_PLACE){INPUTS, 0, 24, false}, (const RTS_UI8 *)"\x11\x22\x33"), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(inputs(), 0x332211);
}

static RTS_UI32 log_count(const char *text)
{
    LOG_ENTRY entry = {0};
    RTS_UI32 count = 0;

    while (LogGetEntry(entry.handle + 1, &entry) == ERR_OK)
        count += strstr(entry.text, text) != NULL;
    return count;
}

static void a_device_that_is_well_says_so(void)
{
    begin_meter();
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(state().ok, 1);
    CHECK_EQUAL(state().errors, 0);
    CHECK(state().age_ms <= 10);
    CHECK_EQUAL(state().flags,
                CF_ENABLE | CF_DRIVER_AVAILABLE | CF_CONNECTOR_FOUND | CF_CONNECTOR_CONFIGURED | CF_CONNECTOR_ACTIVE);
    CHECK_EQUAL(log_count("Meter"), 0);
}

static void inputs_of_a_lost_device_hold_or_are_zero_or_have_a_value(void)
{
    begin_meter();
    CHECK_EQUAL(SimIoFault("Meter", IO_SIM_ABSENT, 1), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(inputs(), 0xEE0011);
    CHECK_EQUAL(state().ok, 0);
    CHECK((state().flags & CF_CONNECTOR_BUS_ERROR) != 0);
    CHECK(state().errors >= 9);
    CHECK(state().age_ms >= 90 && state().age_ms <= 110);
    CHECK_EQUAL(log_count("Meter is lost"), 1); /* however often it was asked */
}

static void a_device_comes_back_by_itself(void)
{
    begin_meter();
    CHECK_EQUAL(SimIoFault("Meter", IO_SIM_ABSENT, 1), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(SimIoFault("Meter", IO_SIM_ABSENT, 0), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(30)), ERR_OK);
    CHECK_EQUAL(inputs(), 0x332211);
    CHECK_EQUAL(state().ok, 1);
    CHECK_EQUAL(log_count("Meter is back"), 1);
}

static void a_device_is_seen_lost_and_back_while_the_program_is_stopped(void)
{
    begin_meter();
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(SimIoFault("Meter", IO_SIM_ABSENT, 1), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(5)), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(5)), ERR_OK);
    CHECK_EQUAL(state().ok, 0);
    CHECK_EQUAL(inputs(), 0xEE0011);
    CHECK_EQUAL(SimIoFault("Meter", IO_SIM_ABSENT, 0), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(5)), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(5)), ERR_OK);
    CHECK_EQUAL(state().ok, 1);
    CHECK_EQUAL(inputs(), 0x332211);
}

static void data_of_a_late_device_is_old(void)
{
    begin_meter();
    CHECK_EQUAL(SimIoFault("Meter", IO_SIM_LATE, 200), ERR_OK);
    CHECK_EQUAL(SimIoWrite("Meter", &(SIM_IO_PLACE){INPUTS, 0, 8, false}, (const RTS_UI8 *)"\x44"), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(150)), ERR_OK);
    CHECK_EQUAL(inputs(), 0x332211);
    CHECK_EQUAL(state().ok, 1);
    CHECK(state().age_ms >= 140);
    CHECK_EQUAL(SimAdvance(ms(70)), ERR_OK);
    CHECK_EQUAL(inputs(), 0x332244);
}

static void a_device_of_another_type_is_found_and_not_used(void)
{
    begin_meter();
    CHECK_EQUAL(SimIoFault("Meter", IO_SIM_TYPE, 1), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(inputs(), 0xEE0011);
    CHECK_EQUAL(state().flags & (CF_CONNECTOR_FOUND | CF_CONNECTOR_CONFIGURED | CF_CONNECTOR_ERROR),
                CF_CONNECTOR_FOUND | CF_CONNECTOR_ERROR);
}

static void a_bad_answer_is_counted_and_three_in_a_row_lose_the_device(void)
{
    IO_DEVICE_STATE now;

    begin_meter();
    CHECK_EQUAL(SimIoFault("Meter", IO_SIM_ANSWERS, 1), ERR_OK);
    CHECK_EQUAL(SimIoFault("Meter", IO_SIM_CUT, 1), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(state().errors, 2);
    CHECK_EQUAL(state().ok, 1);
    CHECK_EQUAL(log_count("Meter"), 0);
    CHECK_EQUAL(SimIoFault("Meter", IO_SIM_ANSWERS, 3), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(30)), ERR_OK);
    CHECK_EQUAL(SimIoGetState("Meter", &now), ERR_OK); /* the variable is as the cycle began */
    CHECK_EQUAL(now.errors, 5);
    CHECK_EQUAL(now.ok, 0);
    CHECK_EQUAL(log_count("Meter is lost"), 1);
    CHECK_EQUAL(SimAdvance(ms(30)), ERR_OK);
    CHECK_EQUAL(state().ok, 1);
}

static void nothing_is_written_beyond_a_simulated_device(void)
{
    RTS_UI8 data[8] = {0};

    begin_meter();
    CHECK_EQUAL(SimIoWrite("Meter", &(SIM_IO_PLACE){INPUTS, 0, 25, false}, data), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(SimIoWrite("Meter", &(SIM_IO_PLACE){INPUTS, 0xFFFFFFFF, 2, false}, data), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(SimIoRead("Meter", &(SIM_IO_PLACE){INPUTS + 1, 0, 8, false}, data), ERR_NO_OBJECT);
    CHECK_EQUAL(SimIoRead("Valve", &(SIM_IO_PLACE){INPUTS, 0, 8, false}, data), ERR_NO_OBJECT);
    CHECK_EQUAL(SimIoRead("Meter", &(SIM_IO_PLACE){INPUTS, 4, 8, false}, data), ERR_OK);
    CHECK_EQUAL(data[0], 0x21);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_device_that_is_well_says_so);
    RUN(inputs_of_a_lost_device_hold_or_are_zero_or_have_a_value);
    RUN(a_device_comes_back_by_itself);
    RUN(a_device_is_seen_lost_and_back_while_the_program_is_stopped);
    RUN(data_of_a_late_device_is_old);
    RUN(a_device_of_another_type_is_found_and_not_used);
    RUN(a_bad_answer_is_counted_and_three_in_a_row_lose_the_device);
    RUN(nothing_is_written_beyond_a_simulated_device);
    return test_result();
}
