/*
 * AppLife.c - the life of the application: load, start, stop, exceptions.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * An application that is new has to prove itself by running for a while. Until it has, a failure makes the next start-up go
 * back to the previous one (AppBoot.c). A loss of power is not a failure.
 */
#include "AppLife.h"

#include <stddef.h>
#include <string.h>

#include "../cycle/AppAreas.h"
#include "AppCommit.h"
#include "AppEvents.h"
#include "AppException.h"
#include "../load/AppFunctions.h"
#include "AppIo.h"
#include "AppRetain.h"
#include "AppState.h"
#include "../load/AppTasks.h"
#include "CmpIecTask.h"
#include "CmpLog.h"
#include "CmpRetain.h"
#include "CyclePhases.h"
#include "IecCycle.h"
#include "SysExcept.h"
#include "SysFileFlash.h"
#include "SysFlash.h"
#include "SysTime.h"

#define PROVE_MS (APP_PROVE_US / 1000)
#define STUCK_NS ((RTS_I64)1000000000)

/* What a loaded application waits for: nothing, its initial values, those of retain variables too. */
enum { INIT_DONE = 0, INIT_WARM = 1, INIT_COLD = 2 };

static struct {
    RTS_UI8 state;   /* AS_* */
    RTS_UI8 pending; /* INIT_* */
    const RTS_UI8 *code;
    APP_IMAGE image;
    APP_TABLES tables;
    IEC_CONTEXT context; /* what every task starts from */
    RTS_UI32 run_since_ms;
} app;

#if EVENT_MAX_CALLBACKS > 0
void AppPostEvent(RTS_UI32 event)
{
    AppEventTell(event, &app.image);
}
#endif

static bool is_loaded(void)
{
    return app.state != AS_NONE;
}

RTS_UI32 AppGetState(void)
{
    return app.state;
}

bool AppIsInitialised(void)
{
    return app.pending == INIT_DONE;
}

const APP_IMAGE *AppGetImage(void)
{
    return &app.image;
}

const IEC_CONTEXT *AppGetContext(void)
{
    return &app.context;
}

RTS_UI32 AppGetSlot(void)
{
    return is_loaded() ? app.image.file : SLOT_NONE;
}

bool AppHasException(void)
{
    return AppExceptionGet()->code != RTSEXCPT_NOEXCEPTION;
}

bool AppWasBrokenOff(void)
{
    return !RTS_ONE_CORE && AppExceptionGet()->code == RTSEXCPT_STOP_TIMEOUT;
}

static bool is_proven(void)
{
    return AppCommitIsProven(app.image.file);
}

/* ---- exceptions ---- */

static const char *place_of(RTS_I32 task)
{
    if (IEC_EVENTS && task == APP_IN_EVENT)
        return "Event";
    if (IEC_EVENTS && task == APP_IN_CALL)
        return "Call from C";
    return task < 0 ? "Initialisation" : app.tables.tasks[task].name;
}

/* No IEC code runs. */
static void record_exception(const APP_RAISED *raised)
{
    APP_EXCEPTION exception = {raised->code, APP_NO_CODE_OFFSET, raised->task};

    if (SysExceptIsCode(raised->address))
        exception.code_offset = (RTS_UI32)(raised->address - (uintptr_t)app.code);
    SysExceptKeepTrace(raised->address);
    AppExceptionSet(&exception, place_of(raised->task));
}

#if SETTINGS
bool AppEndUnclean(const char *text)
{
    if (SETTING(BootStart) != BOOT_START_CLEAN || AppCommitGet()->state[AppCommitGet()->active] != SLOT_PROVEN)
        return false;
    AppCommitSetDead(text);
    return true;
}
#endif

/* The safe state after an exception (again, since other tasks have finished their cycle); an application that is new
 * will not be booted. */
static void enter_exception_state(void)
{
    AppEnterSafeState();
    app.state = AS_STOP;
    if (!AppWasBrokenOff() && !(app.image.file == AppCommitGet()->active && AppEndUnclean("")))
        (void)AppCommitSetState(app.image.file, SLOT_FAILED);
    AppPostEvent(EVT_CmpApp_Exception);
}

void AppHandlePendingException(void)
{
    APP_RAISED raised;

    if (!AppExceptionTake(&raised))
        return;
    IecTaskStopAll();
    record_exception(&raised);
    enter_exception_state();
    (void)RetainSave(false);
}

