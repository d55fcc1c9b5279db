/*
 * IoTables.h - the tables of the loaded I/O configuration, for the manager.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef IOTABLES_H
#define IOTABLES_H

#include "CmpIecAbi.h"
#include "IoConfig.h"

/* `config` as checked, and the areas; NULL: there is none. From main, while no task runs. */
void IoTablesSet(const IO_CONFIG *config, const IEC_CONTEXT *context);

/* All counts are 0 without a configuration. */
RTS_UI32 IoTablesCountConnectors(void);
RTS_UI32 IoTablesCountTaskMaps(void);
const IoConfigTaskMap *IoTablesGetTaskMaps(void);

/* Where an IO_DEVICE_STATE of the program is. */
IO_DEVICE_STATE *IoTablesGetState(RTS_UI32 offset);

/* Gives a channel of the inputs a value. Within SysLock. */
void IoTablesSetInput(const IoConfigChannelMap *channel, RTS_UI32 value);

#endif
