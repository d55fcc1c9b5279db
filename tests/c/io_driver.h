/*
 * io_driver.h - a driver for tests of the I/O manager, and an application that copies its input to its output.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The driver has a memory of inputs (parameter 1) and one of outputs (parameter 2), is always well unless a test says
 * otherwise, and writes down how it is called.
 */
#ifndef IO_DRIVER_H
#define IO_DRIVER_H

#include "CmpIoMgrEmbedded.h"
#include "app_device.h"
#include "io_image.h"

enum { DRIVER_INPUTS = 1, DRIVER_OUTPUTS = 2, DRIVER_MEMORY = 64 };

static struct {
    RTS_UI8 in[DRIVER_MEMORY];
    RTS_UI8 out[DRIVER_MEMORY];
    char calls[64];       /* a letter each */
    bool is_careless;     /* checks no channel */
    const char *refuses;  /* connector that it refuses */
    void (*within)(void); /* called once, within the next function of a cycle: what interrupts it */
    RTS_UI32 bus_cycles[IO_SPEC_CONNECTORS];
    const IoConfigConnector *connector; /* that a test notes, and what it has become in an online change */
    const IoConfigConnector *followed;
} plant;

static const ICmpIoDrv test_functions;
static IO_DRIVER test_driver = {.functions = &test_functions};

static void called(char letter)
{
    RTS_SIZE length = strlen(plant.calls);

    if (length + 1 < sizeof plant.calls) {
        plant.calls[length] = letter;
        plant.calls[length + 1] = '\0';
    }
}

static void be_interrupted(void)
{
    void (*within)(void) = plant.within;

    plant.within = NULL;
    if (within != NULL)
        within();
}

static const IoDrvInfo *test_info(void)
{
    static const IoDrvInfo info = {"IoDrvTest", "Test", "Tests", 1};

    return &info;
}

static RTS_RESULT test_configure(const IoConfigConnector *connectors, int count)
{
    called(count > 0 ? 'C' : 'c');
    for (; count > 0; count--, connectors++) {
        RTS_RESULT result = ERR_OK;
        if (!IoMgrConfigIsMine(connectors, &test_driver))
            continue;
        if (plant.refuses != NULL && strcmp(IoMgrConfigGetName(connectors), plant.refuses) == 0)
            result = IoMgrConfigRefuse(connectors, ERR_NO_OBJECT, "there is no line %s.", "DI9");
        else
            IoMgrConfigNoteData(connectors);
        if (result != ERR_OK)
            return result;
    }
    return ERR_OK;
}

static RTS_RESULT check_channel(const IoConfigConnector *connector, const IoConfigChannelMap *channel, RTS_UI32 type)
{
    RTS_UNUSED(type);
    if (channel->bits > 8 * DRIVER_MEMORY || channel->parameter_bit > 8u * DRIVER_MEMORY - channel->bits)
        return IoMgrConfigRefuse(connector, ERR_OUT_OF_LIMITS, "it has no bit %u.", (unsigned)channel->parameter_bit);
    return ERR_OK;
}

static RTS_RESULT test_map(const IoConfigTaskMap *task_maps, int count)
{
    called('M');
    return plant.is_careless ? (RTS_RESULT)ERR_OK
                             : IoMgrConfigEachChannel(task_maps, count, &test_driver, check_channel);
}

static RTS_RESULT test_read(const IoConfigConnectorMap *maps, int count)
{
    called('r');
    for (; count > 0; count--, maps++) {
        const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(maps);
        RTS_UI32 i;
        CHECK(IoMgrConfigIsMine(IoMgrConfigGetConnector(maps->connector), &test_driver));
        for (i = 0; i < maps->channel_map_count; i++) {
            IoMgrCopyInputLE(&channel[i], plant.in);
            be_interrupted();
        }
    }
    return ERR_OK;
}

static RTS_RESULT test_write(const IoConfigConnectorMap *maps, int count)
{
    called('w');
    for (; count > 0; count--, maps++) {
        const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(maps);
        RTS_UI32 i;
        for (i = 0; i < maps->channel_map_count; i++) {
            be_interrupted();
            IoMgrCopyOutputLE(&channel[i], plant.out);
        }
    }
    return ERR_OK;
}

static RTS_RESULT test_bus_cycle(const IoConfigConnector *connector)
{
    called('b');
    plant.bus_cycles[IoMgrConfigGetIndex(connector)]++;
    return ERR_OK;
}

#if ONLINE_CHANGE
static void test_follow(const IoConfigTaskMap *task_maps, int count)
{
    RTS_UNUSED(task_maps);
    RTS_UNUSED(count);
    called('f');
    plant.followed = IoMgrConfigFollow(plant.connector);
}
#endif

static const ICmpIoDrv test_functions = {
    .IoDrvGetInfo = test_info,
    .IoDrvUpdateConfiguration = test_configure,
    .IoDrvUpdateMapping = test_map,
    .IoDrvReadInputs = test_read,
    .IoDrvWriteOutputs = test_write,
    .IoDrvStartBusCycle = test_bus_cycle,
#if ONLINE_CHANGE
    .IoDrvFollowConfiguration = test_follow,
#endif
};

/* ---- the application ---- */

static APP_SPEC spec;
static APP_BYTES image;
static IO_SPEC io;

/* A device with the driver, and an application without tasks and channels yet; its connector 0 is "Plant". */
static inline void begin_io(void)
{
    start_blank();
    memset(&plant, 0, sizeof plant);
    CHECK_EQUAL(IoMgrRegisterInstance(&test_driver), ERR_OK);
    spec_init(&spec);
    spec.areas[APP_AREA_INPUT] = 32;
    spec.areas[APP_AREA_OUTPUT] = 32;
    io_init(&io);
    io_add_connector(&io, "Plant", "IoDrvTest");
}

/* A task that copies the first DINT of the inputs to the outputs, at `at` of both. */
static inline CDL_TASK *add_copying_task(const char *name, RTS_UI32 interval_us, RTS_UI32 at)
{
    CDL_TASK *task = add_task(&spec, name, KIND_CYCLIC, interval_us, here(&spec));

    emit_copy(&spec, APP_AREA_OUTPUT, at, APP_AREA_INPUT, at);
    emit_ret(&spec);
    return task;
}

/* Bytes of the plant of a task, at the same place of memory and area. */
static inline IoConfigChannelMap *add_bytes(RTS_UI16 task, RTS_UI16 type, RTS_UI32 byte, RTS_UI32 count)
{
    return io_add_channel(&io, task, type, 0, type == IO_MAP_INPUTS ? DRIVER_INPUTS : DRIVER_OUTPUTS, 8 * byte,
                          8 * byte, (RTS_UI16)(8 * count));
}

static inline RTS_RESULT load_io(void)
{
    emit_io(&spec, &io);
    build_image(&image, &spec);
    return download(&image);
}

static inline void start_io(void)
{
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    memset(plant.calls, 0, sizeof plant.calls);
}

static inline RTS_UI32 output_at(RTS_UI32 byte)
{
    return plant.out[byte];
}

#endif
