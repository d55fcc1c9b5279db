/*
 * SysFlashLog.c - records that survive a power cut at any point.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysFlashLog.h"

#include <string.h>

#include "CmpChecksum.h"
#include "SysFlash.h"

typedef struct {
    RTS_UI32 magic;
    RTS_UI32 sequence;
    RTS_UI32 tag;
    RTS_UI32 size; /* of the data that follow */
    RTS_UI32 crc;  /* of the four words above and the data */
} RECORD_HEAD;

RTS_STATIC_ASSERT(sizeof(RECORD_HEAD) == FLASH_LOG_HEAD_SIZE, record_head_size);

enum { RECORD_MAGIC = 0x474F4C52 };

/* What a scan looks for and what it finds. */
typedef struct {
    bool any; /* any record, or only one of the range with this tag and size */
    FLASH_LOG_RANGE range;
    RTS_UI32 tag;
    RTS_UI32 size;
    bool found;
    RTS_UI32 sequence;
    RTS_UI32 position; /* in the file */
} SEARCH;

static RTS_UI32 record_length(RTS_UI32 size)
{
    return (FLASH_LOG_HEAD_SIZE + size + FILE_ALIGN - 1) / FILE_ALIGN * FILE_ALIGN;
}

static bool is_newer(RTS_UI32 a, RTS_UI32 b)
{
    return (RTS_I32)(a - b) > 0;
}

static RTS_UI32 head_crc(const RECORD_HEAD *head)
{
    return CRC32Update(0, head, offsetof(RECORD_HEAD, crc));
}

static bool data_is_valid(RTS_UI32 file, RTS_UI32 position, const RECORD_HEAD *head)
{
    RTS_UI32 crc = head_crc(head);
    RTS_UI32 done = 0;
    RTS_UI8 part[64];

    while (done < head->size) {
        RTS_UI32 count = head->size - done < sizeof part ? head->size - done : (RTS_UI32)sizeof part;
        if (SysFileRead(file, position + FLASH_LOG_HEAD_SIZE + done, part, count) != ERR_OK)
            return false;
        crc = CRC32Update(crc, part, count);
        done += count;
    }
    return crc == head->crc;
}

static bool is_wanted(const SEARCH *search, const RECORD_HEAD *head)
{
    return search->any || (head->tag == search->tag && head->size == search->size &&
                           is_newer(head->sequence, search->range.after) &&
                           !is_newer(head->sequence, search->range.until));
}

static void note(SEARCH *search, const RECORD_HEAD *head, RTS_UI32 position)
{
    if (!is_wanted(search, head))
        return;
    if (search->found && !is_newer(head->sequence, search->sequence))
        return;
    search->found = true;
    search->sequence = head->sequence;
    search->position = position;
}

/*
 * Looks at the records of the half at `start`. *end: the place after the last one, half written ones included. A
 * record that was cut off may reach as far as its head says, though the bytes look erased.
 */
static RTS_RESULT scan_half(const FLASH_LOG *log, RTS_UI32 start, SEARCH *search, RTS_UI32 *end)
{
    RTS_UI32 offset = 0;
    RECORD_HEAD head;

    *end = 0;
    while (log->half_size - offset >= FLASH_LOG_HEAD_SIZE) {
        RTS_RESULT result = SysFileRead(log->file, start + offset, &head, sizeof head);
        RTS_UI32 step = FILE_ALIGN;
        if (result != ERR_OK)
            return result;
        if (head.magic == RECORD_MAGIC && head.size <= log->half_size - offset - FLASH_LOG_HEAD_SIZE) {
            RTS_UI32 length = record_length(head.size);
            if (offset + length > *end)
                *end = offset + length;
            if (data_is_valid(log->file, start + offset, &head)) {
                note(search, &head, start + offset);
                step = length;
            }
        }
        offset += step;
    }
    return ERR_OK;
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
    RTS_UI32 offset = log->half_size;
    RTS_UI8 part[FILE_ALIGN];

    while (offset > end && SysFileRead(log->file, log->start + offset - FILE_ALIGN, part, sizeof part) == ERR_OK &&
           is_erased(part, sizeof part))
        offset -= FILE_ALIGN;
    return offset;
}

RTS_RESULT FlashLogOpen(FLASH_LOG *log, RTS_UI32 file)
{
    SEARCH search = {true, {0, 0}, 0, 0, false, 0, 0};
    RTS_UI32 end[2];
    RTS_UI32 half;
    RTS_RESULT result;

    memset(log, 0, sizeof *log);
    log->file = file;
    log->half_size = SysFileGetArea(file)->size / 2;
    log->used = log->half_size; /* without a record the first one erases its half */
    for (half = 0; half < 2; half++) {
        result = scan_half(log, half * log->half_size, &search, &end[half]);
        if (result != ERR_OK)
            return result;
    }
    if (search.found) {
        half = search.position / log->half_size;
        log->start = half * log->half_size;
        log->sequence = search.sequence;
        log->used = skip_garbage(log, end[half]);
    }
    return ERR_OK;
}

RTS_RESULT FlashLogRead(const FLASH_LOG *log, FLASH_LOG_RANGE range, RTS_UI32 tag, void *data, RTS_UI32 size)
{
    SEARCH search = {false, range, tag, size, false, 0, 0};
    RTS_UI32 end;
    RTS_RESULT result = scan_half(log, 0, &search, &end);

    if (result == ERR_OK)
        result = scan_half(log, log->half_size, &search, &end);
    if (result != ERR_OK)
        return result;
    if (!search.found)
        return ERR_NO_OBJECT;
    return SysFileRead(log->file, search.position + FLASH_LOG_HEAD_SIZE, data, size);
}

/* Makes room for `length` bytes: in this half, or by changing over to the other. */
static RTS_RESULT make_room(FLASH_LOG *log, RTS_UI32 length)
{
    RTS_UI32 other = log->start == 0 ? log->half_size : 0;
    RTS_RESULT result;

    if (length <= log->half_size - log->used)
        return ERR_OK;
    result = SysFileErase(log->file, other, log->half_size);
    if (result == ERR_OK) {
        log->start = other;
        log->used = 0;
    }
    return result;
}

static RTS_RESULT write_record(RTS_UI32 file, RTS_UI32 position, const RECORD_HEAD *head, const void *data)
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
    RECORD_HEAD head = {RECORD_MAGIC, ++log->sequence, tag, size, 0};
    RTS_UI32 position;
    RTS_RESULT result;

    if (size > FlashLogCapacity(log))
        return ERR_DISK_FULL;
    result = make_room(log, record_length(size));
    if (result != ERR_OK)
        return result;
    head.crc = CRC32Update(head_crc(&head), data, size);
    position = log->start + log->used;
    log->used += record_length(size); /* also when it fails: nothing is programmed twice */
    result = write_record(log->file, position, &head, data);
    if (data_is_valid(log->file, position, &head))
        return ERR_OK; /* whatever failed: from now on this record is the newest */
    return result != ERR_OK ? result : (RTS_RESULT)ERR_DEVICE;
}

RTS_UI32 FlashLogCapacity(const FLASH_LOG *log)
{
    return log->half_size - FLASH_LOG_HEAD_SIZE;
}
