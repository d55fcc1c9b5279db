/*
 * AppCommit.c - seals and commit records.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppCommit.h"

#include <string.h>

#include "AppException.h"
#include "../load/AppLoader.h"
#include "AppPassword.h"
#include "CMUtils.h"
#include "CmpBytes.h"
#include "CmpItf.h"
#include "CmpLog.h"
#include "CmpSrvNumbers.h"
#include "CompactDownload.h"
#include "SysExcept.h"
#include "SysFlash.h"
#include "SysFlashLog.h"

enum { BEGUN_MAX = 0xFE };

RTS_STATIC_ASSERT(sizeof(APP_SEAL) == FILE_ALIGN, a_seal_is_programmed_at_once);

static RTS_RESULT write_record(const char *text);

static struct {
    FLASH_LOG log; /* its `opened` says whether anything is known */
    COMMIT commit; /* what is in flash, or should be and could not be written */
#if BOOT_ON_DEMAND
    bool tried;    /* the active slot has no seal */
    COMMIT booted; /* what is in flash then */
#endif
#if COMM_PASSWORD
    USER_VERIFIER password; /* also when the commit of its record does not count */
#endif
} state;

RTS_RESULT AppCommitResult(void)
{
    return state.log.opened;
}

const COMMIT *AppCommitGet(void)
{
    return &state.commit;
}

bool AppCommitIsProven(RTS_UI32 slot)
{
    RTS_UI8 state = AppCommitGet()->state[slot];

    return state == SLOT_PROVEN || state == SLOT_HALTED;
}

bool AppCommitIsDead(void)
{
    RTS_UI8 active = state.commit.active;

    return active < SLOT_COUNT && state.commit.state[active] >= SLOT_FAILED;
}

RTS_UI32 AppCommitOtherSlot(RTS_UI32 slot)
{
    return slot == FILE_SLOT_A ? FILE_SLOT_B : FILE_SLOT_A;
}

void AppCommitWipe(RTS_UI32 slot)
{
    (void)SysFileErase(slot, 0, SysFlashGet()->sector_size);
}

/* ---- seals ---- */

RTS_UI32 AppSealCheck(const APP_SEAL *seal)
{
    return ~(seal->number ^ seal->crc ^ seal->retain_after);
}

/* Takes over a slot when the image in it is whole and has a seal with a number above `known`. Returns whether the record
 * may be true: false when it must have known the seal, and tells of another image. A seal may remain from an image of
 * which a download has written only a part again. */
static bool take_seal(RTS_UI32 slot, RTS_UI32 known)
{
    const COMMIT_SLOT *recorded = &state.commit.slot[slot];
    CDL_HEADER header;
    APP_SEAL seal;
    bool newer;
    RTS_UI32 crc;

    if (SysFileRead(slot, 0, &header, sizeof header) != ERR_OK ||
        SysFileRead(slot, SysFileAlign(header.total_size), &seal, sizeof seal) != ERR_OK ||
        seal.check != AppSealCheck(&seal) || seal.crc != header.crc)
        return true;
    newer = (RTS_I32)(seal.number - known) > 0;
    if (!newer && (recorded->size == 0 || recorded->crc == seal.crc))
        return true;
    if (AppLoaderCRC32(slot, &header, &crc) != ERR_OK || crc != seal.crc)
        return true;
    if (!newer)
        return false;
    state.commit.slot[slot] = (COMMIT_SLOT){header.total_size, seal.crc, seal.retain_after};
    state.commit.state[slot] = SLOT_TRIAL;
    if ((RTS_I32)(seal.number - state.commit.number) > 0) {
        state.commit.number = seal.number;
        state.commit.active = (RTS_UI8)slot;
        state.commit.begun = 0;
    }
    return true;
}

static bool take_seals(void)
{
    RTS_UI32 known = state.commit.number;
    bool agrees = take_seal(FILE_SLOT_A, known);

    return take_seal(FILE_SLOT_B, known) && agrees;
}

