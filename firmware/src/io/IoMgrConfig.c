/*
 * IoMgrConfig.c - the I/O configuration of the loaded application, and copies of its channels.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IoMgrConfig.h"

#include <string.h>

#include "CmpChecksum.h"
#include "IecCycle.h"
#include "IoTables.h"

static const IO_CONFIG no_config;

static IO_TABLES tables;

/* ---- for the manager ---- */

static const IoConfigParameter *get_parameters(void)
{
    return IoTablesParametersOf(&tables);
}

const IoConfigTaskMap *IoTablesGetTaskMaps(void)
{
    return (const IoConfigTaskMap *)(get_parameters() + tables.head->parameters);
}

const IO_TABLES *IoTablesGet(void)
{
    return &tables;
}

void IoTablesSet(const IO_CONFIG *config, const IEC_CONTEXT *context)
{
    IO_TABLES_FIND(tables, config != NULL ? config : &no_config, IoTablesGetTaskMaps());
    tables.areas = context != NULL ? context->area : NULL;
}

RTS_UI32 IoTablesCountConnectors(void)
{
    return tables.head->connectors;
}

RTS_UI32 IoTablesCountTaskMaps(void)
{
    return tables.head->task_maps;
}

static const char *get_text(RTS_UI32 offset)
{
    return (const char *)tables.data + offset;
}

IO_DEVICE_STATE *IoTablesGetState(RTS_UI32 offset)
{
    return (IO_DEVICE_STATE *)(void *)(tables.areas[APP_AREA_DATA] + offset);
}

/* ---- connectors ---- */

/* Moves to the first connector from `connector` on, of *count, that has the type, or with `by_parent` the parent. */
static const IoConfigConnector *find(const IoConfigConnector *connector, int *count, bool by_parent, RTS_UI32 wanted)
{
    for (; *count > 0; connector++, --*count) {
        if ((by_parent ? connector->parent : connector->type) == wanted)
            return connector;
    }
    return NULL;
}

const IoConfigConnector *IoMgrConfigGetFirstConnector(const IoConfigConnector *connectors, int *count, RTS_UI16 type)
{
    return find(connectors, count, false, type);
}

const IoConfigConnector *IoMgrConfigGetNextConnector(const IoConfigConnector *connector, int *count, RTS_UI16 type)
{
    --*count;
    return find(connector + 1, count, false, type);
}

const IoConfigConnector *IoMgrConfigGetFirstChild(const IoConfigConnector *connectors, int *count,
                                                  const IoConfigConnector *parent)
{
    return find(connectors, count, true, IoMgrConfigGetIndex(parent));
}

const IoConfigConnector *IoMgrConfigGetNextChild(const IoConfigConnector *connector, int *count,
                                                 const IoConfigConnector *parent)
{
    --*count;
    return find(connector + 1, count, true, IoMgrConfigGetIndex(parent));
}

RTS_NOINLINE RTS_UI32 IoMgrConfigGetIndex(const IoConfigConnector *connector)
{
    return (RTS_UI32)(connector - tables.connectors);
}

const IoConfigConnector *IoMgrConfigGetConnector(RTS_UI32 index)
{
    return index < IoTablesCountConnectors() ? &tables.connectors[index] : NULL;
}

const char *IoMgrConfigGetName(const IoConfigConnector *connector)
{
    return get_text(connector->name);
}

const char *IoMgrConfigGetDriverName(const IoConfigConnector *connector)
{
    return get_text(connector->driver);
}

/* ---- parameters ---- */

const IoConfigParameter *IoMgrConfigGetParameter(const IoConfigConnector *connector, RTS_UI32 id)
{
    const IoConfigParameter *parameter = get_parameters() + connector->first_parameter;
    const IoConfigParameter *end = parameter + connector->parameter_count;

    while (parameter < end && parameter->id < id)
        parameter++;
    return parameter < end && parameter->id == id ? parameter : NULL;
}

static RTS_UI32 get_value(const IoConfigParameter *parameter, RTS_UI32 bits, RTS_RESULT *result)
{
    bool known = parameter != NULL && (parameter->flags & PVF_POINTER) == 0 && parameter->bits <= bits;

    if (result != NULL)
        *result = known ? ERR_OK : ERR_PARAMETER;
    return known ? parameter->value : 0;
}

