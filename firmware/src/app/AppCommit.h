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

/* The slot that is not `slot`; of SLOT_NONE the first. */
RTS_UI32 AppCommitOtherSlot(RTS_UI32 slot);

/*
 * Each of these writes a record that is in force from then on, atomically. ERR_DEVICE flash fault: the one before
 * stays.
 */

/* The image in `slot` is what boots: a trial. */
RTS_RESULT AppCommitInstall(RTS_UI32 slot, RTS_UI32 size, RTS_UI32 crc, RTS_UI32 retain_after);

/* Nothing boots. */
RTS_RESULT AppCommitErase(void);

/* The slot that is not `failed` is what boots; its retain records are those after `retain_after`. */
RTS_RESULT AppCommitRollBack(RTS_UI32 failed, RTS_UI32 retain_after);

/* A new state of the image in `slot`. Writes nothing when it has proven itself, or that is its state already. */
RTS_RESULT AppCommitSetState(RTS_UI32 slot, RTS_UI8 state, RTS_UI8 starts);

#endif
