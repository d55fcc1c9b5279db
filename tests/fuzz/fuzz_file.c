/*
 * fuzz_file.c - any sequence of operations on the files, with calls of the flash that fail: what was written and closed
 * is what is read, and no file changes another.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: operations of three bytes: what and which file, and a number of 16 bits.
 */
#include <string.h>

#include "CmpChecksum.h"
#include "Sim.h"
#include "SysFileFlash.h"
#include "fuzz.h"
#include "rts_config.h"

enum { FLASH_SIZE = 16 * 1024, SECTOR_SIZE = 256, OPERATION_SIZE = 3 };

/* What a file has to hold. Where `known` is false anything may be. */
static struct {
    uint8_t data[FLASH_SIZE];
    bool known[FLASH_SIZE];
    bool erased[FLASH_SIZE];
    bool open;      /* may be written; not after a fault */
    RTS_UI32 begin; /* of what was written since it was opened */
} model[FILE_COUNT];

size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    static const uint8_t inputs[][15] = {
        {0, 0, 0, 4, 100, 0, 8, 0, 0, 12, 0, 0, 16, 5, 0},   /* create, write 100, close, read */
        {1, 0, 0, 5, 0, 2, 5, 17, 0, 9, 0, 0, 0, 0, 0},      /* two files */
        {18, 0, 0, 14, 0, 0, 6, 36, 0, 10, 0, 0, 14, 48, 0}, /* erase, append, write, close, append */
        {0, 0, 0, 20, 3, 0, 4, 100, 0, 8, 0, 0, 0, 0, 0},    /* a program that fails */
        {2, 0, 0, 6, 255, 255, 6, 0, 4, 10, 0, 0, 0, 0, 0},  /* more than fits */
    };

    if (index >= RTS_COUNT(inputs) || capacity < sizeof(inputs[0]))
        return 0;
    memcpy(data, inputs[index], sizeof(inputs[0]));
    return sizeof(inputs[0]);
}

static uint8_t pattern(RTS_UI32 file, RTS_UI32 position)
{
    return (uint8_t)(position * 7 + file * 31 + (position >> 8));
}

static void create(RTS_UI32 file)
{
    SysFileCreate(file);
    model[file].open = true;
    model[file].begin = 0;
}

/* At a place from which on the sector is erased, as its contract wants. */
static void append(RTS_UI32 file, RTS_UI32 number)
{
    RTS_UI32 size = SysFileGetArea(file)->size;
    RTS_UI32 position = number % size / FILE_ALIGN * FILE_ALIGN;
    RTS_UI32 i;

    for (i = position; i < size; i++)
        if (!model[file].erased[i])
            return;
    SysFileAppend(file, position);
    model[file].open = true;
    model[file].begin = position;
}

/* From the beginning of the first sector that `from` is in, what was there is worth nothing. */
static void forget(RTS_UI32 file, RTS_UI32 from, RTS_UI32 to)
{
    for (; from < to; from++) {
        model[file].known[from] = false;
        model[file].erased[from] = false;
    }
}

/* Sectors are erased as they are reached, also by a write that fails. */
static void write(RTS_UI32 file, RTS_UI32 number)
{
    uint8_t data[1500];
    RTS_UI32 size = number % (RTS_UI32)sizeof(data);
    RTS_UI32 limit = SysFileGetArea(file)->size;
    RTS_UI32 position = SysFileGetPos(file);
    RTS_UI32 end;
    RTS_RESULT result;

    if (!model[file].open)
        return;
    for (RTS_UI32 i = 0; i < size; i++)
        data[i] = pattern(file, position + i);
    result = SysFileWrite(file, data, size);
    if (size > limit - position) {
        FUZZ_CHECK(result == ERR_DISK_FULL && SysFileGetPos(file) == position);
        return;
    }
    end = (position + size + SECTOR_SIZE - 1) / SECTOR_SIZE * SECTOR_SIZE;
    forget(file, model[file].begin, end < limit ? end : limit);
    if (result == ERR_OK)
        FUZZ_CHECK(SysFileGetPos(file) == position + size);
    else
        model[file].open = false;
}

