/*
 * AppDownload.c - downloading a new application.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * An image is written to the slot that is not what boots, checked there, mapped, sealed (from here on it is what
 * boots), and only then is the old application stopped and this one loaded.
 */
#include "AppDownload.h"

#include "AppBoot.h"
#include "AppChange.h"
#include "AppCommit.h"
#include "AppEvents.h"
#include "AppLife.h"
#include "../load/AppLoader.h"
#include "AppReason.h"
#include "AppState.h"
#include "CmpLog.h"
#include "CmpRetain.h"
#include "SettingValues.h"
#include "SysFileFlash.h"
#include "SysFlash.h"
#include "Unpack.h"

static struct {
    bool open;
    RTS_UI32 slot;
    RTS_UI32 size;
    RTS_UI32 crc;
#if BOOT_ON_DEMAND
    bool tries; /* the image that is complete is not to boot */
#endif
} download;

#if BOOT_ON_DEMAND
#define IS_TRY download.tries
#else
#define IS_TRY false
#endif

/* Which slot is kept. An application that failed gives way to the previous one now, or that one would be overwritten
 * though it is the newest that runs; it is kept also when it cannot be read now. So does one that is only tried. */
static RTS_UI32 slot_to_keep(void)
{
    const COMMIT *commit = AppCommitGet();
    RTS_UI32 active = commit->active;

    if (active != SLOT_NONE && (commit->state[active] == SLOT_FAILED || AppCommitIsTried()) && AppCanRollBack(active)) {
        AppUnload();
        (void)AppRollBack(active);
        return AppCommitOtherSlot(active);
    }
    return AppGetSlot() != SLOT_NONE ? AppGetSlot() : active;
}

RTS_RESULT AppDownloadBegin(RTS_UI32 total_size, RTS_UI32 image_crc)
{
    RTS_UI32 slot;

    if (AppEventIsPosting())
        return ERR_CALL_AGAIN;
    AppDownloadAbort();
    if (CMHasLeftOut())
        return ERR_NOTINITIALIZED;
    if (AppCommitIsTried() && AppAskStop() != ERR_OK)
        return ERR_OPERATION_DENIED;
    if (AppCommitResult() != ERR_OK && AppGetSlot() == SLOT_NONE)
        return ERR_DEVICE; /* what is worth keeping is not known */
    slot = AppCommitOtherSlot(slot_to_keep());
    if (total_size > SysFileGetArea(slot)->size - FILE_ALIGN) /* the seal follows */
        return ERR_NOMEMORY;
    download.open = true;
    download.slot = slot;
    download.size = total_size;
    download.crc = image_crc;
    SysFileCreate(slot);
    return ERR_OK;
}

/* Whether `size` bytes may be written at `offset` now. */
static RTS_RESULT check_place(RTS_UI32 offset, RTS_UI32 size)
{
    if (!download.open || offset != SysFileGetPos(download.slot))
        return ERR_INVALID_SEQUENCE;
    return size > download.size - offset ? ERR_OUT_OF_LIMITS : ERR_OK;
}

RTS_RESULT AppDownloadWrite(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_RESULT result = check_place(offset, size);

    if (result != ERR_OK)
        return result;
    result = SysFileWrite(download.slot, data, size);
    if (result != ERR_OK)
        AppDownloadAbort();
    return result;
}

static RTS_RESULT append(const RTS_UI8 *data, RTS_UI32 size)
{
    return SysFileWrite(download.slot, data, size);
}

static RTS_RESULT append_copy(RTS_UI32 distance, RTS_UI32 size)
{
    return SysFileCopy(download.slot, distance, size);
}

RTS_RESULT AppDownloadUnpack(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 unpacked)
{
    static const UNPACK_SINK sink = {append, append_copy};
    RTS_RESULT result = check_place(offset, unpacked);

    if (result != ERR_OK)
        return result;
    result = Unpack(data, size, unpacked, &sink);
    if (result != ERR_OK)
        AppDownloadAbort();
    return result;
}

RTS_UI32 AppDownloadOffset(void)
{
    return download.open ? SysFileGetPos(download.slot) : 0;
}

bool AppDownloadIsOf(RTS_UI32 total_size, RTS_UI32 image_crc)
{
    return download.open && download.size == total_size && download.crc == image_crc;
}

bool AppDownloadIsOpen(void)
{
    return download.open;
}

void AppDownloadAbort(void)
{
    download.open = false;
}

/* Goes back to the application that ran until now, if it can; in any case the refused one does not boot. */
static void put_back(RTS_UI32 failed_slot, bool ran)
{
    if (AppRollBack(failed_slot))
        (void)(ran ? AppStart() : AppInitialise());
    else
        AppCommitTakeBack(failed_slot);
}

/* Ends the old application; one that is not to boot counts from here on. The old one has not failed then, whatever happens. */
static void begin_try(const APP_IMAGE *image, bool ran, RTS_UI32 retain_after)
{
#if BOOT_ON_DEMAND
    if (IS_TRY && ran && !AppHasException())
        (void)AppCommitSetState(AppGetSlot(), SLOT_TRIAL);
#endif
    AppUnload();
#if BOOT_ON_DEMAND
    if (IS_TRY)
        AppCommitTry(image->file, image->size, image->crc, retain_after);
#endif
    RTS_UNUSED(image);
    RTS_UNUSED(ran);
    RTS_UNUSED(retain_after);
}

