/*
 * IecCompilerCalls.h - the components on Linux that compiled code calls where a processor has no instruction.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Shared by the linux and the sim port. 64-bit processors need none.
 */
#if defined(__arm__) && defined(__linux__)
#include "../baremetal/common/CmpCompilerCalls.h"

#define COMPILER_CALLS(X) X(CmpIntCalls) X(CmpRealCalls) X(CmpLrealCalls)
#else
#define COMPILER_CALLS(X)
#endif
