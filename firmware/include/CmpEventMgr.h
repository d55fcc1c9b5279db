/*
 * CmpEventMgr.h - events between components. Manual 3.12.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A component that wants to know registers a callback in CH_INIT3; the provider posts. All in the context of main.
 */
#ifndef CMPEVENTMGR_H
#define CMPEVENTMGR_H

#include "CmpErrors.h"
#include "CmpItf.h"
#include "CmpStd.h"

typedef struct {
    RTS_UI32 event;    /* EVT_* of the provider */
    RTS_UI32 provider; /* CMPID_* */
    void *parameter;   /* of the event, see there */
    void *user;        /* as registered */
} EVENT_PARAM;

typedef void (*PF_EVENT_CALLBACK)(const EVENT_PARAM *event);

/* Callbacks run in the order of registration. ERR_NOMEMORY when EVENT_MAX_CALLBACKS are registered. */
RTS_RESULT EventRegisterCallback(RTS_UI32 provider, RTS_UI32 event, PF_EVENT_CALLBACK callback, void *user);

/* ERR_NO_OBJECT when it is not registered. A callback may unregister itself. */
RTS_RESULT EventUnregisterCallback(RTS_UI32 provider, RTS_UI32 event, PF_EVENT_CALLBACK callback, void *user);

/* Calls all callbacks of the event. */
void EventPost(RTS_UI32 provider, RTS_UI32 event, void *parameter);

RTS_RESULT CmpEventMgrEmbedded_Hook(CMP_HOOK hook);

#endif
