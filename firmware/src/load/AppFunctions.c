/*
 * AppFunctions.c - checks what an image calls and what of it is called, and its names: function tables, imports, info.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppFunctions.h"

#include <string.h>

#include "CMUtils.h"
#include "CmpItf.h"
#include "CmpLog.h"
#include "SysFileFlash.h"

/* ---- functions of the image ---- */

RTS_RESULT LoaderCheckFunctions(LOADER *l)
{
    POU_REF table[CDL_FUNCTION_COUNT];
    RTS_UI32 i;
    RTS_RESULT result;

    if (l->header.function_table.size != sizeof table)
        return refuse(l, ERR_SIZE_MISMATCH, "Function table has %u bytes, not %u.", U(l->header.function_table.size),
                      U(sizeof table));
    result = LoaderRead(l, l->header.function_table.offset, table, sizeof table);
    if (result != ERR_OK)
        return result;
    for (i = 0; i < CDL_FUNCTION_COUNT; i++) {
        l->image->entry[i] = IMAGE_NO_ENTRY;
        if (table[i].area == APP_AREA_NONE)
            continue;
        if (i >= CDL_FUNCTION_RELOC)
            return refuse(l, ERR_NOT_SUPPORTED, "Function %u is not supported.", U(i));
        if (!LoaderIsCode(l, table[i].area, table[i].offset))
            return refuse(l, ERR_INVALID_REFERENCE, "Function %u is outside the code.", U(i));
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
            *offset = LoaderAlign(*offset);
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
    if (found->signature != 0 && found->signature != ref->signature_id)
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

/* Adds an import that cannot be resolved to the refusal, which names all of them. */
static void add_unresolved(LOADER *l, const char *name, RTS_RESULT result)
{
    APP_REFUSAL *refusal = l->refusal;
    RTS_SIZE length = strlen(refusal->text);

    if (l->unresolved == ERR_OK)
        l->unresolved = refuse(l, result, "External functions this device lacks: %s (%s)", name, problem_text(result));
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
        return refuse(l, ERR_NOMEMORY, "More than the %u external functions possible.", U(APP_MAX_IMPORTS));
    result = LoaderReadNext(l, &ref, EXT_REF_INFO_SIZE);
    if (result != ERR_OK)
        return result;
    if (!read_name(l->image->file, &l->offset, l->end, name))
        return refuse(l, ERR_PARAMETER, "Name of external function %u is empty or too long.", U(index));
    if (ref.area != APP_AREA_NONE || ref.offset != index * sizeof(RTS_PFN))
        return refuse(l, ERR_INVALID_REFERENCE, "External function %s is not in import slot %u.", name, U(index));
    result = find_import(&ref, name);
    if (result != ERR_OK)
        add_unresolved(l, name, result);
    l->image->import_count++;
    return ERR_OK;
}

RTS_RESULT LoaderCheckImports(LOADER *l)
{
    RTS_RESULT result = LoaderCheckEntries(l, SEGMENT_IMPORTS, check_import);

    l->image->imports = l->header.external_function_table.offset;
    return result == ERR_OK ? l->unresolved : result;
}

static RTS_RESULT check_iec_function(LOADER *l)
{
    char name[APP_NAME_SIZE];
    FUNCTION_INFO info;
    RTS_RESULT result = LoaderReadNext(l, &info, sizeof info);

    if (result != ERR_OK)
        return result;
    if (!read_name(l->image->file, &l->offset, l->end, name))
        return refuse(l, ERR_PARAMETER, "Name in the IEC function table is bad.");
    if (!LoaderIsCode(l, info.area, info.offset))
        return refuse(l, ERR_INVALID_REFERENCE, "IEC function %s is outside the code.", name);
    return ERR_OK;
}

/* Those with an identifier are called on an event; others are names for tools. */
RTS_RESULT LoaderCheckIecFunctions(LOADER *l)
{
#if IEC_EVENTS
    l->image->iec_functions = l->header.iec_function_table;
#endif
    if (!SRV_INFORMATION && !IEC_EVENTS)
        return ERR_OK;
    return LoaderCheckEntries(l, SEGMENT_IEC_FUNCTIONS, check_iec_function);
}

#if IEC_EVENTS
RTS_UI32 AppLoaderFindEvent(const APP_IMAGE *image, RTS_UI32 event)
{
    RTS_UI32 offset = image->iec_functions.offset;
    RTS_UI32 end = offset + image->iec_functions.size;
    char name[APP_NAME_SIZE];
    FUNCTION_INFO info;

    while (offset < end && SysFileRead(image->file, offset, &info, sizeof info) == ERR_OK) {
        if (info.identifier == event)
            return info.offset;
        offset += (RTS_UI32)sizeof info;
        if (!read_name(image->file, &offset, end, name))
            break;
    }
    return IMAGE_NO_ENTRY;
}
#endif

/* ---- application info ---- */

/* Finds the end of the string at `offset`; false when it is not terminated before `end`. */
static bool skip_string(RTS_UI32 file, RTS_UI32 *offset, RTS_UI32 end)
{
    char c = 1;

    while (*offset < end && SysFileRead(file, *offset, &c, 1) == ERR_OK) {
        ++*offset;
        if (c == '\0') {
            *offset = LoaderAlign(*offset);
            return true;
        }
    }
    return false;
}

/* Only the strings; a date follows. */
RTS_RESULT LoaderCheckInfo(LOADER *l)
{
    RTS_UI32 i;

    if (!SRV_INFORMATION)
        return ERR_OK;
    l->image->info = l->header.application_info;
    LoaderOpen(l, SEGMENT_INFO);
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

    for (; index > 0; index--)
        (void)skip_string(image->file, &offset, end); /* ends where no further string can be read, either */
    while (length + 1 < size && offset < end && SysFileRead(image->file, offset, &text[length], 1) == ERR_OK &&
           text[length] != '\0') {
        length++;
        offset++;
    }
    text[length] = '\0';
}

/* ---- afterwards ---- */

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
