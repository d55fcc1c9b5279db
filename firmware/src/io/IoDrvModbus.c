/*
 * IoDrvModbus.c - driver of Modbus devices, and of this device as a Modbus server.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The engine (src/modbus) runs in CH_COMM_CYCLE; tasks and it meet in the data of ModbusSetup.h, under SysLock.
 */
#include "IoDrvModbus.h"

#include <string.h>

#include "AppState.h"
#include "CMUtils.h"
#include "CmpLog.h"
#include "CmpIoMgrEmbedded.h"
#include "ModbusCalls.h"
#include "ModbusDriver.h"
#include "ModbusScan.h"
#include "ModbusServerTcp.h"
#include "ModbusSetup.h"
#include "ModbusTcp.h"
#include "ModbusToolLine.h"
#include "ModbusTunnel.h"
#include "SysLock.h"
#include "SysTime.h"

static MODBUS_SETUP setup;

/* Between IoDrvUpdateMapping and the next configuration. */
static bool is_running;
static const IoConfigTaskMap *maps;
static int map_count;

static const ICmpIoDrv functions;
static IO_DRIVER driver = {.functions = &functions};

static const IoDrvInfo *get_info(void)
{
    static const IoDrvInfo info = {"IoDrvModbus", "Modbus", "Open PLC runtime", 0x00010000};

    return &info;
}

MODBUS_SETUP *IoDrvModbusGetSetup(void)
{
    return &setup;
}

/* ---- configuration ---- */

/* Devices get what their outputs have become, the safe state, before the lines are closed. */
static void write_last_outputs(void)
{
    RTS_I64 now_ns = SysTimeGetNs();
    RTS_I64 end_ns = now_ns + (RTS_I64)MODBUS_LAST_WRITES_MS * 1000000;
    bool found = true;

    for (; found && now_ns < end_ns; now_ns = SysTimeGetNs()) {
        found = false;
        for (RTS_UI32 i = 0; i < setup.client_count; i++) {
            found = ModbusClientHurryWrites(&setup.clients[i].client) || found;
            ModbusClientPoll(&setup.clients[i].client, now_ns);
        }
        if (found && !RTS_ONE_CORE)
            SysTimePause();
    }
}

/* What is asked for is set up when it is known what is copied. */
static RTS_RESULT update_configuration(const IoConfigConnector *connectors, int count)
{
    RTS_UNUSED(connectors);
    RTS_UNUSED(count);
    if (is_running)
        write_last_outputs();
    is_running = false;
    map_count = 0;
    ModbusCallsBegin(NULL, NULL);
    ModbusScanEnd();
    ModbusGiveBack(&setup);
    return ERR_OK;
}

static bool is_channel_good(const MODBUS_PLACE *place, const IoConfigChannelMap *channel, bool is_output)
{
    RTS_UI32 bits = 0;

    return ModbusFindMemory(place, channel->parameter, is_output, &bits) != NULL && channel->parameter_bit <= bits &&
           channel->bits <= bits - channel->parameter_bit;
}

static MODBUS_JOB_STATE *job_of(const MODBUS_PLACE *place, const IoConfigChannelMap *channel)
{
    return &place->device->jobs[channel->parameter - MODBUS_PARAM_JOB];
}

/* In each of its bytes: a channel is whole ones, or within one. */
static RTS_UI32 mask_of(const IoConfigChannelMap *channel)
{
    return channel->bits >= 8 ? 0xFF : ((1u << channel->bits) - 1) << channel->parameter_bit % 8;
}

/* Until a job has all its outputs, `written` has the bits that are missing. */
static void mark(MODBUS_JOB_STATE *job, const IoConfigChannelMap *channel, bool missing)
{
    RTS_UI8 *byte = job->written + channel->parameter_bit / 8;
    RTS_UI32 mask = mask_of(channel);

    for (RTS_UI32 i = 0; i < (channel->bits + 7u) / 8; i++)
        byte[i] = (RTS_UI8)(missing ? byte[i] | mask : byte[i] & ~mask);
}

/* A device of a line that is optional, and not used, has no data. */
static RTS_RESULT check_channel(const IoConfigConnector *connector, const IoConfigChannelMap *channel, RTS_UI32 type)
{
    MODBUS_PLACE place = ModbusFindPlace(&setup, connector);

    if (place.device == NULL && place.server == NULL)
        return ERR_OK;
    if (!is_channel_good(&place, channel, type == IO_MAP_OUTPUTS))
        return MODBUS_REFUSE(connector, ERR_PARAMETER, "a channel is not in its data.");
    if (place.device != NULL && type == IO_MAP_OUTPUTS)
        mark(job_of(&place, channel), channel, true);
    return ERR_OK;
}

