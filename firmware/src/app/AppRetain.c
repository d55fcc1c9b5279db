/*
 * AppRetain.c - the retain variables of an application that is loaded.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The previous application is in the other slot, with its table of kept variables; its records are those that are newer
 * than its `retain_after`, up to the `retain_after` of the new one. All of that stays until the new application has a
 * record of its own, so a power cut at any time only means that its first start is done again. After a rollback the
 * other slot has the newer numbers, so nothing is taken from there.
 */
#include "AppRetain.h"

#include "AppCommit.h"
#include "../load/AppLoader.h"
#include "CmpLog.h"

/* Not inlined: an image and what checks it are large on the stack. */
static RTS_NOINLINE RTS_RESULT take_over(RTS_UI32 slot)
{
    RTS_UI32 other = AppCommitOtherSlot(slot);
    const COMMIT_SLOT *before = &AppCommitGet()->slot[other];
    FLASH_LOG_RANGE range = {before->retain_after, AppCommitGet()->slot[slot].retain_after};
    APP_REFUSAL refusal;
    APP_IMAGE image;
    RTS_RESULT result = ERR_NO_OBJECT;

    if (AppCommitGet()->state[other] != SLOT_EMPTY)
        result = AppLoaderCheck(other, before->size, before->crc, &image, &refusal);
    return result == ERR_OK ? RetainLoad(&image.kept, before->crc, range) : result;
}

RTS_RESULT AppRetainLoad(const APP_IMAGE *image, RTS_UI8 *area, RTS_UI32 retain_until)
{
    const COMMIT_SLOT *slot = &AppCommitGet()->slot[image->file];
    const FLASH_LOG_RANGE range = {slot->retain_after, retain_until};
    bool proven = AppCommitIsProven(image->file);
    RTS_RESULT result;

    if (APP_RETAIN_SIZE == 0)
        return ERR_NO_OBJECT;
    RetainAttach(area, &image->kept, image->crc);
    result = RetainLoad(&image->kept, image->crc, range);
    if (result != ERR_OK && (image->kept.size > 0 || !proven) && take_over(image->file) != ERR_OK &&
        image->kept.size > 0 && retain_until != slot->retain_after)
        LogAdd(CMPID_CmpRetain, LOG_WARNING, result, "No saved retain variables fit the application: initial values");
    if (proven)
        RetainKeepNone();
    else
        RetainKeep(slot->retain_after);
    return result;
}
