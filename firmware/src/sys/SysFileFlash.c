/*
 * SysFileFlash.c - a fixed set of files on SysFlash.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysFileFlash.h"

#include <string.h>

#include "CmpChecksum.h"
#include "CmpLog.h"
#include "SysFlash.h"
#include "rts_config.h"

enum { READ_TRIES = 3 };

typedef struct {
    FILE_AREA area;
    RTS_UI32 position;        /* bytes written */
    RTS_UI32 erased_to;       /* sectors below this are erased, or need not be */
    RTS_UI8 unit[FILE_ALIGN]; /* the last position % FILE_ALIGN bytes, not yet programmed */
} FLASH_FILE;

static FLASH_FILE files[LOG_KEEP > 0 ? FILE_KEPT + 1 : FILE_STORE_FILES > 0 ? FILE_STORE + 1 : FILE_COUNT];

/* ---- where the files are ---- */

/* Of the flash, without the end that the kept log has. */
static RTS_UI32 size_without_log(void)
{
    RTS_UI32 size = SysFlashGet()->size;

    return LOG_KEEP > 0 && LOG_KEEP_SIZE < size ? size - LOG_KEEP_SIZE : size;
}

/* Of that, without the end that the store has. */
static RTS_UI32 size_for_programs(void)
{
    RTS_UI32 size = size_without_log();

    return FILE_STORE_FILES > 0 && FILE_STORE_SIZE < size ? size - FILE_STORE_SIZE : size;
}

#if LOG_KEEP > 0
static void map_log(void)
{
    RTS_UI32 half = (SysFlashGet()->size - size_without_log()) / 2;

    if (half > 0 && half % SysFlashGet()->sector_size == 0)
        files[FILE_KEPT].area = (FILE_AREA){size_without_log(), 2 * half};
}
#else
static void map_log(void)
{
}
#endif

#if FILE_STORE_FILES > 0
static void map_store(void)
{
    RTS_UI32 sector = SysFlashGet()->sector_size;
    RTS_UI32 start = size_for_programs();
    RTS_UI32 size = size_without_log() - start;

    if (size < 3 * sector || size % sector != 0)
        return;
    for (RTS_UI32 at = start; at < start + size; at += sector)
        if (FLASH_SECTOR_AT(at) != sector)
            return;
    files[FILE_CATALOG].area = (FILE_AREA){start, 2 * sector};
    files[FILE_STORE].area = (FILE_AREA){start + 2 * sector, size - 2 * sector};
}
#else
static void map_store(void)
{
}
#endif

#ifdef FILE_MAP

static bool overlap(const FILE_AREA *a, const FILE_AREA *b)
{
    return a->offset < b->offset + b->size && b->offset < a->offset + a->size;
}

/* Whether a sector begins there, or the flash ends. */
static bool is_border(RTS_UI32 offset)
{
    RTS_UI32 at = 0;

    while (at < offset)
        at += FLASH_SECTOR_AT(at);
    return at == offset;
}

/* Whether file `i` is in the flash, on borders of its sectors, the halves of a log too, apart from the files before it. */
static bool is_valid(RTS_UI32 i)
{
    const FILE_AREA *area = &files[i].area;
    RTS_UI32 size = size_for_programs();
    bool is_log = i == FILE_COMMIT || i == FILE_RETAIN;
    RTS_UI32 k;

    if (area->size == 0 || area->size > size || area->offset > size - area->size)
        return false;
    if (!is_border(area->offset) || !is_border(area->offset + area->size))
        return false;
    if (is_log && (area->size % 2 != 0 || !is_border(area->offset + area->size / 2)))
        return false;
    for (k = 0; k < i; k++) {
        if (overlap(area, &files[k].area))
            return false;
    }
    return true;
}

/* False when the flash has no room for the files, or the layout is invalid. */
static bool map_files(void)
{
    static const FILE_AREA map[FILE_COUNT] = {FILE_MAP};
    bool valid = true;
    RTS_UI32 i;

    for (i = 0; i < FILE_COUNT && valid; i++) {
        files[i].area = map[i];
        valid = is_valid(i);
    }
    return valid;
}

#else

/* False when nothing is left for the slots. */
static bool map_files(void)
{
    RTS_UI32 sector = SysFlashGet()->sector_size;
    const FILE_AREA map[FILE_COUNT] = {FILE_MAP_OF(size_for_programs(), sector)};
    RTS_UI32 i;

    for (i = 0; i < FILE_COUNT; i++)
        files[i].area = map[i];
    return map[FILE_SLOT_A].size > 0;
}

#endif

static bool is_power_of_two(RTS_UI32 n)
{
    return n != 0 && (n & (n - 1)) == 0;
}

static bool flash_is_valid(const SYS_FLASH *flash)
{
    return is_power_of_two(flash->sector_size) && is_power_of_two(flash->program_size) &&
           flash->program_size <= FILE_ALIGN && flash->sector_size >= 2 * FILE_ALIGN && /* holds a record's head */
           flash->size % flash->sector_size == 0 && (FLASH_READS_FAIL || flash->mapped != NULL);
}

/* ---- writing ---- */

const FILE_AREA *SysFileGetArea(RTS_UI32 file)
{
    return &files[file].area;
}

void SysFileCreate(RTS_UI32 file)
{
    files[file].position = 0;
    files[file].erased_to = 0;
}

void SysFileCreateAt(RTS_UI32 file, RTS_UI32 position)
{
    files[file].position = position;
    files[file].erased_to = position;
}

void SysFileAppend(RTS_UI32 file, RTS_UI32 position)
{
    files[file].position = position;
    files[file].erased_to = files[file].area.size;
}

RTS_UI32 SysFileGetPos(RTS_UI32 file)
{
    return files[file].position;
}

