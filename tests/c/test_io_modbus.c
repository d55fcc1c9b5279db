/*
 * test_io_modbus.c - Modbus lines, devices and servers as the configuration of an application has them.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The simulator has no line of a field bus and no network: "COM2" and sockets are here.
 */
#include "IoDrvModbus.h"
#include "ModbusRtu.h"
#include "io_driver.h"
#include "no_network.h"

enum { LINE = 5, PASS_MS = 5, UNIT = 1, OTHER_UNIT = 2 };

static struct {
    RTS_UI32 opened;
    RTS_UI32 closed;
    RTS_UI8 in[64]; /* to the device */
    RTS_UI32 in_size;
    RTS_UI8 out[256]; /* the last frame from it */
    RTS_UI32 out_size;
    RTS_UI32 asked[OTHER_UNIT + 1]; /* frames by unit */
    RTS_UI8 identification_of;      /* this unit has one */
    RTS_UI8 server_id_of;           /* this one has an ID only */
    RTS_UI8 refusing;               /* this one replies with an exception */
} line;

/* ---- the line ---- */

RTS_RESULT __wrap_SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index);
RTS_RESULT __wrap_SysComOpenPort(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *index)
{
    RTS_UNUSED(settings);
    *index = LINE;
    line.opened++;
    return strcmp(name, "COM2") == 0 ? ERR_OK : ERR_NO_OBJECT;
}

void __wrap_SysComClose(RTS_UI32 index);
void __wrap_SysComClose(RTS_UI32 index)
{
    line.closed += index == LINE;
}

RTS_UI32 __wrap_SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size);
RTS_UI32 __wrap_SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 count = line.in_size < size ? line.in_size : size;

    if (index != LINE)
        return 0;
    memcpy(data, line.in, count);
    line.in_size -= count;
    memmove(line.in, line.in + count, line.in_size);
    return count;
}

static void reply(RTS_UI8 unit, const char *pdu, RTS_UI32 pdu_size)
{
    RTS_UI32 size = 1 + pdu_size;
    RTS_UI16 crc;

    line.in[0] = unit;
    memcpy(line.in + 1, pdu, pdu_size);
    crc = ModbusCrc(line.in, size);
    line.in[size] = (RTS_UI8)crc;
    line.in[size + 1] = (RTS_UI8)(crc >> 8);
    line.in_size = size + MODBUS_CRC_SIZE;
}

static void reply_who_it_is(const RTS_UI8 *request)
{
    static const char identification[] = "\x2B\x0E\x01\x81\x00\x00\x03\x00\x04"
                                         "Acme\x01\x02P7\x02\x01"
                                         "2";

    if (request[0] == line.refusing)
        reply(request[0], (const char[]){(char)(request[1] | MODBUS_EXCEPTION), MODBUS_ILLEGAL_ADDRESS}, 2);
    else if (request[0] == line.identification_of && request[1] == MODBUS_ENCAPSULATED)
        reply(request[0], identification, sizeof identification - 1);
    else if (request[0] == line.server_id_of && request[1] == MODBUS_ENCAPSULATED)
        reply(request[0], "\xAB\x01", 2);
    else if (request[0] == line.server_id_of && request[1] == MODBUS_REPORT_SERVER_ID)
        reply(request[0],
              "\x11\x06\x14\xFF"
              "Pump",
              8);
}

RTS_UI32 __wrap_SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size);
RTS_UI32 __wrap_SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    if (index != LINE)
        return size;
    memcpy(line.out, data, size);
    line.out_size = size;
    if (data[0] <= OTHER_UNIT)
        line.asked[data[0]]++;
    reply_who_it_is(data);
    return size;
}

/* ---- configurations ---- */

static void begin(void)
{
    (void)IoDrvModbus_Hook(CH_EXIT3);
    begin_io();
    memset(&line, 0, sizeof line);
    listeners = 0;
    listen_result = ERR_OK;
    CHECK_EQUAL(IoDrvModbus_Hook(CH_INIT2), ERR_OK);
    io_init(&io);
    add_copying_task("Main", 10000, 0);
}

static IoConfigConnector *add_line(RTS_UI32 role)
{
    IoConfigConnector *connector = io_add_connector(&io, "Line", "IoDrvModbus");

    io_add_parameter(&io, MODBUS_PARAM_ROLE, 32, role);
    io_add_text_parameter(&io, MODBUS_PARAM_LINE, "COM2");
    return connector;
}

