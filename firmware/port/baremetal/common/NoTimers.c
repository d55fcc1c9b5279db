/*
 * NoTimers.c - in place of SysTimer.c, for a super loop (CmpScheduleEmbedded.c): no task interrupts main.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "BareMetal.h"

void SysTimerInit(void)
{
}

void SysTimerAlarm(void)
{
}

bool SysTimersWork(void)
{
    return true;
}

/* No interrupt of a task is ever triggered. */
void SysTimerRun(RTS_UI32 timer)
{
    RTS_UNUSED(timer);
}
