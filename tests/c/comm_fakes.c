/*
 * comm_fakes.c - what the communication needs from the rest of the runtime.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "comm_fakes.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "../../firmware/src/app/AppLife.h"
#include "CmpAppBPSrv.h"
#include "CmpAppSrv.h"
#include "CmpTraceSrv.h"
#include "CmpBytes.h"
#include "CmpCan.h"
#include "CmpBlkDrvCan.h"
#include "CmpBlkDrvSimpleCom.h"
#include "CmpBlkDrvTcp.h"
#include "CmpBlkDrvUdp.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpDevice.h"
#include "CmpEventMgr.h"
#include "CyclePhases.h"
#include "FileStore.h"
#include "CmpLogKeep.h"
#include "CmpLogSrv.h"
#include "CmpPlcShell.h"
#include "CmpMonitor2.h"
#include "CmpNameServiceServer.h"
#include "CmpOperationControl.h"
#include "CmpRouterEmbedded.h"
#include "CmpSrv.h"
#include "CmpTraceMgr.h"
#include "CmpUserMgr.h"
#include "NodeName.h"
#include "Sim.h"
#include "SimLink.h"
#include "SysCom.h"
#include "Unpack.h"
#include "SysExcept.h"
#include "SysLock.h"
#include "SysTime.h"

/* COMM_CAN_TESTED: 1 the driver of CAN in place of those of networks, 2 beside them. */
#define NETWORK_TESTED (COMM_ENDPOINTS && COMM_CAN_TESTED != 1)

FAKES fakes;

SRV_GROUP srv_groups[10];
const RTS_SIZE srv_group_room = RTS_COUNT(srv_groups);

#if CM_VERSIONS > 0
const CMP_NAME cmp_names[] = {{CMPID_CmpMgr, "CmpMgr"}};
const RTS_SIZE cmp_component_count = RTS_COUNT(cmp_names);

RTS_UI32 CMGetVersion(RTS_UI32 id)
{
    RTS_UNUSED(id);
    return 0;
}
#endif

/* ---- system ---- */

RTS_I64 SysTimeGetNs(void)
{
    return 0;
}

RTS_UI32 SysTimeGetMs(void)
{
    return fakes.now_ms;
}

#if COMM_CAN_TESTED && CAN_SHARED
void SysTimeWantPass(RTS_UI32 ms)
{
    RTS_UNUSED(ms);
}
#endif

SYS_STACK SysTargetGetStack(void)
{
    return (SYS_STACK){2000, 500};
}

const SYS_TARGET *SysTargetGet(void)
{
    return &fakes.target;
}

#if NODE_NAME_CAN_CHANGE
const char *NodeNameOf(const SYS_TARGET *target)
{
    return fakes.node_name[0] != '\0' ? fakes.node_name : target->node_name;
}

RTS_RESULT NodeNameSet(const char *name)
{
    strncpy(fakes.node_name, name, NS_MAX_NODE_NAME);
    return ERR_OK;
}
#endif

RTS_UI32 SysTargetRandom(void)
{
    fakes.random = fakes.random * 1664525u + 1013904223u;
    return fakes.random ^ fakes.random >> 16;
}

bool SysTargetHasGenerator(void)
{
    return !fakes.no_generator;
}

RTS_UI32 SysLockEnter(void)
{
    fakes.locks++;
    return fakes.lock_depth++;
}

void SysLockLeave(RTS_UI32 before)
{
    fakes.lock_depth = before;
}

RTS_UI32 SysComGetCount(void)
{
    return 1;
}

RTS_RESULT SysComOpen(RTS_UI32 index)
{
    return index == 0 ? fakes.line_open_result : ERR_DEVICE;
}

void SysComClose(RTS_UI32 index)
{
    RTS_UNUSED(index);
}

RTS_UI32 SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 there = fakes.line_in_size - fakes.line_in_read;

    RTS_UNUSED(index);
    if (size > there)
        size = there;
    memcpy(data, fakes.line_in + fakes.line_in_read, size);
    fakes.line_in_read += size;
    return size;
}

RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 room = FAKE_LINE_SIZE - fakes.line_out_size;

    RTS_UNUSED(index);
    if (size > fakes.line_write_limit)
        size = fakes.line_write_limit;
    if (size > room)
        size = room;
    memcpy(fakes.line_out + fakes.line_out_size, data, size);
    fakes.line_out_size += size;
    return size;
}

