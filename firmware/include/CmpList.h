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
 *
 * What components register in is sized here: a component of the runtime has the room that it needs, one of a port room
 * for a table of external functions; CM_OWN_EXT_TABLES and SRV_OWN_GROUPS of rts_config.h are for more.
 */
#include "CmpItf.h"
#include "CmpSrv.h"
#include "rts_config.h"

/* A component that lacks another one, or its memory, would fail at start-up. */
#if HAS_CmpIoMgrEmbedded
#if IO_MAX_CONNECTORS == 0
#error "HAS_CmpIoMgrEmbedded: set IO_MAX_CONNECTORS, the devices and buses of a program, in rts_config_port.h."
#endif
#elif HAS_CmpIoMgrSrv || HAS_IoDrvSim || HAS_IoDrvGpio || HAS_IoDrvModbus || HAS_IoDrvCanopen || HAS_IoDrvCanopenDevice
#error "HAS_CmpIoMgrSrv and each HAS_IoDrv... need HAS_CmpIoMgrEmbedded in cmp_list.c."
#endif
#if HAS_CmpEventMgrEmbedded && EVENT_MAX_CALLBACKS == 0
#error "HAS_CmpEventMgrEmbedded: set EVENT_MAX_CALLBACKS, the callbacks of your components, in rts_config_port.h."
#endif
#if HAS_CmpAppBP && (BP_MAX == 0 || !HAS_COMMUNICATION)
#error "HAS_CmpAppBP: set BP_MAX in rts_config_port.h, and HAS_COMMUNICATION in cmp_list.c."
#endif
#if HAS_CmpUserMgr && !COMM_PASSWORD
#error "HAS_CmpUserMgr: set COMM_PASSWORD to 1 in rts_config_port.h."
#endif
#if HAS_CmpFileTransfer && FILE_STORE_FILES == 0
#error "HAS_CmpFileTransfer: set FILE_STORE_FILES and FILE_STORE_SIZE in rts_config_port.h."
#endif
#if HAS_CmpSettings && !SETTINGS
#error "HAS_CmpSettings: set SETTINGS to 1 in rts_config_port.h."
#endif
#if HAS_CmpAppCalls && APP_CALLS == 0
#error "HAS_CmpAppCalls: set APP_CALLS, the calls of programs that main carries out, in rts_config_port.h."
#endif
#if HAS_IecFile && (IEC_FILES == 0 || !HAS_CmpAppCalls || !HAS_CmpFileTransfer)
#error "HAS_IecFile: set IEC_FILES in rts_config_port.h, and HAS_CmpAppCalls and HAS_CmpFileTransfer in cmp_list.c."
#endif
#if HAS_IecSocket && !HAS_CmpAppCalls
#error "HAS_IecSocket needs HAS_CmpAppCalls in cmp_list.c."
#endif
#if HAS_IecCom && !HAS_CmpAppCalls
#error "HAS_IecCom needs HAS_CmpAppCalls in cmp_list.c."
#endif
#if HAS_CmpTraceMgr && TRACE_BUFFER == 0
#error "HAS_CmpTraceMgr: set TRACE_BUFFER, the bytes that traces may use, in rts_config_port.h."
#endif
#if HAS_CmpCan && !CAN_SHARED
#error "HAS_CmpCan: set CAN_SHARED to 1 in rts_config_port.h."
#endif
#if CAN_SHARED && HAS_CmpBlkDrvCan && !HAS_CmpCan
#error "HAS_CmpBlkDrvCan: with CAN_SHARED it needs HAS_CmpCan in cmp_list.c."
#endif
#if HAS_IecCan && (CAN_MAX_RECEIVERS == 0 || !HAS_CmpCan)
#error "HAS_IecCan: set CAN_MAX_RECEIVERS in rts_config_port.h, and HAS_CmpCan in cmp_list.c."
#endif
#if HAS_IoDrvCanopen && (CANOPEN_MAX_DEVICES == 0 || !HAS_CmpCan)
#error "HAS_IoDrvCanopen: set CANOPEN_MAX_DEVICES in rts_config_port.h, and HAS_CmpCan in cmp_list.c."
#endif
#if HAS_IoDrvCanopenDevice && (CANOPEN_DEVICE_DATA == 0 || !HAS_CmpCan)
#error "HAS_IoDrvCanopenDevice: set CANOPEN_DEVICE_DATA in rts_config_port.h, and HAS_CmpCan in cmp_list.c."
#endif
#if HAS_CmpCanopenProgram && (!CANOPEN_PROGRAM_DOWNLOAD || !HAS_IoDrvCanopenDevice)
#error "HAS_CmpCanopenProgram: set CANOPEN_PROGRAM_DOWNLOAD, and HAS_IoDrvCanopenDevice in cmp_list.c."
#endif
#if HAS_CmpLogKeep && (LOG_KEEP == 0 || !HAS_CmpLog)
#error \
    "HAS_CmpLogKeep: set LOG_KEEP, the entries that survive power-off, in rts_config_port.h, and HAS_CmpLog in cmp_list.c."
