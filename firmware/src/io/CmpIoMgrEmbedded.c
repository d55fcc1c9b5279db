/*
 * CmpIoMgrEmbedded.c - the I/O manager: calls the drivers when an application is loaded, in each cycle, in the safe state.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A driver is in one of its functions at a time, and nobody waits for it. Who finds it busy leaves a note in
 * IO_DRIVER.pending; who is in it looks for notes before it goes, and does what they say. So outputs of a task that runs
 * once are never forgotten.
 */
#include "CmpIoMgrEmbedded.h"

#include <string.h>

#include "AppIo.h"
#include "AppState.h"
#include "CMUtils.h"
#include "CmpEventMgr.h"
#include "CmpLog.h"
#include "CyclePhases.h"
#include "IoDevices.h"
#include "IoTables.h"
#include "SchedEvents.h"
#include "SysAtomic.h"
#include "SysLock.h"
#include "SysTime.h"

/* Notes: a bit for each task whose outputs wait, and these. */
#define PENDING_SAFE_STATE 0x80000000u
#define PENDING_BUS_CYCLE 0x40000000u
RTS_STATIC_ASSERT(APP_MAX_TASKS < 30, tasks_have_a_bit_each);

enum { DIAGNOSIS_MS = 100, NO_MAP = 0xFF };

static struct {
    IO_DRIVER *drivers;
    APP_REFUSAL *refusal; /* while an application is loaded by the drivers */
    RTS_RESULT refused;
    bool is_loaded;
    bool has_phases;
    RTS_UI8 map_of[APP_MAX_TASKS][2]; /* which task map, by IO_MAP_*; NO_MAP */
    RTS_UI32 last_ms;                 /* when main last looked after inputs and devices */
    RTS_UI32 diagnosis_ms;
} manager;

RTS_STATIC_ASSERT(2 * APP_MAX_TASKS < NO_MAP, task_maps_can_be_indexed);

static void post(RTS_UI32 event)
{
    if (EVENT_MAX_CALLBACKS > 0)
        EventPost(CMPID_CmpIoMgrEmbedded, event, NULL);
}

/* ---- drivers ---- */

static IO_DRIVER *find_driver(const char *name)
{
    IO_DRIVER *driver = manager.drivers;

    while (driver != NULL && strcmp(driver->functions->IoDrvGetInfo()->szDriverName, name) != 0)
        driver = driver->next;
    return driver;
}

/* The one that a configuration means; on the simulator the one that takes all. */
static IO_DRIVER *find_driver_for(const char *name)
{
    IO_DRIVER *driver = find_driver(name);

    return driver == NULL && IO_SIM_TAKES_ALL ? find_driver("IoDrvSim") : driver;
}

RTS_RESULT IoMgrRegisterInstance(IO_DRIVER *driver)
{
    if (find_driver(driver->functions->IoDrvGetInfo()->szDriverName) != NULL)
        return ERR_DUPLICATE;
    driver->busy = 0;
    driver->pending = 0;
    driver->skipped = 0;
    driver->next = manager.drivers;
    manager.drivers = driver;
    return ERR_OK;
}

RTS_RESULT IoMgrUnregisterInstance(IO_DRIVER *driver)
{
    IO_DRIVER **place = &manager.drivers;

    while (*place != NULL && *place != driver)
        place = &(*place)->next;
    if (*place == NULL)
        return ERR_NO_OBJECT;
    *place = driver->next;
    return ERR_OK;
}

bool IoMgrConfigIsMine(const IoConfigConnector *connector, const IO_DRIVER *driver)
{
    return IoDeviceGetDriver(IoMgrConfigGetIndex(connector)) == driver;
}

/* ---- one driver, one caller ---- */

