/*
 * IecFile.c - the files of a program.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IecFile.h"

#if IEC_FILES > 0

#include <string.h>

#include "AppEventIds.h"
#include "CmpAppCalls.h"
#include "CmpChecksum.h"
#include "CmpEventMgr.h"
#include "CmpSettings.h"
#include "FileStore.h"
#include "RetainFile.h"

enum { VERSION = 0x00010000, SLOTS = 256, COPIES = 8 };

typedef enum { CLOSED, READING, WRITING, COPYING, LISTING } USE;

/* An open file. */
typedef struct {
    USE use;
    RTS_UI32 handle;
    FILE_ENTRY entry;  /* that is read, or copied; of a file that is written its name */
    RTS_UI32 position; /* in it; of the list the next index */
    RTS_UI32 crc;      /* of what has been written */
} OPEN_FILE;

static struct {
    RTS_UI32 opened; /* files ever */
    OPEN_FILE file[IEC_FILES];
} files;

/* ---- open files ---- */

static OPEN_FILE *find_open(RTS_UI32 handle)
{
    OPEN_FILE *file = &files.file[handle % SLOTS % IEC_FILES];

    return file->use != CLOSED && file->handle == handle ? file : NULL;
}

static OPEN_FILE *find_closed(void)
{
    for (RTS_UI32 i = 0; i < IEC_FILES; i++) {
        if (files.file[i].use == CLOSED)
            return &files.file[i];
    }
    return NULL;
}

static OPEN_FILE *find_writer(void)
{
    for (RTS_UI32 i = 0; i < IEC_FILES; i++) {
        if (files.file[i].use == WRITING || files.file[i].use == COPYING)
            return &files.file[i];
    }
    return NULL;
}

static RTS_UI32 use_file(OPEN_FILE *file, USE use)
{
    file->use = use;
    file->position = 0;
    file->crc = 0;
    file->handle = (++files.opened % (UINT32_MAX / SLOTS) + 1) * SLOTS + (RTS_UI32)(file - files.file);
    return file->handle;
}

/* ---- errors and names ---- */

static RTS_I32 error_of(RTS_RESULT result)
{
    switch (result) {
    case ERR_OK:
        return 0;
    case ERR_PARAMETER:
        return IEC_FILE_WRONG_PARAMETER;
    case ERR_NO_OBJECT:
    case ERR_NO_CONSISTENCY:
        return IEC_FILE_NOT_EXIST;
    case ERR_DUPLICATE:
        return IEC_FILE_EXIST;
    case ERR_DISK_FULL:
    case ERR_FT_FILE_SIZE_MISMATCH:
        return IEC_FILE_INCOMPLETE;
    default:
        return IEC_FILE_UNKNOWN;
    }
}

/* Or read by it: a program sets no settings of the device that runs it. */
static bool is_of_device(const char *name)
{
    static const char *const names[] = {FILE_NAME_IMAGE, FILE_NAME_LOG, FILE_NAME_RETAIN, SETTINGS_FILE_NAME};

    for (RTS_SIZE i = 0; i < RTS_COUNT(names); i++) {
        if (strcmp(name, names[i]) == 0)
            return true;
    }
    return false;
}

/* The error of a name that a file cannot have, or that a program must not write. */
static RTS_I32 check_own(const char *name)
{
    if (!FileStoreIsName(name))
        return IEC_FILE_WRONG_PARAMETER;
    return is_of_device(name) ? IEC_FILE_READ_ONLY : 0;
}

/* True if the open file of that name is written by the program. */
static bool is_written(const char *name)
{
    const OPEN_FILE *writer = find_writer();

    return writer != NULL && strcmp(writer->entry.name, name) == 0;
}

/* ---- opening ---- */

static RTS_I32 open_to_read(APP_CALL *call, OPEN_FILE *file, const char *name)
{
    const FILE_ENTRY *entry = FileStoreFind(name);

    if (entry == NULL)
        return IEC_FILE_NOT_EXIST;
    file->entry = *entry;
    call->result = use_file(file, READING);
    return 0;
}

/* Waits while a tool writes a file. */
static RTS_I32 open_to_write(APP_CALL *call, OPEN_FILE *file, const char *name, bool append)
{
    const FILE_ENTRY *previous = append ? FileStoreFind(name) : NULL;
    RTS_RESULT result;

    if (FileStoreIsWriting())
        return APP_CALL_PENDING;
    result = FileStoreCreate(name);
    if (result != ERR_OK)
        return error_of(result);
    memset(&file->entry, 0, sizeof file->entry);
    memcpy(file->entry.name, name, strlen(name) + 1);
    if (previous != NULL)
        file->entry = *previous;
    call->result = use_file(file, previous != NULL ? COPYING : WRITING);
    return previous != NULL ? APP_CALL_PENDING : 0;
}

