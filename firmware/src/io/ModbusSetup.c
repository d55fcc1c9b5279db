/*
 * ModbusSetup.c - the lines, devices, jobs and ranges of Modbus that the configuration asks for.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusSetup.h"

#include <string.h>

#include "CMUtils.h"
#include "CmpIoMgrEmbedded.h"
#include "IoDrvModbus.h"
#include "ModbusRtu.h"
#include "ModbusServerTcp.h"
#include "ModbusTcp.h"
#include "ModbusToolLine.h"
#include "SysCom.h"
#include "SysTarget.h"

enum { DEFAULT_BAUD = 19200, LEAST_BAUD = 300 };

static const bool HAS_TCP = MODBUS_MAX_CONNECTIONS > 0;

/* ---- parameters ---- */

static RTS_UI32 number(const IoConfigConnector *connector, RTS_UI32 id, RTS_UI32 otherwise)
{
    RTS_RESULT result;
    const IoConfigParameter *parameter = IoMgrConfigGetParameter(connector, id);
    RTS_UI32 value = IoMgrConfigGetParameterValueDword(parameter, &result);

    return result == ERR_OK ? value : otherwise;
}

/* The value of a parameter that is a structure of `size` bytes, NULL otherwise. */
static const void *structure(const IoConfigConnector *connector, RTS_UI32 id, RTS_UI32 size)
{
    const IoConfigParameter *parameter = IoMgrConfigGetParameter(connector, id);

    return parameter != NULL && parameter->bits == 8 * size ? IoMgrConfigGetParameterValuePointer(parameter, NULL)
                                                            : NULL;
}

RTS_NOINLINE RTS_RESULT ModbusRefused(RTS_RESULT result)
{
    return result == ERR_OK ? (RTS_RESULT)ERR_PENDING : result;
}

/* Takes `count` of those that there are `most` of. */
static RTS_RESULT take(const IoConfigConnector *connector, RTS_UI32 *used, RTS_UI32 count, RTS_UI32 most,
                       const char *what)
{
    if (count > most - *used)
        return MODBUS_REFUSE(connector, ERR_NOMEMORY, "this device has room for %u %s.", (unsigned)most, what);
    *used += count;
    return ERR_OK;
}

/* Takes bytes of the data, which are zero. */
static RTS_NOINLINE RTS_RESULT take_data(MODBUS_SETUP *setup, const IoConfigConnector *connector, RTS_UI32 size,
                                         RTS_UI8 **data)
{
    *data = setup->data + setup->data_size;
    return take(connector, &setup->data_size, size, MODBUS_DATA_SIZE, "bytes of Modbus data");
}

/* ---- serial lines ---- */

static RTS_RESULT refuse_line(const IoConfigConnector *connector, RTS_RESULT result, const char *name)
{
    switch (result) {
    case ERR_NO_OBJECT:
        return MODBUS_REFUSE(connector, result, "this device has no serial line \"%s\".", name);
    case ERR_DUPLICATE:
        return MODBUS_REFUSE(connector, result, "the serial line \"%s\" is in use.", name);
    default:
        return MODBUS_REFUSE(connector, result,
                             "the serial line \"%s\" cannot run with this baud, parity, stop_bits or drive.", name);
    }
}

/* A client would ask the devices on the line of tools, and a tool could not: only a server can have it. */
static RTS_RESULT refuse_client(const IoConfigConnector *connector, RTS_UI32 line, const char *name)
{
    SysComClose(line);
    ModbusToolLineOpen();
    return MODBUS_REFUSE(connector, ERR_DUPLICATE, "tools have the serial line \"%s\"; only a server can be on it.",
                         name);
}

/* As SysComOpenPort. The line of tools is open until a server takes it, by whatever name, and then *of_tools. */
static RTS_RESULT open_port(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *line, bool *of_tools)
{
    RTS_RESULT result = SysComOpenPort(name, settings, line);

    *of_tools = false;
    if (result != ERR_DUPLICATE || !ModbusToolLineClose())
        return result;
    result = SysComOpenPort(name, settings, line);
    *of_tools = result == ERR_OK;
    if (result != ERR_OK)
        ModbusToolLineOpen();
    return result;
}

