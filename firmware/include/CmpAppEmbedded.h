/*
 * CmpAppEmbedded.h - the application: load, start, stop, reset, boot project.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * There is one application. It lies in one of two flash slots; a download goes to the other one while the application
 * runs, and takes over only after every check has passed. Manual 3.3, 2.3.1; design: two slots, one atomic commit
 * record. All functions are called from main only, unless said otherwise. (Shared with the host.)
 */
#ifndef CMPAPPEMBEDDED_H
#define CMPAPPEMBEDDED_H

#include "CmpErrors.h"
#include "CmpIecAbi.h"
#include "CmpStd.h"
#include "SysStart.h"
#include "rts_config.h"
#ifndef RTS_CFFI
#include "CmpItf.h"
#endif

/* Application states (codesys-v3-protocol 4.6). An exception is AS_STOP with OS_EXCEPTION set in the operating
 * state. */
enum { AS_NONE = 0, AS_RUN = 1, AS_STOP = 2, AS_HALT_ON_BP = 3, AS_SINGLE_CYCLE = 5 };

/* Operating state bits (5.6). */
enum {
    OS_PROGRAM_LOADED = 0x1,
    OS_DOWNLOAD = 0x2,
    OS_FORCE_ACTIVE = 0x10,
    OS_EXCEPTION = 0x20,
    OS_BOOTPROJECT_VALID = 0x1000,
};

/* Reset options. */
enum { RESET_OPTION_WARM = 0, RESET_OPTION_COLD = 1, RESET_OPTION_ORIGIN = 2 };

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
    EVT_CmpApp_Exception = 0x8001C,
};

enum { APP_NAME_SIZE = 60 }; /* with NUL */

/* The last exception; code RTSEXCPT_NOEXCEPTION when there is none. */
typedef struct {
    RTS_UI32 code;
    RTS_UI32 code_offset; /* fault address in the code segment, APP_NO_CODE_OFFSET when it was elsewhere */
    RTS_I32 task;         /* index of the task, -1 when in initialisation code */
} APP_EXCEPTION;

typedef struct {
    RTS_UI32 state;     /* AS_* */
    RTS_UI32 op_state;  /* OS_* */
    RTS_UI32 image_crc; /* 0 without application, like the size */
    RTS_UI32 image_size;
    APP_EXCEPTION exception;
} APP_STATUS;

enum { APP_REFUSAL_SIZE = APP_REFUSAL_TEXT_SIZE };

/* Why a download was refused: a sentence, cut to fit; "" when it was not. */
typedef struct {
    char text[APP_REFUSAL_SIZE];
} APP_REFUSAL;

#ifndef RTS_CFFI
/* Writes why, and returns `result`. A macro, so that sentences that are never sent take no flash. */
#define APP_REFUSE(refusal, result, ...) \
    (APP_REFUSAL_TEXT_SIZE > 1 ? AppRefuse(refusal, result, __VA_ARGS__) : (RTS_RESULT)(result))
RTS_RESULT AppRefuse(APP_REFUSAL *refusal, RTS_RESULT result, const char *format, ...);
#endif

/*
 * Download. Begin opens the idle slot (erases lazily, sector by sector), Write appends, End checks everything
 * and, only when all is well, commits the slot, stops the old application and loads the new one (state AS_STOP).
 * On any error the old application runs on, untouched; except that when the tasks of the new one cannot be created, it
 * is loaded again, with its retain variables, and started if it ran.
 *
 * Begin: ERR_NOMEMORY too large for the slot. Write: ERR_INVALID_SEQUENCE not begun or `offset` is not what
 * AppDownloadOffset says; ERR_DEVICE flash fault, which ends the download. End: the reason as ERR_* and in *refusal
 * (never NULL).
 */
RTS_RESULT AppDownloadBegin(RTS_UI32 total_size, RTS_UI32 image_crc);
RTS_RESULT AppDownloadWrite(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size);
RTS_UI32 AppDownloadOffset(void); /* bytes received so far; a broken transfer continues here */
/* Whether the download that has begun is that of this image. It outlives the channel it came through. */
bool AppDownloadIsOf(RTS_UI32 total_size, RTS_UI32 image_crc);
bool AppDownloadIsOpen(void);
RTS_RESULT AppDownloadEnd(APP_REFUSAL *refusal);
void AppDownloadAbort(void);

/* ERR_APP_NOT_LOADED without application, ERR_INVALID_STATE after an exception (reset first), ERR_OK otherwise. */
RTS_RESULT AppStartApplication(void);
/* Returns when no task is in its cycle any more; outputs are set to zero, retain variables saved. */
RTS_RESULT AppStopApplication(void);
/* Warm keeps retain variables, cold initialises them too, origin deletes the application and its boot project. After
 * warm and cold the application is in AS_STOP. */
RTS_RESULT AppReset(RTS_UI32 option);

void AppGetStatus(APP_STATUS *status);
/* Project name etc. from the application info segment; "" when absent. index: 0 project, 1 author, 2 version, 3
 * description, 4 profile. Valid until the next call; cut to APP_NAME_SIZE. */
const char *AppGetInfo(RTS_UI32 index);

/*
 * Checks that [offset, offset + size) lies in area `index` of the loaded application and returns its address, NULL
 * otherwise. The only way anybody turns an area reference from outside into a pointer. APP_AREA_CODE may only be read.
 */
RTS_UI8 *AppGetAreaAddress(RTS_UI32 index, RTS_UI32 offset, RTS_UI32 size);
RTS_UI32 AppGetAreaSize(RTS_UI32 index); /* bytes, as the image asked for */
/* Finds what a pointer of the application leads to; false when that is in no area, as with NULL and temporary
 * variables. */
bool AppFindArea(uintptr_t address, RTS_UI32 *index, RTS_UI32 *offset);

#ifndef RTS_CFFI
/* Called by CmpIecTask in the context of the task whose cycle failed, when no task starts another cycle: sets the
 * outputs to zero and records the exception. The rest (log, outputs that other tasks have written meanwhile, events)
 * follows in CH_COMM_CYCLE. */
void AppHandleException(RTS_I32 task, RTS_UI32 code, uintptr_t address);

/* The words for an RTSEXCPT_* code, for the log. From any context. */
const char *AppExceptionName(RTS_UI32 code);

RTS_RESULT CmpAppEmbedded_Hook(CMP_HOOK hook);
#endif

#endif
