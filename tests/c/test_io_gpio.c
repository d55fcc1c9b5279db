/*
 * test_io_gpio.c - IoDrvGpio: lines of the board as inputs and outputs, edges that start tasks, lines that are not there.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IoDrvGpio.h"
#include "SysGpio.h"
#include "io_driver.h"

static APP_REFUSAL refusal;

/* Line 0 is DI0, line 1 is DO0; the program copies input byte 0 to output byte 0. */
static void begin_lines(void)
{
    begin_io();
    CHECK_EQUAL(IoDrvGpio_Hook(CH_INIT2), ERR_OK);
    SimGpioUnplug(0);
    (void)SimGpioSet("DI0", 0);
    io_init(&io);
    io_add_connector(&io, "Board", "IoDrvGpio");
    add_copying_task("Main", 10000, 0);
    io_add_channel(&io, 0, IO_MAP_INPUTS, 0, GPIO_INPUTS, 0, 0, 1);
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 0, GPIO_OUTPUTS, 1, 0, 1);
}

static void add_lines(RTS_UI32 in_options, RTS_UI32 out_options)
{
    io_add_text_parameter(&io, GPIO_LINE + 0, "DI0");
    io_add_text_parameter(&io, GPIO_LINE + 1, "DO0");
    io_add_parameter(&io, GPIO_OPTIONS + 0, 8, in_options);
    io_add_parameter(&io, GPIO_OPTIONS + 1, 8, out_options | GPIO_OPTION_OUT);
}

static void end_lines(void)
{
    CHECK_EQUAL(IoDrvGpio_Hook(CH_EXIT2), ERR_OK);
}

static void check_refused(RTS_RESULT result, const char *text)
{
    emit_io(&spec, &io);
    build_image(&image, &spec);
    CHECK_EQUAL(download_part(&image, image.size, &refusal), result);
    if (strstr(refusal.text, text) == NULL)
        fprintf(stderr, "refused with: %s\n", refusal.text);
    CHECK(strstr(refusal.text, text) != NULL);
    end_lines();
}

static void a_line_follows_another_one(void)
{
    begin_lines();
    add_lines(0, 0);
    start_io();
    CHECK_EQUAL(SimGpioSet("DI0", 1), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(SimGpioGet("DO0"), 1);
    CHECK_EQUAL(SimGpioSet("DI0", 0), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(SimGpioGet("DO0"), 0);
    end_lines();
}

static void lines_may_be_true_when_they_are_low(void)
{
    begin_lines();
    add_lines(GPIO_OPTION_ACTIVE_LOW, GPIO_OPTION_ACTIVE_LOW);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(SimGpioGet("DO0"), 1); /* FALSE */
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_INPUT, 0), 1);
    CHECK_EQUAL(SimGpioGet("DO0"), 0);
    end_lines();
}

static void an_edge_starts_a_task(void)
{
    RTS_UI32 entry;

    begin_lines();
    add_lines(GPIO_OPTION_RISING, 0);
    io_add_text_parameter(&io, GPIO_EVENT + 0, "door");
    entry = here(&spec);
    add_task(&spec, "OnDoor", KIND_EXTERNAL, 0, entry)->event_offset = CRC32Update(0, "door", 4);
    emit_add(&spec, APP_AREA_DATA, 0, 1);
    emit_ret(&spec);
    start_io();
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 0), 0);
    CHECK_EQUAL(SimGpioSet("DI0", 1), ERR_OK);
    CHECK_EQUAL(SimGpioSet("DI0", 0), ERR_OK);
    CHECK_EQUAL(SimGpioSet("DI0", 1), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 0), 2);
    end_lines();
}

static void a_task_that_waits_for_an_event_of_no_line(void)
{
    begin_lines();
    add_lines(0, 0);
    add_task(&spec, "OnDoor", KIND_EXTERNAL, 0, 0)->event_offset = 77;
    check_refused(ERR_NO_OBJECT, "Task OnDoor waits for an event that nothing posts.");
}

static void a_line_that_the_board_has_not(void)
{
    begin_lines();
    io_add_text_parameter(&io, GPIO_LINE + 0, "DI9");
    check_refused(ERR_NO_OBJECT, "Board (IoDrvGpio): this device has no line DI9.");
}

