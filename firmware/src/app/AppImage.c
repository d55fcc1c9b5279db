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

/* Words of the areas, which IEC code sees as bytes. */
typedef uintptr_t __attribute__((may_alias)) WORD;
enum { UNIT_WORDS = CDL_IMAGE_UNIT / IMAGE_WORD_SIZE };

RTS_STATIC_ASSERT(APP_IMAGE_SIZE / IMAGE_WORD_SIZE <= (IMAGE_INDEX)-1, copies_can_be_indexed);

/* One for each of APP_MAX_TASKS; NULL before the first application. */
static const TASK_IMAGE *plan;

/* ---- the plan ---- */

RTS_UI32 AppImagePlace(IMAGE_PART *part, const CDL_IMAGE *image, RTS_UI32 used)
{
    bool copied = APP_IMAGE_ALWAYS || (image->flags & CDL_IMAGE_SHARED) != 0;
    RTS_UI32 count = copied ? image->count * UNIT_WORDS : 0;

    part->first = (IMAGE_INDEX)(image->first * UNIT_WORDS);
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

static WORD *shared_of(const IMAGE_PART *part, RTS_UI32 area)
{
    return (WORD *)AppAreasGet(area) + part->first;
}

static WORD *copy_of(const IMAGE_PART *part)
{
    return (WORD *)AppAreasGet(AREAS_COPIES) + part->copy;
}

/* The base is where the area would begin if all of it were copied: only addresses within the part are ever used. */
void AppImageSetContext(RTS_UI32 task, IEC_CONTEXT *context)
{
    RTS_UI32 i;

    for (i = 0; i < IMAGE_AREAS; i++) {
        const IMAGE_PART *part = &plan[task].part[i];
        if (part->count != 0)
            context->area[APP_AREA_INPUT + i] =
                (RTS_UI8 *)((uintptr_t)copy_of(part) - (uintptr_t)part->first * IMAGE_WORD_SIZE);
    }
}

bool AppImageFind(uintptr_t address, RTS_UI32 *area, RTS_UI32 *offset)
{
    const IMAGE_PART *part = plan[0].part;
    RTS_UI32 i;

    for (i = 0; i < IMAGE_AREAS * APP_MAX_TASKS; i++, part++) {
        uintptr_t distance = address - (uintptr_t)copy_of(part);
        if (distance < (uintptr_t)part->count * IMAGE_WORD_SIZE) {
            *area = APP_AREA_INPUT + i % IMAGE_AREAS;
            *offset = (RTS_UI32)(distance + (uintptr_t)part->first * IMAGE_WORD_SIZE);
            return true;
        }
    }
    return false;
}

/* ---- the cycle ---- */

static void copy_in(WORD *copy, WORD *before, const WORD *shared, RTS_UI32 count)
{
    for (; count > 0; count--)
        *before++ = *copy++ = *shared++;
}

static void copy_out(const WORD *copy, const WORD *before, WORD *shared, RTS_UI32 count)
{
    for (; count > 0; count--, shared++) {
        WORD now = *copy++;
        WORD changed = now ^ *before++;
        if (changed != 0)
            *shared ^= (*shared ^ now) & changed;
    }
}

void AppImageCopy(RTS_UI32 task, const RTS_UI32 *running)
{
    const IMAGE_PART *part = plan[task].part;
    RTS_UI32 lock;
    RTS_UI32 i;

    if ((part[0].count | part[1].count) == 0)
        return;
    lock = SysLockEnter();
    for (i = 0; i < IMAGE_AREAS; i++, part++) {
        WORD *copy = copy_of(part);
        WORD *before = copy + part->before - part->copy;
        WORD *shared = shared_of(part, APP_AREA_INPUT + i);
        if (running == NULL)
            copy_in(copy, before, shared, part->count);
        else if (copy != before && SysAtomicLoad(running))
            copy_out(copy, before, shared, part->count);
    }
    SysLockLeave(lock);
}

#endif
