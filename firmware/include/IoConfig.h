/*
 * IoConfig.h - the I/O configuration of an application, as the image has it (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Structures and names of manual 8.2.2, 8.5 and 8.8.1. The configuration is part of the code segment, so that execution
 * in place spends no RAM on it: it is read only, and has indices and offsets where the manual has pointers. The head is
 * followed by the tables, in the order of its counts, then by the data: names and values, each where an entry says.
 * Entries start at multiples of 4. All little-endian. What an entry has of the next table begins where that of the entry
 * before it ended, so that each entry is checked once.
 */
#ifndef IOCONFIG_H
#define IOCONFIG_H

#include "CmpStd.h"

enum {
    IO_CONFIG_VERSION = 2,
    IO_CONFIG_NONE = 0xFFFF, /* instead of an index: there is none */
    IO_CONFIG_MAX_NAME = 32, /* of a connector, driver or board, with NUL */
};

/* Instead of an offset: there is none. */
#ifdef RTS_CFFI
static const RTS_UI32 IO_CONFIG_NOWHERE;
#else
#define IO_CONFIG_NOWHERE 0xFFFFFFFFu
#endif

/* Payload of CDL_BLOB_IO: where the configuration is in the code segment. */
typedef struct {
    RTS_UI32 offset; /* a multiple of 4 */
    RTS_UI32 size;   /* bytes: the head, all tables, and the data */
} IO_CONFIG_PLACE;

/* The head. Numbers of entries of each table; none is IO_CONFIG_NONE or more. */
typedef struct {
    RTS_UI16 version;        /* IO_CONFIG_VERSION */
    RTS_UI16 connectors;     /* IoConfigConnector */
    RTS_UI16 parameters;     /* IoConfigParameter */
    RTS_UI16 task_maps;      /* IoConfigTaskMap */
    RTS_UI16 connector_maps; /* IoConfigConnectorMap */
    RTS_UI16 channel_maps;   /* IoConfigChannelMap */
    RTS_UI32 data_size;      /* bytes, a multiple of 4 */
    RTS_UI32 board;          /* in the data, with NUL: the board whose lines and devices are meant (SysTargetIsBoard);
                              * IO_CONFIG_NOWHERE: any that has them */
} IO_CONFIG;

/* Flags of a connector (8.8.1). The configuration has CF_ENABLE and CF_OPTIONAL only; the others are set while it runs,
 * CF_DRIVER_AVAILABLE by the I/O manager, what follows by the driver. */
enum {
    CF_ENABLE = 0x0001,
    CF_OPTIONAL = 0x0002, /* the application runs without its driver, and if the driver refuses it */
    CF_DRIVER_AVAILABLE = 0x0010,
    CF_CONNECTOR_FOUND = 0x0020,
    CF_CONNECTOR_CONFIGURED = 0x0040,
    CF_CONNECTOR_ACTIVE = 0x0080,
    CF_CONNECTOR_BUS_ERROR = 0x0100,
    CF_CONNECTOR_ERROR = 0x0200,
    CF_CONNECTOR_DIAGNOSTIC_AVAILABLE = 0x0400,
};

/* Types of connectors; those of a driver's own begin at CT_VENDOR. */
enum {
    CT_MASTER = 1, /* a bus, or the local inputs and outputs of the board: it has no parent */
    CT_SLAVE = 2,  /* a device or module on it */
    CT_VENDOR = 0x8000,
};

/* A device, module or bus. A child comes after its parent. */
typedef struct {
    RTS_UI16 type;     /* CT_* */
    RTS_UI16 parent;   /* connector, IO_CONFIG_NONE: none */
    RTS_UI16 flags;    /* CF_* */
    RTS_UI16 bus_task; /* task in whose cycle the bus cycle is started, IO_CONFIG_NONE: the parent's, or the fastest */
    RTS_UI16 first_parameter;
    RTS_UI16 parameter_count;
    RTS_UI32 name;   /* in the data, with NUL: what the engineer calls it */
    RTS_UI32 driver; /* in the data, with NUL: szDriverName of the driver that is to take it */
    RTS_UI32 state;  /* in APP_AREA_DATA, a multiple of 4: its IO_DEVICE_STATE; IO_CONFIG_NOWHERE: none */
} IoConfigConnector;

