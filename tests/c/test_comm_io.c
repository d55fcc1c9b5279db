/*
 * test_comm_io.c - the services of inputs and outputs over the wire: list, parameters, identify, scan.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpBytes.h"
#include "CmpPackets.h"
#include "IoDrvSim.h"
#include "SimLink.h"
#include "comm_client.h"
#include "io_driver.h"

enum { INPUTS = 7 };

static CLIENT client;
static REPLY reply;
static RTS_UI8 content[512];
static BTAG_WRITER writer;

/* A bus with two simulated devices, the second one with an input of 16 bits. */
static void begin_bus(void)
{
    start_blank();
    spec_init(&spec);
    spec.areas[APP_AREA_INPUT] = 32;
    io_init(&io);
    io_add_connector(&io, "Line", "IoDrvSim");
    io_add_connector(&io, "Pump", "IoDrvSim")->parent = 0;
    io_add_connector(&io, "Meter", "IoDrvModbus")->parent = 0;
    io_add_parameter(&io, 3, 8, 0x5A);
    add_copying_task("Main", 10000, 0);
    io_add_channel(&io, 0, IO_MAP_INPUTS, 2, INPUTS, 0, 0, 16);
    start_io();
    CHECK_EQUAL(SimAdvance(ms(30)), ERR_OK);
    SimLinkReset();
    client_init(&client, 0x0102);
    CHECK(client_open(&client) && client_login(&client));
}

static void begin_request(void)
{
    BTagWriterInit(&writer, content, sizeof content);
}

static bool call(RTS_UI16 service)
{
    return client_call(&client, SG_IOMGR, service, &writer, &reply);
}

static bool find(RTS_UI32 id, BTAG *tag)
{
    return BTagFind(&reply.tags, id, 0, 0xFFFF, tag) == ERR_OK;
}

/* Entry `index` of a list, in order. */
static bool find_entry(RTS_UI32 index, BTAG_READER *entry)
{
    BTAG_READER tags = reply.tags;
    BTAG tag;

    while (BTagReadNext(&tags, &tag) == ERR_OK) {
        if (tag.id == TAG_IO_ENTRY && index-- == 0)
            return BTagReadContainer(&tags, &tag, entry) == ERR_OK;
    }
    return false;
}

static void connectors_are_listed(void)
{
    BTAG_READER entry;
    BTAG tag;

    begin_bus();
    begin_request();
    CHECK(call(SRV_IO_LIST));
    CHECK(find_entry(2, &entry) && !find_entry(3, &entry));
    CHECK(find_entry(2, &entry));
    CHECK(BTagFind(&entry, TAG_IO_NAME, 1, 64, &tag) == ERR_OK && memcmp(tag.data, "Meter", 6) == 0);
    CHECK(BTagFind(&entry, TAG_IO_DRIVER, 1, 64, &tag) == ERR_OK && memcmp(tag.data, "IoDrvModbus", 12) == 0);
    CHECK(BTagFind(&entry, TAG_IO_STATE, sizeof(IO_STATE), sizeof(IO_STATE), &tag) == ERR_OK);
    CHECK_EQUAL(BytesGet16(((const IO_STATE *)tag.data)->index), 2);
    CHECK_EQUAL(BytesGet16(((const IO_STATE *)tag.data)->parent), 0);
    CHECK((BytesGet16(((const IO_STATE *)tag.data)->flags) & CF_CONNECTOR_ACTIVE) != 0);
    CHECK(BytesGet32(((const IO_STATE *)tag.data)->age_ms) <= 10);
}

static void a_list_goes_on_from_where_it_ended(void)
{
    BTAG_READER entry;

    begin_bus();
    begin_request();
    BTagWrite32(&writer, TAG_IO_START, 2);
    CHECK(call(SRV_IO_LIST));
    CHECK(find_entry(0, &entry) && !find_entry(1, &entry));
    begin_request();
    BTagWrite32(&writer, TAG_IO_START, 3);
    CHECK(call(SRV_IO_LIST));
    CHECK(!find_entry(0, &entry));
}

static void put_parameter(RTS_UI32 connector, RTS_UI32 id, RTS_UI32 bits, RTS_UI32 bit_offset)
{
    IO_PARAMETER parameter = {0};

    BytesPut16(parameter.connector, connector);
    BytesPut32(parameter.id, id);
    BytesPut32(parameter.bits, bits);
    BytesPut32(parameter.bit_offset, bit_offset);
    begin_request();
    BTagWrite(&writer, TAG_IO_PARAMETER, BTAG_ALIGN_0, &parameter, sizeof parameter);
}

