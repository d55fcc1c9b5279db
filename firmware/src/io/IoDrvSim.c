/*
 * IoDrvSim.c - driver of simulated devices, with faults that a test sets.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A device has what it measures and does (`device`), the driver what it received and is to send (`buffer`): between the
 * two is the wire, which may fail.
 */
#include "IoDrvSim.h"

#include <string.h>

#include "CmpIoMgrEmbedded.h"
#include "CmpLog.h"
#include "SysLock.h"
#include "SysTime.h"
#include "rts_config.h"

enum { LOST_AFTER = 3 /* bad answers in a row */ };

/* The memory of a parameter. */
typedef struct {
    RTS_UI32 parameter;
    RTS_UI16 connector;
    bool is_output;
    RTS_UI32 at; /* in `device` and `buffer` */
    RTS_UI32 size;
} BLOCK;

typedef struct {
    RTS_UI32 fault[IO_SIM_FAULTS]; /* by id - IO_SIM_ABSENT */
    RTS_UI32 bad;                  /* answers in a row */
    RTS_UI32 last_ms;              /* of the last exchange */
} DEVICE;

static struct {
    BLOCK block[IO_SIM_MAX_BLOCKS];
    RTS_UI32 blocks;
    DEVICE devices[IO_MAX_CONNECTORS > 0 ? IO_MAX_CONNECTORS : 1];
    RTS_UI8 device[IO_SIM_MEMORY];
    RTS_UI8 buffer[IO_SIM_MEMORY];
} sim;

static const ICmpIoDrv functions;
static IO_DRIVER sim_driver = {.functions = &functions};

static const IoDrvInfo *get_info(void)
{
    static const IoDrvInfo info = {"IoDrvSim", "Simulated device", "Open PLC runtime", 0x00010000};

    return &info;
}

static RTS_UI32 *fault_of(RTS_UI32 connector, RTS_UI32 id)
{
    return &sim.devices[connector].fault[id - IO_SIM_ABSENT];
}

static bool has_fault(RTS_UI32 connector)
{
    static const RTS_UI32 none[RTS_COUNT(sim.devices[0].fault)];

    return memcmp(sim.devices[connector].fault, none, sizeof none) != 0;
}

/* ---- the wire ---- */

static void transfer(RTS_UI32 connector)
{
    RTS_UI32 lock = SysLockEnter();
    RTS_UI32 i;

    for (i = 0; i < sim.blocks; i++) {
        const BLOCK *block = &sim.block[i];
        if (block->connector == connector)
            memcpy(block->is_output ? &sim.device[block->at] : &sim.buffer[block->at],
                   block->is_output ? &sim.buffer[block->at] : &sim.device[block->at], block->size);
    }
    SysLockLeave(lock);
    sim.devices[connector].last_ms = SysTimeGetMs();
    sim.devices[connector].bad = 0;
    IoMgrConfigNoteData(IoMgrConfigGetConnector(connector));
}

static void lose(RTS_UI32 connector, RTS_UI32 error, RTS_UI32 reset)
{
    const IoConfigConnector *place = IoMgrConfigGetConnector(connector);

    IoMgrConfigResetDiagnosis(place, reset);
    IoMgrConfigSetDiagnosis(place, error);
}

/* Whether this answer is bad; half of one is as bad as a damaged one. */
static bool take_bad(RTS_UI32 connector)
{
    RTS_UI32 *damaged = fault_of(connector, IO_SIM_ANSWERS);
    RTS_UI32 *left = *damaged != 0 ? damaged : fault_of(connector, IO_SIM_CUT);

    if (*left == 0)
        return false;
    --*left;
    return true;
}

/* One question and its answer. */
static void exchange(RTS_UI32 connector)
{
    DEVICE *device = &sim.devices[connector];

    if (*fault_of(connector, IO_SIM_ABSENT) != 0) {
        lose(connector, CF_CONNECTOR_BUS_ERROR, CF_CONNECTOR_FOUND | CF_CONNECTOR_ACTIVE);
    } else if (*fault_of(connector, IO_SIM_TYPE) != 0) {
        lose(connector, CF_CONNECTOR_FOUND | CF_CONNECTOR_ERROR, CF_CONNECTOR_CONFIGURED | CF_CONNECTOR_ACTIVE);
    } else if (take_bad(connector)) {
        if (++device->bad < LOST_AFTER)
            IoMgrConfigNoteError(IoMgrConfigGetConnector(connector));
        else
            lose(connector, CF_CONNECTOR_BUS_ERROR, 0);
    } else if (SysTimeGetMs() - device->last_ms >= *fault_of(connector, IO_SIM_LATE)) {
        transfer(connector);
    }
}

/* ---- configuration ---- */

static RTS_RESULT update_configuration(const IoConfigConnector *connectors, int count)
{
    RTS_UNUSED(connectors);
    RTS_UNUSED(count);
    memset(&sim, 0, sizeof sim);
    return ERR_OK;
}

