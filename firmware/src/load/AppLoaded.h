/*
 * AppLoaded.h - what the runtime knows about an image that has passed all checks.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef APPLOADED_H
#define APPLOADED_H

#include "../cycle/AppImage.h"
#include "CmpIecAbi.h"
#include "CmpRetain.h"
#include "CompactDownload.h"
#include "rts_config.h"

#define IMAGE_NO_ENTRY 0xFFFFFFFFu
enum { IMAGE_INFO_COUNT = 5 };

/* What the header and the tables of an image say. */
typedef struct {
    RTS_UI32 file; /* FILE_SLOT_* */
    RTS_UI32 size;
    RTS_UI32 crc;
    CDL_SEGMENT code;
    CDL_SEGMENT info;
    RTS_UI32 area_size[APP_AREA_COUNT];
    RTS_UI32 entry[CDL_FUNCTION_COUNT]; /* offset in the code segment or IMAGE_NO_ENTRY */
    RETAIN_TABLE kept;
    RTS_UI32 tasks;   /* offset of the task records */
    RTS_UI32 imports; /* offset of the names of external functions */
    RTS_UI32 task_count;
    RTS_UI32 import_count;
#if IEC_EVENTS
    CDL_SEGMENT iec_functions;
#endif
#if IO_MAX_CONNECTORS > 0
    CDL_SEGMENT io; /* the I/O configuration, in the code; size 0: none */
#endif
#if ONLINE_CHANGE
    CDL_CHANGE change; /* not checked; size 0 and base 0: it cannot take the place of another one */
#endif
#if APP_IMAGE_SIZE > 0
    TASK_IMAGE task_image[APP_MAX_TASKS];
#endif
} APP_IMAGE;

/* What the tasks of an image need as long as they live. */
typedef struct {
    CDL_TASK tasks[APP_MAX_TASKS];
    RTS_PFN imports[APP_MAX_IMPORTS];
} APP_TABLES;

#endif
