/*
 * CmpTaskLoad.c - how much of the processor each task takes, and the limit of it.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Where tasks are threads the system knows their time, on one core TaskTime.c. In the simulator they run one after the
 * other: the time of their cycles is all there is.
 */
#include "CmpTaskLoad.h"

#if TASK_LOAD

#include <string.h>

#include "CmpScheduleTimer.h"
#include "IecCycle.h"
#include "SettingValues.h"
#include "SysAtomic.h"
#include "SysTime.h"
#include "TaskTime.h"
#include "TaskTrigger.h"

/* Of a task. Times wrap after 4.29 s, which is more than a window. */
typedef struct {
    RTS_UI32 used_ns; /* at the end of the last window, as the next ones */
    RTS_UI32 cycles;
    RTS_UI32 long_cycles;
    RTS_UI32 overruns;
    RTS_UI16 percent;
    RTS_UI8 status; /* TASK_* */
} WINDOW;

enum { PERCENT = 100, STATUS_BITS = 2 };
static const RTS_I64 window_ns = (RTS_I64)TASK_LOAD_WINDOW_MS * 1000000;

static struct {
    RTS_I64 since_ns;
    RTS_UI32 percent; /* of all */
    RTS_UI32 high;    /* windows in a row with too high a load */
    RTS_UI32 starts;  /* of the program, up to the one that the windows are of */
    WINDOW task[APP_MAX_TASKS];
} load;

/* ---- the time that a task had the processor ---- */

static RTS_UI32 read_used_ns(RTS_UI32 task)
{
#if SCHED_PROCESSOR_TIME
    return (RTS_UI32)SchedGetUsedNs(task);
#elif RTS_ONE_CORE
    return TaskTimeGet(task);
#else
    return IecCycleGetUsedNs(task);
#endif
}

/* ---- a window ---- */

#if IEC_TASK_CALLS
#define is_off(task) !IecCycleIsScheduled(task)
#else
#define is_off(task) false
#endif

/* A cycle is seen when it ends. Without one nothing new is known, unless several were due. */
static RTS_UI8 find_status(RTS_UI32 task, const WINDOW *before)
{
    const CDL_TASK *record = TriggerGetTask(task);
    const WINDOW *now = &load.task[task];
    RTS_UI32 cycles = now->cycles - before->cycles;
    RTS_UI32 long_cycles = now->long_cycles - before->long_cycles;

    if (record->kind != KIND_CYCLIC || is_off(task))
        return TASK_IDLE;
    if (cycles == 0)
        return record->interval_us < TASK_LOAD_WINDOW_MS * 1000 / 2 ? TASK_TOO_LATE : load.task[task].status;
    if (long_cycles == 0 && now->overruns == before->overruns)
        return TASK_IN_TIME;
    return long_cycles < cycles ? TASK_LATE : TASK_TOO_LATE;
}

static void read_counts(RTS_UI32 task)
{
    WINDOW *window = &load.task[task];

    window->used_ns = read_used_ns(task);
    window->cycles = IecCycleGetCycles(task);
    window->long_cycles = IecCycleGetLongCycles(task);
    window->overruns = SchedGetOverruns(task);
}

static void end_window_of(RTS_UI32 task, RTS_UI32 ns_per_percent)
{
    WINDOW *window = &load.task[task];
    WINDOW before = *window;

    read_counts(task);
    window->percent = (RTS_UI16)((window->used_ns - before.used_ns) / ns_per_percent);
    window->status = find_status(task, &before);
}

/* Returns the load of all tasks that have to stay below the limit; *largest: the one with the largest. */
static RTS_UI32 sum_limited(RTS_UI32 *largest)
{
    RTS_UI32 sum = 0;
    RTS_UI32 most = 0;
    RTS_UI32 i;

    for (i = 0; i < IecTaskGetCount(); i++) {
        if (TriggerGetTask(i)->kind == KIND_FREEWHEELING)
            continue;
        sum += load.task[i].percent;
        if (load.task[i].percent >= most) {
            most = load.task[i].percent;
            *largest = i;
        }
    }
    return sum;
}

static void check_limit(void)
{
    RTS_UI32 limit = (RTS_UI32)SETTING(MaxLoad);
    RTS_UI32 largest = 0;

    load.high = limit != 0 && sum_limited(&largest) > limit ? load.high + 1 : 0;
    if (load.high >= TASK_LOAD_PATIENCE)
        IecCycleBlame(largest);
}

static void begin_first_window(RTS_I64 now_ns)
{
    RTS_UI32 i;

    load.since_ns = now_ns;
    load.percent = 0;
    load.high = 0;
    for (i = 0; i < IecTaskGetCount(); i++) {
        read_counts(i);
        load.task[i].percent = 0;
        load.task[i].status = TASK_IDLE;
    }
    SysAtomicStore(&load.starts, IecCycleGetStarts());
}

static void end_window(RTS_I64 now_ns)
{
    RTS_I64 length_ns = now_ns - load.since_ns;
    RTS_UI32 sum = 0;
    RTS_UI32 i;

    load.since_ns = now_ns;
    for (i = 0; i < IecTaskGetCount(); i++) {
        end_window_of(i, (RTS_UI32)(length_ns >> 32 == 0 ? length_ns : 0xFFFFFFFF) / PERCENT);
        sum += load.task[i].percent;
    }
    load.percent = sum;
    check_limit();
}

/* On one core from above all tasks, which may leave main no time; elsewhere from main. */
static void sample(RTS_I64 now_ns)
{
    if (!IecCycleMayStart())
        return;
    if (load.starts != IecCycleGetStarts())
        begin_first_window(now_ns);
    else if (now_ns - load.since_ns >= window_ns)
        end_window(now_ns);
}

/* ---- what others ask ---- */

static bool is_known(void)
{
    return IecCycleMayStart() && SysAtomicLoad(&load.starts) == IecCycleGetStarts();
}

RTS_UI32 TaskLoadGet(RTS_UI32 task)
{
    if (!is_known() || task > IecTaskGetCount())
        return 0;
    return task == IecTaskGetCount() ? load.percent : load.task[task].percent;
}

RTS_UI32 TaskLoadGetStatus(RTS_UI32 word)
{
    const RTS_UI32 in_word = 32 / STATUS_BITS;
    RTS_UI32 status = 0;
    RTS_UI32 i;

    for (i = 0; is_known() && i < in_word && word * in_word + i < IecTaskGetCount(); i++)
        status |= (RTS_UI32)load.task[word * in_word + i].status << (i * STATUS_BITS);
    return status;
}

RTS_RESULT CmpTaskLoad_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        CMP_CLEAR(load);
#if RTS_ONE_CORE
    if (hook == CH_INIT)
        SchedSetSampler(sample);
#else
    if (hook == CH_COMM_CYCLE)
        sample(SysTimeGetNs());
#endif
    return ERR_OK;
}

#endif
