/*
 * fuzz_io.c - any I/O configuration in an image that is right otherwise: it is refused, or runs and stops.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: a configuration. The drivers are IoDrvSim and one that trusts the loader.
 */
#include "fuzz.h"
#include "io_driver.h"

enum { MAX_CONFIG = 2048 };

static void add_seed(unsigned index)
{
    spec_init(&spec);
    spec.areas[APP_AREA_INPUT] = 32;
    spec.areas[APP_AREA_OUTPUT] = 32;
    io_init(&io);
    io_add_connector(&io, "Bus", index == 0 ? "IoDrvTest" : "IoDrvSim");
    io_add_parameter(&io, 3, 8, 0x12);
    io_add_text_parameter(&io, 9, "/dev/ttyS1");
    io_add_connector(&io, "Device", "IoDrvSim")->parent = 0;
    io.connectors[1].state = 16;
    add_copying_task("Main", 10000, 0);
    add_copying_task("Other", 20000, 4);
    add_bytes(0, IO_MAP_INPUTS, 0, 4);
    add_bytes(0, IO_MAP_OUTPUTS, 0, 4)->flags = IO_VALUE;
    io_add_channel(&io, 1, IO_MAP_INPUTS, 1, 5, 3, 6, 1)->flags = IO_HOLD;
    io_add_channel(&io, 1, IO_MAP_OUTPUTS, 1, 6, 8, 64, 16)->flags |= IO_CHANNEL_BIG_ENDIAN;
    emit_io(&spec, &io);
}

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    if (index > 1)
        return 0;
    add_seed(index);
    if (spec.io.size > capacity)
        return 0;
    memcpy(data, spec.code + spec.io.offset, spec.io.size);
    return spec.io.size;
}

static void begin(void)
{
    static bool is_prepared;

    if (is_prepared)
        return;
    is_prepared = true;
    FUZZ_CHECK(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF) == ERR_OK);
    FUZZ_CHECK(SimStart() == ERR_OK);
    FUZZ_CHECK(IoMgrRegisterInstance(&test_driver) == ERR_OK);
}

/* Requests from outside for whatever the configuration has, and more. */
static void ask(void)
{
    IoDrvModule module;
    RTS_UI8 data[16];
    RTS_UI32 i;

    for (i = 0; i < 4; i++) {
        (void)IoMgrReadParameter(i, 3, data, 8, i);
        (void)IoMgrReadParameter(i, 9, data, 88, 0);
        (void)IoMgrReadParameter(i, 5, data, 3, i);
        (void)IoMgrWriteParameter(i, 6, data, 8, i);
        (void)IoMgrScanModules(i, i, &module);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size == 0 || size > MAX_CONFIG)
        return 0;
    begin();
    add_seed(0);
    spec.code_size = spec.io.offset;
    emit(&spec, (const char *)data, (RTS_UI32)size);
    spec.io.size = (RTS_UI32)size;
    plant.calls[0] = '\0';
    build_image(&image, &spec);
    if (download(&image) != ERR_OK)
        return 0;
    FUZZ_CHECK(AppStartApplication() == ERR_OK);
    FUZZ_CHECK(SimAdvance(ms(20)) == ERR_OK);
    ask();
    FUZZ_CHECK(AppStopApplication() == ERR_OK);
    FUZZ_CHECK(SimAdvance(ms(20)) == ERR_OK);
    FUZZ_CHECK(app_exception() == RTSEXCPT_NOEXCEPTION);
    return 0;
}