static RTS_RESULT write_bytes(OPEN_FILE *file, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_RESULT result = FileStoreWrite(data, size);

    if (result == ERR_OK)
        file->crc = CRC32Update(file->crc, data, size);
    return result;
}

/* Writes the next part of the previous file. The name is no longer needed: the data of the call are the buffer. */
static RTS_RESULT copy_part(APP_CALL *call, OPEN_FILE *file)
{
    RTS_UI32 size = file->entry.size - file->position;
    RTS_RESULT result;

    if (size > sizeof call->data)
        size = sizeof call->data;
    result = FileStoreRead(&file->entry, file->position, call->data, size);
    if (result == ERR_OK)
        result = write_bytes(file, call->data, size);
    file->position += size;
    return result;
}

/* Gives up a file that is written: the previous one stays. */
static RTS_I32 give_up(OPEN_FILE *file, RTS_RESULT result)
{
    FileStoreAbort();
    file->use = CLOSED;
    return error_of(result);
}

/* Some parts in a pass, so that communication goes on. */
static RTS_I32 copy_parts(APP_CALL *call, OPEN_FILE *file)
{
    for (RTS_UI32 i = 0; i < COPIES && file->position < file->entry.size; i++) {
        RTS_RESULT result = copy_part(call, file);
        if (result != ERR_OK)
            return give_up(file, result);
    }
    if (file->position < file->entry.size)
        return APP_CALL_PENDING;
    file->use = WRITING;
    return 0;
}

static RTS_I32 open_file(APP_CALL *call)
{
    const char *name = (const char *)call->data;
    OPEN_FILE *file = find_open(call->result); /* that is copied */
    RTS_I32 error;

    if (file != NULL)
        return copy_parts(call, file);
    if (!FileStoreIsName(name))
        return IEC_FILE_WRONG_PARAMETER;
    file = find_closed();
    if (file == NULL)
        return IEC_FILE_TOO_MANY;
    if (call->value == IEC_FILE_MODE_READ)
        return open_to_read(call, file, name);
    if (call->value != IEC_FILE_MODE_WRITE && call->value != IEC_FILE_MODE_APPEND &&
        call->value != IEC_FILE_MODE_APPEND_OR_CREATE)
        return IEC_FILE_NOT_IMPLEMENTED;
    error = check_own(name);
    if (error != 0)
        return error;
    if (call->value == IEC_FILE_MODE_APPEND && FileStoreFind(name) == NULL)
        return IEC_FILE_NOT_EXIST;
    if (find_writer() != NULL)
        return IEC_FILE_TOO_MANY;
    return open_to_write(call, file, name, call->value != IEC_FILE_MODE_WRITE);
}

/* ---- what is open ---- */

static RTS_I32 close_file(OPEN_FILE *file)
{
    bool was_written = file->use == WRITING;

    file->use = CLOSED;
    return was_written ? error_of(FileStoreFinish(file->crc)) : 0;
}

static RTS_I32 read_file(APP_CALL *call, OPEN_FILE *file)
{
    RTS_UI32 size = file->entry.size - file->position;
    RTS_RESULT result;

    if (size > call->value)
        size = call->value;
    if (size > sizeof call->data)
        size = sizeof call->data;
    result = FileStoreRead(&file->entry, file->position, call->data, size);
    if (result != ERR_OK)
        return error_of(result);
    file->position += size;
    call->result = size;
    return 0;
}

/* A file that has no room is given up, as half of it would be of no use. */
static RTS_I32 write_file(APP_CALL *call, OPEN_FILE *file)
{
    RTS_RESULT result = write_bytes(file, call->data, call->size);

    return result == ERR_OK ? 0 : give_up(file, result);
}

static RTS_I32 set_position(OPEN_FILE *file, RTS_UI32 position)
{
    if (position > file->entry.size)
        return IEC_FILE_WRONG_PARAMETER;
    file->position = position;
    return 0;
}

static RTS_I32 list(APP_CALL *call, OPEN_FILE *file)
{
    const FILE_ENTRY *entry = NULL;

    while (entry == NULL && file->position < FILE_STORE_FILES)
        entry = FileStoreGet(file->position++);
    if (entry == NULL)
        return IEC_FILE_NO_MORE_ENTRIES;
    memcpy(call->data, entry->name, sizeof entry->name);
    call->size = sizeof entry->name;
    call->result = entry->size;
    return 0;
}

