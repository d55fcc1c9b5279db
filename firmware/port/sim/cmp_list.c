/*
 * cmp_list.c - the components of the simulator.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpItf.h"

/* In the order of start-up: a component comes after those it uses. */
#define COMPONENTS(X)           \
    X(CmpLog)                   \
    X(SysSim)                   \
    X(SysFileFlash)             \
    X(CmpEventMgrEmbedded)      \
    X(CmpMath)                  \
    X(CmpRetain)                \
    X(CmpScheduleTimer)         \
    X(CmpIecTask)               \
    X(CmpAppEmbedded)           \
    X(CmpSrv)                   \
    X(CmpDevice)                \
    X(CmpAppSrv)                \
    X(CmpMonitor2)              \
    X(CmpLogSrv)                \
    X(CmpChannelServerEmbedded) \
    X(CmpNameServiceServer)     \
    X(CmpRouterEmbedded)        \
    X(CmpBlkDrvSimpleCom)

CMP_LIST(COMPONENTS);
