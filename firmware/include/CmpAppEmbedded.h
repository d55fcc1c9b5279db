/*
 * CmpAppEmbedded.h - the application: start, stop, reset, boot project, status.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * There is one application. It is in one of two flash slots; a download goes to the other one while the application
 * runs, and takes over only after every check has passed. Manual 3.3, 2.3.1; design: two slots, one atomic commit
 * record. All functions are called from main only, unless said otherwise. (Shared with the host.)
 */
#ifndef CMPAPPEMBEDDED_H
#define CMPAPPEMBEDDED_H

#include "AppAddress.h"
#include "AppDownload.h"
#include "AppException.h"
#include "AppState.h"
#include "CmpErrors.h"
#include "CmpIecAbi.h"
#include "CmpStd.h"
#include "SysStart.h"
#ifndef RTS_CFFI
#include "CmpItf.h"
#endif

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

typedef struct {
    RTS_UI32 state;     /* AS_* */
    RTS_UI32 op_state;  /* OS_* */
    RTS_UI32 image_crc; /* 0 without application, like the size */
    RTS_UI32 image_size;
    APP_EXCEPTION exception;
} APP_STATUS;

/* All of these also return the answer of a component that denies (EVT_DenyStart, EVT_DenyStop), whose words
 * AppTakeReason has, and ERR_CALL_AGAIN within a callback of an event. */
/* ERR_APP_NOT_LOADED without application, ERR_INVALID_STATE after an exception (reset first), ERR_OK otherwise. */
RTS_RESULT AppStartApplication(void);
/* Returns when no task is in its cycle any more; outputs are set to zero, retain variables saved. */
RTS_RESULT AppStopApplication(void);
/* One cycle of each task of an application that is stopped, and stays so: outputs are set to zero after it, as by
 * AppStopApplication. Returns when it is done. ERR_APP_NOT_LOADED; ERR_CALL_AGAIN while it runs; ERR_INVALID_STATE
 * after an exception; ERR_EXCEPTION when there was one. With SRV_OTHER_CLIENTS. */
RTS_RESULT AppSingleCycle(void);
/* Loads and starts the boot project, as after a start-up: what is in RAM is lost, retain variables are kept. Nothing
 * runs when that fails. ERR_APP_NOT_LOADED without one. */
RTS_RESULT AppReload(void);
/* Warm keeps retain variables, cold initialises them too, origin deletes the application and its boot project, and is
 * never denied. After
 * warm and cold the application is in AS_STOP. */
RTS_RESULT AppReset(RTS_UI32 option);

void AppGetStatus(APP_STATUS *status);
/* Project name etc. from the application info segment; "" when absent. index: 0 project, 1 author, 2 version, 3
 * description, 4 profile. Valid until the next call; cut to APP_NAME_SIZE. */
const char *AppGetInfo(RTS_UI32 index);

/* Reads from the image of the application. ERR_APP_NOT_LOADED without one, ERR_OUT_OF_LIMITS past its end, ERR_DEVICE. */
RTS_RESULT AppReadImage(RTS_UI32 offset, void *data, RTS_UI32 size);

#ifndef RTS_CFFI
RTS_RESULT CmpAppEmbedded_Hook(CMP_HOOK hook);
#endif

#endif
