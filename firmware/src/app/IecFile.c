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
    bool updates; /* what of `entry` is not written over stays */
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
    file->updates = false;
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
    case ERR_ENTRIES_REMAINING:
        return IEC_FILE_NOT_EMPTY;
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

/* The same of one that is to be written: its folder is there. */
static RTS_I32 check_new(const char *name)
{
    RTS_I32 error = check_own(name);

    return error == 0 && !FileStoreHasFolderOf(name) ? IEC_FILE_NOT_EXIST : error;
}

/* The second string of the data; NULL if it has no end. */
static const char *second_name(const APP_CALL *call)
{
    RTS_UI32 length = (RTS_UI32)strlen((const char *)call->data) + 1;

    return memchr(call->data + length, '\0', call->size - length) != NULL ? (const char *)call->data + length : NULL;
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

/* Waits while a tool writes a file. It begins with the content of `previous`, NULL: it is empty. If the file is updated, that
 * comes later, up to where it is written over. */
static RTS_I32 open_to_write(APP_CALL *call, OPEN_FILE *file, const char *name, const FILE_ENTRY *previous,
                             bool updates)
{
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
    call->result = use_file(file, previous != NULL && !updates ? COPYING : WRITING);
    file->updates = updates;
    return file->use == COPYING ? APP_CALL_PENDING : 0;
}

static RTS_RESULT write_bytes(OPEN_FILE *file, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_RESULT result = FileStoreWrite(data, size);

    if (result == ERR_OK)
        file->crc = CRC32Update(file->crc, data, size);
    return result;
}

/* Writes the next part of the previous file, at most up to `end`. The name is no longer needed: the data of the call are the
 * buffer. */
static RTS_RESULT copy_part(APP_CALL *call, OPEN_FILE *file, RTS_UI32 end)
{
    RTS_UI32 size = end - FileStorePosition();
    RTS_RESULT result;

    if (size > sizeof call->data)
        size = sizeof call->data;
    result = FileStoreRead(&file->entry, FileStorePosition(), call->data, size);
    return result == ERR_OK ? write_bytes(file, call->data, size) : result;
}

/* Gives up a file that is written: the previous one stays. */
static RTS_I32 give_up(OPEN_FILE *file, RTS_RESULT result)
{
    FileStoreAbort();
    file->use = CLOSED;
    return error_of(result);
}

/* Some parts in a pass, so that communication goes on. */
static RTS_I32 copy_up_to(APP_CALL *call, OPEN_FILE *file, RTS_UI32 end)
{
    for (RTS_UI32 i = 0; i < COPIES && FileStorePosition() < end; i++) {
        RTS_RESULT result = copy_part(call, file, end);
        if (result != ERR_OK)
            return give_up(file, result);
    }
    return FileStorePosition() < end ? APP_CALL_PENDING : 0;
}

static RTS_I32 copy_all(APP_CALL *call, OPEN_FILE *file)
{
    RTS_I32 error = copy_up_to(call, file, file->entry.size);

    if (error == 0)
        file->use = WRITING;
    return error;
}

/* Modes in which a file is written. */
static bool writes(RTS_UI32 mode)
{
    return mode == IEC_FILE_MODE_WRITE || mode == IEC_FILE_MODE_APPEND || mode == IEC_FILE_MODE_APPEND_OR_CREATE ||
           mode == IEC_FILE_MODE_UPDATE || mode == IEC_FILE_MODE_UPDATE_OR_CREATE;
}

static RTS_I32 begin_to_write(APP_CALL *call, OPEN_FILE *file, const char *name)
{
    const FILE_ENTRY *previous = FileStoreFind(name);
    RTS_UI32 mode = call->value;
    RTS_I32 error = check_new(name);

    if (error != 0)
        return error;
    if ((mode == IEC_FILE_MODE_APPEND || mode == IEC_FILE_MODE_UPDATE) && previous == NULL)
        return IEC_FILE_NOT_EXIST;
    if (find_writer() != NULL)
        return IEC_FILE_TOO_MANY;
    return open_to_write(call, file, name, mode == IEC_FILE_MODE_WRITE ? NULL : previous,
                         mode == IEC_FILE_MODE_UPDATE || mode == IEC_FILE_MODE_UPDATE_OR_CREATE);
}

static RTS_I32 open_file(APP_CALL *call)
{
    const char *name = (const char *)call->data;
    OPEN_FILE *file = find_open(call->result); /* that is copied */

    if (file != NULL)
        return copy_all(call, file);
    if (!FileStoreIsName(name))
        return IEC_FILE_WRONG_PARAMETER;
    file = find_closed();
    if (file == NULL)
        return IEC_FILE_TOO_MANY;
    if (call->value == IEC_FILE_MODE_READ)
        return open_to_read(call, file, name);
    return writes(call->value) ? begin_to_write(call, file, name) : IEC_FILE_NOT_IMPLEMENTED;
}

/* ---- what is open ---- */

static RTS_I32 close_file(APP_CALL *call, OPEN_FILE *file)
{
    bool was_written = file->use == WRITING;
    RTS_I32 error = was_written && file->updates ? copy_up_to(call, file, file->entry.size) : 0;

    if (error != 0)
        return error;
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

/* Of a file that is written only forward, over what stays of the previous one. */
static RTS_I32 set_position(APP_CALL *call, OPEN_FILE *file)
{
    RTS_UI32 position = call->value;
    RTS_UI32 most = file->use == WRITING && !file->updates ? 0 : file->entry.size;

    if (file->use == WRITING && position == FileStorePosition())
        return 0;
    if (position > most || (file->use == WRITING && position < FileStorePosition()))
        return IEC_FILE_WRONG_PARAMETER;
    if (file->use == WRITING)
        return copy_up_to(call, file, position);
    file->position = position;
    return 0;
}

/* The rest of a name after the path of a folder, NULL if it is not in it. */
static const char *rest_in(const FILE_ENTRY *file, const char *folder)
{
    RTS_SIZE length = strlen(folder);

    if (file == NULL)
        return NULL;
    if (length == 0)
        return file->name;
    if (strncmp(file->name, folder, length) != 0 || file->name[length] != '/')
        return NULL;
    return file->name[length + 1] != '\0' ? file->name + length + 1 : NULL;
}

/* Characters of the first name in `rest`, with the `/` of a folder. */
static RTS_SIZE length_of_first(const char *rest)
{
    const char *end = strchr(rest, '/');

    return end != NULL ? (RTS_SIZE)(end - rest) + 1 : strlen(rest);
}

/* True if an entry before `index` begins with the same folder. */
static bool was_listed(const char *folder, RTS_UI32 index, const char *rest, RTS_SIZE length)
{
    for (RTS_UI32 i = 0; i < index; i++) {
        const char *earlier = rest_in(FileStoreGet(i), folder);
        if (earlier != NULL && strncmp(earlier, rest, length) == 0)
            return rest[length - 1] == '/';
    }
    return false;
}

/* The position of a list is the index of the entry that comes next. */
static RTS_I32 list(APP_CALL *call, OPEN_FILE *file)
{
    while (file->position < FILE_STORE_FILES) {
        RTS_UI32 index = file->position++;
        const FILE_ENTRY *entry = FileStoreGet(index);
        const char *rest = rest_in(entry, file->entry.name);
        if (rest == NULL || was_listed(file->entry.name, index, rest, length_of_first(rest)))
            continue;
        memset(call->data, 0, sizeof entry->name);
        memcpy(call->data, rest, length_of_first(rest));
        call->size = sizeof entry->name;
        call->result = strchr(rest, '/') == NULL ? entry->size : 0;
        return 0;
    }
    return IEC_FILE_NO_MORE_ENTRIES;
}

static RTS_I32 do_with_open(APP_CALL *call)
{
    OPEN_FILE *file = find_open(call->handle);
    USE needed = call->operation == IEC_FILE_WRITE ? WRITING : call->operation == IEC_FILE_LIST ? LISTING : READING;

    if (file == NULL || file->use == COPYING) /* a program that guesses its handle */
        return IEC_FILE_HANDLE_INVALID;
    if (call->operation == IEC_FILE_CLOSE)
        return close_file(call, file);
    if ((call->operation == IEC_FILE_GET_POS || call->operation == IEC_FILE_OPEN_SIZE) && file->use == WRITING) {
        call->result = FileStorePosition();
        return 0;
    }
    if (call->operation == IEC_FILE_SET_POS && file->use == WRITING)
        needed = WRITING;
    if (file->use != needed)
        return IEC_FILE_HANDLE_INVALID;
    switch (call->operation) {
    case IEC_FILE_READ:
        return read_file(call, file);
    case IEC_FILE_WRITE:
        return write_file(call, file);
    case IEC_FILE_SET_POS:
        return set_position(call, file);
    case IEC_FILE_GET_POS:
        call->result = file->position;
        return 0;
    case IEC_FILE_OPEN_SIZE:
        call->result = file->entry.size;
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
    const char *new_name = second_name(call);
    RTS_I32 error = check_own(name);

    if (new_name == NULL)
        return IEC_FILE_WRONG_PARAMETER;
    if (error == 0)
        error = check_new(new_name);
    if (error == 0 && (is_written(name) || is_written(new_name)))
        error = IEC_FILE_TOO_MANY;
    return error == 0 ? error_of(FileStoreRename(name, new_name)) : error;
}

/* The first pass of a copy. */
static RTS_I32 begin_copy(APP_CALL *call)
{
    const char *name = (const char *)call->data;
    const char *new_name = second_name(call);
    const FILE_ENTRY *source = FileStoreFind(name);
    OPEN_FILE *file = find_closed();
    RTS_I32 error;

    if (!FileStoreIsName(name) || new_name == NULL || strcmp(name, new_name) == 0)
        return IEC_FILE_WRONG_PARAMETER;
    if (source == NULL)
        return IEC_FILE_NOT_EXIST;
    error = check_new(new_name);
    if (error != 0)
        return error;
    if (call->value == 0 && FileStoreFind(new_name) != NULL)
        return IEC_FILE_EXIST;
    if (file == NULL || find_writer() != NULL)
        return IEC_FILE_TOO_MANY;
    return open_to_write(call, file, new_name, source, false);
}

static RTS_I32 copy_file(APP_CALL *call)
{
    OPEN_FILE *file = find_open(call->result);
    RTS_I32 error;

    if (file == NULL)
        return begin_copy(call);
    error = copy_all(call, file);
    if (error != 0)
        return error;
    call->result = file->entry.size;
    return close_file(call, file);
}

/* ---- folders ---- */

/* The file that the program writes is not moved away under it. */
static bool is_written_in(const char *folder)
{
    const OPEN_FILE *writer = find_writer();

    return writer != NULL && rest_in(&writer->entry, folder) != NULL;
}

/* Those above it, from the first on. */
static RTS_RESULT create_folders_above(const char *path)
{
    char folder[FILE_NAME_MAX + 1] = "";
    RTS_RESULT result = ERR_OK;

    for (RTS_UI32 i = 0; i < FILE_NAME_MAX && path[i] != '\0' && result == ERR_OK; i++) {
        if (path[i] == '/' && !FileStoreIsFolder(folder))
            result = FileStoreCreateFolder(folder);
        folder[i] = path[i];
    }
    return result;
}

static RTS_I32 create_folder(const APP_CALL *call)
{
    const char *path = (const char *)call->data;
    RTS_RESULT result = ERR_OK;

    if (!FileStoreIsName(path))
        return IEC_FILE_WRONG_PARAMETER;
    if (call->value != 0)
        result = create_folders_above(path);
    return error_of(result == ERR_OK ? FileStoreCreateFolder(path) : result);
}

static RTS_I32 delete_folder(const APP_CALL *call)
{
    const char *path = (const char *)call->data;

    return is_written_in(path) ? IEC_FILE_TOO_MANY : error_of(FileStoreDeleteFolder(path, call->value != 0));
}

static RTS_I32 rename_folder(const APP_CALL *call)
{
    const char *path = (const char *)call->data;
    const char *new_path = second_name(call);

    if (new_path == NULL)
        return IEC_FILE_WRONG_PARAMETER;
    if (is_written_in(path))
        return IEC_FILE_TOO_MANY;
    if (FileStoreIsName(new_path) && !FileStoreHasFolderOf(new_path))
        return IEC_FILE_NOT_EXIST;
    return error_of(FileStoreRenameFolder(path, new_path));
}

static RTS_I32 is_folder(APP_CALL *call)
{
    const char *path = (const char *)call->data;

    if (path[0] != '\0' && !FileStoreIsName(path))
        return IEC_FILE_WRONG_PARAMETER;
    call->result = FileStoreIsFolder(path);
    return 0;
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
    const char *path = (const char *)call->data;
    OPEN_FILE *file = find_closed();

    if (path[0] != '\0' && !FileStoreIsName(path))
        return IEC_FILE_WRONG_PARAMETER;
    if (!FileStoreIsFolder(path))
        return IEC_FILE_NOT_EXIST;
    if (file == NULL)
        return IEC_FILE_TOO_MANY;
    memcpy(file->entry.name, path, strlen(path) + 1);
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

/* What has a name, or two. */
static RTS_I32 do_with_name(APP_CALL *call)
{
    switch (call->operation) {
    case IEC_FILE_OPEN:
        return open_file(call);
    case IEC_FILE_DELETE:
        return delete_file((const char *)call->data);
    case IEC_FILE_RENAME:
        return rename_file(call);
    case IEC_FILE_SIZE:
        return get_size(call);
    case IEC_FILE_OPEN_DIR:
        return open_list(call);
    case IEC_FILE_COPY:
        return copy_file(call);
    case IEC_FILE_CREATE_DIR:
        return create_folder(call);
    case IEC_FILE_DELETE_DIR:
        return delete_folder(call);
    case IEC_FILE_RENAME_DIR:
        return rename_folder(call);
    default:
        return is_folder(call);
    }
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
    case IEC_FILE_OPEN_DIR:
    case IEC_FILE_COPY:
    case IEC_FILE_CREATE_DIR:
    case IEC_FILE_DELETE_DIR:
    case IEC_FILE_RENAME_DIR:
    case IEC_FILE_IS_DIR:
        break;
    default:
        return do_with_open(call);
    }
    if (call->result == 0 && !AppCallIsText(call)) /* a file that is copied has its handle there */
        return IEC_FILE_WRONG_PARAMETER;
    return do_with_name(call);
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