enum {
    PVF_POINTER = 0x0001, /* the value is in the data */
};

/* A parameter of a connector. Ids are the driver's own; those of a connector are in ascending order. */
typedef struct {
    RTS_UI32 id;
    RTS_UI16 type;  /* TYPE_CLASS of it, for those who show it */
    RTS_UI16 flags; /* PVF_* */
    RTS_UI32 bits;  /* size of the value */
    RTS_UI32 value; /* of up to 32 bits; PVF_POINTER: its offset in the data, a multiple of 4 */
} IoConfigParameter;

enum { IO_MAP_INPUTS = 0, IO_MAP_OUTPUTS = 1 };

/* What a task uses of inputs, or of outputs. Every task has at most one of each; an input that no task uses is in that
 * of the bus cycle task of its connector. */
typedef struct {
    RTS_UI16 task;
    RTS_UI16 type; /* IO_MAP_* */
    RTS_UI16 first_connector_map;
    RTS_UI16 connector_map_count;
} IoConfigTaskMap;

/* Of a task map: the channels of one connector. Connectors of one driver are next to each other. */
typedef struct {
    RTS_UI16 connector;
    RTS_UI16 first_channel_map;
    RTS_UI16 channel_map_count;
    RTS_UI16 reserved;
} IoConfigConnectorMap;

/* What becomes of an output when the application stops, or has an exception; of an input when its device is lost. */
enum { IO_HOLD = 0, IO_ZERO = 1, IO_VALUE = 2 };

enum {
    IO_CHANNEL_ON_STOP = 0x03,    /* IO_HOLD, _ZERO or _VALUE */
    IO_CHANNEL_BIG_ENDIAN = 0x04, /* its bytes are in the other order than in the device's parameter */
};

/* A channel: `bits` at `parameter_bit` of a parameter of the connector are those at `area_bit` of the inputs or outputs.
 * A channel that is no multiple of 8 bits, or does not start at one, is within one byte on both sides. `parameter_bit` is
 * below 0x80000000, so that drivers can add to it. */
typedef struct {
    RTS_UI32 parameter; /* id, the driver's own */
    RTS_UI32 parameter_bit;
    RTS_UI32 area_bit;
    RTS_UI16 bits;
    RTS_UI16 flags; /* IO_CHANNEL_* */
    RTS_UI32 value; /* of IO_VALUE; of more than 32 bits the lowest, the others are zero */
} IoConfigChannelMap;

/* Variable of a program that follows a device: IO_DEVICE of the library. */
typedef struct {
    RTS_UI32 flags;  /* CF_* */
    RTS_UI32 errors; /* since the application was loaded */
    RTS_UI32 age_ms; /* since its last good data; 0xFFFFFFFF: none yet, or longer */
    RTS_UI8 ok;      /* its data is good: active, and no error */
    RTS_UI8 reserved[3];
} IO_DEVICE_STATE;

#ifndef RTS_CFFI
RTS_STATIC_ASSERT(sizeof(IO_CONFIG) == 20, io_config_is_20_bytes);
RTS_STATIC_ASSERT(sizeof(IoConfigConnector) == 24, io_config_connector_is_24_bytes);
RTS_STATIC_ASSERT(sizeof(IoConfigParameter) == 16, io_config_parameter_is_16_bytes);
RTS_STATIC_ASSERT(sizeof(IoConfigTaskMap) == 8, io_config_task_map_is_8_bytes);
RTS_STATIC_ASSERT(sizeof(IoConfigConnectorMap) == 8, io_config_connector_map_is_8_bytes);
RTS_STATIC_ASSERT(sizeof(IoConfigChannelMap) == 20, io_config_channel_map_is_20_bytes);
RTS_STATIC_ASSERT(sizeof(IO_DEVICE_STATE) == 16, io_device_state_is_16_bytes);
#endif

#endif
