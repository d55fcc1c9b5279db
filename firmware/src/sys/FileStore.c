/*
 * FileStore.c - files that tools keep on the device.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "FileStore.h"

#include <string.h>

#include "CmpLog.h"
#include "SysFileFlash.h"
#include "SysFlash.h"
#include "SysFlashLog.h"
#include "rts_config.h"

#if FILE_STORE_FILES > 0

enum { CATALOG_TAG = 0x454C4946 };

typedef struct {
    FILE_ENTRY file[FILE_STORE_FILES];
} CATALOG;

static struct {
    FLASH_LOG log;
    RTS_RESULT opened;
    CATALOG catalog;
    bool writing;
    RTS_UI32 written;
    FILE_ENTRY next; /* that is written */
} store;

/* ---- names and places ---- */

static bool is_name_character(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
           c == '-';
}

/* Returns the characters of a path of names with `/` between them, 0 if there is anything else in it. */
static RTS_UI32 length_of_path(const char *path)
{
    bool begins = true; /* a name */
    RTS_UI32 length;

    for (length = 0; length <= FILE_NAME_MAX && path[length] != '\0'; length++) {
        char c = path[length];
        if (begins ? !is_name_character(c) || c == '.' : !is_name_character(c) && c != '/')
            return 0;
        begins = c == '/';
    }
    return length <= FILE_NAME_MAX ? length : 0;
}

bool FileStoreIsName(const char *name)
{
    RTS_UI32 length = length_of_path(name);

    return length > 0 && name[length - 1] != '/';
}

/* The entry of a folder has a `/` at its end. */
static bool is_mark(const char *name)
{
    RTS_UI32 length = length_of_path(name);

    return length > 0 && name[length - 1] == '/';
}

/* Bytes of flash that a file takes: whole sectors. */
static RTS_UI32 span(RTS_UI32 size)
{
    RTS_UI32 sector = SysFlashGet()->sector_size;

    return (size + sector - 1) & ~(sector - 1);
}

static RTS_UI32 capacity(void)
{
    return SysFileGetArea(FILE_STORE)->size;
}

const FILE_ENTRY *FileStoreGet(RTS_UI32 index)
{
    return index < FILE_STORE_FILES && store.catalog.file[index].name[0] != '\0' ? &store.catalog.file[index] : NULL;
}

static FILE_ENTRY *find(const char *name)
{
    for (RTS_UI32 i = 0; i < FILE_STORE_FILES; i++)
        if (strcmp(store.catalog.file[i].name, name) == 0)
            return &store.catalog.file[i];
    return NULL;
}

const FILE_ENTRY *FileStoreFind(const char *name)
{
    return name[0] == '\0' ? NULL : find(name);
}

/* Bytes from `start` to the next file, 0 within one. */
static RTS_UI32 room_at(RTS_UI32 start)
{
    RTS_UI32 end = capacity();

    for (RTS_UI32 i = 0; i < FILE_STORE_FILES; i++) {
        const FILE_ENTRY *file = FileStoreGet(i);
        if (file == NULL || file->start + span(file->size) <= start)
            continue;
        if (file->start <= start)
            return 0;
        if (file->start < end)
            end = file->start;
    }
    return end - start;
}

/* Where a gap may begin: at the start, and after each file. */
static RTS_UI32 gap(RTS_UI32 index)
{
    const FILE_ENTRY *file = FileStoreGet(index);

    return file == NULL ? 0 : file->start + span(file->size);
}

/* ---- folders ---- */

/* True if the file, or the folder, of the name is below the folder with this path, or is it. */
static bool is_below(const char *name, const char *folder)
{
    RTS_SIZE length = strlen(folder);

    return strncmp(name, folder, length) == 0 && name[length] == '/';
}

bool FileStoreIsFolder(const char *path)
{
    for (RTS_UI32 i = 0; i < FILE_STORE_FILES; i++) {
        if (is_below(store.catalog.file[i].name, path))
            return true;
    }
    return path[0] == '\0';
}

/* ERR_DUPLICATE if a folder has the name, or a file that of one of its folders. */
static RTS_RESULT check_way(const char *name)
{
    if (FileStoreIsFolder(name))
        return ERR_DUPLICATE;
    for (RTS_UI32 i = 0; i < FILE_STORE_FILES; i++) {
        const FILE_ENTRY *file = FileStoreGet(i);
        if (file != NULL && !is_mark(file->name) && is_below(name, file->name))
            return ERR_DUPLICATE;
    }
    return ERR_OK;
}