const char *CMGetComponentName(RTS_UI32 id)
{
    return id == CMPID_CmpAppEmbedded ? "CmpAppEmbedded" : "";
}

void LogAddEntry(RTS_UI32 component, RTS_UI32 log_class, RTS_UI32 error, const char *format, ...)
{
    RTS_UNUSED(component);
    RTS_UNUSED(log_class);
    RTS_UNUSED(error);
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(fakes.log_text, sizeof(fakes.log_text), format, arguments);
    va_end(arguments);
    fakes.log_added++;
}

RTS_RESULT LogGetEntry(RTS_UI32 handle, LOG_ENTRY *entry)
{
    for (RTS_UI32 i = 0; i < fakes.log_count; i++) {
        if (fakes.log[i].handle >= handle) {
            *entry = fakes.log[i];
            return ERR_OK;
        }
    }
    return ERR_END_OF_OBJECT;
}

RTS_RESULT LogKeepGet(RTS_UI32 number, LOG_ENTRY *entry, LOG_KEPT_FROM *from)
{
    *from = (LOG_KEPT_FROM){fakes.utc_ns, 7};
    return fakes.kept != ERR_OK ? fakes.kept : LogGetEntry(number, entry);
}

RTS_RESULT SysTimeRtcGet(RTS_I64 *utc_ns)
{
    *utc_ns = fakes.utc_ns;
    return fakes.utc_ns == 0 ? ERR_NOT_READY_YET : ERR_OK;
}

/* Without the simulator there is no power to cut. */
RTS_RESULT SimCall(void (*fn)(void *arg), void *arg)
{
    fn(arg);
    return ERR_OK;
}

/* ---- application ---- */

RTS_UI8 *fakes_area(RTS_UI32 index)
{
    return (RTS_UI8 *)fakes.area[index];
}

/* AppAddress.c finds addresses in these. */
const APP_IMAGE *AppGetImage(void)
{
    static APP_IMAGE image;

    memcpy(image.area_size, fakes.area_size, sizeof(image.area_size));
    image.crc = fakes.status.image_crc;
    return &image;
}

const IEC_CONTEXT *AppGetContext(void)
{
    static IEC_CONTEXT context;

    for (RTS_UI32 i = 0; i < APP_AREA_COUNT; i++)
        context.area[i] = fakes_area(i);
    return &context;
}

RTS_UI32 AppGetState(void)
{
    return AS_STOP;
}

#if APP_IMAGE_SIZE > 0
bool AppImageFind(uintptr_t address, RTS_UI32 *area, RTS_UI32 *offset)
{
    RTS_UNUSED(address);
    RTS_UNUSED(area);
    RTS_UNUSED(offset);
    return false;
}

RTS_UI8 *AppImageGetCopy(RTS_UI32 task, RTS_UI32 area, RTS_UI32 offset, RTS_UI32 size)
{
    RTS_UNUSED(task);
    RTS_UNUSED(area);
    RTS_UNUSED(offset);
    RTS_UNUSED(size);
    return NULL;
}
#endif

/* ---- breakpoints ---- */

#if BP_MAX > 0
RTS_RESULT AppBpAttach(bool keep)
{
    fakes.bp.attached++;
    fakes.bp.kept = keep;
    return fakes.bp.result;
}

void AppBpDetach(void)
{
    fakes.bp.detached++;
}

void AppBpAlive(void)
{
    fakes.bp.alive++;
}

void AppBpGetStatus(BP_STATUS *status)
{
    *status = fakes.bp.status;
}

RTS_RESULT AppBpSet(const BP_BREAKPOINT *breakpoint)
{
    if (fakes.bp.count == RTS_COUNT(fakes.bp.list))
        return ERR_NOMEMORY;
    fakes.bp.list[fakes.bp.count++] = *breakpoint;
    return fakes.bp.result;
}

RTS_RESULT AppBpClear(RTS_UI32 offset)
{
    fakes.bp.cleared = offset;
    return fakes.bp.result;
}

void AppBpClearAll(void)
{
    fakes.bp.count = 0;
}

bool AppBpGet(RTS_UI32 index, BP_BREAKPOINT *breakpoint)
{
    if (index >= fakes.bp.count)
        return false;
    *breakpoint = fakes.bp.list[index];
    return true;
}

void AppBpClearWatches(void)
{
    fakes.bp.watches = fakes.bp.watch_traps = 0;
}

RTS_RESULT AppBpAddWatch(const APP_PLACE *place)
{
    fakes.bp.watch = *place;
    fakes.bp.watches++;
    return fakes.bp.result;
}