static BLOCK *find_block(RTS_UI32 connector, RTS_UI32 parameter)
{
    RTS_UI32 i = 0;

    while (i < sim.blocks && (sim.block[i].connector != connector || sim.block[i].parameter != parameter))
        i++;
    return &sim.block[i];
}

/* Makes the block of a channel long enough. */
static RTS_RESULT add_channel(const IoConfigConnector *connector, const IoConfigChannelMap *channel, RTS_UI32 type)
{
    RTS_UI32 index = IoMgrConfigGetIndex(connector);
    BLOCK *block = find_block(index, channel->parameter);
    RTS_UI32 size = (channel->parameter_bit + channel->bits + 7) / 8;

    if (size > IO_SIM_MEMORY || block == sim.block + IO_SIM_MAX_BLOCKS)
        return IoMgrConfigRefuse(connector, ERR_NOMEMORY, "simulated devices are small here.");
    if (block == sim.block + sim.blocks) {
        block->connector = (RTS_UI16)index;
        block->parameter = channel->parameter;
        block->is_output = type == IO_MAP_OUTPUTS;
        sim.blocks++;
    }
    if (block->size < size)
        block->size = size;
    return ERR_OK;
}

/* A block for which there is no room has none. */
static RTS_RESULT place_blocks(void)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 used = 0;
    BLOCK *block;

    for (block = sim.block; result == ERR_OK && block < sim.block + sim.blocks; block++) {
        block->at = used;
        if (block->size > IO_SIM_MEMORY - used) {
            block->size = 0;
            result = IoMgrConfigRefuse(IoMgrConfigGetConnector(block->connector), ERR_NOMEMORY,
                                       "all simulated devices together have %u bytes here.", (unsigned)IO_SIM_MEMORY);
        }
        used += block->size;
    }
    return result;
}

static RTS_RESULT update_mapping(const IoConfigTaskMap *task_maps, int count)
{
    RTS_RESULT result = IoMgrConfigEachChannel(task_maps, count, &sim_driver, add_channel);
    const IoConfigConnector *connector;
    RTS_UI32 i;

    if (result == ERR_OK)
        result = place_blocks();
    for (i = 0; result == ERR_OK && (connector = IoMgrConfigGetConnector(i)) != NULL; i++) {
        if (IoMgrConfigIsMine(connector, &sim_driver))
            transfer(i);
    }
    return result;
}

/* ---- cycles ---- */

/* Devices without fault answer at once. */
static void transfer_all(const IoConfigConnectorMap *maps, int count)
{
    for (; count > 0; count--, maps++) {
        if (!has_fault(maps->connector))
            transfer(maps->connector);
    }
}

typedef void (*PF_COPY)(const IoConfigChannelMap *channel, RTS_UI8 *memory);

static void copy_input(const IoConfigChannelMap *channel, RTS_UI8 *memory)
{
    IoMgrCopyInputLE(channel, memory);
}

static void copy_output(const IoConfigChannelMap *channel, RTS_UI8 *memory)
{
    IoMgrCopyOutputLE(channel, memory);
}

static void copy_all(const IoConfigConnectorMap *maps, int count, PF_COPY copy)
{
    RTS_UI32 lock = SysLockEnter();

    for (; count > 0; count--, maps++) {
        const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(maps);
        RTS_UI32 channels = maps->channel_map_count;
        for (; channels > 0; channels--, channel++)
            copy(channel, &sim.buffer[find_block(maps->connector, channel->parameter)->at]);
    }
    SysLockLeave(lock);
}

static RTS_RESULT read_inputs(const IoConfigConnectorMap *maps, int count)
{
    transfer_all(maps, count);
    copy_all(maps, count, copy_input);
    return ERR_OK;
}

static RTS_RESULT write_outputs(const IoConfigConnectorMap *maps, int count)
{
    copy_all(maps, count, copy_output);
    transfer_all(maps, count);
    return ERR_OK;
}

static bool is_on(const IoConfigConnector *connector, RTS_UI32 bus)
{
    while (IoMgrConfigGetIndex(connector) != bus && connector->parent != IO_CONFIG_NONE)
        connector = IoMgrConfigGetConnector(connector->parent);
    return IoMgrConfigGetIndex(connector) == bus;
}

static RTS_RESULT start_bus_cycle(const IoConfigConnector *bus)
{
    const IoConfigConnector *connector;
    RTS_UI32 i;

    for (i = 0; (connector = IoMgrConfigGetConnector(i)) != NULL; i++) {
        if (IoMgrConfigIsMine(connector, &sim_driver) && is_on(connector, IoMgrConfigGetIndex(bus)))
            exchange(i);
    }
    return ERR_OK;
}

/* ---- requests ---- */

