/*
 * io_any.h - any I/O configuration, in an image that is right otherwise: it is refused, or runs and stops without harm.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * For a test and a fuzz target. The drivers are those of the simulator, IoDrvGpio on its lines, IoDrvModbus on a line
 * "COM2" with a device that replies to everything and a client that asks in between, and the one of io_driver.h. Harm is
 * what a sanitizer finds, and any byte changed around the inputs and outputs, and before and after the variables.
 */
#ifndef IO_ANY_H
#define IO_ANY_H

#include "IoDrvGpio.h"
#include "IoDrvModbus.h"
#include "IoDrvSim.h"
#include "ModbusRtu.h"
#include "io_driver.h"
#include "no_network.h"

/* Bytes of the areas: the configurations in the corpus need no more, and there is memory past the end of each. */
enum { ANY_INPUTS = 64, ANY_OUTPUTS = 64, ANY_DATA = 512, ANY_GUARD = 1024, ANY_MARK = 0xA5 };
enum { ANY_LINE = 5, ANY_PASS_MS = 5 };

/* ---- the line ---- */

static struct {
    RTS_UI8 in[256]; /* to the controller */
    RTS_UI32 in_size;
    RTS_UI32 asked; /* requests of the other client */
} any_line;

static void any_send(RTS_UI32 size)
{
    RTS_UI16 crc = ModbusCrc(any_line.in, size);

    any_line.in[size] = (RTS_UI8)crc;
    any_line.in[size + 1] = (RTS_UI8)(crc >> 8);
    any_line.in_size = size + MODBUS_CRC_SIZE;
}

/* As long as it was asked for, of a value that goes on. */
static void any_reply(const RTS_UI8 *request)
{
    RTS_UI32 count = (RTS_UI32)request[4] << 8 | request[5];
    bool reads_bits = request[1] == MODBUS_READ_COILS || request[1] == MODBUS_READ_DISCRETE_INPUTS;
    bool reads = reads_bits || request[1] == MODBUS_READ_HOLDING_REGISTERS || request[1] == MODBUS_READ_INPUT_REGISTERS;
    RTS_UI32 size = reads_bits ? (count + 7) / 8 : 2 * count;
    RTS_UI32 i;

    memcpy(any_line.in, request, 6); /* what is written is echoed */
    for (i = 0; reads && i < size && i < 250; i++)
        any_line.in[3 + i] = (RTS_UI8)(i + any_line.asked);
    if (reads)
        any_line.in[2] = (RTS_UI8)i;
    any_send(reads ? 3 + i : 6);
}

/* Requests for a server, which a client takes for noise. */
static void any_ask(void)
{
    static const RTS_UI8 requests[][11] = {
        {5, MODBUS_READ_HOLDING_REGISTERS, 0, 0, 0, 6},
        {5, MODBUS_WRITE_REGISTERS, 0, 1, 0, 2, 4, 0x12, 0x34, 0x56, 0x78},
        {5, MODBUS_READ_INPUT_REGISTERS, 0, 0, 0, 1},
        {5, MODBUS_WRITE_COILS, 0, 0, 0, 8, 1, 0xFF},
        {5, MODBUS_READ_COILS, 0, 0, 0, 20},
    };
    static const RTS_UI8 sizes[] = {6, 11, 6, 8, 6};
    RTS_UI32 which = any_line.asked++ % RTS_COUNT(requests);

    memcpy(any_line.in, requests[which], sizes[which]);
    any_send(sizes[which]);
}

RTS_RESULT __wrap_SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index);
RTS_RESULT __wrap_SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index)
{
    RTS_UNUSED(settings);
    *index = ANY_LINE;
    return strcmp(name, "COM2") == 0 ? ERR_OK : ERR_NO_OBJECT;
}

void __wrap_SysComClose(RTS_UI32 index);
void __wrap_SysComClose(RTS_UI32 index)
{
    RTS_UNUSED(index);
}

RTS_UI32 __wrap_SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size);
RTS_UI32 __wrap_SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 count = any_line.in_size < size ? any_line.in_size : size;

    if (index != ANY_LINE)
        return 0;
    memcpy(data, any_line.in, count);
    any_line.in_size = 0;
    return count;
}