static bool enter_driver(IO_DRIVER *driver)
{
    if (SysAtomicReplace(&driver->busy, 0, 1))
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

/* Not just a load: of it and note() one is first, so either a note is seen here, or who left it sees that nobody is in. */
static bool has_notes(IO_DRIVER *driver)
{
    return SysAtomicAdd(&driver->pending, 0) != 0;
}

static void do_notes(IO_DRIVER *driver, RTS_UI32 notes);

static void leave_driver(IO_DRIVER *driver)
{
    SysAtomicStore(&driver->busy, 0);
    while (has_notes(driver) && SysAtomicReplace(&driver->busy, 0, 1)) {
        do_notes(driver, take_notes(driver));
        SysAtomicStore(&driver->busy, 0);
    }
}

/* Enters, or leaves a note for who is in; false then. */
static bool enter_or_note(IO_DRIVER *driver, RTS_UI32 what)
{
    if (enter_driver(driver))
        return true;
    note(driver, what);
    if (SysAtomicReplace(&driver->busy, 0, 1)) /* it has just been left */
        leave_driver(driver);
    return false;
}

/* ---- maps ---- */

static const IoConfigTaskMap *get_map(RTS_UI32 task, RTS_UI32 type)
{
    RTS_UI32 index = manager.is_loaded ? manager.map_of[task][type] : NO_MAP;

    return index != NO_MAP ? IoTablesGetTaskMaps() + index : NULL;
}

typedef IO_DRIVER *(*PF_DRIVER_OF)(RTS_UI32 connector);

/* The connectors of a map from `map` on that go to one driver, or to none. */
static const IoConfigConnectorMap *end_of_run(const IoConfigConnectorMap *map, const IoConfigConnectorMap *end,
                                              PF_DRIVER_OF driver_of)
{
    IO_DRIVER *driver = driver_of(map->connector);

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
                IoTablesSetChannel(IO_MAP_INPUTS, channel, what == IO_VALUE ? channel->value : 0);
        }
    }
    SysLockLeave(lock);
}

