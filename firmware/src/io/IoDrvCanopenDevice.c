/*
 * IoDrvCanopenDevice.c - driver of this controller as a CANopen device.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Values of the dictionary are in memory of the driver. Tasks copy from and to them at the edges of their cycles; main
 * serves the network (CanopenDevice.h), and RPDOs are received in the context of the port.
 */
#include "IoDrvCanopenDevice.h"

#include <string.h>

#include "CMUtils.h"
#include "CanopenAccess.h"
#include "CanopenDevice.h"
#include "CanopenDeviceDriver.h"
#include "CanopenDevicePdo.h"
#include "CanopenStore.h"
#include "CanopenTime.h"
#include "CmpBytes.h"
#include "CmpCan.h"
#include "CmpChecksum.h"
#include "CmpIoMgrEmbedded.h"
#include "CmpLog.h"
#include "SysLock.h"
#include "SysTarget.h"
#include "SysTime.h"
#include "SysTimeRtc.h"

#if CANOPEN_DEVICE_DATA > 0

enum { NS_PER_MS = 1000000, MAX_MS = 60000, BITS_PER_KBIT = 1000, EMERGENCY_SIZE = 2 };

static struct {
    const IoConfigConnector *connector; /* NULL: this controller is no device */
    RTS_UI32 network;
    bool is_running;
    bool was_operational;
    bool has_collision;                /* it was reported */
    RTS_UI8 emergency[EMERGENCY_SIZE]; /* the code of the program */
    RTS_UI16 reported;
    CAN_USER user;
    const IoConfigTaskMap *maps;
    int map_count;
    CANOPEN_SLAVE slave;
    RTS_UI8 values[CANOPEN_DEVICE_DATA];
} device;

static const ICmpIoDrv functions;
static IO_DRIVER driver = {.functions = &functions};

#if CANOPEN_PROGRAM_DOWNLOAD
static const CANOPEN_PROGRAM *program; /* NULL: the manager cannot replace it */

void IoDrvCanopenDeviceSetProgram(const CANOPEN_PROGRAM *functions_of_it)
{
    program = functions_of_it;
}

RTS_UI32 IoDrvCanopenDeviceMakeReply(CAN_FRAME *frame)
{
    const CANOPEN_SLAVE *slave = &device.slave;

    memset(frame, 0, sizeof(*frame));
    frame->id = CANOPEN_SDO_REPLY + (RTS_UI32)slave->node;
    frame->size = CANOPEN_PDO_SIZE;
    frame->data[0] = SDO_WRITE_DONE;
    BytesPut16(frame->data + 1, slave->server.object.index);
    frame->data[3] = slave->server.object.sub;
    return device.network;
}
#else
#define program NULL
#endif

static const CAN_FILTER filters[] = {{0, 0, false}}; /* all frames of 11 bits */

static const IoDrvInfo *get_info(void)
{
    static const IoDrvInfo info = {"IoDrvCanopenDevice", "CANopen device", "Open PLC runtime", 0x00010000};

    return &info;
}

/* ---- frames ---- */

static bool send(const CAN_FRAME *frame)
{
    return CanSend(device.network, frame) == ERR_OK;
}

/* In the context of the port. SYNC is for main, too. */
static bool take_urgent(RTS_UI32 index, const CAN_FRAME *frame)
{
    RTS_UNUSED(index);
    return CanopenPdoTakeUrgent(&device.slave, frame, SysTimeGetMs());
}

static RTS_UI32 get_bit_rate(void)
{
    CAN_STATE state;

    SysCanGetState(device.network, &state);
    return state.bit_rate / BITS_PER_KBIT;
}

static bool is_time(const CAN_FRAME *frame)
{
    return (device.slave.flags & CANOPEN_DEVICE_TIME) != 0 && frame->id == CANOPEN_TIME &&
           (frame->flags & CAN_FLAG_REMOTE) == 0;
}

static void take(RTS_UI32 index, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    RTS_I64 utc_ns;

    RTS_UNUSED(index);
    if (!device.is_running)
        return;
    if (is_time(frame) && CanopenTimeGet(frame, &utc_ns))
        (void)SysTimeRtcSet(utc_ns); /* if programs may */
    else
        CanopenDeviceTake(&device.slave, frame, get_bit_rate(), now_ms);
}

static void note_bus(RTS_UI32 index, bool off)
{
    RTS_UNUSED(index);
    if (device.is_running)
        CanopenDeviceNoteBus(&device.slave, off, SysTimeGetMs());
}

