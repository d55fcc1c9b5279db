/*
 * IoTables.h - the tables of the loaded I/O configuration, for the manager.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef IOTABLES_H
#define IOTABLES_H

#include "CmpIecAbi.h"
#include "IoConfig.h"

/* Where the tables of a configuration are. */
typedef struct {
    const IO_CONFIG *head;
    const IoConfigConnector *connectors;
    const IoConfigConnectorMap *connector_maps;
    const IoConfigChannelMap *channel_maps;
    const RTS_UI8 *data;
    RTS_UI8 *const *areas; /* by APP_AREA_* */
} IO_TABLES;

static inline const IoConfigParameter *IoTablesParametersOf(const IO_TABLES *tables)
{
    return (const IoConfigParameter *)(tables->connectors + tables->head->connectors);
}

static inline const IoConfigTaskMap *IoTablesTaskMapsOf(const IO_TABLES *tables)
{
    return (const IoConfigTaskMap *)(IoTablesParametersOf(tables) + tables->head->parameters);
}

/* Finds the tables of a checked configuration; `areas` stay. `task_maps` is evaluated when the head and connectors are known.
 * A macro: as a function it costs more flash where it is used once. */
#define IO_TABLES_FIND(tables, config, task_maps_of)                                                                   \
    do {                                                                                                               \
        (tables).head = (config);                                                                                      \
        (tables).connectors = (const IoConfigConnector *)((tables).head + 1);                                          \
        (tables).connector_maps = (const IoConfigConnectorMap *)((task_maps_of) + (tables).head->task_maps);           \
        (tables).channel_maps = (const IoConfigChannelMap *)((tables).connector_maps + (tables).head->connector_maps); \
        (tables).data = (const RTS_UI8 *)((tables).channel_maps + (tables).head->channel_maps);                        \
    } while (0)

/* `config` as checked, and the areas; NULL: there is none. From main, while no task runs. */
void IoTablesSet(const IO_CONFIG *config, const IEC_CONTEXT *context);

/* Returns the tables of the loaded configuration. */
const IO_TABLES *IoTablesGet(void);

/* All counts are 0 without a configuration. */
RTS_UI32 IoTablesCountConnectors(void);
RTS_UI32 IoTablesCountTaskMaps(void);
const IoConfigTaskMap *IoTablesGetTaskMaps(void);

/* Where an IO_DEVICE_STATE of the program is. */
IO_DEVICE_STATE *IoTablesGetState(RTS_UI32 offset);

/* Gives a channel of the inputs a value. Within SysLock. */
void IoTablesSetInput(const IoConfigChannelMap *channel, RTS_UI32 value);

#endif
