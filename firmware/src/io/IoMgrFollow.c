/*
 * IoMgrFollow.c - an online change: the same I/O configuration, at another place in memory.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Drivers know connectors, parameters and channels, and have checked them. So both configurations must have the same
 * connectors with the same parameters. Which task uses which channels may differ, and so may the bus cycle tasks and the
 * places of the variables that follow devices.
 */
#include "IoMgrFollow.h"

#if ONLINE_CHANGE

#include <string.h>

#include "IoFollow.h"
#include "IoTables.h"

/* What drivers have pointers into. */
typedef struct {
    const void *from;
    const void *to;
    RTS_SIZE size;
} PART;

static struct {
    PART devices; /* connectors and parameters */
    PART data;
} moved;

/* ---- comparing ---- */

static bool is_same_connector(const IoConfigConnector *a, const IoConfigConnector *b)
{
    IoConfigConnector other = *b;

    other.state = a->state;
    other.bus_task = a->bus_task;
    return memcmp(a, &other, sizeof other) == 0;
}

static bool has_same_devices(const IO_TABLES *a, const IO_TABLES *b)
{
    RTS_UI32 i;

    if (a->head->connectors != b->head->connectors || a->head->parameters != b->head->parameters ||
        a->head->data_size != b->head->data_size || a->head->board != b->head->board)
        return false;
    for (i = 0; i < a->head->connectors; i++) {
        if (!is_same_connector(&a->connectors[i], &b->connectors[i]))
            return false;
    }
    return memcmp(IoTablesParametersOf(a), IoTablesParametersOf(b), a->head->parameters * sizeof(IoConfigParameter)) ==
               0 &&
           memcmp(a->data, b->data, a->head->data_size) == 0;
}

/* A channel of a connector: type is IO_MAP_*. */
typedef struct {
    const IoConfigChannelMap *map;
    RTS_UI32 connector;
    RTS_UI32 type;
} CHANNEL;

/* Returns the end of the bits from `bit` on that a channel of a map has as well, at the same place; `bit`: none. */
static RTS_UI32 find_end(const IoConfigChannelMap *map, RTS_UI32 count, const IoConfigChannelMap *wanted, RTS_UI32 bit)
{
    for (; count > 0; count--, map++) {
        if (map->parameter == wanted->parameter && map->flags == wanted->flags &&
            bit - map->parameter_bit < map->bits &&
            map->area_bit - map->parameter_bit == wanted->area_bit - wanted->parameter_bit)
            return map->parameter_bit + map->bits;
    }
    return bit;
}

static RTS_UI32 find_end_in(const IO_TABLES *tables, const CHANNEL *wanted, RTS_UI32 bit)
{
    const IoConfigTaskMap *task = IoTablesTaskMapsOf(tables);
    const IoConfigTaskMap *end = task + tables->head->task_maps;
    RTS_UI32 found = bit;

    for (; task < end && found == bit; task++) {
        const IoConfigConnectorMap *map = tables->connector_maps + task->first_connector_map;
        RTS_UI32 left = task->type == wanted->type ? task->connector_map_count : 0;
        for (; left > 0 && found == bit; left--, map++) {
            if (map->connector == wanted->connector)
                found =
                    find_end(tables->channel_maps + map->first_channel_map, map->channel_map_count, wanted->map, bit);
        }
    }
    return found;
}

/* True if each bit of a channel is one of a channel in `tables`: neighbours may be one channel there. */
static bool has_channel(const IO_TABLES *tables, const CHANNEL *channel)
{
    RTS_UI32 bit = channel->map->parameter_bit;
    RTS_UI32 end = bit + channel->map->bits;
    RTS_UI32 next = bit;

    do {
        bit = next;
        next = find_end_in(tables, channel, bit);
    } while (next != bit && next < end);
    return next != bit;
}

static bool has_all_channels(const IO_TABLES *tables, const IO_TABLES *wanted)
{
    const IoConfigTaskMap *task = IoTablesTaskMapsOf(wanted);
    const IoConfigTaskMap *end = task + wanted->head->task_maps;

    for (; task < end; task++) {
        const IoConfigConnectorMap *map = wanted->connector_maps + task->first_connector_map;
        RTS_UI32 maps = task->connector_map_count;
        for (; maps > 0; maps--, map++) {
            CHANNEL channel = {wanted->channel_maps + map->first_channel_map, map->connector, task->type};
            RTS_UI32 left = map->channel_map_count;
            for (; left > 0; left--, channel.map++) {
                if (!has_channel(tables, &channel))
                    return false;
            }
        }
    }
    return true;
}

static RTS_SIZE size_of(const IO_TABLES *tables)
{
    return (RTS_SIZE)(tables->data + tables->head->data_size - (const RTS_UI8 *)tables->head);
}

/* Most changes leave all as it is: comparing channels takes longer. */
static bool is_same(const IO_TABLES *a, const IO_TABLES *b)
{
    return size_of(a) == size_of(b) && memcmp(a->head, b->head, size_of(a)) == 0;
}

bool IoTablesCanFollow(const IO_CONFIG *config)
{
    const IO_TABLES *loaded = IoTablesGet();
    IO_TABLES other;

    IO_TABLES_FIND(other, config, IoTablesTaskMapsOf(&other));
    return is_same(loaded, &other) || (has_same_devices(loaded, &other) && has_all_channels(loaded, &other));
}

/* ---- following ---- */

void IoTablesFollow(const IO_CONFIG *config, const IEC_CONTEXT *context)
{
    const IO_TABLES *loaded = IoTablesGet();

    moved.devices.size = (RTS_SIZE)((const RTS_UI8 *)IoTablesTaskMapsOf(loaded) - (const RTS_UI8 *)loaded->connectors);
    moved.devices.from = loaded->connectors;
    moved.data.size = loaded->head->data_size;
    moved.data.from = loaded->data;
    IoTablesSet(config, context);
    moved.devices.to = loaded->connectors;
    moved.data.to = loaded->data;
}

static bool is_in(const PART *part, const void *place)
{
    return (uintptr_t)place - (uintptr_t)part->from < part->size;
}

static const void *lead(const PART *part, const void *place)
{
    return (const RTS_UI8 *)part->to + ((const RTS_UI8 *)place - (const RTS_UI8 *)part->from);
}

const void *IoMgrConfigFollow(const void *place)
{
    if (is_in(&moved.devices, place))
        return lead(&moved.devices, place);
    return is_in(&moved.data, place) ? lead(&moved.data, place) : place;
}

#endif
