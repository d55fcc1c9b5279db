/*
 * fuzz_log.h - a device with two applications whose log of one kind holds anything.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: the content of the log from its first byte on. The CRC of whatever looks like a record is made right, but for
 * one in 16.
 */
#ifndef FUZZ_LOG_H
#define FUZZ_LOG_H

#include "SysFileFlash.h"
#include "SysFlashLog.h"
#include "app_image.h"
#include "fuzz.h"

enum { FUZZ_FLASH_SIZE = 64 * 1024, FUZZ_SECTOR_SIZE = 1024 };

static APP_BYTES fuzz_images[4]; /* [step]; 0 unused */

/* An application is taken, started and runs for this long. */
static inline void fuzz_install(RTS_UI32 step, RTS_I64 duration)
{
    FUZZ_CHECK(download(&fuzz_images[step]) == ERR_OK && AppStartApplication() == ERR_OK);
    FUZZ_CHECK(SimAdvance(duration) == ERR_OK);
    FUZZ_CHECK(app_state() == AS_RUN && read_u32(APP_AREA_DATA, STEP_OFFSET) == step);
}

/* What the flash holds after applications 1 and 2 have proven themselves. */
static inline const RTS_UI8 *fuzz_history(void)
{
    static RTS_UI8 content[FUZZ_FLASH_SIZE];
    static bool is_prepared;
    RTS_UI32 step;

    if (is_prepared)
        return content;
    is_prepared = true;
    FUZZ_CHECK(SimFlashConfigure(FUZZ_FLASH_SIZE, FUZZ_SECTOR_SIZE, 8, 0xFF) == ERR_OK);
    FUZZ_CHECK(SimStart() == ERR_OK);
    for (step = 1; step <= 3; step++)
        build_counter(&fuzz_images[step], step);
    fuzz_install(1, ms(5000));
    fuzz_install(2, ms(5000));
    SimStop();
    memcpy(content, SimFlashData(), sizeof content);
    return content;
}

static inline void fuzz_repair_records(RTS_UI8 *log, RTS_UI32 size)
{
    RTS_UI32 at;

    for (at = 0; at + FLASH_LOG_HEAD_SIZE <= size; at += FILE_ALIGN) {
        FLASH_LOG_HEAD head;
        memcpy(&head, log + at, sizeof head);
        if (head.magic != FLASH_LOG_MAGIC || head.size > size - at - FLASH_LOG_HEAD_SIZE || head.crc % 16 == 15)
            continue;
        head.crc = CRC32Update(0, &head, offsetof(FLASH_LOG_HEAD, crc));
        head.crc = CRC32Update(head.crc, log + at + FLASH_LOG_HEAD_SIZE, head.size);
        memcpy(log + at, &head, sizeof head);
    }
}

/* Power comes to the device with `data` in file `file`. */
static inline void fuzz_start_with(RTS_UI32 file, const uint8_t *data, size_t size)
{
    static RTS_UI8 content[FUZZ_FLASH_SIZE];
    const FILE_AREA *area;

    memcpy(content, fuzz_history(), sizeof content);
    area = SysFileGetArea(file);
    memset(content + area->offset, 0xFF, area->size);
    memcpy(content + area->offset, data, size < area->size ? size : area->size);
    fuzz_repair_records(content + area->offset, area->size);
    SimStop();
    FUZZ_CHECK(SimFlashLoad(content, sizeof content) == ERR_OK);
    FUZZ_CHECK(SimStart() == ERR_OK);
}

/* The log as it is in a device that is well, and the same with the other half in use. */
static inline size_t fuzz_log_seed(RTS_UI32 file, unsigned index, uint8_t *data, size_t capacity)
{
    const RTS_UI8 *history = fuzz_history();
    const FILE_AREA *area = SysFileGetArea(file);
    RTS_UI32 size = area->size;

    if (index > 0)
        return 0;
    while (size > 0 && history[area->offset + size - 1] == 0xFF)
        size--;
    if (size > capacity)
        size = (RTS_UI32)capacity;
    memcpy(data, history + area->offset, size);
    return size;
}

/* Another application is taken, and is what runs after power was off. */
static inline void fuzz_check_can_be_flashed(void)
{
    fuzz_install(3, ms(50));
    FUZZ_CHECK(SimStart() == ERR_OK);
    FUZZ_CHECK(app_state() == AS_RUN && read_u32(APP_AREA_DATA, STEP_OFFSET) == 3);
    FUZZ_CHECK(SimFlashViolations() == 0);
}

#endif
