/*
 * IecEntry.h - how compiled code is entered on Linux.
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

#endif
