/*
 * AppImage.c - the process image of each task: copies of inputs and outputs, and what goes back.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppImage.h"

#if APP_IMAGE_SIZE > 0

#include "AppAreas.h"
#include "SysAtomic.h"
#include "SysLock.h"

/* A unit of the areas, which IEC code sees as bytes. */
typedef RTS_UI64 __attribute__((may_alias)) UNIT;

RTS_STATIC_ASSERT(sizeof(UNIT) == CDL_IMAGE_UNIT, units_are_those_of_the_image);
RTS_STATIC_ASSERT(APP_IMAGE_SIZE / CDL_IMAGE_UNIT <= (IMAGE_INDEX)-1, copies_can_be_indexed);

/* One for each of APP_MAX_TASKS; NULL before the first application is loaded. */
static const TASK_IMAGE *plan;

/* ---- the plan ---- */

RTS_UI32 AppImagePlace(IMAGE_PART *part, const CDL_IMAGE *image, RTS_UI32 used)
{
    bool copied = APP_IMAGE_ALWAYS || (image->flags & CDL_IMAGE_SHARED) != 0;
    RTS_UI32 count = copied ? image->count : 0;

    part->first = (IMAGE_INDEX)image->first;
    part->count = (IMAGE_INDEX)count;
    part->copy = (IMAGE_INDEX)used;
    if (image->flags & CDL_IMAGE_WRITTEN)
        used += count;
    part->before = (IMAGE_INDEX)used;
    return used + count;
}

void AppImageAttach(const TASK_IMAGE *images)
{
    plan = images;
}

/* ---- places ---- */

static UNIT *copy_at(RTS_UI32 index)
{
    return (UNIT *)AppAreasGet(AREAS_COPIES) + index;
}

/* The base is where the area would begin if all of it were copied: only addresses within the part are ever used. */
bool AppImageSetContext(RTS_UI32 task, IEC_CONTEXT *context)
{
    bool copied = false;
    RTS_UI32 i;

    for (i = 0; i < IMAGE_AREAS; i++) {
        const IMAGE_PART *part = &plan[task].part[i];
        if (part->count == 0)
            continue;
        context->area[APP_AREA_INPUT + i] = (RTS_UI8 *)((uintptr_t)copy_at(part->copy) - part->first * sizeof(UNIT));
        copied = true;
    }
    return copied;
}

bool AppImageFind(uintptr_t address, RTS_UI32 *area, RTS_UI32 *offset)
{
    const IMAGE_PART *part = plan[0].part;
    RTS_UI32 i;

    for (i = 0; i < IMAGE_AREAS * APP_MAX_TASKS; i++, part++) {
        uintptr_t distance = address - (uintptr_t)copy_at(part->copy);
        if (distance < part->count * sizeof(UNIT)) {
            *area = APP_AREA_INPUT + i % IMAGE_AREAS;
            *offset = (RTS_UI32)(distance + part->first * sizeof(UNIT));
            return true;
        }
    }
    return false;
}

RTS_UI8 *AppImageGetCopy(RTS_UI32 task, RTS_UI32 area, RTS_UI32 offset, RTS_UI32 size)
{
    const IMAGE_PART *part = &plan[task].part[area - APP_AREA_INPUT];
    RTS_UI32 distance = offset - part->first * (RTS_UI32)sizeof(UNIT);
    RTS_UI32 length = part->count * (RTS_UI32)sizeof(UNIT);

    return distance < length && size <= length - distance ? (RTS_UI8 *)copy_at(part->copy) + distance : NULL;
}

/* ---- the cycle ---- */

static void copy_in(const IMAGE_PART *part, const UNIT *shared)
{
    UNIT *copy = copy_at(part->copy);
    UNIT *before = copy_at(part->before);
    RTS_UI32 count = part->count;

    if (count == 0)
        return;
    shared += part->first;
    do {
        *before++ = *copy++ = *shared++;
    } while (--count > 0);
}

void AppImageCopyIn(RTS_UI32 task)
{
    RTS_UI32 lock = SysLockEnter();

    copy_in(&plan[task].part[0], (const UNIT *)AppAreasGet(APP_AREA_INPUT));
    copy_in(&plan[task].part[1], (const UNIT *)AppAreasGet(APP_AREA_OUTPUT));
    SysLockLeave(lock);
}

static void copy_out(const IMAGE_PART *part, UNIT *shared)
{
    const UNIT *copy = copy_at(part->copy);
    const UNIT *before = copy_at(part->before);
    RTS_UI32 count = part->count;

    if (copy == before) /* it writes nothing of it, or there is nothing */
        return;
    shared += part->first;
    do {
        UNIT now = *copy++;
        UNIT changed = now ^ *before++;
        if (changed != 0)
            *shared = (*shared & ~changed) | (now & changed);
        shared++;
    } while (--count > 0);
}

void AppImageCopyOut(RTS_UI32 task, const RTS_UI32 *running)
{
    RTS_UI32 lock = SysLockEnter();

    if (SysAtomicLoad(running)) {
        copy_out(&plan[task].part[0], (UNIT *)AppAreasGet(APP_AREA_INPUT));
        copy_out(&plan[task].part[1], (UNIT *)AppAreasGet(APP_AREA_OUTPUT));
    }
    SysLockLeave(lock);
}

#endif
