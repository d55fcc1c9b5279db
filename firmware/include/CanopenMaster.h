/*
 * CanopenMaster.h - brings CANopen nodes into operation, and back after a loss: one state machine for each node.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A node is reset (communication only), identified, configured by its concise DCF, started, and watched by its heartbeat.
 * What goes wrong is repeated after 0, 1, 2, 4, 8, 8 .. s, also for a node that restarts again and again or shares its
 * number with another one; other nodes are not disturbed. From main; time is an argument.
 * Frames are sent by the function of the owner; false: no room, it is called again in the next pass.
 */
#ifndef CANOPENMASTER_H
#define CANOPENMASTER_H

#include "CanopenSdoClient.h"

typedef enum {
    MASTER_RESET,     /* the command is to be sent */
    MASTER_BOOTS,     /* waits for its boot-up */
    MASTER_IDENTIFY,  /* reads 1000h and 1018h */
    MASTER_CONFIGURE, /* writes its concise DCF */
    MASTER_START,     /* the command is to be sent, once `must_wait` allows it */
    MASTER_STARTS,    /* waits for its heartbeat */
    MASTER_RUNS,
    MASTER_HELD,  /* in the state that a program has commanded */
    MASTER_HALTS, /* the stop command is to be sent; then MASTER_START */
    MASTER_WAITS, /* until the next attempt */
} MASTER_STATE;

/* Letters of CiA 302-2 for why a node did not boot, and others. */
enum {
    MASTER_WHY_NONE = 0,
    MASTER_WHY_SILENT = 'B',        /* no reply to 1000h */
    MASTER_WHY_TYPE = 'C',          /* another 1000h */
    MASTER_WHY_VENDOR = 'D',        /* another 1018h:1 */
    MASTER_WHY_CONFIGURATION = 'J', /* a write was refused */
    MASTER_WHY_NO_HEARTBEAT = 'K',  /* not started */
    MASTER_WHY_PRODUCT = 'M',
    MASTER_WHY_REVISION = 'N',
    MASTER_WHY_LOST = 'h',      /* its heartbeat is missing */
    MASTER_WHY_RESTARTED = 'r', /* it has booted by itself */
    MASTER_WHY_STATE = 's',     /* it has left the operational state */
    MASTER_WHY_LATE = 'p',      /* a PDO is late */
    MASTER_WHY_BUS = 'o',       /* bus off */
    MASTER_WHY_HELD = 'n',      /* a program has commanded another state */
    MASTER_WHY_HALTED = 'q',    /* stopped for the loss of another node */
    MASTER_WHY_DUPLICATE = 'd', /* two devices have its number */
};

enum { CANOPEN_SDO_BUFFER = 8 }; /* bytes that can be read of an identity, which has four */
enum { EXPECTED_TYPE, EXPECTED_VENDOR, EXPECTED_PRODUCT, EXPECTED_REVISION, EXPECTED_COUNT };

/* Counters in the order of CANOPEN_PARAM_BOOTS .. */
typedef struct {
    RTS_UI32 boots;
    RTS_UI32 lost;
    RTS_UI32 timeouts;
    RTS_UI32 aborts;
    RTS_UI32 last_abort;
    RTS_UI32 emcy;
    RTS_UI32 last_emcy;
    RTS_UI32 short_pdos;
} CANOPEN_COUNTERS;

