/*
 * RetainSram.c - the newest copy of the retain variables, in RAM that keeps its content while the power is off.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "RetainSram.h"

#include <string.h>

#include "CmpChecksum.h"
#include "SysAtomic.h"
#include "SysSram.h"
#include "rts_config.h"

#if APP_RETAIN_SRAM

enum { MAGIC = 0x4D415253, PLACES = 2 };

/* A copy that is complete has the magic number, which is written last. After it come its bytes. */
typedef struct {
    RTS_UI32 magic;
    RTS_UI32 count; /* of copies, the newest has the highest */
    RTS_UI32 sequence;
    RTS_UI32 tag;
    RTS_UI32 size;
    RTS_UI32 crc; /* of the four before, and of the bytes */
} COPY;

/* Bytes for a copy with its head. */
static RTS_UI32 get_room(void)
{
    RTS_UI32 size;

    (void)SysSramGet(&size);
    return size / PLACES & ~7u;
}

static COPY *get_place(RTS_UI32 index)
{
    RTS_UI32 size;

    return (COPY *)(void *)(SysSramGet(&size) + index * get_room());
}

bool RetainSramFits(RTS_UI32 size)
{
    RTS_UI32 room = get_room();

    return room > sizeof(COPY) && size <= room - sizeof(COPY);
}

static RTS_UI32 checksum(const COPY *copy)
{
    RTS_UI32 crc = CRC32Update(0, &copy->count, 4 * sizeof copy->count);

    return CRC32Update(crc, copy + 1, copy->size);
}

/* After a long time without battery its bytes are anything. */
static bool is_valid(const COPY *copy)
{
    return copy->magic == MAGIC && RetainSramFits(copy->size) && checksum(copy) == copy->crc;
}

/* The newest copy, NULL without one. */
static COPY *find_newest(void)
{
    COPY *newest = NULL;

    for (RTS_UI32 i = 0; i < PLACES && get_room() > sizeof(COPY); i++) {
        COPY *copy = get_place(i);
        if (is_valid(copy) && (newest == NULL || (RTS_I32)(copy->count - newest->count) > 0))
            newest = copy;
    }
    return newest;
}

/* The place that is written now, and the count of what is written. Looking for them takes two checksums: once in a start. */
static struct {
    bool known;
    RTS_UI32 next;
    RTS_UI32 count;
} turn;

static void find_turn(void)
{
    const COPY *newest = find_newest();

    turn.known = true;
    turn.next = newest != NULL && newest == get_place(0);
    turn.count = newest != NULL ? newest->count : 0;
}

void RetainSramSave(RTS_UI32 tag, RTS_UI32 sequence, const void *data, RTS_UI32 size)
{
    if (!RetainSramFits(size))
        return;
    if (!turn.known)
        find_turn();
    COPY *copy = get_place(turn.next);
    SysAtomicStore(&copy->magic, 0);
    SysAtomicFence();
    copy->count = ++turn.count;
    copy->sequence = sequence;
    copy->tag = tag;
    copy->size = size;
    memcpy(copy + 1, data, size);
    copy->crc = checksum(copy);
    SysAtomicFence();
    SysAtomicStore(&copy->magic, MAGIC);
    turn.next ^= 1;
}

bool RetainSramLoad(RTS_UI32 tag, RTS_UI32 sequence, FLASH_LOG_RANGE range, void *data, RTS_UI32 size)
{
    const COPY *copy;

    turn.known = false; /* the memory is what the last power-off has left */
    copy = find_newest();
    if (copy == NULL || copy->tag != tag || copy->size != size || copy->sequence != sequence ||
        (RTS_I32)(sequence - range.after) <= 0 || (RTS_I32)(range.until - sequence) < 0)
        return false;
    memcpy(data, copy + 1, size);
    return true;
}

#endif
