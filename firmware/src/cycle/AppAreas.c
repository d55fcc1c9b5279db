/*
 * AppAreas.c - the RAM of the application.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppAreas.h"

#include <string.h>

#include "AppIo.h"
#include "CmpErrors.h"
#include "SysLock.h"
#include "SysMem.h"
#include "rts_config.h"

/* An area in words, 8-aligned for the largest IEC type; at least one word. */
#define WORDS(size) (((size) + sizeof(RTS_I64) - 1) / sizeof(RTS_I64) + ((size) == 0))

typedef struct {
    RTS_I64 data[WORDS(APP_DATA_SIZE)];
    RTS_I64 input[WORDS(APP_INPUT_SIZE)];
    RTS_I64 output[WORDS(APP_OUTPUT_SIZE)];
    RTS_I64 memory[WORDS(APP_MEMORY_SIZE)];
    RTS_I64 copies[WORDS(APP_IMAGE_SIZE)]; /* of inputs and outputs */
    RTS_I64 retain[WORDS(APP_RETAIN_SIZE)];
} AREAS;

typedef struct {
    AREAS all;
} APP_AREAS_ALIGNED(sizeof(AREAS)) PLACED;

#if APP_AREAS_FROM_PORT
static PLACED *areas_of_port;
#define areas (*areas_of_port)

RTS_RESULT AppAreasInit(void)
{
    areas_of_port = SysMemAllocArea(sizeof areas);
    return areas_of_port != NULL ? ERR_OK : ERR_NOMEMORY;
}
#else
static PLACED areas APP_AREAS_SECTION;
#endif

void AppAreasClear(void)
{
    memset(&areas, 0, sizeof areas);
}

#if IO_MAX_CONNECTORS > 0
/* Part by part, so that the mask is small. Without lock, since the manager looks at all channels for each. */
static void clear_what_is_not_kept(void)
{
    RTS_UI8 *outputs = (RTS_UI8 *)areas.all.output;
    RTS_UI8 kept[32];
    RTS_UI32 at;
    RTS_UI32 i;

    for (at = 0; at < APP_OUTPUT_SIZE; at += i) {
        RTS_UI32 size = APP_OUTPUT_SIZE - at < sizeof kept ? APP_OUTPUT_SIZE - at : sizeof kept;
        memset(kept, 0, sizeof kept);
        AppIoGet()->get_kept(at, kept, size);
        for (i = 0; i < size; i++)
            outputs[at + i] &= kept[i];
    }
}
#else
#define clear_what_is_not_kept() ((void)0)
#endif

/* A task that copies its outputs back meanwhile is before or after; none does when no cycle may start any more. */
void AppAreasClearOutputs(void)
{
    RTS_UI32 lock = SysLockEnter();

    if (AppIoGet() == NULL)
        memset(areas.all.output, 0, sizeof areas.all.output);
    SysLockLeave(lock);
    if (AppIoGet() != NULL)
        clear_what_is_not_kept();
}

RTS_UI8 *AppAreasGet(RTS_UI32 area)
{
    static const RTS_UI32 offsets[] = {
        offsetof(AREAS, data),   offsetof(AREAS, retain), offsetof(AREAS, input),
        offsetof(AREAS, output), offsetof(AREAS, memory), offsetof(AREAS, copies),
    };

    return (RTS_UI8 *)&areas + offsets[area];
}

void AppAreasSet(IEC_CONTEXT *context)
{
    RTS_UI32 i;

    for (i = 0; i < APP_AREA_CODE; i++)
        context->area[i] = AppAreasGet(i);
}
