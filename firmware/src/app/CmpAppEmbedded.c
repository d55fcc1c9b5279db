/*
 * CmpAppEmbedded.c - the component of the application: start, stop, reset, status.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpAppEmbedded.h"

#include <string.h>

#include "../cycle/AppAreas.h"
#include "AppBoot.h"
#include "AppCommit.h"
#include "AppEvents.h"
#include "../load/AppFunctions.h"
#include "AppLife.h"
#include "AppPower.h"
#include "CmpAppBP.h"
#include "CmpForce.h"
#include "CmpLog.h"
#include "SysFileFlash.h"
#include "rts_config.h"

static bool is_loaded(void)
{
    return AppGetState() != AS_NONE;
}

/* ---- start and stop ---- */

RTS_RESULT AppStartApplication(void)
{
    AppHandlePendingException();
    if (AppEventIsPosting())
        return ERR_CALL_AGAIN;
    if (!is_loaded())
        return ERR_APP_NOT_LOADED;
    if (!AppIsInitialised())
        return AppBootByHand();
    if (AppHasException())
        return ERR_INVALID_STATE;
    return AppGetState() == AS_RUN ? ERR_OK : AppStartIfAllowed();
}

static RTS_RESULT stop_unasked(void)
{
    AppPowerForget();
    if (!is_loaded())
        return ERR_APP_NOT_LOADED;
    if (AppStopTasks() && (!AppHasException() || AppWasBrokenOff())) {
        (void)AppCommitSetState(AppGetSlot(), SLOT_TRIAL);
        LogAdd(CMPID_CmpAppEmbedded, LOG_INFO | LOG_KEPT, ERR_OK, "Application stopped");
    }
    return ERR_OK;
}

RTS_RESULT AppStopApplication(void)
{
    RTS_RESULT result = AppEventIsPosting() ? (RTS_RESULT)ERR_CALL_AGAIN : AppAskStop();

    return result == ERR_OK ? stop_unasked() : result;
}

#if SRV_OTHER_CLIENTS
RTS_RESULT AppSingleCycle(void)
{
    RTS_RESULT result;

    AppHandlePendingException();
    if (AppEventIsPosting())
        return ERR_CALL_AGAIN;
    if (!is_loaded())
        return ERR_APP_NOT_LOADED;
    if (AppGetState() == AS_RUN)
        return ERR_CALL_AGAIN;
    if (AppIsInitialised() && AppHasException())
        return ERR_INVALID_STATE;
    result = AppAskStart(EVT_DenyStart);
    return result == ERR_OK ? AppRunOnce() : result;
}
#endif

RTS_RESULT AppReload(void)
{
    RTS_RESULT result;

    if (AppEventIsPosting())
        return ERR_CALL_AGAIN;
    if (CMHasLeftOut())
        return ERR_NOTINITIALIZED;
    if (AppCommitGet()->active == SLOT_NONE)
        return ERR_APP_NOT_LOADED;
    result = AppAskStop();
    if (result == ERR_OK)
        result = AppEventAskBoot(EVT_DenyLoadBootproject);
    if (result != ERR_OK)
        return result;
    (void)stop_unasked();
    return AppBootAgain();
}

/* ---- reset ---- */

static RTS_RESULT reset_origin(void)
{
    RTS_RESULT result = AppCommitErase();

    if (result != ERR_OK)
        return result;
    AppDownloadAbort(); /* of another client: its slot is wiped, too */
    AppUnload();
    AppAreasClear();
    AppCommitWipe(FILE_SLOT_A);
    AppCommitWipe(FILE_SLOT_B);
    return ERR_OK;
}

RTS_RESULT AppReset(RTS_UI32 option)
{
    RTS_RESULT result;

    if (option > RESET_OPTION_ORIGIN)
        return ERR_PARAMETER;
    if (AppEventIsPosting())
        return ERR_CALL_AGAIN;
    AppHandlePendingException();
    if (!is_loaded() && option != RESET_OPTION_ORIGIN)
        return ERR_APP_NOT_LOADED;
    result = option != RESET_OPTION_ORIGIN ? AppAskStop() : (RTS_RESULT)ERR_OK;
    if (result != ERR_OK)
        return result;
    AppPostEvent(EVT_PrepareReset);
    if (is_loaded())
        (void)stop_unasked();
    result = option == RESET_OPTION_ORIGIN ? reset_origin() : AppReinitialise(option == RESET_OPTION_COLD);
    LogAdd(CMPID_CmpAppEmbedded, LOG_INFO | LOG_KEPT, result, "Reset %s",
           option == RESET_OPTION_WARM   ? "warm"
           : option == RESET_OPTION_COLD ? "cold"
                                         : "origin");
    AppPostEvent(EVT_ResetDone);
    return result;
}

/* ---- what others ask ---- */

void AppGetStatus(APP_STATUS *status)
{
    AppHandlePendingException();
    memset(status, 0, sizeof *status);
    status->state = AppGetState();
    status->image_crc = AppGetImage()->crc;
    status->image_size = AppGetImage()->size;
    status->exception = *AppExceptionGet();
    if (is_loaded())
        status->op_state |= OS_PROGRAM_LOADED;
    if (AppDownloadIsOpen())
        status->op_state |= OS_DOWNLOAD;
    if (AppHasException())
        status->op_state |= OS_EXCEPTION;
    if (AppCommitGet()->active != SLOT_NONE && !AppCommitIsTried())
        status->op_state |= OS_BOOTPROJECT_VALID;
#if BP_MAX > 0
    if (AppBpIsHalted())
        status->state = AS_HALT_ON_BP;
#endif
    if (ForceGetCount() > 0)
        status->op_state |= OS_FORCE_ACTIVE;
}

const char *AppGetInfo(RTS_UI32 index)
{
    static char info[APP_NAME_SIZE]; /* without the service that asks it takes no RAM */

    if (!is_loaded() || index >= IMAGE_INFO_COUNT)
        return "";
    AppLoaderReadInfo(AppGetImage(), index, info, sizeof info);
    return info;
}

RTS_RESULT AppReadImage(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    const APP_IMAGE *image = AppGetImage();

    if (!is_loaded())
        return ERR_APP_NOT_LOADED;
    if (size > image->size || offset > image->size - size)
        return ERR_OUT_OF_LIMITS;
    return SysFileRead(image->file, offset, data, size);
}

/* ---- the hook ---- */

RTS_RESULT CmpAppEmbedded_Hook(CMP_HOOK hook)
{
    switch (hook) {
    case CH_INIT:
        if (AppAreasInit() != ERR_OK)
            return ERR_NOMEMORY;
        if (!RTS_STARTS_ONCE) {
            AppForget();
            AppPowerForget();
            AppDownloadAbort();
        }
        break;
    case CH_INIT_TASKS:
        AppBoot();
        break;
    case CH_COMM_CYCLE:
        AppPowerCheck();
        AppHandlePendingException();
        AppCheckProof();
        break;
    case CH_EXIT_TASKS:
        (void)stop_unasked();
        AppUnload();
        break;
    default:
        break;
    }
    return ERR_OK;
}