static RTS_RESULT identify(const IoConfigConnector *connector)
{
    LogAdd(CMPID_IoDrvSim, LOG_INFO, ERR_OK, "%s blinks", IoMgrConfigGetName(connector));
    return *fault_of(IoMgrConfigGetIndex(connector), IO_SIM_ABSENT) != 0 ? ERR_TIMEOUT : ERR_OK;
}

/* The devices of the description that are there. */
static RTS_RESULT scan(const IoConfigConnector *bus, RTS_UI32 index, IoDrvModule *module)
{
    const IoConfigConnector *child;
    RTS_UI32 i;

    for (i = 0; (child = IoMgrConfigGetConnector(i)) != NULL; i++) {
        if (child->parent != IoMgrConfigGetIndex(bus) || *fault_of(i, IO_SIM_ABSENT) != 0 || index-- > 0)
            continue;
        module->product = child->type;
        module->slot = i;
        memcpy(module->name, IoMgrConfigGetName(child), strlen(IoMgrConfigGetName(child)) + 1);
        return ERR_OK;
    }
    return ERR_NO_OBJECT;
}

RTS_STATIC_ASSERT((int)IO_MODULE_NAME_SIZE >= (int)IO_CONFIG_MAX_NAME, names_of_connectors_fit);

/* The memory of a parameter or fault; NULL with the reason in *result. */
static RTS_UI8 *find_memory(const IoConfigConnector *connector, RTS_UI32 id, RTS_UI32 bits, RTS_UI32 bit_offset,
                            RTS_RESULT *result)
{
    RTS_UI32 index = IoMgrConfigGetIndex(connector);
    BLOCK *block = find_block(index, id);
    bool is_fault = id - IO_SIM_ABSENT < IO_SIM_FAULTS;
    RTS_UI32 size = sizeof(RTS_UI32);

    *result = ERR_NO_OBJECT;
    if (!is_fault && block == sim.block + sim.blocks)
        return NULL;
    if (!is_fault)
        size = block->size;
    *result = ERR_OUT_OF_LIMITS;
    if (bits > 8 * size || bit_offset > 8 * size - bits)
        return NULL;
    *result = ERR_OK;
    return is_fault ? (RTS_UI8 *)fault_of(index, id) : &sim.device[block->at];
}

static void copy_bits(RTS_UI8 *to, RTS_UI32 to_bit, const RTS_UI8 *from, RTS_UI32 from_bit, RTS_UI32 bits)
{
    for (; bits > 0; bits--, to_bit++, from_bit++) {
        RTS_UI8 mask = (RTS_UI8)(1u << (to_bit & 7));
        bool value = (from[from_bit >> 3] >> (from_bit & 7) & 1) != 0;
        to[to_bit >> 3] = (RTS_UI8)(value ? to[to_bit >> 3] | mask : to[to_bit >> 3] & ~mask);
    }
}

static RTS_RESULT read_parameter(const IoConfigConnector *connector, RTS_UI32 id, void *data, RTS_UI32 bits,
                                 RTS_UI32 bit_offset)
{
    RTS_RESULT result;
    const RTS_UI8 *memory = find_memory(connector, id, bits, bit_offset, &result);

    if (memory != NULL) {
        memset(data, 0, (bits + 7) / 8);
        copy_bits(data, 0, memory, bit_offset, bits);
    }
    return result;
}

static RTS_RESULT write_parameter(const IoConfigConnector *connector, RTS_UI32 id, const void *data, RTS_UI32 bits,
                                  RTS_UI32 bit_offset)
{
    RTS_RESULT result;
    RTS_UI8 *memory = find_memory(connector, id, bits, bit_offset, &result);
    RTS_UI32 lock = SysLockEnter();

    if (memory != NULL)
        copy_bits(memory, bit_offset, data, 0, bits);
    SysLockLeave(lock);
    return result;
}

#if ONLINE_CHANGE
/* Devices and their channels are known by number. */
static void follow_configuration(const IoConfigTaskMap *task_maps, int count)
{
    RTS_UNUSED(task_maps);
    RTS_UNUSED(count);
}
#endif

static const ICmpIoDrv functions = {
    .IoDrvGetInfo = get_info,
    .IoDrvUpdateConfiguration = update_configuration,
    .IoDrvUpdateMapping = update_mapping,
    .IoDrvReadInputs = read_inputs,
    .IoDrvWriteOutputs = write_outputs,
    .IoDrvStartBusCycle = start_bus_cycle,
    .IoDrvIdentify = identify,
    .IoDrvScanModules = scan,
    .IoDrvReadParameter = read_parameter,
    .IoDrvWriteParameter = write_parameter,
#if ONLINE_CHANGE
    .IoDrvFollowConfiguration = follow_configuration,
#endif
};

RTS_RESULT IoDrvSim_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(sim);
    if (hook == CH_INIT2)
        return IoMgrRegisterInstance(&sim_driver);
    return hook == CH_EXIT2 ? IoMgrUnregisterInstance(&sim_driver) : (RTS_RESULT)ERR_OK;
}