static void a_line_that_something_else_has(void)
{
    begin_lines();
    add_lines(0, 0);
    CHECK_EQUAL(SimGpioTake("DO0", 1), ERR_OK);
    check_refused(ERR_OPERATION_DENIED, "Board (IoDrvGpio): line DO0 is in use by something else.");
    CHECK_EQUAL(SimGpioTake("DO0", 0), ERR_OK);
}

static void a_line_that_is_named_twice(void)
{
    begin_lines();
    io_add_text_parameter(&io, GPIO_LINE + 0, "DI0");
    io_add_text_parameter(&io, GPIO_LINE + 1, "DI0");
    check_refused(ERR_OPERATION_DENIED, "line DI0 is in use");
}

static void an_input_as_an_output(void)
{
    begin_lines();
    io_add_text_parameter(&io, GPIO_LINE + 0, "DI0");
    io_add_parameter(&io, GPIO_OPTIONS + 0, 8, GPIO_OPTION_OUT);
    check_refused(ERR_NOT_SUPPORTED, "line DI0 cannot do what its options ask for.");
}

static void a_channel_that_is_no_line(void)
{
    begin_lines();
    add_lines(0, 0);
    io_add_channel(&io, 0, IO_MAP_INPUTS, 0, GPIO_INPUTS, 32, 8, 1);
    check_refused(ERR_OUT_OF_LIMITS, "it has no channel 1.32.");
}

/* A second connector with the line `name`, number 0. */
static IoConfigConnector *add_connector_of(const char *name, RTS_UI32 options)
{
    IoConfigConnector *connector = io_add_connector(&io, name, "IoDrvGpio");

    io_add_text_parameter(&io, GPIO_LINE + 0, name);
    io_add_parameter(&io, GPIO_OPTIONS + 0, 8, options);
    return connector;
}

static void lines_of_a_refused_channel_are_free(void)
{
    SYS_GPIO_LINE line = {"DO1", GPIO_OPTION_OUT, RTS_INVALID_HANDLE};

    begin_lines();
    add_lines(0, 0);
    add_connector_of("DO1", GPIO_OPTION_OUT)->flags |= CF_OPTIONAL;
    io_add_channel(&io, 0, IO_MAP_INPUTS, 1, GPIO_INPUTS, 32, 8, 1);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK(log_has("Not used: DO1 (IoDrvGpio): it has no channel 1.32."));
    CHECK_EQUAL(SimAdvance(ms(1)), ERR_OK);
    CHECK_EQUAL(IoDrvGpio_Hook(CH_COMM_CYCLE), ERR_OK);
    CHECK_EQUAL(SysGpioAdd(2, 0, &line), ERR_OK);
    SysGpioClose(2);
    end_lines();
}

