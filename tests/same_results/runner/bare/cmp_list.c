/*
 * cmp_list.c - the components of the runner: what applications need, no communication.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpCompilerCalls.h"

#define COMPONENTS(X)      \
    X(CmpLog)              \
    X(SysSim)              \
    X(CmpEventMgrEmbedded) \
    X(SysFileFlash)        \
    X(CmpRetain)           \
    X(CmpScheduleTimer)    \
    X(CmpIecTask)          \
    X(CmpMath)             \
    X(CmpIntCalls)         \
    X(CmpRealCalls)        \
    X(CmpLrealCalls)       \
    X(CmpAppEmbedded)

CMP_LIST(COMPONENTS);
