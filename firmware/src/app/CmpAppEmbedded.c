/*
 * CmpAppEmbedded.c - the application: load, start, stop, reset, boot project, exceptions.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Life of an image: downloaded to the idle slot, checked there, mapped, committed (from here on it is what boots), and only then is
 * the old application stopped and this one loaded. Until it has proven itself, dying makes the next start-up go back to the
 * other slot.
 */
#include "CmpAppEmbedded.h"

#include <string.h>

#include "AppCommit.h"
#include "AppLoader.h"
#include "CMUtils.h"
#include "CmpEventMgr.h"
#include "CmpIecTask.h"
#include "CmpLog.h"
#include "CmpRetain.h"
#include "SysAtomic.h"
#include "SysExcept.h"
#include "SysFileFlash.h"
#include "SysFlash.h"
#include "SysTime.h"

/* How often an application may be started without proving itself: while there is one to go back to, and when there is
 * none. Beyond the second the device takes it for the reason of its restarts and leaves it stopped. */
enum { STARTS_WITHOUT_PROOF = 2, STARTS_WITHOUT_FALLBACK = 10 };

#define PROVE_NS ((RTS_I64)APP_PROVE_US * 1000)
#define NO_CODE_OFFSET 0xFFFFFFFFu

/* The RAM areas, 8-aligned for the largest IEC type. */
#define AREA_WORDS(size) (((size) + sizeof(RTS_I64) - 1) / sizeof(RTS_I64) + ((size) == 0))
static RTS_I64 data_area[AREA_WORDS(APP_DATA_SIZE)];
static RTS_I64 retain_area[AREA_WORDS(APP_RETAIN_SIZE)];
static RTS_I64 input_area[AREA_WORDS(APP_INPUT_SIZE)];
static RTS_I64 output_area[AREA_WORDS(APP_OUTPUT_SIZE)];
static RTS_I64 memory_area[AREA_WORDS(APP_MEMORY_SIZE)];

typedef struct {
    bool open;
    RTS_UI32 slot;
    RTS_UI32 size;
    RTS_UI32 crc;
} DOWNLOAD;

static struct {
    RTS_UI32 state; /* AS_* */
    RTS_UI32 slot;  /* of the loaded application */
    const RTS_UI8 *code;
    APP_IMAGE image;
    APP_TABLES tables;
    IEC_CONTEXT context; /* what every task starts from */
    RTS_I64 run_since_ns;
    APP_EXCEPTION exception;
    RTS_UI32 exception_claims;  /* how many contexts had an exception since the last was handled */
    RTS_UI32 exception_pending; /* `raised` is complete and waits for main */
    struct {
        RTS_I32 task;
        RTS_UI32 code;
        uintptr_t address;
    } raised;
    DOWNLOAD download;
} app;

static void post(RTS_UI32 event)
{
    if (EVENT_MAX_CALLBACKS > 0)
        EventPost(CMPID_CmpAppEmbedded, event, NULL);
}

static bool is_loaded(void)
{
    return app.state != AS_NONE;
}

static bool has_exception(void)
{
    return app.exception.code != RTSEXCPT_NOEXCEPTION;
}

/* ---- exceptions ---- */

const char *AppExceptionName(RTS_UI32 code)
{
    static const struct {
        RTS_UI32 code;
        const char *name;
    } names[] = {
        {RTSEXCPT_WATCHDOG, "watchdog expired"},
        {RTSEXCPT_DIVIDEBYZERO, "division by zero"},
        {RTSEXCPT_ARRAYBOUNDS, "index out of range"},
        {RTSEXCPT_ACCESS_VIOLATION, "access violation"},
        {RTSEXCPT_ILLEGAL_INSTRUCTION, "illegal instruction"},
        {RTSEXCPT_PRIV_INSTRUCTION, "privileged instruction"},
        {RTSEXCPT_STACK_OVERFLOW, "stack overflow"},
        {RTSEXCPT_MISALIGNMENT, "misaligned access"},
        {RTSEXCPT_OVERFLOW, "overflow"},
        {RTSEXCPT_FPU_ERROR, "floating point error"},
    };
    RTS_SIZE i;

    for (i = 0; i < RTS_COUNT(names); i++) {
        if (names[i].code == code)
            return names[i].name;
    }
    return "exception";
}

