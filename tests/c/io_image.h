/*
 * io_image.h - builds I/O configurations for application images, for tests of the I/O manager.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A test fills an IO_SPEC, and emits it after the code of an APP_SPEC.
 */
#ifndef IO_IMAGE_H
#define IO_IMAGE_H

#include "IoConfig.h"
#include "app_image.h"

enum { IO_SPEC_CONNECTORS = 8, IO_SPEC_PARAMETERS = 16, IO_SPEC_CHANNELS = 32, IO_SPEC_DATA = 512 };

typedef struct {
    RTS_UI16 task;
    RTS_UI16 type; /* IO_MAP_* */
    RTS_UI16 connector;
    IoConfigChannelMap map;
} IO_SPEC_CHANNEL;

typedef struct {
    IO_CONFIG head;
    IoConfigConnector connectors[IO_SPEC_CONNECTORS];
    IoConfigParameter parameters[IO_SPEC_PARAMETERS];
    IO_SPEC_CHANNEL channels[IO_SPEC_CHANNELS];
    RTS_UI32 channel_count;
    RTS_UI8 data[IO_SPEC_DATA];
} IO_SPEC;

static inline void io_init(IO_SPEC *io)
{
    memset(io, 0, sizeof *io);
    io->head.version = IO_CONFIG_VERSION;
    io->head.board = IO_CONFIG_NOWHERE;
}

static inline RTS_UI32 io_add_data(IO_SPEC *io, const void *data, RTS_UI32 size)
{
    RTS_UI32 at = io->head.data_size;

    memcpy(io->data + at, data, size);
    io->head.data_size = (at + size + 3) & ~3u;
    return at;
}

static inline RTS_UI32 io_add_text(IO_SPEC *io, const char *text)
{
    return io_add_data(io, text, (RTS_UI32)strlen(text) + 1);
}

/* A connector without parent, of the fastest task, without state. */
static inline IoConfigConnector *io_add_connector(IO_SPEC *io, const char *name, const char *driver)
{
    IoConfigConnector *connector = &io->connectors[io->head.connectors++];

    connector->type = CT_MASTER;
    connector->parent = IO_CONFIG_NONE;
    connector->flags = CF_ENABLE;
    connector->bus_task = IO_CONFIG_NONE;
    connector->first_parameter = io->head.parameters;
    connector->name = io_add_text(io, name);
    connector->driver = io_add_text(io, driver);
    connector->state = IO_CONFIG_NOWHERE;
    return connector;
}

/* A parameter of the connector that was added last. */
static inline IoConfigParameter *io_add_parameter(IO_SPEC *io, RTS_UI32 id, RTS_UI32 bits, RTS_UI32 value)
{
    IoConfigParameter *parameter = &io->parameters[io->head.parameters++];

    io->connectors[io->head.connectors - 1].parameter_count++;
    parameter->id = id;
    parameter->bits = bits;
    parameter->value = value;
    return parameter;
}

static inline void io_add_text_parameter(IO_SPEC *io, RTS_UI32 id, const char *text)
{
    RTS_UI32 at = io_add_text(io, text);

    io_add_parameter(io, id, 8 * ((RTS_UI32)strlen(text) + 1), at)->flags = PVF_POINTER;
}

static inline IoConfigChannelMap *io_add_channel(IO_SPEC *io, RTS_UI16 task, RTS_UI16 type, RTS_UI16 connector,
                                                 RTS_UI32 parameter, RTS_UI32 parameter_bit, RTS_UI32 area_bit,
                                                 RTS_UI16 bits)
{
    IO_SPEC_CHANNEL *channel = &io->channels[io->channel_count++];

    channel->task = task;
    channel->type = type;
    channel->connector = connector;
    channel->map.parameter = parameter;
    channel->map.parameter_bit = parameter_bit;
    channel->map.area_bit = area_bit;
    channel->map.bits = bits;
    channel->map.flags = IO_ZERO;
    return &channel->map;
}

static inline bool io_is_of(const IO_SPEC_CHANNEL *channel, RTS_UI32 task, RTS_UI32 type)
{
    return channel->task == task && channel->type == type;
}

/* The tables of maps, in the order of the tasks, types and connectors. */
typedef struct {
    IoConfigTaskMap tasks[2 * APP_MAX_TASKS];
    IoConfigConnectorMap connectors[IO_SPEC_CHANNELS];
    IoConfigChannelMap channels[IO_SPEC_CHANNELS];
} IO_SPEC_MAPS;

static inline void io_add_connector_map(IO_SPEC *io, IO_SPEC_MAPS *maps, IoConfigTaskMap *task, RTS_UI16 connector)
{
    IoConfigConnectorMap *map = &maps->connectors[io->head.connector_maps];
    RTS_UI32 i;

    memset(map, 0, sizeof *map);
    map->connector = connector;
    map->first_channel_map = io->head.channel_maps;
    for (i = 0; i < io->channel_count; i++) {
        const IO_SPEC_CHANNEL *channel = &io->channels[i];
        if (io_is_of(channel, task->task, task->type) && channel->connector == connector)
            maps->channels[io->head.channel_maps++] = channel->map;
    }
    map->channel_map_count = (RTS_UI16)(io->head.channel_maps - map->first_channel_map);
    if (map->channel_map_count > 0) {
        io->head.connector_maps++;
        task->connector_map_count++;
    }
}

static inline void io_add_task_map(IO_SPEC *io, IO_SPEC_MAPS *maps, RTS_UI16 number, RTS_UI16 type)
{
    IoConfigTaskMap *task = &maps->tasks[io->head.task_maps];
    RTS_UI16 connector;

    task->task = number;
    task->type = type;
    task->first_connector_map = io->head.connector_maps;
    task->connector_map_count = 0;
    for (connector = 0; connector < IO_SPEC_CONNECTORS; connector++)
        io_add_connector_map(io, maps, task, connector);
    if (task->connector_map_count > 0)
        io->head.task_maps++;
}

/* Puts the configuration after the code, of the tasks that are there. */
static inline void emit_io(APP_SPEC *spec, IO_SPEC *io)
{
    IO_SPEC_MAPS maps;
    RTS_UI16 task;

    io->head.task_maps = io->head.connector_maps = io->head.channel_maps = 0;
    for (task = 0; task < spec->task_count; task++) {
        io_add_task_map(io, &maps, task, IO_MAP_INPUTS);
        io_add_task_map(io, &maps, task, IO_MAP_OUTPUTS);
    }
    while (spec->code_size % 4 != 0)
        emit_ret(spec);
    spec->io.offset = here(spec);
    emit(spec, (const char *)&io->head, sizeof io->head);
    emit(spec, (const char *)io->connectors, io->head.connectors * (RTS_UI32)sizeof io->connectors[0]);
    emit(spec, (const char *)io->parameters, io->head.parameters * (RTS_UI32)sizeof io->parameters[0]);
    emit(spec, (const char *)maps.tasks, io->head.task_maps * (RTS_UI32)sizeof maps.tasks[0]);
    emit(spec, (const char *)maps.connectors, io->head.connector_maps * (RTS_UI32)sizeof maps.connectors[0]);
    emit(spec, (const char *)maps.channels, io->head.channel_maps * (RTS_UI32)sizeof maps.channels[0]);
    emit(spec, (const char *)io->data, io->head.data_size);
    spec->io.size = here(spec) - spec->io.offset;
}

#endif
