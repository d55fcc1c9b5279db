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
#include "CommClient.h"

/* A request as a handler sees it. `tags` and what is found in them are valid during the call only. */
typedef struct {
    COMM_CLIENT *client; /* that asks */
    BTAG_READER tags;
    RTS_UI32 session;       /* from the header */
    RTS_UI32 reply_session; /* what the reply's header will carry; a handler may change it */
} SRV_REQUEST;

/* Writes the content of the reply. Any result but ERR_OK replaces that content by TAG_ERROR with the result. */
typedef RTS_RESULT (*SRV_HANDLER)(SRV_REQUEST *request, BTAG_WRITER *reply);

/* What a client may do; a set of bits. A login gives all of them, as there are no users. */
enum {
    RIGHT_NONE = 0,     /* for services that need no login: identity of the device, login */
    RIGHT_VIEW = 1,     /* reads variables */
    RIGHT_WRITE = 2,    /* writes variables */
    RIGHT_CONTROL = 4,  /* starts, stops, resets */
    RIGHT_DOWNLOAD = 8, /* replaces the application */
    RIGHT_ALL = RIGHT_VIEW | RIGHT_WRITE | RIGHT_CONTROL | RIGHT_DOWNLOAD,
    RIGHT_STATE = COMM_PASSWORD ? RIGHT_VIEW | 0x10 : RIGHT_NONE, /* state of the application: needs a login with a
                                                                  * password only */
};

typedef struct {
    RTS_UI16 service;
    RTS_UI16 right; /* RIGHT_* the client needs */
    SRV_HANDLER handler;
} SRV_SERVICE;

typedef struct {
    const SRV_SERVICE *services;
    RTS_SIZE count;
    RTS_UI16 group;
} SRV_GROUP;

/* Registered groups. CmpList.h makes the room from the list of components. */
extern SRV_GROUP srv_groups[];
extern const RTS_SIZE srv_group_room;

/* `services` must stay valid. ERR_NOMEMORY when the groups of a port's own components exceed SRV_OWN_GROUPS. */
RTS_RESULT SrvRegisterGroup(RTS_UI16 group, const SRV_SERVICE *services, RTS_SIZE count);

/* Handles one message of a client and returns the size of the reply in `reply`; 0 when the header is invalid, so that
 * there is no reply. */
RTS_UI32 SrvHandleMessage(COMM_CLIENT *client, const RTS_UI8 *message, RTS_UI32 size, RTS_UI8 *reply,
                          RTS_UI32 capacity);

/* ---- the session of a client ---- */

/* Creates the session (again), without rights, and returns its id. */
RTS_UI32 SrvCreateSession(COMM_CLIENT *client);
/* Gives session `id` the rights of a login; another id creates a new session. Returns the session's id. */
RTS_UI32 SrvLogin(COMM_CLIENT *client, RTS_UI32 id);
/* Ends session `id`; ERR_INVALID_SESSION_ID when it is not that of the client. */
RTS_RESULT SrvLogout(COMM_CLIENT *client, RTS_UI32 id);
bool SrvIsLoggedIn(const COMM_CLIENT *client);
/* Called by the channel server: the session ends with its channel. */
void SrvEndSession(COMM_CLIENT *client);

/* The application session within the session: creates a new one and returns its id. */
RTS_UI32 SrvCreateAppSession(COMM_CLIENT *client);
bool SrvIsAppSession(const COMM_CLIENT *client, RTS_UI32 id);
void SrvEndAppSession(COMM_CLIENT *client);

RTS_RESULT CmpSrv_Hook(CMP_HOOK hook);

#endif
