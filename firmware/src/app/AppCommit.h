/*
 * AppCommit.h - which slot holds the application: the commit record.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Each record is the whole truth about both slots, so the newest valid one is all there is to know. From main only.
 */
#ifndef APPCOMMIT_H
#define APPCOMMIT_H

#include "CmpErrors.h"
#include "CmpStd.h"

/* What is known about the image in a slot. */
enum {
    SLOT_EMPTY = 0,
    SLOT_TRIAL = 1,   /* downloaded; stopped in good order since it was last started */
    SLOT_STARTED = 2, /* started `starts` times without having proven itself */
    SLOT_PROVEN = 3,  /* ran for APP_PROVE_US without exception */
    SLOT_FAILED = 4,  /* had an exception before it was proven */
};

enum { SLOT_COUNT = 2, SLOT_NONE = 0xFF };

typedef struct {
    RTS_UI32 size;
    RTS_UI32 crc;
    RTS_UI32 retain_after; /* retain records up to this number are not of this application */
    RTS_UI8 state;         /* SLOT_* */
    RTS_UI8 starts;
    RTS_UI16 reserved;
} COMMIT_SLOT;

typedef struct {
    RTS_UI8 active; /* slot of the application, SLOT_NONE without one */
    RTS_UI8 reserved[3];
    COMMIT_SLOT slot[SLOT_COUNT];
} COMMIT;

/* Finds the newest record. */
RTS_RESULT AppCommitOpen(void);

/* The record in force. */
const COMMIT *AppCommitGet(void);

/* Makes `commit` the record in force, atomically. ERR_DEVICE flash fault: the one before stays. */
RTS_RESULT AppCommitWrite(const COMMIT *commit);

/* Writes a new state of one slot; nothing when it has that state already. */
RTS_RESULT AppCommitSetState(RTS_UI32 slot, RTS_UI8 state, RTS_UI8 starts);

#endif
