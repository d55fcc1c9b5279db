/*
 * AppCommit.c - the commit record.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppCommit.h"

#include <string.h>

#include "CmpLog.h"
#include "SysFlashLog.h"

RTS_STATIC_ASSERT(sizeof(COMMIT) == 36, commit_record_is_36_bytes);

enum { COMMIT_TAG = 0x54494D43 };

static struct {
    FLASH_LOG log;
    COMMIT commit;
} record;

static void set_blank(COMMIT *commit)
{
    memset(commit, 0, sizeof *commit);
    commit->active = SLOT_NONE;
}

RTS_RESULT AppCommitOpen(void)
{
    RTS_RESULT result;

    set_blank(&record.commit);
    result = FlashLogOpen(&record.log, FILE_COMMIT);
    if (result != ERR_OK)
        return result;
    if (FlashLogReadNewest(&record.log, COMMIT_TAG, &record.commit, sizeof record.commit) != ERR_OK ||
        (record.commit.active >= SLOT_COUNT && record.commit.active != SLOT_NONE))
        set_blank(&record.commit);
    return ERR_OK;
}

const COMMIT *AppCommitGet(void)
{
    return &record.commit;
}

RTS_UI32 AppCommitOtherSlot(RTS_UI32 slot)
{
    return slot == FILE_SLOT_A ? FILE_SLOT_B : FILE_SLOT_A;
}

static RTS_RESULT write_record(const COMMIT *commit)
{
    RTS_RESULT result = FlashLogAppend(&record.log, COMMIT_TAG, commit, sizeof *commit);

    if (result == ERR_OK)
        record.commit = *commit;
    else
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, result, "The commit record cannot be written");
    return result;
}

RTS_RESULT AppCommitInstall(RTS_UI32 slot, RTS_UI32 size, RTS_UI32 crc, RTS_UI32 retain_after)
{
    COMMIT commit = record.commit;
    const COMMIT_SLOT trial = {size, crc, retain_after, SLOT_TRIAL, 0, 0};

    commit.active = (RTS_UI8)slot;
    commit.slot[slot] = trial;
    return write_record(&commit);
}

RTS_RESULT AppCommitErase(void)
{
    COMMIT commit;

    set_blank(&commit);
    return write_record(&commit);
}

RTS_RESULT AppCommitRollBack(RTS_UI32 failed, RTS_UI32 retain_after)
{
    COMMIT commit = record.commit;
    RTS_UI32 other = AppCommitOtherSlot(failed);

    commit.active = (RTS_UI8)other;
    commit.slot[failed].state = SLOT_FAILED;
    commit.slot[other].retain_after = retain_after;
    return write_record(&commit);
}

RTS_RESULT AppCommitSetState(RTS_UI32 slot, RTS_UI8 state, RTS_UI8 starts)
{
    COMMIT commit = record.commit;
    COMMIT_SLOT *changed = &commit.slot[slot];

    if (changed->state == SLOT_PROVEN || (changed->state == state && changed->starts == starts))
        return ERR_OK;
    changed->state = state;
    changed->starts = starts;
    return write_record(&commit);
}
