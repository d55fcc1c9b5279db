/*
 * AppLoader.c - checks an application image: header, CRC, target, segments, areas.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A row of checks, each may rely on the ones before it. Every refusal is a sentence of its own.
 */
#include "AppChecks.h"

#include <string.h>

#include "CMUtils.h"
#include "CmpChecksum.h"
#include "CmpRetain.h"
#include "SysFileFlash.h"
#include "SysTarget.h"

RTS_RESULT AppRefuse(APP_REFUSAL *refusal, RTS_RESULT result, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    CMUtlvsnprintf(refusal->text, sizeof refusal->text, format, arguments);
    va_end(arguments);
    return result;
}

RTS_RESULT LoaderRead(LOADER *l, RTS_UI32 offset, void *data, RTS_UI32 size)
{
    RTS_RESULT result = SysFileRead(l->image->file, offset, data, size);

    return result == ERR_OK ? ERR_OK : refuse(l, result, "Flash cannot be read at offset %u.", U(offset));
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

/* ---- header, CRC, target ---- */

static RTS_RESULT check_header(LOADER *l)
{
    const CDL_HEADER *header = &l->header;
    RTS_RESULT result;

    if (l->image->size < CDL_HEADER_SIZE)
        return refuse(l, ERR_SIZE_MISMATCH, "Image of %u bytes is shorter than its header.", U(l->image->size));
    result = LoaderRead(l, 0, &l->header, sizeof l->header);
    if (result != ERR_OK)
        return result;
    if (header->header_tag != CDL_HEADER_TAG)
        return refuse(l, ERR_TYPE_MISMATCH, "Not a compact download image: it starts with 0x%x.",
                      U(header->header_tag));
    if (header->header_version != CDL_HEADER_VERSION || header->header_size != CDL_HEADER_SIZE)
        return refuse(l, ERR_VERSION_MISMATCH, "Header version %u of %u bytes is unknown here.",
                      U(header->header_version), U(header->header_size));
    if (header->total_size != l->image->size)
        return refuse(l, ERR_SIZE_MISMATCH, "The image should have %u bytes, %u arrived.", U(header->total_size),
                      U(l->image->size));
    return ERR_OK;
}

static RTS_RESULT check_crc(LOADER *l)
{
    RTS_UI32 expected = l->header.crc;
    RTS_UI32 crc;
    RTS_RESULT result;

    l->header.crc = 0;
    crc = CRC32Update(0, &l->header, sizeof l->header);
    result = SysFileCRC32(l->image->file, CDL_HEADER_SIZE, l->image->size - CDL_HEADER_SIZE, &crc);
    if (result != ERR_OK)
        return refuse(l, result, "Flash cannot be read.");
    if (crc != expected)
        return refuse(l, ERR_CRC_FAILED, "The image is damaged: CRC 0x%x, not 0x%x.", U(crc), U(expected));
    if (crc != l->image->crc)
        return refuse(l, ERR_CRC_FAILED, "CRC 0x%x is not the announced one, 0x%x.", U(crc), U(l->image->crc));
    return ERR_OK;
}

static RTS_RESULT check_target(LOADER *l)
{
    const SYS_TARGET *target = SysTargetGet();

    if (l->header.device_type != target->type)
        return refuse(l, ERR_TYPE_MISMATCH, "The image is for device type 0x%x, this device is 0x%x.",
                      U(l->header.device_type), U(target->type));
    if (l->header.device_id != target->id)
        return refuse(l, ERR_ID_MISMATCH,
                      "The image is for device id 0x%x, this device is 0x%x: build it for this target.",
                      U(l->header.device_id), U(target->id));
    if (l->header.device_version >> 24 != target->version >> 24)
        return refuse(l, ERR_VERSION_MISMATCH, "The image is for device version %u.x, this device has %u.x.",
                      U(l->header.device_version >> 24), U(target->version >> 24));
    return ERR_OK;
}

/* ---- places of segments, areas ---- */

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

static RTS_RESULT check_segments(LOADER *l)
{
    RTS_RESULT result = ERR_OK;
    RTS_UI32 i;

    for (i = 0; i < SEGMENT_COUNT && result == ERR_OK; i++)
        result = check_segment(l, i);
    return result;
}

static RTS_RESULT check_code(LOADER *l)
{
    const CDL_HEADER *h = &l->header;

    if (h->code.size == 0)
        return refuse(l, ERR_OUT_OF_LIMITS, "The image has no code.");
    if (h->code_area_index != APP_AREA_CODE || h->code_area_size < h->code.size)
        return refuse(l, ERR_OUT_OF_LIMITS, "Code of %u bytes is not in area %u, or above its %u bytes.",
                      U(h->code.size), U(APP_AREA_CODE), U(h->code_area_size));
    l->image->code = h->code;
    l->image->area_size[APP_AREA_CODE] = h->code.size;
    return ERR_OK;
}

static RTS_RESULT check_area(LOADER *l)
{
    static const char *const names[APP_AREA_CODE] = {"data", "retain", "input", "output", "memory"};
    static const RTS_UI32 limits[APP_AREA_CODE] = {APP_DATA_SIZE, APP_RETAIN_SIZE, APP_INPUT_SIZE, APP_OUTPUT_SIZE,
                                                   APP_MEMORY_SIZE};
    AREA_INFO area;
    RTS_UI32 limit;
    RTS_RESULT result = LoaderReadNext(l, &area, sizeof area);

    if (result != ERR_OK)
        return result;
    if (area.index >= APP_AREA_COUNT || (l->areas_seen >> area.index & 1) != 0)
        return refuse(l, ERR_OUT_OF_LIMITS, "Area %u is unknown or listed twice.", U(area.index));
    l->areas_seen |= 1u << area.index;
    if (area.index == APP_AREA_CODE)
        return ERR_OK;
    limit = limits[area.index];
    if (area.index == APP_AREA_RETAIN && RetainCapacity() < limit)
        limit = RetainCapacity();
    if (area.size > limit)
        return refuse(l, ERR_NOMEMORY, "The %s area needs %u bytes, this device has %u.", names[area.index],
                      U(area.size), U(limit));
    l->image->area_size[area.index] = area.size;
    return ERR_OK;
}

static RTS_RESULT check_areas(LOADER *l)
{
    return LoaderCheckEntries(l, SEGMENT_AREAS, check_area);
}

RTS_RESULT AppLoaderCheck(RTS_UI32 file, RTS_UI32 size, RTS_UI32 crc, APP_IMAGE *image, APP_REFUSAL *refusal)
{
    static const CHECK checks[] = {
        check_header,         check_crc,          check_target,
        check_segments,       check_code,         check_areas,
        LoaderCheckFunctions, LoaderCheckImports, LoaderCheckIecFunctions,
        LoaderCheckInfo,      LoaderCheckBlobs,
    };
    LOADER l;
    RTS_RESULT result = ERR_OK;
    RTS_SIZE i;

    memset(image, 0, sizeof *image);
    memset(&l, 0, sizeof l);
    refusal->text[0] = '\0';
    image->file = file;
    image->size = size;
    image->crc = crc;
    l.image = image;
    l.refusal = refusal;
    for (i = 0; i < RTS_COUNT(checks) && result == ERR_OK; i++)
        result = checks[i](&l);
    return result;
}