/* `server`: of which it is; NULL: of a client. */
static RTS_RESULT open_line(MODBUS_LINK *link, MODBUS_SERVER *server, const IoConfigConnector *connector)
{
    const char *name = IoMgrConfigGetParameterValueText(IoMgrConfigGetParameter(connector, MODBUS_PARAM_LINE));
    RTS_UI32 line;
    RTS_RESULT result;
    bool of_tools;
    const SYSCOM_SETTINGS settings = {
        number(connector, MODBUS_PARAM_BAUD, DEFAULT_BAUD),
        (RTS_UI8)number(connector, MODBUS_PARAM_PARITY, SYSCOM_PARITY_EVEN),
        (RTS_UI8)number(connector, MODBUS_PARAM_STOP_BITS, 1),
        number(connector, MODBUS_PARAM_RS485, 0) != 0,
    };

    if (name == NULL)
        return MODBUS_REFUSE(connector, ERR_PARAMETER, "the name of its serial line is missing.");
    if (settings.baud < LEAST_BAUD || settings.parity > SYSCOM_PARITY_ODD || settings.stop_bits < 1 ||
        settings.stop_bits > 2)
        return refuse_line(connector, ERR_NOT_SUPPORTED, name);
    result = open_port(name, &settings, &line, &of_tools);
    if (result != ERR_OK)
        return refuse_line(connector, result, name);
    if (of_tools && server == NULL)
        return refuse_client(connector, line, name);
    if (server != NULL)
        server->tunnel = of_tools;
    ModbusRtuBegin(link, line, &settings);
    return ERR_OK;
}

/* Of a server on TCP the link is not used. */
static void close_link(MODBUS_LINK *link)
{
    if (link->type != NULL)
        ModbusLinkType(link)->close(link);
}

/* ---- TCP ---- */

static bool is_named(RTS_UI32 role)
{
    return role == MODBUS_ROLE_NAMED_TCP_CLIENT || role == MODBUS_ROLE_NAMED_RTU_TCP_CLIENT;
}

static bool is_on_tcp(RTS_UI32 role)
{
    return role == MODBUS_ROLE_TCP_CLIENT || role == MODBUS_ROLE_TCP_SERVER || role == MODBUS_ROLE_RTU_TCP_CLIENT ||
           is_named(role);
}

static RTS_RESULT refuse_tcp(const IoConfigConnector *connector)
{
    return MODBUS_REFUSE(connector, ERR_NOT_SUPPORTED, "this device has no TCP.");
}

#if MODBUS_MAX_CONNECTIONS > 0
static SOCKADDRESS address_of(const IoConfigConnector *connector)
{
    return (SOCKADDRESS){number(connector, MODBUS_PARAM_ADDRESS, 0),
                         (RTS_UI16)number(connector, MODBUS_PARAM_PORT, MODBUS_PORT)};
}

RTS_STATIC_ASSERT((int)MODBUS_MAX_HOST == (int)SYSSOCK_MAX_NAME, what_a_port_takes);

static const char *host_of(const IoConfigConnector *connector)
{
    return IoMgrConfigGetParameterValueText(IoMgrConfigGetParameter(connector, MODBUS_PARAM_HOST));
}

static RTS_RESULT check_host(const IoConfigConnector *connector)
{
    const char *host = host_of(connector);

    if (!SYSSOCK_NAMES)
        return MODBUS_REFUSE(connector, ERR_NOT_SUPPORTED,
                             "this device finds no names: write an IPv4 address as host.");
    if (host == NULL || host[0] == '\0' || CMUtlStrNLen(host, MODBUS_MAX_HOST + 1) > MODBUS_MAX_HOST)
        return MODBUS_REFUSE(connector, ERR_PARAMETER, "it needs a host of 1 to %u characters.",
                             (unsigned)MODBUS_MAX_HOST);
    return ERR_OK;
}