RTS_UI32 IoMgrConfigGetParameterValueDword(const IoConfigParameter *parameter, RTS_RESULT *result)
{
    return get_value(parameter, 32, result);
}

RTS_UI16 IoMgrConfigGetParameterValueWord(const IoConfigParameter *parameter, RTS_RESULT *result)
{
    return (RTS_UI16)get_value(parameter, 16, result);
}

RTS_UI8 IoMgrConfigGetParameterValueByte(const IoConfigParameter *parameter, RTS_RESULT *result)
{
    return (RTS_UI8)get_value(parameter, 8, result);
}

const void *IoMgrConfigGetParameterValuePointer(const IoConfigParameter *parameter, RTS_RESULT *result)
{
    bool known = parameter != NULL && (parameter->flags & PVF_POINTER) != 0;

    if (result != NULL)
        *result = known ? ERR_OK : ERR_PARAMETER;
    return known ? get_text(parameter->value) : NULL;
}

const char *IoMgrConfigGetParameterValueText(const IoConfigParameter *parameter)
{
    const char *text = IoMgrConfigGetParameterValuePointer(parameter, NULL);
    RTS_UI32 size = parameter != NULL ? parameter->bits / 8 : 0;

    return text != NULL && size > 0 && text[size - 1] == '\0' ? text : NULL;
}

/* Where a value is does not count. */
RTS_UI32 IoMgrConfigGetCrc(const IoConfigConnector *connector)
{
    const IoConfigParameter *parameter = get_parameters() + connector->first_parameter;
    RTS_UI32 crc = 0;
    RTS_UI32 left;

    for (left = connector->parameter_count; left > 0; left--, parameter++) {
        bool is_pointer = (parameter->flags & PVF_POINTER) != 0;
        crc = CRC32Update(crc, parameter, offsetof(IoConfigParameter, value));
        crc = CRC32Update(crc, is_pointer ? get_text(parameter->value) : (const void *)&parameter->value,
                          is_pointer ? (parameter->bits + 7) / 8 : sizeof parameter->value);
    }
    return crc;
}

/* ---- maps ---- */

const IoConfigConnectorMap *IoMgrConfigGetConnectorMaps(const IoConfigTaskMap *map)
{
    return tables.connector_maps + map->first_connector_map;
}

const IoConfigChannelMap *IoMgrConfigGetChannelMaps(const IoConfigConnectorMap *map)
{
    return tables.channel_maps + map->first_channel_map;
}

/* ---- copies ---- */

/* Inlined, but for bytes: a bit is a few instructions, and there may be many. */
static RTS_NOINLINE void copy_bytes(const IoConfigChannelMap *channel, RTS_UI8 *to, RTS_UI32 to_bit,
                                    const RTS_UI8 *from, RTS_UI32 from_bit, RTS_UI32 turned)
{
    RTS_UI32 size = channel->bits >> 3;

    to += to_bit >> 3;
    from += from_bit >> 3;
    if ((channel->flags & IO_CHANNEL_BIG_ENDIAN) == turned) {
        memcpy(to, from, size);
    } else {
        while (size > 0)
            *to++ = from[--size];
    }
}

/* Within one byte on both sides. */
static RTS_INLINE void copy_bits(RTS_UI8 *to, RTS_UI32 to_bit, const RTS_UI8 *from, RTS_UI32 from_bit, RTS_UI32 bits)
{
    RTS_UI32 mask = ((1u << bits) - 1) << (to_bit & 7);
    RTS_UI32 value = (RTS_UI32)from[from_bit >> 3] >> (from_bit & 7) << (to_bit & 7);

    to += to_bit >> 3;
    *to = (RTS_UI8)((*to & ~mask) | (value & mask));
}

/* Eight bits or more are whole bytes on both sides (IoConfigChannelMap). */
static RTS_INLINE void copy(const IoConfigChannelMap *channel, RTS_UI8 *to, RTS_UI32 to_bit, const RTS_UI8 *from,
                            RTS_UI32 from_bit, RTS_UI32 turned)
{
    RTS_UI32 bits = channel->bits;

    if (bits < 8)
        copy_bits(to, to_bit, from, from_bit, bits);
    else
        copy_bytes(channel, to, to_bit, from, from_bit, turned);
}

