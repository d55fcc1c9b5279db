/*
 * IoMgrDevices.c - the state of each connector: flags, errors, age of its data.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IoMgrDevices.h"

#include <string.h>

#include "CmpLog.h"
#include "IoDevices.h"
#include "IoMgrConfig.h"
#include "IoTables.h"
#include "SysAtomic.h"
#include "SysTime.h"

/* In a state, above CF_*. */
enum {
    HAD_DATA = 0x00010000,  /* good_ms counts */
    BUS_CYCLE = 0x00020000, /* has one of its own */
    BUS_WAITS = 0x00040000, /* was left to who is in the driver */
    ALIVE = 0x00080000,     /* its data is of now */
    TOLD_SHIFT = 20,        /* what the log knows, HEALTH_*: two bits */
    BUS_TASK_SHIFT = 24,    /* to the top */
};

enum { HEALTH_STARTING, HEALTH_GOOD, HEALTH_LOST, HEALTH_MASK };

enum { LOSS_SIZE = 40 }; /* of the explanation in the log, with NUL */

enum { CF_ERRORS = CF_CONNECTOR_BUS_ERROR | CF_CONNECTOR_ERROR };

typedef struct {
    RTS_UI32 flags;
    RTS_UI32 errors;
    RTS_UI32 good_ms; /* when the last good data came */
    IO_DRIVER *driver;
} DEVICE;

static DEVICE devices[IO_MAX_CONNECTORS > 0 ? IO_MAX_CONNECTORS : 1];

/* From any context. */
static void change(RTS_UI32 *flags, RTS_UI32 reset, RTS_UI32 set)
{
    RTS_UI32 before;

    do {
        before = SysAtomicLoad(flags);
    } while (!SysAtomicReplace(flags, before, (before & ~reset) | set));
}

/* NULL when the connector is one of an application that is not there any more. */
static DEVICE *device_of(const IoConfigConnector *connector)
{
    RTS_UI32 index = IoMgrConfigGetIndex(connector);

    return index < IoTablesCountConnectors() ? &devices[index] : NULL;
}

/* ---- what drivers say ---- */

void IoMgrConfigSetDiagnosis(const IoConfigConnector *connector, RTS_UI32 flags)
{
    DEVICE *device = device_of(connector);

    if (device == NULL)
        return;
    if ((flags & CF_ERRORS) != 0) {
        (void)SysAtomicAdd(&device->errors, 1);
        if ((SysAtomicLoad(&device->flags) & ALIVE) != 0)
            SysAtomicStore(&device->good_ms, SysTimeGetMs());
        change(&device->flags, ALIVE, flags);
        return;
    }
    change(&device->flags, 0, flags);
}

void IoMgrConfigResetDiagnosis(const IoConfigConnector *connector, RTS_UI32 flags)
{
    DEVICE *device = device_of(connector);

    if (device != NULL)
        change(&device->flags, flags, 0);
}

void IoMgrConfigNoteData(const IoConfigConnector *connector)
{
    const RTS_UI32 good = HAD_DATA | CF_CONNECTOR_FOUND | CF_CONNECTOR_CONFIGURED | CF_CONNECTOR_ACTIVE;
    DEVICE *device = device_of(connector);

    if (device == NULL)
        return;
    SysAtomicStore(&device->good_ms, SysTimeGetMs());
    if ((SysAtomicLoad(&device->flags) & (good | CF_ERRORS)) != good)
        change(&device->flags, CF_ERRORS, good);
}

void IoMgrConfigNoteAlive(const IoConfigConnector *connector)
{
    DEVICE *device = device_of(connector);

    IoMgrConfigNoteData(connector);
    if (device != NULL)
        change(&device->flags, 0, ALIVE);
}

void IoMgrConfigNoteError(const IoConfigConnector *connector)
{
    DEVICE *device = device_of(connector);

    if (device != NULL)
        (void)SysAtomicAdd(&device->errors, 1);
}

