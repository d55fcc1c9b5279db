/*
 * SysTimer.h - timers a port gives; each runs one IEC task in a context of its own.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A port offers at least APP_MAX_TASKS timers. On bare metal a timer is a timer interrupt at its own NVIC priority, on
 * Linux a thread, in the simulator an entry of the virtual clock's queue.
 *
 * A timer is periodic and runs a cyclic task. With SCHED_EVENTS_IN_TIMERS (rts_config.h) there are also timers without
 * an interval, which call when they are triggered: they run the tasks that wait for an event.
 */
#ifndef SYSTIMER_H
#define SYSTIMER_H

#include "CmpErrors.h"
#include "CmpStd.h"

/*
 * Called once per period, in the timer's own context. `due_ns`: when it should have been called (SysTimeGetNs), start
 * + n * interval exactly. Due times that pass while a callback runs are skipped and counted. Without an interval:
 * called after SysTimerTrigger, `due_ns` has no meaning.
 */
typedef void (*SYS_TIMER_CALLBACK)(void *param, RTS_I64 due_ns);

/* Creates a stopped timer; priority 0 (highest) .. 31; interval 0: it is triggered. From main. ERR_NOMEMORY when all
 * timers are in use, ERR_PARAMETER without a callback or with a priority above 31. */
RTS_RESULT SysTimerCreate(SYS_TIMER_CALLBACK callback, void *param, RTS_UI32 interval_us, RTS_UI32 priority,
                          RTS_HANDLE *timer);

/* Starts a stopped timer: first call at once (due now), then once per interval, or trigger; without an interval a
 * needless call now and then does no harm. From main. ERR_INVALID_HANDLE when there is no such timer, ERR_NOMEMORY when
 * the system gives it no thread. */
RTS_RESULT SysTimerStart(RTS_HANDLE timer);

/* After it returns the callback is not running and is not called again; a callback that does not come to an end is the
 * watchdog's business. Does nothing when it is stopped. From main, never from a callback. ERR_INVALID_HANDLE when there
 * is no such timer. */
RTS_RESULT SysTimerStop(RTS_HANDLE timer);

/*
 * Has a timer without interval call once, at `due_ns` (SysTimeGetNs) or at once when that has passed. Triggered again
 * before the call has begun it still calls once, at the earlier time; triggered while the callback runs it calls again
 * afterwards. Does nothing when the timer is stopped. From any context but a signal handler: main, tasks, interrupts
 * below the clock's, the callback itself. Only with SCHED_EVENTS_IN_TIMERS; a time to come only with
 * SCHED_FREEWHEELING_IN_TIMERS.
 */
void SysTimerTrigger(RTS_HANDLE timer, RTS_I64 due_ns);

/* Stops and frees. From main, never from a callback. ERR_INVALID_HANDLE when there is no such timer. */
RTS_RESULT SysTimerDelete(RTS_HANDLE timer);

/* How many due times were skipped since the timer was created; 0 when there is no such timer. From main. */
RTS_UI32 SysTimerGetOverruns(RTS_HANDLE timer);

/* Processor time that the context of a timer has used since it was started [ns]; 0 while it is stopped. From main. Only of
 * ports with SCHED_PROCESSOR_TIME. */
RTS_I64 SysTimerGetUsedNs(RTS_HANDLE timer);

#endif
