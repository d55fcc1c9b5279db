/*
 * AppLoader.c - checks an application image.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A row of checks, each may rely on the ones before it. Every refusal is a sentence of its own.
 */
#include "AppLoader.h"

#include <string.h>

#include "CMUtils.h"
#include "CmpChecksum.h"
#include "CmpIecTask.h"
#include "CmpItf.h"
#include "CmpLog.h"
#include "CmpRetain.h"
#include "SysFileFlash.h"
#include "SysTarget.h"

typedef struct {
    APP_IMAGE *image;
    APP_REFUSAL *refusal;
    CDL_HEADER header;
    RTS_UI32 segment; /* SEGMENT_*: the one that is read now */
    RTS_UI32 offset;  /* of its next entry */
    RTS_UI32 end;
    RTS_UI32 areas_seen;   /* a bit for each */
    RTS_RESULT unresolved; /* what was wrong with the first import that was */
} LOADER;

typedef RTS_RESULT (*CHECK)(LOADER *l);

#define U(value) ((unsigned)(value))
#define refuse(l, result, ...) APP_REFUSE((l)->refusal, result, __VA_ARGS__)

RTS_RESULT AppRefuse(APP_REFUSAL *refusal, RTS_RESULT result, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    CMUtlvsnprintf(refusal->text, sizeof refusal->text, format, arguments);
    va_end(arguments);
    return result;
}

static RTS_RESULT read_image(LOADER *l, RTS_UI32 offset, void *data, RTS_UI32 size)
{
    RTS_RESULT result = SysFileRead(l->image->file, offset, data, size);

    return result == ERR_OK ? ERR_OK : refuse(l, result, "Flash cannot be read at offset %u.", U(offset));
}

/* ---- segments ---- */

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

static RTS_UI32 align4(RTS_UI32 offset)
{
    return (offset + 3) & ~(RTS_UI32)3;
}

/* Reads the next `size` bytes of the segment. */
static RTS_RESULT read_next(LOADER *l, void *data, RTS_UI32 size)
{
    RTS_UI32 offset = l->offset;

    if (size > l->end - offset)
        return refuse(l, ERR_SIZE_MISMATCH, "%s segment ends within an entry.", segment_names[l->segment]);
    l->offset = offset + size;
    return read_image(l, offset, data, size);
}

static void open_segment(LOADER *l, RTS_UI32 segment)
{
    const CDL_SEGMENT *place = find_segment(l, segment);

    l->segment = segment;
    l->offset = place->offset;
    l->end = place->offset + place->size;
}

/* Has every entry of a segment checked by `check_entry`, which reads it. */
static RTS_RESULT check_entries(LOADER *l, RTS_UI32 segment, CHECK check_entry)
{
    RTS_RESULT result = ERR_OK;

    open_segment(l, segment);
    while (l->offset < l->end && result == ERR_OK)
        result = check_entry(l);
    return result;
}

/* ---- header, CRC, target ---- */

