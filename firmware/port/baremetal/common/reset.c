/*
 * reset.c - why the controller started: kept in RAM that survives a reset and is not cleared.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A chip with a reset cause register can tell more: its board calls ResetSetCause.
 */
#include "BareMetal.h"
#include "SysExcept.h"
#include "SysStart.h"

enum { RECORD_MAGIC = 0x52535430 };

/* Written before a reset; volatile, because no program reads it after that. */
__attribute__((section(".noinit"))) static volatile RESET_RECORD kept;
static RESET_RECORD last; /* what this start-up found there */

void ResetInit(void)
{
    last = kept;
    if (last.magic != RECORD_MAGIC || last.cause >= RESET_CAUSE_COUNT)
        last.cause = RESET_POWER_ON;
    kept = (RESET_RECORD){.magic = RECORD_MAGIC, .cause = RESET_PIN};
}

const RESET_RECORD *ResetGet(void)
{
    return &last;
}

void ResetSetCause(RESET_CAUSE cause)
{
    last.cause = cause;
}

void ResetNow(RESET_CAUSE cause, RTS_UI32 pc)
{
    kept = (RESET_RECORD){.magic = RECORD_MAGIC, .cause = cause, .pc = pc, .status = CpuFaultStatus()};
    CpuBarrier();
    CpuReset();
    for (;;)
        CpuBarrier();
}

/* Which reset it was, and where, main has put into the log. An unannounced one may have been the reset pin, or the
 * watchdog of a chip that does not report it. */
const SYS_START *SysStartGet(void)
{
    static const SYS_START starts[] = {
        {SYS_START_POWER, 0, -1, RTSEXCPT_NOEXCEPTION, APP_NO_CODE_OFFSET, ""},
        {SYS_START_CRASH, 0, -1, RTSEXCPT_NOEXCEPTION, APP_NO_CODE_OFFSET, ""},
        {SYS_START_UNKNOWN, 0, -1, RTSEXCPT_NOEXCEPTION, APP_NO_CODE_OFFSET, ""},
    };

    if (last.cause >= RESET_FATAL)
        return &starts[SYS_START_CRASH];
    return &starts[last.cause == RESET_PIN ? SYS_START_UNKNOWN : SYS_START_POWER];
}
