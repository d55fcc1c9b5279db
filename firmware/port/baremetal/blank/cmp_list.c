/*
 * cmp_list.c - the components of your device. Strike what it does not need; add your own.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpItf.h"

/* System components first; services before the components that register with them. */
#define COMPONENTS(X)           \
    X(CmpLog)                   \
    X(CmpEventMgrEmbedded)      \
    X(SysFileFlash)             \
    X(CmpRetain)                \
    X(CmpScheduleTimer)         \
    X(CmpIecTask)               \
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
