/*
 * AppState.h - the states of the application and the events it posts (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef APPSTATE_H
#define APPSTATE_H

#include "CmpStd.h"

/* Application states (codesys-v3-protocol 4.6). An exception is AS_STOP with OS_EXCEPTION set in the operating
 * state. */
enum { AS_NONE = 0, AS_RUN = 1, AS_STOP = 2, AS_HALT_ON_BP = 3, AS_SINGLE_CYCLE = 5 };

/* Events (5.7), with EVT_CLASS_* in the high half. */
enum {
    EVT_PrepareStart = 0x10001,
    EVT_StartDone = 0x10002,
    EVT_PrepareStop = 0x10003,
    EVT_StopDone = 0x10004,
    EVT_PrepareReset = 0x10005,
    EVT_ResetDone = 0x10006,
    EVT_PrepareDownload = 0x10009,
    EVT_DownloadDone = 0x1000A,
    EVT_PrepareExit = 0x1000E, /* its variables end: it is given up, or gets its initial values again */
    EVT_CmpApp_Exception = 0x8001C,
};

/* AS_*. From any context. */
RTS_UI32 AppGetState(void);

#endif