RTS_UI32 __wrap_SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size);
RTS_UI32 __wrap_SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    if (index == ANY_LINE && size >= 6)
        any_reply(data);
    return size;
}

/* ---- the device ---- */

/* Two tasks, which copy inputs to outputs. */
static void any_spec(void)
{
    spec_init(&spec);
    spec.areas[APP_AREA_DATA] = ANY_DATA;
    spec.areas[APP_AREA_INPUT] = ANY_INPUTS;
    spec.areas[APP_AREA_OUTPUT] = ANY_OUTPUTS;
    add_copying_task("Main", 10000, 0);
    add_copying_task("Other", 20000, 4);
    while (spec.code_size % 4 != 0)
        emit_ret(&spec);
}

/* Once, with power on. */
static void any_begin(void)
{
    start_blank();
    CHECK_EQUAL(IoMgrRegisterInstance(&test_driver), ERR_OK);
    CHECK_EQUAL(IoDrvGpio_Hook(CH_INIT2), ERR_OK);
    CHECK_EQUAL(IoDrvModbus_Hook(CH_INIT2), ERR_OK);
}

static void any_pass(RTS_UI32 passes)
{
    for (; passes > 0; passes--) {
        CHECK_EQUAL(SimAdvance(ms(ANY_PASS_MS)), ERR_OK);
        if (any_line.in_size == 0)
            any_ask();
        CHECK_EQUAL(IoDrvModbus_Hook(CH_COMM_CYCLE), ERR_OK);
        CHECK_EQUAL(IoDrvGpio_Hook(CH_COMM_CYCLE), ERR_OK);
        (void)SimGpioSet("DI0", passes & 1);
        (void)SimGpioSet("DI2", passes & 1);
    }
}

/* Requests from outside for whatever the configuration has, and more. */
static void any_requests(void)
{
    static const RTS_UI32 ids[] = {1, 3, 5, 9, 0x1000, 0x2000, 0x4000, 0x8001, IO_SIM_LATE};
    IoDrvModule module;
    RTS_UI8 data[64];
    RTS_UI32 i;
    RTS_UI32 k;

    for (i = 0; i < 6; i++) {
        for (k = 0; k < RTS_COUNT(ids); k++) {
            (void)IoMgrReadParameter(i, ids[k], data, 8, i);
            (void)IoMgrReadParameter(i, ids[k], data, 8 * sizeof data, 0);
            (void)IoMgrWriteParameter(i, ids[k], data, 3, i);
        }
        for (k = 0; k < 3; k++)
            (void)IoMgrScanModules(i, k, &module);
    }
}

/* All devices that are simulated, and the lines of the board, are gone, or back. */
static void any_lose(RTS_UI32 are_lost)
{
    RTS_UI32 i;

    for (i = 0; i < 6; i++)
        (void)IoMgrWriteParameter(i, IO_SIM_ABSENT, &are_lost, 32, 0);
    SimGpioUnplug((int)are_lost);
}

/* ---- what is around the areas ---- */

typedef struct {
    RTS_UI32 area;
    RTS_UI32 offset; /* of the guard, past the end of the area */
    RTS_UI32 size;
} ANY_PLACE;

static const ANY_PLACE any_guards[] = {
    {APP_AREA_INPUT, ANY_INPUTS, APP_INPUT_SIZE - ANY_INPUTS},
    {APP_AREA_OUTPUT, ANY_OUTPUTS, APP_OUTPUT_SIZE - ANY_OUTPUTS},
    {APP_AREA_DATA, ANY_DATA, ANY_GUARD},
    {APP_AREA_DATA, APP_DATA_SIZE - ANY_GUARD, ANY_GUARD}, /* before the inputs */
};

static RTS_UI8 *any_guard(const ANY_PLACE *place)
{
    return (RTS_UI8 *)AppGetAreaAddress(place->area, 0, 1) + place->offset;
}

static void any_mark(void)
{
    RTS_UI32 i;

    for (i = 0; i < RTS_COUNT(any_guards); i++)
        memset(any_guard(&any_guards[i]), ANY_MARK, any_guards[i].size);
}

