/*
 * CmpMgr.c - component manager: start-up, shutdown, external functions.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpItf.h"

#include <string.h>

#include "CmpLog.h"
#include "rts_config.h"

#if CM_LEAVES_OUT

static struct {
    CMP_FAILURE first;
    const char *setting; /* what the log says of a full table */
} failure;

const CMP_FAILURE *CMGetFailure(void)
{
    return &failure.first;
}

bool CMHasLeftOut(void)
{
    return failure.first.name != NULL;
}

RTS_RESULT CMNoRoomIn(const char *setting)
{
    failure.setting = setting;
    return ERR_NOMEMORY;
}

static void forget_failures(void)
{
    CMP_CLEAR(failure);
    if (!RTS_STARTS_ONCE)
        memset(cmp_left_out, 0, cmp_component_count * sizeof cmp_left_out[0]);
}

/* The log entry says what to write if a table was full. */
static void note_failure(RTS_SIZE component, RTS_RESULT error)
{
    const CMP_NAME *name = &cmp_names[component];

    if (failure.first.name == NULL)
        failure.first = (CMP_FAILURE){name->name, name->id, error};
    if (error != ERR_NOMEMORY || failure.setting == NULL)
        failure.setting = "";
    LogAdd(CMPID_CmpMgr, LOG_ERROR | LOG_KEPT, error, "Start of %s failed%s", name->name, failure.setting);
}

/* Leaves a component out whose hook failed, if the device can do without. */
static RTS_RESULT leave_out(RTS_SIZE component, CMP_HOOK hook, RTS_RESULT error)
{
    note_failure(component, error);
    if (component < cmp_programs_first || component >= cmp_programs_end)
        return error;
    cmp_left_out[component] = true;
    while (hook-- > CH_INIT_SYSTEM)
        (void)cmp_hooks[component]((CMP_HOOK)(CH_EXIT_SYSTEM - hook));
    return ERR_OK;
}

static RTS_RESULT call(RTS_SIZE component, CMP_HOOK hook)
{
    RTS_RESULT result = cmp_left_out[component] ? (RTS_RESULT)ERR_OK : cmp_hooks[component](hook);

    return result == ERR_OK || hook > CH_INIT_FINISHED ? result : leave_out(component, hook, result);
}

#else

static void forget_failures(void)
{
}

static RTS_RESULT call(RTS_SIZE component, CMP_HOOK hook)
{
    return cmp_hooks[component](hook);
}

#endif

#if CM_VERSIONS > 0

static struct {
    RTS_UI32 count;
    struct {
        RTS_UI32 id;
        RTS_UI32 version;
    } of[CM_VERSIONS];
} versions;

void CMNoteVersion(RTS_UI32 id, RTS_UI32 version)
{
    if (versions.count < CM_VERSIONS) {
        versions.of[versions.count].id = id;
        versions.of[versions.count++].version = version;
    }
}

RTS_UI32 CMGetVersion(RTS_UI32 id)
{
    for (RTS_UI32 i = 0; i < versions.count; i++) {
        if (versions.of[i].id == id)
            return versions.of[i].version;
    }
    return 0;
}

static void forget_versions(void)
{
    CMP_CLEAR(versions);
}

#else

static void forget_versions(void)
{
}

#endif

/*
 * Start-up is a row of calls: each hook before CH_INIT_FINISHED for each component, the components of a hook in the
 * order of the list. Shutdown is the same row backwards, with the hooks that undo.
 */
static RTS_SIZE row_length(void)
{
    return CH_INIT_FINISHED * cmp_component_count;
}

static RTS_RESULT do_call(RTS_SIZE place)
{
    return call(place % cmp_component_count, (CMP_HOOK)(place / cmp_component_count));
}

/* Undoes the first `count` calls of the row, the last one first. */
static void undo(RTS_SIZE count)
{
    while (count-- > 0)
        (void)call(count % cmp_component_count, (CMP_HOOK)(CH_EXIT_SYSTEM - count / cmp_component_count));
}

RTS_STATIC_ASSERT((int)CH_EXIT_SYSTEM - (int)CH_INIT_COMM == (int)CH_EXIT_COMM, exit_hooks_mirror_init_hooks);

RTS_RESULT CMInit(void)
{
    RTS_SIZE done;
    RTS_RESULT result = ERR_OK;

    if (!RTS_STARTS_ONCE)
        memset(cmp_ext_tables, 0, cmp_ext_table_room * sizeof cmp_ext_tables[0]);
    forget_failures();
    forget_versions();
    for (done = 0; done < row_length() && result == ERR_OK; done++)
        result = do_call(done);
    if (result != ERR_OK) {
        done--; /* the one that failed has undone what it did itself */
        if (!CM_LEAVES_OUT)
            LogAdd(CMPID_CmpMgr, LOG_ERROR | LOG_KEPT, result, "Start of %s failed",
                   cmp_names[done % cmp_component_count].name);
    } else {
        result = CMCallHook(CH_INIT_FINISHED);
    }
    if (result != ERR_OK)
        undo(done);
    return result;
}

RTS_RESULT CMExit(void)
{
    undo(row_length());
    return ERR_OK;
}

RTS_RESULT CMCallHook(CMP_HOOK hook)
{
    RTS_RESULT first = ERR_OK;
    RTS_SIZE i;

    for (i = 0; i < cmp_component_count; i++) {
        RTS_RESULT result = call(i, hook);
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
        if (cmp_names[i].id == id)
            return cmp_names[i].name;
    }
    return "";
}

RTS_RESULT CMRegisterExternal(const CMP_EXT_FUNCTION *table, RTS_SIZE count)
{
    CMP_EXT_TABLE *place;

    for (place = cmp_ext_tables; place < cmp_ext_tables + cmp_ext_table_room; place++) {
        if (place->functions == NULL) {
            *place = (CMP_EXT_TABLE){table, count};
            return ERR_OK;
        }
    }
    return CMNoRoom(CM_OWN_EXT_TABLES);
}

const CMP_EXT_FUNCTION *CMFindExternal(const char *name)
{
    const CMP_EXT_TABLE *table;
    RTS_SIZE i;

    for (table = cmp_ext_tables; table < cmp_ext_tables + cmp_ext_table_room; table++) {
        for (i = 0; i < table->count; i++) {
            if (strcmp(table->functions[i].name, name) == 0)
                return &table->functions[i];
        }
    }
    return NULL;
}