static IoConfigConnector *add_device(const char *name, RTS_UI32 unit)
{
    IoConfigConnector *connector = io_add_connector(&io, name, "IoDrvModbus");

    connector->parent = 0;
    connector->type = CT_SLAVE;
    io_add_parameter(&io, MODBUS_PARAM_UNIT, 32, unit);
    return connector;
}

static void add_structure(RTS_UI32 id, const void *data, RTS_UI32 size)
{
    RTS_UI32 at = io_add_data(&io, data, size);

    io_add_parameter(&io, id, 8 * size, at)->flags = PVF_POINTER;
}

static void add_read_job(RTS_UI32 index, RTS_UI16 registers)
{
    const MODBUS_JOB job = {.function = MODBUS_READ_HOLDING_REGISTERS, .read_count = registers, .interval_ms = 20};

    add_structure(MODBUS_PARAM_JOB + index, &job, sizeof job);
}

static void add_write_job(RTS_UI8 function, RTS_UI16 count)
{
    const MODBUS_JOB job = {.function = function, .write_count = count, .interval_ms = 20};

    add_structure(MODBUS_PARAM_JOB, &job, sizeof job);
}

static void add_range(RTS_UI32 index, RTS_UI16 first, RTS_UI32 registers)
{
    const MODBUS_RANGE range = {.tables = MODBUS_HOLDING_REGISTERS,
                                .flags = MODBUS_RANGE_WRITABLE,
                                .first_register = first,
                                .reverse = 1,
                                .bits = MODBUS_REGISTER_BITS * registers};

    add_structure(MODBUS_PARAM_RANGE + index, &range, sizeof range);
}

static void run_passes(RTS_UI32 passes)
{
    for (RTS_UI32 i = 0; i < passes; i++) {
        CHECK_EQUAL(SimAdvance(ms(PASS_MS)), ERR_OK);
        CHECK_EQUAL(IoDrvModbus_Hook(CH_COMM_CYCLE), ERR_OK);
    }
}

/* Nothing replies: two tries make a device lost, each takes its time-out. */
static void run_long(void)
{
    run_passes(5000 / PASS_MS);
}

/* Writes a register of the server, which is to reply if it is there. */
static bool is_written(RTS_UI16 address)
{
    RTS_UI8 request[] = {UNIT, MODBUS_WRITE_REGISTER, (RTS_UI8)(address >> 8), (RTS_UI8)address, 0xAB, 0xCD, 0, 0};
    RTS_UI16 crc = ModbusCrc(request, sizeof request - MODBUS_CRC_SIZE);

    request[6] = (RTS_UI8)crc;
    request[7] = (RTS_UI8)(crc >> 8);
    memcpy(line.in, request, sizeof request);
    line.in_size = sizeof request;
    line.out_size = 0;
    run_passes(4);
    line.in_size = 0;
    return line.out_size == sizeof request && memcmp(line.out, request, sizeof request) == 0;
}

/* ---- outputs ---- */

enum { OUTPUT_AT = 4, HEAD = 7 /* before the data of a request to write */ };

/* A register of the job, at the same place in the outputs. */
static IoConfigChannelMap *add_output(RTS_UI16 task, RTS_UI32 number, RTS_UI32 flags)
{
    RTS_UI32 bit = MODBUS_REGISTER_BITS * number;
    IoConfigChannelMap *map =
        io_add_channel(&io, task, IO_MAP_OUTPUTS, 1, MODBUS_PARAM_JOB, bit, 8 * OUTPUT_AT + bit, MODBUS_REGISTER_BITS);

    map->flags = (RTS_UI16)flags;
    return map;
}

/* A device with some registers or coils that are written together; a task sets all the outputs. */
static void begin_outputs(RTS_UI8 function, RTS_UI16 count)
{
    begin();
    (void)add_line(MODBUS_ROLE_SERIAL_CLIENT);
    (void)add_device("Drive", UNIT);
    add_write_job(function, count);
    spec.tasks[0].entry_offset = here(&spec);
    emit_set(&spec, APP_AREA_OUTPUT, OUTPUT_AT, 0x44332211);
    emit_add(&spec, APP_AREA_DATA, 0, 1);
    emit_ret(&spec);
}