void AppHandleException(RTS_I32 task, RTS_UI32 code, uintptr_t address)
{
    memset(output_area, 0, sizeof output_area); /* at once: main may be busy with the flash */
    if (SysAtomicAdd(&app.exception_claims, 1) != 0)
        return; /* another task was first: one exception stops everything */
    app.raised.task = task;
    app.raised.code = code;
    app.raised.address = address;
    SysAtomicStore(&app.exception_pending, 1);
}

static void record_exception(RTS_I32 task, RTS_UI32 code, uintptr_t address)
{
    RTS_UI32 offset = (RTS_UI32)(address - (uintptr_t)app.code);
    const char *where = task < 0 ? "Initialisation" : app.tables.tasks[task].name;

    app.exception.task = task;
    app.exception.code = code;
    app.exception.code_offset = SysExceptIsCode(address) ? offset : NO_CODE_OFFSET;
    SysExceptKeepTrace(address);
    if (app.exception.code_offset == NO_CODE_OFFSET)
        LogAdd(CMPID_CmpAppEmbedded, LOG_EXCEPTION, code, "%s: %s", where, AppExceptionName(code));
    else
        LogAdd(CMPID_CmpAppEmbedded, LOG_EXCEPTION, code, "%s: %s at code offset 0x%x", where, AppExceptionName(code),
               (unsigned)app.exception.code_offset);
}

static void clear_exception(void)
{
    memset(&app.exception, 0, sizeof app.exception);
    SysExceptKeepTrace(0);
    SysAtomicStore(&app.exception_pending, 0);
    SysAtomicStore(&app.exception_claims, 0);
}

/* Whether the application in its slot still has to prove itself. */
static bool is_unproven(void)
{
    return AppCommitGet()->slot[app.slot].state != SLOT_PROVEN;
}

/* The safe state after an exception: no task runs, outputs are zero (again, since other tasks have finished their
 * cycle), and an application that is new will not be booted. */
static void enter_exception_state(void)
{
    IecTaskStopAll();
    memset(output_area, 0, sizeof output_area);
    app.state = AS_STOP;
    if (is_unproven())
        (void)AppCommitSetState(app.slot, SLOT_FAILED, 0);
    post(EVT_CmpApp_Exception);
}

static void handle_pending_exception(void)
{
    if (!SysAtomicLoad(&app.exception_pending))
        return;
    SysAtomicStore(&app.exception_pending, 0);
    record_exception(app.raised.task, app.raised.code, app.raised.address);
    enter_exception_state();
    (void)RetainSave(false);
}

/* ---- code outside of tasks ---- */

typedef struct {
    RTS_UI32 offset;
    bool takes_flag;
    RTS_UI32 flag;
} INIT_CALL;

static void call_init(void *arg)
{
    const INIT_CALL *call = arg;
    uintptr_t entry = ((uintptr_t)app.code + call->offset) | APP_ENTRY_MODE_BIT;

    if (call->takes_flag)
        APP_CALL_GLOBAL_INIT((IEC_GLOBAL_INIT)entry, &app.context, call->flag);
    else
        APP_CALL_ENTRY((IEC_ENTRY)entry, &app.context);
}

/* Runs a function of the function table when the image has it; false when it failed. */
static bool run_function(RTS_UI32 function, bool takes_flag, RTS_UI32 flag)
{
    INIT_CALL call = {app.image.entry[function], takes_flag, flag};
    RTS_EXCEPTION exception;

    if (call.offset == IMAGE_NO_ENTRY || !IecTaskRunGuarded(call_init, &call, &exception))
        return true;
    record_exception(-1, exception.code, exception.address);
    return false;
}

/* ---- load and unload ---- */

static void set_context(void)
{
    memset(&app.context, 0, sizeof app.context);
    app.context.area[APP_AREA_DATA] = (RTS_UI8 *)data_area;
    app.context.area[APP_AREA_RETAIN] = (RTS_UI8 *)retain_area;
    app.context.area[APP_AREA_INPUT] = (RTS_UI8 *)input_area;
    app.context.area[APP_AREA_OUTPUT] = (RTS_UI8 *)output_area;
    app.context.area[APP_AREA_MEMORY] = (RTS_UI8 *)memory_area;
    app.context.area[APP_AREA_CODE] = (RTS_UI8 *)(uintptr_t)app.code;
    app.context.imports = app.tables.imports;
}

