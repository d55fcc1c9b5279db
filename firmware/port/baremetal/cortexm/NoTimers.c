/*
 * NoTimers.c - in place of SysTimer.c, for a super loop (CmpScheduleEmbedded.c): no task interrupts main.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CortexM.h"

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

/* No line of a task is ever enabled. */
void TimerIrq(void);
void TimerIrq(void)
{
}
