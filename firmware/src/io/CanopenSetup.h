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

/* Who receives writes one of two copies, then `number`; a task reads the newer one. Inputs have only that, outputs only
 * what follows. */
typedef struct {
    CANOPEN_PDO pdo;
    RTS_UI32 number; /* of receptions */
    RTS_UI32 received_ms;
    RTS_UI8 in[2][CANOPEN_PDO_SIZE];
    RTS_UI8 out[CANOPEN_PDO_SIZE];
    RTS_UI8 sent[CANOPEN_PDO_SIZE];
    RTS_UI32 sent_run; /* in which run of the node `sent` was */
    RTS_UI32 sent_ms;
} CANOPEN_PDO_STATE;

/* Handles that are not in use are RTS_INVALID_HANDLE. */
typedef struct {
    RTS_UI32 kind; /* CANOPEN_SYNC_* */
    RTS_UI32 every_us;
    RTS_UI32 window_us; /* 0: there is none */
    RTS_HANDLE timer;
    RTS_HANDLE window_timer;
    RTS_HANDLE sync_event;
    RTS_HANDLE window_event;
    RTS_UI32 is_open; /* the end of the window is to come */
} CANOPEN_SYNC_STATE;

typedef struct CANOPEN_LINE CANOPEN_LINE;

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
    CANOPEN_SYNC_STATE sync;
    RTS_UI32 is_safe; /* outputs are those of the safe state; for tasks */
    bool attached;
    bool was_off;
    bool is_passive;
    CANOPEN_DEVICE *devices;
    RTS_UI32 device_count;
    CAN_USER user;
    CANOPEN_DEVICE *by_node[CANOPEN_MAX_NODE + 1];
    CANOPEN_PDO_STATE *by_cob[0x800]; /* inputs */
};

typedef struct {
    RTS_UI32 line_count;
    RTS_UI32 device_count;
    RTS_UI32 pdo_count;
    CANOPEN_LINE lines[CAN_CONTROLLERS];
    CANOPEN_DEVICE devices[CANOPEN_ROOM(CANOPEN_MAX_DEVICES)];
    CANOPEN_PDO_STATE pdos[CANOPEN_ROOM(CANOPEN_MAX_PDOS)];
} CANOPEN_SETUP;

/* The PDO of a channel, NULL: none. */
CANOPEN_PDO_STATE *CanopenFindPdo(CANOPEN_SETUP *setup, const IoConfigConnector *connector, RTS_UI32 parameter);
CANOPEN_DEVICE *CanopenFindDevice(CANOPEN_SETUP *setup, const IoConfigConnector *connector);

#if ONLINE_CHANGE
/* Leads all pointers into the configuration on (IoDrvFollowConfiguration). */
void CanopenSetupFollow(CANOPEN_SETUP *setup);
#endif

/* Makes what the connectors of `driver` ask for. ERR_* of IoMgrConfigRefuse. */
RTS_RESULT CanopenSetUp(CANOPEN_SETUP *setup, const IO_DRIVER *driver);

#endif
