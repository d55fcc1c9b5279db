/*
 * ModbusSetup.h - the lines, devices, jobs and ranges of Modbus that the configuration asks for.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main, while no task runs. What is set up stays where it is until the next configuration.
 */
#ifndef MODBUSSETUP_H
#define MODBUSSETUP_H

#include "IoConfig.h"
#include "IoDrv.h"
#include "ModbusClient.h"
#include "ModbusServer.h"
#include "rts_config.h"

/* A connector of a device, of a server, or of a client's line. */
typedef struct {
    const IoConfigConnector *connector;
    RTS_UI32 noted_errors; /* what the manager knows */
    RTS_UI32 noted_data; /* of a device, when its data came last: the lower half of that; of a server, how often + 1 */
    bool noted_lost;
} MODBUS_NOTED;

typedef struct {
    MODBUS_NOTED noted;
    MODBUS_SERVER server;
    MODBUS_LINK link; /* serial */
} MODBUS_SERVER_LINE;

typedef struct {
    MODBUS_NOTED noted;
    MODBUS_NOTED *devices; /* of each of them */
    MODBUS_CLIENT client;
} MODBUS_CLIENT_LINE;

#define MODBUS_ROOM(count) ((count) > 0 ? (count) : 1)

typedef struct {
    RTS_UI32 client_count;
    RTS_UI32 device_count;
    RTS_UI32 job_count;
    RTS_UI32 server_count;
    RTS_UI32 range_count;
    RTS_UI32 data_size;
    MODBUS_CLIENT_LINE clients[MODBUS_ROOM(MODBUS_MAX_CLIENTS)];
    MODBUS_NOTED noted[MODBUS_ROOM(MODBUS_MAX_DEVICES)]; /* of each device */
    MODBUS_DEVICE devices[MODBUS_ROOM(MODBUS_MAX_DEVICES)];
    MODBUS_JOB_STATE jobs[MODBUS_ROOM(MODBUS_MAX_JOBS)];
    MODBUS_SERVER_LINE servers[MODBUS_ROOM(MODBUS_MAX_SERVERS)];
    MODBUS_CALL calls[1 + MODBUS_MAX_CALLS]; /* the first one is that of a scan */
    MODBUS_MEMORY ranges[MODBUS_ROOM(MODBUS_MAX_RANGES)];
    RTS_UI8 data[MODBUS_DATA_SIZE];
} MODBUS_SETUP;

/* What is optional and refused is as if it were not configured: all is set up again without it. So this is
 * IoMgrConfigRefuse, but with ERR_PENDING instead of ERR_OK. */
#define MODBUS_REFUSE(...) ModbusRefused(IoMgrConfigRefuse(__VA_ARGS__))
RTS_RESULT ModbusRefused(RTS_RESULT result);

/* Closes what is open, and sets up what the connectors of `driver` ask for. Errors: see MODBUS_REFUSE; ERR_PENDING: it
 * is to be called again. */
RTS_RESULT ModbusSetUp(MODBUS_SETUP *setup, const IO_DRIVER *driver);

#if ONLINE_CHANGE
/* Leads all pointers into the configuration on (IoDrvFollowConfiguration). */
void ModbusSetupFollow(MODBUS_SETUP *setup);
#endif

/* Closes what is open; the line of tools is the firmware's again. */
void ModbusGiveBack(MODBUS_SETUP *setup);

/* What a connector is: one of them, or none if both are NULL. */
typedef struct {
    MODBUS_DEVICE *device;
    MODBUS_SERVER_LINE *server;
} MODBUS_PLACE;

/* From any context, as is what follows. */
MODBUS_PLACE ModbusFindPlace(MODBUS_SETUP *setup, const IoConfigConnector *connector);

/* The memory of a channel's parameter, and how many bits it has; NULL: there is none. */
RTS_UI8 *ModbusFindMemory(const MODBUS_PLACE *place, RTS_UI32 parameter, bool is_output, RTS_UI32 *bits);

#endif