static RTS_RESULT update_mapping(const IoConfigTaskMap *task_maps, int count)
{
    RTS_RESULT result;

    do {
        result = ModbusSetUp(&setup, &driver);
        if (result == ERR_OK)
            result = IoMgrConfigEachChannel(task_maps, count, &driver, check_channel);
    } while (result == ERR_PENDING);
    is_running = result == ERR_OK;
    maps = task_maps;
    map_count = count;
    if (is_running)
        ModbusCallsBegin(&setup, NULL);
    return result;
}

/* ---- tasks ---- */

/* The job may be done when all that it writes is of the program, or of the safe state: what holds its value is not in
 * that, and other tasks may run later. */
static void note_output(MODBUS_JOB_STATE *job, const IoConfigChannelMap *channel, RTS_UI32 bits)
{
    RTS_UI32 size = (bits + 7) / 8;

    if ((job->written[channel->parameter_bit / 8] & mask_of(channel)) == 0)
        return;
    mark(job, channel, false);
    while (size > 0 && job->written[size - 1] == 0)
        size--;
    job->has_out = size == 0;
}

static bool is_untouched(const MODBUS_PLACE *place)
{
    return place->server != NULL && place->server->server.written == 0;
}

static RTS_RESULT follow(const IoConfigConnector *connector, const IoConfigChannelMap *channel, RTS_UI32 type)
{
    MODBUS_PLACE place = {NULL, NULL};
    RTS_UI32 bits, lock;

    if (type == IO_MAP_INPUTS)
        place = ModbusFindPlace(&setup, connector);
    if (is_untouched(&place)) {
        lock = SysLockEnter();
        IoMgrCopyInputBackLE(channel, ModbusFindMemory(&place, channel->parameter, false, &bits));
        SysLockLeave(lock);
    }
    return ERR_OK;
}

void IoDrvModbusFollowInputs(void)
{
    bool all_written = true;

    for (RTS_UI32 i = 0; i < setup.server_count; i++)
        all_written = all_written && setup.servers[i].server.written != 0;
    if (!all_written)
        (void)IoMgrConfigEachChannel(maps, map_count, &driver, follow);
}

static void copy(const IoConfigConnectorMap *map, bool is_output)
{
    const MODBUS_PLACE place = ModbusFindPlace(&setup, IoMgrConfigGetConnector(map->connector));
    const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(map);
    RTS_UI32 bits;

    for (RTS_UI32 count = map->channel_map_count; count > 0; count--, channel++) {
        RTS_UI8 *memory = ModbusFindMemory(&place, channel->parameter, is_output, &bits);
        if (memory == NULL)
            continue;
        if (!is_output) {
            if (!is_untouched(&place))
                IoMgrCopyInputLE(channel, memory);
            continue;
        }
        IoMgrCopyOutputLE(channel, memory);
        if (place.device != NULL && !job_of(&place, channel)->has_out)
            note_output(job_of(&place, channel), channel, bits);
    }
}

static RTS_RESULT copy_all(const IoConfigConnectorMap *maps, int count, bool is_output)
{
    RTS_UI32 lock = SysLockEnter();

    for (; count > 0; count--, maps++)
        copy(maps, is_output);
    SysLockLeave(lock);
    return ERR_OK;
}

static RTS_RESULT read_inputs(const IoConfigConnectorMap *maps, int count)
{
    return copy_all(maps, count, false);
}

static RTS_RESULT write_outputs(const IoConfigConnectorMap *maps, int count)
{
    return copy_all(maps, count, true);
}

/* ---- what the manager sees ---- */

static void note_error(MODBUS_NOTED *noted, RTS_UI32 errors, RTS_UI32 flag)
{
    if (errors == noted->noted_errors)
        return;
    noted->noted_errors = errors;
    if (flag == 0) {
        IoMgrConfigNoteError(noted->connector);
        return;
    }
    IoMgrConfigSetDiagnosis(noted->connector, flag);
    IoMgrConfigResetDiagnosis(noted->connector, (CF_CONNECTOR_BUS_ERROR | CF_CONNECTOR_ERROR) & ~flag);
}