static RTS_I32 do_with_open(APP_CALL *call)
{
    OPEN_FILE *file = find_open(call->handle);
    USE needed = call->operation == IEC_FILE_WRITE ? WRITING : call->operation == IEC_FILE_LIST ? LISTING : READING;

    if (file == NULL || file->use == COPYING) /* a program that guesses its handle */
        return IEC_FILE_HANDLE_INVALID;
    if (call->operation == IEC_FILE_CLOSE)
        return close_file(file);
    if (call->operation == IEC_FILE_GET_POS && file->use == WRITING) {
        call->result = FileStorePosition();
        return 0;
    }
    if (file->use != needed)
        return IEC_FILE_HANDLE_INVALID;
    switch (call->operation) {
    case IEC_FILE_READ:
        return read_file(call, file);
    case IEC_FILE_WRITE:
        return write_file(call, file);
    case IEC_FILE_SET_POS:
        return set_position(file, call->value);
    case IEC_FILE_GET_POS:
        call->result = file->position;
        return 0;
    case IEC_FILE_AT_END:
        call->result = file->position == file->entry.size;
        return 0;
    case IEC_FILE_LIST:
        return list(call, file);
    default:
        return IEC_FILE_NOT_IMPLEMENTED;
    }
}

/* ---- what has a name ---- */

static RTS_I32 delete_file(const char *name)
{
    RTS_I32 error = check_own(name);

    if (error == 0 && is_written(name))
        error = IEC_FILE_TOO_MANY;
    return error == 0 ? error_of(FileStoreDelete(name)) : error;
}

static RTS_I32 rename_file(const APP_CALL *call)
{
    const char *name = (const char *)call->data;
    RTS_UI32 length = (RTS_UI32)strlen(name) + 1;
    const char *new_name = name + length;
    RTS_I32 error = check_own(name);

    if (memchr(new_name, '\0', call->size - length) == NULL)
        return IEC_FILE_WRONG_PARAMETER;
    if (error == 0)
        error = check_own(new_name);
    if (error == 0 && (is_written(name) || is_written(new_name)))
        error = IEC_FILE_TOO_MANY;
    return error == 0 ? error_of(FileStoreRename(name, new_name)) : error;
}

static RTS_I32 get_size(APP_CALL *call)
{
    const char *name = (const char *)call->data;
    const FILE_ENTRY *entry = FileStoreFind(name);

    if (entry == NULL)
        return FileStoreIsName(name) ? IEC_FILE_NOT_EXIST : IEC_FILE_WRONG_PARAMETER;
    call->result = entry->size;
    return 0;
}

static RTS_I32 open_list(APP_CALL *call)
{
    OPEN_FILE *file = find_closed();

    if (file == NULL)
        return IEC_FILE_TOO_MANY;
    call->result = use_file(file, LISTING);
    return 0;
}

/* Closes what was opened and whose handle no task knows. What is written of it is dropped. */
static RTS_I32 undo_open(const APP_CALL *call)
{
    OPEN_FILE *file = NULL;

    if (call->operation == IEC_FILE_OPEN || call->operation == IEC_FILE_OPEN_DIR)
        file = find_open(call->result);
    if (file == NULL)
        return 0;
    if (file->use == WRITING)
        FileStoreAbort();
    file->use = CLOSED;
    return 0;
}

/* In main. */
static RTS_I32 carry_out(APP_CALL *call)
{
    if (call->error == APP_CALL_ABANDONED)
        return undo_open(call);
    switch (call->operation) {
    case IEC_FILE_OPEN:
    case IEC_FILE_DELETE:
    case IEC_FILE_RENAME:
    case IEC_FILE_SIZE:
        break;
    case IEC_FILE_OPEN_DIR:
        return open_list(call);
    default:
        return do_with_open(call);
    }
    if (call->result == 0 && !AppCallIsText(call)) /* a file that is copied has its handle there */
        return IEC_FILE_WRONG_PARAMETER;
    switch (call->operation) {
    case IEC_FILE_OPEN:
        return open_file(call);
    case IEC_FILE_DELETE:
        return delete_file((const char *)call->data);
    case IEC_FILE_RENAME:
        return rename_file(call);
    default:
        return get_size(call);
    }
}

/* ---- what the library calls ---- */

static RTS_I32 file_call(RTS_UI32 operation, RTS_UI32 handle, RTS_UI32 value)
{
    const APP_CALL_ARGUMENTS arguments = {operation, handle, value};

    return AppCallTake(carry_out, &arguments);
}

APP_GATE(file_call);

static const CMP_EXT_FUNCTION functions[] = {
    {"file_call", 0x87E40C09, VERSION, (RTS_PFN)APP_GATED(file_call)}, /* file_call(UDINT,UDINT,UDINT):DINT */
};

/* What the program has not closed. */
static void end_with_variables(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    if (find_writer() != NULL)
        FileStoreAbort();
    for (RTS_UI32 i = 0; i < IEC_FILES; i++)
        files.file[i].use = CLOSED;
}

RTS_RESULT IecFile_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(files);
    if (hook != CH_INIT3)
        return ERR_OK;
    RTS_RESULT result = EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_PrepareExit, end_with_variables, NULL);
    return result == ERR_OK ? CMRegisterExternal(functions, RTS_COUNT(functions)) : result;
}

#endif
