/*
 * AppCommit.c - seals and commit records.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppCommit.h"

#include <string.h>

#include "AppException.h"
#include "CMUtils.h"
#include "CmpChecksum.h"
#include "CmpLog.h"
#include "CompactDownload.h"
#include "SysExcept.h"
#include "SysFlash.h"
#include "SysFlashLog.h"

RTS_STATIC_ASSERT(sizeof(COMMIT) == 32, commit_is_32_bytes);

enum { COMMIT_TAG = 0x324D4D43, BEGUN_MAX = 0xFE };

/* What the log holds. */
typedef struct {
    COMMIT commit;
    RTS_UI32 map; /* of the flash: SysFileGetMap */
    COMMIT_CAUSE cause;
} RECORD;

/* The first unit after an image. */
typedef struct {
    RTS_UI32 number;
    RTS_UI32 crc; /* of the image */
    RTS_UI32 retain_after;
    RTS_UI32 check; /* CRC of the words above */
} SEAL;

RTS_STATIC_ASSERT(sizeof(SEAL) == FILE_ALIGN, a_seal_is_programmed_at_once);

static struct {
    FLASH_LOG log;
    RTS_RESULT opened;
    COMMIT commit;
} state;

RTS_RESULT AppCommitResult(void)
{
    return state.opened;
}

const COMMIT *AppCommitGet(void)
{
    return &state.commit;
}

RTS_UI32 AppCommitOtherSlot(RTS_UI32 slot)
{
    return slot == FILE_SLOT_A ? FILE_SLOT_B : FILE_SLOT_A;
}

/* ---- seals ---- */

static RTS_UI32 seal_check(const SEAL *seal)
{
    return CRC32Update(0, seal, offsetof(SEAL, check));
}

/* Reads the seal of the image that the header in `slot` tells of; false when there is none. */
static bool read_seal(RTS_UI32 slot, SEAL *seal, RTS_UI32 *size)
{
    CDL_HEADER header;

    if (SysFileRead(slot, 0, &header, sizeof header) != ERR_OK)
        return false;
    *size = header.total_size;
    return SysFileRead(slot, SysFileAlign(header.total_size), seal, sizeof *seal) == ERR_OK &&
           seal->check == seal_check(seal) && seal->crc == header.crc;
}

static bool is_newer(RTS_UI32 a, RTS_UI32 b)
{
    return (RTS_I32)(a - b) > 0;
}

/* Takes over the slots whose seal is newer than what is known. */
static void take_seals(void)
{
    RTS_UI32 known = state.commit.number;
    RTS_UI32 slot;
    RTS_UI32 size;
    SEAL seal;

    for (slot = 0; slot < SLOT_COUNT; slot++) {
        if (!read_seal(slot, &seal, &size) || !is_newer(seal.number, known))
            continue;
        state.commit.slot[slot] = (COMMIT_SLOT){size, seal.crc, seal.retain_after};
        state.commit.state[slot] = SLOT_TRIAL;
        if (is_newer(seal.number, state.commit.number)) {
            state.commit.number = seal.number;
            state.commit.active = (RTS_UI8)slot;
            state.commit.begun = 0;
        }
    }
}

void AppCommitWipe(RTS_UI32 slot)
{
    (void)SysFileErase(slot, 0, SysFlashGet()->sector_size);
}

RTS_RESULT AppCommitInstall(RTS_UI32 slot, RTS_UI32 crc, RTS_UI32 retain_after)
{
    SEAL seal = {state.commit.number + 1, crc, retain_after, 0};
    RTS_RESULT result;

    seal.check = seal_check(&seal);
    result = SysFileWrite(slot, &seal, sizeof seal);
    if (result == ERR_OK)
        result = SysFileClose(slot);
    if (result == ERR_OK)
        take_seals();
    if (state.commit.active == slot)
        return ERR_OK;
    AppCommitWipe(slot);
    return ERR_DEVICE;
}

/* ---- records ---- */

static RTS_RESULT read_record(RECORD *record)
{
    return FlashLogReadNewest(&state.log, COMMIT_TAG, record, sizeof *record);
}

static void set_blank(COMMIT *commit)
{
    RTS_UI32 number = commit->number;

    memset(commit, 0, sizeof *commit);
    commit->active = SLOT_NONE;
    commit->number = number;
}