RTS_RESULT AppBpAddWatchTrap(RTS_UI32 offset)
{
    fakes.bp.watch_traps += offset;
    return fakes.bp.result;
}

void AppBpClearTemporary(void)
{
    fakes.bp.temporary_count = 0;
}

RTS_RESULT AppBpAddTemporary(RTS_UI32 offset)
{
    if (fakes.bp.temporary_count == RTS_COUNT(fakes.bp.temporary))
        return ERR_NOMEMORY;
    fakes.bp.temporary[fakes.bp.temporary_count++] = offset;
    return ERR_OK;
}

RTS_RESULT AppBpGo(RTS_UI32 how)
{
    fakes.bp.gone_on++;
    fakes.bp.how = how;
    return fakes.bp.result;
}

RTS_RESULT AppBpPause(void)
{
    fakes.bp.paused++;
    return fakes.bp.result;
}

RTS_UI8 *AppBpGetStack(RTS_UI32 distance, RTS_UI32 size)
{
    RTS_UI32 room = sizeof fakes.bp.stack;

    return size <= room && distance <= room - size ? fakes.bp.stack + distance : NULL;
}
#endif

/* CmpForce.c keeps its list; no task uses it. */
void CyclePhaseAdd(CYCLE_PHASE when, CYCLE_ENTRY *entry)
{
    RTS_UNUSED(when);
    RTS_UNUSED(entry);
}

void CyclePhaseRemove(CYCLE_PHASE when, const CYCLE_ENTRY *entry)
{
    RTS_UNUSED(when);
    RTS_UNUSED(entry);
}

void IecCycleFindPhases(void)
{
}

/* CmpTraceMgr.c keeps its packets; no task uses them. */
RTS_RESULT IecTaskGetEntry(RTS_UI32 task, IEC_ENTRY *entry, IEC_CONTEXT **context)
{
    static IEC_CONTEXT made;

    *entry = NULL;
    *context = &made;
    return task < fakes.task_count ? ERR_OK : ERR_INVALIDID;
}

void IecTaskGetTimes(RTS_UI32 task, RTS_UI32 *cycle_ns, RTS_UI32 *late_ns)
{
    RTS_UNUSED(task);
    *cycle_ns = *late_ns = 0;
}

#if FILE_STORE_FILES > 0
const FILE_ENTRY *FileStoreGet(RTS_UI32 index)
{
    RTS_UNUSED(index);
    return NULL;
}

RTS_RESULT FileStoreRead(const FILE_ENTRY *entry, RTS_UI32 offset, void *data, RTS_UI32 size)
{
    RTS_UNUSED(entry);
    RTS_UNUSED(offset);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    return ERR_NO_CONSISTENCY;
}
#endif

bool IecCycleMayRun(void)
{
    return false;
}

RTS_RESULT EventRegisterCallback(RTS_UI32 provider, RTS_UI32 event, PF_EVENT_CALLBACK callback, void *user)
{
    RTS_UNUSED(provider);
    RTS_UNUSED(event);
    RTS_UNUSED(callback);
    RTS_UNUSED(user);
    return ERR_OK;
}

void AppGetStatus(APP_STATUS *status)
{
    *status = fakes.status;
}

#if EXCEPT_MAX_CALLS > 0
const EXCEPT_TRACE *SysExceptGetTrace(void)
{
    return &fakes.trace;
}
#endif

#if EXCEPT_REGISTERS > 0
const EXCEPT_FRAME *SysExceptGetRegisters(void)
{
    static const EXCEPT_FRAME unknown;
    return &unknown;
}
#endif

const char *AppGetInfo(RTS_UI32 index)
{
    static const char *const texts[] = {"project", "author", "1.2.3", "", "profile"};

    return texts[index];
}

static RTS_RESULT control(void)
{
    fakes.now_ms += fakes.control_ms;
    fakes.reason = fakes.denial;
    return fakes.control_result;
}

#if OPERATION_CONTROL
RTS_UI32 OperationForbidden(void)
{
    return fakes.forbidden;
}

RTS_RESULT OperationMay(RTS_UI32 operation)
{
    return (fakes.forbidden >> operation & 1) != 0 ? ERR_OPERATION_DENIED : ERR_OK;
}
#endif

const char *AppTakeReason(void)
{
    const char *reason = fakes.reason;

    fakes.reason = NULL;
    return reason != NULL ? reason : "";
}

RTS_RESULT AppStartApplication(void)
{
    fakes.starts++;
    return control();
}

