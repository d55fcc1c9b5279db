/*
 * AppTasks.c - checks the blobs of an image: tasks, kept variables.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppTasks.h"

#include <string.h>

#include "AppIo.h"
#include "IoConfigCheck.h"
#include "RetainTable.h"
#include "SchedEvents.h"

RTS_RESULT AppTasksCheckEvent(const CDL_TASK *task, APP_REFUSAL *refusal)
{
    if (task->kind != KIND_EXTERNAL || SchedHasExternalEvent(task->event_offset))
        return ERR_OK;
    return APP_REFUSE(refusal, ERR_NO_OBJECT, "Task %s waits for an event that nothing posts.", task->name);
}

#if IO_MAX_CONNECTORS > 0
RTS_RESULT LoaderCheckEvents(LOADER *l)
{
    RTS_UI32 count = l->image->io.size == 0 ? l->image->task_count : 0;
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    for (i = 0; i < count && result == ERR_OK; i++) {
        CDL_TASK task;
        result = LoaderRead(l, l->image->tasks + i * (RTS_UI32)sizeof task, &task, sizeof task);
        if (result == ERR_OK)
            result = AppTasksCheckEvent(&task, l->refusal);
    }
    return result;
}
#endif

static RTS_RESULT check_task(LOADER *l, const CDL_TASK *task)
{
    const char *name = task->name;

    if (name[0] == '\0' || memchr(name, '\0', sizeof task->name) == NULL)
        return refuse(l, ERR_PARAMETER, "Task %u has no name.", U(l->image->task_count));
    if (task->kind > (SCHED_LEVEL_EVENTS ? KIND_LEVEL : KIND_FREEWHEELING))
        return refuse(l, ERR_NOT_SUPPORTED, "Task %s has the unknown kind %u.", name, U(task->kind));
    if (task->priority > CDL_PRIORITY_LOWEST)
        return refuse(l, ERR_OUT_OF_LIMITS, "Task %s has priority %u, above 31.", name, U(task->priority));
    if (task->kind == KIND_CYCLIC && task->interval_us == 0)
        return refuse(l, ERR_PARAMETER, "Cyclic task %s has no interval.", name);
    if (task->entry_offset >= l->image->code.size)
        return refuse(l, ERR_INVALID_REFERENCE, "Task %s is outside the code.", name);
    if (SCHED_WAITS_FOR_VARIABLE(task->kind) &&
        (task->event_area >= APP_AREA_CODE || task->event_offset >= l->image->area_size[task->event_area]))
        return refuse(l, ERR_INVALID_REFERENCE, "Event of task %s is outside its area.", name);
    /* A driver may post the event, which is known after all blobs have been read (LoaderCheckEvents). */
    return IO_MAX_CONNECTORS > 0 ? (RTS_RESULT)ERR_OK : AppTasksCheckEvent(task, l->refusal);
}

static RTS_RESULT check_tasks(LOADER *l, RTS_UI32 size)
{
    RTS_UI32 count = size / (RTS_UI32)sizeof(CDL_TASK);
    CDL_TASK task;
    RTS_RESULT result = ERR_OK;

    if (l->image->task_count != 0)
        return refuse(l, ERR_DUPLICATE, "The image has two lists of tasks.");
    if (count * sizeof(CDL_TASK) != size)
        return refuse(l, ERR_SIZE_MISMATCH, "Task list of %u bytes has a part of an entry.", U(size));
    if (count > APP_MAX_TASKS)
        return refuse(l, ERR_NOMEMORY, "The application has %u tasks, this device can run %u.", U(count),
                      U(APP_MAX_TASKS));
    l->image->tasks = l->offset;
    for (; l->image->task_count < count && result == ERR_OK; l->image->task_count++) {
        result = LoaderReadNext(l, &task, sizeof task);
        if (result == ERR_OK)
            result = check_task(l, &task);
    }
    return result;
}

/* Of two tables the last one counts. Values of variables that are out of order are not found, which does no harm. */
static RTS_RESULT check_kept(LOADER *l, RTS_UI32 size)
{
    RETAIN_TABLE table;
    KEPT kept;
    RTS_UI32 number = 0;
    RTS_RESULT result;

    l->image->kept.offset = l->offset;
    l->image->kept.size = size;
    table = l->image->kept;
    while ((result = RetainTableNext(&table, &kept)) == ERR_OK)
        number++;
    return result == ERR_NO_OBJECT ? ERR_OK
                                   : refuse(l, result, "Kept variable %u is out of place; build again.", U(number));
}

