/*
 * cmp_list.c - the components of the full configuration: everything there is.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpCompilerCalls.h"

/* System components first; services before the components that register with them. */
#define COMPONENTS(X)           \
    X(CmpLog)                   \
    X(CmpEventMgrEmbedded)      \
    X(SysFileFlash)             \
    X(CmpRetain)                \
    X(CmpScheduleTimer)         \
    X(CmpIecTask)               \
    X(SysWatchdog)              \
    X(CmpMath)                  \
    X(CmpIntCalls)              \
    X(CmpRealCalls)             \
    X(CmpLrealCalls)            \
    X(CmpAppEmbedded)           \
    X(CmpSrv)                   \
    X(CmpDevice)                \
    X(CmpAppSrv)                \
    X(CmpLogSrv)                \
    X(CmpMonitor2)              \
    X(CmpRouterEmbedded)        \
    X(CmpNameServiceServer)     \
    X(CmpChannelServerEmbedded) \
    X(CmpBlkDrvSimpleCom)

CMP_LIST(COMPONENTS);
