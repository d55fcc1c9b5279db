/*
 * cmp_list.c - the components of the minimal configuration.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define HAS_SysWatchdog 1
#define HAS_COMMUNICATION 1
#define HAS_CmpBlkDrvSimpleCom 1
#include "CmpList.h"
