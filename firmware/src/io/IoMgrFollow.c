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

/* What is looked for: the bits of a channel from `bit` on. */
typedef struct {
    const IO_TABLES *tables;
    CHANNEL channel;
    RTS_UI32 bit;
} SEARCH;

/* Calls `handle` with the channels of a configuration, until it returns false; returns false then. */
static bool for_channels(const IO_TABLES *tables, bool (*handle)(SEARCH *search, const CHANNEL *channel),
                         SEARCH *search)
{
    const IoConfigTaskMap *task = IoTablesTaskMapsOf(tables);
    const IoConfigTaskMap *end = task + tables->head->task_maps;

    for (; task < end; task++) {
        const IoConfigConnectorMap *map = tables->connector_maps + task->first_connector_map;
        RTS_UI32 maps = task->connector_map_count;
        for (; maps > 0; maps--, map++) {
            CHANNEL channel = {tables->channel_maps + map->first_channel_map, map->connector, task->type};
            RTS_UI32 left = map->channel_map_count;
            for (; left > 0; left--, channel.map++) {
                if (!handle(search, &channel))
                    return false;
            }
        }
    }
    return true;
}

/* False if a channel has the bit that is looked for, at the same place: the next one is looked for then. */
static bool misses(SEARCH *search, const CHANNEL *channel)
{
    const IoConfigChannelMap *map = channel->map;
    const IoConfigChannelMap *wanted = search->channel.map;

    if (channel->connector != search->channel.connector || channel->type != search->channel.type ||
        map->parameter != wanted->parameter || map->flags != wanted->flags ||
        search->bit - map->parameter_bit >= map->bits ||
        map->area_bit - map->parameter_bit != wanted->area_bit - wanted->parameter_bit)
        return true;
    search->bit = map->parameter_bit + map->bits;
    return false;
}

/* True if each bit of a channel is one of a channel in the tables: neighbours may be one channel there. */
static bool has_channel(SEARCH *search, const CHANNEL *channel)
{
    search->channel = *channel;
    search->bit = channel->map->parameter_bit;
    do {
        if (for_channels(search->tables, misses, search))
            return false;
    } while (search->bit - channel->map->parameter_bit < channel->map->bits);
    return true;
}

bool IoTablesCanFollow(const IO_CONFIG *config)
{
    const IO_TABLES *loaded = IoTablesGet();
    SEARCH search = {.tables = loaded};
    IO_TABLES other;

    IO_TABLES_FIND(other, config, IoTablesTaskMapsOf(&other));
    return has_same_devices(loaded, &other) && for_channels(&other, has_channel, &search);
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
