/*
 * Canopen.h - identifiers, states and abort codes of CANopen (CiA 301, 302).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CANOPEN_H
#define CANOPEN_H

#include "CmpStd.h"

/* Identifiers of 11 bits; + node, but for NMT and SYNC. */
enum {
    CANOPEN_NMT = 0x000,
    CANOPEN_SYNC = 0x080,
    CANOPEN_EMCY = 0x080,
    CANOPEN_TPDO = 0x180,
    CANOPEN_SDO_REPLY = 0x580,
    CANOPEN_SDO_REQUEST = 0x600,
    CANOPEN_HEARTBEAT = 0x700,
    CANOPEN_NODE_MASK = 0x07F,
    CANOPEN_FUNCTION_MASK = 0x780,
    CANOPEN_MAX_NODE = 127,
    CANOPEN_PDO_SIZE = 8,
    CANOPEN_GUARD_TOGGLE = 0x80, /* of a guarding reply, beside the state */
};

/* Commands of the NMT master. */
enum {
    NMT_START = 0x01,
    NMT_STOP = 0x02,
    NMT_PREOPERATIONAL = 0x80,
    NMT_RESET_NODE = 0x81,
    NMT_RESET_COMMUNICATION = 0x82,
};

/* States, as a heartbeat has them. */
enum {
    NODE_BOOTS = 0x00,
    NODE_STOPPED = 0x04,
    NODE_OPERATIONAL = 0x05,
    NODE_PREOPERATIONAL = 0x7F,
};

/* Objects. */
enum {
    OBJECT_TYPE = 0x1000,
    OBJECT_HEARTBEAT = 0x1017,
    OBJECT_IDENTITY = 0x1018,
};

/* Command bytes of SDO. */
enum {
    SDO_WRITE_EXPEDITED = 0x23, /* | 4 * bytes that are unused */
    SDO_WRITE_BEGIN = 0x21,
    SDO_WRITE_SEGMENT = 0x00,
    SDO_WRITE_DONE = 0x60,
    SDO_SEGMENT_DONE = 0x20,
    SDO_READ = 0x40,
    SDO_READ_SEGMENT = 0x60,
    SDO_ABORT = 0x80,
    SDO_TOGGLE = 0x10,
    SDO_KIND = 0xE0,
};

#define SDO_ABORT_TOGGLE 0x05030000u
#define SDO_ABORT_TIMEOUT 0x05040000u
#define SDO_ABORT_COMMAND 0x05040001u
#define SDO_ABORT_MEMORY 0x05040005u
#define SDO_ABORT_NO_OBJECT 0x06020000u
#define SDO_ABORT_GENERAL 0x08000000u
#define SDO_ABORT_NO_DICTIONARY 0x08000023u

#endif