static bool has_written(const char *data)
{
    return line.asked[UNIT] != 0 && memcmp(line.out + HEAD, data, 4) == 0;
}

static void outputs_are_safe_before_the_program_runs(void)
{
    begin_outputs(MODBUS_WRITE_REGISTERS, 2);
    (void)add_output(0, 0, IO_ZERO);
    add_output(0, 1, IO_VALUE)->value = 0x5566;
    CHECK_EQUAL(load_io(), ERR_OK);
    run_long();
    CHECK(has_written("\0\0\x66\x55"));
}

/* What the device has of those that hold is not known: the request waits until the program gives it. */
static void outputs_that_hold_are_not_written_before_the_program_runs(void)
{
    for (RTS_UI32 held = 0; held <= 1; held++) {
        begin_outputs(MODBUS_WRITE_REGISTERS, 2);
        (void)add_output(0, held, IO_HOLD);
        add_output(0, 1 - held, IO_VALUE)->value = 0x5566;
        CHECK_EQUAL(load_io(), ERR_OK);
        run_long();
        CHECK_EQUAL(line.asked[UNIT], 0);
        CHECK_EQUAL(AppStartApplication(), ERR_OK);
        run_long();
        CHECK(has_written("\x11\x22\x33\x44"));
        CHECK_EQUAL(AppStopApplication(), ERR_OK);
        run_long();
        CHECK(has_written(held == 0 ? "\x11\x22\x66\x55" : "\x66\x55\x33\x44"));
    }
}

/* It was silent, and refuses now: that it does not answer is not true any more. */
static void a_device_that_refuses_is_not_one_that_is_silent(void)
{
    IO_DEVICE_STATE state;

    begin_outputs(MODBUS_WRITE_REGISTERS, 1);
    (void)add_output(0, 0, IO_ZERO);
    CHECK_EQUAL(load_io(), ERR_OK);
    run_long();
    CHECK_EQUAL(IoMgrGetState(1, &state), ERR_OK);
    CHECK_EQUAL(state.flags & (CF_CONNECTOR_BUS_ERROR | CF_CONNECTOR_ERROR), CF_CONNECTOR_BUS_ERROR);
    line.refusing = UNIT;
    run_long();
    CHECK_EQUAL(IoMgrGetState(1, &state), ERR_OK);
    CHECK_EQUAL(state.flags & (CF_CONNECTOR_BUS_ERROR | CF_CONNECTOR_ERROR), CF_CONNECTOR_ERROR);
    CHECK_EQUAL(state.ok, 0);
}

static void single_bits_hold_like_registers(void)
{
    begin_outputs(MODBUS_WRITE_COILS, 5);
    for (RTS_UI32 i = 0; i < 5; i++)
        io_add_channel(&io, 0, IO_MAP_OUTPUTS, 1, MODBUS_PARAM_JOB, i, 8 * OUTPUT_AT + i, 1)->flags =
            i == 3 ? IO_HOLD : IO_ZERO;
    CHECK_EQUAL(load_io(), ERR_OK);
    run_long();
    CHECK_EQUAL(line.asked[UNIT], 0);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    run_long();
    CHECK(line.asked[UNIT] != 0);
    CHECK_EQUAL(line.out[HEAD], 0x11);
}

/* The other one runs when bit 7 of the counter is set. */
static void outputs_of_two_tasks_are_not_written_before_both_have_run(void)
{
    CDL_TASK *task;

    begin_outputs(MODBUS_WRITE_REGISTERS, 2);
    task = add_task(&spec, "Event", KIND_EVENT, 0, here(&spec));
    task->event_area = APP_AREA_DATA;
    task->event_ignored = 0x7F;
    emit_ret(&spec);
    (void)add_output(0, 0, IO_HOLD);
    (void)add_output(1, 1, IO_HOLD);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    run_passes(1200 / PASS_MS);
    CHECK_EQUAL(line.asked[UNIT], 0);
    run_passes(200 / PASS_MS);
    CHECK(has_written("\x11\x22\x33\x44"));
}

/* ---- what is optional and refused ---- */