typedef struct {
    RTS_UI8 node;
    RTS_UI32 expected[EXPECTED_COUNT]; /* 0: any */
    const RTS_UI8 *config;             /* entries of the concise DCF */
    RTS_UI32 config_size;
    RTS_UI32 heartbeat_ms; /* its period; 0: it has none */
    RTS_UI32 guard_ms;     /* period of the guarding requests; 0, or with a heartbeat: none */
    RTS_UI32 guard_life;   /* periods without a reply until it is lost */
    /* Of the master. */
    MASTER_STATE state;
    RTS_UI8 why;       /* MASTER_WHY_* of the last failure */
    RTS_UI8 nmt_state; /* of its last heartbeat */
    RTS_UI8 command;   /* what starts it; NMT_STOP, NMT_PREOPERATIONAL: a program does not want it to run */
    bool is_heard;     /* there was a heartbeat */
    RTS_UI32 heard_ms; /* when the last one was */
    bool has_booted;   /* since its last reset, at `booted_ms` */
    RTS_UI32 booted_ms;
    RTS_UI32 ran_ms;  /* since when it runs */
    RTS_UI8 restarts; /* by itself, without a steady run between them */
    RTS_UI8 beats;    /* heartbeats since `beats_ms` */
    RTS_UI32 beats_ms;
    bool is_asked_elsewhere; /* of the owner: another client of SDO is at it, so the manager waits */
    bool must_wait;          /* of the owner: it is not to be started yet */
    RTS_UI8 guard_toggle;    /* that the next guarding reply has */
    RTS_UI32 guarded_ms;     /* when the last guarding request was sent */
    bool repeated;           /* the transfer is the second one */
    RTS_UI32 failures;       /* of attempts and losses */
    RTS_UI32 step;           /* of MASTER_IDENTIFY; of MASTER_CONFIGURE: the place in `config` */
    RTS_UI32 since_ms;       /* of the state; in MASTER_START, _RUNS and _HELD the last heartbeat or guarding reply */
    RTS_UI32 wait_ms;        /* before the next attempt */
    RTS_UI32 found;          /* what it has instead of what is expected */
    RTS_UI16 index;          /* whose write was refused */
    RTS_UI8 sub;
    SDO_CLIENT sdo;
    RTS_UI8 reply[CANOPEN_SDO_BUFFER];
    CANOPEN_COUNTERS counters;
} CANOPEN_NODE;

/* A node whose first fields are set begins with its reset. */
void CanopenNodeBegin(CANOPEN_NODE *node, RTS_UI32 timeout_ms, RTS_UI32 now_ms);

/* A frame of the node: heartbeat, guarding reply, SDO reply or EMCY. */
void CanopenNodeTake(CANOPEN_NODE *node, const CAN_FRAME *frame, RTS_UI32 now_ms);

void CanopenNodePoll(CANOPEN_NODE *node, PF_CANOPEN_SEND send, void *owner, RTS_UI32 now_ms);

/* The owner has seen that it is lost. */
void CanopenNodeLose(CANOPEN_NODE *node, RTS_UI8 why, RTS_UI32 now_ms);

/* A program has sent it a command. The manager keeps it in that state, also after a loss, until it is to run again. */
void CanopenNodeCommand(CANOPEN_NODE *node, RTS_UI8 command, RTS_UI32 now_ms);

/* Stops a node that runs, for the loss of another one. It starts again without a boot, once `must_wait` allows it. */
void CanopenNodeHalt(CANOPEN_NODE *node, RTS_UI32 now_ms);

/* True if it is configured: it runs, or needs only the command to start. */
bool CanopenNodeIsReady(const CANOPEN_NODE *node);

/* True if it has a heartbeat or is guarded. */
bool CanopenNodeIsWatched(const CANOPEN_NODE *node);

/* True while the manager resets it, reads or writes its objects, so that no other client may. */
bool CanopenNodeIsAsked(const CANOPEN_NODE *node);

/* True if its heartbeat or guarding reply is not late. */
bool CanopenNodeIsHeard(const CANOPEN_NODE *node, RTS_UI32 now_ms);

/* Returns the time until the next call is due even if no frame arrives [ms]; UINT32_MAX: none. */
RTS_UI32 CanopenNodeGetWaitMs(const CANOPEN_NODE *node, RTS_UI32 now_ms);

/* Sends a command to a node; false: no room. */
bool CanopenSendNmt(PF_CANOPEN_SEND send, void *owner, RTS_UI8 command, RTS_UI8 node);

/* True if the concise DCF of `size` bytes, a count and entries, is whole. */
bool CanopenIsConfig(const RTS_UI8 *config, RTS_UI32 size);

#endif