static RTS_RESULT check_header(LOADER *l)
{
    const CDL_HEADER *header = &l->header;
    RTS_RESULT result;

    if (l->image->size < CDL_HEADER_SIZE)
        return refuse(l, ERR_SIZE_MISMATCH, "Image of %u bytes is shorter than its header.", U(l->image->size));
    result = read_image(l, 0, &l->header, sizeof l->header);
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
        return refuse(l, ERR_ID_MISMATCH, "The image is for device id 0x%x, this device is 0x%x: build it for this target.",
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
    RTS_RESULT result = read_next(l, &area, sizeof area);

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
    return check_entries(l, SEGMENT_AREAS, check_area);
}

/* ---- functions ---- */

static bool is_code(const LOADER *l, RTS_UI32 area, RTS_UI32 offset)
{
    return area == APP_AREA_CODE && offset < l->image->code.size;
}

static RTS_RESULT check_functions(LOADER *l)
{
    POU_REF table[CDL_FUNCTION_COUNT];
    RTS_UI32 i;
    RTS_RESULT result;

    if (l->header.function_table.size != sizeof table)
        return refuse(l, ERR_SIZE_MISMATCH, "Function table has %u bytes, not %u.",
                      U(l->header.function_table.size), U(sizeof table));
    result = read_image(l, l->header.function_table.offset, table, sizeof table);
    if (result != ERR_OK)
        return result;
    for (i = 0; i < CDL_FUNCTION_COUNT; i++) {
        l->image->entry[i] = IMAGE_NO_ENTRY;
        if (table[i].area == APP_AREA_NONE)
            continue;
        if (i >= CDL_FUNCTION_RELOC)
            return refuse(l, ERR_NOT_SUPPORTED, "Function %u is not supported.",
                          U(i));
        if (!is_code(l, table[i].area, table[i].offset))
            return refuse(l, ERR_INVALID_REFERENCE, "Function %u lies outside the code.", U(i));
        l->image->entry[i] = table[i].offset;
    }
    return ERR_OK;
}

/*
 * Reads the NUL-terminated name at *offset of a table that ends at `end`; *offset is where the next entry starts then.
 * False when it is empty, not terminated, too long or not plain text.
 */
static bool read_name(RTS_UI32 file, RTS_UI32 *offset, RTS_UI32 end, char name[APP_NAME_SIZE])
{
    RTS_UI32 length;

    for (length = 0; length < APP_NAME_SIZE && *offset < end; length++) {
        if (SysFileRead(file, (*offset)++, &name[length], 1) != ERR_OK)
            return false;
        if (name[length] == '\0') {
            *offset = align4(*offset);
            return length > 0;
        }
        if (name[length] < '!' || name[length] > '~')
            return false;
    }
    return false;
}

static RTS_RESULT find_import(const EXT_REF_INFO *ref, const char *name)
{
    const CMP_EXT_FUNCTION *found = CMFindExternal(name);

    if (found == NULL)
        return ERR_APP_UNRESOLVED_REFERENCE;
    if (found->signature != ref->signature_id)
        return ERR_APP_SIGNATURE_MISMATCH;
    if (found->version >> 16 != ref->version >> 16 || found->version < ref->version)
        return ERR_APP_VERSION_MISMATCH;
    return ERR_OK;
}

static const char *problem_text(RTS_RESULT result)
{
    return result == ERR_APP_UNRESOLVED_REFERENCE ? "missing"
           : result == ERR_APP_SIGNATURE_MISMATCH ? "other parameters"
                                                  : "other version";
}

/* Adds an import that cannot be resolved to the refusal, which is to name all of them. */
static void add_unresolved(LOADER *l, const char *name, RTS_RESULT result)
{
    APP_REFUSAL *refusal = l->refusal;
    RTS_SIZE length = strlen(refusal->text);

    if (l->unresolved == ERR_OK)
        l->unresolved =
            refuse(l, result, "External functions this device lacks: %s (%s)", name, problem_text(result));
    else if (APP_REFUSAL_TEXT_SIZE > 1)
        CMUtlsnprintf(refusal->text + length, sizeof refusal->text - length, ", %s (%s)", name, problem_text(result));
    LogAdd(CMPID_CmpAppEmbedded, LOG_ERROR, result, "External function %s: %s", name, problem_text(result));
}

static RTS_RESULT check_import(LOADER *l)
{
    RTS_UI32 index = l->image->import_count;
    EXT_REF_INFO ref;
    char name[APP_NAME_SIZE];
    RTS_RESULT result;

    if (index == APP_MAX_IMPORTS)
        return refuse(l, ERR_NOMEMORY, "More than the %u external functions possible.",
                      U(APP_MAX_IMPORTS));
    result = read_next(l, &ref, EXT_REF_INFO_SIZE);
    if (result != ERR_OK)
        return result;
    if (!read_name(l->image->file, &l->offset, l->end, name))
        return refuse(l, ERR_PARAMETER, "Name of external function %u is empty or too long.", U(index));
    if (ref.area != APP_AREA_NONE || ref.offset != index * sizeof(RTS_PFN))
        return refuse(l, ERR_INVALID_REFERENCE, "External function %s is not in import slot %u.",
                      name, U(index));
    result = find_import(&ref, name);
    if (result != ERR_OK)
        add_unresolved(l, name, result);
    l->image->import_count++;
    return ERR_OK;
}

static RTS_RESULT check_imports(LOADER *l)
{
    RTS_RESULT result = check_entries(l, SEGMENT_IMPORTS, check_import);

    l->image->imports = l->header.external_function_table.offset;
    return result == ERR_OK ? l->unresolved : result;
}

static RTS_RESULT check_iec_function(LOADER *l)
{
    char name[APP_NAME_SIZE];
    FUNCTION_INFO info;
    RTS_RESULT result = read_next(l, &info, sizeof info);

    if (result != ERR_OK)
        return result;
    if (!read_name(l->image->file, &l->offset, l->end, name))
        return refuse(l, ERR_PARAMETER, "Name in the IEC function table is bad.");
    if (!is_code(l, info.area, info.offset))
        return refuse(l, ERR_INVALID_REFERENCE, "IEC function %s lies outside the code.", name);
    return ERR_OK;
}

static RTS_RESULT check_iec_functions(LOADER *l)
{
    return SRV_INFORMATION ? check_entries(l, SEGMENT_IEC_FUNCTIONS, check_iec_function) : (RTS_RESULT)ERR_OK;
}

/* ---- application info ---- */

/* Finds the end of the string at `offset`; false when it is not terminated before `end`. */
static bool skip_string(RTS_UI32 file, RTS_UI32 *offset, RTS_UI32 end)
{
    char c = 1;

    while (*offset < end && SysFileRead(file, *offset, &c, 1) == ERR_OK) {
        ++*offset;
        if (c == '\0') {
            *offset = align4(*offset);
            return true;
        }
    }
    return false;
}

/* Only the strings; a date follows. */
static RTS_RESULT check_info(LOADER *l)
{
    RTS_UI32 i;

    if (!SRV_INFORMATION)
        return ERR_OK;
    l->image->info = l->header.application_info;
    open_segment(l, SEGMENT_INFO);
    for (i = 0; i < IMAGE_INFO_COUNT && l->offset < l->end; i++) {
        if (!skip_string(l->image->file, &l->offset, l->end))
            return refuse(l, ERR_PARAMETER, "Application info %u is not terminated.", U(i));
    }
    return ERR_OK;
}

void AppLoaderReadInfo(const APP_IMAGE *image, RTS_UI32 index, char *text, RTS_SIZE size)
{
    RTS_UI32 end = image->info.offset + image->info.size;
    RTS_UI32 offset = image->info.offset;
    RTS_SIZE length = 0;

    while (index > 0 && skip_string(image->file, &offset, end))
        index--;
    if (index == 0) {
        while (length + 1 < size && offset < end && SysFileRead(image->file, offset, &text[length], 1) == ERR_OK &&
               text[length] != '\0') {
            length++;
            offset++;
        }
    }
    text[length] = '\0';
}

/* ---- blobs: tasks, retain layout ---- */

static RTS_RESULT check_task(LOADER *l, const CDL_TASK *task)
{
    const char *name = task->name;

    if (name[0] == '\0' || memchr(name, '\0', sizeof task->name) == NULL)
        return refuse(l, ERR_PARAMETER, "Task %u has no name.", U(l->image->task_count));
    if (task->kind > KIND_FREEWHEELING)
        return refuse(l, ERR_NOT_SUPPORTED, "Task %s has the unknown kind %u.", name, U(task->kind));
    if (task->priority > 31)
        return refuse(l, ERR_OUT_OF_LIMITS, "Task %s has priority %u, above 31.", name, U(task->priority));
    if (task->kind == KIND_CYCLIC && task->interval_us == 0)
        return refuse(l, ERR_PARAMETER, "Cyclic task %s has no interval.", name);
    if (task->entry_offset >= l->image->code.size)
        return refuse(l, ERR_INVALID_REFERENCE, "Task %s lies outside the code.", name);
    if (task->kind == KIND_EVENT &&
        (task->event_area >= APP_AREA_CODE || task->event_offset >= l->image->area_size[task->event_area]))
        return refuse(l, ERR_INVALID_REFERENCE, "Event of task %s lies outside its area.", name);
    return ERR_OK;
}

static RTS_RESULT check_tasks(LOADER *l, RTS_UI32 size)
{
    RTS_UI32 count = size / (RTS_UI32)sizeof(CDL_TASK);
    CDL_TASK task;
    RTS_RESULT result = ERR_OK;

    if (l->image->task_count != 0)
        return refuse(l, ERR_DUPLICATE, "The image has two lists of tasks.");
    if (count * sizeof(CDL_TASK) != size)
        return refuse(l, ERR_SIZE_MISMATCH, "Task list of %u bytes has a part of an entry.", U(size));
    if (count > APP_MAX_TASKS)
        return refuse(l, ERR_NOMEMORY, "The application has %u tasks, this device can run %u.", U(count),
                      U(APP_MAX_TASKS));
    l->image->tasks = l->offset;
    for (; l->image->task_count < count && result == ERR_OK; l->image->task_count++) {
        result = read_next(l, &task, sizeof task);
        if (result == ERR_OK)
            result = check_task(l, &task);
    }
    return result;
}

static RTS_RESULT check_retain_layout(LOADER *l, RTS_UI32 size)
{
    if (size != sizeof l->image->retain_layout)
        return refuse(l, ERR_SIZE_MISMATCH, "Retain layout has %u bytes, not 4.", U(size));
    return read_next(l, &l->image->retain_layout, size);
}

static RTS_RESULT check_blob(LOADER *l)
{
    CDL_BLOB blob;
    RTS_UI32 next;
    RTS_RESULT result = read_next(l, &blob, sizeof blob);

    if (result != ERR_OK)
        return result;
    if (blob.magic != (RTS_UI32)CDL_BLOB_MAGIC)
        return refuse(l, ERR_TYPE_MISMATCH, "There is no blob at offset %u.", U(l->offset - sizeof blob));
    if (blob.size > l->end - l->offset)
        return refuse(l, ERR_OUT_OF_LIMITS, "Blob %u ends beyond its segment.", U(blob.id));
    next = align4(l->offset + blob.size);
    if (blob.id == CDL_BLOB_TASKS)
        result = check_tasks(l, blob.size);
    else if (blob.id == CDL_BLOB_RETAIN)
        result = check_retain_layout(l, blob.size);
    /* Others are of a newer tool, and not needed to run. */
    l->offset = next;
    return result;
}

static RTS_RESULT check_blobs(LOADER *l)
{
    RTS_RESULT result;

    l->image->retain_layout = l->image->crc; /* unless a blob says more */
    result = check_entries(l, SEGMENT_BLOBS, check_blob);
    if (result == ERR_OK && l->image->task_count == 0)
        return refuse(l, ERR_NO_OBJECT, "The application has no task.");
    return result;
}

RTS_RESULT AppLoaderCheck(RTS_UI32 file, RTS_UI32 size, RTS_UI32 crc, APP_IMAGE *image, APP_REFUSAL *refusal)
{
    static const CHECK checks[] = {
        check_header,    check_crc,     check_target,        check_segments, check_code,  check_areas,
        check_functions, check_imports, check_iec_functions, check_info,     check_blobs,
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

RTS_RESULT AppLoaderRead(const APP_IMAGE *image, APP_TABLES *tables)
{
    RTS_UI32 offset = image->imports;
    char name[APP_NAME_SIZE];
    RTS_UI32 i;

    for (i = 0; i < image->import_count; i++) {
        const CMP_EXT_FUNCTION *found = NULL;
        offset += EXT_REF_INFO_SIZE;
        if (read_name(image->file, &offset, image->size, name))
            found = CMFindExternal(name);
        if (found == NULL)
            return ERR_DEVICE;
        tables->imports[i] = found->function;
    }
    return SysFileRead(image->file, image->tasks, tables->tasks, image->task_count * (RTS_UI32)sizeof(CDL_TASK));
}
