/*
 * FileStore.h - files that tools keep on the device, by name.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * On SysFileFlash: the catalog is a record log, the contents are rows of sectors. A file is in the catalog when all of it
 * is in flash and its CRC is right. So a power cut leaves the previous file or the new one; until then both need room. One
 * file is written at a time. A name may have folders before it (`trend/may.csv`), whose names count. A folder is there while a
 * file is below it, or an entry of its own, whose name is the path and a `/`. All from main, from CH_INIT_SYSTEM2 of SysFileFlash on. With FILE_STORE_FILES only.
 */
#ifndef FILESTORE_H
#define FILESTORE_H

#include "CmpErrors.h"
#include "CmpSrvNumbers.h"
#include "CmpStd.h"

/* Files that the device makes itself: they are not in the store, and cannot be written or deleted. */
#define FILE_NAME_IMAGE "Application.cdl"
#define FILE_NAME_LOG "PlcLog.txt"

typedef struct {
    char name[FILE_NAME_MAX + 4]; /* NUL and zeros to its end; "" for an entry that is free */
    RTS_UI32 start;               /* in FILE_STORE, a multiple of the sector size */
    RTS_UI32 size;
    RTS_UI32 crc;
} FILE_ENTRY;

/* Reads the catalog. A flash fault leaves a store that refuses everything with ERR_DEVICE. */
void FileStoreOpen(void);

/* Whether a file may have this name: letters, digits and ". _ -", with "/" between the names of folders and the file, none of
 * which is empty or begins with "."; 1 to FILE_NAME_MAX characters. */
bool FileStoreIsName(const char *name);

/* Entry `index`, 0 to FILE_STORE_FILES - 1; NULL if it is free. */
const FILE_ENTRY *FileStoreGet(RTS_UI32 index);
/* The file of that name, NULL if there is none. */
const FILE_ENTRY *FileStoreFind(const char *name);

/* Bytes of the largest file that there is room for, 0 if there are FILE_STORE_FILES already. */
RTS_UI32 FileStoreRoom(void);

/* Begins a file; one that has begun and not ended is dropped. ERR_PARAMETER not a name; ERR_DUPLICATE a folder has it, or a
 * file that of one of its folders; ERR_DISK_FULL no room, or too many files; ERR_DEVICE. Folders need not be there. */
RTS_RESULT FileStoreBegin(const char *name, RTS_UI32 size, RTS_UI32 crc);
/* Begins a file whose size is known at its end: it has the largest gap until then. Errors as FileStoreBegin; FileStoreFinish
 * ends it. */
RTS_RESULT FileStoreCreate(const char *name);
/* Appends. ERR_INVALID_SEQUENCE not begun; ERR_FT_FILE_SIZE_MISMATCH more than was said; ERR_DEVICE, which drops it. */
RTS_RESULT FileStoreWrite(const RTS_UI8 *data, RTS_UI32 size);
/* Bytes written of the file that has begun. */
RTS_UI32 FileStorePosition(void);
/* Whether one has begun and not ended. */
bool FileStoreIsWriting(void);
/* Puts the file in place of the previous one of its name. ERR_FT_FILE_SIZE_MISMATCH bytes are missing,
 * ERR_FT_CRC_MISMATCH, ERR_DEVICE: the previous one stays. */
RTS_RESULT FileStoreEnd(void);
/* The same for a file of FileStoreCreate, with what has been written, whose CRC-32 this is. */
RTS_RESULT FileStoreFinish(RTS_UI32 crc);
void FileStoreAbort(void);

/* Reads from a file, of which `entry` is a copy. ERR_NO_CONSISTENCY it has been changed or deleted since,
 * ERR_OUT_OF_LIMITS past its end, ERR_DEVICE. */
RTS_RESULT FileStoreRead(const FILE_ENTRY *entry, RTS_UI32 offset, void *data, RTS_UI32 size);

/* ERR_NO_OBJECT there is none, ERR_DEVICE it is still there. */
RTS_RESULT FileStoreDelete(const char *name);

/* ERR_NO_OBJECT there is none, ERR_DUPLICATE there is one of the new name, or as FileStoreBegin, ERR_PARAMETER not a name,
 * ERR_DEVICE. */
RTS_RESULT FileStoreRename(const char *name, const char *new_name);

/* True if there is a folder with that path; "" is the one of all. */
bool FileStoreIsFolder(const char *path);
/* True if the folder is there in which the path ends. */
bool FileStoreHasFolderOf(const char *path);
/* ERR_PARAMETER not a path, or one of FILE_NAME_MAX characters, ERR_DUPLICATE there is a file or a folder of that name,
 * ERR_NO_OBJECT the folder for it is missing, ERR_DISK_FULL too many entries, ERR_DEVICE. */
RTS_RESULT FileStoreCreateFolder(const char *path);
/* ERR_PARAMETER, ERR_NO_OBJECT there is none, ERR_ENTRIES_REMAINING it is not empty, ERR_DEVICE. With its files all of them
 * are deleted, or after a power cut none. */
RTS_RESULT FileStoreDeleteFolder(const char *path, bool with_files);
/* As FileStoreRename, with all that is in it. ERR_PARAMETER also if a name becomes too long, or it would be in itself. */
RTS_RESULT FileStoreRenameFolder(const char *path, const char *new_path);

#endif
