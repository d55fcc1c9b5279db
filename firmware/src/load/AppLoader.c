/*
 * AppLoader.c - checks an application image: header, CRC, target, segments, areas.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A row of checks, each may rely on the previous ones. Every refusal is a sentence of its own.
 */
#include "AppLoader.h"

#include <string.h>

#include "AppChecks.h"
#include "AppFunctions.h"
#include "AppTasks.h"
#include "CmpChecksum.h"
#include "CmpRetain.h"
#include "IoConfigCheck.h"
#include "SysFileFlash.h"
#include "SysTarget.h"

/* ---- header, CRC, code, target ---- */

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
        return refuse(l, ERR_TYPE_MISMATCH, "Not a compact download image: it starts with 0x%X.",
                      U(header->header_tag));
    if (header->header_version != CDL_HEADER_VERSION || header->header_size != CDL_HEADER_SIZE)
        return refuse(l, ERR_VERSION_MISMATCH, "Header version %u of %u bytes is unknown here.",
                      U(header->header_version), U(header->header_size));
    if (header->total_size != l->image->size)
        return refuse(l, ERR_SIZE_MISMATCH, "The image should have %u bytes, %u arrived.", U(header->total_size),
                      U(l->image->size));
    return ERR_OK;
}

RTS_RESULT AppLoaderCRC32(RTS_UI32 file, CDL_HEADER *header, RTS_UI32 *crc)
{
    header->crc = 0;
    *crc = CRC32Update(0, header, sizeof *header);
    return SysFileCRC32(file, CDL_HEADER_SIZE, header->total_size - CDL_HEADER_SIZE, crc);
}

static RTS_RESULT check_crc(LOADER *l)
{
    RTS_UI32 expected = l->header.crc;
    RTS_UI32 crc;
    RTS_RESULT result = AppLoaderCRC32(l->image->file, &l->header, &crc);

    if (result != ERR_OK)
        return refuse(l, result, "The flash cannot be read.");
    if (crc != expected)
        return refuse(l, ERR_CRC_FAILED, "The image is damaged: CRC %X, not %X.", U(crc), U(expected));
    if (crc != l->image->crc)
        return refuse(l, ERR_CRC_FAILED, "CRC %X is not the announced one, %X.", U(crc), U(l->image->crc));
    return ERR_OK;
}

static RTS_RESULT check_code(LOADER *l)
{
    const CDL_HEADER *h = &l->header;

    if (h->code.size == 0)
        return refuse(l, ERR_OUT_OF_LIMITS, "The image has no code.");
    if (h->code_area_index != APP_AREA_CODE || h->code_area_size < h->code.size)
        return refuse(l, ERR_OUT_OF_LIMITS, "Code of %u bytes is not in area %u, or above its %u bytes.",
                      U(h->code.size), U(APP_AREA_CODE), U(h->code_area_size));
    l->image->code = h->code; /* whatever this firmware may refuse later, it is the image (AppLoader.h) */
    l->image->area_size[APP_AREA_CODE] = h->code.size;
    return ERR_OK;
}

static RTS_RESULT check_target(LOADER *l)
{
    const SYS_TARGET *target = SysTargetGet();

    if (l->header.device_type != target->type)
        return refuse(l, ERR_TYPE_MISMATCH, "The image is for device type 0x%X, this device is 0x%X.",
                      U(l->header.device_type), U(target->type));
    if (l->header.device_id != target->id)
        return refuse(l, ERR_ID_MISMATCH,
                      "The image is for device id 0x%X, this device is 0x%X: build it for this target.",
                      U(l->header.device_id), U(target->id));
    if (l->header.device_version >> 24 != target->version >> 24)
        return refuse(l, ERR_VERSION_MISMATCH, "The image is for device version %u.x, this device has %u.x.",
                      U(l->header.device_version >> 24), U(target->version >> 24));
    return ERR_OK;
}

/* ---- areas ---- */

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
        check_header,         check_crc,          LoaderCheckSegments,
        check_code,           check_target,       check_areas,
        LoaderCheckFunctions, LoaderCheckImports, LoaderCheckIecFunctions,
        LoaderCheckInfo,      LoaderCheckBlobs,
#if IO_MAX_CONNECTORS > 0
        LoaderCheckIo,        LoaderCheckEvents,
#endif
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
