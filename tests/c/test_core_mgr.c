/*
 * test_core_mgr.c - the component manager: order of start-up and shutdown, undoing, external functions.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The manager is compiled a second time here, under other names, with a list of three components that write down what
 * they are asked to do.
 */
#include <string.h>

#define CMInit test_init
#define CMExit test_exit
#define CMCallHook test_call_hook
#define CMGetComponentName test_component_name
#define CMRegisterExternal test_register
#define CMFindExternal test_find
#define CMNoteVersion test_note_version
#define CMGetVersion test_get_version
#define cmp_hooks test_hooks
#define cmp_names test_names
#define cmp_component_count test_component_count
#define cmp_ext_tables test_ext_tables
#define cmp_ext_table_room test_ext_table_room
#include "../../firmware/src/core/CmpMgr.c"

#include "test.h"

static char trace[400];
static CMP_HOOK fail_at;
static char fail_in;

static RTS_RESULT note(char name, CMP_HOOK hook)
{
    char text[8];

    snprintf(text, sizeof text, "%c%d ", name, (int)hook);
    strncat(trace, text, sizeof trace - strlen(trace) - 1);
    return name == fail_in && hook == fail_at ? ERR_TIMEOUT : ERR_OK;
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

const PF_HOOK_FUNCTION test_hooks[] = {hook_a, hook_b, hook_c};
const CMP_NAME test_names[] = {{1000, "A"}, {1001, "B"}, {1002, "C"}};
const RTS_SIZE test_component_count = 3;
CMP_EXT_TABLE test_ext_tables[3];
const RTS_SIZE test_ext_table_room = RTS_COUNT(test_ext_tables);

static void begin(char name, CMP_HOOK hook)
{
    trace[0] = '\0';
    fail_in = name;
    fail_at = hook;
}

/* Hooks 0..8 are CH_INIT_*, 9 is CH_COMM_CYCLE, 10..17 are CH_EXIT_*. */
static void start_up_calls_every_hook_of_all_components_in_order(void)
{
    begin(0, 0);
    CHECK_EQUAL(CMInit(), ERR_OK);
    CHECK(strcmp(trace, "a0 b0 c0 a1 b1 c1 a2 b2 c2 a3 b3 c3 a4 b4 c4 a5 b5 c5 a6 b6 c6 a7 b7 c7 a8 b8 c8 ") == 0);
}

static void shutdown_goes_backwards(void)
{
    begin(0, 0);
    CHECK_EQUAL(CMExit(), ERR_OK);
    CHECK(strcmp(trace, "c10 b10 a10 c11 b11 a11 c12 b12 a12 c13 b13 a13 c14 b14 a14 c15 b15 a15 c16 b16 a16 "
                        "c17 b17 a17 ") == 0);
}

static void errors_at_shutdown_stop_nothing(void)
{
    begin('c', CH_EXIT_COMM);
    CHECK_EQUAL(CMExit(), ERR_OK);
    CHECK(strstr(trace, "a17") != NULL);
}

static void a_start_up_that_fails_undoes_what_was_done(void)
{
    begin('b', CH_INIT);
    CHECK_EQUAL(CMInit(), ERR_TIMEOUT);
    CHECK(strcmp(trace, "a0 b0 c0 a1 b1 c1 a2 b2 a15 c16 b16 a16 c17 b17 a17 ") == 0);
    begin('a', CH_INIT_SYSTEM);
    CHECK_EQUAL(CMInit(), ERR_TIMEOUT);
    CHECK(strcmp(trace, "a0 ") == 0);
    begin('c', CH_INIT_FINISHED);
    CHECK_EQUAL(CMInit(), ERR_TIMEOUT);
    CHECK(strstr(trace, "a8 b8 c8 c10 b10 a10 ") != NULL);
    CHECK(strstr(trace, "c17 b17 a17 ") != NULL);
}

static void the_main_loop_calls_everybody_and_returns_the_first_error(void)
{
    begin('b', CH_COMM_CYCLE);
    CHECK_EQUAL(CMCallHook(CH_COMM_CYCLE), ERR_TIMEOUT);
    CHECK(strcmp(trace, "a9 b9 c9 ") == 0);
}

static void components_have_names(void)
{
    CHECK(strcmp(CMGetComponentName(1001), "B") == 0);
    CHECK(strcmp(CMGetComponentName(CMPID_CmpMgr), "CmpMgr") == 0);
    CHECK(strcmp(CMGetComponentName(7777), "") == 0);
}

static void some_function(void)
{
}

static void external_functions_are_found_by_name(void)
{
    static const CMP_EXT_FUNCTION first[] = {{"one", 1, 0x10000, some_function}, {"two", 2, 0x10000, some_function}};
    static const CMP_EXT_FUNCTION second[] = {{"three", 3, 0x10000, some_function}};

    begin(0, 0);
    CHECK_EQUAL(CMInit(), ERR_OK);
    CHECK(CMFindExternal("one") == NULL);
    CHECK_EQUAL(CMRegisterExternal(first, RTS_COUNT(first)), ERR_OK);
    CHECK_EQUAL(CMRegisterExternal(second, RTS_COUNT(second)), ERR_OK);
    CHECK(CMFindExternal("two") == &first[1]);
    CHECK(CMFindExternal("three") == &second[0]);
    CHECK(CMFindExternal("thre") == NULL);
    CHECK(CMFindExternal("") == NULL);
}

static void tables_are_limited_and_forgotten_at_start_up(void)
{
    static const CMP_EXT_FUNCTION table[] = {{"one", 1, 0x10000, some_function}};
    RTS_SIZE i;

    begin(0, 0);
    CHECK_EQUAL(CMInit(), ERR_OK);
    for (i = 0; i < cmp_ext_table_room; i++)
        CHECK_EQUAL(CMRegisterExternal(table, 1), ERR_OK);
    CHECK_EQUAL(CMRegisterExternal(table, 1), ERR_NOMEMORY);
    CHECK_EQUAL(CMInit(), ERR_OK);
    CHECK(CMFindExternal("one") == NULL);
    CHECK_EQUAL(CMRegisterExternal(table, 1), ERR_OK);
}

int main(void)
{
    RUN(start_up_calls_every_hook_of_all_components_in_order);
    RUN(shutdown_goes_backwards);
    RUN(errors_at_shutdown_stop_nothing);
    RUN(a_start_up_that_fails_undoes_what_was_done);
    RUN(the_main_loop_calls_everybody_and_returns_the_first_error);
    RUN(components_have_names);
    RUN(external_functions_are_found_by_name);
    RUN(tables_are_limited_and_forgotten_at_start_up);
    return test_result();
}