static void an_optional_device_is_left_out_with_all_its_jobs(void)
{
    begin();
    (void)add_line(MODBUS_ROLE_SERIAL_CLIENT);
    add_device("Meter", UNIT)->flags |= CF_OPTIONAL;
    add_read_job(0, 2);
    add_read_job(1, MODBUS_MAX_READ_REGISTERS + 1);
    add_read_job(2, 2);
    (void)add_device("Drive", OTHER_UNIT);
    add_read_job(0, 2);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK(log_has("Not used: Meter (IoDrvModbus): one of its jobs cannot be a request."));
    run_long();
    CHECK_EQUAL(line.asked[UNIT], 0);
    CHECK(line.asked[OTHER_UNIT] >= 2);
}

static void an_optional_device_that_is_left_out_takes_no_room(void)
{
    begin();
    (void)add_line(MODBUS_ROLE_SERIAL_CLIENT);
    add_device("Meter", UNIT)->flags |= CF_OPTIONAL;
    add_read_job(0, 125);
    add_read_job(1, 125);
    add_read_job(2, 125); /* the first two fit */
    (void)add_device("Drive", OTHER_UNIT);
    add_read_job(0, 125);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK(log_has("Not used: Meter (IoDrvModbus): this device has room for 512 bytes of Modbus data."));
    run_long();
    CHECK_EQUAL(line.asked[UNIT], 0);
    CHECK(line.asked[OTHER_UNIT] >= 2);
}

static void an_optional_device_with_a_channel_that_cannot_be_is_not_asked(void)
{
    begin();
    (void)add_line(MODBUS_ROLE_SERIAL_CLIENT);
    add_device("Meter", UNIT)->flags |= CF_OPTIONAL;
    add_read_job(0, 2);
    io_add_channel(&io, 0, IO_MAP_INPUTS, 1, MODBUS_PARAM_JOB, 32, 0, 16);
    (void)add_device("Drive", OTHER_UNIT);
    add_read_job(0, 2);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK(log_has("Not used: Meter (IoDrvModbus): a channel is not in its data."));
    run_long();
    CHECK_EQUAL(line.asked[UNIT], 0);
    CHECK(line.asked[OTHER_UNIT] >= 2);
}

static void a_server_is_written(void)
{
    begin();
    (void)add_line(MODBUS_ROLE_SERIAL_SERVER);
    add_range(0, 0, 10);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK(is_written(9));
    CHECK(!is_written(10));
    CHECK_EQUAL(line.out_size, 5); /* an exception */
}

static void check_no_server(void)
{
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK(log_has("Not used: Line (IoDrvModbus): "));
    CHECK_EQUAL(line.closed, line.opened);
    CHECK(!is_written(0));
    CHECK_EQUAL(line.out_size, 0);
    CHECK_EQUAL(listeners, 0);
}

static void an_optional_server_whose_memory_has_no_room_is_not_there(void)
{
    begin();
    add_line(MODBUS_ROLE_SERIAL_SERVER)->flags |= CF_OPTIONAL;
    add_range(0, 0, 10000);
    check_no_server();
}

static void an_optional_server_with_more_ranges_than_there_is_room_for_is_not_there(void)
{
    begin();
    add_line(MODBUS_ROLE_SERIAL_SERVER)->flags |= CF_OPTIONAL;
    for (RTS_UI16 i = 0; i < MODBUS_MAX_RANGES + 3; i++)
        add_range(i, i, 1);
    check_no_server();
}

static void an_optional_server_with_a_channel_that_cannot_be_is_not_there(void)
{
    begin();
    add_line(MODBUS_ROLE_SERIAL_SERVER)->flags |= CF_OPTIONAL;
    add_range(0, 0, 10);
    io_add_channel(&io, 0, IO_MAP_INPUTS, 0, MODBUS_PARAM_RANGE, 160, 0, 16);
    check_no_server();
}

static void a_tcp_server_that_is_left_out_does_not_listen(void)
{
    begin();
    add_line(MODBUS_ROLE_TCP_SERVER)->flags |= CF_OPTIONAL;
    add_range(0, 0, 10000);
    check_no_server();
    begin();
    (void)add_line(MODBUS_ROLE_TCP_SERVER);
    add_range(0, 0, 10);
    CHECK_EQUAL(load_io(), ERR_OK);
    run_passes(2);
    CHECK_EQUAL(listeners, 1);
}

