/*
 * IoCycle.c - what the I/O manager does with drivers in each cycle, in the safe state, and in main.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A driver is in one of its functions at a time, and no caller waits for it. One that finds it busy leaves a note in
 * IO_DRIVER.pending; who is in it looks for notes before it goes, and does what they say. So outputs of a task that runs
 * once are never forgotten.
 */
#include "IoCycle.h"

#include <string.h>

#include "AppState.h"
#include "CmpItf.h"
#include "CyclePhases.h"
#include "IoDevices.h"
#include "IoMgrConfig.h"
#include "IoTables.h"
#include "SchedEvents.h"
#include "SysAtomic.h"
#include "SysLock.h"
#include "rts_config.h"

/* Notes: a bit for each task whose outputs wait, and these. */
#define PENDING_SAFE_STATE 0x80000000u
#define PENDING_BUS_CYCLE 0x40000000u
RTS_STATIC_ASSERT(APP_MAX_TASKS < 30, tasks_have_a_bit_each);

/* What a task uses, by IO_MAP_*; found out when the configuration is loaded. None at first. */
typedef struct {
    const IoConfigConnectorMap *first[2];
    RTS_UI16 count[2];
} WORK;

static struct {
    IO_DRIVER *drivers; /* all there are, while there is a configuration */
    bool is_loaded;
    bool has_phases;
    RTS_UI32 bus_tasks; /* a bit for each task that is that of a device with something to do in it */
    WORK work[APP_MAX_TASKS];
} state;

/* ---- one driver, one caller ---- */

/* Inlined, as what is done at both ends of each call of a driver. On one core who interrupts between the load and the
 * store has left the driver when the store comes. */
static RTS_INLINE bool take_driver(IO_DRIVER *driver)
{
    if (!RTS_ONE_CORE)
        return SysAtomicReplace(&driver->busy, 0, 1);
    if (SysAtomicLoad(&driver->busy) != 0)
        return false;
    SysAtomicStore(&driver->busy, 1);
    return true;
}

static RTS_INLINE bool enter_driver(IO_DRIVER *driver)
{
    if (take_driver(driver))
        return true;
    (void)SysAtomicAdd(&driver->skipped, 1);
    return false;
}

static void note(IO_DRIVER *driver, RTS_UI32 what)
{
    RTS_UI32 before;

    do {
        before = SysAtomicLoad(&driver->pending);
    } while (!SysAtomicReplace(&driver->pending, before, before | what));
}

static RTS_UI32 take_notes(IO_DRIVER *driver)
{
    RTS_UI32 notes;

    do {
        notes = SysAtomicLoad(&driver->pending);
    } while (!SysAtomicReplace(&driver->pending, notes, 0));
    return notes;
}

/* Not just a load on several cores: of it and note() one is first, so either a note is seen here, or its writer sees that
 * the driver is free. */
static RTS_INLINE bool has_notes(IO_DRIVER *driver)
{
    return (RTS_ONE_CORE ? SysAtomicLoad(&driver->pending) : SysAtomicAdd(&driver->pending, 0)) != 0;
}

static void do_notes(IO_DRIVER *driver, RTS_UI32 notes);

static void follow_notes(IO_DRIVER *driver)
{
    while (has_notes(driver) && take_driver(driver)) {
        do_notes(driver, take_notes(driver));
        SysAtomicStore(&driver->busy, 0);
    }
}

static RTS_INLINE void leave_driver(IO_DRIVER *driver)
{
    SysAtomicStore(&driver->busy, 0);
    if (has_notes(driver))
        follow_notes(driver);
}

/* Not inlined: rare. */
static RTS_NOINLINE void leave_note(IO_DRIVER *driver, RTS_UI32 what)
{
    (void)SysAtomicAdd(&driver->skipped, 1);
    note(driver, what);
    follow_notes(driver); /* it may just have been left */
}

/* Enters, or leaves a note for who is in; false then. */
static RTS_INLINE bool enter_or_note(IO_DRIVER *driver, RTS_UI32 what)
{
    if (take_driver(driver))
        return true;
    leave_note(driver, what);
    return false;
}

/* ---- maps ---- */

typedef IO_DRIVER *(*PF_DRIVER_OF)(RTS_UI32 connector);

