/*
 * test_core_left_out.c - a component that only programs need and that fails to start is left out (CM_LEAVES_OUT).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The manager is compiled a second time here, under other names, with a list of four components that write down what
 * they are asked to do; programs need B and C only.
 */
#include <string.h>

#define CM_LEAVES_OUT 1
#define CMInit test_init
#define CMExit test_exit
#define CMCallHook test_call_hook
#define CMGetComponentName test_component_name
#define CMRegisterExternal test_register
#define CMFindExternal test_find
#define CMGetFailure test_get_failure
#define CMHasLeftOut test_has_left_out
#define CMNoRoomIn test_no_room_in
#define CMNoteVersion test_note_version
#define CMGetVersion test_get_version
#define cmp_hooks test_hooks
#define cmp_names test_names
#define cmp_component_count test_component_count
#define cmp_programs_first test_programs_first
#define cmp_programs_end test_programs_end
#define cmp_left_out test_left_out
#define cmp_ext_tables test_ext_tables
#define cmp_ext_table_room test_ext_table_room
#include "../../firmware/src/core/CmpMgr.c"

#include "test.h"

enum { INIT_HOOKS = CH_INIT_FINISHED + 1 };

static char trace[600];
static CMP_HOOK fail_at;
static const char *fail_in;
static bool full;

static RTS_RESULT note(char name, CMP_HOOK hook)
{
    static const CMP_EXT_FUNCTION table[1];
    char text[8];

    snprintf(text, sizeof text, "%c%d ", name, (int)hook);
    strncat(trace, text, sizeof trace - strlen(trace) - 1);
    if (hook != fail_at || strchr(fail_in, name) == NULL)
        return ERR_OK;
    while (full && CMRegisterExternal(table, 1) == ERR_OK)
        ;
    return full ? ERR_NOMEMORY : ERR_TIMEOUT;
}

static RTS_RESULT hook_a(CMP_HOOK hook)
{
    return note('a', hook);
}

static RTS_RESULT hook_b(CMP_HOOK hook)
{
    return note('b', hook);
}

static RTS_RESULT hook_c(CMP_HOOK hook)
{
    return note('c', hook);
}

static RTS_RESULT hook_d(CMP_HOOK hook)
{
    return note('d', hook);
}

const PF_HOOK_FUNCTION test_hooks[] = {hook_a, hook_b, hook_c, hook_d};
const CMP_NAME test_names[] = {{1000, "A"}, {1001, "B"}, {1002, "C"}, {1003, "D"}};
const RTS_SIZE test_component_count = 4;
const RTS_SIZE test_programs_first = 1;
const RTS_SIZE test_programs_end = 3;
bool test_left_out[4];
CMP_EXT_TABLE test_ext_tables[3];
const RTS_SIZE test_ext_table_room = RTS_COUNT(test_ext_tables);

static void begin(const char *names, CMP_HOOK hook)
{
    trace[0] = '\0';
    fail_in = names;
    fail_at = hook;
    full = false;
}

static bool log_has(const char *text)
{
    RTS_UI32 handle = 1;
    LOG_ENTRY entry;

    for (; LogGetEntry(handle, &entry) == ERR_OK; handle = entry.handle + 1)
        if (strcmp(entry.text, text) == 0 && entry.log_class == LOG_ERROR)
            return true;
    return false;
}

static void without_failure_none_is_left_out(void)
{
    begin("", CH_INIT);
    CHECK_EQUAL(CMInit(), ERR_OK);
    CHECK(!CMHasLeftOut());
    CHECK(CMGetFailure()->name == NULL);
    CHECK(strstr(trace, "a8 b8 c8 d8 ") != NULL);
}

static void a_component_of_programs_that_fails_is_undone_and_called_no_more(void)
{
    begin("b", CH_INIT2);
    CHECK_EQUAL(CMInit(), ERR_OK);
    CHECK(strcmp(trace, "a0 b0 c0 d0 a1 b1 c1 d1 a2 b2 c2 d2 a3 b3 b15 b16 b17 c3 d3 a4 c4 d4 a5 c5 d5 "
                        "a6 c6 d6 a7 c7 d7 a8 c8 d8 ") == 0);
    CHECK(CMHasLeftOut());
    CHECK(strcmp(CMGetFailure()->name, "B") == 0);
    CHECK_EQUAL(CMGetFailure()->id, 1001);
    CHECK_EQUAL(CMGetFailure()->error, ERR_TIMEOUT);
    CHECK(log_has("Start of B failed"));
    begin("", CH_INIT);
    CHECK_EQUAL(CMCallHook(CH_COMM_CYCLE), ERR_OK);
    CHECK(strcmp(trace, "a9 c9 d9 ") == 0);
    begin("", CH_INIT);
    CHECK_EQUAL(CMExit(), ERR_OK);
    CHECK(strchr(trace, 'b') == NULL && strstr(trace, "d10 c10 a10 ") != NULL);
}