static void close_file(RTS_UI32 file)
{
    RTS_UI32 position = SysFileGetPos(file);

    if (!model[file].open)
        return;
    model[file].open = false;
    if (SysFileClose(file) != ERR_OK)
        return;
    for (RTS_UI32 i = model[file].begin; i < position; i++) {
        model[file].data[i] = pattern(file, i);
        model[file].known[i] = true;
    }
}

static void erase(RTS_UI32 file, RTS_UI32 number)
{
    RTS_UI32 sectors = SysFileGetArea(file)->size / SECTOR_SIZE;
    RTS_UI32 first = (number & 0xFF) % sectors;
    RTS_UI32 count = 1 + (number >> 8) % (sectors - first);

    model[file].open = false;
    forget(file, first * SECTOR_SIZE, (first + count) * SECTOR_SIZE);
    if (SysFileErase(file, first * SECTOR_SIZE, count * SECTOR_SIZE) != ERR_OK)
        return;
    for (RTS_UI32 i = first * SECTOR_SIZE; i < (first + count) * SECTOR_SIZE; i++) {
        model[file].data[i] = 0xFF;
        model[file].known[i] = model[file].erased[i] = true;
    }
}

static void check_bytes(RTS_UI32 file, RTS_UI32 offset, const uint8_t *data, RTS_UI32 size)
{
    for (RTS_UI32 i = 0; i < size; i++)
        FUZZ_CHECK(!model[file].known[offset + i] || data[i] == model[file].data[offset + i]);
}

/* Any place and size, also outside. */
static void read_part(RTS_UI32 file, RTS_UI32 number)
{
    uint8_t data[300];
    RTS_UI32 limit = SysFileGetArea(file)->size;
    RTS_UI32 size = number % (RTS_UI32)sizeof(data);
    RTS_RESULT result = SysFileRead(file, number, data, size);

    if (number > limit || size > limit - number)
        FUZZ_CHECK(result == ERR_OUT_OF_LIMITS);
    else if (result == ERR_OK)
        check_bytes(file, number, data, size);
}

static void check_all(void)
{
    static uint8_t data[FLASH_SIZE];

    for (RTS_UI32 file = 0; file < FILE_COUNT; file++) {
        RTS_UI32 size = SysFileGetArea(file)->size;
        RTS_UI32 crc = 0;
        FUZZ_CHECK(SysFileRead(file, 0, data, size) == ERR_OK);
        check_bytes(file, 0, data, size);
        FUZZ_CHECK(SysFileCRC32(file, 0, size, &crc) == ERR_OK && crc == CRC32Update(0, data, size));
    }
    FUZZ_CHECK(SimFlashViolations() == 0);
}

static void operate(uint8_t what, RTS_UI32 number)
{
    RTS_UI32 file = what % FILE_COUNT;

    switch (what / FILE_COUNT % 7) {
    case 0:
        create(file);
        break;
    case 1:
        write(file, number);
        break;
    case 2:
        close_file(file);
        break;
    case 3:
        append(file, number);
        break;
    case 4:
        erase(file, number);
        break;
    case 5:
        SimFlashFail(file, number % 64);
        break;
    default:
        read_part(file, number);
        break;
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    SimStop();
    memset(model, 0, sizeof(model));
    SimFlashSetMapped(0); /* reads can fail */
    FUZZ_CHECK(SimFlashConfigure(FLASH_SIZE, SECTOR_SIZE, 8, 0xFF) == ERR_OK);
    FUZZ_CHECK(SimStart() == ERR_OK);
    for (size_t i = 0; i + OPERATION_SIZE <= size; i += OPERATION_SIZE)
        operate(data[i], data[i + 1] | (RTS_UI32)data[i + 2] << 8);
    for (RTS_UI32 kind = 0; kind < SIM_CALLS; kind++)
        SimFlashFail(kind, 0);
    check_all();
    return 0;
}