bool FileStoreHasFolderOf(const char *path)
{
    const char *end = strrchr(path, '/');
    char folder[FILE_NAME_MAX + 1] = "";

    if (end != NULL)
        memcpy(folder, path, (RTS_SIZE)(end - path));
    return FileStoreIsFolder(folder);
}

static RTS_UI32 largest_gap(RTS_UI32 *start)
{
    RTS_UI32 largest = 0;

    for (RTS_UI32 i = 0; i <= FILE_STORE_FILES; i++) {
        RTS_UI32 room = room_at(gap(i));
        if (room <= largest)
            continue;
        largest = room;
        *start = gap(i);
    }
    return largest;
}

/* The smallest gap that has `size` bytes; false if there is none. */
static bool find_place(RTS_UI32 size, RTS_UI32 *start)
{
    RTS_UI32 smallest = UINT32_MAX;

    for (RTS_UI32 i = 0; i <= FILE_STORE_FILES; i++) {
        RTS_UI32 room = room_at(gap(i));
        if (room < size || room >= smallest)
            continue;
        smallest = room;
        *start = gap(i);
    }
    return smallest != UINT32_MAX;
}

RTS_UI32 FileStoreRoom(void)
{
    RTS_UI32 start;

    return store.opened != ERR_OK || find("") == NULL ? 0 : largest_gap(&start);
}

/* ---- the catalog ---- */

/* A record may hold anything. */
static bool is_valid(const FILE_ENTRY *file)
{
    return memchr(file->name, '\0', sizeof(file->name)) != NULL && length_of_path(file->name) > 0 &&
           (!is_mark(file->name) || file->size == 0) && file->size <= capacity() &&
           file->start <= capacity() - file->size && span(file->start) == file->start;
}

static void read_catalog(void)
{
    store.opened = FlashLogReadNewest(&store.log, CATALOG_TAG, &store.catalog, sizeof(store.catalog));
    if (store.opened == ERR_NO_OBJECT) {
        memset(&store.catalog, 0, sizeof(store.catalog));
        store.opened = ERR_OK;
        if (store.log.sequence != 0)
            LogAdd(CMPID_CmpFileTransfer, LOG_WARNING, ERR_VERSION_MISMATCH, "Files are of another firmware");
    }
    for (RTS_UI32 i = 0; i < FILE_STORE_FILES; i++)
        if (!is_valid(&store.catalog.file[i]))
            memset(&store.catalog.file[i], 0, sizeof(FILE_ENTRY));
}

void FileStoreOpen(void)
{
    memset(&store, 0, sizeof(store));
    store.opened = ERR_DEVICE;
    if (capacity() == 0)
        return;
    store.opened = FlashLogOpen(&store.log, FILE_CATALOG);
    if (store.opened == ERR_OK)
        read_catalog();
}

/* Sets an entry, and writes the catalog. On an error the entry is as it was, in flash too if that can be. */
static RTS_RESULT change(FILE_ENTRY *place, const FILE_ENTRY *value)
{
    const FILE_ENTRY before = *place;

    *place = *value;
    RTS_RESULT result = FlashLogAppend(&store.log, CATALOG_TAG, &store.catalog, sizeof(store.catalog));
    if (result == ERR_OK)
        return ERR_OK;
    *place = before;
    (void)FlashLogAppend(&store.log, CATALOG_TAG, &store.catalog, sizeof(store.catalog));
    LogAdd(CMPID_CmpFileTransfer, LOG_ERROR, result, "The catalog of the files cannot be written");
    return result;
}

/* ---- writing ---- */

/* Whether a file of that name can begin. */
static RTS_RESULT check_name(const char *name)
{
    if (!FileStoreIsName(name))
        return ERR_PARAMETER;
    return store.opened == ERR_OK ? check_way(name) : store.opened;
}

/* The entry that the file will have. */
static FILE_ENTRY *place_of(const char *name)
{
    FILE_ENTRY *place = find(name);

    return place == NULL ? find("") : place;
}