#if APP_IMAGE_SIZE > 0
/* After the list of tasks: what each of them uses of inputs and outputs. */
static RTS_RESULT check_images(LOADER *l, RTS_UI32 size)
{
    IMAGE_PART *part = l->image->task_image[0].part;
    const IMAGE_PART *end = part + IMAGE_AREAS * l->image->task_count;
    const RTS_UI32 *area_size = &l->image->area_size[APP_AREA_INPUT];
    RTS_UI32 used = 0;
    CDL_IMAGE image;
    RTS_UI32 i;

    for (i = 0; part < end && size >= sizeof image; i ^= 1, size -= (RTS_UI32)sizeof image) {
        RTS_RESULT result = LoaderReadNext(l, &image, sizeof image);
        if (result != ERR_OK)
            return result;
        used = AppImagePlace(part++, &image, used);
        if ((image.first + image.count) * CDL_IMAGE_UNIT >= area_size[i] + CDL_IMAGE_UNIT)
            used = IMAGE_TOO_LARGE;
    }
    if (used > APP_IMAGE_SIZE / CDL_IMAGE_UNIT)
        return refuse(l, ERR_NOMEMORY, "The %s area needs %u bytes, this device has %u.", "process image",
                      U(used * CDL_IMAGE_UNIT), U(APP_IMAGE_SIZE));
    return ERR_OK;
}
#else
static RTS_RESULT check_images(const LOADER *l, RTS_UI32 size)
{
    RTS_UNUSED(l);
    RTS_UNUSED(size);
    return ERR_OK;
}
#endif

#if ONLINE_CHANGE
/* What it says is checked when it is to be done (AppChange.c): a start takes no notice of it. */
#define read_change(l) LoaderReadNext(l, &(l)->image->change, sizeof(CDL_CHANGE))
#else
#define read_change(l) ((RTS_RESULT)ERR_OK)
#endif

static RTS_RESULT check_blob(LOADER *l)
{
    CDL_BLOB blob;
    RTS_UI32 next;
    RTS_RESULT result = LoaderReadNext(l, &blob, sizeof blob);

    if (result != ERR_OK)
        return result;
    if (blob.magic != CDL_BLOB_MAGIC)
        return refuse(l, ERR_TYPE_MISMATCH, "There is no blob at offset %u.", U(l->offset - sizeof blob));
    if (blob.size > l->end - l->offset)
        return refuse(l, ERR_OUT_OF_LIMITS, "Blob %u ends beyond its segment.", U(blob.id));
    next = LoaderAlign(l->offset + blob.size);
    if (blob.id == CDL_BLOB_TASKS)
        result = check_tasks(l, blob.size);
    else if (blob.id == CDL_BLOB_RETAIN && APP_RETAIN_SIZE > 0)
        result = check_kept(l, blob.size);
    else if (blob.id == CDL_BLOB_IMAGES)
        result = check_images(l, blob.size);
    else if (ONLINE_CHANGE && blob.id == CDL_BLOB_CHANGE && blob.size == sizeof(CDL_CHANGE))
        result = read_change(l);
    else if (blob.id == CDL_BLOB_IO && AppIoGet() != NULL)
        result = LoaderFindIo(l, blob.size);
    else if (blob.id >= CDL_BLOB_REQUIRED)
        return refuse(l, ERR_NOT_SUPPORTED, "The application needs what this firmware lacks (0x%X).", U(blob.id));
    /* Others are of a newer tool, and not needed to run. */
    l->offset = next;
    return result;
}

RTS_RESULT LoaderCheckBlobs(LOADER *l)
{
    RTS_RESULT result;

    l->image->kept.file = l->image->file;
    l->image->kept.area_size = l->image->area_size[APP_AREA_RETAIN];
    result = LoaderCheckEntries(l, SEGMENT_BLOBS, check_blob);
    if (result == ERR_OK && l->image->task_count == 0)
        return refuse(l, ERR_NO_OBJECT, "The application has no task.");
    return result;
}
