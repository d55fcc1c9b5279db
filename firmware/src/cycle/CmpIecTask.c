/*
 * CmpIecTask.c - the tasks of the application.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpIecTask.h"

#include "CmpScheduleTimer.h"
#include "IecCycle.h"
#include "SchedEvents.h"
#include "SysExcept.h"
#include "SysTime.h"
#include "TaskTrigger.h"
#include "rts_config.h"

/* ---- the external function for checks in compiled code ---- */

/* The call is before the return address; that of Thumb code has its mode bit set. */
static void iecraise(RTS_UI32 code)
{
    uintptr_t address = (uintptr_t)__builtin_return_address(0) & ~(uintptr_t)APP_ENTRY_MODE_BIT;

    SysExceptRaise(code, address - 1, __builtin_dwarf_cfa());
}

static const CMP_EXT_FUNCTION externals[] = {
    {"iecraise", 0x703B892E, 0x00010000, (RTS_PFN)iecraise}, /* iecraise(UDINT) */
};

/* ---- all tasks ---- */

RTS_RESULT IecTaskCreateAll(const CDL_TASK *records, RTS_UI32 count, const IEC_CONTEXT *prototype)
{
    if (count > APP_MAX_TASKS)
        return ERR_NOMEMORY;
    IecCycleCreate(records, count, prototype);
    return SchedCreateTasks(records, count, count > 0 ? prototype->area : NULL);
}

#if BP_MAX > 0
static const IEC_TASK_WATCHER *watcher;

void IecTaskSetWatcher(const IEC_TASK_WATCHER *of)
{
    watcher = of;
}
#endif

RTS_RESULT IecTaskStartAll(void)
{
#if BP_MAX > 0
    if (watcher != NULL)
        watcher->will_start();
#endif
    IecCycleStart();
    return SchedStart();
}

/* Not inlined: it is called from three places. */
RTS_NOINLINE void IecTaskStopAll(void)
{
    IecCycleStop();
#if BP_MAX > 0
    if (watcher != NULL)
        watcher->stop();
#endif
    SchedStop();
    IecCycleCallOff();
}

#if ONLINE_CHANGE
void IecTaskSetCode(const CDL_TASK *records, RTS_UI32 count, RTS_UI32 kept, const IEC_CONTEXT *prototype)
{
    IecCycleSetCode(records, count, kept, prototype);
    TriggerChange(records, count, kept);
}

static RTS_RESULT exchange_tasks(const CYCLE_EXCHANGE *exchange, RTS_UI32 kept)
{
    RTS_RESULT result;

    SchedStopOthers(kept);
    result = IecCycleExchange(exchange);
    if (result == ERR_OK)
        return SchedChangeOthers(TriggerGetTask(0), IecTaskGetCount(), kept);
    SchedStartOthers(kept);
    return result;
}

RTS_RESULT IecTaskExchange(const CYCLE_EXCHANGE *exchange, RTS_UI32 kept)
{
#if BP_MAX > 0
    bool watched = watcher != NULL && IecCycleMayRun();
    RTS_RESULT result;

    if (watched)
        watcher->stop();
    result = exchange_tasks(exchange, kept);
    if (watched)
        watcher->will_start();
    return result;
#else
    return exchange_tasks(exchange, kept);
#endif
}
#endif

static void run_each_once(RTS_UI32 priority, bool by_event)
{
    RTS_UI32 i;

    for (i = 0; i < IecTaskGetCount(); i++) {
        const CDL_TASK *task = TriggerGetTask(i);
        bool waits = SCHED_WAITS_FOR_VARIABLE(task->kind) || task->kind == KIND_EXTERNAL;
        if (task->priority == priority && waits == by_event && (!waits || TriggerTake(i)))
            (void)IecTaskCycle(i, SysTimeGetNs());
    }
}

void IecTaskRunOnce(void)
{
    RTS_UI32 priority;

    TriggerForget();
    IecCycleStart();
    for (priority = 0; priority <= CDL_PRIORITY_LOWEST; priority++)
        run_each_once(priority, false);
    for (priority = 0; priority <= CDL_PRIORITY_LOWEST; priority++)
        run_each_once(priority, true);
    IecTaskStopAll();
}

RTS_RESULT IecTaskGetInfo(RTS_UI32 index, IEC_TASK_INFO *info)
{
    RTS_RESULT result = IecCycleGetInfo(index, info);

    if (result == ERR_OK && info->cycles > 0)
        info->overruns = SchedGetOverruns(index);
    return result;
}

RTS_RESULT CmpIecTask_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        IecCycleForget();
    return hook == CH_INIT3 ? CMRegisterExternal(externals, RTS_COUNT(externals)) : ERR_OK;
}
