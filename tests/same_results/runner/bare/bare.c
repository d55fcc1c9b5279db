/*
 * bare.c - what the simulator's clock needs on a bare processor: RAM as flash, checked errors.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * There are no interrupts and no supervisor: an endless loop is aborted by the time limit of the test. A fault that is
 * not a checked error is one of the test: it ends the runner.
 */
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "Sim.h"
#include "SimLink.h"
#include "SysExcept.h"
#include "SysFlash.h"
#include "rts_config.h"
#include "sim_port.h"

/* ---- flash ---- */

static RTS_UI64 cells[SIM_FLASH_SIZE / sizeof(RTS_UI64)] __attribute__((aligned(16)));
#define CELLS ((RTS_UI8 *)cells)

static RTS_RESULT flash_read(RTS_UI32 offset, void *data, RTS_UI32 size)
{
    memcpy(data, CELLS + offset, size);
    return ERR_OK;
}

static RTS_RESULT flash_program(RTS_UI32 offset, const void *data, RTS_UI32 size)
{
    memcpy(CELLS + offset, data, size);
    return ERR_OK;
}

static RTS_RESULT flash_erase(RTS_UI32 offset)
{
    memset(CELLS + offset, SIM_FLASH_ERASED, SIM_FLASH_SECTOR_SIZE);
    return ERR_OK;
}

static RTS_RESULT flash_sync(void)
{
    return ERR_OK;
}

const SYS_FLASH *SysFlashGet(void)
{
    static const SYS_FLASH flash = {
        SIM_FLASH_SIZE,
        SIM_FLASH_SECTOR_SIZE,
        SIM_FLASH_PROGRAM_SIZE,
        SIM_FLASH_ERASED,
        CELLS,
        flash_read,
        flash_program,
        flash_erase,
        flash_sync,
    };

    return &flash;
}

const RTS_UI8 *SysFlashMapCode(RTS_UI32 slot, RTS_UI32 offset, RTS_UI32 size)
{
    RTS_UNUSED(slot);
    __builtin___clear_cache((char *)CELLS + offset, (char *)CELLS + offset + size);
    return CELLS + offset;
}

void SysFlashReleaseCode(RTS_UI32 slot)
{
    RTS_UNUSED(slot);
}

RTS_RESULT SimFlashConfigure(RTS_UI32 size, RTS_UI32 sector_size, RTS_UI32 program_size, RTS_UI8 erased)
{
    RTS_UNUSED(size);
    RTS_UNUSED(sector_size);
    RTS_UNUSED(program_size);
    memset(cells, erased, sizeof cells);
    return ERR_OK;
}

RTS_RESULT SimFlashPowerOn(void)
{
    return ERR_OK;
}

/* ---- what a board without lines and threads leaves out ---- */

void SimComPowerOn(void)
{
}

void SimLinkReset(void)
{
}

void SimSuperviseHold(bool hold)
{
    RTS_UNUSED(hold);
}

void SimSuperviseStart(void)
{
}

void SimMutexLock(void)
{
}

void SimMutexUnlock(void)
{
}

int nanosleep(const struct timespec *time, struct timespec *left)
{
    RTS_UNUSED(time);
    RTS_UNUSED(left);
    return 0;
}

int clock_gettime(clockid_t clock, struct timespec *now)
{
    RTS_UNUSED(clock);
    memset(now, 0, sizeof *now);
    return 0;
}

/* ---- checked errors ---- */

static struct {
    bool running;
    jmp_buf landing;
    RTS_EXCEPTION raised;
} try;

bool SysExceptTry(void (*fn)(void *arg), void *arg, RTS_EXCEPTION *exception)
{
    memset(&try.raised, 0, sizeof try.raised);
    if (setjmp(try.landing) == 0) {
        try.running = true;
        fn(arg);
    }
    try.running = false;
    *exception = try.raised;
    return exception->code == RTSEXCPT_NOEXCEPTION;
}

void SysExceptRaise(RTS_UI32 code, uintptr_t address, const void *stack)
{
    RTS_UNUSED(stack);
    if (!try.running)
        abort();
    try.raised.code = code;
    try.raised.address = address;
    longjmp(try.landing, 1);
}

void SysExceptBreak(const void *arg, RTS_UI32 code)
{
    RTS_UNUSED(arg);
    RTS_UNUSED(code);
}

void SysExceptShutdown(void)
{
}

/* ---- functions of a host ---- */

/* There is no host here that could implement functions. */
RTS_RESULT SimFunctionsRegister(void)
{
    return ERR_OK;
}
