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
#include "../load/AppTasks.h"
#include "AppAddress.h"
#include "AppCommit.h"
#include "AppEvents.h"
#include "AppIo.h"
#include "AppLife.h"
#include "AppReason.h"
#include "AppState.h"
#include "CmpAppBP.h"
#include "CmpIecTask.h"
#include "CmpLog.h"
#include "CmpRetain.h"
#include "IecCycle.h"
#include "SysFlash.h"
#include "SysTime.h"

#define U(value) ((unsigned)(value))
#define NS_PER_US 1000u

/* On the stack of main: the tables are of the image that is to run next. */
typedef struct {
    const APP_IMAGE *image;
    const RTS_UI8 *code;
    APP_TABLES tables;
    APP_IMAGE old;
    const RTS_UI8 *old_code;
    RTS_UI32 led;          /* steps, from the first one, that say where pointers lead on */
    AREA_ADDRESS dangling; /* the first pointer to something that is gone */
    AREA_ADDRESS gone;     /* that */
    bool dangles;
    bool fails;         /* the program that ran, before the exchange */
    RTS_UI32 exception; /* of what initialises */
    RTS_UI32 pause_ns;  /* how long no task could begin a cycle */
} CHANGE;

/* ---- steps ---- */

static const CDL_CHANGE_STEP *first_step(const CHANGE *change)
{
    return (const CDL_CHANGE_STEP *)(const void *)(change->code + change->image->change.offset);
}

/* What a kind of step has. */
enum {
    IS_COPIED = 1,
    IS_LED = 2, /* pointers lead on by it */
    IS_POINTERS = 4,
    IS_FROM = 8, /* a place in the image that runs */
    IS_TO = 16,  /* a place in the one that is to run next */
};
static const RTS_UI8 traits[] = {
    IS_COPIED | IS_LED | IS_FROM | IS_TO, /* MOVE */
    IS_LED | IS_FROM | IS_TO,             /* FOLLOW */
    IS_LED | IS_FROM,                     /* GONE */
    IS_POINTERS | IS_FROM,                /* LEAD */
    IS_POINTERS | IS_FROM,                /* FORGET */
    IS_COPIED | IS_FROM | IS_TO,          /* COPY */
    IS_TO,                                /* CLEAR */
    IS_TO,                                /* PUT */
    IS_TO,                                /* SIGN */
};

static bool has(const CDL_CHANGE_STEP *step, RTS_UI32 trait)
{
    return (traits[step->kind] & trait) != 0;
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
    RTS_UI32 area = step->from_area;

    if (step->kind > CDL_CHANGE_SIGN || data_size(step) > left)
        return false;
    if (step->kind == CDL_CHANGE_FOLLOW)
        area &= ~(RTS_UI32)CDL_CHANGE_OBJECTS;
    if (has(step, IS_FROM) && !is_in_area(&change->old, area, step->from, step->size))
        return false;
    if (has(step, IS_TO))
        return is_in_area(change->image, step->area, step->to, step->size) &&
               (step->kind != CDL_CHANGE_SIGN || step->to > 0);
    return !has(step, IS_POINTERS) ||
           (step->to >= APP_POINTER_SIZE && (step->area & ~(RTS_UI32)CDL_CHANGE_OBJECTS) == 0);
}

/* True if a step that leads pointers on is after the previous one. */
static bool is_in_order(const CHANGE *change, const CDL_CHANGE_STEP *step)
{
    const CDL_CHANGE_STEP *last = step - 1;

    if (step != first_step(change) + change->led)
        return false;
    return change->led == 0 || last->from_area < step->from_area ||
           (last->from_area == step->from_area && last->from + last->size <= step->from);
}

/* Each step within its area and the code. */
static bool are_steps(CHANGE *change)
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
        if (has(step, IS_LED)) {
            if (!is_in_order(change, step))
                return false;
            change->led++;
        }
        left -= (RTS_UI32)sizeof *step + data_size(step);
    }
    return true;
}

/* ---- pointers ---- */

