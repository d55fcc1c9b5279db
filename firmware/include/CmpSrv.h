/*
 * CmpSrv.h - layer 7: headers, sessions, dispatch to the services.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A component registers its service group in CH_INIT3. All from main.
 */
#ifndef CMPSRV_H
#define CMPSRV_H

#include "CmpBinTagUtil.h"
#include "CmpItf.h"
#include "CmpSrvNumbers.h"

/* A request as a handler sees it. `tags` and what is found in them are valid during the call only. */
typedef struct {
    BTAG_READER tags;
    RTS_UI32 session;       /* from the header */
    RTS_UI32 reply_session; /* what the reply's header will carry; a handler may change it */
} SRV_REQUEST;

/* Writes the content of the reply. Any result but ERR_OK replaces that content by TAG_ERROR with the result. */
typedef RTS_RESULT (*SRV_HANDLER)(SRV_REQUEST *request, BTAG_WRITER *reply);

enum { SRV_OPEN = 0, SRV_NEEDS_LOGIN = 1 };

typedef struct {
    RTS_UI16 service;
    RTS_UI16 access; /* SRV_OPEN: anybody may call it, it changes nothing; SRV_NEEDS_LOGIN */
    SRV_HANDLER handler;
} SRV_SERVICE;

/* ERR_NOMEMORY above SRV_MAX_GROUPS. `services` must stay valid. */
RTS_RESULT SrvRegisterGroup(RTS_UI16 group, const SRV_SERVICE *services, RTS_SIZE count);

/* Handles one message and returns the size of the reply in `reply`; 0 when the header is too broken to be answered. */
RTS_UI32 SrvHandleMessage(const RTS_UI8 *message, RTS_UI32 size, RTS_UI8 *reply, RTS_UI32 capacity);

/* ---- the session: one, because there is one channel ---- */

/* Creates the session anew (without rights) and returns its id. */
RTS_UI32 SrvCreateSession(void);
/* Gives session `id` the rights of a login; another id creates a new session. Returns the session's id. */
RTS_UI32 SrvLogin(RTS_UI32 id);
/* Ends session `id`; ERR_INVALID_SESSION_ID when it is not the current one. */
RTS_RESULT SrvLogout(RTS_UI32 id);
bool SrvIsLoggedIn(void);
/* Called by the channel server: the session ends with its channel. */
void SrvEndSession(void);

/* The application session within the session: creates a new one and returns its id. */
RTS_UI32 SrvCreateAppSession(void);
bool SrvIsAppSession(RTS_UI32 id);
void SrvEndAppSession(void);

RTS_RESULT CmpSrv_Hook(CMP_HOOK hook);

#endif