#endif
#if HAS_CmpIoKeep && (IO_KEEP_SIZE == 0 || !HAS_CmpIoMgrEmbedded || !HAS_CmpEventMgrEmbedded || !SETTINGS)
#error "HAS_CmpIoKeep: set IO_KEEP_SIZE and SETTINGS in rts_config_port.h, and HAS_CmpIoMgrEmbedded in cmp_list.c."
#endif
#if HAS_CmpLogSrv && !HAS_CmpLog
#error "HAS_CmpLogSrv needs HAS_CmpLog in cmp_list.c."
#endif
#if (HAS_CmpBlkDrvTcp || HAS_CmpBlkDrvUdp || HAS_CmpBlkDrvCan) && !COMM_ENDPOINTS
#error "HAS_CmpBlkDrvTcp, ...Udp and ...Can: set COMM_ENDPOINTS to 1 in rts_config_port.h."
#endif

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

#if CM_LEAVES_OUT
enum {
#define X(component) CMP_INDEX_##component,
#include "CmpOrder.h"
#undef X
};

const RTS_SIZE cmp_programs_first = CMP_INDEX_CmpIecTask + 1;
const RTS_SIZE cmp_programs_end = CMP_INDEX_CmpAppEmbedded;
bool cmp_left_out[RTS_COUNT(cmp_hooks)];
#endif

/* ---- what they register in ---- */

/* clang-format off */
#define CMP_ONE(component) +1

enum {
    CMP_EXT_TABLE_ROOM = CM_OWN_EXT_TABLES
#ifdef PORT_SYSTEM
    PORT_SYSTEM(CMP_ONE)
#endif
#ifdef PORT_COMPONENTS
    PORT_COMPONENTS(CMP_ONE)
#endif
    CMP_ONE(CmpIecTask)
#if HAS_CmpRetain
    CMP_ONE(CmpRetain)
#endif
#if HAS_CmpMath
    CMP_ONE(CmpMath)
#endif
#if HAS_CmpOperationControl
    CMP_ONE(CmpOperationControl)
#endif
#if HAS_IecLog
    CMP_ONE(IecLog)
#endif
#if HAS_IecEvents
    CMP_ONE(IecEvents)
#endif
#if HAS_CmpAppCalls
    CMP_ONE(CmpAppCalls)
#endif
#if HAS_IecFile
    CMP_ONE(IecFile)
#endif
#if HAS_IecSocket
    CMP_ONE(IecSocket)
#endif
#if HAS_IecCom
    CMP_ONE(IecCom)
#endif
#if HAS_IecCan
    CMP_ONE(IecCan)
#endif
#if HAS_IecClock
    CMP_ONE(IecClock)
#endif
#if HAS_IecTaskCalls
    CMP_ONE(IecTaskCalls)
#endif
#if HAS_IecTaskHandler
    CMP_ONE(IecTaskHandler)
#endif
#if HAS_IoDrvCanopen
    CMP_ONE(IoDrvCanopen)
#endif
#if HAS_IoDrvModbus
    CMP_ONE(IoDrvModbus)
#endif
};

CMP_EXT_TABLE cmp_ext_tables[CMP_EXT_TABLE_ROOM];
const RTS_SIZE cmp_ext_table_room = CMP_EXT_TABLE_ROOM;

#if HAS_COMMUNICATION
enum {
    SRV_GROUP_ROOM = SRV_OWN_GROUPS
    CMP_ONE(CmpAppSrv)
    CMP_ONE(CmpDevice)
#if SRV_OTHER_CLIENTS
    CMP_ONE(CmpDevice) /* settings */
#endif
#if HAS_CmpLogSrv
    CMP_ONE(CmpLogSrv)
#endif
#if HAS_CmpMonitor2
    CMP_ONE(CmpMonitor2)
#endif
#if HAS_CmpTraceMgr
    CMP_ONE(CmpTraceSrv)
#endif
#if HAS_CmpAppBP
    CMP_ONE(CmpAppBPSrv)
#endif
#if HAS_CmpIoMgrSrv
    CMP_ONE(CmpIoMgrSrv)
#endif
#if HAS_CmpUserMgr
    CMP_ONE(CmpUserMgr)
#endif
#if HAS_CmpPlcShell
    CMP_ONE(CmpPlcShell)
#endif
#if HAS_CmpFileTransfer
    CMP_ONE(CmpFileTransfer)
#endif
};

SRV_GROUP srv_groups[SRV_GROUP_ROOM];
const RTS_SIZE srv_group_room = SRV_GROUP_ROOM;
#endif
/* clang-format on */

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