static RTS_UI32 errors_of(const MODBUS_DEVICE *device)
{
    return device->counters.timeouts + device->counters.exceptions + device->counters.unverified;
}

static void note_device(MODBUS_NOTED *noted, const MODBUS_DEVICE *device)
{
    bool lost = ModbusDeviceIsLost(device);
    bool good = ModbusDeviceIsGood(device);

    if ((RTS_UI32)device->good_ns != noted->noted_data && good)
        IoMgrConfigNoteData(noted->connector);
    noted->noted_data = (RTS_UI32)device->good_ns;
    if (lost)
        note_error(noted, errors_of(device), CF_CONNECTOR_BUS_ERROR);
    else
        note_error(noted, errors_of(device), good || device->failures != 0 ? 0 : CF_CONNECTOR_ERROR);
}

/* Of a client a line is as well as one of its devices, of those that can reply. */
static void note_client(MODBUS_CLIENT_LINE *line)
{
    const MODBUS_CLIENT *client = &line->client;
    const MODBUS_DEVICE *device = client->devices;
    const MODBUS_DEVICE *end = device + client->device_count;
    MODBUS_NOTED *noted = line->devices;
    bool can_reply = false;
    bool replies = false;
    bool failed = false;

    for (; device < end; device++, noted++) {
        note_device(noted, device);
        failed = failed || device->failures != 0;
        if (!ModbusDeviceIsOne(client, device))
            continue;
        can_reply = true;
        replies = replies || (device->good_ns != 0 && !ModbusDeviceIsLost(device));
    }
    bool lost = can_reply && !replies && failed;
    if (replies || !can_reply)
        IoMgrConfigNoteData(line->noted.connector);
    else if (lost && !line->noted.noted_lost)
        IoMgrConfigSetDiagnosis(line->noted.connector, CF_CONNECTOR_BUS_ERROR);
    line->noted.noted_lost = lost;
    note_error(&line->noted, client->link.bad_frames, 0);
}

/* A server that cannot listen; only one on TCP is. */
static void note_deaf(const IoConfigConnector *connector, RTS_RESULT why)
{
    const char *reason = why == ERR_DUPLICATE          ? "its port is in use"
                         : why == ERR_NO_ACCESS_RIGHTS ? "there is no right to its port"
                                                       : "its address is not one of this device";

    IoMgrConfigSetDiagnosis(connector, CF_CONNECTOR_ERROR);
    LogAdd(CMPID_CmpIoMgrEmbedded, LOG_WARNING, why, "%s cannot listen: %s", IoMgrConfigGetName(connector), reason);
}

/* The age of a server is that of what was written to it last. */
static void note_server(MODBUS_SERVER_LINE *line, RTS_RESULT state)
{
    bool good = state == ERR_OK;
    bool lost = !good && state != ERR_PENDING;

    if (good && (line->noted.noted_lost || line->noted.noted_data != line->server.written + 1)) {
        IoMgrConfigNoteData(line->noted.connector);
        line->noted.noted_data = line->server.written + 1;
    }
    if (lost && !line->noted.noted_lost)
        note_deaf(line->noted.connector, state);
    line->noted.noted_lost = lost;
    note_error(&line->noted, line->server.errors + line->link.bad_frames, 0);
}

/* ---- the engine ---- */

#if MODBUS_MAX_CONNECTIONS > 0
static void poll_tcp_servers(RTS_I64 now_ns)
{
    ModbusServerTcpPoll(now_ns);
}

static RTS_RESULT state_of(const MODBUS_SERVER_LINE *line)
{
    return line->server.tcp ? ModbusServerTcpGetState(&line->server) : ERR_OK;
}

static RTS_UI32 tcp_counter(RTS_UI32 id)
{
    const MODBUS_TCP_COUNTERS *counters = ModbusServerTcpGetCounters();

    return id == MODBUS_PARAM_ACCEPTED ? counters->accepted : counters->displaced;
}
#else
static void poll_tcp_servers(RTS_I64 now_ns)
{
    RTS_UNUSED(now_ns);
}

static RTS_RESULT state_of(const MODBUS_SERVER_LINE *line)
{
    RTS_UNUSED(line);
    return ERR_OK;
}

static RTS_UI32 tcp_counter(RTS_UI32 id)
{
    RTS_UNUSED(id);
    return 0;
}
#endif