static bool is_of_pdo(RTS_UI32 direction, RTS_UI32 id)
{
    const CANOPEN_PDO_SETTING *pdos = device.slave.settings.pdos[direction];

    for (RTS_UI32 i = 0; i < device.slave.pdo_count[direction]; i++)
        if ((pdos[i].cob & CANOPEN_COB_INVALID) == 0 && (pdos[i].cob & CANOPEN_COB_ID) == id)
            return true;
    return false;
}

/* Programs must not send what the device does, or its manager. */
static bool is_reserved(RTS_UI32 network, RTS_UI32 id)
{
    RTS_UI32 function = id & CANOPEN_FUNCTION_MASK;
    RTS_UI32 node = device.slave.node;

    if (!device.is_running || network != device.network)
        return false;
    if (id == CANOPEN_NMT || id == CANOPEN_LSS_REQUEST || id == CANOPEN_LSS_REPLY)
        return true;
    return is_of_pdo(CANOPEN_RPDOS, id) || is_of_pdo(CANOPEN_TPDOS, id) ||
           (node != 0 && (id & CANOPEN_NODE_MASK) == node &&
            (function == CANOPEN_SDO_REPLY || function == CANOPEN_SDO_REQUEST || function == CANOPEN_HEARTBEAT ||
             function == CANOPEN_EMCY));
}

/* ---- configuration ---- */

static RTS_RESULT update_configuration(const IoConfigConnector *connectors, int count)
{
    RTS_UNUSED(connectors);
    RTS_UNUSED(count);
    if (device.is_running)
        CanDetach(device.network, &device.user);
    memset(&device, 0, sizeof(device));
    return ERR_OK;
}

static RTS_UI32 number(RTS_UI32 id)
{
    return IoMgrConfigGetParameterValueDword(IoMgrConfigGetParameter(device.connector, id), NULL);
}

/* The bytes of a parameter, which start at a multiple of 4; NULL and 0: it is missing. */
static const void *bytes(RTS_UI32 id, RTS_UI32 *size)
{
    const IoConfigParameter *parameter = IoMgrConfigGetParameter(device.connector, id);

    *size = parameter != NULL ? parameter->bits / 8 : 0;
    if (*size != 0 && (parameter->flags & PVF_POINTER) != 0)
        return IoMgrConfigGetParameterValuePointer(parameter, NULL);
    *size = 0;
    return NULL;
}

/* A table of entries; NULL and 0: it is missing, or not whole. */
static const void *table(RTS_UI32 id, RTS_UI32 entry_size, RTS_UI32 *count)
{
    RTS_UI32 size;
    const void *found = bytes(id, &size);

    *count = found != NULL && size % entry_size == 0 ? size / entry_size : 0;
    return found;
}

static RTS_RESULT refuse(const char *sentence)
{
    return IoMgrConfigRefuse(device.connector, ERR_PARAMETER, "%s", sentence);
}

/* 32 bits that differ from device to device, as 1018h:4 and LSS need them. */
static RTS_UI32 get_serial(void)
{
    const char *text = SysTargetGet()->serial_number;
    RTS_SIZE length = text != NULL ? strlen(text) : 0;

    return CRC32Update(0, text, length);
}

static RTS_RESULT describe(CANOPEN_SLAVE *slave)
{
    slave->send = send;
    slave->values = device.values;
    slave->values_size = number(CANOPEN_DEVICE_VALUES);
    slave->objects = table(CANOPEN_DEVICE_OBJECTS, sizeof(*slave->objects), &slave->object_count);
    slave->limits = table(CANOPEN_DEVICE_LIMITS, sizeof(*slave->limits), &slave->limit_count);
    slave->texts = bytes(CANOPEN_DEVICE_TEXTS, &slave->texts_size);
    slave->defaults[CANOPEN_RPDOS] =
        table(CANOPEN_DEVICE_RPDOS, sizeof(CANOPEN_PDO_SETTING), &slave->pdo_count[CANOPEN_RPDOS]);
    slave->defaults[CANOPEN_TPDOS] =
        table(CANOPEN_DEVICE_TPDOS, sizeof(CANOPEN_PDO_SETTING), &slave->pdo_count[CANOPEN_TPDOS]);
    slave->flags = number(CANOPEN_DEVICE_FLAGS);
    slave->first_node = (RTS_UI8)number(CANOPEN_DEVICE_NODE);
    slave->heartbeat_ms = (RTS_UI16)number(CANOPEN_DEVICE_HEARTBEAT);
    slave->serial = get_serial();
#if CANOPEN_PROGRAM_DOWNLOAD
    slave->program = program;
#endif
    if ((slave->flags & CANOPEN_DEVICE_DOWNLOAD) != 0 && program == NULL)
        return refuse("this firmware has no program download; leave out 'download'.");
    if (number(CANOPEN_DEVICE_NODE) > CANOPEN_MAX_NODE || number(CANOPEN_DEVICE_HEARTBEAT) > MAX_MS)
        return refuse("its node number or heartbeat cannot be.");
    if (slave->values_size > CANOPEN_DEVICE_DATA)
        return IoMgrConfigRefuse(device.connector, ERR_NOMEMORY, "this controller has room for %u bytes of objects.",
                                 (unsigned)CANOPEN_DEVICE_DATA);
    if (slave->pdo_count[CANOPEN_RPDOS] > CANOPEN_DEVICE_PDOS || slave->pdo_count[CANOPEN_TPDOS] > CANOPEN_DEVICE_PDOS)
        return IoMgrConfigRefuse(device.connector, ERR_NOMEMORY, "this controller has room for %u PDOs each way.",
                                 (unsigned)CANOPEN_DEVICE_PDOS);
    return ERR_OK;
}