RTS_RESULT AppStopApplication(void)
{
    fakes.stops++;
    return control();
}

RTS_RESULT AppReset(RTS_UI32 option)
{
    fakes.resets++;
    fakes.reset_option = option;
    return control();
}

RTS_RESULT AppSingleCycle(void)
{
    fakes.single_cycles++;
    return control();
}

RTS_RESULT AppReload(void)
{
    fakes.reloads++;
    return control();
}

RTS_UI32 IecTaskGetCount(void)
{
    return fakes.task_count;
}

RTS_RESULT IecTaskGetInfo(RTS_UI32 task, IEC_TASK_INFO *info)
{
    *info = fakes.tasks[task];
    return ERR_OK;
}

#if IEC_LATENESS
RTS_RESULT IecCycleGetLateness(RTS_UI32 task, RTS_UI32 number, IEC_LATENESS_COUNT *lateness)
{
    *lateness = (IEC_LATENESS_COUNT){.below_ns = 1000 * (number + 1), .count = number * (task + 1)};
    return number < 3 ? ERR_OK : ERR_INVALIDID;
}
#endif

RTS_UI32 TaskLoadGet(RTS_UI32 task)
{
    return fakes.task_load + task;
}

RTS_UI32 IecTaskGetLoad(void)
{
    return fakes.task_load;
}

RTS_UI32 IecTaskGetActivity(bool *busy)
{
    *busy = fakes.task_busy;
    fakes.task_activity += fakes.activity_per_look;
    return fakes.task_activity;
}

RTS_RESULT AppDownloadBegin(RTS_UI32 total_size, RTS_UI32 image_crc)
{
    fakes.download_open = total_size <= FAKE_IMAGE_SIZE;
    if (!fakes.download_open)
        return ERR_NOMEMORY;
    fakes.download_begins++;
    fakes.download_total = total_size;
    fakes.download_crc = image_crc;
    fakes.download_offset = 0;
    return ERR_OK;
}

RTS_RESULT AppDownloadWrite(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size)
{
    if (offset != fakes.download_offset || size > fakes.download_total - offset)
        return ERR_INVALID_SEQUENCE;
    if (fakes.write_result != ERR_OK) {
        fakes.download_open = false;
        fakes.download_offset = 0;
        return fakes.write_result;
    }
    fakes.download_writes++;
    memcpy(fakes.image + offset, data, size);
    fakes.download_offset += size;
    return ERR_OK;
}

static RTS_RESULT copy_image(RTS_UI32 distance, RTS_UI32 size)
{
    if (distance > fakes.download_offset)
        return ERR_OUT_OF_LIMITS;
    for (; size > 0; size--, fakes.download_offset++)
        fakes.image[fakes.download_offset] = fakes.image[fakes.download_offset - distance];
    return ERR_OK;
}

static RTS_RESULT write_image(const RTS_UI8 *data, RTS_UI32 size)
{
    memcpy(fakes.image + fakes.download_offset, data, size);
    fakes.download_offset += size;
    return ERR_OK;
}

RTS_RESULT AppDownloadUnpack(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 unpacked)
{
    static const UNPACK_SINK sink = {write_image, copy_image};

    if (!fakes.download_open || offset != fakes.download_offset)
        return ERR_INVALID_SEQUENCE;
    if (unpacked > fakes.download_total - offset)
        return ERR_OUT_OF_LIMITS;
    RTS_RESULT result = Unpack(data, size, unpacked, &sink);
    fakes.download_writes++;
    fakes.download_open = result == ERR_OK;
    return result;
}

RTS_UI32 AppDownloadOffset(void)
{
    return fakes.download_offset;
}

bool AppDownloadIsOf(RTS_UI32 total_size, RTS_UI32 image_crc)
{
    return fakes.download_open && fakes.download_total == total_size && fakes.download_crc == image_crc;
}

bool AppDownloadIsOpen(void)
{
    return fakes.download_open;
}

RTS_RESULT AppRefuse(APP_REFUSAL *refusal, RTS_RESULT result, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(refusal->text, sizeof(refusal->text), format, arguments);
    va_end(arguments);
    return result;
}

RTS_RESULT AppDownloadEnd(APP_REFUSAL *refusal)
{
    fakes.download_ends++;
    fakes.download_open = false;
    fakes.download_offset = 0;
    strcpy(refusal->text, fakes.end_result == ERR_OK ? "" : fakes.end_text);
    if (fakes.end_result == ERR_OK) {
        fakes.status.image_size = fakes.download_total;
        fakes.status.state = AS_STOP;
    }
    return fakes.end_result;
}

