/*
 * cmp_list.c - the components of the plus configuration: standard, and what programs and components hear and forbid.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpCompilerCalls.h"

#define HAS_CmpLog 1
#define HAS_CmpLogKeep 1
#define HAS_CmpEventMgrEmbedded 1
#define HAS_SysWatchdog 1
#define HAS_CmpRetain 1
#define HAS_CmpOperationControl 1
#define HAS_IecLog 1
#define HAS_IecEvents 1
#define HAS_IecTaskCalls 1
#define HAS_CmpTaskLoad 1
#define HAS_IecTaskHandler 1
#define HAS_COMMUNICATION 1
#define HAS_CmpLogSrv 1
#define HAS_CmpMonitor2 1
#define HAS_CmpBlkDrvSimpleCom 1
#define PORT_COMPONENTS(X) X(CmpIntCalls) X(CmpRealCalls)
#include "CmpList.h"