/* The end of those connectors from `map` on that go to one driver, or to none. Mostly there is one. */
static RTS_INLINE const IoConfigConnectorMap *end_of_run(const IoConfigConnectorMap *map,
                                                         const IoConfigConnectorMap *end, PF_DRIVER_OF driver_of,
                                                         const IO_DRIVER *driver)
{
    while (++map < end && driver_of(map->connector) == driver) {
    }
    return map;
}

/* ---- inputs ---- */

/* Of devices without good data: what the configuration says. */
static void substitute(const IoConfigConnectorMap *map, const IoConfigConnectorMap *end)
{
    RTS_UI32 lock = SysLockEnter();

    for (; map < end; map++) {
        const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(map);
        RTS_UI32 count = map->channel_map_count;
        for (; count > 0; count--, channel++) {
            RTS_UI32 what = channel->flags & IO_CHANNEL_ON_STOP;
            if (what != IO_HOLD)
                IoTablesSetInput(channel, what == IO_VALUE ? channel->value : 0);
        }
    }
    SysLockLeave(lock);
}

static void read_inputs(const WORK *work)
{
    const IoConfigConnectorMap *map = work->first[IO_MAP_INPUTS];
    const IoConfigConnectorMap *end = map + work->count[IO_MAP_INPUTS];
    const IoConfigConnectorMap *next;

    for (; map < end; map = next) {
        IO_DRIVER *driver = IoDeviceGetWell(map->connector);
        next = end_of_run(map, end, IoDeviceGetWell, driver);
        if (driver == NULL) {
            substitute(map, next);
        } else {
            RTS_RESULT (*read)(const IoConfigConnectorMap *maps, int count) = driver->functions->IoDrvReadInputs;
            if (read != NULL && enter_driver(driver)) {
                (void)read(map, (int)(next - map));
                leave_driver(driver);
            }
        }
    }
}

/* ---- outputs ---- */

typedef void (*PF_WRITE)(IO_DRIVER *driver, const IoConfigConnectorMap *map, int count);

static void write_all(IO_DRIVER *driver, const IoConfigConnectorMap *map, int count)
{
    (void)driver->functions->IoDrvWriteOutputs(map, count);
}

/* What does not hold its value, channel by channel where some do. */
static void write_safe(IO_DRIVER *driver, const IoConfigConnectorMap *map, int count)
{
    for (; count > 0; count--, map++) {
        const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(map);
        IoConfigConnectorMap part = *map;
        RTS_UI32 i;

        part.channel_map_count = 0;
        for (i = 0; i < map->channel_map_count; i++, channel++) {
            bool is_held = (channel->flags & IO_CHANNEL_ON_STOP) == IO_HOLD;
            if (!is_held)
                part.channel_map_count++;
            if (part.channel_map_count > 0 && (is_held || i + 1u == map->channel_map_count)) {
                (void)driver->functions->IoDrvWriteOutputs(&part, 1);
                part.channel_map_count = 0;
            }
            if (part.channel_map_count == 0)
                part.first_channel_map = (RTS_UI16)(map->first_channel_map + i + 1);
        }
    }
}

/* Of one task, what goes to a driver that we are in. */
static void write_to(IO_DRIVER *driver, const WORK *work, PF_WRITE write)
{
    const IoConfigConnectorMap *map = work->first[IO_MAP_OUTPUTS];
    const IoConfigConnectorMap *end = map + work->count[IO_MAP_OUTPUTS];
    const IoConfigConnectorMap *next;

    for (; map < end; map = next) {
        IO_DRIVER *other = IoDeviceGetDriver(map->connector);
        next = end_of_run(map, end, IoDeviceGetDriver, other);
        if (other == driver)
            write(driver, map, (int)(next - map));
    }
}

static void write_outputs(RTS_UI32 task, const WORK *work)
{
    const IoConfigConnectorMap *map = work->first[IO_MAP_OUTPUTS];
    const IoConfigConnectorMap *end = map + work->count[IO_MAP_OUTPUTS];
    const IoConfigConnectorMap *next;

    for (; map < end; map = next) {
        IO_DRIVER *driver = IoDeviceGetDriver(map->connector);
        next = end_of_run(map, end, IoDeviceGetDriver, driver);
        if (driver == NULL || driver->functions->IoDrvWriteOutputs == NULL || !enter_or_note(driver, 1u << task))
            continue;
        (void)driver->functions->IoDrvWriteOutputs(map, (int)(next - map));
        leave_driver(driver);
    }
}

/* ---- bus cycles ---- */