#if ONLINE_CHANGE
RTS_RESULT AppDownloadChange(APP_REFUSAL *refusal)
{
    return AppDownloadEnd(refusal);
}
#endif

#if BOOT_ON_DEMAND
RTS_RESULT AppDownloadTry(APP_REFUSAL *refusal)
{
    RTS_RESULT result = AppDownloadEnd(refusal);

    fakes.tried = result == ERR_OK;
    return result;
}

bool AppDownloadTriesAll(void)
{
    return false;
}

bool AppDownloadIsTried(void)
{
    return fakes.tried;
}

RTS_RESULT AppCreateBootProject(void)
{
    fakes.tried = false;
    return ERR_OK;
}
#endif

/* ---- password ---- */

#if COMM_PASSWORD
bool AppHasPassword(void)
{
    return BytesGet32(fakes.password.iterations) != 0;
}

const USER_VERIFIER *AppPasswordGet(void)
{
    return &fakes.password;
}

RTS_RESULT AppPasswordSet(const USER_VERIFIER *verifier)
{
    if (fakes.password_result == ERR_OK)
        fakes.password = *verifier;
    return fakes.password_result;
}
#endif

/* ---- start ---- */

const BLK_COUNTERS *const BlkCounters[] = {
    &BlkDrvComCounters,
#if COMM_CAN_TESTED
    &BlkDrvCanCounters,
#endif
#if NETWORK_TESTED
    &BlkDrvTcpCounters,
    &BlkDrvUdpCounters,
#endif
    NULL,
};

void fakes_hook(CMP_HOOK hook)
{
    static const PF_HOOK_FUNCTION hooks[] = {
        CmpSrv_Hook,
#if COMM_PASSWORD
        CmpUserMgr_Hook,
#endif
        CmpDevice_Hook,
        CmpAppSrv_Hook,
        CmpMonitor2_Hook,
#if TRACE_BUFFER > 0
        CmpTraceSrv_Hook,
#endif
#if BP_MAX > 0
        CmpAppBPSrv_Hook,
#endif
        CmpLogSrv_Hook,
        CmpPlcShell_Hook,
        CmpChannelServerEmbedded_Hook,
        CmpNameServiceServer_Hook,
        CmpRouterEmbedded_Hook,
        CmpBlkDrvSimpleCom_Hook,
#if COMM_CAN_TESTED && CAN_SHARED
        CmpCan_Hook,
#endif
#if COMM_CAN_TESTED
        CmpBlkDrvCan_Hook,
#endif
#if NETWORK_TESTED
        CmpBlkDrvTcp_Hook,
        CmpBlkDrvUdp_Hook,
#endif
    };
    const RTS_UI32 count = RTS_COUNT(hooks);

    for (RTS_UI32 i = 0; i < count; i++)
        fakes.hook_errors += hooks[hook >= CH_EXIT_COMM ? count - 1 - i : i](hook) != ERR_OK;
}

void fakes_init(void)
{
    static const SYS_TARGET target = {0x1000, 0x00010002, 0x030E0514, "Device", "Vendor", "Node7", "SN-42"};

    memset(&fakes, 0, sizeof(fakes));
    fakes.target = target;
    fakes.end_text = "This image is for another device.";
    fakes.now_ms = 0xFFFFF000u; /* about to wrap: time compares must cope */
    fakes.random = 12345;
    fakes.line_write_limit = FAKE_LINE_SIZE;
    fakes.status.state = AS_STOP;
    fakes.status.op_state = OS_PROGRAM_LOADED | OS_BOOTPROJECT_VALID;
    fakes.status.image_crc = FAKE_IMAGE_CRC;
    fakes.status.image_size = 3000;
    for (RTS_UI32 i = 0; i < APP_AREA_COUNT; i++)
        fakes.area_size[i] = FAKE_AREA_SIZE;
    SimLinkReset();
}

void fakes_run_init_hooks(void)
{
    for (int hook = CH_INIT_SYSTEM; hook <= CH_INIT_FINISHED; hook++)
        fakes_hook((CMP_HOOK)hook);
}

void fakes_start(void)
{
    fakes_init();
    fakes_run_init_hooks();
}

void fakes_cycle(RTS_UI32 ms)
{
    fakes.now_ms += ms;
    fakes_hook(CH_COMM_CYCLE);
}
