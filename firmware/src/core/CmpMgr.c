/*
 * CmpMgr.c - component manager: start-up, shutdown, external functions.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpItf.h"

#include <string.h>

#include "CmpLog.h"
#include "rts_config.h"

typedef struct {
    const CMP_EXT_FUNCTION *functions;
    RTS_SIZE count;
} EXT_TABLE;

static struct {
    EXT_TABLE tables[CM_MAX_EXT_TABLES];
    RTS_SIZE table_count;
} manager;

/* A step of the start-up and what undoes it. */
typedef struct {
    CMP_HOOK init;
    CMP_HOOK exit;
} STEP;

static const STEP steps[] = {
    {CH_INIT_SYSTEM, CH_EXIT_SYSTEM},
    {CH_INIT_SYSTEM2, CH_EXIT_SYSTEM2},
    {CH_INIT, CH_EXIT},
    {CH_INIT2, CH_EXIT2},
    {CH_INIT3, CH_EXIT3},
    {CH_INIT_SYSTEM_TASKS, CH_EXIT_SYSTEM_TASKS},
    {CH_INIT_TASKS, CH_EXIT_TASKS},
    {CH_INIT_COMM, CH_EXIT_COMM},
};

/* Calls the exit hook of step `step` for the first `count` components, last one first. */
static void undo_step(RTS_SIZE step, RTS_SIZE count)
{
    while (count > 0)
        (void)cmp_components[--count].hook(steps[step].exit);
}

static void undo_all(RTS_SIZE step_count)
{
    while (step_count > 0)
        undo_step(--step_count, cmp_component_count);
}

static RTS_RESULT do_step(RTS_SIZE step)
{
    RTS_SIZE i;
    RTS_RESULT result;

    for (i = 0; i < cmp_component_count; i++) {
        result = cmp_components[i].hook(steps[step].init);
        if (result != ERR_OK) {
            LogAdd(CMPID_CmpMgr, LOG_ERROR, result, "Start-up failed in %s, step %u", cmp_components[i].name,
                   (unsigned)step);
            undo_step(step, i);
            return result;
        }
    }
    return ERR_OK;
}

RTS_RESULT CMInit(void)
{
    RTS_SIZE step;
    RTS_RESULT result;

    memset(&manager, 0, sizeof manager);
    for (step = 0; step < RTS_COUNT(steps); step++) {
        result = do_step(step);
        if (result != ERR_OK) {
            undo_all(step);
            return result;
        }
    }
    result = CMCallHook(CH_INIT_FINISHED);
    if (result != ERR_OK)
        undo_all(RTS_COUNT(steps));
    return result;
}

RTS_RESULT CMExit(void)
{
    undo_all(RTS_COUNT(steps));
    return ERR_OK;
}

RTS_RESULT CMCallHook(CMP_HOOK hook)
{
    RTS_RESULT first = ERR_OK;
    RTS_SIZE i;

    for (i = 0; i < cmp_component_count; i++) {
        RTS_RESULT result = cmp_components[i].hook(hook);
        if (first == ERR_OK)
            first = result;
    }
    return first;
}

const char *CMGetComponentName(RTS_UI32 id)
{
    RTS_SIZE i;

    if (id == CMPID_CmpMgr)
        return "CmpMgr";
    for (i = 0; i < cmp_component_count; i++) {
        if (cmp_components[i].id == id)
            return cmp_components[i].name;
    }
    return "";
}

RTS_RESULT CMRegisterExternal(const CMP_EXT_FUNCTION *table, RTS_SIZE count)
{
    if (manager.table_count == CM_MAX_EXT_TABLES)
        return ERR_NOMEMORY;
    manager.tables[manager.table_count].functions = table;
    manager.tables[manager.table_count].count = count;
    manager.table_count++;
    return ERR_OK;
}

const CMP_EXT_FUNCTION *CMFindExternal(const char *name)
{
    RTS_SIZE t;
    RTS_SIZE i;

    for (t = 0; t < manager.table_count; t++) {
        for (i = 0; i < manager.tables[t].count; i++) {
            if (strcmp(manager.tables[t].functions[i].name, name) == 0)
                return &manager.tables[t].functions[i];
        }
    }
    return NULL;
}
