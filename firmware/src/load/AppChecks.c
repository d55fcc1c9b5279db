/*
 * AppChecks.c - reads an image segment by segment for its checks.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppChecks.h"

#include "SysFileFlash.h"

RTS_RESULT LoaderRead(LOADER *l, RTS_UI32 offset, void *data, RTS_UI32 size)
{
    RTS_RESULT result = SysFileRead(l->image->file, offset, data, size);

    return result == ERR_OK ? ERR_OK : refuse(l, result, "The flash cannot be read.");
}

/* ---- segments ---- */

static const char *const segment_names[SEGMENT_COUNT] = {
    "Code", "Application info", "Area table", "Function table", "External function table", "IEC function table", "Blob",
};

static const CDL_SEGMENT *find_segment(const LOADER *l, RTS_UI32 segment)
{
    static const RTS_UI8 places[SEGMENT_COUNT] = {
        offsetof(CDL_HEADER, code),
        offsetof(CDL_HEADER, application_info),
        offsetof(CDL_HEADER, area_table),
        offsetof(CDL_HEADER, function_table),
        offsetof(CDL_HEADER, external_function_table),
        offsetof(CDL_HEADER, iec_function_table),
        offsetof(CDL_HEADER, blob),
    };

    return (const CDL_SEGMENT *)((const RTS_UI8 *)&l->header + places[segment]);
}

RTS_UI32 LoaderAlign(RTS_UI32 offset)
{
    return (offset + 3) & ~(RTS_UI32)3;
}

RTS_RESULT LoaderReadNext(LOADER *l, void *data, RTS_UI32 size)
{
    RTS_UI32 offset = l->offset;

    if (size > l->end - offset)
        return refuse(l, ERR_SIZE_MISMATCH, "%s segment ends within an entry.", segment_names[l->segment]);
    l->offset = offset + size;
    return LoaderRead(l, offset, data, size);
}

void LoaderOpen(LOADER *l, RTS_UI32 segment)
{
    const CDL_SEGMENT *place = find_segment(l, segment);

    l->segment = segment;
    l->offset = place->offset;
    l->end = place->offset + place->size;
}

RTS_RESULT LoaderCheckEntries(LOADER *l, RTS_UI32 segment, CHECK check_entry)
{
    RTS_RESULT result = ERR_OK;

    LoaderOpen(l, segment);
    while (l->offset < l->end && result == ERR_OK)
        result = check_entry(l);
    return result;
}

bool LoaderIsCode(const LOADER *l, RTS_UI32 area, RTS_UI32 offset)
{
    return area == APP_AREA_CODE && offset < l->image->code.size;
}

static RTS_RESULT check_segment(LOADER *l, RTS_UI32 segment)
{
    const CDL_SEGMENT *place = find_segment(l, segment);
    const char *name = segment_names[segment];
    RTS_UI32 align = segment == SEGMENT_CODE ? APP_CODE_ALIGN : 4;

    if (place->size == 0)
        return ERR_OK;
    if (place->offset < CDL_HEADER_SIZE)
        return refuse(l, ERR_OUT_OF_LIMITS, "%s segment overlaps the header.", name);
    if (place->offset > l->image->size || place->size > l->image->size - place->offset)
        return refuse(l, ERR_OUT_OF_LIMITS, "%s segment ends beyond the image.", name);
    if (place->offset % align != 0)
        return refuse(l, ERR_ALIGNMENT, "%s segment is not aligned to %u bytes.", name, U(align));
    return ERR_OK;
}

RTS_RESULT LoaderCheckSegments(LOADER *l)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    for (i = 0; i < SEGMENT_COUNT && result == ERR_OK; i++)
        result = check_segment(l, i);
    return result;
}
