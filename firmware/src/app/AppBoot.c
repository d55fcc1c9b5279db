/*
 * AppBoot.c - what runs after a start-up: the boot project, or the application before it when that fails.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "App.h"
#include "AppCommit.h"
#include "CmpLog.h"
#include "CmpRetain.h"

/* How often an application may be started without proving itself: while there is one to go back to, and when there is
 * none. Beyond the second the device takes it for the reason of its restarts and leaves it stopped. */
enum { STARTS_WITHOUT_PROOF = 2, STARTS_WITHOUT_FALLBACK = 10 };

static bool load_from_slot(RTS_UI32 slot, RTS_UI32 retain_until)
{
    const COMMIT_SLOT *committed = &AppCommitGet()->slot[slot];
    const RTS_UI8 *code;
    APP_REFUSAL refusal;
    APP_IMAGE image;
    RTS_RESULT result = AppLoaderCheck(slot, committed->size, committed->crc, &image, &refusal);

    if (result != ERR_OK) {
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, result, "Boot project refused: %s", refusal.text);
        return false;
    }
    code = AppMapCode(&image);
    return code != NULL && AppLoad(&image, code, retain_until) == ERR_OK;
}

bool AppRollBack(RTS_UI32 failed)
{
    const COMMIT *commit = AppCommitGet();
    RTS_UI32 other = AppCommitOtherSlot(failed);
    RTS_UI32 retain_until = commit->slot[failed].retain_after;
    RTS_UI32 retain_after;

    if (commit->slot[other].state == SLOT_EMPTY || commit->slot[other].state == SLOT_FAILED ||
        !load_from_slot(other, retain_until))
        return false;
    /* A record of its own numbers its retain variables as newest before the commit makes it so. */
    RetainKeep(retain_until);
    retain_after = RetainGetSequence();
    (void)RetainSave(true);
    (void)AppCommitRollBack(failed, retain_after);
    RetainKeepNone();
    LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING, ERR_OK, "The new application failed: back to the one before");
    return true;
}

static bool has_died(const COMMIT_SLOT *slot, RTS_UI32 starts)
{
    return slot->state == SLOT_FAILED || (slot->state == SLOT_STARTED && slot->starts >= starts);
}

/* Loads what shall run; false when there is nothing. */
static bool load_boot_project(RTS_UI32 active)
{
    if (has_died(&AppCommitGet()->slot[active], STARTS_WITHOUT_PROOF) && AppRollBack(active))
        return true;
    return load_from_slot(active, RetainGetSequence()) || AppRollBack(active);
}

/* A boot project starts by itself; one that died stays stopped when there is none to go back to. */
static void run_boot_project(RTS_UI32 active)
{
    const COMMIT_SLOT *slot;

    if (active == SLOT_NONE) {
        LogAdd(CMPID_CmpAppEmbedded, LOG_INFO, ERR_OK, "No boot project");
        return;
    }
    if (!load_boot_project(active))
        return;
    slot = &AppCommitGet()->slot[AppGetSlot()];
    if (has_died(slot, STARTS_WITHOUT_FALLBACK))
        LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING, ERR_OK, "Boot project not started: it failed before");
    else if (!AppHasException())
        (void)AppStart(slot->state == SLOT_STARTED ? slot->starts : 0);
}

void AppBoot(void)
{
    RTS_RESULT result = AppCommitOpen();

    if (result == ERR_OK)
        run_boot_project(AppCommitGet()->active);
    else
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, result, "The commit record cannot be read");
}
