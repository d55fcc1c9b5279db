/*
 * AppRetain.c - the retain variables of an application that is loaded.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The application before is in the other slot, with its table of kept variables; its records are those that are newer
 * than its `retain_after`, up to the `retain_after` of the new one. All of that stays until the new application has a
 * record of its own, so a power cut at any time only means that its first start is done again. After a rollback the
 * other slot has the newer numbers, so nothing is taken from there.
 */
#include "AppRetain.h"

#include "AppCommit.h"
#include "CmpLog.h"

RETAIN_TABLE AppGetRetainTable(const APP_IMAGE *image)
{
    RETAIN_TABLE table = {image->file, image->kept.offset, image->kept.size, image->area_size[APP_AREA_RETAIN]};

    return table;
}

/* Not inlined: an image and what checks it are large on the stack. */
static RTS_NOINLINE bool read_table(RTS_UI32 slot, RETAIN_TABLE *table)
{
    const COMMIT_SLOT *committed = &AppCommitGet()->slot[slot];
    APP_REFUSAL refusal;
    APP_IMAGE image;

    if (committed->state == SLOT_EMPTY ||
        AppLoaderCheck(slot, committed->size, committed->crc, &image, &refusal) != ERR_OK)
        return false;
    *table = AppGetRetainTable(&image);
    return true;
}

static RTS_RESULT take_over(RTS_UI32 slot)
{
    RTS_UI32 other = AppCommitOtherSlot(slot);
    FLASH_LOG_RANGE range = {AppCommitGet()->slot[other].retain_after, AppCommitGet()->slot[slot].retain_after};
    RETAIN_TABLE before;

    return read_table(other, &before) ? RetainTakeOver(&before, range) : (RTS_RESULT)ERR_NO_OBJECT;
}

RTS_RESULT AppRetainLoad(const APP_IMAGE *image, RTS_UI8 *area, RTS_UI32 retain_until)
{
    const COMMIT_SLOT *slot = &AppCommitGet()->slot[image->file];
    const RETAIN_TABLE table = AppGetRetainTable(image);
    const FLASH_LOG_RANGE range = {slot->retain_after, retain_until};
    RTS_RESULT result;

    if (APP_RETAIN_SIZE == 0)
        return ERR_NO_OBJECT;
    RetainAttach(area, &table);
    result = RetainRestore(range);
    if (result != ERR_OK && (table.size > 0 || slot->state != SLOT_PROVEN) && take_over(image->file) != ERR_OK &&
        table.size > 0 && retain_until != slot->retain_after)
        LogAdd(CMPID_CmpRetain, LOG_WARNING, result, "No saved retain variables fit the application: initial values");
    if (slot->state == SLOT_PROVEN)
        RetainKeepNone();
    else
        RetainKeep(slot->retain_after);
    return result;
}
