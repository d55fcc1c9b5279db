/*
 * CmpCompilerCalls.h - components that offer the compiler's own calls to applications, see CmpCompilerCalls.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CMPCOMPILERCALLS_H
#define CMPCOMPILERCALLS_H

#include "CmpItf.h"

/* Component numbers from 0x1000 on are the port's. */
enum { CMPID_CmpIntCalls = 0x1000, CMPID_CmpRealCalls = 0x1001, CMPID_CmpLrealCalls = 0x1002 };

RTS_RESULT CmpIntCalls_Hook(CMP_HOOK hook);
RTS_RESULT CmpRealCalls_Hook(CMP_HOOK hook);
RTS_RESULT CmpLrealCalls_Hook(CMP_HOOK hook);

#endif