static void run_bus_cycle(IO_DRIVER *driver, RTS_UI32 index)
{
    const IoConfigConnector *connector = IoMgrConfigGetConnector(index);

    (void)driver->functions->IoDrvStartBusCycle(connector);
    if (driver->functions->IoDrvWatchdogTrigger != NULL && AppGetState() == AS_RUN)
        (void)driver->functions->IoDrvWatchdogTrigger(connector);
}

/* Of the connectors that have their bus cycle in this task, or of all. */
static void start_bus_cycles(RTS_UI32 task)
{
    RTS_UI32 i;

    for (i = 0; i < IoTablesCountConnectors(); i++) {
        IO_DRIVER *driver = IoDeviceGetDriver(i);
        if (driver == NULL || driver->functions->IoDrvStartBusCycle == NULL || !IoDeviceHasBusCycle(i) ||
            (task != IO_ALL_TASKS && task != IoDeviceGetBusTask(i)))
            continue;
        IoDeviceLeaveBusCycle(i);
        if (enter_or_note(driver, PENDING_BUS_CYCLE)) {
            if (IoDeviceTakeBusCycle(i))
                run_bus_cycle(driver, i);
            leave_driver(driver);
        }
    }
}

/* ---- notes ---- */

static void run_left_bus_cycles(IO_DRIVER *driver)
{
    RTS_UI32 i;

    for (i = 0; i < IoTablesCountConnectors(); i++) {
        if (IoDeviceGetDriver(i) == driver && IoDeviceTakeBusCycle(i))
            run_bus_cycle(driver, i);
    }
}

/* We are in the driver. Outputs that became safe are not written as a task left them any more. */
static void do_notes(IO_DRIVER *driver, RTS_UI32 notes)
{
    bool is_safe = (notes & PENDING_SAFE_STATE) != 0;
    RTS_UI32 task;

    for (task = 0; task < APP_MAX_TASKS; task++) {
        if (is_safe || (notes >> task & 1) != 0)
            write_to(driver, &state.work[task], is_safe ? write_safe : write_all);
    }
    if ((notes & PENDING_BUS_CYCLE) != 0)
        run_left_bus_cycles(driver);
}

/* ---- the phases of a cycle ---- */

static RTS_INLINE bool is_bus_task(RTS_UI32 task)
{
    return (state.bus_tasks >> task & 1) != 0;
}

static void take_inputs(RTS_UI32 task, const IEC_CONTEXT *context)
{
    const WORK *work = &state.work[task];

    RTS_UNUSED(context);
    if (work->count[IO_MAP_INPUTS] != 0) {
        read_inputs(work);
        SchedNoteEvents();
    }
    if (is_bus_task(task))
        IoDevicesUpdate(task);
}

static void give_outputs(RTS_UI32 task, const IEC_CONTEXT *context)
{
    const WORK *work = &state.work[task];

    RTS_UNUSED(context);
    write_outputs(task, work);
    if (is_bus_task(task))
        start_bus_cycles(task);
}

/* ---- the safe state ---- */

typedef void (*PF_CHANNEL)(const IoConfigChannelMap *channel, void *arg);

static void for_each_output(PF_CHANNEL visit, void *arg)
{
    RTS_UI32 m;

    for (m = 0; m < IoTablesCountTaskMaps(); m++) {
        const IoConfigTaskMap *task_map = IoTablesGetTaskMaps() + m;
        const IoConfigConnectorMap *map = IoMgrConfigGetConnectorMaps(task_map);
        RTS_UI32 maps = task_map->type == IO_MAP_OUTPUTS ? task_map->connector_map_count : 0;
        for (; maps > 0; maps--, map++) {
            const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(map);
            RTS_UI32 channels = map->channel_map_count;
            for (; channels > 0; channels--)
                visit(channel++, arg);
        }
    }
}

typedef struct {
    RTS_UI32 first; /* byte */
    RTS_UI32 size;
    RTS_UI8 *mask;
} KEPT;

static void note_kept(const IoConfigChannelMap *channel, void *arg)
{
    const KEPT *kept = arg;
    RTS_UI32 bit = channel->area_bit;
    RTS_UI32 end = bit + channel->bits;

    if (end <= 8 * kept->first || bit >= 8 * (kept->first + kept->size))
        return;
    for (; bit < end; bit++) {
        RTS_UI32 byte = (bit >> 3) - kept->first;
        if (byte < kept->size)
            kept->mask[byte] |= (RTS_UI8)(1u << (bit & 7));
    }
}

