/*
 * RetainTable.h - reads the table of kept variables in an image.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef RETAINTABLE_H
#define RETAINTABLE_H

#include "CmpRetain.h"
#include "CompactDownload.h"

/* An entry: elements of an array, or a variable as an array of one. */
typedef struct {
    RTS_UI8 hash[CDL_KEPT_HASH_SIZE];
    bool persistent;
    RTS_UI32 offset; /* of the first element in the retain area */
    RTS_UI32 size;   /* of an element, bytes */
    RTS_UI32 text;   /* bytes of a character, 0: no text */
    RTS_UI32 stride; /* from one element to the next, bytes */
    RTS_UI32 count;
    RTS_I32 first; /* index of the first element */
} KEPT;

/* Reads the next entry; *table becomes the rest. ERR_NO_OBJECT at the end, ERR_OUT_OF_LIMITS when the entry is cut off
 * or does not lie in the retain area, or an error of the flash. */
RTS_RESULT RetainTableNext(RETAIN_TABLE *table, KEPT *kept);

#endif
