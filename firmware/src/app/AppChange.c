/*
 * AppChange.c - online change: an image takes the place of the one that runs, between two cycles.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppChange.h"

#if ONLINE_CHANGE

#include <string.h>

#include "../cycle/AppAreas.h"
#include "../load/AppFunctions.h"
#include "AppCommit.h"
#include "AppEvents.h"
#include "AppLife.h"
#include "AppReason.h"
#include "AppState.h"
#include "CmpAppBP.h"
#include "CmpIecTask.h"
#include "CmpLog.h"
#include "CmpRetain.h"
#include "IecCycle.h"
#include "SysFlash.h"

#define U(value) ((unsigned)(value))

/* On the stack of main: the tables are of the image that is to run next. */
typedef struct {
    const APP_IMAGE *image;
    const RTS_UI8 *code;
    APP_TABLES tables;
    APP_IMAGE old;
    const RTS_UI8 *old_code;
    RTS_UI32 exception; /* of what initialises */
} CHANGE;

/* ---- steps ---- */

static const CDL_CHANGE_STEP *first_step(const CHANGE *change)
{
    return (const CDL_CHANGE_STEP *)(const void *)(change->code + change->image->change.offset);
}

static RTS_UI32 data_size(const CDL_CHANGE_STEP *step)
{
    return step->kind == CDL_CHANGE_PUT ? (step->size + 3) & ~(RTS_UI32)3 : 0;
}

static const CDL_CHANGE_STEP *next_step(const CDL_CHANGE_STEP *step)
{
    return (const CDL_CHANGE_STEP *)(const void *)((const RTS_UI8 *)(step + 1) + data_size(step));
}

static bool is_in_area(const APP_IMAGE *image, RTS_UI32 area, RTS_UI32 offset, RTS_UI32 size)
{
    return area < APP_AREA_CODE && offset <= image->area_size[area] && size <= image->area_size[area] - offset;
}

static bool is_step(const CHANGE *change, const CDL_CHANGE_STEP *step, RTS_UI32 left)
{
    if (step->kind > CDL_CHANGE_MOVE || !is_in_area(change->image, step->area, step->to, step->size))
        return false;
    if (step->kind == CDL_CHANGE_MOVE)
        return is_in_area(&change->old, step->from_area, step->from, step->size);
    return step->kind != CDL_CHANGE_PUT || data_size(step) <= left;
}

/* Each step within its area and the code. */
static bool are_steps(const CHANGE *change)
{
    const CDL_CHANGE *place = &change->image->change;
    RTS_UI32 code_size = change->image->code.size;
    const CDL_CHANGE_STEP *step;
    RTS_UI32 left = place->size;

    if (place->offset % 4 != 0 || place->offset > code_size || place->size > code_size - place->offset ||
        (place->init != CDL_CHANGE_NO_INIT && place->init >= code_size))
        return false;
    for (step = first_step(change); left > 0; step = next_step(step)) {
        if (left < sizeof *step || !is_step(change, step, left - (RTS_UI32)sizeof *step))
            return false;
        left -= (RTS_UI32)sizeof *step + data_size(step);
    }
    return true;
}

static void do_step(const CDL_CHANGE_STEP *step)
{
    RTS_UI8 *to = AppAreasGet(step->area) + step->to;

    if (step->kind == CDL_CHANGE_CLEAR)
        memset(to, 0, step->size);
    else if (step->kind == CDL_CHANGE_PUT)
        memcpy(to, step + 1, step->size);
    else
        memmove(to, AppAreasGet(step->from_area) + step->from, step->size);
}

/* ---- checks ---- */

static RTS_RESULT check_state(const APP_IMAGE *image, APP_REFUSAL *refusal)
{
    AppHandlePendingException();
    if (AppGetState() == AS_NONE || !AppIsInitialised() || AppHasException())
        return APP_REFUSE(refusal, ERR_INVALID_STATE, "No program runs that could change; download it.");
#if BP_MAX > 0
    if (AppBpIsHalted())
        return APP_REFUSE(refusal, ERR_INVALID_STATE, "A debugger has halted the program; let it go on first.");
#endif
    if (image->change.base != AppGetImage()->crc)
        return APP_REFUSE(refusal, ERR_ID_MISMATCH, "The change is of program %X, but %X runs; build it again.",
                          U(image->change.base), U(AppGetImage()->crc));
    return ERR_OK;
}

/* True if both records say the same but for where the code is. */
static bool is_same_task(const CDL_TASK *a, const CDL_TASK *b)
{
    CDL_TASK moved = *a;

    moved.entry_offset = b->entry_offset;
    return memcmp(&moved, b, sizeof moved) == 0;
}

static RTS_RESULT check_tasks(const CHANGE *change, APP_REFUSAL *refusal)
{
    const CDL_TASK *old = AppGetTables()->tasks;
    RTS_UI32 i;

    if (change->image->task_count != change->old.task_count)
        return APP_REFUSE(refusal, ERR_NOT_SUPPORTED, "The change has other tasks; download it.");
    for (i = 0; i < change->old.task_count; i++) {
        if (!is_same_task(&change->tables.tasks[i], &old[i]))
            return APP_REFUSE(refusal, ERR_NOT_SUPPORTED, "Task %s is another one; download the program.", old[i].name);
    }
    return ERR_OK;
}

