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

enum { EVTPARAMID_NONE = 0, EVENT_PARAM_VERSION = 1 };

#define EVENT_ALL 0xFFFFFFFFu /* a callback for all events of a provider */

typedef struct {
    RTS_UI32 event;        /* EVT_* of the provider */
    RTS_UI32 provider;     /* CMPID_* */
    RTS_UI16 parameter_id; /* EVTPARAMID_*: the type of the parameter */
    RTS_UI16 version;      /* EVENT_PARAM_VERSION; parameters get new members at their end */
    void *parameter;       /* of the event, see there */
    void *user;            /* as registered */
    RTS_RESULT answer;     /* ERR_OK; a callback of an EVT_Deny* sets an error to deny */
    const char *reason;    /* NULL; a callback that denies may say why: a constant text without full stop */
} EVENT_PARAM;

typedef void (*PF_EVENT_CALLBACK)(EVENT_PARAM *event);

/* Callbacks run in the order of registration. ERR_NOMEMORY when EVENT_MAX_CALLBACKS are registered. */
RTS_RESULT EventRegisterCallback(RTS_UI32 provider, RTS_UI32 event, PF_EVENT_CALLBACK callback, void *user);

/* ERR_NO_OBJECT when it is not registered. A callback may unregister itself. */
RTS_RESULT EventUnregisterCallback(RTS_UI32 provider, RTS_UI32 event, PF_EVENT_CALLBACK callback, void *user);

/* Calls all callbacks of the event, also after one that denied. Returns the first answer that is not ERR_OK. */
RTS_RESULT EventPost(RTS_UI32 provider, RTS_UI32 event, RTS_UI16 parameter_id, void *parameter);

/* The reason that came with the answer of the last EventPost; NULL: none. */
const char *EventGetReason(void);

/* True within a callback, which can neither start, stop, reset nor load the application. */
bool EventIsPosting(void);

RTS_RESULT CmpEventMgrEmbedded_Hook(CMP_HOOK hook);

#endif
