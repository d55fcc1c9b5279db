/*
 * AppBoot.c - what runs after a start-up: the boot project, or the previous application if that failed.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Only its own failure counts against an application, and is noted in flash before anything else is done. When it cannot
 * be loaded for another reason, nothing is written and the next start finds all as it was. Until then the previous one
 * stands in for an application that cannot be read; nothing runs when the reason is firmware for another device, or a
 * function that this one lacks.
 */
#include "AppBoot.h"

#include "AppCommit.h"
#include "AppEvents.h"
#include "AppException.h"
#include "AppLife.h"
#include "../load/AppLoader.h"
#include "CmpLog.h"
#include "CmpRetain.h"
#include "SettingValues.h"
#include "SysExcept.h"
#include "SysStart.h"

static RTS_RESULT load_from_slot(RTS_UI32 slot, RTS_UI32 retain_until)
{
    const COMMIT_SLOT *committed = &AppCommitGet()->slot[slot];
    const RTS_UI8 *code = NULL;
    APP_REFUSAL refusal;
    APP_IMAGE image;
    RTS_RESULT result = AppLoaderCheck(slot, committed->size, committed->crc, &image, &refusal);

    if (result != ERR_OK && result != ERR_DEVICE && image.code.size == 0)
        result = ERR_CRC_FAILED; /* not the image that was committed (AppLoader.h) */
    if (result == ERR_OK) {
        code = AppMapCode(&image);
        if (code == NULL)
            result = APP_REFUSE(&refusal, ERR_NOMEMORY, "There is no executable memory for the code.");
    }
    if (result == ERR_OK) {
        result = AppLoad(&image, code, retain_until, &refusal);
        if (FLASH_READS_FAIL && result == ERR_DEVICE)
            result = ERR_FAILED; /* of a driver: the image can be read */
    }
    if (result != ERR_OK)
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR | LOG_KEPT, result, "Boot project refused: %s", refusal.text);
    return result;
}

bool AppCanRollBack(RTS_UI32 failed)
{
    RTS_UI8 state = AppCommitGet()->state[AppCommitOtherSlot(failed)];

    return state != SLOT_EMPTY && state != SLOT_FAILED;
}

bool AppRollBack(RTS_UI32 failed)
{
    RTS_UI32 retain_until = AppCommitGet()->slot[failed].retain_after;
    RTS_UI32 retain_after;

    if (!AppCanRollBack(failed) || load_from_slot(AppCommitOtherSlot(failed), retain_until) != ERR_OK)
        return false;
    /* A record of its own numbers its retain variables as newest before the commit makes it so. */
    RetainKeep(retain_until);
    retain_after = RetainGetSequence();
    (void)RetainSave(true);
    (void)AppCommitRollBack(failed, retain_after);
    RetainKeepNone();
    LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING | LOG_KEPT, ERR_OK, "Back to the application before");
    return true;
}

/* The application is in the exception that ended the previous run. */
static void take_exception(const SYS_START *start)
{
    APP_EXCEPTION exception = {start->exception, start->code_offset, start->task};

    if (exception.code == RTSEXCPT_NOEXCEPTION)
        exception.code = RTSEXCPT_BOOTPROJECT_CRASH;
    AppExceptionSet(&exception, start->text);
}

/* Whether the active application was what ended the run before this start. */
static bool has_died(RTS_UI32 cause)
{
    static const RTS_UI8 unfinished[] = {0xFF, 1, 2}; /* [SYS_START_*]: initialisations that count as a failure */
    const COMMIT *commit = AppCommitGet();

    return commit->begun >= unfinished[cause] ||
           (cause == SYS_START_CRASH && commit->state[commit->active] == SLOT_STARTED);
}

/* The previous application stands in for one that cannot be read: for this start only, since the fault may pass. It goes
 * on with its own newest values. */
static bool load_stand_in(RTS_UI32 active)
{
    return AppCanRollBack(active) && load_from_slot(AppCommitOtherSlot(active), RetainGetSequence()) == ERR_OK;
}

