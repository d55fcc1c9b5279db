/*
 * SysFlashLog.c - records that survive a power cut at any point.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysFlashLog.h"

#include <string.h>

#include "CmpChecksum.h"
#include "SysFlash.h"
#include "rts_config.h"

/* The records a scan looks for. */
typedef struct {
    FLASH_LOG_RANGE range;
    bool any_kind; /* of any tag and size */
    RTS_UI32 tag;
    RTS_UI32 size;
} WANTED;

/* The newest of them. */
typedef struct {
    bool any;
    RTS_UI32 sequence;
    RTS_UI32 position; /* in the file */
    RTS_UI32 end;      /* of all records in its half, half written ones included */
    RTS_RESULT result; /* ERR_DEVICE: a part cannot be read, the newest may be there */
} FOUND;

static RTS_UI32 half_size(const FLASH_LOG *log)
{
    return SysFileGetArea(log->file)->size / 2;
}

static RTS_UI32 record_length(RTS_UI32 size)
{
    return SysFileAlign(FLASH_LOG_HEAD_SIZE + size);
}

static bool is_newer(RTS_UI32 a, RTS_UI32 b)
{
    return (RTS_I32)(a - b) > 0;
}

static RTS_UI32 head_crc(const FLASH_LOG_HEAD *head)
{
    return CRC32Update(0, head, offsetof(FLASH_LOG_HEAD, crc));
}

/* ERR_OK: the record is valid. ERR_CRC_FAILED: it is not. ERR_DEVICE: unknown. */
static RTS_RESULT check_data(RTS_UI32 file, RTS_UI32 position, const FLASH_LOG_HEAD *head)
{
    RTS_UI32 crc = head_crc(head);
    RTS_RESULT result = SysFileCRC32(file, position + FLASH_LOG_HEAD_SIZE, head->size, &crc);

    if (result == ERR_OK && crc != head->crc)
        return ERR_CRC_FAILED;
    return result;
}

static bool is_wanted(const WANTED *wanted, const FLASH_LOG_HEAD *head)
{
    if (wanted == NULL)
        return true;
    return is_newer(head->sequence, wanted->range.after) && !is_newer(head->sequence, wanted->range.until) &&
           (wanted->any_kind || (head->tag == wanted->tag && head->size == wanted->size));
}

static void note(FOUND *found, const FLASH_LOG_HEAD *head, RTS_UI32 position)
{
    if (found->any && !is_newer(head->sequence, found->sequence))
        return;
    found->any = true;
    found->sequence = head->sequence;
    found->position = position;
}

/* Looks at the records of the half at `start`. One that was cut off may reach as far as its head says, though the bytes
 * look erased. Of a sector that cannot be read the remaining part is skipped. */
static void scan_half(const FLASH_LOG *log, RTS_UI32 start, const WANTED *wanted, FOUND *found)
{
    RTS_UI32 sector = SysFlashGet()->sector_size; /* the smallest, all are multiples of it */
    RTS_UI32 size = half_size(log);
    RTS_UI32 offset = 0;
    RTS_UI32 end = 0;
    FLASH_LOG_HEAD head;

    while (size - offset >= FLASH_LOG_HEAD_SIZE) {
        RTS_RESULT result = SysFileRead(log->file, start + offset, &head, sizeof head);
        RTS_UI32 step = FILE_ALIGN;
        if (FLASH_READS_FAIL && result != ERR_OK) {
            found->result = result;
            step = sector - offset % sector;
        } else if (head.magic == FLASH_LOG_MAGIC && head.size <= size - offset - FLASH_LOG_HEAD_SIZE) {
            RTS_UI32 length = record_length(head.size);
            if (offset + length > end)
                end = offset + length;
            result = check_data(log->file, start + offset, &head);
            if (result == ERR_OK) {
                if (is_wanted(wanted, &head))
                    note(found, &head, start + offset);
                step = length;
            } else if (FLASH_READS_FAIL && result != ERR_CRC_FAILED) {
                found->result = result;
            }
        }
        offset += step;
    }
    if (found->any && found->position >= start)
        found->end = end;
}

/* Finds the newest wanted record, of all records when `wanted` is NULL. */
static void scan(const FLASH_LOG *log, const WANTED *wanted, FOUND *found)
{
    memset(found, 0, sizeof *found);
    scan_half(log, 0, wanted, found);
    scan_half(log, half_size(log), wanted, found);
}

static bool is_erased(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI8 erased = SysFlashGet()->erased;

    while (size > 0 && data[size - 1] == erased)
        size--;
    return size == 0;
}

/* The place after the last byte that is not erased, but not before `end`. */
static RTS_UI32 skip_garbage(const FLASH_LOG *log, RTS_UI32 end)
{
    RTS_UI32 offset = half_size(log);
    RTS_UI8 part[FILE_ALIGN];

    while (offset > end && SysFileRead(log->file, log->start + offset - FILE_ALIGN, part, sizeof part) == ERR_OK &&
           is_erased(part, sizeof part))
        offset -= FILE_ALIGN;
    return offset;
}

