/*
 * SysTimer.h - periodic hardware timers a port gives; each runs one cyclic IEC task.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A port offers at least APP_MAX_TASKS timers. On bare metal a timer is a timer interrupt at its own NVIC priority, on
 * Linux a SCHED_FIFO thread, in the simulator an entry of the virtual clock's queue.
 */
#ifndef SYSTIMER_H
#define SYSTIMER_H

#include "CmpErrors.h"
#include "CmpStd.h"

/*
 * Called once per period, in the timer's own context. `due_ns`: when it should have been called (SysTimeGetNs), start
 * + n * interval exactly. Due times that pass while a callback runs are skipped and counted.
 */
typedef void (*SYS_TIMER_CALLBACK)(void *param, RTS_I64 due_ns);

/* Creates a stopped timer; priority 0 (highest) .. 31. From main. ERR_NOMEMORY when all timers are in use. */
RTS_RESULT SysTimerCreate(SYS_TIMER_CALLBACK callback, void *param, RTS_UI32 interval_us, RTS_UI32 priority,
                          RTS_HANDLE *timer);

/* First call at once (due now), then once per interval. From main. */
RTS_RESULT SysTimerStart(RTS_HANDLE timer);

/* After it returns the callback is not running and is not called again; a callback that does not come to an end is the
 * watchdog's business. From main, never from a callback. */
RTS_RESULT SysTimerStop(RTS_HANDLE timer);

/* Stops and frees. */
RTS_RESULT SysTimerDelete(RTS_HANDLE timer);

/* How many due times were skipped since the timer was created; 0 when there is no such timer. From main. */
RTS_UI32 SysTimerGetOverruns(RTS_HANDLE timer);

#endif