static void begin_client(MODBUS_LINK *link, const IoConfigConnector *connector)
{
    const SOCKADDRESS peer = address_of(connector);
    RTS_UI32 role = number(connector, MODBUS_PARAM_ROLE, 0);

    if (role == MODBUS_ROLE_RTU_TCP_CLIENT || role == MODBUS_ROLE_NAMED_RTU_TCP_CLIENT)
        ModbusTcpBeginRtuClient(link, &peer);
    else
        ModbusTcpBeginClient(link, &peer);
#if SYSSOCK_NAMES
    if (is_named(role))
        ModbusTcpSetHost(link, host_of(connector));
#endif
}

static void begin_server(MODBUS_SERVER *server, const IoConfigConnector *connector)
{
    const SOCKADDRESS own = address_of(connector);

    (void)ModbusServerTcpOpen(server, &own); /* there is room for all servers */
}

static void close_servers(void)
{
    ModbusServerTcpClose();
}
#else
static RTS_RESULT check_host(const IoConfigConnector *connector)
{
    RTS_UNUSED(connector);
    return ERR_OK;
}

static void begin_client(MODBUS_LINK *link, const IoConfigConnector *connector)
{
    RTS_UNUSED(link);
    RTS_UNUSED(connector);
}

static void begin_server(MODBUS_SERVER *server, const IoConfigConnector *connector)
{
    RTS_UNUSED(server);
    RTS_UNUSED(connector);
}

static void close_servers(void)
{
}
#endif

/* ---- devices of a client ---- */

static bool is_job_good(const MODBUS_JOB *job)
{
    const MODBUS_REQUEST request = ModbusJobGetRequest(job);
    RTS_UI32 reverse = job->flags >> MODBUS_JOB_REVERSE_SHIFT & 14;

    return request.function != NULL && request.function->table != 0 && ModbusCheckCounts(&request) == 0 &&
           (reverse & (reverse - 1)) == 0 &&
           (reverse == 0 || (2u * (job->read_count | job->write_count)) % reverse == 0) &&
           (job->interval_ms != 0 || (job->flags & MODBUS_JOB_ON_CHANGE) != 0);
}

static RTS_RESULT add_job(MODBUS_SETUP *setup, const IoConfigConnector *connector, const MODBUS_JOB *job)
{
    MODBUS_JOB_STATE *state = &setup->jobs[setup->job_count];
    const MODBUS_FUNCTION *function = ModbusFindFunction(job->function);
    RTS_UI32 read_size;
    RTS_UI32 write_size;
    RTS_RESULT result;

    if (!is_job_good(job))
        return MODBUS_REFUSE(connector, ERR_PARAMETER, "one of its jobs cannot be a request.");
    result = take(connector, &setup->job_count, 1, MODBUS_MAX_JOBS, "reads and writes of Modbus");
    if (result != ERR_OK)
        return result;
    read_size = ModbusDataSize(function, job->read_count);
    write_size = ModbusDataSize(function, job->write_count);
    state->job = job;
    result = take_data(setup, connector, read_size + 2 * write_size, &state->in);
    state->out = state->in + read_size;
    state->written = state->out + write_size;
    return result;
}

static RTS_RESULT add_jobs(MODBUS_SETUP *setup, MODBUS_DEVICE *device, const IoConfigConnector *connector)
{
    const MODBUS_JOB *job;
    RTS_RESULT result = ERR_OK;

    device->jobs = setup->jobs + setup->job_count;
    while (result == ERR_OK &&
           (job = structure(connector, MODBUS_PARAM_JOB + device->job_count, sizeof(MODBUS_JOB))) != NULL) {
        result = add_job(setup, connector, job);
        device->job_count++;
    }
    return result;
}

