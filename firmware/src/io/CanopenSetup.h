/*
 * CanopenSetup.h - the networks, nodes and PDOs of CANopen that the configuration asks for.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CANOPENSETUP_H
#define CANOPENSETUP_H

#include "CanopenMaster.h"
#include "CmpCan.h"
#include "IoDrv.h"
#include "IoDrvCanopen.h"
#include "rts_config.h"

/* A firmware without CANopen may compile this. */
#define CANOPEN_ROOM(count) ((count) > 0 ? (count) : 1)

/* A PDO (CANOPEN_PDO) in 28 bytes. Who receives an input writes one of two copies, then `number`; a task reads the newer
 * one. */
typedef struct {
    RTS_UI32 cob : 11;
    RTS_UI32 last : 3;       /* its last byte: CanopenPdoSize */
    RTS_UI32 flags : 2;      /* CANOPEN_PDO_* */
    RTS_UI32 within_ms : 16; /* outputs: sent at least so often; inputs: the node is lost without it; 0: neither */
    union {
        struct {
            RTS_UI32 number; /* of receptions */
            RTS_UI32 received_ms;
            RTS_UI8 data[2][CANOPEN_PDO_SIZE];
        } in;
        struct {
            RTS_UI8 data[CANOPEN_PDO_SIZE];
            RTS_UI8 sent[CANOPEN_PDO_SIZE];
            RTS_UI32 sent_run; /* in which run of the node `sent` was */
            RTS_UI32 sent_ms;
        } out;
    } of;
} CANOPEN_PDO_STATE;

RTS_STATIC_ASSERT(sizeof(CANOPEN_PDO_STATE) == 28, a_pdo_takes_28_bytes);

static inline RTS_UI32 CanopenPdoSize(const CANOPEN_PDO_STATE *state)
{
    return state->last + 1u;
}

/* Handles that are not in use are RTS_INVALID_HANDLE. */
typedef struct {
    RTS_UI32 kind; /* CANOPEN_SYNC_* */
    RTS_UI32 every_us;
    RTS_UI32 window_us; /* 0: there is none */
    RTS_UI8 last;       /* its counter goes from 1 to this one, 0: it has none */
    RTS_UI8 counter;    /* of the last SYNC */
    RTS_HANDLE timer;
    RTS_HANDLE window_timer;
    RTS_HANDLE sync_event;
    RTS_HANDLE window_event;
    RTS_UI32 is_open; /* the end of the window is to come */
} CANOPEN_SYNC_STATE;

typedef struct CANOPEN_LINE CANOPEN_LINE;

enum { CANOPEN_INPUT_COB = 16 };

/* Devices that should not be on the bus: another NMT master, and one with our number. */
enum { CANOPEN_OTHER_MASTER, CANOPEN_OTHER_WITH_OUR_NUMBER, CANOPEN_OTHERS };

typedef struct {
    const IoConfigConnector *connector;
    CANOPEN_LINE *line;
    bool used; /* it was not refused */
    CANOPEN_NODE node;
    bool required;   /* no node is started before it */
    RTS_UI8 on_lost; /* CANOPEN_LOST_* */
    CANOPEN_PDO_STATE *pdos;
    RTS_UI32 pdo_count;
    RTS_UI32 runs; /* number of the run that it is in, 0: it is not operational; for tasks */
    RTS_UI32 noted_failures;
    RTS_UI32 noted_emcy;
    RTS_UI32 logged_emcy;
    RTS_UI32 logged_emcy_ms;
} CANOPEN_DEVICE;

struct CANOPEN_LINE {
    const IoConfigConnector *connector;
    RTS_UI32 network;
    RTS_UI8 own_node;
    RTS_UI32 heartbeat_ms;
    RTS_UI32 heartbeat_sent_ms;
    RTS_UI32 time_ms; /* how often TIME is sent, 0: never */
    RTS_UI32 time_sent_ms;
    RTS_UI32 noted_ms[CANOPEN_OTHERS]; /* when a device that should not be there was last in the log, 0: never */
    CANOPEN_SYNC_STATE sync;
    RTS_UI32 is_safe; /* outputs are those of the safe state; for tasks */
    bool attached;
    bool was_off;
    bool is_passive;
#if CANOPEN_SDO_BLOCK
    RTS_UI8 burst; /* segments of a block that are sent in a millisecond */
#endif
    CANOPEN_DEVICE *devices;
    RTS_UI32 device_count;
    CAN_USER user;
    RTS_UI8 by_node[CANOPEN_MAX_NODE + 1]; /* the number of its device, from 1 on; 0: there is none */
    CANOPEN_PDO_STATE *pdos;               /* of the setup */
    RTS_UI32 *inputs; /* those that are received, ascending: identifier << CANOPEN_INPUT_COB, and number in `pdos` */
    RTS_UI32 input_count;
};

typedef struct {
    RTS_UI32 line_count;
    RTS_UI32 device_count;
    RTS_UI32 pdo_count;
    RTS_UI32 input_count;
    CANOPEN_LINE lines[CAN_CONTROLLERS];
    CANOPEN_DEVICE devices[CANOPEN_ROOM(CANOPEN_MAX_DEVICES)];
    CANOPEN_PDO_STATE pdos[CANOPEN_ROOM(CANOPEN_MAX_PDOS)];
    RTS_UI32 inputs[CANOPEN_ROOM(CANOPEN_MAX_PDOS)];
} CANOPEN_SETUP;

/* The PDO of a channel, NULL: none. */
CANOPEN_PDO_STATE *CanopenFindPdo(CANOPEN_SETUP *setup, const IoConfigConnector *connector, RTS_UI32 parameter);
CANOPEN_DEVICE *CanopenFindDevice(CANOPEN_SETUP *setup, const IoConfigConnector *connector);

/* The device with a node number, 0..127, NULL: none that is in use. */
static inline CANOPEN_DEVICE *CanopenFindNode(const CANOPEN_LINE *line, RTS_UI32 node)
{
    return line->by_node[node] != 0 ? line->devices + line->by_node[node] - 1 : NULL;
}

/* The input with an identifier, NULL: none. In any context. */
CANOPEN_PDO_STATE *CanopenFindInput(const CANOPEN_LINE *line, RTS_UI32 cob);

#if ONLINE_CHANGE
/* Leads all pointers into the configuration on (IoDrvFollowConfiguration). */
void CanopenSetupFollow(CANOPEN_SETUP *setup);
#endif

/* Makes what the connectors of `driver` ask for. ERR_* of IoMgrConfigRefuse. */
RTS_RESULT CanopenSetUp(CANOPEN_SETUP *setup, const IO_DRIVER *driver);

#endif