static RTS_INLINE void copy_input(const IoConfigChannelMap *channel, const void *memory, RTS_UI32 turned)
{
    copy(channel, tables.areas[APP_AREA_INPUT], channel->area_bit, memory, channel->parameter_bit, turned);
}

/* Gives a channel a number of 32 bits, extended by zeros, or its lowest bits; `turned`: the highest byte first. */
static RTS_NOINLINE void set(const IoConfigChannelMap *channel, RTS_UI8 *to, RTS_UI32 at, RTS_UI32 value, bool turned)
{
    RTS_UI32 size = channel->bits >> 3;
    RTS_UI8 byte = (RTS_UI8)value;
    RTS_UI32 i;

    if (channel->bits < 8) {
        copy_bits(to, at, &byte, 0, channel->bits);
        return;
    }
    to += at >> 3;
    for (i = 0; i < size; i++, value >>= 8)
        to[turned ? size - 1 - i : i] = (RTS_UI8)value;
}

/* In the safe state a device gets what the configuration says, and the variables stay as they are. */
static RTS_NOINLINE void copy_safe(const IoConfigChannelMap *channel, void *memory, RTS_UI32 turned)
{
    RTS_UI32 what = channel->flags & IO_CHANNEL_ON_STOP;

    if (what != IO_HOLD)
        set(channel, memory, channel->parameter_bit, what == IO_VALUE ? channel->value : 0,
            (channel->flags & IO_CHANNEL_BIG_ENDIAN) != turned);
}

static RTS_INLINE void copy_output(const IoConfigChannelMap *channel, void *memory, RTS_UI32 turned)
{
    if (!IecCycleMayStart()) {
        copy_safe(channel, memory, turned);
        return;
    }
    copy(channel, memory, channel->parameter_bit, tables.areas[APP_AREA_OUTPUT], channel->area_bit, turned);
}

void IoMgrCopyInputLE(const IoConfigChannelMap *channel, const void *memory)
{
    copy_input(channel, memory, 0);
}

void IoMgrCopyInputBE(const IoConfigChannelMap *channel, const void *memory)
{
    copy_input(channel, memory, IO_CHANNEL_BIG_ENDIAN);
}

void IoMgrCopyInputBackLE(const IoConfigChannelMap *channel, void *memory)
{
    copy(channel, memory, channel->parameter_bit, tables.areas[APP_AREA_INPUT], channel->area_bit, 0);
}

void IoMgrCopyOutputLE(const IoConfigChannelMap *channel, void *memory)
{
    copy_output(channel, memory, 0);
}

void IoMgrCopyOutputBE(const IoConfigChannelMap *channel, void *memory)
{
    copy_output(channel, memory, IO_CHANNEL_BIG_ENDIAN);
}

void IoMgrCopySafeOutputLE(const IoConfigChannelMap *channel, void *memory)
{
    copy_safe(channel, memory, 0);
}

void IoMgrCopyInputs(const IoConfigChannelMap *channel, RTS_UI32 count, const void *memory)
{
    RTS_UI8 *area = tables.areas[APP_AREA_INPUT];

    if (count == 0)
        return;
    do {
        copy(channel, area, channel->area_bit, memory, channel->parameter_bit, 0);
        channel++;
    } while (--count > 0);
}

void IoMgrCopyOutputs(const IoConfigChannelMap *channel, RTS_UI32 count, void *memory)
{
    const RTS_UI8 *area = tables.areas[APP_AREA_OUTPUT];
    bool is_safe = !IecCycleMayStart();

    if (count == 0)
        return;
    do {
        if (is_safe)
            copy_safe(channel, memory, 0);
        else
            copy(channel, memory, channel->parameter_bit, area, channel->area_bit, 0);
        channel++;
    } while (--count > 0);
}

void IoTablesSetInput(const IoConfigChannelMap *channel, RTS_UI32 value)
{
    set(channel, tables.areas[APP_AREA_INPUT], channel->area_bit, value, false);
}
