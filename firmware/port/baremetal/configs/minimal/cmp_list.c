/*
 * cmp_list.c - the components of the minimal configuration.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpItf.h"

/* System components first; services before the components that register with them. */
#define COMPONENTS(X)           \
    X(SysFileFlash)             \
    X(CmpScheduleTimer)         \
    X(CmpIecTask)               \
    X(SysWatchdog)              \
    X(CmpAppEmbedded)           \
    X(CmpSrv)                   \
    X(CmpDevice)                \
    X(CmpAppSrv)                \
    X(CmpRouterEmbedded)        \
    X(CmpNameServiceServer)     \
    X(CmpChannelServerEmbedded) \
    X(CmpBlkDrvSimpleCom)

CMP_LIST(COMPONENTS);