static void zero_areas(bool retain_too)
{
    memset(data_area, 0, sizeof data_area);
    memset(input_area, 0, sizeof input_area);
    memset(output_area, 0, sizeof output_area);
    memset(memory_area, 0, sizeof memory_area);
    if (retain_too)
        memset(retain_area, 0, sizeof retain_area);
}

/* Initial values and fresh tasks; the application is in AS_STOP then, perhaps with an exception. */
static RTS_RESULT initialise(bool init_retains)
{
    RTS_RESULT result;

    clear_exception();
    zero_areas(init_retains);
    set_context();
    app.state = AS_STOP;
    result = IecTaskCreateAll(app.tables.tasks, app.image.task_count, &app.context);
    if (result != ERR_OK)
        return result;
    if (!run_function(CDL_FUNCTION_CODE_INIT, false, 0) ||
        !run_function(CDL_FUNCTION_GLOBAL_INIT, true, init_retains ? 1 : 0))
        enter_exception_state();
    else if (init_retains)
        (void)RetainSave(false);
    return ERR_OK;
}

static void run_global_exit(void)
{
    if (is_loaded() && !has_exception())
        (void)run_function(CDL_FUNCTION_GLOBAL_EXIT, false, 0);
}

static void unload(void)
{
    if (!is_loaded())
        return;
    run_global_exit();
    (void)IecTaskCreateAll(NULL, 0, &app.context);
    RetainAttach(NULL, 0, 0);
    SysFlashReleaseCode(app.slot);
    clear_exception();
    app.state = AS_NONE;
    app.slot = SLOT_NONE;
    app.code = NULL;
    SysExceptCodeRange(NULL, 0);
    memset(&app.image, 0, sizeof app.image);
}

/* Code of an image, executable; NULL when the port cannot. */
static const RTS_UI8 *map_code(RTS_UI32 slot, const APP_IMAGE *image)
{
    return SysFlashMapCode(slot, SysFileGetArea(slot)->offset + image->code.offset, image->code.size);
}

/* Takes over a checked image with its code mapped at `code`. Retain variables come from a record up to number
 * `retain_until`. */
static RTS_RESULT load(RTS_UI32 slot, const APP_IMAGE *image, const RTS_UI8 *code, RTS_UI32 retain_until)
{
    RTS_UI32 retain_after = AppCommitGet()->slot[slot].retain_after;
    RTS_UI32 retain_size = image->area_size[APP_AREA_RETAIN];
    RTS_RESULT restored;
    RTS_RESULT result = AppLoaderRead(image, &app.tables);

    if (result != ERR_OK) {
        SysFlashReleaseCode(slot);
        return result;
    }
    app.slot = slot;
    app.image = *image;
    app.code = code;
    SysExceptCodeRange(code, image->code.size);
    RetainAttach((RTS_UI8 *)retain_area, retain_size, image->retain_layout);
    restored = RetainRestore(retain_after, retain_until);
    if (restored != ERR_OK && retain_size != 0 && retain_until != retain_after)
        LogAdd(CMPID_CmpRetain, LOG_WARNING, restored, "No saved retain variables fit the application: initial values");
    result = initialise(restored != ERR_OK);
    if (result != ERR_OK)
        unload();
    return result;
}

/* ---- start and stop ---- */

static void stop_tasks(void)
{
    handle_pending_exception();
    if (app.state != AS_RUN)
        return;
    post(EVT_PrepareStop);
    IecTaskStopAll();
    handle_pending_exception(); /* one may have come in the last cycle */
    if (app.state == AS_RUN) {
        memset(output_area, 0, sizeof output_area);
        app.state = AS_STOP;
        (void)RetainSave(false);
    }
    post(EVT_StopDone);
}

/* `died_before`: starts of an unproven application that were not ended in good order. */
static RTS_RESULT start(RTS_UI32 died_before)
{
    RTS_RESULT result;

    post(EVT_PrepareStart);
    if (is_unproven())
        (void)AppCommitSetState(app.slot, SLOT_STARTED, (RTS_UI8)(died_before + 1));
    app.run_since_ns = SysTimeGetNs();
    result = IecTaskStartAll();
    if (result != ERR_OK) {
        IecTaskStopAll();
        return result;
    }
    app.state = AS_RUN;
    LogAdd(CMPID_CmpAppEmbedded, LOG_INFO, ERR_OK, "Application started");
    post(EVT_StartDone);
    return ERR_OK;
}