/* Takes a record over, and the layout of the flash it was written with, unless nothing lies there. */
static void take_record(const RECORD *record)
{
    const COMMIT *commit = &record->commit;
    RTS_UI32 own = SysFileGetMap();

    if (commit->active >= SLOT_COUNT)
        state.commit.number = commit->number;
    else if (!SysFileUseMap(record->map))
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, ERR_VERSION_MISMATCH,
               "The flash has the layout of another firmware: programs may not be found");
    else
        state.commit = *commit;
    if (own != SysFileGetMap())
        LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING, ERR_VERSION_MISMATCH,
               "The flash keeps the layout of another firmware: slots of %u bytes, not %u", (unsigned)record->map,
               (unsigned)own);
    if (state.commit.begun != 0 && FlashLogIsMarked(&state.log, sizeof *record))
        state.commit.begun = 0;
}

RTS_RESULT AppCommitOpen(void)
{
    RECORD record;

    state.commit.number = 0;
    set_blank(&state.commit);
    state.opened = FlashLogOpen(&state.log, FILE_COMMIT);
    if (state.opened == ERR_OK)
        state.opened = read_record(&record);
    if (state.opened == ERR_OK)
        take_record(&record);
    else if (state.opened != ERR_NO_OBJECT)
        return state.opened;
    take_seals();
    if (state.opened == ERR_NO_OBJECT && state.commit.active != SLOT_NONE)
        LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING, ERR_NO_OBJECT, "No commit record: the newest application boots");
    state.opened = ERR_OK;
    return ERR_OK;
}

bool AppCommitGetCause(COMMIT_CAUSE *cause)
{
    RECORD record;

    if (read_record(&record) != ERR_OK)
        return false;
    *cause = record.cause;
    cause->text[sizeof cause->text - 1] = '\0';
    return cause->exception.code != RTSEXCPT_NOEXCEPTION;
}

/* It is in force when it can be read, whatever failed. */
static RTS_RESULT write_record(const COMMIT *commit, const char *text)
{
    RTS_UI32 newest = state.log.newest;
    RECORD record;
    RTS_RESULT result;

    memset(&record, 0, sizeof record);
    record.commit = *commit;
    record.map = SysFileGetMap();
    record.cause.exception = *AppExceptionGet();
    memcpy(record.cause.text, text, CMUtlStrNLen(text, sizeof record.cause.text - 1));
    result = FlashLogAppend(&state.log, COMMIT_TAG, &record, sizeof record);
    if (result == ERR_OK || state.log.newest != newest)
        state.commit = *commit;
    if (result != ERR_OK)
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, result, "The commit record cannot be written");
    return result;
}

RTS_RESULT AppCommitErase(void)
{
    COMMIT commit = state.commit;

    set_blank(&commit);
    return write_record(&commit, "");
}

RTS_RESULT AppCommitRollBack(RTS_UI32 failed, RTS_UI32 retain_after)
{
    COMMIT commit = state.commit;
    RTS_UI32 other = AppCommitOtherSlot(failed);
    RTS_RESULT result;

    commit.active = (RTS_UI8)other;
    commit.begun = 0;
    commit.state[failed] = SLOT_FAILED;
    commit.slot[other].retain_after = retain_after;
    result = write_record(&commit, "");
    if (result == ERR_OK)
        AppCommitWipe(failed);
    return result;
}

RTS_RESULT AppCommitSetState(RTS_UI32 slot, RTS_UI8 new_state)
{
    COMMIT commit = state.commit;

    if (commit.state[slot] == SLOT_PROVEN || commit.state[slot] == new_state)
        return ERR_OK;
    commit.state[slot] = new_state;
    return write_record(&commit, "");
}

RTS_RESULT AppCommitSetDead(const char *text)
{
    COMMIT commit = state.commit;
    RTS_UI8 *dead = &commit.state[commit.active];

    *dead = *dead == SLOT_PROVEN ? SLOT_HALTED : SLOT_FAILED;
    commit.begun = 0;
    return write_record(&commit, text);
}

void AppCommitBegin(void)
{
    COMMIT commit = state.commit;

    if (commit.begun < BEGUN_MAX)
        commit.begun++;
    if (commit.state[commit.active] == SLOT_HALTED)
        commit.state[commit.active] = SLOT_PROVEN;
    (void)write_record(&commit, "");
}

/* A unit that is programmed after the record says so; without room for it, another record does. */
void AppCommitDone(void)
{
    COMMIT commit = state.commit;

    commit.begun = 0;
    if (state.commit.begun == 0)
        return;
    if (FlashLogMark(&state.log) == ERR_OK)
        state.commit = commit;
    else
        (void)write_record(&commit, "");
}