static void parameters_are_written_and_read(void)
{
    BTAG tag;

    begin_bus();
    put_parameter(2, INPUTS, 8, 4);
    BTagWrite(&writer, TAG_IO_DATA, BTAG_ALIGN_0, "\xAB", 1);
    CHECK(call(SRV_IO_WRITE_PARAMETER));
    CHECK_EQUAL(reply_number(&reply, TAG_IO_RESULT), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_INPUT, 0), 0x0AB0);
    put_parameter(2, INPUTS, 16, 0);
    CHECK(call(SRV_IO_READ_PARAMETER));
    CHECK(find(TAG_IO_DATA, &tag) && tag.size == 2 && memcmp(tag.data, "\xB0\x0A", 2) == 0);
    put_parameter(2, 3, 8, 0); /* of the configuration only */
    CHECK(call(SRV_IO_READ_PARAMETER));
    CHECK(find(TAG_IO_DATA, &tag) && tag.size == 1 && tag.data[0] == 0x5A);
}

static void parameters_that_are_not_there(void)
{
    BTAG tag;

    begin_bus();
    put_parameter(2, INPUTS + 1, 8, 0);
    CHECK(call(SRV_IO_READ_PARAMETER));
    CHECK_EQUAL(reply_number(&reply, TAG_IO_RESULT), ERR_NO_OBJECT);
    CHECK(!find(TAG_IO_DATA, &tag));
    put_parameter(9, INPUTS, 8, 0);
    CHECK(call(SRV_IO_READ_PARAMETER));
    CHECK_EQUAL(reply_number(&reply, TAG_IO_RESULT), ERR_INVALIDID);
    put_parameter(2, INPUTS, 17, 0);
    CHECK(call(SRV_IO_READ_PARAMETER));
    CHECK_EQUAL(reply_number(&reply, TAG_IO_RESULT), ERR_OUT_OF_LIMITS);
    put_parameter(2, INPUTS, 0xFFFFFFFF, 0); /* more than a message holds */
    CHECK(call(SRV_IO_READ_PARAMETER));
    CHECK_EQUAL(reply_error(&reply), ERR_BUFFERSIZE);
    put_parameter(2, INPUTS, 16, 0);
    BTagWrite(&writer, TAG_IO_DATA, BTAG_ALIGN_0, "\xAB", 1); /* less than the bits take */
    CHECK(call(SRV_IO_WRITE_PARAMETER));
    CHECK_EQUAL(reply_error(&reply), ERR_SIZE_MISMATCH);
}

static void a_device_shows_itself(void)
{
    begin_bus();
    begin_request();
    BTagWrite32(&writer, TAG_IO_CONNECTOR, 1);
    CHECK(call(SRV_IO_IDENTIFY));
    CHECK_EQUAL(reply_number(&reply, TAG_IO_RESULT), ERR_OK);
    CHECK(log_has("Pump blinks"));
    CHECK_EQUAL(SimIoFault("Pump", IO_SIM_ABSENT, 1), ERR_OK);
    begin_request();
    BTagWrite32(&writer, TAG_IO_CONNECTOR, 1);
    CHECK(call(SRV_IO_IDENTIFY));
    CHECK_EQUAL(reply_number(&reply, TAG_IO_RESULT), ERR_TIMEOUT);
}

static void a_scan_finds_what_is_on_the_bus(void)
{
    BTAG tag;

    begin_bus();
    CHECK_EQUAL(SimIoFault("Pump", IO_SIM_ABSENT, 1), ERR_OK);
    begin_request();
    BTagWrite32(&writer, TAG_IO_CONNECTOR, 0);
    CHECK(call(SRV_IO_SCAN));
    CHECK(find(TAG_IO_MODULE, &tag));
    CHECK(memcmp(tag.data + sizeof(IO_MODULE), "Meter", 6) == 0);
    CHECK_EQUAL(reply_number(&reply, TAG_IO_RESULT), ERR_NO_OBJECT);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(connectors_are_listed);
    RUN(a_list_goes_on_from_where_it_ended);
    RUN(parameters_are_written_and_read);
    RUN(parameters_that_are_not_there);
    RUN(a_device_shows_itself);
    RUN(a_scan_finds_what_is_on_the_bus);
    return test_result();
}
