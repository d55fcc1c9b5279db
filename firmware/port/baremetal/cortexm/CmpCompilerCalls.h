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

CMP_DECLARE(CmpIntCalls)
CMP_DECLARE(CmpRealCalls)
CMP_DECLARE(CmpLrealCalls)

#endif
