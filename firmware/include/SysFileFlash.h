/*
 * SysFileFlash.h - a fixed set of files on SysFlash. Manual 3.10.5.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Where the files are: FILE_MAP of rts_config_port.h, or computed from the size of the flash. A file is written in
 * sequence, in units of FILE_ALIGN bytes; sectors are erased when the first unit of them is due, no byte is programmed
 * twice. All from main.
 */
#ifndef SYSFILEFLASH_H
#define SYSFILEFLASH_H

#include "CmpErrors.h"
#include "CmpItf.h"
#include "CmpStd.h"
#ifndef RTS_CFFI
#include "rts_config.h"
#endif

/* The files. Commit and retain are record logs (SysFlashLog.h). */
enum { FILE_SLOT_A = 0, FILE_SLOT_B = 1, FILE_COMMIT = 2, FILE_RETAIN = 3, FILE_COUNT = 4 };

/* With FILE_STORE_FILES also those of FileStore.h, at the end of the flash; the catalog is a record log. They have no
 * bytes where FILE_STORE_SIZE is too small. */
enum { FILE_CATALOG = 4, FILE_STORE = 5 };

/* With LOG_KEEP the log that survives power-off (CmpLogKeep.h), a record log in the last LOG_KEEP_SIZE bytes of the flash. */
#ifndef RTS_CFFI
enum { FILE_KEPT = FILE_STORE_FILES > 0 ? 6 : 4 };
#endif

/* Bytes that are programmed at a time; all program sizes divide it. */
enum { FILE_ALIGN = 16 };
#define SysFileAlign(size) (((size) + FILE_ALIGN - 1) & ~(RTS_UI32)(FILE_ALIGN - 1))

/* Where a file is in flash: both multiples of the sector size. */
typedef struct {
    RTS_UI32 offset;
    RTS_UI32 size;
} FILE_AREA;

/*
 * Where they are in a flash of `size` bytes when the port does not say: both logs are after the slots, which share what is
 * left. A half of the retain log is a sixteenth of the flash and a sector. Nothing else counts, so that firmware of other
 * sizes finds what this one has written. The slots have no bytes where the flash is too small.
 */
#define FILE_COMMIT_SIZE(sector) (2 * (sector))
#define FILE_RETAIN_SIZE(size, sector) (2 * (sector) * ((size) / 16 / (sector) + 1))
#define FILE_LOGS_SIZE(size, sector) (FILE_COMMIT_SIZE(sector) + FILE_RETAIN_SIZE(size, sector))
#define FILE_SLOT_SIZE(size, sector) \
    ((size) > FILE_LOGS_SIZE(size, sector) ? ((size) - FILE_LOGS_SIZE(size, sector)) / 2 / (sector) * (sector) : 0)
#define FILE_MAP_OF(size, sector)                                                                    \
    {0, FILE_SLOT_SIZE(size, sector)}, {FILE_SLOT_SIZE(size, sector), FILE_SLOT_SIZE(size, sector)}, \
        {2 * FILE_SLOT_SIZE(size, sector), FILE_COMMIT_SIZE(sector)},                                \
    {                                                                                                \
        2 * FILE_SLOT_SIZE(size, sector) + FILE_COMMIT_SIZE(sector), FILE_RETAIN_SIZE(size, sector)  \
    }

#ifndef RTS_CFFI
const FILE_AREA *SysFileGetArea(RTS_UI32 file);

/* Opens for writing from the start; erases as it goes. */
void SysFileCreate(RTS_UI32 file);

/* Opens for writing at `position`, a multiple of the sector size; erases as it goes. */
void SysFileCreateAt(RTS_UI32 file, RTS_UI32 position);

/* Opens for writing at `position`, a multiple of FILE_ALIGN, of what is erased already. */
void SysFileAppend(RTS_UI32 file, RTS_UI32 position);

/* Appends. ERR_DISK_FULL beyond the end of the file, nothing is written then; ERR_DEVICE flash fault. */
RTS_RESULT SysFileWrite(RTS_UI32 file, const void *data, RTS_UI32 size);

/* Appends `size` bytes, each of them the one `distance` before it. ERR_OUT_OF_LIMITS for distance 0, and before the start
 * of the file; else as SysFileWrite. */
RTS_RESULT SysFileCopy(RTS_UI32 file, RTS_UI32 distance, RTS_UI32 size);

/* Bytes written so far, the position of the next one. */
RTS_UI32 SysFileGetPos(RTS_UI32 file);

/* Programs what is still buffered, padded to a unit with the erased value, and syncs. */
RTS_RESULT SysFileClose(RTS_UI32 file);

/* Reads what is in flash. ERR_OUT_OF_LIMITS beyond the end of the file. */
RTS_RESULT SysFileRead(RTS_UI32 file, RTS_UI32 offset, void *data, RTS_UI32 size);

/* Goes on with the CRC-32 in *crc over `size` bytes at `offset`. Errors as SysFileRead; *crc is worthless then. */
RTS_RESULT SysFileCRC32(RTS_UI32 file, RTS_UI32 offset, RTS_UI32 size, RTS_UI32 *crc);

/* Erases [offset, offset + size), multiples of the sector size. */
RTS_RESULT SysFileErase(RTS_UI32 file, RTS_UI32 offset, RTS_UI32 size);

RTS_RESULT SysFileFlash_Hook(CMP_HOOK hook);
#endif

#endif
