/*
 * AppRecord.h - what the flash says of the programs in its slots (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A seal follows the image in a slot: the device, or who programmed its flash, has put all of it there. Commit records
 * in a log (SysFlashLog.h) say what happened since. AppCommit.h is what reads and writes both.
 */
#ifndef APPRECORD_H
#define APPRECORD_H

#include "AppException.h"
#include "CmpStd.h"

/* What is known about the image in a slot. */
enum {
    SLOT_EMPTY = 0,
    SLOT_TRIAL = 1,   /* downloaded; stopped in good order since it was last started */
    SLOT_STARTED = 2, /* started, and has not proven itself yet */
    SLOT_PROVEN = 3,  /* ran for APP_PROVE_US without exception */
    SLOT_FAILED = 4,  /* failed before it was proven: run on request only */
    SLOT_HALTED = 5,  /* proven, but failed in its initialisation: run on request only */
};

enum { SLOT_COUNT = 2, SLOT_NONE = 0xFF };

/* The first unit after an image, programmed when all else is in flash and checked. */
typedef struct {
    RTS_UI32 number; /* from 1 */
    RTS_UI32 crc;    /* of the image */
    RTS_UI32 retain_after;
    RTS_UI32 check; /* AppSealCheck: that it was programmed whole; the image has a CRC of its own */
} APP_SEAL;

RTS_UI32 AppSealCheck(const APP_SEAL *seal);

typedef struct {
    RTS_UI32 size;
    RTS_UI32 crc;
    RTS_UI32 retain_after; /* retain records up to this number are not of this application */
} COMMIT_SLOT;

typedef struct {
    RTS_UI8 active;            /* slot of the application, SLOT_NONE without one */
    RTS_UI8 begun;             /* how many initialisations of it in a row were begun and not finished */
    RTS_UI8 state[SLOT_COUNT]; /* SLOT_* */
    RTS_UI32 number;           /* of the newest seal */
    COMMIT_SLOT slot[SLOT_COUNT];
} COMMIT;

/* The tag of a record is this and the offset of slot B: another layout of the flash is another kind of record, because
 * it would mean other places. */
enum { COMMIT_TAG = 0x324D4D43 };

#ifndef RTS_CFFI

#include "CmpPackets.h"
#include "rts_config.h"

/* A record: the commit, and with it why the application failed, which is of no use without a log. */
typedef struct {
    COMMIT commit;
    APP_EXCEPTION exception;        /* that the active application is in; all zero when it is in none */
    char text[APP_CRASH_TEXT_SIZE]; /* the port's words, "" without */
#if COMM_PASSWORD
    USER_VERIFIER password;
#endif
} COMMIT_RECORD;

enum {
    COMMIT_HAS_CAUSE = LOG_MAX_ENTRIES > 0,
    COMMIT_RECORD_SIZE = COMMIT_HAS_CAUSE ? sizeof(COMMIT_RECORD) : sizeof(COMMIT),
};

RTS_STATIC_ASSERT(sizeof(COMMIT) == 32, commit_is_32_bytes);
RTS_STATIC_ASSERT(COMMIT_HAS_CAUSE || !COMM_PASSWORD, a_password_is_in_the_whole_record);

#endif

#endif
