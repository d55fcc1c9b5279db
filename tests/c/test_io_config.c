/*
 * test_io_config.c - how a driver reads its configuration, and that no damaged one reaches it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IecCycle.h"
#include "io_driver.h"

/* Two buses with a device each and parameters of all kinds. */
static void begin_tree(void)
{
    begin_io();
    io_init(&io);
    io_add_connector(&io, "BusA", "IoDrvTest");
    io_add_parameter(&io, 3, 8, 0x12);
    io_add_parameter(&io, 5, 16, 0x1234);
    io_add_parameter(&io, 7, 32, 0x12345678);
    io_add_text_parameter(&io, 9, "/dev/ttyS1");
    io_add_connector(&io, "BusB", "IoDrvTest");
    io_add_connector(&io, "DeviceA", "IoDrvTest")->parent = 0;
    io.connectors[2].type = CT_SLAVE;
    io_add_connector(&io, "DeviceB", "IoDrvTest")->parent = 1;
    io.connectors[3].type = CT_SLAVE;
    io.connectors[3].state = 32;
    add_copying_task("Main", 10000, 0);
    add_bytes(0, IO_MAP_INPUTS, 0, 4);
    add_bytes(0, IO_MAP_OUTPUTS, 0, 4);
}

static void connectors_are_found_by_type_and_parent(void)
{
    const IoConfigConnector *all;
    const IoConfigConnector *found;
    int count = 4;

    begin_tree();
    CHECK_EQUAL(load_io(), ERR_OK);
    all = IoMgrConfigGetConnector(0);
    found = IoMgrConfigGetFirstConnector(all, &count, CT_SLAVE);
    CHECK(found == all + 2 && count == 2);
    found = IoMgrConfigGetNextConnector(found, &count, CT_SLAVE);
    CHECK(found == all + 3 && count == 1);
    CHECK(IoMgrConfigGetNextConnector(found, &count, CT_SLAVE) == NULL);
    count = 4;
    found = IoMgrConfigGetFirstChild(all, &count, all + 1);
    CHECK(found == all + 3);
    CHECK(IoMgrConfigGetNextChild(found, &count, all + 1) == NULL);
    CHECK(strcmp(IoMgrConfigGetName(found), "DeviceB") == 0);
    CHECK_EQUAL(IoMgrConfigGetIndex(found), 3);
    CHECK(IoMgrConfigGetConnector(4) == NULL);
}

static void parameters_are_found_by_id(void)
{
    const IoConfigConnector *bus;
    RTS_RESULT result;

    begin_tree();
    CHECK_EQUAL(load_io(), ERR_OK);
    bus = IoMgrConfigGetConnector(0);
    CHECK_EQUAL(IoMgrConfigGetParameterValueByte(IoMgrConfigGetParameter(bus, 3), &result), 0x12);
    CHECK_EQUAL(result, ERR_OK);
    CHECK_EQUAL(IoMgrConfigGetParameterValueWord(IoMgrConfigGetParameter(bus, 5), &result), 0x1234);
    CHECK_EQUAL(IoMgrConfigGetParameterValueByte(IoMgrConfigGetParameter(bus, 5), &result), 0);
    CHECK_EQUAL(result, ERR_PARAMETER);
    CHECK_EQUAL(IoMgrConfigGetParameterValueDword(IoMgrConfigGetParameter(bus, 7), NULL), 0x12345678);
    CHECK(strcmp(IoMgrConfigGetParameterValueText(IoMgrConfigGetParameter(bus, 9)), "/dev/ttyS1") == 0);
    CHECK(IoMgrConfigGetParameterValuePointer(IoMgrConfigGetParameter(bus, 7), &result) == NULL);
    CHECK_EQUAL(result, ERR_PARAMETER);
    CHECK(IoMgrConfigGetParameter(bus, 4) == NULL);
    CHECK(IoMgrConfigGetParameter(bus, 10) == NULL);
    CHECK(IoMgrConfigGetParameter(bus + 1, 3) == NULL);
}