void IoCycleGetKept(RTS_UI32 first, RTS_UI8 *mask, RTS_UI32 size)
{
    KEPT kept = {first, size, mask};

    if (state.is_loaded)
        for_each_output(note_kept, &kept);
}

/* No cycle may start: so what drivers copy (IoMgrCopyOutputLE) is safe. */
static void make_safe(void)
{
    IO_DRIVER *driver;

    for (driver = state.drivers; driver != NULL; driver = driver->next) {
        if (driver->functions->IoDrvWriteOutputs == NULL || !enter_or_note(driver, PENDING_SAFE_STATE))
            continue;
        do_notes(driver, PENDING_SAFE_STATE);
        leave_driver(driver);
    }
}

static void enter_safe_state(RTS_UI32 task, const IEC_CONTEXT *context)
{
    RTS_UNUSED(task);
    RTS_UNUSED(context);
    if (state.is_loaded)
        make_safe();
}

/* ---- begin and end ---- */

/* Something to do in its bus task: a variable of the program to bring up to date, or a bus cycle. */
static bool has_bus_work(RTS_UI32 connector)
{
    const IO_DRIVER *driver = IoDeviceGetDriver(connector);

    return IoMgrConfigGetConnector(connector)->state != IO_CONFIG_NOWHERE ||
           (driver != NULL && driver->functions->IoDrvStartBusCycle != NULL && IoDeviceHasBusCycle(connector));
}

static void find_work(void)
{
    RTS_UI32 i;

    memset(state.work, 0, sizeof state.work);
    state.bus_tasks = 0;
    for (i = 0; i < IoTablesCountTaskMaps(); i++) {
        const IoConfigTaskMap *map = IoTablesGetTaskMaps() + i;
        WORK *work = &state.work[map->task];
        work->first[map->type] = IoMgrConfigGetConnectorMaps(map);
        work->count[map->type] = map->connector_map_count;
    }
    for (i = 0; i < IoTablesCountConnectors(); i++) {
        if (has_bus_work(i))
            state.bus_tasks |= 1u << IoDeviceGetBusTask(i);
    }
}

static RTS_RESULT register_phases(void)
{
    RTS_RESULT result = state.has_phases ? (RTS_RESULT)ERR_OK : CyclePhaseRegister(CYCLE_INPUTS, take_inputs);

    if (!state.has_phases && result == ERR_OK)
        result = CyclePhaseRegister(CYCLE_OUTPUTS, give_outputs);
    if (!state.has_phases && result == ERR_OK)
        result = CyclePhaseRegister(CYCLE_SAFE_STATE, enter_safe_state);
    state.has_phases = result == ERR_OK;
    return result;
}

RTS_RESULT IoCycleLoad(IO_DRIVER *drivers)
{
    RTS_RESULT result = register_phases();

    if (result != ERR_OK)
        return result;
    find_work();
    state.drivers = drivers;
    state.is_loaded = true;
    make_safe();
    return ERR_OK;
}

#if ONLINE_CHANGE
void IoCycleFollow(void)
{
    find_work();
}
#endif

void IoCycleUnload(void)
{
    IO_DRIVER *driver;

    for (driver = state.drivers; driver != NULL; driver = driver->next)
        driver->pending = 0;
    state.drivers = NULL;
    state.is_loaded = false;
    memset(state.work, 0, sizeof state.work);
    state.bus_tasks = 0;
}

void IoCycleForget(void)
{
    CMP_CLEAR(state);
}

/* ---- main ---- */

void IoCycleKeepUp(void)
{
    RTS_UI32 task;

    for (task = 0; task < APP_MAX_TASKS; task++)
        read_inputs(&state.work[task]);
    start_bus_cycles(IO_ALL_TASKS);
    IoDevicesUpdate(IO_ALL_TASKS);
}

void IoCycleDiagnose(void)
{
    RTS_UI32 i;

    for (i = 0; i < IoTablesCountConnectors(); i++) {
        IO_DRIVER *driver = IoDeviceGetDriver(i);
        if (driver == NULL || driver->functions->IoDrvGetModuleDiagnosis == NULL || !enter_driver(driver))
            continue;
        (void)driver->functions->IoDrvGetModuleDiagnosis(IoMgrConfigGetConnector(i));
        leave_driver(driver);
    }
}
