/*
 * CmpOperationControl.h - what the running program forbids tools to do (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Manual 3.3.9. A program sets the members of PlcOperationControlInstance, a variable of the library. They count while
 * the application runs: one that is stopped or has failed forbids nothing, so the device stays open. Starting and a
 * reset to the origin are never forbidden; nor is what a component of the device does itself.
 */
#ifndef CMPOPERATIONCONTROL_H
#define CMPOPERATIONCONTROL_H

#include "CmpErrors.h"
#include "CmpItf.h"
#include "rts_config.h"

/* In the order of the variable's members. OPERATION_ALL: all others. */
enum {
    OPERATION_ONLINE_CHANGE,
    OPERATION_DOWNLOAD,
    OPERATION_STOP,
    OPERATION_BP,
    OPERATION_WRITE,
    OPERATION_FORCE,
    OPERATION_RESET,
    OPERATION_ALL,
    OPERATION_COUNT,
};

#if !defined(RTS_CFFI) && !OPERATION_CONTROL
#define OperationForbidden() 0u
#define OperationMay(operation) ERR_OK
#else
/* A bit 1 << OPERATION_* for each that the program forbids now, without OPERATION_ALL. From main. */
RTS_UI32 OperationForbidden(void);

/* ERR_OPERATION_DENIED when the program forbids it now. From main. */
RTS_RESULT OperationMay(RTS_UI32 operation);
#endif

#ifndef RTS_CFFI
RTS_RESULT CmpOperationControl_Hook(CMP_HOOK hook);
#endif

#endif