static void components_with_a_version_of_their_own_keep_it_until_the_next_start(void)
{
    begin("", CH_INIT);
    CHECK_EQUAL(CMInit(), ERR_OK);
    CHECK_EQUAL(CMGetVersion(1001), 0);
    for (RTS_UI32 i = 0; i < CM_VERSIONS + 2; i++)
        CMNoteVersion(1001 + i, 0x01020300 + i);
    CHECK_EQUAL(CMGetVersion(1001), 0x01020300);
    CHECK_EQUAL(CMGetVersion(1000 + CM_VERSIONS), 0x01020300 + CM_VERSIONS - 1);
    CHECK_EQUAL(CMGetVersion(1001 + CM_VERSIONS), 0);
    CHECK_EQUAL(CMInit(), ERR_OK);
    CHECK_EQUAL(CMGetVersion(1001), 0);
}

static void it_may_fail_in_each_step(void)
{
    for (int hook = CH_INIT_SYSTEM; hook < INIT_HOOKS; hook++) {
        begin("c", (CMP_HOOK)hook);
        CHECK_EQUAL(CMInit(), ERR_OK);
        CHECK(CMHasLeftOut());
        CHECK_EQUAL(test_left_out[2], 1);
        CHECK_EQUAL(test_left_out[1] + test_left_out[0] + test_left_out[3], 0);
        (void)CMExit();
    }
}

static void several_are_left_out_and_the_first_is_named(void)
{
    begin("bc", CH_INIT3);
    CHECK_EQUAL(CMInit(), ERR_OK);
    CHECK(test_left_out[1] && test_left_out[2]);
    CHECK(strcmp(CMGetFailure()->name, "B") == 0);
}

static void the_runtime_itself_is_not_left_out(void)
{
    begin("a", CH_INIT2);
    CHECK_EQUAL(CMInit(), ERR_TIMEOUT);
    CHECK(strcmp(CMGetFailure()->name, "A") == 0);
    CHECK(strstr(trace, "a3 d15 ") != NULL && strstr(trace, "b17 a17 ") != NULL);
    begin("d", CH_INIT_FINISHED);
    CHECK_EQUAL(CMInit(), ERR_TIMEOUT);
    CHECK(strcmp(CMGetFailure()->name, "D") == 0);
    CHECK(strstr(trace, "c17 b17 a17 ") != NULL);
}

static void an_error_in_the_main_loop_leaves_none_out(void)
{
    begin("", CH_INIT);
    CHECK_EQUAL(CMInit(), ERR_OK);
    begin("b", CH_COMM_CYCLE);
    CHECK_EQUAL(CMCallHook(CH_COMM_CYCLE), ERR_TIMEOUT);
    CHECK(!CMHasLeftOut());
}

static void a_full_table_is_named_in_the_log(void)
{
    begin("b", CH_INIT3);
    full = true;
    CHECK_EQUAL(CMInit(), ERR_OK);
    CHECK(log_has("Start of B failed: raise CM_OWN_EXT_TABLES"));
}

static void a_start_forgets_the_failures_of_the_previous_one(void)
{
    begin("b", CH_INIT3);
    CHECK_EQUAL(CMInit(), ERR_OK);
    CHECK(CMHasLeftOut());
    begin("", CH_INIT);
    CHECK_EQUAL(CMInit(), ERR_OK);
    CHECK(!CMHasLeftOut());
    CHECK_EQUAL(test_left_out[1], 0);
}

int main(void)
{
    RUN(without_failure_none_is_left_out);
    RUN(a_component_of_programs_that_fails_is_undone_and_called_no_more);
    RUN(components_with_a_version_of_their_own_keep_it_until_the_next_start);
    RUN(it_may_fail_in_each_step);
    RUN(several_are_left_out_and_the_first_is_named);
    RUN(the_runtime_itself_is_not_left_out);
    RUN(an_error_in_the_main_loop_leaves_none_out);
    RUN(a_full_table_is_named_in_the_log);
    RUN(a_start_forgets_the_failures_of_the_previous_one);
    return test_result();
}
