/*
 * cmp_list.c - the components of the full configuration: everything there is.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpCompilerCalls.h"

#define HAS_CmpLog 1
#define HAS_CmpLogKeep (LOG_KEEP > 0)
#define HAS_CmpEventMgrEmbedded 1
#define HAS_CmpSettings SETTINGS
#define HAS_SysWatchdog 1
#define HAS_CmpRetain 1
#define HAS_CmpMath 1
#define HAS_CmpIoMgrEmbedded 1
#define HAS_IoDrvGpio 1
#define HAS_CmpForce (FORCE_MAX > 0)
#define HAS_CmpOperationControl 1
#define HAS_IecLog 1
#define HAS_IecEvents IEC_EVENTS
#define HAS_CmpAppCalls (APP_CALLS > 0)
#define HAS_IecFile (IEC_FILES > 0)
#define HAS_IecSocket (APP_CALLS > 0)
#define HAS_IecCom (APP_CALLS > 0)
#define HAS_CmpAppBP (BP_MAX > 0)
#define HAS_IecClock (APP_CALLS > 0)
#define HAS_IecTaskCalls IEC_TASK_CALLS
#define HAS_CmpTaskLoad TASK_LOAD
#define HAS_IecTaskHandler IEC_TASK_HANDLER
#define HAS_CmpTraceMgr (TRACE_BUFFER > 0)
#define HAS_CmpIoMgrSrv 1
#define HAS_COMMUNICATION 1
#define HAS_CmpUserMgr 1
#define HAS_CmpLogSrv 1
#define HAS_CmpPlcShell 1
#define HAS_CmpFileTransfer 1
#define HAS_CmpMonitor2 1
#define HAS_CmpBlkDrvSimpleCom 1
#define PORT_COMPONENTS(X) X(CmpIntCalls) X(CmpRealCalls) X(CmpLrealCalls) X(RunLamp)
#include "CmpList.h"