static bool any_is_all(const RTS_UI8 *bytes, RTS_UI32 size, RTS_UI8 value)
{
    return size == 0 || (bytes[0] == value && memcmp(bytes, bytes + 1, size - 1) == 0);
}

/* Whether all guards have a value; all outputs are cleared when they become safe, those past its end too. */
static bool any_is_marked(RTS_UI8 value, bool outputs_are_safe)
{
    bool is_marked = true;
    RTS_UI32 i;

    for (i = 0; i < RTS_COUNT(any_guards); i++) {
        const ANY_PLACE *place = &any_guards[i];
        RTS_UI8 expected = place->area == APP_AREA_OUTPUT && outputs_are_safe ? 0 : value;
        is_marked = is_marked && any_is_all(any_guard(place), place->size, expected);
    }
    return is_marked;
}

/* ---- a configuration ---- */

/* Emits one with connectors within connectors, of several drivers and tasks, and every kind of channel. */
static void any_nest(const char *driver)
{
    io_init(&io);
    io_add_connector(&io, "Bus", driver)->state = 16;
    io_add_parameter(&io, 3, 8, 0x12);
    io_add_text_parameter(&io, 9, "/dev/ttyS1");
    io_add_connector(&io, "Gateway", "IoDrvSim")->parent = 0;
    io_add_connector(&io, "A device with the longest name!", "IoDrvSim")->parent = 1;
    io.connectors[2].bus_task = 1;
    io_add_connector(&io, "Module", driver)->parent = 2;
    io.connectors[3].flags |= CF_OPTIONAL;
    add_bytes(0, IO_MAP_INPUTS, 0, 4);
    add_bytes(1, IO_MAP_OUTPUTS, 0, 4)->flags = IO_VALUE;
    io_add_channel(&io, 0, IO_MAP_INPUTS, 1, 5, 3, 67, 1)->flags = IO_HOLD;
    io_add_channel(&io, 1, IO_MAP_INPUTS, 2, 5, 0, 72, 32)->flags |= IO_CHANNEL_BIG_ENDIAN;
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 2, 6, 8, 64, 16)->flags |= IO_CHANNEL_BIG_ENDIAN;
    io_add_channel(&io, 1, IO_MAP_OUTPUTS, 3, 2, 17, 81, 3);
    emit_io(&spec, &io);
}

static APP_REFUSAL any_refusal;

/* Runs and stops what is loaded; what is wrong, NULL: nothing. */
static const char *any_run(void)
{
    if (!any_is_marked(0, true))
        return "loading it wrote beyond its areas";
    any_mark();
    if (AppStartApplication() != ERR_OK)
        return "it does not start";
    any_pass(4);
    any_requests();
    any_lose(1);
    any_pass(3);
    any_lose(0);
    any_pass(1);
    if (!any_is_marked(ANY_MARK, false))
        return "a cycle wrote beyond its areas";
    if (AppStopApplication() != ERR_OK)
        return "it does not stop";
    any_pass(2);
    if (!any_is_marked(ANY_MARK, true))
        return "the stop wrote beyond its areas";
    if (app_exception() != RTSEXCPT_NOEXCEPTION)
        return "it has an exception";
    return AppReset(RESET_OPTION_ORIGIN) == ERR_OK ? NULL : "it is not unloaded";
}

/* Loads, runs, stops and unloads a configuration. What is wrong with that, NULL: nothing; *loaded: it was not refused. */
static const char *any_try(const void *config, RTS_UI32 size, bool *loaded)
{
    any_spec();
    spec.io.offset = here(&spec);
    emit(&spec, config, size);
    spec.io.size = size;
    memset(&any_line, 0, sizeof any_line);
    memset(&plant, 0, sizeof plant);
    build_image(&image, &spec);
    memset(&any_refusal, 0, sizeof any_refusal);
    *loaded = download_part(&image, image.size, &any_refusal) == ERR_OK;
    if (*loaded)
        return any_run();
    return any_refusal.text[0] != '\0' ? NULL : "it is refused without a sentence";
}

#endif
