/*
 * test_io_busy.c - a driver that is busy is never waited for, and nothing is lost by that.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * One task interrupts another within a function of the driver, as tasks do on one core.
 */
#include "SysTime.h"
#include "io_driver.h"

static void run_fast_task(void)
{
    CHECK(IecTaskCycle(1, SysTimeGetNs()));
}

/* Tasks 0 and 1 copy an input each; 1 interrupts. */
static void begin_two_tasks(void)
{
    begin_io();
    add_copying_task("Slow", 100000, 0);
    add_copying_task("Fast", 50000, 4);
    add_bytes(0, IO_MAP_INPUTS, 0, 4);
    add_bytes(0, IO_MAP_OUTPUTS, 0, 4);
    add_bytes(1, IO_MAP_INPUTS, 4, 4);
    add_bytes(1, IO_MAP_OUTPUTS, 4, 4);
    start_io();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    plant.calls[0] = '\0';
}

static void inputs_stay_as_they_are(void)
{
    begin_two_tasks();
    memset(plant.in, 5, sizeof plant.in);
    plant.within = run_fast_task; /* within the read of the slow one */
    CHECK(IecTaskCycle(0, SysTimeGetNs()));
    CHECK_EQUAL(test_driver.skipped, 3); /* its inputs, outputs, and bus cycle */
    CHECK_EQUAL(output_at(0), 5);
    CHECK_EQUAL(output_at(4), 0);
    CHECK(IecTaskCycle(1, SysTimeGetNs()));
    CHECK_EQUAL(output_at(4), 5);
}

static void who_is_in_the_driver_writes_the_outputs_of_the_other(void)
{
    begin_two_tasks();
    memset(AppGetAreaAddress(APP_AREA_INPUT, 0, 8), 9, 8);
    memset(plant.in, 9, sizeof plant.in);
    plant.within = run_fast_task;
    CHECK(IecTaskCycle(0, SysTimeGetNs()));
    CHECK_EQUAL(output_at(0), 9);
    CHECK_EQUAL(output_at(4), 9);            /* at once, not in its next cycle */
    CHECK(strcmp(plant.calls, "rwbw") == 0); /* what was left is done before the own outputs */
    CHECK_EQUAL(test_driver.pending, 0);
    CHECK_EQUAL(test_driver.busy, 0);
}

/* Writes one DINT bit by bit from two tasks, each interrupting the other's driver calls; none is lost. */
static void two_tasks_write_bits_of_one_byte(void)
{
    RTS_UI32 i;

    begin_io();
    add_task(&spec, "Low", KIND_CYCLIC, 100000, here(&spec));
    emit_copy(&spec, APP_AREA_OUTPUT, 0, APP_AREA_DATA, 0);
    emit_ret(&spec);
    add_task(&spec, "High", KIND_CYCLIC, 50000, here(&spec));
    emit_copy(&spec, APP_AREA_OUTPUT, 4, APP_AREA_DATA, 4);
    emit_ret(&spec);
    /* one byte of the device, its lower bits from one task, its upper bits from the other */
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 0, DRIVER_OUTPUTS, 0, 0, 4);
    io_add_channel(&io, 1, IO_MAP_OUTPUTS, 0, DRIVER_OUTPUTS, 4, 32, 4);
    start_io();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    for (i = 0; i < 10000; i++) {
        *AppGetAreaAddress(APP_AREA_DATA, 0, 1) = (RTS_UI8)(i & 15);
        *AppGetAreaAddress(APP_AREA_DATA, 4, 1) = (RTS_UI8)(i >> 4 & 15);
        plant.within = i % 3 != 0 ? run_fast_task : NULL;
        if (plant.within == NULL)
            run_fast_task();
        if (!IecTaskCycle(0, SysTimeGetNs()) || plant.out[0] != (i & 0xFF)) {
            CHECK_EQUAL(plant.out[0], i & 0xFF);
            break;
        }
    }
    CHECK_EQUAL(i, 10000);
    CHECK(test_driver.skipped > 6000);
}

static void a_bus_cycle_is_done_by_who_is_in_the_driver(void)
{
    begin_two_tasks();
    memset(plant.bus_cycles, 0, sizeof plant.bus_cycles);
    plant.within = run_fast_task;
    CHECK(IecTaskCycle(0, SysTimeGetNs()));
    CHECK_EQUAL(plant.bus_cycles[0], 1);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(inputs_stay_as_they_are);
    RUN(who_is_in_the_driver_writes_the_outputs_of_the_other);
    RUN(two_tasks_write_bits_of_one_byte);
    RUN(a_bus_cycle_is_done_by_who_is_in_the_driver);
    return test_result();
}
