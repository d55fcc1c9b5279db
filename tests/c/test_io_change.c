/*
 * test_io_change.c - online changes of a program with inputs and outputs, as a driver sees them.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppDownload.h"
#include "io_driver.h"

/* Two tasks; the second one copies bytes that the first one does not. */
static void specify(void)
{
    begin_io();
    io_add_parameter(&io, 7, 32, 1);
    io_add_text_parameter(&io, 8, "COM1");
    add_copying_task("Fast", 10000, 0);
    add_copying_task("Slow", 20000, 4);
    add_bytes(0, IO_MAP_INPUTS, 0, 4);
    add_bytes(0, IO_MAP_OUTPUTS, 0, 4);
    add_bytes(0, IO_MAP_INPUTS, 4, 4);
    add_bytes(1, IO_MAP_OUTPUTS, 4, 4);
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 0, DRIVER_OUTPUTS, 64, 64, 3);
}

static char why[APP_REFUSAL_SIZE];

/* The specified program takes the place of the one that runs. `more`: bytes of code before the configuration. */
static RTS_RESULT change(RTS_UI32 more)
{
    RTS_UI32 base = image_crc(&image);
    APP_SPEC with_io = spec;
    APP_REFUSAL refusal;
    APP_BYTES changed;
    RTS_RESULT result;

    for (; more > 0; more--)
        emit_ret(&with_io);
    emit_io(&with_io, &io);
    with_io.change = (CDL_CHANGE){base, CDL_CHANGE_NO_INIT, 0, 0};
    build_image(&changed, &with_io);
    result = send_part(&changed, changed.size);
    if (result == ERR_OK)
        result = AppDownloadChange(&refusal);
    if (result == ERR_OK)
        image = changed;
    memcpy(why, refusal.text, sizeof why);
    return result;
}

static APP_SPEC bare; /* before the configuration was emitted */
static IO_SPEC described;

static void again(void)
{
    spec = bare;
    io = described;
}

static void note(void)
{
    bare = spec;
    described = io;
}

static void begin(void)
{
    specify();
    note();
    start_io();
    memcpy(plant.in, "\x11\x22\x33\x44\x55\x66\x77\x88", 8);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK(memcmp(plant.out, plant.in, 8) == 0);
    again();
}

static void driver_goes_on_and_is_told_once(void)
{
    RTS_UI32 n;

    begin();
    for (n = 1; n <= 4; n++) {
        plant.connector = IoMgrConfigGetConnector(0);
        memset(plant.calls, 0, sizeof plant.calls);
        CHECK_EQUAL(change(8 * n), ERR_OK);
        CHECK(strcmp(plant.calls, "f") == 0);
        CHECK(plant.followed == IoMgrConfigGetConnector(0) && plant.followed != plant.connector);
        CHECK(memcmp(plant.out, plant.in, 8) == 0);
        plant.in[0]++;
        CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
        CHECK(memcmp(plant.out, plant.in, 8) == 0);
        CHECK(strpbrk(plant.calls, "CcM") == NULL);
        again();
    }
}

static void pointers_lead_to_the_same_parts_and_others_stay(void)
{
    const IoConfigConnector *connector;
    const IoConfigParameter *parameter;
    const char *text;
    char own;

    begin();
    connector = IoMgrConfigGetConnector(0);
    parameter = IoMgrConfigGetParameter(connector, 7);
    text = IoMgrConfigGetParameterValueText(IoMgrConfigGetParameter(connector, 8));
    CHECK_EQUAL(change(100), ERR_OK);
    connector = IoMgrConfigGetConnector(0);
    CHECK(IoMgrConfigFollow(parameter) == IoMgrConfigGetParameter(connector, 7));
    CHECK(IoMgrConfigFollow(text) == IoMgrConfigGetParameterValueText(IoMgrConfigGetParameter(connector, 8)));
    CHECK(IoMgrConfigFollow(NULL) == NULL);
    CHECK(IoMgrConfigFollow(&own) == &own);
}

/* The last channel is three bits, that may be one channel or more. */
static void tasks_may_use_other_channels(void)
{
    begin();
    io.channels[2].task = 1;
    io.channels[1].task = 1;
    io.channels[4].task = 1;
    io.channels[4].map.bits = 1;
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 0, DRIVER_OUTPUTS, 65, 65, 2);
    io_add_channel(&io, 1, IO_MAP_OUTPUTS, 0, DRIVER_OUTPUTS, 65, 65, 1);
    CHECK_EQUAL(change(0), ERR_OK);
    memset(plant.in, 9, 8);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK(memcmp(plant.out, plant.in, 8) == 0);
}