static void a_tcp_server_whose_port_is_in_use_says_so_and_tries_again(void)
{
    IO_DEVICE_STATE state;

    begin();
    listen_result = ERR_DUPLICATE;
    (void)add_line(MODBUS_ROLE_TCP_SERVER);
    add_range(0, 0, 10);
    CHECK_EQUAL(load_io(), ERR_OK);
    run_passes(3);
    CHECK(log_has("Line cannot listen: its port is in use"));
    CHECK_EQUAL(IoMgrGetState(0, &state), ERR_OK);
    CHECK_EQUAL(state.flags & CF_CONNECTOR_ERROR, CF_CONNECTOR_ERROR);
    CHECK_EQUAL(state.errors, 1);
    listen_result = ERR_OK;
    run_long();
    CHECK_EQUAL(listeners, 1);
    CHECK_EQUAL(IoMgrGetState(0, &state), ERR_OK);
    CHECK_EQUAL(state.ok, 1);
}

/* A build without SYSSOCK_NAMES: the image is refused in words, not connected to address 0. */
static void a_host_that_is_looked_up_is_refused_where_there_are_no_names(void)
{
    static const RTS_UI32 roles[] = {MODBUS_ROLE_NAMED_TCP_CLIENT, MODBUS_ROLE_NAMED_RTU_TCP_CLIENT};

    for (RTS_UI32 i = 0; i < RTS_COUNT(roles); i++) {
        begin();
        (void)add_line(roles[i]);
        io_add_text_parameter(&io, MODBUS_PARAM_HOST, "meter.plant");
        CHECK_EQUAL(load_io(), ERR_NOT_SUPPORTED);
        CHECK(log_has("this device finds no names: write an IPv4 address as host."));
    }
}

/* Its place in the tables is not what the server had that was left out. */
static void a_server_comes_after_one_that_is_left_out(void)
{
    begin();
    add_line(MODBUS_ROLE_TCP_SERVER)->flags |= CF_OPTIONAL;
    add_range(0, 0, 10);
    add_range(1, 10, 10000);
    (void)add_line(MODBUS_ROLE_SERIAL_SERVER);
    add_range(0, 5, 1);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK(is_written(5));
    CHECK(!is_written(0));
    CHECK_EQUAL(listeners, 0);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK_EQUAL(line.closed, line.opened);
}

/* ---- scan ---- */

enum { WELL_KNOWN_UNIT = 9, ID_UNIT = 20, LONG_MS = 100000 };

static RTS_RESULT scan_on(RTS_UI32 index, IoDrvModule *module)
{
    RTS_RESULT result = IoMgrScanModules(0, index, module);

    for (RTS_UI32 i = 0; result == ERR_PENDING && i < LONG_MS / 100; i++) {
        run_passes(100 / PASS_MS);
        result = IoMgrScanModules(0, index, module);
    }
    return result;
}

static void begin_scan(void)
{
    begin();
    (void)add_line(MODBUS_ROLE_SERIAL_CLIENT);
    (void)add_device("Meter", UNIT);
    add_read_job(0, 2);
    line.identification_of = WELL_KNOWN_UNIT;
    line.server_id_of = ID_UNIT;
}

static void a_scan_finds_who_replies(void)
{
    IoDrvModule module;

    begin_scan();
    CHECK_EQUAL(load_io(), ERR_OK);
    for (RTS_UI32 i = 0; i < 2; i++) {
        CHECK_EQUAL(scan_on(0, &module), ERR_OK);
        CHECK_EQUAL(module.slot, WELL_KNOWN_UNIT);
        CHECK(strcmp(module.name, "Acme P7 2") == 0);
        CHECK_EQUAL(scan_on(1, &module), ERR_OK);
        CHECK_EQUAL(module.slot, ID_UNIT);
        CHECK(strcmp(module.name, "Pump") == 0);
        CHECK_EQUAL(scan_on(2, &module), ERR_NO_OBJECT);
    }
}