static void what_the_configuration_says_can_be_read_from_outside(void)
{
    RTS_UI32 value = 0;
    char text[11];

    begin_tree();
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(IoMgrReadParameter(0, 7, &value, 8, 8), ERR_OK);
    CHECK_EQUAL(value, 0x56);
    CHECK_EQUAL(IoMgrReadParameter(0, 9, text, 88, 0), ERR_OK);
    CHECK(strcmp(text, "/dev/ttyS1") == 0);
    CHECK_EQUAL(IoMgrReadParameter(0, 9, text, 88, 8), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(IoMgrReadParameter(0, 7, &value, 8, 24), ERR_OK);
    CHECK_EQUAL(IoMgrReadParameter(0, 7, &value, 8, 25), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(IoMgrReadParameter(0, 3, &value, 9, 0), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(IoMgrReadParameter(0, 3, &value, 16, 0xFFFFFFF8), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(IoMgrReadParameter(0, 4, &value, 8, 0), ERR_NO_OBJECT);
    CHECK_EQUAL(IoMgrReadParameter(4, 7, &value, 8, 0), ERR_INVALIDID);
    CHECK_EQUAL(IoMgrWriteParameter(0, 7, &value, 8, 0), ERR_NOT_SUPPORTED);
    CHECK_EQUAL(IoMgrIdentify(4), ERR_INVALIDID);
}

static void the_connector_after_the_last_one_has_no_state(void)
{
    IO_DEVICE_STATE state;

    begin_tree();
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(IoMgrGetState(3, &state), ERR_OK);
    CHECK_EQUAL(IoMgrGetState(4, &state), ERR_INVALIDID);
    CHECK_EQUAL(IoMgrGetState(0xFFFFFFFF, &state), ERR_INVALIDID);
    CHECK_EQUAL(IoMgrGetSkipped(3), 0);
    CHECK_EQUAL(IoMgrGetSkipped(4), 0);
    CHECK_EQUAL(IoMgrGetSkipped(0xFFFFFFFF), 0);
    CHECK(IoMgrConfigGetConnector(0xFFFFFFFF) == NULL);
}

static const IoConfigChannelMap word = {.bits = 16};
static const IoConfigChannelMap turned_word = {.bits = 16, .flags = IO_CHANNEL_BIG_ENDIAN};
static const IoConfigChannelMap bit = {.parameter_bit = 5, .area_bit = 1, .bits = 1};

static RTS_UI32 input_of(void (*copy)(const IoConfigChannelMap *channel, const void *memory),
                         const IoConfigChannelMap *channel, const RTS_UI8 *memory)
{
    copy(channel, memory);
    return read_u32(APP_AREA_INPUT, 0);
}

static void the_order_of_bytes_is_that_of_the_device(void)
{
    static const RTS_UI8 memory[] = {0x22, 0x11};
    static const RTS_UI8 other[] = {0x11, 0x22};

    begin_tree();
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(input_of(IoMgrCopyInputLE, &word, memory), 0x1122);
    CHECK_EQUAL(input_of(IoMgrCopyInputBE, &word, memory), 0x2211);
    CHECK_EQUAL(input_of(IoMgrCopyInputLE, &turned_word, memory), 0x2211);
    CHECK_EQUAL(input_of(IoMgrCopyInputBE, &turned_word, memory), 0x1122);
    CHECK_EQUAL(input_of(IoMgrCopyInputBE, &bit, other), 0x1120); /* in what was there */
    CHECK_EQUAL(input_of(IoMgrCopyInputBE, &bit, memory), 0x1122);
}

static void outputs_come_in_the_order_of_the_device(void)
{
    RTS_UI8 *outputs;
    RTS_UI8 memory[2] = {0, 0};

    begin_tree();
    CHECK_EQUAL(load_io(), ERR_OK);
    outputs = AppGetAreaAddress(APP_AREA_OUTPUT, 0, 2);
    outputs[0] = 0x22;
    outputs[1] = 0x11;
    IecCycleStart();
    IoMgrCopyOutputLE(&word, memory);
    CHECK(memory[0] == 0x22 && memory[1] == 0x11);
    IoMgrCopyOutputBE(&word, memory);
    CHECK(memory[0] == 0x11 && memory[1] == 0x22);
    IoMgrCopyOutputBE(&turned_word, memory);
    CHECK(memory[0] == 0x22 && memory[1] == 0x11);
    outputs[0] = 0;
    IoMgrCopyOutputBE(&bit, memory);
    CHECK(memory[0] == 0x02 && memory[1] == 0x11);
    IecCycleStop();
}

static void in_the_safe_state_outputs_are_what_the_configuration_says(void)
{
    IoConfigChannelMap safe = word;
    RTS_UI8 memory[2] = {0x77, 0x77};

    begin_tree();
    CHECK_EQUAL(load_io(), ERR_OK);
    memset(AppGetAreaAddress(APP_AREA_OUTPUT, 0, 2), 0x22, 2);
    safe.flags = IO_HOLD;
    IoMgrCopyOutputs(&safe, 1, memory);
    CHECK(memory[0] == 0x77 && memory[1] == 0x77);
    safe.flags = IO_VALUE;
    safe.value = 0xABCD;
    IoMgrCopyOutputLE(&safe, memory);
    CHECK(memory[0] == 0xCD && memory[1] == 0xAB);
    IoMgrCopyOutputBE(&safe, memory);
    CHECK(memory[0] == 0xAB && memory[1] == 0xCD);
    safe.flags |= IO_CHANNEL_BIG_ENDIAN;
    IoMgrCopyOutputs(&safe, 1, memory);
    CHECK(memory[0] == 0xAB && memory[1] == 0xCD);
    safe.flags = IO_ZERO;
    IoMgrCopyOutputLE(&safe, memory);
    CHECK(memory[0] == 0 && memory[1] == 0);
}

/* Each byte takes some values; what is accepted runs, and writes nothing but its areas. */
static void each_byte_may_be_damaged(void)
{
    static const RTS_UI8 flips[] = {0x01, 0x04, 0x80, 0xFF};
    RTS_UI32 refused = 0;
    RTS_UI32 accepted = 0;
    RTS_UI32 at;
    RTS_UI32 i;

    begin_tree();
    CHECK_EQUAL(load_io(), ERR_OK);
    for (at = 0; at < spec.io.size; at++) {
        for (i = 0; i < RTS_COUNT(flips); i++) {
            RTS_UI32 place = image_header(&image).code.offset + spec.io.offset + at;
            RTS_RESULT result;
            image.bytes[place] ^= flips[i];
            image_fix_crc(&image);
            result = download(&image);
            if (result == ERR_OK) {
                accepted++;
                CHECK_EQUAL(AppStartApplication(), ERR_OK);
                CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
                CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
            } else {
                refused++;
            }
            image.bytes[place] ^= flips[i];
        }
    }
    CHECK(refused > accepted / 2 && accepted > 0);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(connectors_are_found_by_type_and_parent);
    RUN(parameters_are_found_by_id);
    RUN(what_the_configuration_says_can_be_read_from_outside);
    RUN(the_connector_after_the_last_one_has_no_state);
    RUN(the_order_of_bytes_is_that_of_the_device);
    RUN(outputs_come_in_the_order_of_the_device);
    RUN(in_the_safe_state_outputs_are_what_the_configuration_says);
    RUN(each_byte_may_be_damaged);
    return test_result();
}