static void bus_cycle_may_be_in_another_task(void)
{
    begin();
    io.connectors[0].bus_task = 1;
    CHECK_EQUAL(change(0), ERR_OK);
    memset(plant.bus_cycles, 0, sizeof plant.bus_cycles);
    CHECK_EQUAL(SimAdvance(ms(200)), ERR_OK);
    CHECK(plant.bus_cycles[0] >= 9 && plant.bus_cycles[0] <= 11);
}

/* Nothing has changed, and the driver was not asked. */
static void check_refused(void)
{
    RTS_UI32 crc = image_crc(&image);
    APP_STATUS status;

    memset(plant.calls, 0, sizeof plant.calls);
    CHECK_EQUAL(change(0), ERR_NOT_SUPPORTED);
    CHECK(strcmp(why, "The I/O configuration has changed; download the program.") == 0);
    AppGetStatus(&status);
    CHECK_EQUAL(status.image_crc, crc);
    CHECK_EQUAL(status.state, AS_RUN);
    CHECK(strcmp(plant.calls, "") == 0);
    again();
}

static void whatever_the_driver_has_not_checked_is_refused(void)
{
    IoConfigChannelMap *map;

    begin();
    io.connectors[0].flags |= CF_OPTIONAL;
    check_refused();
    io.parameters[0].value = 2;
    check_refused();
    io.data[io.head.data_size - 8] ^= 1; /* "COM1" */
    check_refused();
    io_add_connector(&io, "Second", "IoDrvTest");
    check_refused();
    io_add_text_parameter(&io, 9, "x");
    check_refused();
    map = &io.channels[3].map;
    map->parameter = DRIVER_INPUTS;
    check_refused();
    map->parameter_bit += 8;
    check_refused();
    map->area_bit += 8;
    check_refused();
    map->bits += 8;
    check_refused();
    map->bits = 8 * 28;
    check_refused();
    map->flags |= IO_CHANNEL_BIG_ENDIAN;
    check_refused();
    io.channels[4].map.bits = 4;
    check_refused();
    io.channels[4].map.parameter_bit = 65;
    check_refused();
    CHECK_EQUAL(change(0), ERR_OK);
}

static void program_with_devices_and_one_without_are_no_change_of_each_other(void)
{
    APP_REFUSAL refusal;
    APP_BYTES changed;

    begin();
    spec.change = (CDL_CHANGE){image_crc(&image), CDL_CHANGE_NO_INIT, 0, 0};
    build_image(&changed, &spec);
    CHECK_EQUAL(send_part(&changed, changed.size), ERR_OK);
    CHECK_EQUAL(AppDownloadChange(&refusal), ERR_NOT_SUPPORTED);
    CHECK(strcmp(refusal.text, "The I/O configuration has changed; download the program.") == 0);
    again();
    CHECK_EQUAL(download(&changed), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    image = changed;
    check_refused();
}

static const IoDrvInfo *old_info(void)
{
    static const IoDrvInfo info = {"IoDrvOld", "Test", "Tests", 1};

    return &info;
}

static RTS_RESULT old_configure(const IoConfigConnector *connectors, int count)
{
    RTS_UNUSED(connectors);
    RTS_UNUSED(count);
    return ERR_OK;
}

static void driver_that_knows_no_change_is_named(void)
{
    static const ICmpIoDrv functions = {.IoDrvGetInfo = old_info, .IoDrvUpdateConfiguration = old_configure};
    static IO_DRIVER driver = {.functions = &functions};

    specify();
    CHECK_EQUAL(IoMgrRegisterInstance(&driver), ERR_OK);
    note();
    start_io();
    again();
    CHECK_EQUAL(change(0), ERR_OK); /* the program has none of it */
    again();
    io_add_connector(&io, "Old", "IoDrvOld");
    note();
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    again();
    CHECK_EQUAL(change(0), ERR_NOT_SUPPORTED);
    CHECK(strcmp(why, "The driver IoDrvOld knows no online change; download the program.") == 0);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(driver_goes_on_and_is_told_once);
    RUN(pointers_lead_to_the_same_parts_and_others_stay);
    RUN(tasks_may_use_other_channels);
    RUN(bus_cycle_may_be_in_another_task);
    RUN(whatever_the_driver_has_not_checked_is_refused);
    RUN(program_with_devices_and_one_without_are_no_change_of_each_other);
    RUN(driver_that_knows_no_change_is_named);
    return test_result();
}