/* Silence, and the next request of a client, are shorter than the sleep of main may be. */
static void cycle(void)
{
    RTS_I64 now_ns = SysTimeGetNs();
    bool hurry = setup.client_count != 0;

    ModbusCallsPoll(AppGetState() == AS_RUN, now_ns);
    for (RTS_UI32 i = 0; i < setup.client_count; i++) {
        ModbusClientPoll(&setup.clients[i].client, now_ns);
        ModbusScanPoll(&setup.clients[i].client, now_ns);
        note_client(&setup.clients[i]);
    }
    IoDrvModbusFollowInputs();
    for (RTS_UI32 i = 0; i < setup.server_count; i++) {
        MODBUS_SERVER_LINE *line = &setup.servers[i];
        line->server.running = AppGetState() == AS_RUN;
        if (!line->server.tcp)
            (void)ModbusServerPoll(&line->server, &line->link, now_ns);
        hurry = hurry || line->link.fill != 0;
        note_server(line, state_of(line));
    }
    poll_tcp_servers(now_ns);
    if (hurry)
        SysTimeWantPass(1);
}

/* ---- requests from the PC ---- */

/* MODBUS_DEVICE_COUNTERS has them in the order of their numbers. */
static RTS_RESULT device_counter(const MODBUS_DEVICE *device, RTS_UI32 id, RTS_UI32 *value)
{
    RTS_UI32 index = id - MODBUS_PARAM_REQUESTS;

    if (id == MODBUS_PARAM_BUSY) {
        *value = device->busy;
        return ERR_OK;
    }
    if (index >= sizeof(device->counters) / sizeof(*value))
        return ERR_NO_OBJECT;
    memcpy(value, (const RTS_UI8 *)&device->counters + index * sizeof(*value), sizeof(*value));
    return ERR_OK;
}

static RTS_RESULT server_counter(const MODBUS_SERVER_LINE *line, RTS_UI32 id, RTS_UI32 *value)
{
    switch (id) {
    case MODBUS_PARAM_REQUESTS:
        *value = line->server.requests;
        return ERR_OK;
    case MODBUS_PARAM_EXCEPTIONS:
        *value = line->server.errors;
        return ERR_OK;
    case MODBUS_PARAM_WRITTEN:
        *value = line->server.written;
        return ERR_OK;
    case MODBUS_PARAM_BAD_FRAMES:
        *value = line->link.bad_frames;
        return ERR_OK;
    case MODBUS_PARAM_ACCEPTED:
    case MODBUS_PARAM_DISPLACED:
        *value = tcp_counter(id);
        return ERR_OK;
    default:
        return ERR_NO_OBJECT;
    }
}

/* NULL: it is no line of a client. */
static MODBUS_CLIENT *find_client(const IoConfigConnector *connector)
{
    for (RTS_UI32 i = 0; i < setup.client_count; i++) {
        if (setup.clients[i].noted.connector == connector)
            return &setup.clients[i].client;
    }
    return NULL;
}

static RTS_RESULT client_counter(const IoConfigConnector *connector, RTS_UI32 id, RTS_UI32 *value)
{
    const MODBUS_CLIENT *client = id == MODBUS_PARAM_BAD_FRAMES ? find_client(connector) : NULL;

    if (client == NULL)
        return ERR_NO_OBJECT;
    *value = client->link.bad_frames;
    return ERR_OK;
}

static RTS_RESULT read_parameter(const IoConfigConnector *connector, RTS_UI32 id, void *data, RTS_UI32 bits,
                                 RTS_UI32 bit_offset)
{
    const MODBUS_PLACE place = ModbusFindPlace(&setup, connector);
    RTS_UI32 value = 0;
    RTS_RESULT result;

    if (place.device != NULL)
        result = device_counter(place.device, id, &value);
    else if (place.server != NULL)
        result = server_counter(place.server, id, &value);
    else
        result = client_counter(connector, id, &value);
    if (result != ERR_OK || bit_offset != 0 || bits != 8 * sizeof(value))
        return result != ERR_OK ? result : ERR_PARAMETER;
    memcpy(data, &value, sizeof(value));
    return ERR_OK;
}

static RTS_RESULT scan_modules(const IoConfigConnector *connector, RTS_UI32 index, IoDrvModule *module)
{
    MODBUS_CLIENT *client = is_running ? find_client(connector) : NULL;

    return client != NULL ? ModbusScan(client, index, module, SysTimeGetNs()) : (RTS_RESULT)ERR_NOT_SUPPORTED;
}