static RTS_RESULT find_connector(void)
{
    const IoConfigConnector *connector;

    for (RTS_UI32 i = 0; (connector = IoMgrConfigGetConnector(i)) != NULL; i++) {
        if (!IoMgrConfigIsMine(connector, &driver))
            continue;
        if (device.connector != NULL) {
            RTS_RESULT result = IoMgrConfigRefuse(connector, ERR_DUPLICATE, "this controller can be one device only.");
            if (result != ERR_OK)
                return result;
            continue;
        }
        device.connector = connector;
    }
    return ERR_OK;
}

static RTS_UI8 *find_memory(RTS_UI32 parameter, RTS_UI32 *bits)
{
    if (parameter == CANOPEN_DEVICE_VALUE) {
        *bits = 8 * device.slave.values_size;
        return device.values;
    }
    *bits = parameter == CANOPEN_DEVICE_EMERGENCY ? 8 * sizeof(device.emergency) : 0;
    return device.emergency;
}

static RTS_RESULT check_channel(const IoConfigConnector *connector, const IoConfigChannelMap *channel, RTS_UI32 type)
{
    RTS_UI32 bits;

    (void)find_memory(channel->parameter, &bits);
    if (connector == device.connector && (channel->parameter_bit + channel->bits > bits ||
                                          (channel->parameter == CANOPEN_DEVICE_EMERGENCY && type != IO_MAP_OUTPUTS)))
        return refuse("a channel is not in its dictionary.");
    return ERR_OK;
}

/* Values that the network has not written are the initial ones of their variables. */
static RTS_RESULT follow(const IoConfigConnector *connector, const IoConfigChannelMap *channel, RTS_UI32 type)
{
    if (type != IO_MAP_INPUTS || connector != device.connector)
        return ERR_OK;
    RTS_UI32 lock = SysLockEnter();
    IoMgrCopyInputBackLE(channel, device.values);
    SysLockLeave(lock);
    return ERR_OK;
}

static void follow_inputs(void)
{
    (void)IoMgrConfigEachChannel(device.maps, device.map_count, &driver, follow);
}

static RTS_RESULT attach(void)
{
    device.user = (CAN_USER){.filters = filters,
                             .filter_count = RTS_COUNT(filters),
                             .take_urgent = take_urgent,
                             .take = take,
                             .note_bus = note_bus,
                             .reserves = is_reserved};
    device.is_running = true;
    RTS_RESULT result = CanAttach(device.network, &device.user);
    device.is_running = result == ERR_OK;
    if (result == ERR_OK)
        return ERR_OK;
    return IoMgrConfigRefuse(device.connector, result, "the CAN network %u cannot be opened.",
                             (unsigned)device.network);
}

static RTS_RESULT update_mapping(const IoConfigTaskMap *task_maps, int count)
{
    RTS_RESULT result = find_connector();

    if (result != ERR_OK || device.connector == NULL)
        return result;
    device.network = number(CANOPEN_DEVICE_NETWORK);
    device.maps = task_maps;
    device.map_count = count;
    result = describe(&device.slave);
    if (result == ERR_OK)
        result = IoMgrConfigEachChannel(task_maps, count, &driver, check_channel);
    if (result != ERR_OK || !IoMgrConfigIsMine(device.connector, &driver))
        return result;
    follow_inputs();
    if (!CanopenDeviceBegin(&device.slave, SysTimeGetMs()))
        return refuse("its dictionary is damaged, or has an object that is too large for this controller.");
    return IoMgrConfigIsMine(device.connector, &driver) ? attach() : result;
}

/* ---- tasks ---- */

