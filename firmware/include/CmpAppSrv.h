/*
 * CmpAppSrv.h - the application services (group 2): login, start, stop, reset, status, tasks, download.
 * codesys-v3-protocol 4.6.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Requests and replies: docs/protocol.md.
 */
#ifndef CMPAPPSRV_H
#define CMPAPPSRV_H

#include "CmpItf.h"
#include "CmpStd.h"

/* True while a tool that is connected has begun a download. From main. */
bool AppSrvHasDownload(void);

RTS_RESULT CmpAppSrv_Hook(CMP_HOOK hook);

#endif
