/*
 * IoConfigCheck.c - checks the I/O configuration of an image, entry by entry.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * After it no index, offset or length of the configuration leads out of it, or out of an area: those who read it check
 * none. What an entry has of the next table begins where that of the entry before it ended, so that every entry is checked
 * once, together with the one that has it.
 */
#include "IoConfigCheck.h"

#include "AppIo.h"
#include "SysTarget.h"

#if IO_MAX_CONNECTORS > 0

#include <string.h>

enum { CONNECTORS, PARAMETERS, TASK_MAPS, CONNECTOR_MAPS, CHANNEL_MAPS, TABLES };

typedef struct {
    LOADER *l;
    RTS_UI32 at[TABLES + 1]; /* where the tables are in the image, and then the data */
    RTS_UI16 count[TABLES];
    RTS_UI16 next[TABLES]; /* entry that is read next */
    RTS_UI32 data_size;
    RTS_UI32 maps_seen;              /* a bit for each task and type */
    char name[IO_CONFIG_MAX_NAME];   /* of the connector */
    char driver[IO_CONFIG_MAX_NAME]; /* that it names */
} IO_CHECK;

static const RTS_UI8 entry_size[TABLES] = {
    sizeof(IoConfigConnector),    sizeof(IoConfigParameter),  sizeof(IoConfigTaskMap),
    sizeof(IoConfigConnectorMap), sizeof(IoConfigChannelMap),
};

/* A compiler never writes such a configuration: which entry says enough. Table TABLES is the head, or where it is. */
static RTS_RESULT refuse_damaged(LOADER *l, RTS_RESULT result, RTS_UI32 table, RTS_UI32 entry)
{
    return refuse(l, result, "The I/O configuration is damaged (table %u, entry %u): build again.", U(table), U(entry));
}

static RTS_RESULT damaged(const IO_CHECK *c, RTS_UI32 table)
{
    return refuse_damaged(c->l, ERR_INVALID_REFERENCE, table, c->next[table] - 1u);
}

static RTS_RESULT read_next(IO_CHECK *c, RTS_UI32 table, void *entry)
{
    RTS_UI32 size = entry_size[table];

    return LoaderRead(c->l, c->at[table] + size * c->next[table]++, entry, size);
}

/* Whether an entry has `count` of those of `table` that come next. */
static bool has_next(const IO_CHECK *c, RTS_UI32 table, RTS_UI32 first, RTS_UI32 count)
{
    return first == c->next[table] && count <= (RTS_UI32)c->count[table] - first;
}

/* Has that many entries of a table checked, which are there. */
static RTS_RESULT check_entries(IO_CHECK *c, RTS_UI32 count, RTS_RESULT (*check_entry)(IO_CHECK *c))
{
    RTS_RESULT result = ERR_OK;

    for (; count > 0 && result == ERR_OK; count--)
        result = check_entry(c);
    return result;
}

/* ---- connectors and their parameters ---- */

/* Reads a name; false when there is none. */
static bool read_name(const IO_CHECK *c, RTS_UI32 offset, char *name)
{
    RTS_UI32 size = IO_CONFIG_MAX_NAME;

    if (offset >= c->data_size)
        return false;
    if (size > c->data_size - offset)
        size = c->data_size - offset;
    return LoaderRead(c->l, c->at[TABLES] + offset, name, size) == ERR_OK && name[0] != '\0' &&
           memchr(name, '\0', size) != NULL;
}

static bool is_value(const IO_CHECK *c, const IoConfigParameter *parameter)
{
    RTS_UI32 size = parameter->bits / 8 + (parameter->bits % 8 != 0);

    if (parameter->flags == 0)
        return parameter->bits <= 32;
    return parameter->flags == PVF_POINTER && parameter->value % 4 == 0 && parameter->value <= c->data_size &&
           size <= c->data_size - parameter->value;
}

static RTS_RESULT check_parameters(IO_CHECK *c, RTS_UI32 count)
{
    RTS_UI32 least = 0; /* id, as they ascend */

    for (; count > 0; count--) {
        IoConfigParameter parameter;
        RTS_RESULT result = read_next(c, PARAMETERS, &parameter);
        if (result != ERR_OK)
            return result;
        if (parameter.id < least || parameter.id == 0xFFFFFFFFu || !is_value(c, &parameter))
            return damaged(c, PARAMETERS);
        least = parameter.id + 1;
    }
    return ERR_OK;
}