static void begin_at_place(const char *name)
{
    memset(store.next.name, 0, sizeof(store.next.name));
    memcpy(store.next.name, name, strlen(name));
    store.written = 0;
    store.writing = true;
    SysFileCreateAt(FILE_STORE, store.next.start);
}

RTS_RESULT FileStoreBegin(const char *name, RTS_UI32 size, RTS_UI32 crc)
{
    RTS_RESULT result = check_name(name);

    FileStoreAbort();
    if (result != ERR_OK)
        return result;
    if (size > capacity() || place_of(name) == NULL || !find_place(span(size), &store.next.start))
        return ERR_DISK_FULL;
    store.next.size = size;
    store.next.crc = crc;
    begin_at_place(name);
    return ERR_OK;
}

RTS_RESULT FileStoreCreate(const char *name)
{
    RTS_RESULT result = check_name(name);

    FileStoreAbort();
    if (result != ERR_OK)
        return result;
    if (place_of(name) == NULL)
        return ERR_DISK_FULL;
    store.next.start = 0; /* of an empty file in a store that is full */
    store.next.size = largest_gap(&store.next.start);
    begin_at_place(name);
    return ERR_OK;
}

RTS_RESULT FileStoreWrite(const RTS_UI8 *data, RTS_UI32 size)
{
    if (!store.writing)
        return ERR_INVALID_SEQUENCE;
    if (size > store.next.size - store.written)
        return ERR_FT_FILE_SIZE_MISMATCH;
    RTS_RESULT result = SysFileWrite(FILE_STORE, data, size);
    store.written += size;
    if (result != ERR_OK)
        FileStoreAbort();
    return result;
}

bool FileStoreIsWriting(void)
{
    return store.writing;
}

RTS_UI32 FileStorePosition(void)
{
    return store.written;
}

/* That what is in flash is what was to be written. */
static RTS_RESULT check_written(void)
{
    RTS_UI32 crc = 0;
    RTS_RESULT result = SysFileCRC32(FILE_STORE, store.next.start, store.next.size, &crc);

    if (result != ERR_OK)
        return result;
    return crc == store.next.crc ? ERR_OK : ERR_FT_CRC_MISMATCH;
}

RTS_RESULT FileStoreEnd(void)
{
    if (!store.writing)
        return ERR_INVALID_SEQUENCE;
    store.writing = false;
    if (store.written != store.next.size)
        return ERR_FT_FILE_SIZE_MISMATCH;
    RTS_RESULT result = SysFileClose(FILE_STORE);
    if (result == ERR_OK)
        result = check_written();
    return result == ERR_OK ? change(place_of(store.next.name), &store.next) : result;
}

RTS_RESULT FileStoreFinish(RTS_UI32 crc)
{
    store.next.size = store.written;
    store.next.crc = crc;
    return FileStoreEnd();
}

void FileStoreAbort(void)
{
    store.writing = false;
    store.written = 0;
}

/* ---- reading and deleting ---- */

RTS_RESULT FileStoreRead(const FILE_ENTRY *entry, RTS_UI32 offset, void *data, RTS_UI32 size)
{
    const FILE_ENTRY *file = FileStoreFind(entry->name);

    if (file == NULL || memcmp(file, entry, sizeof(*file)) != 0)
        return ERR_NO_CONSISTENCY;
    if (size > file->size || offset > file->size - size)
        return ERR_OUT_OF_LIMITS;
    return SysFileRead(FILE_STORE, file->start + offset, data, size);
}

RTS_RESULT FileStoreDelete(const char *name)
{
    static const FILE_ENTRY none;

    if (store.opened != ERR_OK)
        return store.opened;
    if (FileStoreFind(name) == NULL)
        return ERR_NO_OBJECT;
    return change(find(name), &none);
}

RTS_RESULT FileStoreRename(const char *name, const char *new_name)
{
    RTS_RESULT result = check_name(new_name);

    if (result != ERR_OK)
        return result;
    if (FileStoreFind(name) == NULL)
        return ERR_NO_OBJECT;
    if (FileStoreFind(new_name) != NULL)
        return ERR_DUPLICATE;
    FILE_ENTRY renamed = *FileStoreFind(name);
    memset(renamed.name, 0, sizeof(renamed.name));
    memcpy(renamed.name, new_name, strlen(new_name));
    return change(find(name), &renamed);
}

