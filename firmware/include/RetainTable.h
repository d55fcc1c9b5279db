/*
 * RetainTable.h - reads the table of kept variables in an image.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RETAINTABLE_H
#define RETAINTABLE_H

#include "CmpErrors.h"
#include "CmpStd.h"
#include "CompactDownload.h"

/* Where in flash the table of kept variables of an image is (CDL_KEPT), and how large its retain area. */
typedef struct {
    RTS_UI32 file;
    RTS_UI32 offset;
    RTS_UI32 size;      /* of the table in bytes, 0: nothing is kept */
    RTS_UI32 area_size; /* bytes */
} RETAIN_TABLE;

/* An entry; of a single variable `run` says that it is one of its size. */
typedef struct {
    CDL_KEPT variable;
    CDL_KEPT_RUN run;
} KEPT;

/* Reads the next entry; *table becomes what remains. ERR_NO_OBJECT at the end, ERR_OUT_OF_LIMITS when the entry is cut
 * off or is not in the retain area, or an error of the flash. */
RTS_RESULT RetainTableNext(RETAIN_TABLE *table, KEPT *kept);

/* Of the first element in the retain area, bytes. */
static inline RTS_UI32 KeptOffset(const KEPT *kept)
{
    return kept->variable.place >> CDL_KEPT_OFFSET_SHIFT;
}

#endif
