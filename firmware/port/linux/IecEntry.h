/*
 * IecEntry.h - how compiled code is entered on Linux and macOS.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Shared by the linux and the sim port. On 32-bit Arm it is as on Cortex-M: Thumb code with the import table in r9.
 */
#ifndef IECENTRY_H
#define IECENTRY_H

#if defined(__arm__) && defined(__linux__)
#include "../baremetal/common/IecCall.h"

#define APP_ENTRY_MODE_BIT 1
#endif

#if defined(__linux__)
#define RTS_STRUCTURED_EXCEPTION_HANDLING 1
#endif

/* As many as SysExcept.c keeps of each. */
#if defined(__linux__) && defined(__x86_64__)
#define EXCEPT_REGISTERS 19
#elif (defined(__linux__) || defined(__APPLE__)) && defined(__aarch64__)
#define EXCEPT_REGISTERS 35
#elif defined(__linux__) && defined(__arm__)
#define EXCEPT_REGISTERS 18
#endif

#endif
