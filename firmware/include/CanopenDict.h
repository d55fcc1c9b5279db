/*
 * CanopenDict.h - the object dictionary of a CANopen device, and the state of the device that it shows.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Objects of the application are a table in the image, and their values are in memory of the owner. Objects of
 * communication are the firmware's: settings, which 1010h stores, and what the device is doing.
 *
 * From main. Of a PDO a task and the context that receives use what CanopenDevicePdo.h says.
 */
#ifndef CANOPENDICT_H
#define CANOPENDICT_H

#include "Canopen.h"
#include "CanopenObject.h"
#include "CanopenProgram.h"
#include "SysCan.h"
#include "rts_config.h"

/* A firmware without the device may compile this. */
#define CANOPEN_DEVICE_ROOM(count) ((count) > 0 ? (count) : 1)

enum {
    CANOPEN_HISTORY = 8,     /* emergencies in 1003h */
    CANOPEN_EMERGENCIES = 4, /* that wait to be sent */
    CANOPEN_RPDOS = 0,       /* of `pdos` */
    CANOPEN_TPDOS = 1,
    CANOPEN_DIRECTIONS = 2,
    CANOPEN_LAST_SYNC_TYPE = 240, /* transmission types: 0 to this one after SYNC */
    CANOPEN_FIRST_EVENT_TYPE = 254,
    CANOPEN_NOWHERE = 0xFFFF, /* `place` of CANOPEN_PDO_RUN: a dummy in an RPDO */
    CANOPEN_SIGNED = 0x8000,  /* flag of it: an integer that has to be widened with its sign */
};

/* CANOPEN_LIVE: what `place` is. */
enum { LIVE_REGISTER, LIVE_HISTORY, LIVE_STORE, LIVE_RESTORE, LIVE_SERIAL, LIVE_PDO, LIVE_MAPPING };

/* The settings of communication that 1010h:02 stores. */
typedef struct {
    RTS_UI32 sync_cob;
    RTS_UI32 emcy_cob;
    RTS_UI32 consumer; /* node << 16 | ms */
    RTS_UI32 date;     /* of the configuration */
    RTS_UI32 time;
    RTS_UI16 emcy_inhibit; /* x 100 us */
    RTS_UI16 heartbeat_ms;
    RTS_UI8 on_error;     /* 1029h:1 */
    RTS_UI8 sync_counter; /* 1019h: SYNC has a counter up to this one, 0: none */
    RTS_UI8 reserved[2];
    CANOPEN_PDO_SETTING pdos[CANOPEN_DIRECTIONS][CANOPEN_DEVICE_ROOM(CANOPEN_DEVICE_PDOS)];
} CANOPEN_SETTINGS;

/* A PDO at work. */
typedef struct {
    RTS_UI32 active;                  /* its identifier while it is exchanged, 0: it is not */
    RTS_UI16 place[CANOPEN_MAPPINGS]; /* byte in the values, and CANOPEN_SIGNED */
    RTS_UI8 size;                     /* bytes of its mapping */
    RTS_UI8 syncs;                    /* since it was sent */
    bool is_sent;                     /* since it is active */
    bool has_started;                 /* the SYNC with its start value has come */
    bool has_staged;
    RTS_UI32 number;                   /* of receptions */
    RTS_UI32 used;                     /* the reception whose data are in the values */
    RTS_UI32 time_ms;                  /* of the last reception or transmission */
    RTS_UI8 data[2][CANOPEN_PDO_SIZE]; /* received, the newer one at `number` % 2; sent: the first */
    RTS_UI8 staged[CANOPEN_PDO_SIZE];  /* received, for the next SYNC */
} CANOPEN_PDO_RUN;

typedef struct {
    RTS_UI32 state;
    RTS_UI32 node;
    RTS_UI32 transfers;
    RTS_UI32 aborts;
    RTS_UI32 last_abort;
    RTS_UI32 received;
    RTS_UI32 sent;
    RTS_UI32 emcy;
} CANOPEN_DEVICE_COUNTERS;

typedef enum {
    SERVER_IDLE,
    SERVER_WRITE,
    SERVER_READ,
    SERVER_BLOCK_WRITE,
    SERVER_BLOCK_WRITE_END,
    SERVER_BLOCK_READ_READY,
    SERVER_BLOCK_READ,
    SERVER_BLOCK_READ_WAIT,
    SERVER_BLOCK_READ_END
} SERVER_STATE;

