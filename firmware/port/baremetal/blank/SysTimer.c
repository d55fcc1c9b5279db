/*
 * SysTimer.c - timers, one for each cyclic task. Contract: SysTimer.h.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysTimer.h"

/*
 * Write here: take a free timer, keep callback, parameter, interval and priority. Timers of a better priority interrupt
 * those of a worse one. With fewer hardware timers than tasks, one alarm for the earliest due time is enough (see
 * common/SysTimer.c).
 */
RTS_RESULT SysTimerCreate(SYS_TIMER_CALLBACK callback, void *param, RTS_UI32 interval_us, RTS_UI32 priority,
                          RTS_HANDLE *timer)
{
    RTS_UNUSED(callback);
    RTS_UNUSED(param);
    RTS_UNUSED(interval_us);
    RTS_UNUSED(priority);
    RTS_UNUSED(timer);
    return ERR_NOTIMPLEMENTED;
}

/* Write here: the first call is due now, the n-th at start + n * interval exactly; due times that pass during a
 * callback are skipped and counted. */
RTS_RESULT SysTimerStart(RTS_HANDLE timer)
{
    RTS_UNUSED(timer);
    return ERR_NOTIMPLEMENTED;
}

/* Write here: no call after this one returns. */
RTS_RESULT SysTimerStop(RTS_HANDLE timer)
{
    RTS_UNUSED(timer);
    return ERR_NOTIMPLEMENTED;
}

/* Write here, and say SCHED_EVENTS_IN_TIMERS 1 in rts_config_port.h: a timer created with interval 0 calls once, in its
 * context. Until then tasks that wait for an event run in main. */
void SysTimerTrigger(RTS_HANDLE timer, RTS_I64 due_ns)
{
    RTS_UNUSED(timer);
    RTS_UNUSED(due_ns);
}

/* Write here: stop and free. */
RTS_RESULT SysTimerDelete(RTS_HANDLE timer)
{
    RTS_UNUSED(timer);
    return ERR_NOTIMPLEMENTED;
}

/* Write here: how many due times were skipped. */
RTS_UI32 SysTimerGetOverruns(RTS_HANDLE timer)
{
    RTS_UNUSED(timer);
    return 0;
}