static void a_held_output_stays_over_a_download(void)
{
    begin_lines();
    add_lines(0, 0);
    io.channels[1].map.flags = IO_HOLD;
    start_io();
    CHECK_EQUAL(SimGpioSet("DI0", 1), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(SimGpioGet("DO0"), 1);
    add_task(&spec, "More", KIND_CYCLIC, 10000, 0);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(SimGpioGet("DO0"), 1);
    end_lines();
}

/* Another application, for which connectors are to follow. */
static void begin_lines_again(void)
{
    spec_init(&spec);
    spec.areas[APP_AREA_INPUT] = 32;
    spec.areas[APP_AREA_OUTPUT] = 32;
    io_init(&io);
    add_copying_task("Main", 10000, 0);
}

static void groups_of_lines_may_be_removed_added_and_change_places(void)
{
    static const char *const orders[][3] = {{"DI0", "DI1", NULL}, {"DI1", NULL},        {"DI0", NULL},
                                            {"DI0", "DI1", NULL}, {"DI1", "DI0", NULL}, {"DI2", "DI1", NULL}};
    RTS_UI32 i;

    begin_lines();
    for (i = 0; i < RTS_COUNT(orders); i++) {
        const char *const *name = orders[i];
        begin_lines_again();
        for (; *name != NULL; name++)
            add_connector_of(*name, 0);
        CHECK_EQUAL(load_io(), ERR_OK);
    }
    end_lines();
}

static void lines_may_move_to_another_group(void)
{
    begin_lines();
    begin_lines_again();
    add_connector_of("DI0", 0);
    add_connector_of("DO0", GPIO_OPTION_OUT);
    CHECK_EQUAL(load_io(), ERR_OK);
    begin_lines_again();
    add_connector_of("DO0", GPIO_OPTION_OUT);
    io_add_connector(&io, "Both", "IoDrvGpio");
    io_add_text_parameter(&io, GPIO_LINE + 0, "DI1");
    io_add_text_parameter(&io, GPIO_LINE + 1, "DI0");
    CHECK_EQUAL(load_io(), ERR_OK);
    end_lines();
}

/* All else is as it was: what a line is called, and its options. */
static void a_line_that_becomes_another_is_opened_again(void)
{
    static const struct {
        const char *name;
        RTS_UI32 options;
        RTS_UI32 input;
    } lines[] = {{"DI0", 0, 1}, {"DI1", 0, 0}, {"DI1", GPIO_OPTION_ACTIVE_LOW, 1}, {"DI1", 0, 0}, {"DI0", 0, 1}};
    RTS_UI32 i;

    begin_lines();
    CHECK_EQUAL(SimGpioSet("DI0", 1), ERR_OK);
    for (i = 0; i < RTS_COUNT(lines); i++) {
        begin_lines_again();
        add_connector_of(lines[i].name, lines[i].options);
        io_add_channel(&io, 0, IO_MAP_INPUTS, 0, GPIO_INPUTS, 0, 0, 1);
        start_io();
        CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
        CHECK_EQUAL(read_u32(APP_AREA_INPUT, 0), lines[i].input);
    }
    CHECK_EQUAL(SimGpioSet("DI0", 0), ERR_OK);
    end_lines();
}

/* The held output is the second group at first, then the only one. */
static void a_held_output_stays_when_its_group_moves(void)
{
    begin_lines();
    begin_lines_again();
    add_connector_of("DI0", 0);
    add_connector_of("DO0", GPIO_OPTION_OUT);
    io_add_channel(&io, 0, IO_MAP_INPUTS, 0, GPIO_INPUTS, 0, 0, 1);
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 1, GPIO_OUTPUTS, 0, 0, 1)->flags = IO_HOLD;
    start_io();
    CHECK_EQUAL(SimGpioSet("DI0", 1), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(SimGpioGet("DO0"), 1);
    begin_lines_again();
    add_connector_of("DO0", GPIO_OPTION_OUT);
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 0, GPIO_OUTPUTS, 0, 0, 1)->flags = IO_HOLD;
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(SimGpioGet("DO0"), 1);
    end_lines();
}

/* An optional connector that is refused takes no group from those that follow. */
static void a_refused_connector_leaves_its_group(void)
{
    begin_lines();
    begin_lines_again();
    add_connector_of("DI9", 0)->flags |= CF_OPTIONAL;
    add_connector_of("DI0", 0);
    add_connector_of("DI1", 0);
    CHECK_EQUAL(load_io(), ERR_OK);
    end_lines();
}

static void lines_are_given_back_with_the_application(void)
{
    begin_lines();
    add_lines(0, 0);
    start_io();
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK_EQUAL(IoDrvGpio_Hook(CH_COMM_CYCLE), ERR_OK);
    CHECK_EQUAL(SimGpioSet("DI0", 1), ERR_OK);
    begin_lines_again();
    add_connector_of("DO0", 0);
    CHECK_EQUAL(load_io(), ERR_OK); /* another direction: it was free */
    end_lines();
}

static void main_pass(void)
{
    CHECK_EQUAL(IoDrvGpio_Hook(CH_COMM_CYCLE), ERR_OK);
}

/* Every 100 ms the manager wants it to be looked for, or opened; in between a pass of main looks for it. */
static void pass_until_looked_for(void)
{
    for (RTS_UI32 i = 0; i < 3; i++) {
        CHECK_EQUAL(SimAdvance(ms(110)), ERR_OK);
        main_pass();
    }
}

static void a_chip_that_has_gone_comes_back(void)
{
    begin_lines();
    add_lines(0, 0);
    io.connectors[0].state = 16;
    start_io();
    CHECK_EQUAL(SimGpioSet("DI0", 1), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    SimGpioUnplug(1);
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_INPUT, 0), 0); /* on_error */
    CHECK_EQUAL(AppGetAreaAddress(APP_AREA_DATA, 16 + 12, 1)[0], 0);
    SimGpioUnplug(0);
    pass_until_looked_for();
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_INPUT, 0), 1);
    CHECK_EQUAL(SimGpioGet("DO0"), 1);
    CHECK(log_has("Board has an error") && log_has("Board is back"));
    end_lines();
}

