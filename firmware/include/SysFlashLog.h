/*
 * SysFlashLog.h - records that survive a power cut at any point, appended to a file of SysFileFlash.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The file is two halves. Records are appended to one half until it is full; then the other is erased and takes over. A
 * record counts when its CRC is right, the one with the newest sequence number wins: a cut leaves the old or the new
 * one, never a mix. A user puts all it needs into each record, because previous records may be erased. All from main.
 */
#ifndef SYSFLASHLOG_H
#define SYSFLASHLOG_H

#include "CmpStd.h"

/* What a record begins with, at a multiple of FILE_ALIGN; its data follow. (Shared with the host.) */
typedef struct {
    RTS_UI32 magic; /* FLASH_LOG_MAGIC */
    RTS_UI32 sequence;
    RTS_UI32 tag;
    RTS_UI32 size; /* of the data in bytes */
    RTS_UI32 crc;  /* CRC-32 of the four words above and the data */
} FLASH_LOG_HEAD;

enum { FLASH_LOG_HEAD_SIZE = 20, FLASH_LOG_MAGIC = 0x474F4C52 };

#ifndef RTS_CFFI

#include "SysFileFlash.h"

RTS_STATIC_ASSERT(sizeof(FLASH_LOG_HEAD) == FLASH_LOG_HEAD_SIZE, record_head_size);

typedef struct {
    RTS_UI32 file;     /* not 0 */
    RTS_RESULT opened; /* nothing is appended to a log of which a part cannot be read */
    RTS_UI32 start;    /* of the half in use */
    RTS_UI32 used;     /* bytes of that half that may have been programmed */
    RTS_UI32 newest;   /* position of the newest record */
    RTS_UI32 sequence; /* its number, 0 when there is none */
    RTS_UI32 kept;     /* start of a half that is not erased; FLASH_LOG_NONE */
} FLASH_LOG;

#define FLASH_LOG_NONE 0xFFFFFFFFu

/* Finds the newest record and the place for the next. ERR_DEVICE: a part cannot be read; the log has what the remaining
 * part says, and takes no records, because a later start may find a newer one. */
RTS_RESULT FlashLogOpen(FLASH_LOG *log, RTS_UI32 file);

/* Reads the newest record into `data`; ERR_NO_OBJECT when there is none or it has another tag or size. */
RTS_RESULT FlashLogReadNewest(const FLASH_LOG *log, RTS_UI32 tag, void *data, RTS_UI32 size);

/* Which records to read: those numbered after `after`, up to and with `until`. Numbers wrap. */
typedef struct {
    RTS_UI32 after;
    RTS_UI32 until;
} FLASH_LOG_RANGE;

/* Reads the newest record of the range with this tag and size into `data`. ERR_NO_OBJECT when there is none, ERR_DEVICE
 * when it may be in a part that cannot be read; `data` is as it was then. */
RTS_RESULT FlashLogRead(const FLASH_LOG *log, FLASH_LOG_RANGE range, RTS_UI32 tag, void *data, RTS_UI32 size);

/* Appends a record and checks that it can be read. ERR_DISK_FULL when it can never fit, ERR_DEVICE flash fault,
 * also an earlier one of FlashLogOpen. After a fault the record is the newest nevertheless when it can be read, but
 * may not survive a power cut. */
RTS_RESULT FlashLogAppend(FLASH_LOG *log, RTS_UI32 tag, const void *data, RTS_UI32 size);

/* Marks the record that was appended last, which takes one unit of flash and is not synced; ERR_DISK_FULL without room
 * for it, ERR_DEVICE. And whether the newest record, of `size` bytes, is followed by a mark, or by one that was cut
 * off. */
RTS_RESULT FlashLogMark(FLASH_LOG *log);
bool FlashLogIsMarked(const FLASH_LOG *log, RTS_UI32 size);

/*
 * From now on the newest record up to number `until` is kept: when there is no room, it is the other half that is
 * erased, even with the newest record. FlashLogKeepNone ends that. ERR_DEVICE flash fault.
 */
RTS_RESULT FlashLogKeep(FLASH_LOG *log, RTS_UI32 until);
void FlashLogKeepNone(FLASH_LOG *log);

/* The next record goes to the other half, whatever room there is in this one: two records in a row, with this in between,
 * are one in each half, of which a lost sector leaves one. */
void FlashLogTurn(FLASH_LOG *log);

/* Gives up what cannot be read: the log takes records again, with numbers above those that may be there. */
void FlashLogRenew(FLASH_LOG *log);

/* The largest record, in bytes of data. */
RTS_UI32 FlashLogCapacity(const FLASH_LOG *log);

#endif

#endif
