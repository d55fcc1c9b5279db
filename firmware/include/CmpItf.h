/*
 * CmpItf.h - component manager (CmpMgr): the life of the runtime (component numbers and names: shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A component is one hook function in the static list of the port (cmp_list.c). The manager calls it with CH_INIT_* in
 * order of the list, CH_EXIT_* in reverse, CH_COMM_CYCLE in the main loop. Manual 3.1, 3.2. All in the context of main.
 */
#ifndef CMPITF_H
#define CMPITF_H

#include "CmpErrors.h"
#include "CmpStd.h"
#ifndef RTS_CFFI
#include "rts_config.h"
#endif

/* Hooks in the order of start-up; manual 3.1.1. Each CH_EXIT_x undoes CH_INIT_x; they are in reverse order. */
typedef enum {
    CH_INIT_SYSTEM,       /* system components (log, memory, time): reset all own state */
    CH_INIT_SYSTEM2,      /* what needs other system components */
    CH_INIT,              /* all other components: reset all own state, call no other */
    CH_INIT2,             /* all others are initialised; create events */
    CH_INIT3,             /* register for events, services, external functions; open the lines of the communication */
    CH_INIT_SYSTEM_TASKS, /* timers and tasks the application needs */
    CH_INIT_TASKS,        /* boot project, IEC tasks */
    CH_INIT_COMM,         /* begin to serve others: for a port, block drivers do in CH_INIT3 */
    CH_INIT_FINISHED,
    CH_COMM_CYCLE, /* main loop: never blocks */
    CH_EXIT_COMM,
    CH_EXIT_TASKS,
    CH_EXIT_SYSTEM_TASKS,
    CH_EXIT3,
    CH_EXIT2,
    CH_EXIT,
    CH_EXIT_SYSTEM2,
    CH_EXIT_SYSTEM,
} CMP_HOOK;

/* A component's hook function. An error from a CH_INIT_* hook stops the start-up; others are ignored. */
typedef RTS_RESULT (*PF_HOOK_FUNCTION)(CMP_HOOK hook);

/* Clears the variable a component keeps its state in, in the first hook it has. For a source that includes rts_config.h
 * and string.h. */
#define CMP_CLEAR(state)                        \
    do {                                        \
        if (!RTS_STARTS_ONCE)                   \
            memset(&(state), 0, sizeof(state)); \
    } while (0)

/* Component numbers, in log entries; the field's numbers where known. */
enum {
    CMPID_CmpMgr = 0x0001,
    CMPID_CmpAppEmbedded = 0x0002,
    CMPID_CmpIecTask = 0x0003,
    CMPID_CmpScheduleTimer = 0x0004,
    CMPID_CmpRetain = 0x0005,
    CMPID_CmpMonitor2 = 0x0006,
    CMPID_CmpLog = 0x0007,
    CMPID_CmpDevice = 0x0008,
    CMPID_CmpChannelServerEmbedded = 0x0009,
    CMPID_CmpRouterEmbedded = 0x000A,
    CMPID_CmpBlkDrvSimpleCom = 0x000B,
    CMPID_SysFileFlash = 0x000C,
    CMPID_SysFlash = 0x000D,
    CMPID_CmpMath = 0x000E,
    CMPID_SysTimer = 0x000F,
    CMPID_SysCom = 0x0010,
    CMPID_SysTime = 0x0011,
    CMPID_SysTarget = 0x0012,
    CMPID_SysWatchdog = 0x0013,
    CMPID_CmpEventMgrEmbedded = 0x0014,
    CMPID_CmpSrv = 0x0015,
    CMPID_CmpAppSrv = 0x0016,
    CMPID_CmpLogSrv = 0x0017,
    CMPID_CmpNameServiceServer = 0x0018,
    CMPID_SysSim = 0x0019,
    CMPID_SysLock = 0x001A,
    CMPID_SysEvent = 0x001C,
    CMPID_CmpBlkDrvTcp = 0x001D,
    CMPID_CmpBlkDrvUdp = 0x001E,
    CMPID_CmpBlkDrvCan = 0x001F,
    CMPID_SysCan = 0x0020,
    CMPID_CmpPlcShell = 0x0021,
    CMPID_CmpIoMgrEmbedded = 0x0022,
    CMPID_CmpIoMgrSrv = 0x0023,
    CMPID_IoDrvSim = 0x0024,
    CMPID_IoDrvGpio = 0x0025,
    CMPID_IoDrvModbus = 0x0026,
    CMPID_CmpUserMgr = 0x0027,
    CMPID_RunLamp = 0x0028,
    CMPID_IoDrvSysfs = 0x0029,
    CMPID_CmpFileTransfer = 0x002A,
    CMPID_SimBuses = 0x002B,
    CMPID_CmpForce = 0x002C,
    CMPID_CmpTraceMgr = 0x0030,
    CMPID_CmpTraceSrv = 0x0031,
    CMPID_CmpAppBP = 0x0032,
    CMPID_CmpAppBPSrv = 0x0033,
    CMPID_CmpOperationControl = 0x0034,
    CMPID_SysMdns = 0x0038,
    CMPID_IecLog = 0x0040,
    CMPID_IecEvents = 0x00A0,
    CMPID_CmpSettings = 0x0090,
    CMPID_CmpAppCalls = 0x0070,
    CMPID_IecFile = 0x0071,
    CMPID_CmpCan = 0x0050,
    CMPID_IecCan = 0x0051,
    CMPID_SimCanBus = 0x0052,
    CMPID_IoDrvCanopen = 0x0053,
    CMPID_IoDrvCanopenDevice = 0x00B8,
    CMPID_IecClock = 0x0072,
    CMPID_IecTaskCalls = 0x00A1,
    CMPID_CmpLogKeep = 0x00AC,
    CMPID_IecSocket = 0x0073,
    CMPID_IecCom = 0x0074,
    CMPID_CmpTaskLoad = 0x00C8,
    CMPID_CmpCanopenProgram = 0x07E0,
    CMPID_IecTaskHandler = 0x00C9,
    CMPID_CmpIoKeep = 0x0068,
};