static void copy_inputs(const IoConfigConnectorMap *map)
{
    const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(map);

    CanopenPdoUnpack(&device.slave);
    for (RTS_UI32 count = map->channel_map_count; count > 0 && device.slave.written != 0; count--, channel++)
        IoMgrCopyInputLE(channel, device.values);
}

static void copy_outputs(const IoConfigConnectorMap *map)
{
    const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(map);
    RTS_UI32 bits;

    for (RTS_UI32 count = map->channel_map_count; count > 0; count--, channel++)
        IoMgrCopyOutputLE(channel, find_memory(channel->parameter, &bits));
}

static RTS_RESULT copy_all(const IoConfigConnectorMap *maps, int count, bool is_output)
{
    RTS_UI32 lock = SysLockEnter();

    for (; count > 0 && device.is_running; count--, maps++) {
        if (IoMgrConfigGetConnector(maps->connector) != device.connector)
            continue;
        if (is_output)
            copy_outputs(maps);
        else
            copy_inputs(maps);
    }
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

static RTS_RESULT start_bus_cycle(const IoConfigConnector *connector)
{
    if (device.is_running && connector == device.connector)
        CanopenPdoSendChanged(&device.slave, SysTimeGetMs());
    return ERR_OK;
}

/* ---- main ---- */

static void report_emergency(void)
{
    RTS_UI32 lock = SysLockEnter();
    RTS_UI16 code = BytesGet16(device.emergency);
    SysLockLeave(lock);

    if (code == device.reported)
        return;
    device.reported = code;
    CanopenDeviceReport(&device.slave, CANOPEN_ERROR_PROGRAM, code);
}

static void report_collision(void)
{
    bool is_there = (device.slave.errors & CANOPEN_ERROR_COLLISION) != 0;

    if (is_there && !device.has_collision)
        LogAdd(CMPID_IoDrvCanopenDevice, LOG_WARNING, ERR_DUPLICATE, "Another CANopen device has number %u",
               (unsigned)device.slave.node);
    device.has_collision = is_there;
}

/* Inputs count while the network keeps the device in operation. */
static void note_state(void)
{
    bool is_operational = device.slave.state == NODE_OPERATIONAL;

    if (is_operational)
        IoMgrConfigNoteData(device.connector);
    else if (device.was_operational)
        IoMgrConfigSetDiagnosis(device.connector, CF_CONNECTOR_BUS_ERROR);
    device.was_operational = is_operational;
}

static void cycle(void)
{
    RTS_UI32 now_ms = SysTimeGetMs();

    if (device.slave.written == 0)
        follow_inputs();
    report_emergency();
    report_collision();
    CanopenDevicePoll(&device.slave, now_ms);
    note_state();
    SysTimeWantPass(CanopenDeviceGetWaitMs(&device.slave, now_ms));
}

RTS_I64 IoDrvCanopenDeviceGetDueNs(RTS_I64 now_ns)
{
    RTS_UI32 now_ms = (RTS_UI32)(now_ns / NS_PER_MS);
    RTS_UI32 wait_ms = device.is_running ? CanopenDeviceGetWaitMs(&device.slave, now_ms) : UINT32_MAX;

    return wait_ms == UINT32_MAX ? INT64_MAX : (now_ns / NS_PER_MS + wait_ms) * NS_PER_MS;
}

/* ---- the simulator ---- */

static void copy_bits(RTS_UI8 *to, RTS_UI32 to_bit, const RTS_UI8 *from, RTS_UI32 from_bit, RTS_UI32 bits)
{
    for (; bits > 0; bits--, to_bit++, from_bit++) {
        RTS_UI32 value = from[from_bit / 8] >> from_bit % 8 & 1u;
        to[to_bit / 8] = (RTS_UI8)((to[to_bit / 8] & ~(1u << to_bit % 8)) | value << to_bit % 8);
    }
}

static RTS_UI8 *find_bits(const IoConfigConnector *connector, RTS_UI32 parameter, RTS_UI32 bit, RTS_UI32 bits,
                          RTS_RESULT *result)
{
    RTS_UI32 room;
    RTS_UI8 *memory = find_memory(parameter, &room);

    *result = ERR_OK;
    if (!device.is_running || connector != device.connector || room == 0)
        *result = ERR_NOT_SUPPORTED;
    else if (bits > room || bit > room - bits)
        *result = ERR_OUT_OF_LIMITS;
    return memory;
}

RTS_RESULT IoDrvCanopenDeviceSet(const IoConfigConnector *connector, RTS_UI32 parameter, RTS_UI32 bit, RTS_UI32 bits,
                                 const RTS_UI8 *data)
{
    RTS_RESULT result;
    RTS_UI8 *memory = find_bits(connector, parameter, bit, bits, &result);

    if (result != ERR_OK)
        return result;
    if (device.slave.written == 0)
        follow_inputs();
    copy_bits(memory, bit, data, 0, bits);
    device.slave.written++;
    IoMgrConfigNoteData(connector); /* for the next cycle, which may come before the next pass of main */
    return ERR_OK;
}

RTS_RESULT IoDrvCanopenDeviceGet(const IoConfigConnector *connector, RTS_UI32 parameter, RTS_UI32 bit, RTS_UI32 bits,
                                 RTS_UI8 *data)
{
    RTS_RESULT result;
    const RTS_UI8 *memory = find_bits(connector, parameter, bit, bits, &result);

    if (result != ERR_OK)
        return result;
    memset(data, 0, (bits + 7) / 8);
    copy_bits(data, 0, memory, bit, bits);
    return ERR_OK;
}

/* ---- the program of this controller ---- */

RTS_UI8 IoDrvCanopenDeviceGetNode(RTS_UI32 network)
{
    return device.is_running && network == device.network ? device.slave.node : 0;
}

RTS_UI8 IoDrvCanopenDeviceGetState(void)
{
    return device.slave.state;
}

static RTS_UI32 access_object(const CANOPEN_OBJECT *object, bool is_write, RTS_UI8 *data, RTS_UI32 *size)
{
    if (is_write && object->where == CANOPEN_PROGRAM_OBJECT)
        return SDO_ABORT_STATE; /* no program replaces itself */
    if (is_write)
        return CanopenAccessWrite(&device.slave, object, data, *size, SysTimeGetMs());
    return object->size <= *size ? CanopenAccessRead(&device.slave, object, data, size) : SDO_ABORT_MEMORY;
}

RTS_UI32 IoDrvCanopenDeviceAccess(RTS_UI32 network, const CANOPEN_OBJECT *what, bool is_write, RTS_UI8 *data,
                                  RTS_UI32 *size)
{
    CANOPEN_OBJECT object;
    RTS_UI32 abort = SDO_ABORT_NO_DICTIONARY;

    if (device.is_running && network == device.network)
        abort = CanopenDictFind(&device.slave, what->index, what->sub, &object);
    if (abort == 0)
        abort = access_object(&object, is_write, data, size);
    if (abort != 0)
        *size = 0;
    return abort;
}

/* ---- requests from the PC ---- */

static RTS_RESULT read_parameter(const IoConfigConnector *connector, RTS_UI32 id, void *data, RTS_UI32 bits,
                                 RTS_UI32 bit_offset)
{
    CANOPEN_DEVICE_COUNTERS *counters = &device.slave.counters;
    RTS_UI32 index = id - CANOPEN_DEVICE_STATE;
    RTS_UI32 value;

    if (connector != device.connector || index >= sizeof(*counters) / sizeof(value))
        return ERR_NO_OBJECT;
    if (bit_offset != 0 || bits != 8 * sizeof(value))
        return ERR_PARAMETER;
    counters->state = device.slave.state;
    counters->node = device.slave.node;
    memcpy(&value, (const RTS_UI8 *)counters + index * sizeof(value), sizeof(value));
    memcpy(data, &value, sizeof(value));
    return ERR_OK;
}

static void reset(void)
{
    device.slave.written = 0;
}

static void explain_loss(const IoConfigConnector *connector, char *text, RTS_SIZE size)
{
    RTS_UNUSED(connector);
    CMUtlsnprintf(text, size, "%s",
                  device.slave.state == NODE_BOOTS ? "the network has reset it"
                                                   : "the network has taken it out of operation");
}

/* ---- life ---- */

static const ICmpIoDrv functions = {
    .IoDrvGetInfo = get_info,
    .IoDrvUpdateConfiguration = update_configuration,
    .IoDrvUpdateMapping = update_mapping,
    .IoDrvReadInputs = read_inputs,
    .IoDrvWriteOutputs = write_outputs,
    .IoDrvStartBusCycle = start_bus_cycle,
    .IoDrvReadParameter = read_parameter,
    .IoDrvReset = reset,
    .IoDrvExplainLoss = explain_loss,
};

RTS_RESULT IoDrvCanopenDevice_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT2) {
        CanopenStoreOpen();
        return IoMgrRegisterInstance(&driver);
    }
    if (hook == CH_COMM_CYCLE && device.is_running)
        cycle();
    else if (hook == CH_EXIT3)
        (void)update_configuration(NULL, 0);
    else if (hook == CH_EXIT2)
        (void)IoMgrUnregisterInstance(&driver);
    return ERR_OK;
}

#endif
