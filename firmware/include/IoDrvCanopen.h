/*
 * IoDrvCanopen.h - driver of CANopen nodes, whose manager this device is: its parameters (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Driver "IoDrvCanopen". A network is a connector CT_MASTER, its nodes are its children (CT_SLAVE). The PDOs of a node
 * are numbered from 0 without gaps; a channel is in the data of one, whose parameter it has.
 */
#ifndef IODRVCANOPEN_H
#define IODRVCANOPEN_H

#include "CmpStd.h"

/* flags of CANOPEN_PDO */
enum {
    CANOPEN_PDO_OUTPUT = 1, /* we send it: an RPDO of the node */
    CANOPEN_PDO_SYNC = 2,   /* sent after each SYNC, else on change */
};

/* Who sends SYNC. */
enum {
    CANOPEN_SYNC_NONE = 0,
    CANOPEN_SYNC_IN_BUS_CYCLE = 1,
    CANOPEN_SYNC_BY_TIMER = 2,
    CANOPEN_SYNC_OF_OTHERS = 3, /* it is received */
};

/* What happens to the other nodes of the network while a node is lost. */
enum {
    CANOPEN_LOST_CONTINUE = 0,
    CANOPEN_LOST_SAFE = 1, /* their outputs become what the configuration says for the safe state */
    CANOPEN_LOST_STOP = 2, /* they are stopped */
};

/* A PDO that is exchanged with a node. */
typedef struct {
    RTS_UI16 cob; /* its identifier */
    RTS_UI8 size; /* bytes, 1..8 */
    RTS_UI8 flags;
    RTS_UI16 event_ms;    /* outputs: sent at least so often, 0: on change only */
    RTS_UI16 deadline_ms; /* inputs: the node is lost without it for so long, 0: never */
} CANOPEN_PDO;

enum {
    CANOPEN_PARAM_NETWORK = 1,         /* of a network: number of the CAN controller, 0 if missing */
    CANOPEN_PARAM_NODE = 2,            /* 1..127; of a network our own, 0 or missing: no heartbeat of ours */
    CANOPEN_PARAM_HEARTBEAT = 3,       /* [ms] of a network: ours; of a node: its own, 0 or missing: none */
    CANOPEN_PARAM_SYNC = 4,            /* of a network: CANOPEN_SYNC_* */
    CANOPEN_PARAM_TIMEOUT = 5,         /* of a node [ms]: for a reply to SDO, 1000 if missing */
    CANOPEN_PARAM_EXPECTED = 6,        /* of a node: 1000h and 1018h:1 to 3, u32 each, 0: any */
    CANOPEN_PARAM_CONFIG = 7,          /* of a node: its concise DCF (1F22h), bytes */
    CANOPEN_PARAM_SYNC_COUNTER = 0x58, /* of a network, whose SYNC has a counter up to it, 0 or missing: none */
    CANOPEN_PARAM_TIME = 0x59,         /* of a network [ms]: how often we send TIME, 0 or missing: never */
    CANOPEN_PARAM_REQUIRED = 0xC0,    /* of a node, 1: no node is started before this one is ready for the first time */
    CANOPEN_PARAM_ON_LOST = 0xC1,     /* of a node: CANOPEN_LOST_* */
    CANOPEN_PARAM_GUARD = 0xC2,       /* of a node without heartbeat [ms]: period of guarding, 0 or missing: none */
    CANOPEN_PARAM_GUARD_LIFE = 0xC3,  /* periods without a reply until it is lost */
    CANOPEN_PARAM_SYNC_EVERY = 0xC4,  /* of a network [us]: period of CANOPEN_SYNC_BY_TIMER */
    CANOPEN_PARAM_SYNC_WINDOW = 0xC5, /* [us] from SYNC to the event of the window, 0 or missing: none */
    CANOPEN_PARAM_SYNC_EVENT = 0xC6,  /* text: name of the event at each SYNC */
    CANOPEN_PARAM_WINDOW_EVENT = 0xC7, /* text: name of the event at the end of the window */
    CANOPEN_PARAM_PDO = 0x1000,        /* + n: a CANOPEN_PDO */
    /* To be read only, u32 each, of a node: */
    CANOPEN_PARAM_BOOTS = 0x8000,
    CANOPEN_PARAM_LOST = 0x8001,
    CANOPEN_PARAM_TIMEOUTS = 0x8002, /* of SDO */
    CANOPEN_PARAM_ABORTS = 0x8003,
    CANOPEN_PARAM_LAST_ABORT = 0x8004,
    CANOPEN_PARAM_EMCY = 0x8005,
    CANOPEN_PARAM_LAST_EMCY = 0x8006,
    CANOPEN_PARAM_SHORT = 0x8007,   /* PDOs that were shorter than their mapping, and not used */
    CANOPEN_PARAM_STATE = 0x8008,   /* of its last heartbeat */
    CANOPEN_PARAM_OBJECT = 0x10000, /* from here on index << 8 + sub-index: an object of the node, by SDO */
};

#ifndef RTS_CFFI
#include "CmpItf.h"
RTS_STATIC_ASSERT(sizeof(CANOPEN_PDO) == 8, canopen_pdo_is_8_bytes);
RTS_RESULT IoDrvCanopen_Hook(CMP_HOOK hook);
#endif

#endif
