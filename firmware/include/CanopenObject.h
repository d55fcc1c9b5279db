/*
 * CanopenObject.h - entries of the object dictionary of a CANopen device (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CANOPENOBJECT_H
#define CANOPENOBJECT_H

#include "CmpStd.h"

/* access of CANOPEN_OBJECT */
enum {
    CANOPEN_ACCESS_READ = 1,
    CANOPEN_ACCESS_WRITE = 2,
    CANOPEN_ACCESS_TPDO = 4,
    CANOPEN_ACCESS_RPDO = 8,
    CANOPEN_ACCESS_STORED = 16,  /* 1010h stores its value */
    CANOPEN_ACCESS_LIMITED = 32, /* there is a CANOPEN_LIMIT of it */
};

/* where of CANOPEN_OBJECT: what `place` is */
enum {
    CANOPEN_IN_VALUES = 0,      /* byte of the values; a text has a NUL after its `size` characters */
    CANOPEN_CONSTANT = 1,       /* the value */
    CANOPEN_TEXT = 2,           /* byte of the strings, `size` characters */
    CANOPEN_OF_NODE = 3,        /* the value without the node number, which is added */
    CANOPEN_SETTING = 4,        /* of the firmware: byte of its settings */
    CANOPEN_LIVE = 5,           /* of the firmware */
    CANOPEN_PROGRAM_OBJECT = 6, /* PROGRAM_* of CanopenProgram.h */
};

/* An entry of the dictionary. Those of a table are in ascending order of index and sub-index. */
typedef struct {
    RTS_UI16 index;
    RTS_UI8 sub;
    RTS_UI8 type; /* of CiA 301: CANOPEN_BOOLEAN .. */
    RTS_UI8 access;
    RTS_UI8 where;
    RTS_UI16 size; /* bytes; of a text the most characters */
    RTS_UI32 place;
} CANOPEN_OBJECT;

/* The least and the greatest value that SDO can write, of up to 32 bits. */
typedef struct {
    RTS_UI16 index;
    RTS_UI8 sub;
    RTS_UI8 is_signed;
    RTS_UI32 low;
    RTS_UI32 high;
} CANOPEN_LIMIT;

enum { CANOPEN_MAPPINGS = 8 }; /* objects in a PDO */

/* Communication and mapping of a PDO (1400h and 1600h, 1800h and 1A00h). */
typedef struct {
    RTS_UI32 cob; /* bit 31: not used */
    RTS_UI8 type;
    RTS_UI8 count;
    RTS_UI8 of_node;   /* of a default: 1: the node number is added to `cob` */
    RTS_UI8 start;     /* TPDO: the counter of the SYNC after which it is sent first, 0: of any */
    RTS_UI16 inhibit;  /* x 100 us */
    RTS_UI16 event_ms; /* TPDO: sent at least so often; RPDO: late after so long */
    RTS_UI32 map[CANOPEN_MAPPINGS];
} CANOPEN_PDO_SETTING;

enum {
    CANOPEN_DEVICE_STORE = 1, /* flags: 1010h and 1011h */
    CANOPEN_DEVICE_LSS = 2,
    CANOPEN_DEVICE_DOWNLOAD = 4, /* 1F50h to 1F57h */
    CANOPEN_DEVICE_TIME = 8,     /* TIME sets the clock */
};

/* Entry `number` of the firmware's own objects of communication, without those of PDOs. False: there are no more. */
bool CanopenDictGetFixed(RTS_UI32 number, CANOPEN_OBJECT *object);

#ifndef RTS_CFFI
RTS_STATIC_ASSERT(sizeof(CANOPEN_OBJECT) == 12, canopen_object_is_12_bytes);
RTS_STATIC_ASSERT(sizeof(CANOPEN_LIMIT) == 12, canopen_limit_is_12_bytes);
RTS_STATIC_ASSERT(sizeof(CANOPEN_PDO_SETTING) == 44, canopen_pdo_setting_is_44_bytes);
#endif

#endif