static void read_inputs(const IoConfigTaskMap *task_map)
{
    const IoConfigConnectorMap *map = IoMgrConfigGetConnectorMaps(task_map);
    const IoConfigConnectorMap *end = map + task_map->connector_map_count;
    const IoConfigConnectorMap *next;

    for (; map < end; map = next) {
        IO_DRIVER *driver = IoDeviceGetWell(map->connector);
        next = end_of_run(map, end, IoDeviceGetWell);
        if (driver == NULL) {
            substitute(map, next);
        } else if (driver->functions->IoDrvReadInputs != NULL && enter_driver(driver)) {
            (void)driver->functions->IoDrvReadInputs(map, (int)(next - map));
            leave_driver(driver);
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
static void write_to(IO_DRIVER *driver, const IoConfigTaskMap *task_map, PF_WRITE write)
{
    const IoConfigConnectorMap *map = IoMgrConfigGetConnectorMaps(task_map);
    const IoConfigConnectorMap *end = map + task_map->connector_map_count;
    const IoConfigConnectorMap *next;

    for (; map < end; map = next) {
        next = end_of_run(map, end, IoDeviceGetDriver);
        if (IoDeviceGetDriver(map->connector) == driver)
            write(driver, map, (int)(next - map));
    }
}

static void write_outputs(RTS_UI32 task, const IoConfigTaskMap *task_map)
{
    const IoConfigConnectorMap *map = IoMgrConfigGetConnectorMaps(task_map);
    const IoConfigConnectorMap *end = map + task_map->connector_map_count;
    const IoConfigConnectorMap *next;

    for (; map < end; map = next) {
        IO_DRIVER *driver = IoDeviceGetDriver(map->connector);
        next = end_of_run(map, end, IoDeviceGetDriver);
        if (driver == NULL || driver->functions->IoDrvWriteOutputs == NULL || !enter_or_note(driver, 1u << task))
            continue;
        write_all(driver, map, (int)(next - map));
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
        const IoConfigTaskMap *map = get_map(task, IO_MAP_OUTPUTS);
        if (map != NULL && (is_safe || (notes >> task & 1) != 0))
            write_to(driver, map, is_safe ? write_safe : write_all);
    }
    if ((notes & PENDING_BUS_CYCLE) != 0)
        run_left_bus_cycles(driver);
}

/* ---- the phases of a cycle ---- */

static void before_code(RTS_UI32 task, const IEC_CONTEXT *context)
{
    const IoConfigTaskMap *map = get_map(task, IO_MAP_INPUTS);

    RTS_UNUSED(context);
    if (map != NULL) {
        read_inputs(map);
        SchedNoteEvents();
    }
    IoDevicesUpdate(task);
}

static void after_code(RTS_UI32 task, const IEC_CONTEXT *context)
{
    const IoConfigTaskMap *map = get_map(task, IO_MAP_OUTPUTS);

    RTS_UNUSED(context);
    if (map != NULL)
        write_outputs(task, map);
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
} HELD;

static void note_held(const IoConfigChannelMap *channel, void *arg)
{
    const HELD *held = arg;
    RTS_UI32 bit = channel->area_bit;
    RTS_UI32 end = bit + channel->bits;

    if ((channel->flags & IO_CHANNEL_ON_STOP) != IO_HOLD || end <= 8 * held->first ||
        bit >= 8 * (held->first + held->size))
        return;
    for (; bit < end; bit++) {
        RTS_UI32 byte = (bit >> 3) - held->first;
        if (byte < held->size)
            held->mask[byte] |= (RTS_UI8)(1u << (bit & 7));
    }
}

static void get_held(RTS_UI32 first, RTS_UI8 *mask, RTS_UI32 size)
{
    HELD held = {first, size, mask};

    if (manager.is_loaded)
        for_each_output(note_held, &held);
}

static void set_value(const IoConfigChannelMap *channel, void *arg)
{
    RTS_UNUSED(arg);
    if ((channel->flags & IO_CHANNEL_ON_STOP) == IO_VALUE)
        IoTablesSetChannel(IO_MAP_OUTPUTS, channel, channel->value);
}

/* The shared outputs are as they have to be, but for channels with a value. */
static void make_safe(void)
{
    RTS_UI32 lock = SysLockEnter();
    IO_DRIVER *driver;

    for_each_output(set_value, NULL);
    SysLockLeave(lock);
    for (driver = manager.drivers; driver != NULL; driver = driver->next) {
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
    if (manager.is_loaded)
        make_safe();
}

/* ---- load and unload ---- */

RTS_RESULT IoMgrConfigRefuse(const IoConfigConnector *connector, RTS_RESULT result, const char *format, ...)
{
    APP_REFUSAL *refusal = manager.refusal;
    RTS_UI32 index = IoMgrConfigGetIndex(connector);
    RTS_SIZE length;
    va_list arguments;

    if (refusal == NULL)
        return result;
    length = CMUtlsnprintf(refusal->text, sizeof refusal->text, "%s (%s): ", IoMgrConfigGetName(connector),
                           IoMgrConfigGetDriverName(connector));
    va_start(arguments, format);
    CMUtlvsnprintf(refusal->text + length, sizeof refusal->text - length, format, arguments);
    va_end(arguments);
    if ((connector->flags & CF_OPTIONAL) == 0) {
        manager.refused = result;
        return result;
    }
    LogAdd(CMPID_CmpIoMgrEmbedded, LOG_WARNING, result, "Not used: %s", refusal->text);
    refusal->text[0] = '\0';
    IoDeviceSetDriver(index, NULL);
    return ERR_OK;
}

static void assign_drivers(void)
{
    RTS_UI32 i;

    for (i = 0; i < IoTablesCountConnectors(); i++) {
        const IoConfigConnector *connector = IoMgrConfigGetConnector(i);
        const char *name = IoMgrConfigGetDriverName(connector);
        IO_DRIVER *driver = (connector->flags & CF_ENABLE) != 0 ? find_driver_for(name) : NULL;
        if (driver != NULL)
            IoDeviceSetDriver(i, driver);
        else if ((connector->flags & CF_ENABLE) != 0)
            LogAdd(CMPID_CmpIoMgrEmbedded, LOG_WARNING, ERR_NO_OBJECT, "%s is not used: there is no driver %s",
                   IoMgrConfigGetName(connector), name);
    }
}

static bool has_connector(const IO_DRIVER *driver)
{
    RTS_UI32 i = 0;

    while (i < IoTablesCountConnectors() && IoDeviceGetDriver(i) != driver)
        i++;
    return i < IoTablesCountConnectors();
}

static RTS_RESULT configure(IO_DRIVER *driver)
{
    const ICmpIoDrv *functions = driver->functions;
    RTS_RESULT result;

    if (!has_connector(driver))
        return ERR_OK;
    result = functions->IoDrvUpdateConfiguration(IoMgrConfigGetConnector(0), (int)IoTablesCountConnectors());
    if (result == ERR_OK && functions->IoDrvUpdateMapping != NULL)
        result = functions->IoDrvUpdateMapping(IoTablesGetTaskMaps(), (int)IoTablesCountTaskMaps());
    if (result != ERR_OK && manager.refused == ERR_OK)
        result = APP_REFUSE(manager.refusal, result, "The driver %s refuses its configuration (error 0x%X).",
                            functions->IoDrvGetInfo()->szDriverName, (unsigned)result);
    return result;
}

static void index_maps(void)
{
    RTS_UI32 i;

    memset(manager.map_of, NO_MAP, sizeof manager.map_of);
    for (i = 0; i < IoTablesCountTaskMaps(); i++) {
        const IoConfigTaskMap *map = IoTablesGetTaskMaps() + i;
        manager.map_of[map->task][map->type] = (RTS_UI8)i;
    }
}

static RTS_RESULT register_phases(void)
{
    RTS_RESULT result = manager.has_phases ? (RTS_RESULT)ERR_OK : CyclePhaseRegister(CYCLE_INPUTS, before_code);

    if (!manager.has_phases && result == ERR_OK)
        result = CyclePhaseRegister(CYCLE_OUTPUTS, after_code);
    if (!manager.has_phases && result == ERR_OK)
        result = CyclePhaseRegister(CYCLE_SAFE_STATE, enter_safe_state);
    manager.has_phases = result == ERR_OK;
    return result;
}

static RTS_RESULT load(const IO_CONFIG *config, const CDL_TASK *tasks, RTS_UI32 task_count, const IEC_CONTEXT *context,
                       APP_REFUSAL *refusal)
{
    IO_DRIVER *driver;
    RTS_RESULT result = register_phases();

    if (result != ERR_OK)
        return APP_REFUSE(refusal, result, "Raise CYCLE_MAX_PHASES of this firmware.");
    IoTablesSet(config, context);
    IoDevicesReset(tasks, task_count);
    index_maps();
    manager.refusal = refusal;
    manager.refused = ERR_OK;
    post(EVT_PrepareUpdateConfiguration);
    assign_drivers();
    for (driver = manager.drivers; driver != NULL && result == ERR_OK; driver = driver->next)
        result = configure(driver);
    post(EVT_DoneUpdateConfiguration);
    manager.refusal = NULL;
    if (result != ERR_OK)
        return result;
    manager.is_loaded = true;
    make_safe();
    return ERR_OK;
}

static void unload(void)
{
    IO_DRIVER *driver;

    if (IoTablesCountConnectors() == 0)
        return;
    for (driver = manager.drivers; driver != NULL; driver = driver->next) {
        if (has_connector(driver))
            (void)driver->functions->IoDrvUpdateConfiguration(IoMgrConfigGetConnector(0), 0);
        driver->pending = 0;
    }
    manager.is_loaded = false;
    IoTablesSet(NULL, NULL);
}

static bool has_driver(const char *name)
{
    return find_driver_for(name) != NULL;
}

static const APP_IO app_io = {has_driver, load, unload, get_held};

/* ---- main ---- */

static void keep_inputs_up(void)
{
    RTS_UI32 task;

    for (task = 0; task < APP_MAX_TASKS; task++) {
        const IoConfigTaskMap *map = get_map(task, IO_MAP_INPUTS);
        if (map != NULL)
            read_inputs(map);
    }
    start_bus_cycles(IO_ALL_TASKS);
    IoDevicesUpdate(IO_ALL_TASKS);
}

static void diagnose(void)
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

/* Once in a millisecond at most. */
static void look_after_devices(void)
{
    RTS_UI32 now_ms = SysTimeGetMs();

    if (!manager.is_loaded || now_ms == manager.last_ms)
        return;
    manager.last_ms = now_ms;
    if (AppGetState() != AS_RUN)
        keep_inputs_up();
    if (now_ms - manager.diagnosis_ms >= DIAGNOSIS_MS) {
        manager.diagnosis_ms = now_ms;
        diagnose();
    }
    IoDevicesLog();
}

/* ---- requests ---- */

/* The driver of a connector; NULL with the reason in *result. */
static const ICmpIoDrv *find_functions(RTS_UI32 index, RTS_RESULT *result)
{
    IO_DRIVER *driver = index < IoTablesCountConnectors() ? IoDeviceGetDriver(index) : NULL;

    *result = index < IoTablesCountConnectors() ? ERR_NO_OBJECT : ERR_INVALIDID;
    return driver != NULL ? driver->functions : NULL;
}

/* What the configuration says. */
static RTS_RESULT read_configured(const IoConfigParameter *parameter, void *data, RTS_UI32 bits, RTS_UI32 bit_offset)
{
    const void *value = IoMgrConfigGetParameterValuePointer(parameter, NULL);
    RTS_UI32 i;

    if (parameter == NULL)
        return ERR_NO_OBJECT;
    if (bits > parameter->bits || bit_offset > parameter->bits - bits)
        return ERR_OUT_OF_LIMITS;
    if (value == NULL)
        value = &parameter->value;
    memset(data, 0, (bits + 7) / 8);
    for (i = 0; i < bits; i++) {
        RTS_UI32 from = bit_offset + i;
        if ((((const RTS_UI8 *)value)[from / 8] >> (from & 7) & 1) != 0)
            ((RTS_UI8 *)data)[i / 8] |= (RTS_UI8)(1u << (i & 7));
    }
    return ERR_OK;
}

RTS_RESULT IoMgrReadParameter(RTS_UI32 connector, RTS_UI32 id, void *data, RTS_UI32 bits, RTS_UI32 bit_offset)
{
    const IoConfigConnector *place = IoMgrConfigGetConnector(connector);
    RTS_RESULT result;
    const ICmpIoDrv *functions = find_functions(connector, &result);

    if (functions != NULL && functions->IoDrvReadParameter != NULL)
        result = functions->IoDrvReadParameter(place, id, data, bits, bit_offset);
    else if (place != NULL)
        result = ERR_NO_OBJECT;
    return result == ERR_NO_OBJECT ? read_configured(IoMgrConfigGetParameter(place, id), data, bits, bit_offset)
                                   : result;
}

RTS_RESULT IoMgrWriteParameter(RTS_UI32 connector, RTS_UI32 id, const void *data, RTS_UI32 bits, RTS_UI32 bit_offset)
{
    RTS_RESULT result;
    const ICmpIoDrv *functions = find_functions(connector, &result);

    if (functions == NULL)
        return result;
    if (functions->IoDrvWriteParameter == NULL)
        return ERR_NOT_SUPPORTED;
    return functions->IoDrvWriteParameter(IoMgrConfigGetConnector(connector), id, data, bits, bit_offset);
}

RTS_RESULT IoMgrIdentify(RTS_UI32 connector)
{
    RTS_RESULT result;
    const ICmpIoDrv *functions = find_functions(connector, &result);

    if (functions == NULL)
        return result;
    return functions->IoDrvIdentify != NULL ? functions->IoDrvIdentify(IoMgrConfigGetConnector(connector))
                                            : (RTS_RESULT)ERR_NOT_SUPPORTED;
}

RTS_RESULT IoMgrScanModules(RTS_UI32 connector, RTS_UI32 index, IoDrvModule *module)
{
    RTS_RESULT result;
    const ICmpIoDrv *functions = find_functions(connector, &result);

    if (functions == NULL)
        return result;
    memset(module, 0, sizeof *module);
    return functions->IoDrvScanModules != NULL
               ? functions->IoDrvScanModules(IoMgrConfigGetConnector(connector), index, module)
               : (RTS_RESULT)ERR_NOT_SUPPORTED;
}

RTS_UI32 IoMgrGetSkipped(RTS_UI32 connector)
{
    IO_DRIVER *driver = connector < IoTablesCountConnectors() ? IoDeviceGetDriver(connector) : NULL;

    return driver != NULL ? SysAtomicLoad(&driver->skipped) : 0;
}

/* ---- the hook ---- */

RTS_RESULT CmpIoMgrEmbedded_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT) {
        CMP_CLEAR(manager);
        IoTablesSet(NULL, NULL);
        AppIoRegister(&app_io);
    }
    if (hook == CH_COMM_CYCLE)
        look_after_devices();
    return ERR_OK;
}
