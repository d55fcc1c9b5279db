/*
 * cmp_list.c - the components of the simulator.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "../linux/IecCompilerCalls.h"

#define HAS_CmpLog 1
#define HAS_CmpLogKeep 1
#define HAS_CmpIoKeep 1
#define HAS_CmpEventMgrEmbedded 1
#define HAS_CmpSettings 1
#define HAS_CmpRetain 1
#define HAS_CmpMath 1
#define HAS_CmpIoMgrEmbedded 1
#define HAS_IoDrvSim 1
#define HAS_CmpForce 1
#define HAS_CmpOperationControl 1
#define HAS_IecLog 1
#define HAS_IecEvents 1
#define HAS_CmpAppCalls 1
#define HAS_IecFile 1
#define HAS_IecSocket 1
#define HAS_IecCom 1
#define HAS_IecClock 1
#define HAS_IecTaskCalls 1
#define HAS_CmpTaskLoad 1
#define HAS_IecTaskHandler 1
#define HAS_CmpTraceMgr 1
#define HAS_CmpAppBP (BP_MAX > 0)
#define HAS_CmpIoMgrSrv 1
#define HAS_COMMUNICATION 1
#define HAS_CmpUserMgr 1
#define HAS_CmpLogSrv 1
#define HAS_CmpPlcShell 1
#define HAS_CmpFileTransfer 1
#define HAS_CmpMonitor2 1
#define HAS_CmpBlkDrvSimpleCom 1
#ifdef SIM_HAS_BUSES
#define HAS_IoDrvModbus 1
#define HAS_IoDrvCanopen 1
#define HAS_IoDrvCanopenDevice 1
#define HAS_CmpCanopenProgram CANOPEN_PROGRAM_DOWNLOAD
#define HAS_CmpCan 1
#define HAS_IecCan 1
#define PORT_COMPONENTS(X) COMPILER_CALLS(X) X(SysSim) X(SimBuses)
#define PORT_SYSTEM(X) X(SimCanBus)
#else
#define PORT_COMPONENTS(X) COMPILER_CALLS(X) X(SysSim)
#endif
#include "CmpList.h"
