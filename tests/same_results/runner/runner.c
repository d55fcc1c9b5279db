/*
 * runner.c - runs applications from a file and writes what is in their memory after every step.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The portable runtime with the virtual clock of the simulator, on any processor with a C library: in QEMU a bare board
 * with semihosting, or a Linux process. Reads `batch` and writes `results` in the current folder. All numbers are
 * little-endian and 32 bits:
 *
 *   batch    target, number of applications; each: image size, image (padded to 4), number of steps; each step: kind,
 * amount,
 *            number of writes; each write: area, offset, size, bytes (padded to 4)
 *   results  for each application: result of the download; if it is ERR_OK, for each step: exception code, its code
 * offset,
 *            its task, then the bytes of data, retain, output and memory
 */
#include <stdio.h>
#include <stdlib.h>

#include "CmpAppEmbedded.h"
#include "Sim.h"

enum { MAX_IMAGE = 256 * 1024, MAX_WRITE = 4096 };
enum { STEP_CYCLES = 0, STEP_MS = 1 };

static FILE *batch;
static FILE *results;

static void fail(const char *what)
{
    printf("runner: %s\n", what);
    exit(2);
}

static RTS_UI32 get_number(void)
{
    RTS_UI32 number;

    if (fread(&number, sizeof number, 1, batch) != 1)
        fail("the batch ends early");
    return number;
}

static void get_bytes(RTS_UI8 *data, RTS_UI32 size, RTS_UI32 capacity)
{
    RTS_UI32 padded = (size + 3) & ~(RTS_UI32)3;

    if (padded < size || padded > capacity)
        fail("something in the batch is too large");
    if (padded > 0 && fread(data, padded, 1, batch) != 1)
        fail("the batch ends early");
}

static void put(const void *data, RTS_UI32 size)
{
    if (size > 0 && fwrite(data, size, 1, results) != 1)
        fail("the results cannot be written");
}

static void put_number(RTS_UI32 number)
{
    put(&number, sizeof number);
}

static RTS_RESULT download(const RTS_UI8 *image, RTS_UI32 size)
{
    static APP_REFUSAL refusal;
    const CDL_HEADER *header = (const CDL_HEADER *)(const void *)image;
    RTS_RESULT result = AppDownloadBegin(size, header->crc);

    if (result == ERR_OK)
        result = AppDownloadWrite(0, image, size);
    if (result == ERR_OK)
        result = AppDownloadEnd(&refusal);
    if (result == ERR_OK)
        result = AppStartApplication();
    if (result != ERR_OK)
        printf("runner: %s\n", refusal.text);
    return result;
}

static void apply_writes(RTS_UI32 count)
{
    static RTS_UI8 data[MAX_WRITE];

    while (count-- > 0) {
        RTS_UI32 area = get_number();
        RTS_UI32 offset = get_number();
        RTS_UI32 size = get_number();
        RTS_UI8 *place = AppGetAreaAddress(area, offset, size);
        RTS_UI32 i;
        get_bytes(data, size, sizeof data);
        for (i = 0; place != NULL && i < size; i++)
            place[i] = data[i];
    }
}

static void put_state(void)
{
    static const RTS_UI32 areas[] = {APP_AREA_DATA, APP_AREA_RETAIN, APP_AREA_OUTPUT, APP_AREA_MEMORY};
    APP_STATUS status;
    RTS_SIZE i;

    AppGetStatus(&status);
    put_number(status.exception.code);
    put_number(status.exception.code_offset);
    put_number((RTS_UI32)status.exception.task);
    for (i = 0; i < RTS_COUNT(areas); i++) {
        RTS_UI32 size = AppGetAreaSize(areas[i]);
        put(AppGetAreaAddress(areas[i], 0, size), size);
    }
}

static void run_step(bool loaded)
{
    RTS_UI32 kind = get_number();
    RTS_UI32 amount = get_number();

    apply_writes(get_number());
    if (!loaded)
        return;
    if (kind == STEP_MS)
        (void)SimRunFor((RTS_I64)amount * 1000000);
    else if (amount > 0)
        (void)SimRunCycles(amount);
    put_state();
}

static void run_application(void)
{
    static RTS_UI32 image[MAX_IMAGE / sizeof(RTS_UI32)];
    RTS_UI32 size = get_number();
    RTS_UI32 steps;
    RTS_RESULT result;

    get_bytes((RTS_UI8 *)image, size, sizeof image);
    if (SimFlashConfigure(SIM_FLASH_SIZE, SIM_FLASH_SECTOR_SIZE, SIM_FLASH_PROGRAM_SIZE, SIM_FLASH_ERASED) != ERR_OK ||
        SimStart() != ERR_OK)
        fail("the runtime does not start");
    result = download((const RTS_UI8 *)image, size);
    put_number((RTS_UI32)result);
    for (steps = get_number(); steps > 0; steps--)
        run_step(result == ERR_OK);
    SimStop();
}

int main(void)
{
    RTS_UI32 count;

#ifdef __ARM_ARCH_6M__ /* the processor in QEMU is a larger one, which would allow what a Cortex-M0 faults at */
    *(volatile RTS_UI32 *)0xE000ED14u |= 1u << 3; /* CCR.UNALIGN_TRP */
#endif
    batch = fopen("batch", "rb");
    results = fopen("results", "wb");
    if (batch == NULL || results == NULL)
        fail("there is no file 'batch', or 'results' cannot be written");
    SimSetTarget(TARGET_TYPE_PROGRAMMABLE, get_number(), 0x01000000);
    for (count = get_number(); count > 0; count--)
        run_application();
    fclose(results);
    return 0;
}
