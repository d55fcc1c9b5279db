/*
 * cmp_list.c - the components of the configuration with a CANopen manager: those of the configuration with CANopen, the
 * manager with its SYNC and blocks, and requests of tools for inputs, outputs and objects of nodes.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpCompilerCalls.h"

#define HAS_CmpLog 1
#define HAS_SysWatchdog 1
#define HAS_CmpRetain 1
#define HAS_COMMUNICATION 1
#define HAS_CmpLogSrv 1
#define HAS_CmpMonitor2 1
#define HAS_CmpBlkDrvSimpleCom 1
#define HAS_CmpBlkDrvCan 1
#define HAS_CmpCan 1
#define HAS_CmpIoMgrEmbedded 1
#define HAS_CmpIoMgrSrv 1
#define HAS_IoDrvCanopen 1
#define HAS_IoDrvCanopenDevice 1
#define PORT_COMPONENTS(X) X(CmpIntCalls) X(CmpRealCalls)
#include "CmpList.h"
