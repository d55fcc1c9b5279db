/*
 * SysFileFlash.c - a fixed set of files on SysFlash.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysFileFlash.h"

#include <string.h>

#include "CmpLog.h"
#include "SysFlash.h"
#include "SysFlashLog.h"
#include "rts_config.h"

typedef struct {
    FILE_AREA area;
    RTS_UI32 position;        /* bytes written */
    RTS_UI32 erased_to;       /* sectors below this are erased, or need not be */
    RTS_UI8 unit[FILE_ALIGN]; /* the last position % program_size bytes, not yet programmed */
} FLASH_FILE;

static struct {
    const SYS_FLASH *flash;
    FLASH_FILE file[FILE_COUNT];
} files;

static RTS_UI32 minimum(RTS_UI32 a, RTS_UI32 b)
{
    return a < b ? a : b;
}

/* ---- where the files lie ---- */

#ifdef FILE_MAP

static void map_files(void)
{
    static const FILE_AREA map[FILE_COUNT] = {FILE_MAP};
    RTS_UI32 i;

    for (i = 0; i < FILE_COUNT; i++)
        files.file[i].area = map[i];
}

#else

/* Sectors of one half of the retain log: enough for the largest record, but at most an eighth of the flash. */
static RTS_UI32 retain_half_sectors(const SYS_FLASH *flash)
{
    RTS_UI32 sector = flash->sector_size;
    RTS_UI32 most = flash->size / 8 / sector;
    RTS_UI32 wanted = (FLASH_LOG_HEAD_SIZE + APP_RETAIN_SIZE + FILE_ALIGN + sector - 1) / sector;

    return most == 0 ? 1 : minimum(wanted, most);
}

static void map_files(void)
{
    const SYS_FLASH *flash = files.flash;
    RTS_UI32 commit = 2 * flash->sector_size;
    RTS_UI32 retain = 2 * flash->sector_size * retain_half_sectors(flash);
    RTS_UI32 rest = flash->size > commit + retain ? flash->size - commit - retain : 0;
    RTS_UI32 slot = rest / 2 / flash->sector_size * flash->sector_size;
    FILE_AREA map[FILE_COUNT];
    RTS_UI32 i;

    map[FILE_SLOT_A].size = slot;
    map[FILE_SLOT_B].size = slot;
    map[FILE_COMMIT].size = commit;
    map[FILE_RETAIN].size = retain;
    for (i = 0; i < FILE_COUNT; i++) {
        map[i].offset = i == 0 ? 0 : map[i - 1].offset + map[i - 1].size;
        files.file[i].area = map[i];
    }
}

#endif

static bool overlap(const FILE_AREA *a, const FILE_AREA *b)
{
    return a->offset < b->offset + b->size && b->offset < a->offset + a->size;
}

static bool map_is_valid(void)
{
    const SYS_FLASH *flash = files.flash;
    RTS_UI32 i;
    RTS_UI32 k;

    for (i = 0; i < FILE_COUNT; i++) {
        const FILE_AREA *area = &files.file[i].area;
        RTS_UI32 granule = i == FILE_COMMIT || i == FILE_RETAIN ? 2 * flash->sector_size : flash->sector_size;
        if (area->size == 0 || area->size % granule != 0 || area->offset % flash->sector_size != 0)
            return false;
        if (area->size > flash->size || area->offset > flash->size - area->size)
            return false;
        for (k = 0; k < i; k++) {
            if (overlap(area, &files.file[k].area))
                return false;
        }
    }
    return true;
}

static bool is_power_of_two(RTS_UI32 n)
{
    return n != 0 && (n & (n - 1)) == 0;
}

static bool flash_is_valid(const SYS_FLASH *flash)
{
    return is_power_of_two(flash->sector_size) && is_power_of_two(flash->program_size) &&
           flash->program_size <= FILE_ALIGN && flash->sector_size >= 2 * FILE_ALIGN && /* holds a record's head */
           flash->size % flash->sector_size == 0;
}

/* ---- writing ---- */

const FILE_AREA *SysFileGetArea(RTS_UI32 file)
{
    return &files.file[file].area;
}

void SysFileCreate(RTS_UI32 file)
{
    files.file[file].position = 0;
    files.file[file].erased_to = 0;
}

void SysFileAppend(RTS_UI32 file, RTS_UI32 position)
{
    files.file[file].position = position;
    files.file[file].erased_to = files.file[file].area.size;
}

