/*
 * cmp_list.c - the components of the runner: what applications need, no communication.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpCompilerCalls.h"

#define COMPONENTS(X)                                                                                                  \
    X(CmpLog)                                                                                                          \
    X(SysSim)                                                                                                          \
    X(CmpEventMgrEmbedded)                                                                                             \
    X(SysFileFlash)                                                                                                    \
    X(CmpRetain)                                                                                                       \
    X(CmpScheduleTimer)                                                                                                \
    X(CmpIecTask)                                                                                                      \
    X(CmpMath)                                                                                                         \
    X(CmpIntCalls)                                                                                                     \
    X(CmpRealCalls)                                                                                                    \
    X(CmpLrealCalls)                                                                                                   \
    X(CmpAppEmbedded)

COMPONENTS(CMP_DECLARE)

const CMP_COMPONENT cmp_components[] = {COMPONENTS(CMP_ENTRY)};
const RTS_SIZE cmp_component_count = RTS_COUNT(cmp_components);