RTS_RESULT AppCommitInstall(RTS_UI32 slot, RTS_UI32 crc, RTS_UI32 retain_after)
{
    APP_SEAL seal = {state.commit.number + 1, crc, retain_after, 0};

    seal.check = AppSealCheck(&seal);
    if (SysFileWrite(slot, &seal, sizeof seal) == ERR_OK && SysFileClose(slot) == ERR_OK)
        (void)take_seals();
    if (state.commit.active == slot)
        return ERR_OK;
    AppCommitWipe(slot);
    return ERR_DEVICE;
}

/* ---- an image that is tried ---- */

#if BOOT_ON_DEMAND
void AppCommitTry(RTS_UI32 slot, RTS_UI32 size, RTS_UI32 crc, RTS_UI32 retain_after)
{
    state.booted = state.commit;
    state.tried = true;
    state.commit.slot[slot] = (COMMIT_SLOT){size, crc, retain_after};
    state.commit.state[slot] = SLOT_TRIAL;
    state.commit.active = (RTS_UI8)slot;
    state.commit.begun = 0;
}

bool AppCommitIsTried(void)
{
    return state.tried;
}

RTS_RESULT AppCommitSeal(void)
{
    RTS_UI32 slot = state.commit.active;
    const COMMIT_SLOT *image = &state.commit.slot[slot];
    APP_SEAL seal = {state.commit.number + 1, image->crc, image->retain_after, 0};

    seal.check = AppSealCheck(&seal);
    if (SysFileWrite(slot, &seal, sizeof seal) != ERR_OK || SysFileClose(slot) != ERR_OK)
        return ERR_DEVICE;
    state.commit.number = seal.number;
    state.tried = false;
    (void)write_record(""); /* what is known of it; without this record it is a trial, as after a download */
    return ERR_OK;
}

void AppCommitEndTry(void)
{
    if (state.tried)
        state.commit = state.booted;
    state.tried = false;
}
#endif

/* ---- records ---- */

static RTS_UI32 record_tag(void)
{
    return COMMIT_TAG + SysFileGetArea(FILE_SLOT_B)->offset;
}

#if COMM_PASSWORD
/* Whether a tool can have set it. */
static bool is_password(const USER_VERIFIER *verifier)
{
    static const USER_VERIFIER none;
    RTS_UI32 iterations = BytesGet32(verifier->iterations);

    return iterations >= PASSWORD_MIN_ITERATIONS && iterations <= PASSWORD_MAX_ITERATIONS &&
           memcmp(verifier->key, none.key, sizeof none.key) != 0;
}
#endif

/* A record may hold anything: what is no password shall not lock the device. */
static void take_password(const COMMIT_RECORD *record)
{
#if COMM_PASSWORD
    if (is_password(&record->password))
        state.password = record->password;
#else
    RTS_UNUSED(record);
#endif
}

static void put_password(COMMIT_RECORD *record)
{
#if COMM_PASSWORD
    record->password = state.password;
#else
    RTS_UNUSED(record);
#endif
}

static RTS_RESULT read_record(void)
{
    COMMIT_RECORD record;
    void *data = COMMIT_HAS_CAUSE ? (void *)&record : (void *)&state.commit;
    RTS_RESULT result = FlashLogReadNewest(&state.log, record_tag(), data, COMMIT_RECORD_SIZE);

    if (COMMIT_HAS_CAUSE && result == ERR_OK) {
        state.commit = record.commit;
        take_password(&record);
        record.text[sizeof record.text - 1] = '\0'; /* whatever the flash holds */
        if (AppCommitIsDead())
            AppExceptionSet(&record.exception, record.text);
    }
    return result;
}