RTS_UI32 SysFileGetPos(RTS_UI32 file)
{
    return files.file[file].position;
}

/* Programs whole units at `offset` of the file, erasing each sector when its first unit is due. */
static RTS_RESULT program(FLASH_FILE *f, RTS_UI32 offset, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_RESULT result = ERR_OK;

    while (size > 0 && result == ERR_OK) {
        RTS_UI32 count;
        if (offset == f->erased_to) {
            result = files.flash->erase(f->area.offset + offset);
            f->erased_to += files.flash->sector_size;
        }
        count = minimum(size, f->erased_to - offset);
        if (result == ERR_OK)
            result = files.flash->program(f->area.offset + offset, data, count);
        offset += count;
        data += count;
        size -= count;
    }
    return result;
}

/* Adds bytes to the unit that is being filled, programs it when it is full; returns how many through *taken. */
static RTS_RESULT fill_unit(FLASH_FILE *f, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken)
{
    RTS_UI32 unit = files.flash->program_size;
    RTS_UI32 fill = f->position % unit;

    *taken = minimum(unit - fill, size);
    memcpy(f->unit + fill, data, *taken);
    f->position += *taken;
    if (f->position % unit != 0)
        return ERR_OK;
    return program(f, f->position - unit, f->unit, unit);
}

RTS_RESULT SysFileWrite(RTS_UI32 file, const void *data, RTS_UI32 size)
{
    FLASH_FILE *f = &files.file[file];
    RTS_UI32 unit = files.flash->program_size;
    const RTS_UI8 *bytes = data;
    RTS_RESULT result = ERR_OK;

    if (size > f->area.size - f->position)
        return ERR_DISK_FULL;
    while (size > 0 && result == ERR_OK) {
        RTS_UI32 count = size / unit * unit;
        if (f->position % unit != 0 || count == 0) {
            result = fill_unit(f, bytes, size, &count);
        } else {
            f->position += count;
            result = program(f, f->position - count, bytes, count);
        }
        bytes += count;
        size -= count;
    }
    return result;
}

RTS_RESULT SysFileClose(RTS_UI32 file)
{
    FLASH_FILE *f = &files.file[file];
    RTS_UI32 unit = files.flash->program_size;
    RTS_UI32 fill = f->position % unit;
    RTS_RESULT result = ERR_OK;

    if (fill > 0) {
        memset(f->unit + fill, files.flash->erased, unit - fill);
        f->position += unit - fill;
        result = program(f, f->position - unit, f->unit, unit);
    }
    return result == ERR_OK ? files.flash->sync() : result;
}

RTS_RESULT SysFileRead(RTS_UI32 file, RTS_UI32 offset, void *data, RTS_UI32 size)
{
    const FILE_AREA *area = &files.file[file].area;

    if (size > area->size || offset > area->size - size)
        return ERR_OUT_OF_LIMITS;
    if (files.flash->mapped == NULL)
        return files.flash->read(area->offset + offset, data, size);
    memcpy(data, files.flash->mapped + area->offset + offset, size);
    return ERR_OK;
}

RTS_RESULT SysFileErase(RTS_UI32 file, RTS_UI32 offset, RTS_UI32 size)
{
    RTS_UI32 start = files.file[file].area.offset + offset;
    RTS_UI32 done;
    RTS_RESULT result = ERR_OK;

    for (done = 0; done < size && result == ERR_OK; done += files.flash->sector_size)
        result = files.flash->erase(start + done);
    return result;
}

RTS_RESULT SysFileFlash_Hook(CMP_HOOK hook)
{
    if (hook != CH_INIT_SYSTEM2)
        return ERR_OK;
    memset(&files, 0, sizeof files);
    files.flash = SysFlashGet();
    if (!flash_is_valid(files.flash)) {
        LogAdd(CMPID_SysFileFlash, LOG_ERROR, ERR_PARAMETER, "The geometry of the flash is not usable");
        return ERR_PARAMETER;
    }
    map_files();
    if (!map_is_valid()) {
        LogAdd(CMPID_SysFileFlash, LOG_ERROR, ERR_NOMEMORY, "The files do not fit in the flash of %u bytes",
               (unsigned)files.flash->size);
        return ERR_NOMEMORY;
    }
    return ERR_OK;
}