/* Programs the unit that ends at the position; erases its sector when it is the first one there. */
static RTS_RESULT program_unit(FLASH_FILE *f)
{
    const SYS_FLASH *flash = SysFlashGet();
    RTS_UI32 start = f->position - FILE_ALIGN;
    RTS_RESULT result = ERR_OK;

    if (start == f->erased_to) {
        f->erased_to += FLASH_SECTOR_AT(f->area.offset + start);
        result = flash->erase(f->area.offset + start);
    }
    return result == ERR_OK ? flash->program(f->area.offset + start, f->unit, FILE_ALIGN) : result;
}

RTS_RESULT SysFileWrite(RTS_UI32 file, const void *data, RTS_UI32 size)
{
    FLASH_FILE *f = &files[file];
    const RTS_UI8 *bytes = data;
    RTS_RESULT result = ERR_OK;

    if (size > f->area.size - f->position)
        return ERR_DISK_FULL;
    for (; size > 0 && result == ERR_OK; size--) {
        f->unit[f->position++ % FILE_ALIGN] = *bytes++;
        if (f->position % FILE_ALIGN == 0)
            result = program_unit(f);
    }
    return result;
}

RTS_RESULT SysFileClose(RTS_UI32 file)
{
    const SYS_FLASH *flash = SysFlashGet();
    RTS_UI8 padding = flash->erased;
    RTS_RESULT result = ERR_OK;

    while (files[file].position % FILE_ALIGN != 0 && result == ERR_OK)
        result = SysFileWrite(file, &padding, 1);
    return result == ERR_OK ? flash->sync() : result;
}

/* A fault that passes costs nothing. */
static RTS_RESULT read_patiently(const SYS_FLASH *flash, RTS_UI32 offset, void *data, RTS_UI32 size)
{
    RTS_RESULT result;
    int left = READ_TRIES;

    do
        result = flash->read(offset, data, size);
    while (result != ERR_OK && --left > 0);
    return result;
}

RTS_RESULT SysFileRead(RTS_UI32 file, RTS_UI32 offset, void *data, RTS_UI32 size)
{
    const SYS_FLASH *flash = SysFlashGet();
    const FILE_AREA *area = &files[file].area;

    if (size > area->size || offset > area->size - size)
        return ERR_OUT_OF_LIMITS;
    if (FLASH_READS_FAIL && flash->mapped == NULL)
        return read_patiently(flash, area->offset + offset, data, size);
    memcpy(data, flash->mapped + area->offset + offset, size);
    return ERR_OK;
}

/* What was written, also when it is not programmed yet; up to one unit of it. */
static RTS_RESULT read_back(RTS_UI32 file, RTS_UI32 offset, RTS_UI8 *data, RTS_UI32 size)
{
    const FLASH_FILE *f = &files[file];
    RTS_UI32 programmed = f->position - f->position % FILE_ALIGN;
    RTS_UI32 in_flash = offset >= programmed ? 0 : programmed - offset;

    for (RTS_UI32 i = in_flash; i < size; i++)
        data[i] = f->unit[(offset + i) % FILE_ALIGN];
    return SysFileRead(file, offset, data, in_flash < size ? in_flash : size);
}

RTS_RESULT SysFileCopy(RTS_UI32 file, RTS_UI32 distance, RTS_UI32 size)
{
    RTS_UI8 part[FILE_ALIGN];
    RTS_RESULT result = ERR_OK;

    if (distance == 0 || distance > files[file].position)
        return ERR_OUT_OF_LIMITS;
    while (size > 0 && result == ERR_OK) {
        RTS_UI32 count = size < sizeof part ? size : (RTS_UI32)sizeof part;
        if (count > distance)
            count = distance;
        result = read_back(file, files[file].position - distance, part, count);
        if (result == ERR_OK)
            result = SysFileWrite(file, part, count);
        size -= count;
    }
    return result;
}

RTS_RESULT SysFileCRC32(RTS_UI32 file, RTS_UI32 offset, RTS_UI32 size, RTS_UI32 *crc)
{
    RTS_UI8 part[64];
    RTS_RESULT result = ERR_OK;

    while (size > 0 && result == ERR_OK) {
        RTS_UI32 count = size < sizeof part ? size : (RTS_UI32)sizeof part;
        result = SysFileRead(file, offset, part, count);
        *crc = CRC32Update(*crc, part, count);
        offset += count;
        size -= count;
    }
    return result;
}

RTS_RESULT SysFileErase(RTS_UI32 file, RTS_UI32 offset, RTS_UI32 size)
{
    const SYS_FLASH *flash = SysFlashGet();
    RTS_UI32 start = files[file].area.offset + offset;
    RTS_UI32 done;
    RTS_RESULT result = ERR_OK;

    for (done = 0; done < size && result == ERR_OK; done += FLASH_SECTOR_AT(start + done))
        result = flash->erase(start + done);
    return result;
}

RTS_RESULT SysFileFlash_Hook(CMP_HOOK hook)
{
    if (hook != CH_INIT_SYSTEM2)
        return ERR_OK;
    CMP_CLEAR(files);
    if (!flash_is_valid(SysFlashGet())) {
        LogAdd(CMPID_SysFileFlash, LOG_ERROR, ERR_PARAMETER, "The geometry of the flash is not usable");
        return ERR_PARAMETER;
    }
    if (!map_files()) {
        LogAdd(CMPID_SysFileFlash, LOG_ERROR, ERR_NOMEMORY, "The files do not fit in the flash of %u bytes",
               (unsigned)SysFlashGet()->size);
        return ERR_NOMEMORY;
    }
    map_store();
    map_log();
    return ERR_OK;
}
