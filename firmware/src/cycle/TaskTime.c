/*
 * TaskTime.c - how long each task has had the processor, where there is one and tasks interrupt each other.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * One context has the processor at a time. Each change of it is noted, and the time since the last one is charged to the
 * context that had it.
 */
#include "TaskTime.h"

#if TASK_LOAD && RTS_ONE_CORE

#include <string.h>

#include "CmpItf.h"
#include "SysLock.h"
#include "SysTime.h"

enum { NO_TASK = APP_MAX_TASKS };

static struct {
    RTS_UI32 current;
    RTS_I64 since_ns;
    RTS_UI32 used_ns[APP_MAX_TASKS + 1];
} processor;

void TaskTimeForget(void)
{
    CMP_CLEAR(processor);
    processor.current = NO_TASK;
    processor.since_ns = SysTimeGetNs();
}

RTS_UI32 TaskTimeSwitch(RTS_UI32 task)
{
    RTS_UI32 lock = SysLockEnter();
    RTS_UI32 before = processor.current;
    RTS_I64 now_ns = SysTimeGetNs();

    processor.used_ns[before] += (RTS_UI32)(now_ns - processor.since_ns);
    processor.since_ns = now_ns;
    processor.current = task;
    SysLockLeave(lock);
    return before;
}

RTS_UI32 TaskTimeGet(RTS_UI32 task)
{
    (void)TaskTimeSwitch(processor.current);
    return processor.used_ns[task];
}

#endif
