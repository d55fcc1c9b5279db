/*
 * AppAreas.c - the RAM of the application.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppAreas.h"

#include <string.h>

#include "rts_config.h"

/* An area in words, 8-aligned for the largest IEC type; at least one word. */
#define WORDS(size) (((size) + sizeof(RTS_I64) - 1) / sizeof(RTS_I64) + ((size) == 0))

static struct areas {
    RTS_I64 data[WORDS(APP_DATA_SIZE)];
    RTS_I64 input[WORDS(APP_INPUT_SIZE)];
    RTS_I64 output[WORDS(APP_OUTPUT_SIZE)];
    RTS_I64 memory[WORDS(APP_MEMORY_SIZE)];
    RTS_I64 retain[WORDS(APP_RETAIN_SIZE)];
} areas;

void AppAreasClear(void)
{
    memset(&areas, 0, sizeof areas);
}

void AppAreasClearOutputs(void)
{
    memset(areas.output, 0, sizeof areas.output);
}

void AppAreasSet(IEC_CONTEXT *context)
{
    context->area[APP_AREA_DATA] = (RTS_UI8 *)areas.data;
    context->area[APP_AREA_RETAIN] = (RTS_UI8 *)areas.retain;
    context->area[APP_AREA_INPUT] = (RTS_UI8 *)areas.input;
    context->area[APP_AREA_OUTPUT] = (RTS_UI8 *)areas.output;
    context->area[APP_AREA_MEMORY] = (RTS_UI8 *)areas.memory;
}
