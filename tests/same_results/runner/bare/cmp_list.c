/*
 * cmp_list.c - the components of the runner: what applications need, no communication.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpCompilerCalls.h"

#define HAS_CmpLog 1
#define HAS_CmpEventMgrEmbedded 1
#define HAS_CmpRetain 1
#define HAS_CmpMath 1
#define HAS_IecLog 1
#define HAS_IecEvents 1
#define HAS_IecTaskCalls 1
#define PORT_COMPONENTS(X) X(CmpIntCalls) X(CmpRealCalls) X(CmpLrealCalls) X(SysSim)
#include "CmpList.h"