RTS_RESULT AppStartApplication(void)
{
    handle_pending_exception();
    if (!is_loaded())
        return ERR_APP_NOT_LOADED;
    if (has_exception())
        return ERR_INVALID_STATE;
    return app.state == AS_RUN ? ERR_OK : start(0);
}

RTS_RESULT AppStopApplication(void)
{
    bool ran;

    handle_pending_exception();
    if (!is_loaded())
        return ERR_APP_NOT_LOADED;
    ran = app.state == AS_RUN;
    stop_tasks();
    if (ran && !has_exception()) {
        if (is_unproven())
            (void)AppCommitSetState(app.slot, SLOT_TRIAL, 0);
        LogAdd(CMPID_CmpAppEmbedded, LOG_INFO, ERR_OK, "Application stopped");
    }
    return ERR_OK;
}

static void check_proof(void)
{
    if (app.state != AS_RUN || !is_unproven() || SysTimeGetNs() - app.run_since_ns < PROVE_NS)
        return;
    if (AppCommitSetState(app.slot, SLOT_PROVEN, 0) != ERR_OK)
        app.run_since_ns = SysTimeGetNs(); /* try again later, not in every pass */
}

/* ---- reset ---- */

static RTS_RESULT reset_origin(void)
{
    COMMIT blank;
    RTS_RESULT result;

    memset(&blank, 0, sizeof blank);
    blank.active = SLOT_NONE;
    result = AppCommitWrite(&blank);
    if (result != ERR_OK)
        return result;
    unload();
    zero_areas(true);
    return ERR_OK;
}

RTS_RESULT AppReset(RTS_UI32 option)
{
    RTS_RESULT result;

    if (option > RESET_OPTION_ORIGIN)
        return ERR_PARAMETER;
    handle_pending_exception();
    if (!is_loaded() && option != RESET_OPTION_ORIGIN)
        return ERR_APP_NOT_LOADED;
    post(EVT_PrepareReset);
    if (is_loaded())
        (void)AppStopApplication();
    if (option == RESET_OPTION_ORIGIN) {
        result = reset_origin();
    } else {
        run_global_exit();
        result = initialise(option == RESET_OPTION_COLD);
    }
    LogAdd(CMPID_CmpAppEmbedded, LOG_INFO, result, "Reset %s",
           option == RESET_OPTION_WARM ? "warm" : option == RESET_OPTION_COLD ? "cold" : "origin");
    post(EVT_ResetDone);
    return result;
}

/* ---- download ---- */

RTS_RESULT AppDownloadBegin(RTS_UI32 total_size, RTS_UI32 image_crc)
{
    RTS_UI32 slot = app.slot == FILE_SLOT_A ? FILE_SLOT_B : FILE_SLOT_A;

    AppDownloadAbort();
    if (total_size > SysFileGetArea(slot)->size)
        return ERR_NOMEMORY;
    app.download.open = true;
    app.download.slot = slot;
    app.download.size = total_size;
    app.download.crc = image_crc;
    SysFileCreate(slot);
    return ERR_OK;
}

RTS_RESULT AppDownloadWrite(RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_RESULT result;

    if (!app.download.open || offset != SysFileGetPos(app.download.slot))
        return ERR_INVALID_SEQUENCE;
    if (size > app.download.size - offset)
        return ERR_OUT_OF_LIMITS;
    result = SysFileWrite(app.download.slot, data, size);
    if (result != ERR_OK)
        AppDownloadAbort();
    return result;
}

RTS_UI32 AppDownloadOffset(void)
{
    return app.download.open ? SysFileGetPos(app.download.slot) : 0;
}

void AppDownloadAbort(void)
{
    app.download.open = false;
}

static RTS_RESULT explain(APP_REFUSAL *refusal, RTS_RESULT result, const char *text)
{
    refusal->result = result;
    CMUtlsnprintf(refusal->text, sizeof refusal->text, "%s", text);
    return result;
}

/* A macro, so that sentences nobody would see take no flash. */
#define refuse(refusal, result, text) explain(refusal, result, APP_REFUSAL_TEXT_SIZE > 1 ? (text) : "")