static RTS_RESULT add_device(MODBUS_SETUP *setup, const IoConfigConnector *connector)
{
    MODBUS_DEVICE *device = &setup->devices[setup->device_count];
    RTS_UI32 unit = number(connector, MODBUS_PARAM_UNIT, 1);
    RTS_RESULT result = take(connector, &setup->device_count, 1, MODBUS_MAX_DEVICES, "Modbus devices");

    if (result != ERR_OK)
        return result;
    if (unit > UINT8_MAX)
        return MODBUS_REFUSE(connector, ERR_PARAMETER, "there is no unit %u.", (unsigned)unit);
    device->unit = (RTS_UI8)unit;
    device->timeout_ms = number(connector, MODBUS_PARAM_TIMEOUT, MODBUS_TIMEOUT_MS);
    device->pause_ms = (RTS_UI16)number(connector, MODBUS_PARAM_PAUSE, 0);
    device->retries = (RTS_UI8)number(connector, MODBUS_PARAM_RETRIES, MODBUS_RETRIES);
    device->ask_again_ms = number(connector, MODBUS_PARAM_ASK_AGAIN, MODBUS_RETRY_MS);
    setup->noted[setup->device_count - 1].connector = connector;
    return add_jobs(setup, device, connector);
}

static RTS_RESULT add_client(MODBUS_SETUP *setup, const IO_DRIVER *driver, const IoConfigConnector *connector,
                             bool is_tcp)
{
    MODBUS_CLIENT_LINE *line = &setup->clients[setup->client_count];
    RTS_UI32 index = IoMgrConfigGetIndex(connector);
    RTS_UI32 first = setup->device_count;
    const IoConfigConnector *child;
    RTS_RESULT result = take(connector, &setup->client_count, 1, MODBUS_MAX_CLIENTS, "Modbus lines");

    if (result != ERR_OK)
        return result;
    line->noted.connector = connector;
    line->devices = setup->noted + setup->device_count;
    if (is_tcp)
        begin_client(&line->client.link, connector);
    else
        result = open_line(&line->client.link, NULL, connector);
    for (RTS_UI32 i = index + 1; result == ERR_OK && (child = IoMgrConfigGetConnector(i)) != NULL; i++) {
        if (child->parent == index && IoMgrConfigIsMine(child, driver))
            result = add_device(setup, child);
    }
    ModbusClientBegin(&line->client, setup->devices + first, setup->device_count - first);
    ModbusClientSetCalls(&line->client, setup->calls, RTS_COUNT(setup->calls));
    return result;
}

/* ---- servers ---- */

static bool is_range_good(const MODBUS_RANGE *range)
{
    const RTS_UI32 registers = MODBUS_HOLDING_REGISTERS | MODBUS_INPUT_REGISTERS;
    const RTS_UI32 bits = MODBUS_COILS | MODBUS_DISCRETE_INPUTS;
    const RTS_UI32 addresses = 0x10000;

    if (range->bits == 0 || range->bits > addresses * MODBUS_REGISTER_BITS ||
        (range->tables & (registers | bits)) == 0 || range->reverse == 0 || range->reverse > 8 ||
        (range->reverse & (range->reverse - 1)) != 0)
        return false;
    if ((range->tables & bits) != 0 && range->first_bit + range->bits > addresses)
        return false;
    if ((range->tables & registers) == 0)
        return range->reverse == 2;
    return range->bits % MODBUS_REGISTER_BITS == 0 && range->bits % (8u * range->reverse) == 0 &&
           range->first_register + range->bits / MODBUS_REGISTER_BITS <= addresses;
}

static RTS_RESULT add_range(MODBUS_SETUP *setup, const IoConfigConnector *connector, const MODBUS_RANGE *range)
{
    MODBUS_MEMORY *memory = &setup->ranges[setup->range_count];

    RTS_RESULT result;

    if (!is_range_good(range))
        return MODBUS_REFUSE(connector, ERR_PARAMETER, "one of its ranges cannot be.");
    result = take(connector, &setup->range_count, 1, MODBUS_MAX_RANGES, "ranges of Modbus servers");
    if (result != ERR_OK)
        return result;
    memory->range = range;
    return take_data(setup, connector, (range->bits + 7) / 8, &memory->data);
}

static RTS_RESULT add_ranges(MODBUS_SETUP *setup, MODBUS_SERVER *server, const IoConfigConnector *connector)
{
    const MODBUS_RANGE *range;
    RTS_RESULT result = ERR_OK;

    server->memory = setup->ranges + setup->range_count;
    while (result == ERR_OK &&
           (range = structure(connector, MODBUS_PARAM_RANGE + server->range_count, sizeof(MODBUS_RANGE))) != NULL) {
        result = add_range(setup, connector, range);
        server->range_count++;
    }
    return result;
}