/* Name of a component, "" when unknown. */
const char *CMGetComponentName(RTS_UI32 id);

#ifndef RTS_CFFI
/* Notes the version of a component that differs from that of the runtime, a byte each of a.b.c.d, in CH_INIT_SYSTEM or
 * later. There is room for CM_VERSIONS components; those beyond it are listed with the version of the runtime. */
#if CM_VERSIONS > 0
void CMNoteVersion(RTS_UI32 id, RTS_UI32 version);
RTS_UI32 CMGetVersion(RTS_UI32 id); /* 0 if none was noted */
#else
static inline void CMNoteVersion(RTS_UI32 id, RTS_UI32 version)
{
    RTS_UNUSED(id);
    RTS_UNUSED(version);
}
#endif

typedef struct {
    RTS_UI32 id; /* CMPID_* */
    const char *name;
} CMP_NAME;

/* The port's list, in the order of CmpOrder.h. Names are apart from the hooks: unused ones take no flash. */
extern const PF_HOOK_FUNCTION cmp_hooks[];
extern const CMP_NAME cmp_names[];
extern const RTS_SIZE cmp_component_count;

/* Runs all CH_INIT_* hooks. On an error the ones that ran are undone by their CH_EXIT_* and the error is returned. With
 * CM_LEAVES_OUT not of a component that only programs need: that one is undone, and its hooks are not called any more. */
RTS_RESULT CMInit(void);

/* The first component that failed to start, in the last CMInit. */
typedef struct {
    const char *name; /* NULL: none */
    RTS_UI32 id;      /* CMPID_* */
    RTS_RESULT error;
} CMP_FAILURE;

#if CM_LEAVES_OUT
/* The components in [cmp_programs_first, cmp_programs_end) of the list are only there for programs. */
extern const RTS_SIZE cmp_programs_first, cmp_programs_end;
extern bool cmp_left_out[];

const CMP_FAILURE *CMGetFailure(void);

/* True if a component was left out, so that no program may run. */
bool CMHasLeftOut(void);

/* Returns ERR_NOMEMORY, for a table of registrations that is full; `setting` is the macro that makes it larger, which the
 * log names if the component fails. */
RTS_RESULT CMNoRoomIn(const char *setting);
#define CMNoRoom(setting) CMNoRoomIn(": raise " #setting)
#else
static inline bool CMHasLeftOut(void)
{
    return false;
}

#define CMNoRoom(setting) ERR_NOMEMORY
#endif

/* Runs all CH_EXIT_* hooks in reverse order. */
RTS_RESULT CMExit(void);

/* Calls one hook of every component; CH_COMM_CYCLE is what a main loop calls. Returns the first error. */
RTS_RESULT CMCallHook(CMP_HOOK hook);

/* ---- external functions: C functions offered to IEC code ---- */

typedef struct {
    const char *name;   /* lower case */
    RTS_UI32 signature; /* CRC-32 of the interface text, as plctool export-itf writes it; 0: parameters of any kind */
    RTS_UI32 version;   /* library version, major << 16 | minor */
    RTS_PFN function;
} CMP_EXT_FUNCTION;

typedef struct {
    const CMP_EXT_FUNCTION *functions;
    RTS_SIZE count;
} CMP_EXT_TABLE;

/* Registered tables. CmpList.h makes the room from the list of components. */
extern CMP_EXT_TABLE cmp_ext_tables[];
extern const RTS_SIZE cmp_ext_table_room;

/* Registers a static table of functions; called in CH_INIT3. Each component of a port's list has room for one table;
 * ERR_NOMEMORY when that and CM_OWN_EXT_TABLES are used up. */
RTS_RESULT CMRegisterExternal(const CMP_EXT_FUNCTION *table, RTS_SIZE count);

/* Finds a function by name; NULL when there is none. Signature and version are compared by the caller. */
const CMP_EXT_FUNCTION *CMFindExternal(const char *name);
#endif

#endif
