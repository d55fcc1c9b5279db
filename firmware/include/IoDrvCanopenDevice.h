/*
 * IoDrvCanopenDevice.h - driver of this controller as a CANopen device: its parameters (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Driver "IoDrvCanopenDevice". The device is one connector CT_MASTER. Its channels are values of its object dictionary:
 * outputs are objects that the network reads, inputs those that it writes. The tool makes the dictionary; the objects of
 * communication (CanopenDict.h) are the firmware's own.
 */
#ifndef IODRVCANOPENDEVICE_H
#define IODRVCANOPENDEVICE_H

#include "CanopenObject.h"

enum {
    CANOPEN_DEVICE_NETWORK = 1,   /* number of the CAN controller, 0 if missing */
    CANOPEN_DEVICE_NODE = 2,      /* 1..127; 0: LSS gives it one */
    CANOPEN_DEVICE_HEARTBEAT = 3, /* default of 1017h [ms] */
    CANOPEN_DEVICE_FLAGS = 4,
    CANOPEN_DEVICE_OBJECTS = 5, /* CANOPEN_OBJECT, as bytes */
    CANOPEN_DEVICE_TEXTS = 6,   /* bytes */
    CANOPEN_DEVICE_RPDOS = 7,   /* CANOPEN_PDO_SETTING, as bytes */
    CANOPEN_DEVICE_TPDOS = 8,
    CANOPEN_DEVICE_VALUES = 9,         /* bytes of all values */
    CANOPEN_DEVICE_LIMITS = 10,        /* CANOPEN_LIMIT, as bytes */
    CANOPEN_DEVICE_VALUE = 0x1000,     /* of channels: the values */
    CANOPEN_DEVICE_EMERGENCY = 0x1001, /* of a channel: the code of the program's emergency, 0: none */
    /* To be read only, u32 each: */
    CANOPEN_DEVICE_STATE = 0x8000, /* as a heartbeat has it */
    CANOPEN_DEVICE_OWN_NODE = 0x8001,
    CANOPEN_DEVICE_TRANSFERS = 0x8002, /* of SDO that have begun */
    CANOPEN_DEVICE_ABORTS = 0x8003,
    CANOPEN_DEVICE_LAST_ABORT = 0x8004,
    CANOPEN_DEVICE_RECEIVED = 0x8005, /* RPDOs */
    CANOPEN_DEVICE_SENT = 0x8006,     /* TPDOs */
    CANOPEN_DEVICE_EMCY = 0x8007,
};

#ifndef RTS_CFFI
#include "CanopenProgram.h"
#include "CmpItf.h"
#include "SysCan.h"
#include "rts_config.h"

#if CANOPEN_PROGRAM_DOWNLOAD
/* Before any configuration: the functions of 1F50h to 1F57h. */
void IoDrvCanopenDeviceSetProgram(const CANOPEN_PROGRAM *program);

/* Makes the reply "written" to the last request; returns the network it is for. */
RTS_UI32 IoDrvCanopenDeviceMakeReply(CAN_FRAME *frame);
#endif

RTS_RESULT IoDrvCanopenDevice_Hook(CMP_HOOK hook);
#endif

#endif
