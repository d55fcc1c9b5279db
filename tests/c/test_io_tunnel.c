/*
 * test_io_tunnel.c - who has the line of tools within Modbus: the firmware, or a server of the application.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The serial line is here. It has two names, and can be open once.
 */
#include "IoDrvModbus.h"
#include "ModbusRtu.h"
#include "ModbusToolLine.h"
#include "ModbusTunnel.h"
#include "io_driver.h"

enum { LINE = 5, OTHER_LINE = 6, PASS_MS = 5, OWN_UNIT = 247, UNIT = 3, OWN_BAUD = 38400 };

static struct {
    bool open;
    bool other_open;
    RTS_UI32 baud;
    RTS_UI32 opened;
    RTS_UI8 in[64]; /* to the device */
    RTS_UI32 in_size;
    RTS_UI8 out[300]; /* the last frame from it */
    RTS_UI32 out_size;
} line;

RTS_RESULT __wrap_SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index);
RTS_RESULT __wrap_SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index)
{
    bool is_other = strcmp(name, "COM3") == 0;
    bool *open = is_other ? &line.other_open : &line.open;

    if (strcmp(name, "COM2") != 0 && strcmp(name, "bus") != 0 && !is_other)
        return ERR_NO_OBJECT;
    if (*open)
        return ERR_DUPLICATE;
    if (settings->baud > 1000000)
        return ERR_NOT_SUPPORTED;
    *open = true;
    if (!is_other) {
        line.baud = settings->baud;
        line.opened++;
    }
    *index = is_other ? OTHER_LINE : LINE;
    return ERR_OK;
}

void __wrap_SysComClose(RTS_UI32 index);
void __wrap_SysComClose(RTS_UI32 index)
{
    if (index == LINE) {
        CHECK(line.open);
        line.open = false;
        line.in_size = 0;
    }
    if (index == OTHER_LINE)
        line.other_open = false;
}

RTS_UI32 __wrap_SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size);
RTS_UI32 __wrap_SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 count = line.in_size < size ? line.in_size : size;

    if (index != LINE || !line.open)
        return 0;
    memcpy(data, line.in, count);
    line.in_size -= count;
    memmove(line.in, line.in + count, line.in_size);
    return count;
}

RTS_UI32 __wrap_SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size);
RTS_UI32 __wrap_SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    if (index == LINE) {
        memcpy(line.out, data, size);
        line.out_size = size;
    }
    return size;
}

/* ---- tools ---- */

static void run_passes(RTS_UI32 passes)
{
    for (RTS_UI32 i = 0; i < passes; i++) {
        CHECK_EQUAL(SimAdvance(ms(PASS_MS)), ERR_OK);
        CHECK_EQUAL(IoDrvModbus_Hook(CH_COMM_CYCLE), ERR_OK);
    }
}

static bool asks(RTS_UI8 unit, RTS_UI8 mei, RTS_UI8 number)
{
    RTS_UI8 request[] = {unit, MODBUS_ENCAPSULATED, mei, number, 0, 0};
    RTS_UI16 crc = ModbusCrc(request, 4);

    request[4] = (RTS_UI8)crc;
    request[5] = (RTS_UI8)(crc >> 8);
    memcpy(line.in, request, sizeof(request));
    line.in_size = sizeof(request);
    line.out_size = 0;
    run_passes(4);
    line.in_size = 0;
    return line.out_size > 4 && memcmp(line.out, request, 4) == 0;
}

/* Whether tools get a reply at a unit. */
static bool has_tools(RTS_UI8 unit)
{
    return asks(unit, MODBUS_TUNNEL_MEI, MODBUS_TUNNEL_BEGIN);
}

/* ---- configurations ---- */

static void begin(void)
{
    static const MODBUS_TOOL_LINE own = {"bus", {OWN_BAUD, SYSCOM_PARITY_EVEN, 1, false}, OWN_UNIT};

    (void)IoDrvModbus_Hook(CH_EXIT3);
    begin_io();
    memset(&line, 0, sizeof(line));
    ModbusToolLineSet(&own);
    CHECK_EQUAL(IoDrvModbus_Hook(CH_INIT2), ERR_OK);
    CHECK_EQUAL(IoDrvModbus_Hook(CH_INIT3), ERR_OK);
    CHECK_EQUAL(line.baud, OWN_BAUD);
    io_init(&io);
    add_copying_task("Main", 10000, 0);
}