/* ---- what the manager asks ---- */

static RTS_UI32 health_of(RTS_UI32 flags)
{
    if ((flags & CF_ERRORS) != 0)
        return HEALTH_LOST;
    return (flags & CF_CONNECTOR_ACTIVE) != 0 ? HEALTH_GOOD : HEALTH_STARTING;
}

IO_DRIVER *IoDeviceGetDriver(RTS_UI32 index)
{
    return devices[index].driver;
}

IO_DRIVER *IoDeviceGetWell(RTS_UI32 index)
{
    return health_of(SysAtomicLoad(&devices[index].flags)) == HEALTH_GOOD ? devices[index].driver : NULL;
}

RTS_UI32 IoDeviceGetBusTask(RTS_UI32 index)
{
    return SysAtomicLoad(&devices[index].flags) >> BUS_TASK_SHIFT;
}

bool IoDeviceHasBusCycle(RTS_UI32 index)
{
    return (SysAtomicLoad(&devices[index].flags) & BUS_CYCLE) != 0;
}

void IoDeviceLeaveBusCycle(RTS_UI32 index)
{
    change(&devices[index].flags, 0, BUS_WAITS);
}

bool IoDeviceTakeBusCycle(RTS_UI32 index)
{
    bool waits = (SysAtomicLoad(&devices[index].flags) & BUS_WAITS) != 0;

    if (waits)
        change(&devices[index].flags, BUS_WAITS, 0);
    return waits;
}

/* ---- begin ---- */

/* The cyclic task of the shortest interval; without one, the first task. */
static RTS_UI32 find_fastest(const CDL_TASK *tasks, RTS_UI32 count)
{
    RTS_UI32 best = 0xFFFFFFFFu;
    RTS_UI32 fastest = 0;
    RTS_UI32 i;

    for (i = 0; i < count; i++) {
        if (tasks[i].kind == KIND_CYCLIC && tasks[i].interval_us < best) {
            best = tasks[i].interval_us;
            fastest = i;
        }
    }
    return fastest;
}

/* Sets the task in which a connector has its bus cycle. While no task runs. */
static RTS_INLINE void set_bus_cycle(DEVICE *device, const IoConfigConnector *connector, RTS_UI32 fastest)
{
    bool is_root = connector->parent == IO_CONFIG_NONE;
    RTS_UI32 task = is_root ? fastest : IoDeviceGetBusTask(connector->parent);

    if (connector->bus_task != IO_CONFIG_NONE)
        task = connector->bus_task;
    device->flags |= task << BUS_TASK_SHIFT;
    if (is_root || connector->bus_task != IO_CONFIG_NONE)
        device->flags |= BUS_CYCLE;
}

/* `fresh`: with the flags of the configuration; else only the bus cycles are others. */
static void set_flags(const CDL_TASK *tasks, RTS_UI32 task_count, bool fresh)
{
    RTS_UI32 fastest = find_fastest(tasks, task_count);
    RTS_UI32 i;

    for (i = 0; i < IoTablesCountConnectors(); i++) {
        const IoConfigConnector *connector = IoMgrConfigGetConnector(i);
        if (fresh)
            devices[i].flags = connector->flags;
        else
            devices[i].flags &= ~(0xFFu << BUS_TASK_SHIFT | BUS_CYCLE | BUS_WAITS);
        set_bus_cycle(&devices[i], connector, fastest);
    }
}

void IoDevicesReset(const CDL_TASK *tasks, RTS_UI32 task_count)
{
    memset(devices, 0, sizeof devices);
    set_flags(tasks, task_count, true);
}

#if ONLINE_CHANGE
void IoDevicesFollow(const CDL_TASK *tasks, RTS_UI32 task_count)
{
    set_flags(tasks, task_count, false);
}
#endif