/* ---- code outside of tasks ---- */

typedef struct {
    RTS_UI32 function; /* CDL_FUNCTION_* */
    bool init_retains; /* for GlobalInit */
} INIT_CALL;

static void call_init(void *arg)
{
    const INIT_CALL *call = arg;
    uintptr_t entry = ((uintptr_t)app.code + app.image.entry[call->function]) | APP_ENTRY_MODE_BIT;

    if (call->function == CDL_FUNCTION_GLOBAL_INIT)
        APP_CALL_GLOBAL_INIT((IEC_GLOBAL_INIT)entry, &app.context, call->init_retains);
    else
        APP_CALL_ENTRY((IEC_ENTRY)entry, &app.context);
}

/* Runs a function of the function table when the image has it; false when it failed. */
static bool run_function(RTS_UI32 function, bool init_retains)
{
    INIT_CALL call = {function, init_retains};
    APP_RAISED raised = {APP_IN_INITIALISATION, RTSEXCPT_NOEXCEPTION, 0};
    RTS_EXCEPTION exception;

    if (app.image.entry[function] == IMAGE_NO_ENTRY || IecTaskRunGuarded(call_init, &call, &exception))
        return true;
    raised.code = exception.code;
    raised.address = exception.address;
    record_exception(&raised);
    return false;
}

/* Where the I/O configuration of a loaded application is. */
#if IO_MAX_CONNECTORS > 0
static const IO_CONFIG *io_config(void)
{
    return (const IO_CONFIG *)(const void *)(app.code + app.image.io.offset);
}
#endif

#if ONLINE_CHANGE
#if IO_MAX_CONNECTORS > 0
static void follow_io(void)
{
    if (app.image.io.size != 0)
        AppIoGet()->follow(io_config(), app.tables.tasks, app.image.task_count, &app.context);
}
#else
#define follow_io() ((void)0)
#endif

static void call_entry(void *arg)
{
    APP_CALL_ENTRY((IEC_ENTRY)(((uintptr_t)app.code + *(const RTS_UI32 *)arg) | APP_ENTRY_MODE_BIT), &app.context);
}

bool AppRunInit(RTS_UI32 offset, RTS_UI32 *code)
{
    RTS_EXCEPTION exception = {RTSEXCPT_NOEXCEPTION, 0};
    bool ended = IecTaskRunGuarded(call_entry, &offset, &exception);

    *code = exception.code;
    return ended;
}

const APP_TABLES *AppGetTables(void)
{
    return &app.tables;
}

static bool is_same_task(const CDL_TASK *a, const CDL_TASK *b)
{
    return memcmp(a, b, offsetof(CDL_TASK, entry_offset)) == 0 &&
           memcmp(&a->event_area, &b->event_area, sizeof *a - offsetof(CDL_TASK, event_area)) == 0;
}

RTS_UI32 AppFindKeptTasks(const APP_IMAGE *image, const APP_TABLES *tables)
{
    RTS_UI32 kept = 0;
    RTS_UI32 i;

    for (i = 0; i < image->task_count && i < app.image.task_count; i++) {
        if (is_same_task(&tables->tasks[i], &app.tables.tasks[i]))
            kept |= 1u << i;
    }
    return kept;
}

void AppExchange(const APP_IMAGE *image, const RTS_UI8 *code, const APP_TABLES *tables)
{
    RTS_UI32 kept = AppFindKeptTasks(image, tables);

    app.image = *image;
    app.tables = *tables;
    app.code = code;
    app.context.area[APP_AREA_CODE] = (RTS_UI8 *)(uintptr_t)code;
    SysExceptCodeRange(code, image->code.size);
    IecTaskSetCode(app.tables.tasks, app.image.task_count, kept, &app.context);
    RetainExchange(&app.image.kept, image->crc);
    follow_io();
}

void AppBeginProof(void)
{
    app.run_since_ms = SysTimeGetMs();
    if (app.state == AS_RUN)
        (void)AppCommitSetState(app.image.file, SLOT_STARTED);
}
#endif

/* ---- load and unload ---- */

static void set_context(void)
{
    memset(&app.context, 0, sizeof app.context);
    AppAreasSet(&app.context);
    app.context.area[APP_AREA_CODE] = (RTS_UI8 *)(uintptr_t)app.code;
    app.context.imports = app.tables.imports;
}