static bool is_place_of_state(const IO_CHECK *c, RTS_UI32 offset)
{
    RTS_UI32 size = c->l->image->area_size[APP_AREA_DATA];

    return offset == IO_CONFIG_NOWHERE ||
           (offset % 4 == 0 && size >= sizeof(IO_DEVICE_STATE) && offset <= size - sizeof(IO_DEVICE_STATE));
}

static bool is_connector(IO_CHECK *c, const IoConfigConnector *connector)
{
    RTS_UI32 index = c->next[CONNECTORS] - 1u;

    return (connector->parent < index || connector->parent == IO_CONFIG_NONE) &&
           (connector->flags & ~(CF_ENABLE | CF_OPTIONAL)) == 0 &&
           (connector->bus_task < c->l->image->task_count || connector->bus_task == IO_CONFIG_NONE) &&
           has_next(c, PARAMETERS, connector->first_parameter, connector->parameter_count) &&
           read_name(c, connector->name, c->name) && read_name(c, connector->driver, c->driver) &&
           is_place_of_state(c, connector->state);
}

static RTS_RESULT check_connector(IO_CHECK *c)
{
    IoConfigConnector connector;
    RTS_RESULT result = read_next(c, CONNECTORS, &connector);

    if (result != ERR_OK)
        return result;
    if (!is_connector(c, &connector))
        return damaged(c, CONNECTORS);
    if ((connector.flags & (CF_ENABLE | CF_OPTIONAL)) == CF_ENABLE && !AppIoGet()->has_driver(c->driver))
        return refuse(c->l, ERR_NO_OBJECT, "%s needs the driver %s, which this device does not have.", c->name,
                      c->driver);
    return check_parameters(c, connector.parameter_count);
}

/* ---- maps ---- */

static bool is_channel(const IoConfigChannelMap *channel, RTS_UI32 area_size)
{
    RTS_UI32 at = channel->area_bit;
    RTS_UI32 from = channel->parameter_bit;
    RTS_UI32 bits = channel->bits;
    bool in_bytes = ((at | from | bits) & 7) == 0;

    return bits > 0 && (channel->flags & ~(IO_CHANNEL_ON_STOP | IO_CHANNEL_BIG_ENDIAN)) == 0 &&
           (channel->flags & IO_CHANNEL_ON_STOP) <= IO_VALUE &&
           (in_bytes || ((at & 7) + bits <= 8 && (from & 7) + bits <= 8)) && from >> 31 == 0 && at / 8 < area_size &&
           (bits + 7) / 8 <= area_size - at / 8;
}

static RTS_RESULT check_channels(IO_CHECK *c, RTS_UI32 count, RTS_UI32 area_size)
{
    for (; count > 0; count--) {
        IoConfigChannelMap channel;
        RTS_RESULT result = read_next(c, CHANNEL_MAPS, &channel);
        if (result != ERR_OK)
            return result;
        if (!is_channel(&channel, area_size))
            return damaged(c, CHANNEL_MAPS);
    }
    return ERR_OK;
}

static RTS_RESULT check_connector_maps(IO_CHECK *c, RTS_UI32 count, RTS_UI32 area_size)
{
    for (; count > 0; count--) {
        IoConfigConnectorMap map;
        RTS_RESULT result = read_next(c, CONNECTOR_MAPS, &map);
        if (result == ERR_OK && (map.connector >= c->count[CONNECTORS] ||
                                 !has_next(c, CHANNEL_MAPS, map.first_channel_map, map.channel_map_count)))
            result = damaged(c, CONNECTOR_MAPS);
        if (result == ERR_OK)
            result = check_channels(c, map.channel_map_count, area_size);
        if (result != ERR_OK)
            return result;
    }
    return ERR_OK;
}

RTS_STATIC_ASSERT(2 * APP_MAX_TASKS <= 32, task_maps_have_a_bit_each);