static void a_scan_that_nobody_goes_on_with_ends(void)
{
    IoDrvModule module;

    begin_scan();
    line.identification_of = line.server_id_of = 0;
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(IoMgrScanModules(0, 0, &module), ERR_PENDING);
    run_passes(20000 / PASS_MS);
    line.out[0] = 0;
    line.asked[UNIT] = 0;
    run_passes(5000 / PASS_MS);
    CHECK(line.out[0] == UNIT); /* its own device is still asked */
    line.identification_of = 1; /* the next scan begins with the first unit */
    CHECK_EQUAL(scan_on(0, &module), ERR_OK);
    CHECK_EQUAL(module.slot, 1);
}

/* The request that was on its way is not taken for the first one of the new scan. */
static void a_scan_may_begin_again_in_the_middle(void)
{
    IoDrvModule module;

    begin_scan();
    line.identification_of = 1;
    line.server_id_of = 2;
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(scan_on(0, &module), ERR_OK);
    CHECK_EQUAL(scan_on(1, &module), ERR_OK);
    CHECK_EQUAL(IoMgrScanModules(0, 2, &module), ERR_PENDING);
    run_passes(100 / PASS_MS);
    CHECK_EQUAL(scan_on(0, &module), ERR_OK);
    CHECK_EQUAL(module.slot, 1);
    CHECK_EQUAL(scan_on(1, &module), ERR_OK);
    CHECK_EQUAL(module.slot, 2);
}

/* What the previous scan has found may be gone. */
static void a_scan_that_begins_again_after_its_first_device_asks_for_it_again(void)
{
    IoDrvModule module;

    begin_scan();
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(scan_on(0, &module), ERR_OK);
    CHECK_EQUAL(module.slot, WELL_KNOWN_UNIT);
    CHECK_EQUAL(IoMgrScanModules(0, 1, &module), ERR_PENDING);
    run_passes(100 / PASS_MS);
    line.identification_of = 0;
    CHECK_EQUAL(scan_on(0, &module), ERR_OK);
    CHECK_EQUAL(module.slot, ID_UNIT);
    CHECK_EQUAL(scan_on(1, &module), ERR_NO_OBJECT);
}

/* A configuration that is given back while it runs takes its scan along. */
static void a_scan_ends_with_its_configuration(void)
{
    IoDrvModule module;

    begin_scan();
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(IoMgrScanModules(0, 0, &module), ERR_PENDING);
    CHECK_EQUAL(IoDrvModbus_Hook(CH_EXIT3), ERR_OK);
    CHECK_EQUAL(IoMgrScanModules(0, 0, &module), ERR_NOT_SUPPORTED);
    run_passes(10);
}

static void only_lines_of_clients_are_scanned(void)
{
    IoDrvModule module;

    begin_scan();
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK_EQUAL(IoMgrScanModules(1, 0, &module), ERR_NOT_SUPPORTED);
}

int main(void)
{
    RUN(a_scan_finds_who_replies);
    RUN(a_scan_that_nobody_goes_on_with_ends);
    RUN(a_scan_may_begin_again_in_the_middle);
    RUN(a_scan_that_begins_again_after_its_first_device_asks_for_it_again);
    RUN(a_scan_ends_with_its_configuration);
    RUN(only_lines_of_clients_are_scanned);
    NEEDS_X86_64;
    RUN(outputs_are_safe_before_the_program_runs);
    RUN(outputs_that_hold_are_not_written_before_the_program_runs);
    RUN(a_device_that_refuses_is_not_one_that_is_silent);
    RUN(single_bits_hold_like_registers);
    RUN(outputs_of_two_tasks_are_not_written_before_both_have_run);
    RUN(an_optional_device_is_left_out_with_all_its_jobs);
    RUN(an_optional_device_that_is_left_out_takes_no_room);
    RUN(an_optional_device_with_a_channel_that_cannot_be_is_not_asked);
    RUN(a_server_is_written);
    RUN(an_optional_server_whose_memory_has_no_room_is_not_there);
    RUN(an_optional_server_with_more_ranges_than_there_is_room_for_is_not_there);
    RUN(an_optional_server_with_a_channel_that_cannot_be_is_not_there);
    RUN(a_tcp_server_that_is_left_out_does_not_listen);
    RUN(a_tcp_server_whose_port_is_in_use_says_so_and_tries_again);
    RUN(a_server_comes_after_one_that_is_left_out);
    RUN(a_host_that_is_looked_up_is_refused_where_there_are_no_names);
    return test_result();
}