static bool is_ok(void)
{
    IO_DEVICE_STATE state;

    CHECK_EQUAL(IoMgrGetState(0, &state), ERR_OK);
    return state.ok != 0;
}

/* DI0 is read by the task that its edges start, and by no other one. */
static void begin_line_with_event(void)
{
    begin_lines();
    begin_lines_again();
    spec.task_count = 0;
    add_copying_task("OnDoor", 0, 0)->kind = KIND_EXTERNAL;
    spec.tasks[0].event_offset = CRC32Update(0, "door", 4);
    add_connector_of("DI0", GPIO_OPTION_RISING);
    io_add_text_parameter(&io, GPIO_EVENT + 0, "door");
    io_add_channel(&io, 0, IO_MAP_INPUTS, 0, GPIO_INPUTS, 0, 0, 1);
}

/* While the manager asks how a device is, tasks cannot use its driver; to ask all chips for their lines takes long. */
static void a_chip_that_has_gone_is_looked_for_while_tasks_may_use_others(void)
{
    begin_line_with_event();
    start_io();
    SimGpioUnplug(1);
    main_pass();
    SimGpioUnplug(0);
    CHECK_EQUAL(SimAdvance(ms(500)), ERR_OK);
    CHECK(!is_ok());
    main_pass();
    CHECK_EQUAL(SimAdvance(ms(110)), ERR_OK);
    CHECK(is_ok());
    end_lines();
}

/* It is given back, not opened, when the program goes meanwhile. */
static void lines_that_were_found_are_free_without_the_program(void)
{
    begin_line_with_event();
    start_io();
    SimGpioUnplug(1);
    main_pass();
    SimGpioUnplug(0);
    CHECK_EQUAL(SimAdvance(ms(110)), ERR_OK);
    main_pass();
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    main_pass();
    begin_lines_again();
    add_connector_of("DI0", 0);
    CHECK_EQUAL(load_io(), ERR_OK);
    end_lines();
}

/* Without an event nothing reads the lines, and a chip that has gone posts none. */
static void a_chip_that_only_posts_events_is_lost_and_comes_back(void)
{
    begin_line_with_event();
    start_io();
    main_pass();
    CHECK(is_ok());
    SimGpioUnplug(1);
    main_pass();
    CHECK(!is_ok());
    pass_until_looked_for();
    CHECK(!is_ok());
    SimGpioUnplug(0);
    pass_until_looked_for();
    CHECK(is_ok());
    CHECK(log_has("DI0 has an error") && log_has("DI0 is back"));
    CHECK_EQUAL(SimGpioSet("DI0", 1), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, 0), 1);
    end_lines();
}

/* Each pass of main looks, but it is one error. */
static void a_chip_that_has_gone_is_one_error(void)
{
    IO_DEVICE_STATE state;

    begin_line_with_event();
    start_io();
    SimGpioUnplug(1);
    main_pass();
    main_pass();
    CHECK_EQUAL(IoMgrGetState(0, &state), ERR_OK);
    CHECK_EQUAL(state.errors, 1);
    SimGpioUnplug(0);
    end_lines();
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_line_follows_another_one);
    RUN(lines_may_be_true_when_they_are_low);
    RUN(an_edge_starts_a_task);
    RUN(a_task_that_waits_for_an_event_of_no_line);
    RUN(a_line_that_the_board_has_not);
    RUN(a_line_that_something_else_has);
    RUN(a_line_that_is_named_twice);
    RUN(an_input_as_an_output);
    RUN(a_channel_that_is_no_line);
    RUN(lines_of_a_refused_channel_are_free);
    RUN(a_held_output_stays_over_a_download);
    RUN(groups_of_lines_may_be_removed_added_and_change_places);
    RUN(lines_may_move_to_another_group);
    RUN(a_line_that_becomes_another_is_opened_again);
    RUN(a_held_output_stays_when_its_group_moves);
    RUN(a_refused_connector_leaves_its_group);
    RUN(lines_are_given_back_with_the_application);
    RUN(a_chip_that_has_gone_comes_back);
    RUN(a_chip_that_only_posts_events_is_lost_and_comes_back);
    RUN(a_chip_that_has_gone_is_one_error);
    RUN(a_chip_that_has_gone_is_looked_for_while_tasks_may_use_others);
    RUN(lines_that_were_found_are_free_without_the_program);
    return test_result();
}
