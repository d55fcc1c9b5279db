/*
 * cmp_list.c - the components of plcrt, system components first.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpItf.h"

#define COMPONENTS(X)       \
    X(SysTime)              \
    X(CmpLog)               \
    X(SysTarget)            \
    X(SysLock)              \
    X(SysTimer)             \
    X(SysFileFlash)         \
    X(CmpEventMgrEmbedded)  \
    X(SysWatchdog)          \
    X(SysEvent)             \
    X(CmpMath)              \
    X(CmpRetain)            \
    X(CmpIecTask)           \
    X(CmpScheduleTimer)     \
    X(CmpAppEmbedded)       \
    X(CmpSrv)               \
    X(CmpDevice)            \
    X(CmpAppSrv)            \
    X(CmpMonitor2)          \
    X(CmpLogSrv)            \
    X(CmpBlkDrvSimpleCom)   \
    X(CmpRouterEmbedded)    \
    X(CmpNameServiceServer) \
    X(CmpChannelServerEmbedded)

CMP_LIST(COMPONENTS);