static void add_line(RTS_UI32 role, const char *name, RTS_UI32 baud)
{
    (void)io_add_connector(&io, "Line", "IoDrvModbus");
    io_add_parameter(&io, MODBUS_PARAM_ROLE, 32, role);
    io_add_text_parameter(&io, MODBUS_PARAM_LINE, name);
    io_add_parameter(&io, MODBUS_PARAM_BAUD, 32, baud);
    io_add_parameter(&io, MODBUS_PARAM_UNIT, 32, UNIT);
}

static void the_firmware_has_the_line_without_an_application(void)
{
    begin();
    CHECK(has_tools(OWN_UNIT));
    CHECK(!has_tools(UNIT));
    CHECK(!has_tools(MODBUS_BROADCAST));
    CHECK(asks(OWN_UNIT, MODBUS_DEVICE_IDENTIFICATION, 1) == false); /* of another length: an exception */
    CHECK_EQUAL(line.out_size, 5);
}

static void a_server_takes_the_line_by_any_name(void)
{
    static const char *const names[] = {"bus", "COM2"};

    for (RTS_UI32 i = 0; i < RTS_COUNT(names); i++) {
        begin();
        add_line(MODBUS_ROLE_SERIAL_SERVER, names[i], 9600);
        CHECK_EQUAL(load_io(), ERR_OK);
        CHECK_EQUAL(line.baud, 9600);
        CHECK(has_tools(UNIT));
        CHECK(!has_tools(OWN_UNIT));
    }
}

static void the_firmware_has_it_again_without_that_server(void)
{
    begin();
    add_line(MODBUS_ROLE_SERIAL_SERVER, "COM2", 9600);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK_EQUAL(line.baud, OWN_BAUD);
    CHECK(has_tools(OWN_UNIT));
    CHECK(!has_tools(UNIT));
}

static void a_server_on_another_line_has_no_tools(void)
{
    begin();
    add_line(MODBUS_ROLE_SERIAL_SERVER, "COM3", 9600);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK(line.other_open);
    CHECK(has_tools(OWN_UNIT));
}

static void a_client_cannot_have_the_line(void)
{
    begin();
    add_line(MODBUS_ROLE_SERIAL_CLIENT, "COM2", 9600);
    CHECK(load_io() != ERR_OK);
    CHECK(log_has("tools have the serial line \"COM2\"; only a server can be on it."));
    CHECK_EQUAL(line.baud, OWN_BAUD);
    CHECK(has_tools(OWN_UNIT));
}

static void settings_that_the_line_cannot_have_leave_it_to_the_firmware(void)
{
    begin();
    add_line(MODBUS_ROLE_SERIAL_SERVER, "COM2", 2000000);
    CHECK(load_io() != ERR_OK);
    CHECK(has_tools(OWN_UNIT));
}

static void two_servers_on_it_are_one_too_many(void)
{
    begin();
    add_line(MODBUS_ROLE_SERIAL_SERVER, "COM2", 9600);
    add_line(MODBUS_ROLE_SERIAL_SERVER, "bus", 9600);
    CHECK(load_io() != ERR_OK);
    CHECK(has_tools(OWN_UNIT));
}

static void it_ends_with_the_runtime(void)
{
    begin();
    CHECK_EQUAL(IoDrvModbus_Hook(CH_EXIT3), ERR_OK);
    CHECK(!line.open);
}

int main(void)
{
    RUN(the_firmware_has_the_line_without_an_application);
    RUN(a_server_on_another_line_has_no_tools);
    RUN(a_client_cannot_have_the_line);
    RUN(settings_that_the_line_cannot_have_leave_it_to_the_firmware);
    RUN(two_servers_on_it_are_one_too_many);
    RUN(a_server_takes_the_line_by_any_name);
    RUN(the_firmware_has_it_again_without_that_server);
    RUN(it_ends_with_the_runtime);
    return test_result();
}
