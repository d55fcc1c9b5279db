/*
 * AppEvents.c - tells components what happens to an application, and asks whether it may.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppEvents.h"

#if EVENT_MAX_CALLBACKS > 0

#include "../load/AppFunctions.h"
#include "AppCommit.h"
#include "AppReason.h"
#include "CmpLog.h"

static const char *reason;

static RTS_RESULT post(RTS_UI32 event, const char *name, RTS_UI32 slot, RTS_UI32 crc, RTS_UI32 size)
{
    EVTPARAM_CmpApp parameter = {name, slot, crc, size};

    return EventPost(CMPID_CmpAppEmbedded, event, EVTPARAMID_CmpApp, &parameter);
}

static RTS_RESULT post_image(RTS_UI32 event, const APP_IMAGE *image)
{
    static char name[APP_NAME_SIZE];

    if (image->size == 0)
        return post(event, "", SLOT_NONE, 0, 0);
    AppLoaderReadInfo(image, 0, name, sizeof name);
    return post(event, name, image->file, image->crc, image->size);
}

static RTS_RESULT post_boot_project(RTS_UI32 event)
{
    RTS_UI32 active = AppCommitGet()->active;
    const COMMIT_SLOT *slot = &AppCommitGet()->slot[active];

    return post(event, "", active, slot->crc, slot->size);
}

void AppEventTell(RTS_UI32 event, const APP_IMAGE *image)
{
    (void)post_image(event, image);
}

void AppEventTellBoot(RTS_UI32 event)
{
    (void)post_boot_project(event);
}

static const char *what_is_denied(RTS_UI32 event)
{
    switch (event) {
#if ONLINE_CHANGE
    case EVT_PrepareOnlineChange:
        return "Online change";
#endif
    case EVT_PrepareDownload:
        return "Download";
    case EVT_DenyLoadBootproject:
        return "Load of the boot project";
    case EVT_DenyStartBootproject:
        return "Start of the boot project";
    case EVT_DenyStart:
        return "Start";
    default:
        return "Stop";
    }
}

static RTS_RESULT take_answer(RTS_UI32 event, RTS_RESULT answer)
{
    reason = NULL;
    if (answer == ERR_OK)
        return ERR_OK;
    reason = EventGetReason() != NULL ? EventGetReason() : "a component of the device denies it";
    LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING, answer, "%s denied: %s", what_is_denied(event), reason);
    return answer;
}

RTS_RESULT AppEventAsk(RTS_UI32 event, const APP_IMAGE *image)
{
    return take_answer(event, post_image(event, image));
}

RTS_RESULT AppEventAskBoot(RTS_UI32 event)
{
    return take_answer(event, post_boot_project(event));
}

const char *AppTakeReason(void)
{
    const char *taken = reason;

    reason = NULL;
    return taken != NULL ? taken : "";
}

#endif
