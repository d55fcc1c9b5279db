/*
 * RetainTable.c - reads the table of kept variables in an image.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "RetainTable.h"

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
    const CDL_KEPT_RUN *run = &kept->run;
    RTS_UI64 begin = KeptOffset(kept);

    if (run->size == 0 || run->count == 0 || run->stride < run->size)
        return false;
    return begin + (RTS_UI64)(run->count - 1) * run->stride + run->size <= area_size;
}

RTS_RESULT RetainTableNext(RETAIN_TABLE *table, KEPT *kept)
{
    RTS_RESULT result;

    if (table->size == 0)
        return ERR_NO_OBJECT;
    result = read_part(table, &kept->variable, sizeof kept->variable);
    if (result != ERR_OK)
        return result;
    if ((kept->variable.place & CDL_KEPT_IS_RUN) != 0) {
        result = read_part(table, &kept->run, sizeof kept->run);
    } else {
        kept->run.size = kept->run.stride = (RTS_UI16)(1u << (kept->variable.place & CDL_KEPT_SHAPE));
        kept->run.count = 1;
        kept->run.first = 0;
    }
    if (result == ERR_OK && !fits(kept, table->area_size))
        result = ERR_OUT_OF_LIMITS;
    return result;
}
