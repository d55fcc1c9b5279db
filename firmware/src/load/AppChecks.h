/*
 * AppChecks.h - what the checks of an image share. From main only.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * AppLoader.c checks header and areas, AppFunctions.c what is called, AppTasks.c the tasks.
 */
#ifndef APPCHECKS_H
#define APPCHECKS_H

#include "AppLoaded.h"
#include "AppRefusal.h"
#include "CmpErrors.h"

/* The segments of an image. */
enum {
    SEGMENT_CODE,
    SEGMENT_INFO,
    SEGMENT_AREAS,
    SEGMENT_FUNCTIONS,
    SEGMENT_IMPORTS,
    SEGMENT_IEC_FUNCTIONS,
    SEGMENT_BLOBS,
    SEGMENT_COUNT
};

typedef struct {
    APP_IMAGE *image;
    APP_REFUSAL *refusal;
    CDL_HEADER header;
    RTS_UI32 segment; /* SEGMENT_*: the one that is read now */
    RTS_UI32 offset;  /* of its next entry */
    RTS_UI32 end;
    RTS_UI32 areas_seen;   /* a bit for each */
    RTS_RESULT unresolved; /* the error of the first bad import */
} LOADER;

/* Returns ERR_OK, or refuses. */
typedef RTS_RESULT (*CHECK)(LOADER *l);

#define U(value) ((unsigned)(value))
#define refuse(l, result, ...) APP_REFUSE((l)->refusal, result, __VA_ARGS__)

/* Entries of tables start at multiples of 4. */
RTS_UI32 LoaderAlign(RTS_UI32 offset);

/* Reads anything of the image. */
RTS_RESULT LoaderRead(LOADER *l, RTS_UI32 offset, void *data, RTS_UI32 size);

/* From here on LoaderReadNext reads this segment. */
void LoaderOpen(LOADER *l, RTS_UI32 segment);
RTS_RESULT LoaderReadNext(LOADER *l, void *data, RTS_UI32 size);

/* Has every entry of a segment checked by `check_entry`, which reads it. */
RTS_RESULT LoaderCheckEntries(LOADER *l, RTS_UI32 segment, CHECK check_entry);

/* Whether all segments are within the image. */
RTS_RESULT LoaderCheckSegments(LOADER *l);

/* Whether a reference leads into the code segment. */
bool LoaderIsCode(const LOADER *l, RTS_UI32 area, RTS_UI32 offset);

#endif