/* The checked image takes the place of the old application. */
static RTS_RESULT replace(const APP_IMAGE *image, APP_REFUSAL *refusal)
{
    const RTS_UI8 *code = AppMapCode(image);
    RTS_UI32 retain_after = RetainGetSequence() + 2; /* the old application is saved when it stops and when it ends */
    RTS_RESULT result;
    bool ran;

    if (code == NULL)
        return APP_REFUSE(refusal, ERR_NOMEMORY, "There is no executable memory for the code.");
    RetainKeepNone(); /* of the application that was in this slot */
    result = IS_TRY ? (RTS_RESULT)ERR_OK : AppCommitInstall(image->file, image->crc, retain_after);
    if (result != ERR_OK) {
        SysFlashReleaseCode(image->file);
        return APP_REFUSE(refusal, result, "The flash cannot be written.");
    }
    ran = AppStopTasks();
    begin_try(image, ran, retain_after);
    result = AppLoad(image, code, retain_after, refusal);
    if (result == ERR_OK) {
        result = AppInitialise();
        if (result != ERR_OK)
            result = APP_REFUSE(refusal, result, "There are not enough timers for the tasks.");
    }
    if (result != ERR_OK)
        put_back(image->file, ran);
    else if (!IS_TRY)
        AppPostEvent(EVT_CreateBootprojectDone);
    return result;
}

/* A denied image stays in its slot without a seal, as after an aborted download. */
static RTS_RESULT take_over(const APP_IMAGE *image, APP_REFUSAL *refusal)
{
    RTS_RESULT result = AppAskStop();

    if (result != ERR_OK)
        return APP_REFUSE(refusal, result, "%s.", AppTakeReason());
    result = AppEventAsk(EVT_PrepareDownload, image);
    result = result == ERR_OK ? replace(image, refusal) : APP_REFUSE(refusal, result, "%s.", AppTakeReason());
    AppPostEvent(EVT_DownloadDone);
    return result;
}

typedef RTS_RESULT (*TAKE_OVER)(const APP_IMAGE *image, APP_REFUSAL *refusal);

static RTS_RESULT finish_download(TAKE_OVER take, APP_REFUSAL *refusal)
{
    APP_IMAGE image;
    RTS_RESULT result;

    if (AppEventIsPosting())
        return APP_REFUSE(refusal, ERR_CALL_AGAIN, "An event of the application is being handled.");
    if (!download.open)
        return APP_REFUSE(refusal, ERR_INVALID_SEQUENCE, "No download has begun.");
    if (SysFileGetPos(download.slot) != download.size)
        return APP_REFUSE(refusal, ERR_SIZE_MISMATCH, "The image is not complete.");
    AppDownloadAbort();
    if (SysFileClose(download.slot) != ERR_OK)
        return APP_REFUSE(refusal, ERR_DEVICE, "The flash cannot be written.");
    result = AppLoaderCheck(download.slot, download.size, download.crc, &image, refusal);
    return result == ERR_OK ? take(&image, refusal) : result;
}

static RTS_RESULT end_download(APP_REFUSAL *refusal)
{
    RTS_RESULT result;

    refusal->text[0] = '\0';
    AppHandlePendingException();
    result = finish_download(take_over, refusal);
    if (result == ERR_OK)
        LogAdd(CMPID_CmpAppEmbedded, LOG_INFO | LOG_KEPT, ERR_OK, "Application loaded, CRC %X", (unsigned)download.crc);
    else
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, result, "Download refused: %s", refusal->text);
    return result;
}

RTS_RESULT AppDownloadEnd(APP_REFUSAL *refusal)
{
#if BOOT_ON_DEMAND
    download.tries = false;
#endif
    return end_download(refusal);
}

#if BOOT_ON_DEMAND
RTS_RESULT AppDownloadTry(APP_REFUSAL *refusal)
{
    download.tries = true;
    return end_download(refusal);
}

bool AppDownloadTriesAll(void)
{
    return SETTING(BootOnDownload) != 0;
}

bool AppDownloadIsTried(void)
{
    return AppCommitIsTried();
}

RTS_RESULT AppCreateBootProject(void)
{
    RTS_RESULT result;

    AppHandlePendingException();
    if (AppEventIsPosting())
        return ERR_CALL_AGAIN;
    if (AppGetState() == AS_NONE)
        return ERR_APP_NOT_LOADED;
    if (!AppCommitIsTried())
        return ERR_OK;
    result = AppCommitSeal();
    LogAdd(CMPID_CmpAppEmbedded, (result == ERR_OK ? LOG_INFO : LOG_ERROR) | LOG_KEPT, result,
           "Boot project %s, CRC %X", result == ERR_OK ? "created" : "not created", (unsigned)AppGetImage()->crc);
    if (result != ERR_OK)
        return ERR_APP_CREATE_BOOTPROJECT_FAILED;
    AppPostEvent(EVT_CreateBootprojectDone);
    return ERR_OK;
}
#endif

#if ONLINE_CHANGE
RTS_RESULT AppDownloadChange(APP_REFUSAL *refusal)
{
    RTS_RESULT result;

    refusal->text[0] = '\0';
    result = finish_download(AppChange, refusal);
    if (result == ERR_OK)
        LogAdd(CMPID_CmpAppEmbedded, LOG_INFO | LOG_KEPT, ERR_OK, "Online change, CRC %X", (unsigned)download.crc);
    else
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, result, "Online change refused: %s", refusal->text);
    return result;
}
#endif