/* ---- making and deleting folders ---- */

/* The entry of a folder that is made; false if the path is too long for one. */
static bool make_mark(FILE_ENTRY *mark, const char *path)
{
    RTS_SIZE length = strlen(path);

    memset(mark, 0, sizeof(*mark));
    if (!FileStoreIsName(path) || length >= FILE_NAME_MAX)
        return false;
    memcpy(mark->name, path, length);
    mark->name[length] = '/';
    return true;
}

RTS_RESULT FileStoreCreateFolder(const char *path)
{
    FILE_ENTRY mark;
    RTS_RESULT result = make_mark(&mark, path) ? check_name(path) : (RTS_RESULT)ERR_PARAMETER;

    if (result != ERR_OK)
        return result;
    if (FileStoreFind(path) != NULL)
        return ERR_DUPLICATE;
    if (!FileStoreHasFolderOf(path))
        return ERR_NO_OBJECT;
    return find("") == NULL ? (RTS_RESULT)ERR_DISK_FULL : change(find(""), &mark);
}

/* Writes a catalog of which several entries have changed. On an error it is what flash has. */
static RTS_RESULT write_changed(void)
{
    RTS_RESULT result = FlashLogAppend(&store.log, CATALOG_TAG, &store.catalog, sizeof(store.catalog));

    if (result != ERR_OK)
        read_catalog();
    return result;
}

/* ERR_PARAMETER not a path of a folder, ERR_NO_OBJECT there is none. */
static RTS_RESULT check_folder(const char *path)
{
    if (!FileStoreIsName(path))
        return ERR_PARAMETER;
    if (store.opened != ERR_OK)
        return store.opened;
    return FileStoreIsFolder(path) ? (RTS_RESULT)ERR_OK : ERR_NO_OBJECT;
}

/* True if nothing but its own entry is in the folder. */
static bool is_empty(const char *path)
{
    RTS_SIZE length = strlen(path) + 1;

    for (RTS_UI32 i = 0; i < FILE_STORE_FILES; i++) {
        const char *name = store.catalog.file[i].name;
        if (is_below(name, path) && name[length] != '\0')
            return false;
    }
    return true;
}

RTS_RESULT FileStoreDeleteFolder(const char *path, bool with_files)
{
    RTS_RESULT result = check_folder(path);

    if (result != ERR_OK)
        return result;
    if (!with_files && !is_empty(path))
        return ERR_ENTRIES_REMAINING;
    for (RTS_UI32 i = 0; i < FILE_STORE_FILES; i++) {
        FILE_ENTRY *file = &store.catalog.file[i];
        if (is_below(file->name, path))
            memset(file, 0, sizeof(*file));
    }
    return write_changed();
}

/* Replaces the path of a folder in the name of what is in it; false if the name becomes too long. With `commit` false it only
 * looks. */
static bool move(FILE_ENTRY *file, const char *path, const char *new_path, bool commit)
{
    RTS_SIZE before = strlen(path);
    RTS_SIZE after = strlen(new_path);
    RTS_SIZE rest = strlen(file->name + before);
    char name[sizeof(file->name)] = "";

    if (after + rest > FILE_NAME_MAX)
        return false;
    memcpy(name, new_path, after);
    memcpy(name + after, file->name + before, rest);
    if (commit)
        memcpy(file->name, name, sizeof(name));
    return true;
}

static bool move_all(const char *path, const char *new_path, bool commit)
{
    for (RTS_UI32 i = 0; i < FILE_STORE_FILES; i++) {
        FILE_ENTRY *file = &store.catalog.file[i];
        if (is_below(file->name, path) && !move(file, path, new_path, commit))
            return false;
    }
    return true;
}

RTS_RESULT FileStoreRenameFolder(const char *path, const char *new_path)
{
    RTS_RESULT result = check_folder(path);

    if (result == ERR_OK)
        result = check_name(new_path);
    if (result != ERR_OK)
        return result;
    if (FileStoreFind(new_path) != NULL)
        return ERR_DUPLICATE;
    if (is_below(new_path, path) || !move_all(path, new_path, false))
        return ERR_PARAMETER;
    (void)move_all(path, new_path, true);
    return write_changed();
}

#endif