/* Makes the image of the download what boots from now on. */
static RTS_RESULT commit_download(const DOWNLOAD *download)
{
    COMMIT commit = *AppCommitGet();
    COMMIT_SLOT *slot = &commit.slot[download->slot];

    commit.active = (RTS_UI8)download->slot;
    memset(slot, 0, sizeof *slot);
    slot->size = download->size;
    slot->crc = download->crc;
    slot->retain_after = RetainGetSequence();
    slot->state = SLOT_TRIAL;
    return AppCommitWrite(&commit);
}

/* The point of no return: the checked image takes the place of the old application. */
static RTS_RESULT take_over(const DOWNLOAD *download, const APP_IMAGE *image, APP_REFUSAL *refusal)
{
    const RTS_UI8 *code = map_code(download->slot, image);
    RTS_RESULT result;

    if (code == NULL)
        return refuse(refusal, ERR_NOMEMORY, "There is no executable memory for the code.");
    result = commit_download(download);
    if (result != ERR_OK) {
        SysFlashReleaseCode(download->slot);
        return refuse(refusal, result, "The flash cannot be written.");
    }
    post(EVT_PrepareDownload);
    stop_tasks();
    unload();
    result = load(download->slot, image, code, AppCommitGet()->slot[download->slot].retain_after);
    post(EVT_DownloadDone);
    if (result == ERR_NOMEMORY)
        return refuse(refusal, result, "There are not enough timers for the tasks.");
    return result == ERR_OK ? ERR_OK : refuse(refusal, result, "The flash cannot be read.");
}

static RTS_RESULT finish_download(APP_REFUSAL *refusal)
{
    DOWNLOAD download = app.download;
    APP_IMAGE image;
    RTS_RESULT result;

    if (!download.open)
        return refuse(refusal, ERR_INVALID_SEQUENCE, "No download has begun.");
    if (SysFileGetPos(download.slot) != download.size)
        return refuse(refusal, ERR_SIZE_MISMATCH, "The image is not complete.");
    AppDownloadAbort();
    if (SysFileClose(download.slot) != ERR_OK)
        return refuse(refusal, ERR_DEVICE, "The flash cannot be written.");
    result = AppLoaderCheck(download.slot, download.size, download.crc, &image, refusal);
    return result == ERR_OK ? take_over(&download, &image, refusal) : result;
}

RTS_RESULT AppDownloadEnd(APP_REFUSAL *refusal)
{
    RTS_RESULT result;

    memset(refusal, 0, sizeof *refusal);
    handle_pending_exception();
    result = finish_download(refusal);
    if (result == ERR_OK)
        LogAdd(CMPID_CmpAppEmbedded, LOG_INFO, ERR_OK, "Application loaded, CRC 0x%x", (unsigned)app.image.crc);
    else
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, result, "Download refused: %s", refusal->text);
    return result;
}

/* ---- boot project ---- */

static bool load_from_slot(RTS_UI32 slot, RTS_UI32 retain_until)
{
    const COMMIT_SLOT *committed = &AppCommitGet()->slot[slot];
    const RTS_UI8 *code;
    APP_REFUSAL refusal;
    APP_IMAGE image;

    if (AppLoaderCheck(slot, committed->size, committed->crc, &image, &refusal) != ERR_OK) {
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, refusal.result, "Boot project refused: %s", refusal.text);
        return false;
    }
    code = map_code(slot, &image);
    return code != NULL && load(slot, &image, code, retain_until) == ERR_OK;
}

/*
 * Boots the other slot instead of `slot`; false when it holds nothing that can run. Its retain variables are those it had
 * when the failed application came; a record of their own numbers them as newest before the commit makes it so.
 */
static bool roll_back(RTS_UI32 slot)
{
    COMMIT commit = *AppCommitGet();
    RTS_UI32 other = slot == FILE_SLOT_A ? FILE_SLOT_B : FILE_SLOT_A;

    if (commit.slot[other].state == SLOT_EMPTY || commit.slot[other].state == SLOT_FAILED ||
        !load_from_slot(other, commit.slot[slot].retain_after))
        return false;
    commit.active = (RTS_UI8)other;
    commit.slot[slot].state = SLOT_FAILED;
    commit.slot[other].retain_after = RetainGetSequence();
    (void)RetainSave(true);
    (void)AppCommitWrite(&commit);
    LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING, ERR_OK, "The new application failed: back to the one before");
    return true;
}