/* Loads what shall run. */
static RTS_RESULT load_one(bool may_go_back)
{
    RTS_UI32 active = AppCommitGet()->active;
    RTS_RESULT result;

    if (may_go_back && AppCommitGet()->state[active] == SLOT_FAILED && AppRollBack(active))
        return ERR_OK;
    result = load_from_slot(active, RetainGetSequence());
    if (result == ERR_CRC_FAILED && may_go_back && AppRollBack(active))
        return ERR_OK;
    if (FLASH_READS_FAIL && result == ERR_DEVICE && may_go_back && load_stand_in(active))
        return ERR_OK;
    return result;
}

static RTS_RESULT load_boot_project(bool may_go_back)
{
    RTS_RESULT result;

    AppEventTellBoot(EVT_PrepareLoadBootproject);
    result = load_one(may_go_back);
    if (result == ERR_OK)
        AppPostEvent(EVT_LoadBootprojectDone);
    return result;
}

static bool stays_stopped(void)
{
    if (!APP_MAY_STAY_STOPPED)
        return false;
    return SysStartGet()->stay_stopped == SYS_BOOT_STOPPED ||
           (SysStartGet()->stay_stopped == SYS_BOOT_PROVEN && !AppCommitIsProven(AppCommitGet()->active));
}

/* Notes that the application was what ended the run before this start. */
static void take_death(void)
{
    const SYS_START *start = SysStartGet();
    bool died = has_died(start->cause);

    if (LOG_MAX_ENTRIES > 0 && (died || (start->cause == SYS_START_CRASH && stays_stopped())))
        take_exception(start);
    if (died)
        AppCommitSetDead(start->text);
    else if (start->cause == SYS_START_CRASH)
        (void)AppEndUnclean(start->text);
}

static void start_boot_project(void)
{
    if (AppAskStart(EVT_DenyStartBootproject) != ERR_OK)
        return;
    AppPostEvent(EVT_PrepareStartBootproject);
    if (AppStart() == ERR_OK)
        AppPostEvent(EVT_StartBootprojectDone);
}

/* Whether a boot project that is loaded waits for a user. After a rollback it is another one than the one that failed. */
static bool waits(bool failed)
{
    if (failed && SETTING(BootStart) == BOOT_START_CLEAN)
        (void)AppEndUnclean("");
    return stays_stopped() || AppCommitIsDead() || SETTING(BootStart) == BOOT_START_NEVER ||
           (failed && SETTING(BootStart) == BOOT_START_CLEAN);
}

/* A boot project starts automatically, unless it failed. One that stays stopped is loaded, whatever components say. */
static void run_boot_project(void)
{
    RTS_RESULT result;
    bool failed;

    take_death();
    failed = SETTINGS && AppCommitIsDead();
    result = stays_stopped() ? (RTS_RESULT)ERR_OK : AppEventAskBoot(EVT_DenyLoadBootproject);
    if (result == ERR_OK)
        result = load_boot_project(!stays_stopped());
    AppPostEvent(EVT_AllBootprojectsLoaded);
    if (result != ERR_OK)
        return;
    if (waits(failed))
        LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING | LOG_KEPT, ERR_OK, "Boot project not started%s",
               AppCommitIsDead() ? ": it failed before" : "");
    else
        start_boot_project();
}

void AppBoot(void)
{
    AppCommitOpen();
    if (CMHasLeftOut())
        LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING, ERR_OK, "No program is run");
    else if (AppCommitResult() != ERR_OK)
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, AppCommitResult(), "Commit record cannot be read");
    if (AppCommitGet()->active != SLOT_NONE) {
        run_boot_project();
        return;
    }
    LogAdd(CMPID_CmpAppEmbedded, LOG_INFO, ERR_OK, "No boot project");
    AppPostEvent(EVT_AllBootprojectsLoaded);
}

RTS_RESULT AppBootAgain(void)
{
    RTS_RESULT result;

    AppUnload();
    AppCommitEndTry(); /* it is not the boot project */
    if (BOOT_ON_DEMAND && AppCommitGet()->active == SLOT_NONE)
        return ERR_APP_NOT_LOADED;
    result = load_boot_project(true);
    return result == ERR_OK ? AppStartIfAllowed() : result;
}

RTS_RESULT AppBootByHand(void)
{
    RTS_UI32 active = AppCommitGet()->active;

    if (APP_MAY_STAY_STOPPED && active != SLOT_NONE && AppCommitGet()->state[active] == SLOT_FAILED)
        return AppBootAgain();
    return AppStartIfAllowed();
}