/* The SDO server. */
typedef struct {
    SERVER_STATE state;
    bool has_reply;
    bool has_size; /* `size` was said */
    bool has_crc;
    bool is_last;
    RTS_UI8 toggle;
    RTS_UI8 block;    /* segments of a block */
    RTS_UI8 sequence; /* the last one that was sent, or received in order */
    CANOPEN_OBJECT object;
    RTS_UI32 size;
    RTS_UI32 done;
#if CANOPEN_PROGRAM_DOWNLOAD
    RTS_UI32 passed_on; /* bytes of a program before those in `data` */
    RTS_UI16 crc;       /* of them */
#endif
    RTS_UI32 block_start; /* of what is read: where the block begins */
    RTS_UI32 since_ms;
    CAN_FRAME reply;
    RTS_UI8 data[CANOPEN_DEVICE_ROOM(CANOPEN_DEVICE_SDO) + 8];
} SDO_SERVER;

typedef struct {
    bool is_configuring;
    bool has_reply;
    bool is_stored;    /* its number */
    RTS_UI8 fits;      /* parts of the identity that were selected */
    RTS_UI8 position;  /* of fastscan */
    RTS_UI8 next_node; /* after the next reset of communication; 0: none */
    CAN_FRAME reply;
} LSS_SLAVE;

typedef bool (*PF_CANOPEN_DEVICE_SEND)(const CAN_FRAME *frame);

/* A device. The owner sets the first fields before CanopenDeviceBegin, and does not change them. */
typedef struct {
    PF_CANOPEN_DEVICE_SEND send;
#if CANOPEN_PROGRAM_DOWNLOAD
    const CANOPEN_PROGRAM *program; /* NULL: it has no such objects */
#endif
    const CANOPEN_OBJECT *objects;
    RTS_UI32 object_count;
    const CANOPEN_LIMIT *limits;
    RTS_UI32 limit_count;
    const RTS_UI8 *texts;
    RTS_UI32 texts_size;
    RTS_UI8 *values; /* under SysLock */
    RTS_UI32 values_size;
    const CANOPEN_PDO_SETTING *defaults[CANOPEN_DIRECTIONS];
    RTS_UI32 pdo_count[CANOPEN_DIRECTIONS];
    RTS_UI32 flags; /* CANOPEN_DEVICE_STORE .. */
    RTS_UI32 serial;
    RTS_UI16 heartbeat_ms;
    RTS_UI8 first_node; /* 0: none */

    RTS_UI32 written;     /* values that the network has written since the owner reset it to 0 */
    RTS_UI8 node;         /* 0: none */
    RTS_UI8 state;        /* NODE_BOOTS: the boot-up message is to be sent */
    RTS_UI8 wanted_reset; /* NMT_RESET_NODE or _COMMUNICATION; 0: none */
    RTS_UI8 error_register;
    RTS_UI32 errors;                /* bits of CANOPEN_ERROR */
    RTS_UI32 received_before_short; /* RPDOs before one that was too short */
    RTS_UI8 history_count;
    RTS_UI32 history[CANOPEN_HISTORY]; /* the newest first */
    RTS_UI8 emergency_count;
    CAN_FRAME emergencies[CANOPEN_EMERGENCIES];
    RTS_UI32 emergency_ms;
    RTS_UI32 heartbeat_sent_ms;
    bool is_watching; /* the heartbeat of 1016h has come */
    RTS_UI32 heard_ms;
    RTS_UI32 sync_id; /* 0: none is waited for */
    CANOPEN_SETTINGS settings;
    CANOPEN_PDO_RUN runs[CANOPEN_DIRECTIONS][CANOPEN_DEVICE_ROOM(CANOPEN_DEVICE_PDOS)];
    SDO_SERVER server;
    LSS_SLAVE lss;
    CANOPEN_DEVICE_COUNTERS counters;
} CANOPEN_SLAVE;

/* True if the table of the image can be used: in order, and all values in their memory. */
bool CanopenDictIsGood(const CANOPEN_SLAVE *slave);

/* Finds an object. 0, SDO_ABORT_NO_OBJECT, SDO_ABORT_NO_SUB. */
RTS_UI32 CanopenDictFind(const CANOPEN_SLAVE *slave, RTS_UI16 index, RTS_UI8 sub, CANOPEN_OBJECT *found);

/* The number in a constant object; 0 if it is not there. */
RTS_UI32 CanopenDictGetConstant(const CANOPEN_SLAVE *slave, RTS_UI16 index, RTS_UI8 sub);

/* Bits of an object in a PDO. */
RTS_UI32 CanopenDictGetBits(const CANOPEN_OBJECT *object);

/* Integers of 24, 40, 48 and 56 bits are in the next larger type. True if `size` is that of one of them, in bytes. */
bool CanopenIsNarrow(RTS_UI32 size);
bool CanopenIsSigned(const CANOPEN_OBJECT *object);

/* The lower `size` bytes of such an integer have been written: makes the others fit. Within SysLock. */
void CanopenWiden(RTS_UI8 *value, RTS_UI32 size, bool is_signed);

#endif
