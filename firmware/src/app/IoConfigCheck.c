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
    RTS_UI16 count[TABLES + 1];
    RTS_UI16 next[TABLES + 1]; /* entry that is read next */
    RTS_UI32 data_size;
    RTS_UI32 least_id;               /* of the next parameter of the connector */
    RTS_UI32 area_size;              /* of the area of the task map */
    RTS_UI32 maps_seen;              /* a bit for each task and type */
    char name[IO_CONFIG_MAX_NAME];   /* of the connector */
    char driver[IO_CONFIG_MAX_NAME]; /* that it names */
} IO_CHECK;

typedef union {
    IoConfigConnector connector;
    IoConfigParameter parameter;
    IoConfigTaskMap task_map;
    IoConfigConnectorMap connector_map;
    IoConfigChannelMap channel;
    RTS_UI16 words[14]; /* the last two are not there, and zero */
} ENTRY;

/* A compiler never writes such a configuration: which entry says enough. Table TABLES is the head, or where it is. */
static RTS_RESULT refuse_damaged(LOADER *l, RTS_RESULT result, RTS_UI32 table, RTS_UI32 entry)
{
    return refuse(l, result, "The I/O configuration is damaged (table %u, entry %u): build again.", U(table), U(entry));
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

/* Numbers of parameters ascend. */
static bool is_parameter(IO_CHECK *c, const ENTRY *entry)
{
    const IoConfigParameter *parameter = &entry->parameter;
    bool good = parameter->id >= c->least_id && parameter->id != 0xFFFFFFFFu && is_value(c, parameter);

    c->least_id = parameter->id + 1;
    return good;
}

static bool is_place_of_state(const IO_CHECK *c, RTS_UI32 offset)
{
    RTS_UI32 size = c->l->image->area_size[APP_AREA_DATA];

    return offset == IO_CONFIG_NOWHERE ||
           (offset % 4 == 0 && size >= sizeof(IO_DEVICE_STATE) && offset <= size - sizeof(IO_DEVICE_STATE));
}

static bool is_connector(IO_CHECK *c, const ENTRY *entry)
{
    const IoConfigConnector *connector = &entry->connector;
    RTS_UI32 index = c->next[CONNECTORS] - 1u;

    c->least_id = 0;
    return (connector->parent < index || connector->parent == IO_CONFIG_NONE) &&
           (connector->flags & ~(CF_ENABLE | CF_OPTIONAL)) == 0 &&
           (connector->bus_task < c->l->image->task_count || connector->bus_task == IO_CONFIG_NONE) &&
           read_name(c, connector->name, c->name) && read_name(c, connector->driver, c->driver) &&
           is_place_of_state(c, connector->state);
}

/* ---- maps ---- */

static bool is_channel(IO_CHECK *c, const ENTRY *entry)
{
    const IoConfigChannelMap *channel = &entry->channel;
    RTS_UI32 at = channel->area_bit;
    RTS_UI32 from = channel->parameter_bit;
    RTS_UI32 bits = channel->bits;
    bool in_bytes = ((at | from | bits) & 7) == 0;

    return bits > 0 && (channel->flags & ~(IO_CHANNEL_ON_STOP | IO_CHANNEL_BIG_ENDIAN)) == 0 &&
           (channel->flags & IO_CHANNEL_ON_STOP) <= IO_VALUE &&
           (in_bytes || ((at & 7) + bits <= 8 && (from & 7) + bits <= 8)) && from >> 31 == 0 && at / 8 < c->area_size &&
           (bits + 7) / 8 <= c->area_size - at / 8;
}

static bool is_connector_map(IO_CHECK *c, const ENTRY *entry)
{
    return entry->connector_map.connector < c->count[CONNECTORS];
}

RTS_STATIC_ASSERT(2 * APP_MAX_TASKS <= 32, task_maps_have_a_bit_each);
RTS_STATIC_ASSERT(APP_AREA_INPUT + IO_MAP_OUTPUTS == APP_AREA_OUTPUT, areas_are_in_the_order_of_maps);

static bool is_task_map(IO_CHECK *c, const ENTRY *entry)
{
    const IoConfigTaskMap *map = &entry->task_map;
    RTS_UI32 seen = c->maps_seen;

    if (map->task >= c->l->image->task_count || map->type > IO_MAP_OUTPUTS)
        return false;
    c->maps_seen |= 1u << (2 * map->task + map->type);
    c->area_size = c->l->image->area_size[APP_AREA_INPUT + map->type];
    return c->maps_seen != seen;
}

/* ---- tables ---- */

/* What the entries of a table are. Those of `children` that an entry has are two of its words: the first one, and how many;
 * none in TABLES. */
typedef struct {
    bool (*is_good)(IO_CHECK *c, const ENTRY *entry);
    RTS_UI8 size;
    RTS_UI8 children;
    RTS_UI8 word;
} KIND;

#define HAS(children, type, first) sizeof(type), children, offsetof(type, first) / 2

static const KIND kinds[TABLES] = {
    {is_connector, HAS(PARAMETERS, IoConfigConnector, first_parameter)},
    {is_parameter, sizeof(IoConfigParameter), TABLES, 12},
    {is_task_map, HAS(CONNECTOR_MAPS, IoConfigTaskMap, first_connector_map)},
    {is_connector_map, HAS(CHANNEL_MAPS, IoConfigConnectorMap, first_channel_map)},
    {is_channel, sizeof(IoConfigChannelMap), TABLES, 12},
};

static RTS_RESULT check_driver(const IO_CHECK *c, const IoConfigConnector *connector)
{
    if ((connector->flags & (CF_ENABLE | CF_OPTIONAL)) != CF_ENABLE || AppIoGet()->has_driver(c->driver))
        return ERR_OK;
    return refuse(c->l, ERR_NO_OBJECT, "%s needs the driver %s, which this device does not have.", c->name, c->driver);
}

/* That many entries of a table come next, which are there, each with its own of the next table. */
static RTS_RESULT check_entries(IO_CHECK *c, RTS_UI32 table, RTS_UI32 count)
{
    const KIND *kind = &kinds[table];
    RTS_RESULT result = ERR_OK;

    for (; count > 0 && result == ERR_OK; count--) {
        RTS_UI32 number = c->next[table]++;
        ENTRY entry = {.words = {0}};
        const RTS_UI16 *has = entry.words + kind->word; /* the first, and how many */
        result = LoaderRead(c->l, c->at[table] + kind->size * number, &entry, kind->size);
        if (result != ERR_OK)
            return result;
        if (!kind->is_good(c, &entry) || has[0] != c->next[kind->children] ||
            has[1] > c->count[kind->children] - has[0])
            return refuse_damaged(c->l, ERR_INVALID_REFERENCE, table, number);
        if (table == CONNECTORS)
            result = check_driver(c, &entry.connector);
        if (result == ERR_OK)
            result = check_entries(c, kind->children, has[1]);
    }
    return result;
}

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
    memcpy(c->count, &head.connectors, TABLES * sizeof c->count[0]);
    at += (RTS_UI32)sizeof head;
    for (i = 0; i < TABLES; i++) {
        c->at[i] = at;
        at += (RTS_UI32)kinds[i].size * c->count[i];
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
        result = check_entries(&c, CONNECTORS, c.count[CONNECTORS]);
    if (result == ERR_OK)
        result = check_entries(&c, TASK_MAPS, c.count[TASK_MAPS]);
    return result;
}

RTS_RESULT LoaderFindIo(LOADER *l, RTS_UI32 size)
{
    const CDL_SEGMENT *code = &l->image->code;
    IO_CONFIG_PLACE place = {0, 0};
    RTS_RESULT result = size == sizeof place ? LoaderReadNext(l, &place, size) : (RTS_RESULT)ERR_SIZE_MISMATCH;

    if (result == ERR_OK && (place.offset % 4 != 0 || place.size < sizeof(IO_CONFIG) || place.offset > code->size ||
                             place.size > code->size - place.offset || l->image->io.size != 0))
        result = ERR_INVALID_REFERENCE;
    l->image->io.offset = place.offset;
    l->image->io.size = place.size;
    return result == ERR_OK ? ERR_OK : refuse_damaged(l, result, TABLES, 0);
}

#endif
