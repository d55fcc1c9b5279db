/*
 * AppEventIds.h - the events of the application (shared with the host). Manual 3.3.8.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef APPEVENTIDS_H
#define APPEVENTIDS_H

#include "CmpStd.h"

/*
 * EVT_CLASS_* is in the high half; EVTPARAM_CmpApp is the parameter.
 *
 * EVT_PrepareDownload, EVT_PrepareOnlineChange and EVT_Deny* are questions: an answer other than ERR_OK (CmpEventMgr.h) denies, before anything
 * has changed. Services and the start-up ask. What keeps a device reachable does not: exceptions, a reset to the origin,
 * a start that leaves the program stopped, the end of the runtime.
 */
enum {
    EVT_PrepareStart = 0x10001,
    EVT_StartDone = 0x10002,
    EVT_PrepareStop = 0x10003,
    EVT_StopDone = 0x10004,
    EVT_PrepareReset = 0x10005,
    EVT_ResetDone = 0x10006,
    EVT_PrepareOnlineChange = 0x10007, /* of the new application, which is checked; the old one still runs */
    EVT_OnlineChangeDone = 0x10008,    /* after each of them, also a denied one, of what runs then */
    EVT_PrepareDownload = 0x10009,     /* of the new application, which is checked; the old one still runs */
    EVT_DownloadDone = 0x1000A,        /* after each EVT_PrepareDownload, also a denied one, of what is loaded then */
    EVT_PrepareExit = 0x1000E,         /* its variables end: it is given up, or gets its initial values again */
    EVT_CreateBootprojectDone = 0x10010,
    EVT_LoadBootprojectDone = 0x10011,
    EVT_DenyLoadBootproject = 0x10012,    /* no name yet, since its image has not been read */
    EVT_PrepareLoadBootproject = 0x10013, /* the same */
    EVT_DenyStartBootproject = 0x10014,   /* has its initial values, as for EVT_DenyStart */
    EVT_PrepareStartBootproject = 0x10015,
    EVT_StartBootprojectDone = 0x10016,
    EVT_DenyStart = 0x10017,
    EVT_DenyStop = 0x10018,              /* of one that runs: also for a reset and a download */
    EVT_AllBootprojectsLoaded = 0x10019, /* of a start-up, also without a boot project; slot SLOT_NONE then */
    EVT_CmpApp_Exception = 0x8001C,
    EVT_TaskException = 0x800C8, /* of a task that failed; only functions of the program are called, in the task */
};

/* In the function table of an image: identifier of a function that the program registers for events, without its number,
 * which is 1 to 0x7FFF. */
enum { IEC_CALLBACK = 0x07D00000 };

enum { EVTPARAMID_CmpApp = 1 };

/* The application that an event is about. */
typedef struct {
    const char *name; /* of the project; "" when unknown */
    RTS_UI32 slot;    /* FILE_SLOT_*; SLOT_NONE without application, and the rest 0 */
    RTS_UI32 crc;
    RTS_UI32 size;
} EVTPARAM_CmpApp;

#endif
