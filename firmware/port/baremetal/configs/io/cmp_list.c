/*
 * cmp_list.c - the components of the configuration with inputs and outputs: those of the standard one, and the lines of
 * the board.
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
#define HAS_CmpIoMgrEmbedded 1
#define HAS_IoDrvGpio 1
#define PORT_COMPONENTS(X) X(CmpIntCalls) X(CmpRealCalls)
#include "CmpList.h"
