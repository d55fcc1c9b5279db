/*
 * cmp_list.c - the components of your device. Strike what it does not need; add your own (CmpList.h).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define HAS_CmpLog 1
#define HAS_CmpEventMgrEmbedded 1
#define HAS_CmpRetain 1
#define HAS_CmpIoMgrEmbedded 1
#define HAS_IoDrvGpio 1
#define HAS_CmpIoMgrSrv 1
#define HAS_COMMUNICATION 1
#define HAS_CmpLogSrv 1
#define HAS_CmpPlcShell 1
#define HAS_CmpMonitor2 1
#define HAS_CmpBlkDrvSimpleCom 1
#include "CmpList.h"