static RTS_UI8 *source_of(const CDL_CHANGE_STEP *step)
{
    return AppAreasGet(step->from_area & ~(RTS_UI32)CDL_CHANGE_OBJECTS) + step->from;
}

static RTS_UI8 *target_of(const CDL_CHANGE_STEP *step)
{
    return AppAreasGet(step->area) + step->to;
}

/* Returns the step whose part of the image that ran a pointer leads to; NULL: none. */
static const CDL_CHANGE_STEP *find_step(const CHANGE *change, RTS_UI32 area, RTS_UI32 offset)
{
    const CDL_CHANGE_STEP *steps = first_step(change);
    RTS_UI32 low = 0;
    RTS_UI32 high = change->led;

    while (low < high) {
        RTS_UI32 middle = (low + high) / 2;
        const CDL_CHANGE_STEP *step = &steps[middle];
        if (step->from_area < area || (step->from_area == area && step->from + step->size <= offset))
            low = middle + 1;
        else
            high = middle;
    }
    return low < change->led && steps[low].from_area == area && steps[low].from <= offset ? &steps[low] : NULL;
}

/* Finds what a pointer leads to, and its step. `objects`: CDL_CHANGE_OBJECTS for a pointer to an instance. From `begin`,
 * before the image that runs is another one. */
static const CDL_CHANGE_STEP *follow(const CHANGE *change, uintptr_t pointer, RTS_UI32 objects, AREA_ADDRESS *address)
{
    const CDL_CHANGE_STEP *step = NULL;

    if (!AppFindArea(pointer, &address->area, &address->offset))
        address->area = APP_AREA_NONE;
    if (objects != 0)
        step = find_step(change, address->area | objects, address->offset);
    return step != NULL ? step : find_step(change, address->area, address->offset);
}

/* Returns where a pointer is to lead. 0: nowhere, or to what is gone. */
static uintptr_t lead_on(const CHANGE *change, uintptr_t pointer, RTS_UI32 objects, AREA_ADDRESS *address)
{
    const CDL_CHANGE_STEP *step = follow(change, pointer, objects, address);

    if (address->area == APP_AREA_CODE || (step != NULL && step->kind == CDL_CHANGE_GONE))
        return 0;
    return step == NULL ? pointer : pointer - (uintptr_t)source_of(step) + (uintptr_t)target_of(step);
}

/* Returns where a pointer led before. The areas may be anywhere in memory, so it is compared with the places that they
 * have. */
static uintptr_t lead_back(const CHANGE *change, uintptr_t pointer, RTS_UI32 objects)
{
    const CDL_CHANGE_STEP *step = first_step(change);
    const CDL_CHANGE_STEP *end = step + change->led;
    uintptr_t found = pointer;

    for (; step < end; step++) {
        RTS_UI32 own = step->from_area & CDL_CHANGE_OBJECTS;
        uintptr_t distance = pointer - (uintptr_t)target_of(step);
        if (step->kind == CDL_CHANGE_GONE || distance >= step->size || (own & ~objects) != 0)
            continue;
        found = (uintptr_t)source_of(step) + distance;
        if (own == objects)
            break;
    }
    return found;
}

/* ---- what steps do ---- */

typedef enum { WRITE, WRITE_BACK, CHECK_POINTERS, LEAD_ON, LEAD_BACK } WORK;

static void note_dangling(CHANGE *change, const CDL_CHANGE_STEP *step, const RTS_UI8 *at, const AREA_ADDRESS *gone)
{
    if (step->kind == CDL_CHANGE_FORGET || change->dangles)
        return;
    change->dangles = true;
    change->gone = *gone;
    change->dangling.area = step->from_area;
    change->dangling.offset = (RTS_UI32)(at - AppAreasGet(step->from_area));
}

static void handle_pointer(CHANGE *change, const CDL_CHANGE_STEP *step, RTS_UI8 *at, WORK work)
{
    AREA_ADDRESS address;
    uintptr_t pointer;
    uintptr_t led;

    memcpy(&pointer, at, sizeof pointer);
    led = work == LEAD_BACK ? lead_back(change, pointer, step->area) : lead_on(change, pointer, step->area, &address);
    if (work != CHECK_POINTERS)
        memcpy(at, &led, sizeof led);
    else if (led == 0 && pointer != 0)
        note_dangling(change, step, at, &address);
}

