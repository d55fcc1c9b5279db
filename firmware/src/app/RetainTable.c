/*
 * RetainTable.c - reads the table of kept variables in an image.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "RetainTable.h"

#include <string.h>

#include "SysFileFlash.h"

static RTS_RESULT read_part(RETAIN_TABLE *table, void *data, RTS_UI32 size)
{
    RTS_UI32 offset = table->offset;

    if (size > table->size)
        return ERR_OUT_OF_LIMITS;
    table->offset += size;
    table->size -= size;
    return SysFileRead(table->file, offset, data, size);
}

static bool fits(const KEPT *kept, RTS_UI32 area_size)
{
    RTS_UI32 last = area_size - kept->size; /* where an element may begin */

    if (kept->size == 0 || kept->size < kept->text || kept->size > area_size || kept->offset > last)
        return false;
    if (kept->count == 0 || kept->stride < kept->size)
        return false;
    return (RTS_UI64)(kept->count - 1) * kept->stride <= last - kept->offset;
}

RTS_RESULT RetainTableNext(RETAIN_TABLE *table, KEPT *kept)
{
    CDL_KEPT_RUN run = {0, 0, 1, 0};
    CDL_KEPT entry;
    RTS_UI32 shape;
    RTS_RESULT result;

    if (table->size == 0)
        return ERR_NO_OBJECT;
    result = read_part(table, &entry, sizeof entry);
    if (result != ERR_OK)
        return result;
    shape = entry.place & CDL_KEPT_SHAPE;
    kept->text = 0;
    if ((entry.place & CDL_KEPT_IS_RUN) != 0) {
        result = read_part(table, &run, sizeof run);
        kept->text = shape;
    } else {
        run.size = run.stride = (RTS_UI16)(1u << shape);
    }
    memcpy(kept->hash, entry.hash, sizeof kept->hash);
    kept->persistent = (entry.place & CDL_KEPT_PERSISTENT) != 0;
    kept->offset = entry.place >> CDL_KEPT_OFFSET_SHIFT;
    kept->size = run.size;
    kept->stride = run.stride;
    kept->count = run.count;
    kept->first = run.first;
    if (result != ERR_OK)
        return result;
    return fits(kept, table->area_size) ? ERR_OK : (RTS_RESULT)ERR_OUT_OF_LIMITS;
}