static RTS_RESULT check_all(const CHANGE *change, APP_REFUSAL *refusal)
{
#if IO_MAX_CONNECTORS > 0
    if (change->image->io.size != 0 || change->old.io.size != 0)
        return APP_REFUSE(refusal, ERR_NOT_SUPPORTED, "The program has an I/O configuration; download it.");
#endif
    if (!are_steps(change))
        return APP_REFUSE(refusal, ERR_OUT_OF_LIMITS, "The steps of the change are damaged; build it again.");
    return check_tasks(change, refusal);
}

/* ---- the exchange ---- */

/* No task is in its cycle. */
static void begin(void *arg)
{
    const CHANGE *change = arg;
    const RTS_UI8 *end = (const RTS_UI8 *)first_step(change) + change->image->change.size;
    const CDL_CHANGE_STEP *step;

    for (step = first_step(change); (const RTS_UI8 *)step < end; step = next_step(step))
        do_step(step);
    AppExchange(change->image, change->code, &change->tables);
}

static void go_back(void *arg)
{
    const CHANGE *change = arg;

    AppExchange(&change->old, change->old_code, &change->tables);
}

/* Calculated initial values, and FB_Init, of new variables. */
static bool initialise(void *arg)
{
    CHANGE *change = arg;
    bool done = AppRunInit(change->image->change.init, &change->exception);

    if (!done && AppLoaderRead(&change->old, &change->tables) == ERR_OK)
        go_back(change);
    return done;
}

static RTS_RESULT exchange(CHANGE *change, APP_REFUSAL *refusal)
{
    bool has_init = change->image->change.init != CDL_CHANGE_NO_INIT;
    const CYCLE_EXCHANGE moment = {begin, has_init ? initialise : NULL, change};
    RTS_RESULT result = IecTaskExchange(&moment);

    if (result == ERR_TIMEOUT)
        return APP_REFUSE(refusal, result, "A task takes too long for its cycle; try again.");
    if (result != ERR_OK)
        return APP_REFUSE(refusal, result, "The initial values of new variables failed (exception 0x%X).",
                          U(change->exception));
    return ERR_OK;
}

/* The record of the retain variables is there before the image is what boots. */
static RTS_RESULT commit(CHANGE *change, RTS_UI32 retain_after, APP_REFUSAL *refusal)
{
    const CYCLE_EXCHANGE moment = {go_back, NULL, change};
    RTS_RESULT result;

    RetainKeepNone(); /* of the application that was in this slot */
    RetainKeep(retain_after);
    result = RetainSaveExchanged();
    if (result == ERR_OK)
        result = AppCommitInstall(change->image->file, change->image->crc, retain_after);
    if (result == ERR_OK)
        return ERR_OK;
    if (AppLoaderRead(&change->old, &change->tables) == ERR_OK) {
        while (IecTaskExchange(&moment) == ERR_TIMEOUT)
            AppHandlePendingException();
    }
    return APP_REFUSE(refusal, result, "The flash cannot be written.");
}

static RTS_RESULT change_to(CHANGE *change, APP_REFUSAL *refusal)
{
    RTS_UI32 retain_after = RetainGetSequence();
    RTS_RESULT result = check_all(change, refusal);

    if (result == ERR_OK)
        result = exchange(change, refusal);
    if (result == ERR_OK)
        result = commit(change, retain_after, refusal);
    return result;
}

/* Maps its code and reads its tables. */
static RTS_RESULT prepare(CHANGE *change, APP_REFUSAL *refusal)
{
    RTS_RESULT result;

    change->old = *AppGetImage();
    change->old_code = AppGetContext()->area[APP_AREA_CODE];
    change->code = AppMapCode(change->image);
    if (change->code == NULL)
        return APP_REFUSE(refusal, ERR_NOMEMORY, "There is no executable memory for the code.");
    result = AppLoaderRead(change->image, &change->tables);
    return result == ERR_OK ? ERR_OK : APP_REFUSE(refusal, result, "The flash cannot be read.");
}

static RTS_RESULT take_place(const APP_IMAGE *image, APP_REFUSAL *refusal)
{
    CHANGE change = {.image = image};
    RTS_RESULT result = prepare(&change, refusal);

    if (result == ERR_OK)
        result = change_to(&change, refusal);
    SysFlashReleaseCode(result == ERR_OK ? change.old.file : image->file);
    if (result == ERR_OK)
        AppBeginProof();
    return result;
}

RTS_RESULT AppChange(const APP_IMAGE *image, APP_REFUSAL *refusal)
{
    RTS_RESULT result = check_state(image, refusal);

    if (result != ERR_OK)
        return result;
    result = AppEventAsk(EVT_PrepareOnlineChange, image);
    if (result != ERR_OK)
        result = APP_REFUSE(refusal, result, "%s.", AppTakeReason());
    else
        result = check_state(image, refusal); /* the program may have failed in its function for the event, or halted */
    if (result == ERR_OK)
        result = take_place(image, refusal);
    AppPostEvent(EVT_OnlineChangeDone);
    return result;
}

#endif