static void handle_pointers(CHANGE *change, const CDL_CHANGE_STEP *step, WORK work)
{
    RTS_UI32 at;

    for (at = 0; at < step->size && step->size - at >= APP_POINTER_SIZE; at += step->to) {
        handle_pointer(change, step, source_of(step) + at, work);
        if (step->size - at < step->to)
            break;
    }
}

static void write_step(const CDL_CHANGE_STEP *step)
{
    RTS_UI8 *to = target_of(step);

    if (has(step, IS_COPIED))
        memmove(to, source_of(step), step->size);
    else if (step->kind == CDL_CHANGE_PUT)
        memcpy(to, step + 1, step->size);
    else if (step->kind >= CDL_CHANGE_CLEAR)
        memset(to, step->kind == CDL_CHANGE_SIGN && (to[-1] & 0x80) != 0 ? 0xFF : 0, step->size);
}

static void for_steps(CHANGE *change, WORK work)
{
    const CDL_CHANGE_STEP *step = first_step(change);
    const RTS_UI8 *end = (const RTS_UI8 *)step + change->image->change.size;

    for (; (const RTS_UI8 *)step < end; step = next_step(step)) {
        if (has(step, IS_POINTERS) && work >= CHECK_POINTERS)
            handle_pointers(change, step, work);
        else if (work == WRITE && has(step, IS_TO))
            write_step(step);
        else if (work == WRITE_BACK && has(step, IS_COPIED))
            memmove(source_of(step), target_of(step), step->size);
    }
}

/* ---- checks ---- */

static RTS_RESULT check_state(const APP_IMAGE *image, APP_REFUSAL *refusal)
{
    AppHandlePendingException();
    if (AppGetState() == AS_NONE || !AppIsInitialised() || AppHasException())
        return APP_REFUSE(refusal, ERR_INVALID_STATE, "No program runs; download one.");
#if BP_MAX > 0
    if (AppBpIsHalted())
        return APP_REFUSE(refusal, ERR_INVALID_STATE, "A debugger has halted the program; let it go on first.");
#endif
    if (image->change.base != AppGetImage()->crc)
        return APP_REFUSE(refusal, ERR_ID_MISMATCH, "The change is of program %X, but %X runs; build it again.",
                          U(image->change.base), U(AppGetImage()->crc));
    return ERR_OK;
}

/* An event that nothing posts. That of a driver is known, since its connectors stay the same. */
static RTS_RESULT check_tasks(const CHANGE *change, APP_REFUSAL *refusal)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    for (i = 0; i < change->image->task_count && result == ERR_OK; i++)
        result = AppTasksCheckEvent(&change->tables.tasks[i], refusal);
    return result;
}

#if IO_MAX_CONNECTORS > 0
static RTS_RESULT check_io(const CHANGE *change, APP_REFUSAL *refusal)
{
    const CDL_SEGMENT *io = &change->image->io;

    if (io->size == 0 && change->old.io.size == 0)
        return ERR_OK;
    if (io->size == 0 || change->old.io.size == 0)
        return APP_REFUSE(refusal, ERR_NOT_SUPPORTED, "The I/O configuration has changed; download the program.");
    return AppIoGet()->check_change((const IO_CONFIG *)(const void *)(change->code + io->offset), refusal);
}
#else
#define check_io(change, refusal) ((RTS_RESULT)ERR_OK)
#endif

static RTS_RESULT check_all(CHANGE *change, APP_REFUSAL *refusal)
{
    RTS_RESULT result = check_io(change, refusal);

    if (result != ERR_OK)
        return result;
    if (!are_steps(change))
        return APP_REFUSE(refusal, ERR_OUT_OF_LIMITS, "The steps of the change are damaged; build it again.");
    return check_tasks(change, refusal);
}

/* ---- the exchange ---- */

/* True if a task has failed and main does not know it yet: that is charged to the program that is loaded now. */
static bool has_failed(void)
{
    return AppGetState() == AS_RUN && !IecCycleMayRun();
}