/* Gives up what is loaded, as it is. */
static void unload(void)
{
    AppPostEvent(EVT_PrepareExit);
    (void)IecTaskCreateAll(NULL, 0, &app.context);
    if (AppIoGet() != NULL)
        AppIoGet()->unload();
    RetainDetach();
    SysFlashReleaseCode(app.image.file);
    AppExceptionClear();
    app.state = AS_NONE;
    app.pending = INIT_DONE;
    app.code = NULL;
    SysExceptCodeRange(NULL, 0);
    memset(&app.image, 0, sizeof app.image);
}

/* Initial values, what is kept, and fresh tasks. What the flash says meanwhile is that it was begun: nothing else shows
 * that a program ended the runtime here. */
static RTS_RESULT initialise(bool init_retains)
{
    RTS_RESULT result;

    AppExceptionClear();
    AppAreasClear();
    app.pending = INIT_DONE;
    result = IecTaskCreateAll(app.tables.tasks, app.image.task_count, &app.context);
    if (result != ERR_OK) {
        unload();
        return result;
    }
    AppCommitBegin(app.image.file);
    if (run_function(CDL_FUNCTION_CODE_INIT, false))
        RetainPutBack();
    if (AppHasException() || !run_function(CDL_FUNCTION_GLOBAL_INIT, init_retains))
        enter_exception_state();
    RetainSettle(AppHasException());
    AppCommitDone(app.image.file);
    return ERR_OK;
}

RTS_RESULT AppInitialise(void)
{
    RetainCapture(false); /* they may have been written meanwhile */
    return initialise(app.pending == INIT_COLD);
}

/* Of an application that is as its own code left it. */
static void run_global_exit(void)
{
    if (app.pending == INIT_DONE && !AppHasException())
        (void)run_function(CDL_FUNCTION_GLOBAL_EXIT, false);
}

RTS_RESULT AppReinitialise(bool cold)
{
    RTS_RESULT result;

    run_global_exit();
    AppPostEvent(EVT_PrepareExit);
    RetainCapture(cold);
    result = initialise(cold || app.pending == INIT_COLD);
    if (AppIoGet() != NULL)
        AppIoGet()->reset();
    return result;
}

void AppUnload(void)
{
    if (!is_loaded())
        return;
    run_global_exit();
    (void)RetainSave(false); /* what that, or a tool since the stop, has written */
    unload();
}

const RTS_UI8 *AppMapCode(const APP_IMAGE *image)
{
    return SysFlashMapCode(image->file, SysFileGetArea(image->file)->offset + image->code.offset, image->code.size);
}

/* Gives the drivers the configuration of the application. */
#if IO_MAX_CONNECTORS > 0
static RTS_RESULT load_io(APP_REFUSAL *refusal)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    if (app.image.io.size == 0)
        return ERR_OK;
    result = AppIoGet()->load(io_config(), app.tables.tasks, app.image.task_count, &app.context, refusal);
    for (i = 0; i < app.image.task_count && result == ERR_OK; i++)
        result = AppTasksCheckEvent(&app.tables.tasks[i], refusal);
    return result;
}
#else
#define load_io(refusal) ((RTS_RESULT)ERR_OK)
#endif

RTS_RESULT AppLoad(const APP_IMAGE *image, const RTS_UI8 *code, RTS_UI32 retain_until, APP_REFUSAL *refusal)
{
    RTS_RESULT restored;
    RTS_RESULT result = AppLoaderRead(image, &app.tables);

    if (result != ERR_OK) {
        SysFlashReleaseCode(image->file);
        return APP_REFUSE(refusal, result, "The flash cannot be read.");
    }
    app.image = *image;
    app.code = code;
    app.state = AS_STOP;
    SysExceptCodeRange(code, image->code.size);
    AppImageAttach(app.image.task_image);
    set_context();
    AppAreasClear();
    result = load_io(refusal);
    if (result != ERR_OK) {
        unload();
        return result;
    }
    restored = AppRetainLoad(&app.image, app.context.area[APP_AREA_RETAIN], retain_until);
    app.pending = restored == ERR_OK ? INIT_WARM : INIT_COLD;
    return ERR_OK;
}

/* ---- start and stop ---- */