static RTS_RESULT check_task_map(IO_CHECK *c)
{
    IoConfigTaskMap map;
    RTS_UI32 bit;
    RTS_RESULT result = read_next(c, TASK_MAPS, &map);

    if (result != ERR_OK)
        return result;
    if (map.task >= c->l->image->task_count || map.type > IO_MAP_OUTPUTS ||
        !has_next(c, CONNECTOR_MAPS, map.first_connector_map, map.connector_map_count))
        return damaged(c, TASK_MAPS);
    bit = 1u << (2 * map.task + map.type);
    if ((c->maps_seen & bit) != 0)
        return damaged(c, TASK_MAPS);
    c->maps_seen |= bit;
    return check_connector_maps(c, map.connector_map_count, c->l->image->area_size[APP_AREA_INPUT + map.type]);
}

RTS_STATIC_ASSERT(APP_AREA_INPUT + IO_MAP_OUTPUTS == APP_AREA_OUTPUT, areas_are_in_the_order_of_maps);

/* ---- the whole ---- */

static RTS_RESULT open_tables(IO_CHECK *c)
{
    const CDL_SEGMENT *place = &c->l->image->io;
    RTS_UI32 at = c->l->image->code.offset + place->offset;
    RTS_UI32 end = at + place->size;
    IO_CONFIG head;
    RTS_RESULT result = LoaderRead(c->l, at, &head, sizeof head);
    RTS_UI32 i;

    if (result != ERR_OK)
        return result;
    if (head.version != IO_CONFIG_VERSION)
        return refuse(c->l, ERR_VERSION_MISMATCH, "The I/O configuration has version %u, this device knows %u.",
                      U(head.version), U(IO_CONFIG_VERSION));
    memcpy(c->count, &head.connectors, sizeof c->count);
    at += (RTS_UI32)sizeof head;
    for (i = 0; i < TABLES; i++) {
        c->at[i] = at;
        at += (RTS_UI32)entry_size[i] * c->count[i];
    }
    c->at[TABLES] = at;
    c->data_size = head.data_size;
    if (at > end || head.data_size != end - at || head.data_size % 4 != 0 ||
        (head.board != IO_CONFIG_NOWHERE && !read_name(c, head.board, c->name)))
        return refuse_damaged(c->l, ERR_SIZE_MISMATCH, TABLES, 0);
    if (head.board != IO_CONFIG_NOWHERE && !SysTargetIsBoard(c->name))
        return refuse(c->l, ERR_ID_MISMATCH, "The inputs and outputs are those of the board %s, this is %s.", c->name,
                      SysTargetGet()->device_name);
    if (c->count[CONNECTORS] > IO_MAX_CONNECTORS)
        return refuse(c->l, ERR_NOMEMORY, "There are %u devices and buses, this device can have %u.",
                      U(c->count[CONNECTORS]), U(IO_MAX_CONNECTORS));
    return ERR_OK;
}

RTS_STATIC_ASSERT(offsetof(IO_CONFIG, channel_maps) - offsetof(IO_CONFIG, connectors) == 2 * CHANNEL_MAPS,
                  counts_are_in_the_order_of_tables);

RTS_RESULT LoaderCheckIo(LOADER *l)
{
    IO_CHECK c;
    RTS_RESULT result;

    if (l->image->io.size == 0)
        return ERR_OK;
    memset(&c, 0, sizeof c);
    c.l = l;
    result = open_tables(&c);
    if (result == ERR_OK)
        result = check_entries(&c, c.count[CONNECTORS], check_connector);
    if (result == ERR_OK)
        result = check_entries(&c, c.count[TASK_MAPS], check_task_map);
    return result;
}

RTS_RESULT LoaderFindIo(LOADER *l, RTS_UI32 size)
{
    const CDL_SEGMENT *code = &l->image->code;
    IO_CONFIG_PLACE place;
    RTS_RESULT result;

    if (size != sizeof place)
        return refuse_damaged(l, ERR_SIZE_MISMATCH, TABLES, 0);
    result = LoaderReadNext(l, &place, size);
    if (result != ERR_OK)
        return result;
    if (place.offset % 4 != 0 || place.size < sizeof(IO_CONFIG) || place.offset > code->size ||
        place.size > code->size - place.offset || l->image->io.size != 0)
        return refuse_damaged(l, ERR_INVALID_REFERENCE, TABLES, 0);
    l->image->io.offset = place.offset;
    l->image->io.size = place.size;
    return ERR_OK;
}

#endif
