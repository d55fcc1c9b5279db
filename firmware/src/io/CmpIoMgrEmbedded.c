/*
 * CmpIoMgrEmbedded.c - the I/O manager: drivers, and the configuration they get when an application is loaded.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpIoMgrEmbedded.h"

#include <string.h>

#include "AppIo.h"
#include "AppState.h"
#include "CMUtils.h"
#include "CmpEventMgr.h"
#include "CmpLog.h"
#include "IoCycle.h"
#include "IoDevices.h"
#include "IoFollow.h"
#include "IoTables.h"
#include "SysTime.h"

enum { DIAGNOSIS_MS = 100 };

static struct {
    IO_DRIVER *drivers;
    APP_REFUSAL *refusal; /* while an application is loaded by the drivers */
    RTS_RESULT refused;
    RTS_UI32 last_ms; /* when main last looked after inputs and devices */
    RTS_UI32 diagnosis_ms;
} manager;

static void post(RTS_UI32 event)
{
    if (EVENT_MAX_CALLBACKS > 0)
        (void)EventPost(CMPID_CmpIoMgrEmbedded, event, EVTPARAMID_NONE, NULL);
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

/* No more of them once the driver has gone on without the connector. */
static RTS_RESULT each_of_map(const IoConfigConnectorMap *map, RTS_UI32 type, const IO_DRIVER *driver,
                              PF_IO_CHANNEL visit)
{
    const IoConfigConnector *connector = IoMgrConfigGetConnector(map->connector);
    const IoConfigChannelMap *channel = IoMgrConfigGetChannelMaps(map);
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    for (i = 0; result == ERR_OK && i < map->channel_map_count && IoDeviceGetDriver(map->connector) == driver; i++)
        result = visit(connector, &channel[i], type);
    return result;
}

RTS_RESULT IoMgrConfigEachChannel(const IoConfigTaskMap *task_maps, int count, const IO_DRIVER *driver,
                                  PF_IO_CHANNEL visit)
{
    RTS_RESULT result = ERR_OK;

    for (; count > 0; count--, task_maps++) {
        const IoConfigConnectorMap *map = IoMgrConfigGetConnectorMaps(task_maps);
        RTS_UI32 i;
        for (i = 0; result == ERR_OK && i < task_maps->connector_map_count; i++)
            result = each_of_map(&map[i], task_maps->type, driver, visit);
    }
    return result;
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

static RTS_RESULT load(const IO_CONFIG *config, const CDL_TASK *tasks, RTS_UI32 task_count, const IEC_CONTEXT *context,
                       APP_REFUSAL *refusal)
{
    IO_DRIVER *driver;
    RTS_RESULT result = ERR_OK;

    IoTablesSet(config, context);
    IoDevicesReset(tasks, task_count);
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
    result = IoCycleLoad(manager.drivers);
    return result == ERR_OK ? ERR_OK : APP_REFUSE(refusal, result, "Raise CYCLE_OWN_PHASES of this firmware.");
}

/* Drivers without connectors too: theirs may have been refused, optional, after they took hardware. */
static void unload(void)
{
    IO_DRIVER *driver;

    if (IoTablesCountConnectors() == 0)
        return;
    IoCycleUnload();
    for (driver = manager.drivers; driver != NULL; driver = driver->next)
        (void)driver->functions->IoDrvUpdateConfiguration(IoMgrConfigGetConnector(0), 0);
    IoTablesSet(NULL, NULL);
}

static bool has_driver(const char *name)
{
    return find_driver_for(name) != NULL;
}

static void reset(void)
{
    IO_DRIVER *driver;

    for (driver = manager.drivers; driver != NULL; driver = driver->next) {
        if (driver->functions->IoDrvReset != NULL)
            driver->functions->IoDrvReset();
    }
}

#if ONLINE_CHANGE
static RTS_RESULT check_change(const IO_CONFIG *config, APP_REFUSAL *refusal)
{
    const IO_DRIVER *driver;

    if (!IoTablesCanFollow(config))
        return APP_REFUSE(refusal, ERR_NOT_SUPPORTED, "The I/O configuration has changed; download the program.");
    for (driver = manager.drivers; driver != NULL; driver = driver->next) {
        if (has_connector(driver) && driver->functions->IoDrvFollowConfiguration == NULL)
            return APP_REFUSE(refusal, ERR_NOT_SUPPORTED, "The driver %s knows no online change; download the program.",
                              driver->functions->IoDrvGetInfo()->szDriverName);
    }
    return ERR_OK;
}

static void follow(const IO_CONFIG *config, const CDL_TASK *tasks, RTS_UI32 task_count, const IEC_CONTEXT *context)
{
    const IO_DRIVER *driver;

    IoTablesFollow(config, context);
    for (driver = manager.drivers; driver != NULL; driver = driver->next) {
        if (driver->functions->IoDrvFollowConfiguration != NULL)
            driver->functions->IoDrvFollowConfiguration(IoTablesGetTaskMaps(), (int)IoTablesCountTaskMaps());
    }
    IoDevicesFollow(tasks, task_count);
    IoCycleFollow();
}
#endif

static const APP_IO app_io = {
    has_driver,   load,   reset, unload, IoCycleGetKept,
#if ONLINE_CHANGE
    check_change, follow,
#endif
};

/* ---- main ---- */

/* Once in a millisecond at most. */
static void look_after_devices(void)
{
    RTS_UI32 now_ms = SysTimeGetMs();

    if (IoTablesCountConnectors() == 0 || now_ms == manager.last_ms)
        return;
    manager.last_ms = now_ms;
    if (AppGetState() != AS_RUN)
        IoCycleKeepUp();
    if (now_ms - manager.diagnosis_ms >= DIAGNOSIS_MS) {
        manager.diagnosis_ms = now_ms;
        IoCycleDiagnose();
    }
    IoDevicesLog();
}

/* ---- the hook ---- */

RTS_RESULT CmpIoMgrEmbedded_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT) {
        CMP_CLEAR(manager);
        IoCycleForget();
        IoTablesSet(NULL, NULL);
        AppIoRegister(&app_io);
    }
    if (hook == CH_COMM_CYCLE)
        look_after_devices();
    return ERR_OK;
}