bool AppStopTasks(void)
{
    AppHandlePendingException();
    if (app.state != AS_RUN)
        return false;
    AppPostEvent(EVT_PrepareStop);
    IecTaskStopAll();
    AppHandlePendingException(); /* one may have come in the last cycle */
    if (app.state == AS_RUN) {
        AppEnterSafeState();
        app.state = AS_STOP;
        (void)RetainSave(false);
    }
    AppPostEvent(EVT_StopDone);
    return true;
}

/* Gives it its initial values if it waits for them. */
static RTS_RESULT get_ready(void)
{
    RTS_RESULT result = app.pending == INIT_DONE ? ERR_OK : AppInitialise();

    return result == ERR_OK && AppHasException() ? (RTS_RESULT)ERR_EXCEPTION : result;
}

/* ERR_EXCEPTION: the program's function for the event failed. */
static RTS_RESULT tell(RTS_UI32 event)
{
    RTS_UNUSED(event);
    AppPostEvent(event);
    return IEC_EVENTS && AppHasException() ? (RTS_RESULT)ERR_EXCEPTION : ERR_OK;
}

RTS_RESULT AppStart(void)
{
    RTS_RESULT result = get_ready();

    if (result == ERR_OK)
        result = tell(EVT_PrepareStart);
    if (result != ERR_OK)
        return result;
    (void)AppCommitSetState(app.image.file, SLOT_STARTED);
    app.run_since_ms = SysTimeGetMs();
    result = IecTaskStartAll();
    if (result != ERR_OK) {
        IecTaskStopAll();
        AppEnterSafeState(); /* some tasks may have run */
        return result;
    }
    app.state = AS_RUN;
    LogAdd(CMPID_CmpAppEmbedded, LOG_INFO | LOG_KEPT, ERR_OK, "Application started");
    return tell(EVT_StartDone);
}

#if EVENT_MAX_CALLBACKS > 0
RTS_RESULT AppAskStart(RTS_UI32 event)
{
    RTS_RESULT result = get_ready();

    if (result == ERR_OK)
        result = AppEventAsk(event, &app.image);
    return IEC_EVENTS && AppHasException() ? (RTS_RESULT)ERR_EXCEPTION : result;
}

RTS_RESULT AppStartIfAllowed(void)
{
    RTS_RESULT result = AppAskStart(EVT_DenyStart);

    return result == ERR_OK ? AppStart() : result;
}

RTS_RESULT AppAskStop(void)
{
    AppHandlePendingException();
    return app.state == AS_RUN ? AppEventAsk(EVT_DenyStop, &app.image) : (RTS_RESULT)ERR_OK;
}
#endif

#if SRV_OTHER_CLIENTS
/* Nothing is noted in flash: it may be done often, and a program that ends the runtime here does so again when it is
 * started. */
RTS_RESULT AppRunOnce(void)
{
    RTS_RESULT result = get_ready();

    if (result == ERR_OK)
        result = tell(EVT_PrepareStart);
    if (result != ERR_OK)
        return result;
    app.run_since_ms = SysTimeGetMs();
    app.state = AS_RUN;
    if (tell(EVT_StartDone) == ERR_OK)
        IecTaskRunOnce();
    (void)AppStopTasks();
    return AppHasException() ? ERR_EXCEPTION : ERR_OK;
}
#endif

/* Whether a cycle lasts that may never end: its watchdog may take longer than the proof. On one core main does not run
 * meanwhile. */
static bool is_stuck(void)
{
    IEC_GUARD guard;
    RTS_UI32 i;

    for (i = 0; i < IecTaskGetCount(); i++) {
        if (IecTaskReadGuard(i, &guard) && SysTimeGetNs() - guard.start_ns > STUCK_NS)
            return true;
    }
    return false;
}

void AppCheckProof(void)
{
    if (app.state != AS_RUN || is_proven() || SysTimeGetMs() - app.run_since_ms < PROVE_MS)
        return;
    if (!RTS_ONE_CORE && is_stuck())
        return;
    if (AppCommitSetState(app.image.file, SLOT_PROVEN) == ERR_OK)
        RetainKeepNone();
    else
        app.run_since_ms = SysTimeGetMs(); /* try again later, not in every pass */
}

/* ---- reset of the runtime ---- */

void AppForget(void)
{
    CMP_CLEAR(app);
    AppExceptionClear();
    AppAreasClear();
    SysExceptCodeRange(NULL, 0);
}