void IoDeviceSetDriver(RTS_UI32 index, IO_DRIVER *driver)
{
    devices[index].driver = driver;
    if (driver != NULL)
        change(&devices[index].flags, 0, CF_DRIVER_AVAILABLE);
    else
        change(&devices[index].flags, CF_DRIVER_AVAILABLE | CF_CONNECTOR_ACTIVE, 0);
}

/* ---- what others see ---- */

/* Ages that a clock of 32 bits cannot tell from short ones any more are none. */
static RTS_UI32 age_of(DEVICE *device, RTS_UI32 flags)
{
    RTS_UI32 age;

    if ((flags & ALIVE) != 0)
        return 0;
    if ((flags & HAD_DATA) == 0)
        return 0xFFFFFFFFu;
    age = SysTimeGetMs() - SysAtomicLoad(&device->good_ms);
    if (age < 0xF0000000u)
        return age;
    if (age > 0xFFFFFF00u)
        return 0; /* it came just now */
    change(&device->flags, HAD_DATA, 0);
    return 0xFFFFFFFFu;
}

static void get_state(DEVICE *device, IO_DEVICE_STATE *state)
{
    RTS_UI32 flags = SysAtomicLoad(&device->flags);

    state->age_ms = age_of(device, flags);
    state->errors = SysAtomicLoad(&device->errors);
    state->flags = flags & 0xFFFF;
    state->ok = health_of(flags) == HEALTH_GOOD;
}

RTS_RESULT IoMgrGetState(RTS_UI32 connector, IO_DEVICE_STATE *state)
{
    if (connector >= IoTablesCountConnectors())
        return ERR_INVALIDID;
    memset(state, 0, sizeof *state);
    get_state(&devices[connector], state);
    return ERR_OK;
}

void IoDevicesUpdate(RTS_UI32 task)
{
    RTS_UI32 i;

    for (i = 0; i < IoTablesCountConnectors(); i++) {
        RTS_UI32 offset = IoMgrConfigGetConnector(i)->state;
        if (offset == IO_CONFIG_NOWHERE || (task != IO_ALL_TASKS && task != IoDeviceGetBusTask(i)))
            continue;
        get_state(&devices[i], IoTablesGetState(offset));
    }
}

static void log_loss(RTS_UI32 index)
{
    const IoConfigConnector *connector = IoMgrConfigGetConnector(index);
    const ICmpIoDrv *functions = devices[index].driver->functions;
    char why[LOSS_SIZE] = "it does not answer";

    if (functions->IoDrvExplainLoss != NULL)
        functions->IoDrvExplainLoss(connector, why, sizeof why);
    LogAdd(CMPID_CmpIoMgrEmbedded, LOG_WARNING, ERR_OK, "%s is lost: %s", IoMgrConfigGetName(connector), why);
}

void IoDevicesLog(void)
{
    static const char *const words[] = {"stopped", "is back", "has an error"}; /* by HEALTH_* */
    RTS_UI32 i;

    for (i = 0; i < IoTablesCountConnectors(); i++) {
        RTS_UI32 flags = SysAtomicLoad(&devices[i].flags);
        RTS_UI32 told = flags >> TOLD_SHIFT & HEALTH_MASK;
        RTS_UI32 health = health_of(flags);
        if (health == told || devices[i].driver == NULL)
            continue;
        change(&devices[i].flags, (RTS_UI32)HEALTH_MASK << TOLD_SHIFT, health << TOLD_SHIFT);
        if (told == HEALTH_STARTING && health == HEALTH_GOOD)
            continue;
        if ((flags & CF_CONNECTOR_BUS_ERROR) != 0)
            log_loss(i);
        else
            LogAdd(CMPID_CmpIoMgrEmbedded, health == HEALTH_LOST ? LOG_WARNING : LOG_INFO, ERR_OK, "%s %s",
                   IoMgrConfigGetName(IoMgrConfigGetConnector(i)), words[health]);
    }
}