/* Registers have the initial values of their variables again, until a client writes. */
static void reset(void)
{
    for (RTS_UI32 i = 0; i < setup.server_count; i++) {
        setup.servers[i].server.written = 0;
        setup.servers[i].noted.noted_data = 1;
    }
}

/* ---- why a device is lost ---- */

/* The connection of a device; NULL: it is on a serial line. */
static const MODBUS_LINK *connection_of(const MODBUS_DEVICE *device)
{
    for (RTS_UI32 i = 0; i < setup.client_count; i++) {
        const MODBUS_CLIENT *client = &setup.clients[i].client;
        if (device >= client->devices && device < client->devices + client->device_count)
            return ModbusLinkType(&client->link) != &ModbusRtuType ? &client->link : NULL;
    }
    return NULL;
}

static const char *no_connection(const MODBUS_LINK *link)
{
    const char *why = MODBUS_MAX_CONNECTIONS > 0 ? ModbusTcpExplainName(link) : NULL;

    return why != NULL ? why : "no connection to it";
}

static const char *miss_of(const MODBUS_DEVICE *device)
{
    static const char *const misses[] = {
        [MODBUS_MISS_SILENT] = "it does not reply",
        [MODBUS_MISS_LATE] = "its replies are late",
        [MODBUS_MISS_UNIT] = "another unit replies",
        [MODBUS_MISS_OTHER] = "its replies are not to what was asked",
        [MODBUS_MISS_CUT] = "its replies are incomplete",
        [MODBUS_MISS_DAMAGED] = "its replies are damaged",
        [MODBUS_MISS_CLOSED] = "it closes the connection",
        [MODBUS_MISS_NO_ENTRANCE] = "its line is busy",
        [MODBUS_MISS_GATEWAY] = "its gateway gets no reply from it",
    };
    const MODBUS_LINK *link;

    if (device->miss == MODBUS_MISS_NO_ENTRANCE && (link = connection_of(device)) != NULL)
        return no_connection(link);
    return misses[device->miss];
}

/* A line is lost when all its devices are. */
static void explain_loss(const IoConfigConnector *connector, char *text, RTS_SIZE size)
{
    const MODBUS_DEVICE *device = ModbusFindPlace(&setup, connector).device;

    if (device != NULL && device->miss == MODBUS_MISS_UNIT)
        CMUtlsnprintf(text, size, "it replies as unit %u", (unsigned)device->missed_unit);
    else
        CMUtlsnprintf(text, size, "%s", device != NULL ? miss_of(device) : "none of its devices replies");
}

/* ---- life ---- */

#if ONLINE_CHANGE
static void follow_configuration(const IoConfigTaskMap *task_maps, int count)
{
    ModbusSetupFollow(&setup);
    maps = task_maps;
    map_count = count;
}
#endif

static const ICmpIoDrv functions = {
    .IoDrvGetInfo = get_info,
    .IoDrvUpdateConfiguration = update_configuration,
    .IoDrvUpdateMapping = update_mapping,
    .IoDrvReadInputs = read_inputs,
    .IoDrvWriteOutputs = write_outputs,
    .IoDrvScanModules = scan_modules,
    .IoDrvReadParameter = read_parameter,
    .IoDrvReset = reset,
    .IoDrvExplainLoss = explain_loss,
#if ONLINE_CHANGE
    .IoDrvFollowConfiguration = follow_configuration,
#endif
};

static void begin_tools(void)
{
    if (MODBUS_TUNNEL)
        ModbusTunnelReset();
    ModbusToolLineOpen();
}

static void end(void)
{
    (void)update_configuration(NULL, 0);
    (void)ModbusToolLineClose();
}

static void pass(void)
{
    if (ModbusToolLinePoll(SysTimeGetNs()))
        SysTimeWantPass(1);
    if (is_running)
        cycle();
}

RTS_RESULT IoDrvModbus_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT2)
        return IoMgrRegisterInstance(&driver);
    if (hook == CH_INIT3) {
        begin_tools();
        return ModbusCallsRegister();
    }
    if (hook == CH_COMM_CYCLE)
        pass();
    else if (hook == CH_EXIT3)
        end();
    else if (hook == CH_EXIT2)
        (void)IoMgrUnregisterInstance(&driver);
    return ERR_OK;
}
