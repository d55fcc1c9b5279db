/*
 * AppByName.c - finds functions and variables of the program by name, and calls, reads and writes them.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The table is a blob of the image (CDL_EXPORT). Other tools make images too, so nothing here relies on what plctool writes.
 */
#include "AppByName.h"

#include <string.h>

#include "../load/AppLoaded.h"
#include "AppAddress.h"
#include "AppException.h"
#include "AppLife.h"
#include "AppState.h"
#include "CmpIecTask.h"
#include "SysFileFlash.h"
#include "SysLock.h"

/* ---- the table ---- */

typedef struct {
    RTS_UI32 file;
    RTS_UI32 offset;
    RTS_UI32 end;
} READER;

static RTS_UI32 align(RTS_UI32 offset)
{
    return (offset + 3) & ~3u;
}

static RTS_RESULT read(READER *reader, void *data, RTS_UI32 size)
{
    if (size > reader->end - reader->offset)
        return ERR_PARAMETER;
    if (SysFileRead(reader->file, reader->offset, data, size) != ERR_OK)
        return ERR_DEVICE;
    reader->offset += size;
    return ERR_OK;
}

/* Leads the reader to the table of the loaded program. The loader has checked where blobs begin and end. */
static RTS_RESULT open_table(READER *reader)
{
    const APP_IMAGE *image = AppGetImage();
    CDL_HEADER header;
    CDL_BLOB blob;
    RTS_RESULT result;

    if (AppGetState() == AS_NONE)
        return ERR_APP_NOT_LOADED;
    *reader = (READER){image->file, 0, image->size};
    result = read(reader, &header, sizeof header);
    reader->offset = header.blob.offset;
    reader->end = header.blob.offset + header.blob.size;
    while (result == ERR_OK && reader->offset < reader->end) {
        result = read(reader, &blob, sizeof blob);
        if (result == ERR_OK && blob.id == CDL_BLOB_EXPORTS) {
            reader->end = reader->offset + blob.size;
            return ERR_OK;
        }
        reader->offset = align(reader->offset + blob.size);
    }
    return result == ERR_OK ? (RTS_RESULT)ERR_NO_OBJECT : result;
}

static char to_lower(char c)
{
    return c >= 'A' && c <= 'Z' ? (char)(c + 'a' - 'A') : c;
}

/* Reads over a name of the table; *same: it is `wanted`. */
static RTS_RESULT compare_name(READER *reader, const char *wanted, bool *same)
{
    RTS_RESULT result;
    char c;

    *same = true;
    while ((result = read(reader, &c, 1)) == ERR_OK && c != '\0') {
        *same = *same && to_lower(*wanted) == to_lower(c);
        wanted += *same;
    }
    *same = *same && *wanted == '\0';
    reader->offset = align(reader->offset);
    return result;
}

static RTS_RESULT find(const char *name, bool is_variable, CDL_EXPORT *entry)
{
    READER reader;
    RTS_RESULT result = open_table(&reader);
    bool same = false;

    while (result == ERR_OK && reader.offset < reader.end) {
        result = read(&reader, entry, sizeof *entry);
        if (result == ERR_OK)
            result = compare_name(&reader, name, &same);
        if (result == ERR_OK && same && (entry->entry == CDL_EXPORT_VARIABLE) == is_variable)
            return ERR_OK;
    }
    return result == ERR_OK ? (RTS_RESULT)ERR_NO_OBJECT : result;
}

/* A variable in the area of code is refused: code cannot be written. */
static bool is_in_areas(const CDL_EXPORT *entry)
{
    return entry->area < APP_AREA_CODE && AppGetAreaAddress(entry->area, entry->offset, entry->size) != NULL;
}

static void keep(const CDL_EXPORT *entry, APP_NAMED *named)
{
    named->crc = AppGetImage()->crc;
    named->entry = entry->entry;
    named->area = entry->area;
    named->offset = entry->offset;
    named->size = entry->size;
}