static bool has_died(const COMMIT_SLOT *slot, RTS_UI32 starts)
{
    return slot->state == SLOT_FAILED || (slot->state == SLOT_STARTED && slot->starts >= starts);
}

/* Loads what shall run; false when there is nothing. */
static bool load_boot_project(RTS_UI32 active)
{
    if (has_died(&AppCommitGet()->slot[active], STARTS_WITHOUT_PROOF) && roll_back(active))
        return true;
    return load_from_slot(active, RetainGetSequence()) || roll_back(active);
}

/* A boot project starts by itself; one that died stays stopped when there is none to go back to. */
static void boot(void)
{
    const COMMIT *commit = AppCommitGet();
    const COMMIT_SLOT *slot;

    if (commit->active == SLOT_NONE) {
        LogAdd(CMPID_CmpAppEmbedded, LOG_INFO, ERR_OK, "No boot project");
        return;
    }
    if (!load_boot_project(commit->active))
        return;
    slot = &commit->slot[app.slot];
    if (has_died(slot, STARTS_WITHOUT_FALLBACK))
        LogAdd(CMPID_CmpAppEmbedded, LOG_WARNING, ERR_OK, "Boot project not started: it failed before");
    else if (!has_exception())
        (void)start(slot->state == SLOT_STARTED ? slot->starts : 0);
}

static void boot_at_start_up(void)
{
    RTS_RESULT result = AppCommitOpen();

    if (result == ERR_OK)
        boot();
    else
        LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, result, "The commit record cannot be read");
}

/* ---- what others ask ---- */

void AppGetStatus(APP_STATUS *status)
{
    handle_pending_exception();
    memset(status, 0, sizeof *status);
    status->state = app.state;
    status->image_crc = app.image.crc;
    status->image_size = app.image.size;
    status->exception = app.exception;
    if (is_loaded())
        status->op_state |= OS_PROGRAM_LOADED;
    if (app.download.open)
        status->op_state |= OS_DOWNLOAD;
    if (has_exception())
        status->op_state |= OS_EXCEPTION;
    if (AppCommitGet()->active != SLOT_NONE)
        status->op_state |= OS_BOOTPROJECT_VALID;
}

const char *AppGetInfo(RTS_UI32 index)
{
    static char info[APP_NAME_SIZE]; /* not in `app`: without the service that asks it takes no RAM */

    if (!is_loaded() || index >= IMAGE_INFO_COUNT)
        return "";
    AppLoaderReadInfo(&app.image, index, info, sizeof info);
    return info;
}

RTS_UI32 AppGetAreaSize(RTS_UI32 index)
{
    return index < APP_AREA_COUNT ? app.image.area_size[index] : 0;
}

RTS_UI8 *AppGetAreaAddress(RTS_UI32 index, RTS_UI32 offset, RTS_UI32 size)
{
    RTS_UI32 area_size = AppGetAreaSize(index);

    if (size > area_size || offset > area_size - size || index >= APP_AREA_COUNT || !is_loaded())
        return NULL;
    return app.context.area[index] + offset;
}

bool AppFindArea(uintptr_t address, RTS_UI32 *index, RTS_UI32 *offset)
{
    for (*index = 0; *index < APP_AREA_COUNT; ++*index) {
        uintptr_t distance = address - (uintptr_t)app.context.area[*index];
        if (distance < app.image.area_size[*index]) {
            *offset = (RTS_UI32)distance;
            return true;
        }
    }
    return false;
}

/* ---- life ---- */

RTS_RESULT CmpAppEmbedded_Hook(CMP_HOOK hook)
{
    switch (hook) {
    case CH_INIT:
        memset(&app, 0, sizeof app);
        app.slot = SLOT_NONE;
        zero_areas(true);
        break;
    case CH_INIT_TASKS:
        boot_at_start_up();
        break;
    case CH_COMM_CYCLE:
        handle_pending_exception();
        check_proof();
        break;
    case CH_EXIT_TASKS:
        (void)AppStopApplication();
        unload();
        break;
    default:
        break;
    }
    return ERR_OK;
}