/* Major, minor and patch. */
static const char *firmware_version(RTS_UI32 version)
{
    static char text[sizeof("255.255.255")];

    CMUtlsnprintf(text, sizeof(text), "%u.%u.%u", (unsigned)(version >> 24), (unsigned)(version >> 16 & 0xFF),
                  (unsigned)(version >> 8 & 0xFF));
    return text;
}

static void describe(MODBUS_SERVER *server, const IoConfigConnector *connector)
{
    const SYS_TARGET *target = SysTargetGet();
    const char *const otherwise[MODBUS_OBJECTS] = {target->vendor_name, target->device_name,
                                                   firmware_version(target->version), NULL, target->device_name};

    for (RTS_UI32 i = 0; i < MODBUS_OBJECTS; i++) {
        const char *text =
            IoMgrConfigGetParameterValueText(IoMgrConfigGetParameter(connector, MODBUS_PARAM_OBJECT + i));
        server->object[i] = text != NULL ? text : otherwise[i];
    }
}

static void note_gaps(MODBUS_SERVER *server, const IoConfigParameter *parameter)
{
    RTS_RESULT result;
    RTS_UI32 value = IoMgrConfigGetParameterValueDword(parameter, &result);

    server->has_gaps = result == ERR_OK;
    server->gap[0] = (RTS_UI8)value;
    server->gap[1] = (RTS_UI8)(value >> 8);
}

static RTS_RESULT add_server(MODBUS_SETUP *setup, const IoConfigConnector *connector, bool is_tcp)
{
    MODBUS_SERVER_LINE *line = &setup->servers[setup->server_count];
    RTS_RESULT result = take(connector, &setup->server_count, 1, MODBUS_MAX_SERVERS, "Modbus servers");

    if (result != ERR_OK)
        return result;
    line->noted.connector = connector;
    line->server.tcp = is_tcp;
    line->server.unit = (RTS_UI8)number(connector, MODBUS_PARAM_UNIT, is_tcp ? 0 : 1);
    describe(&line->server, connector);
    note_gaps(&line->server, IoMgrConfigGetParameter(connector, MODBUS_PARAM_GAPS));
    if (!is_tcp)
        result = open_line(&line->link, &line->server, connector);
    if (result == ERR_OK)
        result = add_ranges(setup, &line->server, connector);
    if (is_tcp && result == ERR_OK)
        begin_server(&line->server, connector);
    return result;
}

/* ---- all ---- */

static RTS_RESULT add_line(MODBUS_SETUP *setup, const IO_DRIVER *driver, const IoConfigConnector *connector)
{
    RTS_UI32 role = number(connector, MODBUS_PARAM_ROLE, 0);
    bool is_tcp = is_on_tcp(role);
    RTS_RESULT result = is_named(role) ? check_host(connector) : (RTS_RESULT)ERR_OK;

    if (is_tcp && !HAS_TCP)
        return refuse_tcp(connector);
    if (result != ERR_OK)
        return result;
    switch (role) {
    case MODBUS_ROLE_SERIAL_CLIENT:
    case MODBUS_ROLE_TCP_CLIENT:
    case MODBUS_ROLE_RTU_TCP_CLIENT:
    case MODBUS_ROLE_NAMED_TCP_CLIENT:
    case MODBUS_ROLE_NAMED_RTU_TCP_CLIENT:
        return add_client(setup, driver, connector, is_tcp);
    case MODBUS_ROLE_SERIAL_SERVER:
    case MODBUS_ROLE_TCP_SERVER:
        return add_server(setup, connector, is_tcp);
    default:
        return MODBUS_REFUSE(connector, ERR_PARAMETER, "it is neither a client nor a server.");
    }
}

static void close_all(MODBUS_SETUP *setup)
{
    for (RTS_UI32 i = 0; i < setup->client_count; i++)
        close_link(&setup->clients[i].client.link);
    for (RTS_UI32 i = 0; i < setup->server_count; i++)
        close_link(&setup->servers[i].link);
    close_servers();
}