RTS_RESULT AppFindFunctionByName(const char *name, RTS_UI32 signature, APP_NAMED *function)
{
    CDL_EXPORT entry;
    RTS_RESULT result = find(name, false, &entry);

    if (result != ERR_OK)
        return result;
    if (entry.signature != signature)
        return ERR_APP_SIGNATURE_MISMATCH;
    if (entry.entry >= AppGetImage()->code.size || (entry.size > 0 && !is_in_areas(&entry)))
        return ERR_PARAMETER;
    keep(&entry, function);
    return ERR_OK;
}

RTS_RESULT AppFindVariableByName(const char *name, RTS_UI32 signature, APP_NAMED *variable)
{
    CDL_EXPORT entry;
    RTS_RESULT result = find(name, true, &entry);

    if (result != ERR_OK)
        return result;
    if (entry.signature != signature)
        return ERR_TYPE_MISMATCH;
    if (entry.size == 0 || !is_in_areas(&entry))
        return ERR_PARAMETER;
    keep(&entry, variable);
    return ERR_OK;
}

/* ---- what was found ---- */

static RTS_RESULT check(const APP_NAMED *named, bool is_variable, RTS_SIZE size)
{
    if (AppGetState() == AS_NONE)
        return ERR_APP_NOT_LOADED;
    if (named->crc != AppGetImage()->crc || (named->entry == CDL_EXPORT_VARIABLE) != is_variable)
        return ERR_INVALID_HANDLE;
    if (!AppIsInitialised())
        return ERR_NOT_READY_YET;
    return size == named->size ? (RTS_RESULT)ERR_OK : (RTS_RESULT)ERR_SIZE_MISMATCH;
}

static RTS_UI8 *place_of(const APP_NAMED *named)
{
    return AppGetContext()->area[named->area] + named->offset;
}

static void copy(void *to, const void *from, RTS_SIZE size)
{
    RTS_UI32 lock = SysLockEnter();

    memcpy(to, from, size);
    SysLockLeave(lock);
}

RTS_RESULT AppReadVariable(const APP_NAMED *variable, void *value, RTS_SIZE size)
{
    RTS_RESULT result = check(variable, true, size);

    if (result == ERR_OK)
        copy(value, place_of(variable), size);
    return result;
}

RTS_RESULT AppWriteVariable(const APP_NAMED *variable, const void *value, RTS_SIZE size)
{
    RTS_RESULT result = check(variable, true, size);

    if (result == ERR_OK)
        copy(place_of(variable), value, size);
    return result;
}

typedef struct {
    IEC_CONTEXT context;
    uintptr_t entry;
} CALL;

static void run(void *arg)
{
    const CALL *call = arg;

    APP_CALL_ENTRY((IEC_ENTRY)call->entry, &call->context);
}

RTS_RESULT AppCallFunction(const APP_NAMED *function, void *parameters, RTS_SIZE size)
{
    RTS_RESULT result = check(function, false, size);
    RTS_EXCEPTION exception;
    IEC_GUARD guard;
    CALL call;

    if (result != ERR_OK)
        return result;
    if (AppHasException())
        return ERR_EXCEPTION;
    if (IecTaskReadGuard(IecTaskGetCount(), &guard))
        return ERR_CALL_AGAIN;
    if (size > 0)
        memcpy(place_of(function), parameters, size);
    call.context = *AppGetContext();
    call.entry = ((uintptr_t)call.context.area[APP_AREA_CODE] + function->entry) | APP_ENTRY_MODE_BIT;
    IecCycleSetTime(&call.context);
    if (!IecTaskRunGuarded(run, &call, &exception)) {
        AppHandleException(APP_IN_CALL, exception.code, exception.address);
        AppHandlePendingException();
        return ERR_EXCEPTION;
    }
    if (size > 0)
        memcpy(parameters, place_of(function), size);
    return ERR_OK;
}