/* Without a record of ours the seals are all there is. */
static void report_loss(void)
{
    if (state.log.sequence != 0)
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, ERR_VERSION_MISMATCH, "Flash laid out by another firmware");
    if (state.commit.active != SLOT_NONE)
        LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING, ERR_NO_OBJECT,
               COMM_PASSWORD ? "No commit record: newest program taken, no password known"
                             : "No commit record: newest program taken");
}

static void forget_record(void)
{
    memset(&state.commit, 0, sizeof state.commit);
    state.commit.active = SLOT_NONE;
}

static void forget_password(void)
{
#if COMM_PASSWORD
    memset(&state.password, 0, sizeof state.password);
#endif
}

/* Whether there is a password is not known: nothing logs in, since no key is the hash of anything known. */
static void lock(void)
{
#if COMM_PASSWORD
    BytesPut32(state.password.iterations, PASSWORD_MIN_ITERATIONS);
    LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, ERR_DEVICE, "Password cannot be read: no login without a reset of it");
#endif
}

void AppCommitOpen(void)
{
    RTS_RESULT result;
    bool known;

    (void)FlashLogOpen(&state.log, FILE_COMMIT);
#if BOOT_ON_DEMAND
    state.tried = false;
#endif
    forget_record();
    forget_password();
    result = read_record();
    if (result != ERR_OK && result != ERR_NO_OBJECT)
        state.log.opened = result;
    known = result == ERR_OK || state.log.opened == ERR_OK;
    if (result == ERR_OK && FlashLogIsMarked(&state.log, COMMIT_RECORD_SIZE))
        state.commit.begun = 0;
    if (!take_seals() || (state.commit.active >= SLOT_COUNT && state.commit.active != SLOT_NONE)) {
        forget_record(); /* not one of ours: the seals count */
        (void)take_seals();
        result = ERR_NO_OBJECT;
    }
    if (result != ERR_OK)
        report_loss();
    if (!known && state.commit.active != SLOT_NONE) /* else there is nothing to keep, and nothing is taken */
        lock();
}

void AppCommitTakeBack(RTS_UI32 slot)
{
    AppCommitWipe(slot);
    AppCommitOpen();
}

/* What a record may know. */
static const COMMIT *in_flash(void)
{
#if BOOT_ON_DEMAND
    if (state.tried)
        return &state.booted;
#endif
    return &state.commit;
}

/* Writes what has been changed. */
static RTS_RESULT write_record(const char *text)
{
    COMMIT_RECORD record;
    const void *data = COMMIT_HAS_CAUSE ? (void *)&record : (void *)&state.commit;
    RTS_RESULT result;

    if (COMMIT_HAS_CAUSE) {
        memset(&record, 0, sizeof record);
        record.commit = *in_flash();
        if (!AppCommitIsTried())
            record.exception = *AppExceptionGet();
        put_password(&record);
        if (APP_CRASH_TEXT_SIZE > 1)
            memcpy(record.text, text, CMUtlStrNLen(text, sizeof record.text - 1));
    }
    result = FlashLogAppend(&state.log, record_tag(), data, COMMIT_RECORD_SIZE);
    if (result != ERR_OK && state.log.opened == ERR_OK)
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, result, "Commit record cannot be written");
    return result;
}

RTS_RESULT AppCommitErase(void)
{
    const COMMIT before = state.commit;
    RTS_RESULT result;

    AppCommitEndTry();
    forget_record();
    state.commit.number = before.number;
    result = write_record("");
    if (result != ERR_OK) {
        state.commit = before;
        (void)write_record(""); /* the record may be there in spite of the error */
    }
    return result;
}

RTS_RESULT AppCommitRollBack(RTS_UI32 failed, RTS_UI32 retain_after)
{
    RTS_UI32 other = AppCommitOtherSlot(failed);
    RTS_RESULT result;

    AppCommitEndTry();
    state.commit.active = (RTS_UI8)other;
    state.commit.begun = 0;
    state.commit.state[failed] = SLOT_FAILED;
    state.commit.slot[other].retain_after = retain_after;
    result = write_record("");
    if (result == ERR_OK)
        AppCommitWipe(failed);
    return result;
}