void ModbusGiveBack(MODBUS_SETUP *setup)
{
    close_all(setup);
    memset(setup, 0, sizeof(*setup));
    ModbusToolLineOpen();
}

RTS_RESULT ModbusSetUp(MODBUS_SETUP *setup, const IO_DRIVER *driver)
{
    const IoConfigConnector *connector;
    RTS_RESULT result = ERR_OK;

    ModbusGiveBack(setup);
    for (RTS_UI32 i = 0; result == ERR_OK && (connector = IoMgrConfigGetConnector(i)) != NULL; i++) {
        if (connector->parent == IO_CONFIG_NONE && IoMgrConfigIsMine(connector, driver))
            result = add_line(setup, driver, connector);
    }
    return result;
}

/* ---- an online change ---- */

#if ONLINE_CHANGE
static void follow_server(MODBUS_SERVER_LINE *line)
{
    RTS_UI32 i;

    line->noted.connector = IoMgrConfigFollow(line->noted.connector);
    for (i = 0; i < MODBUS_OBJECTS; i++)
        line->server.object[i] = IoMgrConfigFollow(line->server.object[i]);
}

static void follow_client(MODBUS_CLIENT_LINE *line)
{
    line->noted.connector = IoMgrConfigFollow(line->noted.connector);
#if SYSSOCK_NAMES
    line->client.link.host = IoMgrConfigFollow(line->client.link.host);
#endif
}

void ModbusSetupFollow(MODBUS_SETUP *setup)
{
    RTS_UI32 i;

    for (i = 0; i < setup->client_count; i++)
        follow_client(&setup->clients[i]);
    for (i = 0; i < setup->device_count; i++)
        setup->noted[i].connector = IoMgrConfigFollow(setup->noted[i].connector);
    for (i = 0; i < setup->job_count; i++)
        setup->jobs[i].job = IoMgrConfigFollow(setup->jobs[i].job);
    for (i = 0; i < setup->server_count; i++)
        follow_server(&setup->servers[i]);
    for (i = 0; i < setup->range_count; i++)
        setup->ranges[i].range = IoMgrConfigFollow(setup->ranges[i].range);
}
#endif

/* ---- finding ---- */

MODBUS_PLACE ModbusFindPlace(MODBUS_SETUP *setup, const IoConfigConnector *connector)
{
    for (RTS_UI32 i = 0; i < setup->device_count; i++) {
        if (setup->noted[i].connector == connector)
            return (MODBUS_PLACE){&setup->devices[i], NULL};
    }
    for (RTS_UI32 i = 0; i < setup->server_count; i++) {
        if (setup->servers[i].noted.connector == connector)
            return (MODBUS_PLACE){NULL, &setup->servers[i]};
    }
    return (MODBUS_PLACE){NULL, NULL};
}

static RTS_UI8 *memory_of_job(const MODBUS_DEVICE *device, RTS_UI32 index, bool is_output, RTS_UI32 *bits)
{
    const MODBUS_JOB_STATE *state;
    const MODBUS_FUNCTION *function;

    if (index >= device->job_count)
        return NULL;
    state = &device->jobs[index];
    function = ModbusFindFunction(state->job->function);
    *bits = (is_output ? state->job->write_count : state->job->read_count) * (RTS_UI32)function->count_of_bits;
    return is_output ? state->out : state->in;
}

static RTS_UI8 *memory_of_range(const MODBUS_SERVER *server, RTS_UI32 index, RTS_UI32 *bits)
{
    if (index >= server->range_count)
        return NULL;
    *bits = server->memory[index].range->bits;
    return server->memory[index].data;
}

RTS_UI8 *ModbusFindMemory(const MODBUS_PLACE *place, RTS_UI32 parameter, bool is_output, RTS_UI32 *bits)
{
    if (place->device != NULL)
        return memory_of_job(place->device, parameter - MODBUS_PARAM_JOB, is_output, bits);
    return place->server != NULL ? memory_of_range(&place->server->server, parameter - MODBUS_PARAM_RANGE, bits) : NULL;
}
