/*
 * test_io_refused.c - inputs and outputs that a device does not have refuse the application, by name.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IoDrvSim.h"
#include "Sim.h"
#include "io_driver.h"

static APP_REFUSAL refusal;

/* Application 1 runs on a device that has IoDrvTest only; a good application is there to be spoilt. */
static void begin_with_old(void)
{
    APP_BYTES old;

    begin_io();
    CHECK_EQUAL(IoDrvSim_Hook(CH_EXIT2), ERR_OK); /* it would take all connectors */
    build_counter(&old, 1);
    CHECK_EQUAL(download(&old), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    add_copying_task("Main", 10000, 0);
    add_bytes(0, IO_MAP_INPUTS, 0, 4);
}

static RTS_RESULT try_load(void)
{
    emit_io(&spec, &io);
    build_image(&image, &spec);
    return download_part(&image, image.size, &refusal);
}

static void check_refused(RTS_RESULT result, const char *text)
{
    CHECK_EQUAL(try_load(), result);
    if (strstr(refusal.text, text) == NULL)
        fprintf(stderr, "refused with: %s\n", refusal.text);
    CHECK(strstr(refusal.text, text) != NULL);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
}

static void a_missing_driver(void)
{
    begin_with_old();
    io_add_connector(&io, "Meter", "IoDrvModbus");
    check_refused(ERR_NO_OBJECT, "Meter needs the driver IoDrvModbus, which this device does not have.");
    CHECK(log_has("Download refused: Meter needs"));
}

static void an_optional_device_without_driver_is_left_out(void)
{
    begin_with_old();
    io_add_connector(&io, "Meter", "IoDrvModbus")->flags |= CF_OPTIONAL;
    CHECK_EQUAL(try_load(), ERR_OK);
    CHECK(log_has("Meter is not used: there is no driver IoDrvModbus"));
}

static void a_device_that_is_not_enabled_needs_no_driver(void)
{
    begin_with_old();
    io_add_connector(&io, "Meter", "IoDrvModbus")->flags = 0;
    CHECK_EQUAL(try_load(), ERR_OK);
    CHECK(!log_has("Meter"));
}

static void a_device_that_is_left_out_is_told_of_once(void)
{
    begin_with_old();
    io_add_connector(&io, "Spare", "IoDrvTest")->flags |= CF_OPTIONAL;
    io_add_channel(&io, 0, IO_MAP_INPUTS, 1, DRIVER_INPUTS, 8 * DRIVER_MEMORY, 64, 8);
    io_add_channel(&io, 0, IO_MAP_INPUTS, 1, DRIVER_INPUTS, 8 * DRIVER_MEMORY + 8, 72, 8);
    CHECK_EQUAL(try_load(), ERR_OK);
    CHECK(log_has("Not used: Spare (IoDrvTest): it has no bit 512."));
    CHECK(!log_has("it has no bit 520."));
}

enum { FIRST = 1, LARGE, LAST, PARAMETER = 1 };

/* Simulated devices with an output of a byte each; that of the large one is too far away. */
static void add_simulated(void)
{
    static const char *const names[] = {"First", "Large", "Last"};

    for (RTS_UI16 i = FIRST; i <= LAST; i++) {
        IoConfigConnector *connector = io_add_connector(&io, names[i - FIRST], "IoDrvSim");
        if (i == LARGE)
            connector->flags |= CF_OPTIONAL;
        io_add_channel(&io, 0, IO_MAP_OUTPUTS, i, PARAMETER, i == LARGE ? 8 * (IO_SIM_MEMORY - 1) : 0, 8 * i, 8);
    }
}

static RTS_UI8 simulated(RTS_UI32 connector)
{
    RTS_UI8 value = 0;

    CHECK_EQUAL(IoMgrReadParameter(connector, PARAMETER, &value, 8, 0), ERR_OK);
    return value;
}

static void a_simulated_device_that_is_left_out_leaves_the_others_their_memory(void)
{
    begin_io();
    add_copying_task("Main", 10000, 0);
    add_bytes(0, IO_MAP_INPUTS, 0, 4);
    add_simulated();
    CHECK_EQUAL(try_load(), ERR_OK);
    CHECK(log_has("Not used: Large (IoDrvSim): all simulated devices together have 16384 bytes here."));
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    memcpy(plant.in, "\x00\x11\x22\x33", 4);
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(simulated(FIRST), 0x11);
    CHECK_EQUAL(simulated(LAST), 0x33);
}

static void a_configuration_that_the_driver_refuses(void)
{
    begin_with_old();
    plant.refuses = "Plant";
    check_refused(ERR_NO_OBJECT, "Plant (IoDrvTest): there is no line DI9.");
    CHECK(strchr(plant.calls, 'M') == NULL);
    CHECK(plant.calls[strlen(plant.calls) - 1] == 'c');
}

static void what_ran_before_runs_with_its_own_inputs_again(void)
{
    begin_with_old();
    add_bytes(0, IO_MAP_OUTPUTS, 0, 4);
    CHECK_EQUAL(try_load(), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    io_add_connector(&io, "Spare", "IoDrvTest");
    plant.refuses = "Spare";
    CHECK_EQUAL(try_load(), ERR_NO_OBJECT);
    CHECK_EQUAL(app_state(), AS_RUN);
    plant.in[0] = 0x77;
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(output_at(0), 0x77);
}

/* IoDrvSim takes every connector after a restart: what is left in flash would run. */
static void a_refused_application_does_not_run_after_a_restart(void)
{
    begin_io();
    CHECK_EQUAL(IoDrvSim_Hook(CH_EXIT2), ERR_OK);
    add_copying_task("Main", 10000, 0);
    plant.refuses = "Plant";
    CHECK_EQUAL(try_load(), ERR_NO_OBJECT);
    CHECK_EQUAL(app_state(), AS_NONE);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_NONE);
    CHECK(log_has("No boot project"));
}

static void one_that_failed_is_what_boots_again_after_a_refused_one(void)
{
    APP_SPEC dying;
    APP_BYTES old;

    begin_io();
    CHECK_EQUAL(IoDrvSim_Hook(CH_EXIT2), ERR_OK);
    spec_counter(&dying, 9);
    dying.tasks[0].entry_offset = here(&dying);
    emit_divide_by_zero(&dying);
    build_image(&old, &dying);
    CHECK_EQUAL(download(&old), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    add_copying_task("Main", 10000, 0);
    plant.refuses = "Plant";
    CHECK_EQUAL(try_load(), ERR_NO_OBJECT);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(app_state() != AS_RUN);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK(log_has("not started: it failed before"));
}

static void an_optional_device_that_the_driver_refuses_is_left_out(void)
{
    begin_with_old();
    io_add_connector(&io, "Spare", "IoDrvTest")->flags |= CF_OPTIONAL;
    plant.refuses = "Spare";
    CHECK_EQUAL(try_load(), ERR_OK);
    CHECK(log_has("Not used: Spare (IoDrvTest): there is no line DI9."));
}

/* What it took in vain it gives back, and keeps nothing that points into the application. */
static void a_driver_whose_devices_were_all_refused_is_told_of_the_end(void)
{
    begin_with_old();
    io.connectors[0].flags |= CF_OPTIONAL;
    plant.refuses = "Plant";
    CHECK_EQUAL(try_load(), ERR_OK);
    memset(plant.calls, 0, sizeof plant.calls);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK(strcmp(plant.calls, "c") == 0);
}

static void a_part_that_the_runtime_does_not_know(void)
{
    CDL_SEGMENT blob;
    RTS_UI32 *id;

    begin_with_old();
    emit_io(&spec, &io);
    build_image(&image, &spec);
    blob = image_header(&image).blob;
    id =
        (RTS_UI32 *)(void *)(image.bytes + blob.offset + blob.size - sizeof(IO_CONFIG_PLACE) - 8); /* of the last one */
    CHECK_EQUAL(*id, CDL_BLOB_IO);
    *id = CDL_BLOB_REQUIRED + 99;
    image_fix_crc(&image);
    CHECK_EQUAL(download_part(&image, image.size, &refusal), ERR_NOT_SUPPORTED);
    CHECK(strstr(refusal.text, "needs what this firmware lacks (0x80000063)") != NULL);
    CHECK_EQUAL(app_state(), AS_RUN);
}

static void inputs_and_outputs_of_another_board(void)
{
    begin_with_old();
    SimSetBoard("IO-16");
    io.head.board = io_add_text(&io, "IO-8");
    check_refused(ERR_ID_MISMATCH, "The inputs and outputs are those of the board IO-8, this is plctool simulator.");
    SimSetBoard("IO-8");
    CHECK_EQUAL(try_load(), ERR_OK);
    SimSetBoard(NULL);
}

static void a_board_without_a_name(void)
{
    begin_with_old();
    SimSetBoard("");
    io.head.board = io_add_text(&io, "");
    check_refused(ERR_SIZE_MISMATCH, "The I/O configuration is damaged (table 5, entry 0): build again.");
    io.head.board = io.head.data_size;
    check_refused(ERR_SIZE_MISMATCH, "The I/O configuration is damaged (table 5, entry 0): build again.");
    SimSetBoard(NULL);
}

/* ---- exact bounds: one more is refused, the last possible one is taken ---- */

static void a_channel_that_ends_after_its_area(void)
{
    begin_with_old();
    plant.is_careless = true;
    io.channels[0].map.bits = 32;
    io.channels[0].map.area_bit = 8 * (spec.areas[APP_AREA_INPUT] - 3);
    check_refused(ERR_INVALID_REFERENCE, "The I/O configuration is damaged (table ");
    io.channels[0].map.area_bit = 8 * (spec.areas[APP_AREA_INPUT] - 4);
    CHECK_EQUAL(try_load(), ERR_OK);
}

static void a_state_that_ends_after_the_data(void)
{
    begin_with_old();
    io.connectors[0].state = spec.areas[APP_AREA_DATA] - sizeof(IO_DEVICE_STATE) + 4;
    check_refused(ERR_INVALID_REFERENCE, "The I/O configuration is damaged (table ");
    io.connectors[0].state = spec.areas[APP_AREA_DATA] - sizeof(IO_DEVICE_STATE);
    CHECK_EQUAL(try_load(), ERR_OK);
}

static void a_parameter_that_ends_after_the_configuration(void)
{
    IoConfigParameter *parameter;

    begin_with_old();
    parameter = io_add_parameter(&io, 7, 33, io.head.data_size - 4);
    parameter->flags = PVF_POINTER;
    check_refused(ERR_INVALID_REFERENCE, "The I/O configuration is damaged (table ");
    parameter->bits = 32;
    CHECK_EQUAL(try_load(), ERR_OK);
}

static void a_bus_of_the_task_after_the_last_one(void)
{
    begin_with_old();
    io.connectors[0].bus_task = 1;
    check_refused(ERR_INVALID_REFERENCE, "The I/O configuration is damaged (table ");
    io.connectors[0].bus_task = 0;
    CHECK_EQUAL(try_load(), ERR_OK);
}

static void a_device_that_is_its_own_parent(void)
{
    begin_with_old();
    io.connectors[0].parent = 0;
    check_refused(ERR_INVALID_REFERENCE, "The I/O configuration is damaged (table ");
}

static void parameters_with_the_same_number(void)
{
    IoConfigParameter *second;

    begin_with_old();
    io_add_parameter(&io, 0, 8, 0);
    second = io_add_parameter(&io, 0, 8, 0);
    check_refused(ERR_INVALID_REFERENCE, "The I/O configuration is damaged (table ");
    second->id = 1;
    CHECK_EQUAL(try_load(), ERR_OK);
}

static void a_boot_project_is_refused_like_a_download(void)
{
    begin_with_old();
    plant.is_careless = true;
    io.channels[0].map.parameter_bit = 8u * 1024 * 1024; /* too far for IoDrvSim, which takes it after a restart */
    CHECK_EQUAL(try_load(), ERR_OK);
    SimStop();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_NONE);
    CHECK(log_has("Boot project refused: Plant (IoDrvTest): "));
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_missing_driver);
    RUN(an_optional_device_without_driver_is_left_out);
    RUN(a_device_that_is_not_enabled_needs_no_driver);
    RUN(a_device_that_is_left_out_is_told_of_once);
    RUN(a_simulated_device_that_is_left_out_leaves_the_others_their_memory);
    RUN(a_configuration_that_the_driver_refuses);
    RUN(what_ran_before_runs_with_its_own_inputs_again);
    RUN(a_refused_application_does_not_run_after_a_restart);
    RUN(one_that_failed_is_what_boots_again_after_a_refused_one);
    RUN(an_optional_device_that_the_driver_refuses_is_left_out);
    RUN(a_driver_whose_devices_were_all_refused_is_told_of_the_end);
    RUN(inputs_and_outputs_of_another_board);
    RUN(a_board_without_a_name);
    RUN(a_part_that_the_runtime_does_not_know);
    RUN(a_channel_that_ends_after_its_area);
    RUN(a_state_that_ends_after_the_data);
    RUN(a_parameter_that_ends_after_the_configuration);
    RUN(a_bus_of_the_task_after_the_last_one);
    RUN(a_device_that_is_its_own_parent);
    RUN(parameters_with_the_same_number);
    RUN(a_boot_project_is_refused_like_a_download);
    return test_result();
}