RTS_RESULT FlashLogOpen(FLASH_LOG *log, RTS_UI32 file)
{
    FOUND found;

    memset(log, 0, sizeof *log);
    log->file = file;
    log->kept = FLASH_LOG_NONE;
    log->used = half_size(log); /* without a record the first one erases its half */
    scan(log, NULL, &found);
    log->opened = found.result; /* ERR_DEVICE: nothing is to take the number of a record that was not seen */
    if (!found.any)
        return log->opened;
    if (found.position >= half_size(log))
        log->start = half_size(log);
    log->newest = found.position;
    log->sequence = found.sequence;
    log->used = skip_garbage(log, found.end);
    return log->opened;
}

RTS_RESULT FlashLogReadNewest(const FLASH_LOG *log, RTS_UI32 tag, void *data, RTS_UI32 size)
{
    FLASH_LOG_HEAD head;
    RTS_RESULT result =
        log->sequence == 0 ? (RTS_RESULT)ERR_NO_OBJECT : SysFileRead(log->file, log->newest, &head, sizeof head);

    if (result != ERR_OK)
        return result;
    if (head.tag != tag || head.size != size)
        return ERR_NO_OBJECT;
    return SysFileRead(log->file, log->newest + FLASH_LOG_HEAD_SIZE, data, size);
}

RTS_RESULT FlashLogRead(const FLASH_LOG *log, FLASH_LOG_RANGE range, RTS_UI32 tag, void *data, RTS_UI32 size)
{
    const WANTED wanted = {range, false, tag, size};
    FOUND found;

    scan(log, &wanted, &found);
    if (!found.any)
        return found.result != ERR_OK ? found.result : (RTS_RESULT)ERR_NO_OBJECT;
    return SysFileRead(log->file, found.position + FLASH_LOG_HEAD_SIZE, data, size);
}

RTS_RESULT FlashLogKeep(FLASH_LOG *log, RTS_UI32 until)
{
    const WANTED wanted = {{until - 0x7FFFFFFF, until}, true, 0, 0};
    FOUND found;

    scan(log, &wanted, &found);
    FlashLogKeepNone(log);
    if (found.any)
        log->kept = found.position < half_size(log) ? 0 : half_size(log);
    return found.result;
}

void FlashLogKeepNone(FLASH_LOG *log)
{
    log->kept = FLASH_LOG_NONE;
}

/* Makes room for `length` bytes: in this half, or by changing over to the other. */
static RTS_RESULT make_room(FLASH_LOG *log, RTS_UI32 length)
{
    RTS_UI32 size = half_size(log);
    RTS_UI32 next = log->start == 0 ? size : 0;
    RTS_RESULT result;

    if (length <= size - log->used)
        return ERR_OK;
    if (next == log->kept)
        next = log->start;
    result = SysFileErase(log->file, next, size);
    if (result == ERR_OK) {
        log->start = next;
        log->used = 0;
    }
    return result;
}

static RTS_RESULT write_record(RTS_UI32 file, RTS_UI32 position, const FLASH_LOG_HEAD *head, const void *data)
{
    RTS_RESULT result;

    SysFileAppend(file, position);
    result = SysFileWrite(file, head, sizeof *head);
    if (result == ERR_OK)
        result = SysFileWrite(file, data, head->size);
    if (result == ERR_OK)
        result = SysFileClose(file);
    return result;
}

RTS_RESULT FlashLogAppend(FLASH_LOG *log, RTS_UI32 tag, const void *data, RTS_UI32 size)
{
    FLASH_LOG_HEAD head = {FLASH_LOG_MAGIC, log->sequence + 1, tag, size, 0};
    RTS_RESULT checked;
    RTS_UI32 position;
    RTS_RESULT result = log->opened;

    if (size > FlashLogCapacity(log))
        result = ERR_DISK_FULL;
    if (result == ERR_OK)
        result = make_room(log, record_length(size));
    if (result != ERR_OK)
        return result;
    head.crc = CRC32Update(head_crc(&head), data, size);
    position = log->start + log->used;
    log->used += record_length(size); /* also when it fails: nothing is programmed twice */
    log->sequence++;
    result = write_record(log->file, position, &head, data);
    checked = check_data(log->file, position, &head);
    if (checked == ERR_OK)
        log->newest = position; /* the record is readable, so it counts even if sync failed */
    if (result == ERR_OK && checked != ERR_OK)
        return ERR_DEVICE;
    return result;
}

RTS_RESULT FlashLogMark(FLASH_LOG *log)
{
    if (log->used >= half_size(log))
        return ERR_DISK_FULL;
    SysFileAppend(log->file, log->start + log->used);
    log->used += FILE_ALIGN;
    return SysFileWrite(log->file, log, FILE_ALIGN); /* anything that is not erased and does not start a record */
}

bool FlashLogIsMarked(const FLASH_LOG *log, RTS_UI32 size)
{
    return log->start + log->used > log->newest + record_length(size);
}

void FlashLogTurn(FLASH_LOG *log)
{
    log->used = half_size(log);
}

void FlashLogRenew(FLASH_LOG *log)
{
    log->sequence += half_size(log); /* more than the records that a half has room for */
    log->opened = ERR_OK;
    FlashLogTurn(log);
}

RTS_UI32 FlashLogCapacity(const FLASH_LOG *log)
{
    return half_size(log) - FLASH_LOG_HEAD_SIZE;
}