/* No task is in its cycle. Pointers lead on where they were, before what they are in is moved. */
static bool begin(void *arg)
{
    CHANGE *change = arg;
    RTS_I64 start_ns = SysTimeGetNs();

    change->fails = has_failed();
    if (!change->fails)
        for_steps(change, CHECK_POINTERS);
    if (change->fails || change->dangles)
        return false;
    for_steps(change, LEAD_ON);
    for_steps(change, WRITE);
    AppExchange(change->image, change->code, &change->tables);
    change->pause_ns = (RTS_UI32)(SysTimeGetNs() - start_ns);
    return true;
}

static bool go_back(void *arg)
{
    CHANGE *change = arg;

    for_steps(change, WRITE_BACK);
    for_steps(change, LEAD_BACK);
    AppExchange(&change->old, change->old_code, &change->tables);
    return true;
}

static bool go_back_in_moment(void *arg)
{
    return !has_failed() && go_back(arg);
}

/* The previous program goes on, with its tasks. */
static void take_back(CHANGE *change)
{
    const CYCLE_EXCHANGE moment = {go_back_in_moment, NULL, change};
    RTS_RESULT result = AppLoaderRead(&change->old, &change->tables);
    RTS_UI32 kept = AppFindKeptTasks(&change->old, &change->tables);

    if (result != ERR_OK)
        return;
    while ((result = IecTaskExchange(&moment, kept)) == ERR_TIMEOUT || result == ERR_FAILED)
        AppHandlePendingException();
    if (result != ERR_OK)
        (void)AppStopTasks();
}

/* Calculated initial values, and FB_Init, of new variables. */
static bool initialise(void *arg)
{
    CHANGE *change = arg;
    bool done = AppRunInit(change->image->change.init, &change->exception);

    if (!done && AppLoaderRead(&change->old, &change->tables) == ERR_OK)
        (void)go_back(change);
    return done;
}

static RTS_RESULT exchange(CHANGE *change, APP_REFUSAL *refusal)
{
    bool has_init = change->image->change.init != CDL_CHANGE_NO_INIT;
    const CYCLE_EXCHANGE moment = {begin, has_init ? initialise : NULL, change};
    RTS_RESULT result = IecTaskExchange(&moment, AppFindKeptTasks(change->image, &change->tables));

    if (result == ERR_NOMEMORY) {
        take_back(change);
        return APP_REFUSE(refusal, result, "There are not enough timers for the tasks.");
    }
    if (result == ERR_TIMEOUT)
        return APP_REFUSE(refusal, result, "A task takes too long for its cycle; try again.");
    if (change->fails)
        return APP_REFUSE(refusal, ERR_INVALID_STATE, "The program has failed; see its log.");
    if (change->dangles)
        return APP_REFUSE(refusal, ERR_INVALID_REFERENCE,
                          "A pointer (area %u, %u) leads to what is removed (area %u, %u).", U(change->dangling.area),
                          U(change->dangling.offset), U(change->gone.area), U(change->gone.offset));
    if (result != ERR_OK)
        return APP_REFUSE(refusal, result, "The initial values of new variables failed (exception 0x%X).",
                          U(change->exception));
    return ERR_OK;
}

/* The record of the retain variables is there before the image is what boots. */
static RTS_RESULT commit(CHANGE *change, RTS_UI32 retain_after, APP_REFUSAL *refusal)
{
    RTS_RESULT result;

    RetainKeepNone(); /* of the application that was in this slot */
    RetainKeep(retain_after);
    result = RetainSaveExchanged();
    if (result == ERR_OK)
        result = AppCommitInstall(change->image->file, change->image->crc, retain_after);
    if (result == ERR_OK)
        return ERR_OK;
    take_back(change);
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
    if (result == ERR_OK) {
        LogAdd(CMPID_CmpAppEmbedded, LOG_INFO, ERR_OK, "Tasks waited %u us for the exchange",
               U(change.pause_ns / NS_PER_US));
        AppBeginProof();
    }
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
