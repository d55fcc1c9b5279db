/*
 * CmpList.h - the list of components, for the cmp_list.c of a port.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * CmpOrder.h has all there are, in their order. A port chooses from them, and adds its own, before it includes this:
 *
 *   #define HAS_CmpLog 1                 the component of this name; see CmpOrder.h
 *   #define HAS_COMMUNICATION 1          those that all communication needs
 *   #define PORT_SYSTEM(X) X(SysFoo)     system components, after time and log and before all others
 *   #define PORT_COMPONENTS(X) X(Board)  all others, which may use everything but the application and communication
 *
 * SysFoo has the hook SysFoo_Hook and the number CMPID_SysFoo. What is not chosen takes no flash.
 */
#include "CmpItf.h"
#include "rts_config.h"

/* plctool has the facts of all boards here. A program of an operating system has none: they would be memory of it. */
#if defined(BOARD_FACTS_ONLY) || (defined(BOARD_FLASH_SECTOR_SIZE) && !defined(__linux__))
#include "BoardFactsOwn.h"
#endif

#ifndef BOARD_FACTS_ONLY
#define X(component) RTS_RESULT component##_Hook(CMP_HOOK hook);
#include "CmpOrder.h"
#undef X

#define X(component) component##_Hook,
const PF_HOOK_FUNCTION cmp_hooks[] = {
#include "CmpOrder.h"
};
#undef X

#define X(component) {CMPID_##component, #component},
const CMP_NAME cmp_names[] = {
#include "CmpOrder.h"
};
#undef X

#ifdef HAS_CmpPlcShell
extern const struct BLK_COUNTERS BlkDrvComCounters, BlkDrvCanCounters, BlkDrvTcpCounters, BlkDrvUdpCounters;

const struct BLK_COUNTERS *const BlkCounters[] = {
#ifdef HAS_CmpBlkDrvSimpleCom
    &BlkDrvComCounters,
#endif
#ifdef HAS_CmpBlkDrvCan
    &BlkDrvCanCounters,
#endif
#ifdef HAS_CmpBlkDrvTcp
    &BlkDrvTcpCounters,
#endif
#ifdef HAS_CmpBlkDrvUdp
    &BlkDrvUdpCounters,
#endif
    NULL,
};
#endif

const RTS_SIZE cmp_component_count = RTS_COUNT(cmp_hooks);
#endif
