/*
 * iec.c - runs the first task of an application on a Cortex-M: prints its checksum and its instructions per cycle.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Reads `job`: target, area and offset of the checksum, size of the image, image; numbers have 32 bits.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "CmpAppEmbedded.h"
#include "CmpIecTask.h"
#include "Sim.h"
#include "clock.h"

enum { MAX_IMAGE = 256 * 1024, NS_PER_CYCLE = 1000000 };

static struct {
    RTS_UI32 target, area, offset, size;
    RTS_UI32 image[MAX_IMAGE / sizeof(RTS_UI32)];
} job;

static void check(RTS_RESULT result, const char *what)
{
    if (result == ERR_OK)
        return;
    printf("%s: error %lu\n", what, (unsigned long)result);
    exit(1);
}

static void load(void)
{
    static APP_REFUSAL refusal;
    FILE *file = fopen("job", "rb");

    if (file == NULL || fread(&job, 1, sizeof job, file) < sizeof(CDL_HEADER))
        check(ERR_NO_OBJECT, "the job");
    SimSetTarget(TARGET_TYPE_PROGRAMMABLE, job.target, 0x01000000);
    check(SimFlashConfigure(SIM_FLASH_SIZE, SIM_FLASH_SECTOR_SIZE, SIM_FLASH_PROGRAM_SIZE, SIM_FLASH_ERASED), "flash");
    check(SimStart(), "start");
    check(AppDownloadBegin(job.size, job.image[CDL_CRC_OFFSET / sizeof(RTS_UI32)]), "download");
    check(AppDownloadWrite(0, (const RTS_UI8 *)job.image, job.size), "download");
    check(AppDownloadEnd(&refusal), refusal.text);
}

/* In a SysExceptTry, because checks may fail. */
static void run(void *arg)
{
    RTS_UI64 *instructions = arg;
    IEC_CONTEXT *context;
    IEC_ENTRY entry;

    check(IecTaskGetEntry(0, &entry, &context), "task");
    clock_start();
    for (int i = 0; i < CYCLES; i++) {
        APP_CALL_ENTRY(entry, context);
        context->time_ns += NS_PER_CYCLE;
        context->time_ms++;
    }
    *instructions = clock_instructions();
}

int main(void)
{
    RTS_EXCEPTION exception;
    RTS_UI64 instructions = 0;
    RTS_UI32 chk;

    load();
    if (SysExceptTry(run, &instructions, &exception))
        check(exception.code, "exception");
    memcpy(&chk, AppGetAreaAddress(job.area, job.offset, sizeof chk), sizeof chk);
    printf("%lu %lu\n", (unsigned long)chk, (unsigned long)(instructions / CYCLES));
    return 0;
}