RTS_RESULT AppCommitSetState(RTS_UI32 slot, RTS_UI8 changed)
{
    RTS_UI8 before = state.commit.state[slot];
    RTS_RESULT result;

    if (before == SLOT_PROVEN || before == changed)
        return ERR_OK;
    if (AppCommitIsTried()) {
        if (changed == SLOT_PROVEN) /* what the previous one needs is kept */
            return ERR_PENDING;
        state.commit.state[slot] = changed;
        return ERR_OK;
    }
    state.commit.state[slot] = changed;
    result = write_record("");
    if (result != ERR_OK && changed != SLOT_FAILED)
        state.commit.state[slot] = before; /* tried again */
    return result;
}

void AppCommitSetDead(const char *text)
{
    RTS_UI8 *dead = &state.commit.state[state.commit.active];

    *dead = *dead == SLOT_PROVEN ? SLOT_HALTED : SLOT_FAILED;
    state.commit.begun = 0;
    if (!AppCommitIsTried())
        (void)write_record(text);
}

void AppCommitBegin(RTS_UI32 slot)
{
    RTS_UI8 *begun = &state.commit.state[state.commit.active];

    if ((FLASH_READS_FAIL && slot != state.commit.active) || AppCommitIsTried())
        return;
    if (*begun == SLOT_HALTED)
        *begun = SLOT_PROVEN;
    if (state.commit.begun < BEGUN_MAX)
        state.commit.begun++;
    (void)write_record("");
}

void AppCommitDone(RTS_UI32 slot)
{
    if ((FLASH_READS_FAIL && slot != state.commit.active) || AppCommitIsTried())
        return;
    state.commit.begun = 0;
    if (FlashLogMark(&state.log) != ERR_OK)
        (void)write_record(""); /* says so as well */
}

/* ---- the password ---- */

#if COMM_PASSWORD

const USER_VERIFIER *AppPasswordGet(void)
{
    return &state.password;
}

bool AppHasPassword(void)
{
    return BytesGet32(state.password.iterations) != 0;
}

/* The port's words in the newest record, which the next one shall have as well. */
static void read_text(char *text)
{
    COMMIT_RECORD record;

    text[0] = '\0';
    if (APP_CRASH_TEXT_SIZE > 1 && FlashLogReadNewest(&state.log, record_tag(), &record, sizeof record) == ERR_OK)
        memcpy(text, record.text, sizeof record.text);
    text[APP_CRASH_TEXT_SIZE - 1] = '\0';
}

/* A lost sector costs one of two records. */
static RTS_RESULT write_twice(const char *text)
{
    RTS_RESULT result = write_record(text);

    if (result == ERR_OK) {
        FlashLogTurn(&state.log);
        (void)write_record(text);
    }
    return result;
}

RTS_RESULT AppPasswordSet(const USER_VERIFIER *verifier)
{
    const USER_VERIFIER before = state.password;
    char text[APP_CRASH_TEXT_SIZE];
    RTS_RESULT result;

    if (BytesGet32(verifier->iterations) != 0 && !is_password(verifier))
        return ERR_PARAMETER;
    read_text(text);
    state.password = *verifier;
    result = write_twice(text);
    if (result != ERR_OK) {
        state.password = before;
        (void)write_record(text); /* the record may be there in spite of the error */
    }
    return result;
}

RTS_RESULT AppPasswordReset(void)
{
    static const USER_VERIFIER none;
    RTS_RESULT result;

    AppCommitOpen();
    if (!AppHasPassword())
        return ERR_NO_OBJECT;
    if (AppCommitResult() != ERR_OK)
        FlashLogRenew(&state.log);
    result = AppPasswordSet(&none);
    if (result != ERR_OK) {
        FlashLogTurn(&state.log); /* the other half may be sound */
        result = AppPasswordSet(&none);
    }
    return result;
}

#endif
