/*
 * test_app_exception.c - what goes wrong in IEC code, and what the runtime makes of it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpEventMgr.h"
#include "CmpLog.h"
#include "app_image.h"
#include "test.h"

enum { IECRAISE_SIGNATURE = 0x703B892E };

static APP_SPEC spec;
static APP_BYTES image;

/* The counter application with a second task "Bad" of 5 ms, at the end of the code: the test adds what it does. */
static void begin_bad_task(void)
{
    CHECK_EQUAL(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    spec_counter(&spec, 1);
    add_task(&spec, "Bad", KIND_CYCLIC, 5000, here(&spec));
}

static void run_bad_task(void)
{
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
}

static bool last_log_is(const char *text)
{
    LOG_ENTRY entry = {0};

    while (LogGetEntry(entry.handle + 1, &entry) == ERR_OK)
        ;
    if (strcmp(entry.text, text) != 0)
        fprintf(stderr, "log: %s\n", entry.text);
    return strcmp(entry.text, text) == 0;
}

static void check_exception(RTS_UI32 code, RTS_UI32 code_offset, RTS_I32 task)
{
    APP_STATUS status;

    AppGetStatus(&status);
    CHECK_EQUAL(status.state, AS_STOP);
    CHECK((status.op_state & OS_EXCEPTION) != 0);
    CHECK_EQUAL(status.exception.code, code);
    CHECK_EQUAL(status.exception.code_offset, code_offset);
    CHECK_EQUAL(status.exception.task, task);
    CHECK_EQUAL(AppStartApplication(), ERR_INVALID_STATE);
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, OUTPUT_OFFSET), 0);
}

static void division_by_zero_stops_the_application(void)
{
    RTS_UI32 at;
    char text[80];

    begin_bad_task();
    at = here(&spec) + 2;
    emit_divide_by_zero(&spec);
    run_bad_task();
    check_exception(RTSEXCPT_DIVIDEBYZERO, at, 1);
    snprintf(text, sizeof text, "Bad: division by zero at code offset 0x%08X", (unsigned)at);
    CHECK(last_log_is(text));
}

static void access_violation_stops_the_application(void)
{
    RTS_UI32 at;

    begin_bad_task();
    at = here(&spec) + 2;
    emit_write_to_null(&spec);
    run_bad_task();
    check_exception(RTSEXCPT_ACCESS_VIOLATION, at, 1);
}

static void illegal_instruction_stops_the_application(void)
{
    RTS_UI32 at;

    begin_bad_task();
    at = here(&spec);
    emit_illegal_instruction(&spec);
    run_bad_task();
    check_exception(RTSEXCPT_ILLEGAL_INSTRUCTION, at, 1);
}

static void a_failed_check_names_the_call_that_raised_it(void)
{
    RTS_UI32 at;

    begin_bad_task();
    add_import(&spec, "iecraise", IECRAISE_SIGNATURE, 0x00010000);
    emit_call(&spec, 0, RTSEXCPT_ARRAYBOUNDS);
    at = here(&spec) - 2; /* the last byte of the call: a pop of one byte follows it */
    emit_ret(&spec);
    run_bad_task();
    check_exception(RTSEXCPT_ARRAYBOUNDS, at, 1);
}

static void an_endless_loop_is_broken(void)
{
    RTS_UI32 at;

    begin_bad_task();
    at = here(&spec);
    emit_endless_loop(&spec);
    SimSetCycleLimit(100);
    run_bad_task();
    SimSetCycleLimit(2000);
    check_exception(RTSEXCPT_WATCHDOG, at, 1);
}

static void an_endless_loop_in_an_event_task_is_broken(void)
{
    CHECK_EQUAL(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    spec_counter(&spec, 1);
    add_task(&spec, "Free", KIND_FREEWHEELING, 0, here(&spec));
    emit_endless_loop(&spec);
    SimSetCycleLimit(100);
    run_bad_task();
    SimSetCycleLimit(2000);
    CHECK_EQUAL(app_exception(), RTSEXCPT_WATCHDOG);
}

static void other_tasks_do_not_start_another_cycle(void)
{
    begin_bad_task();
    emit_divide_by_zero(&spec);
    spec.tasks[0].priority = 11; /* after the bad one */
    run_bad_task();
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 0);
}

static void reset_clears_the_exception(void)
{
    begin_bad_task();
    emit_divide_by_zero(&spec);
    run_bad_task();
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 0);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO); /* and it can happen again */
}

static void an_application_with_an_exception_can_be_replaced(void)
{
    APP_BYTES good;

    begin_bad_task();
    emit_divide_by_zero(&spec);
    run_bad_task();
    build_counter(&good, 4);
    CHECK_EQUAL(download(&good), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 8);
}

static void initialisation_may_fail_too(void)
{
    RTS_UI32 at;

    begin_bad_task();
    at = here(&spec) + 2;
    spec.function[CDL_FUNCTION_GLOBAL_INIT] = (RTS_I32)here(&spec);
    emit_divide_by_zero(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    check_exception(RTSEXCPT_DIVIDEBYZERO, at, -1);
    CHECK_EQUAL(SimStart(), ERR_OK); /* it does not start at power on, the device does */
    CHECK_EQUAL(app_state(), AS_STOP);
}

static void an_endless_initialisation_is_broken(void)
{
    begin_bad_task();
    spec.function[CDL_FUNCTION_CODE_INIT] = (RTS_I32)here(&spec);
    emit_endless_loop(&spec);
    build_image(&image, &spec);
    SimSetCycleLimit(100);
    CHECK_EQUAL(download(&image), ERR_OK);
    SimSetCycleLimit(2000);
    CHECK_EQUAL(app_exception(), RTSEXCPT_WATCHDOG);
}

static void of_two_exceptions_the_first_counts(void)
{
    begin_bad_task();
    emit_divide_by_zero(&spec);
    run_bad_task();
    AppHandleException(0, RTSEXCPT_ACCESS_VIOLATION, 0);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
    AppHandleException(0, RTSEXCPT_ACCESS_VIOLATION, 0); /* as a task of the next run would */
    AppHandleException(1, RTSEXCPT_DIVIDEBYZERO, 0);
    check_exception(RTSEXCPT_ACCESS_VIOLATION, 0xFFFFFFFF, 0);
    CHECK(last_log_is("Main: access violation"));
}

static RTS_UI32 exceptions_seen;

static void count_exception(EVENT_PARAM *param)
{
    RTS_UNUSED(param);
    exceptions_seen++;
}

static void the_exception_is_posted_once(void)
{
    begin_bad_task();
    emit_divide_by_zero(&spec);
    exceptions_seen = 0;
    CHECK(EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_CmpApp_Exception, count_exception, NULL) == ERR_OK);
    run_bad_task();
    CHECK_EQUAL(SimAdvance(ms(3000)), ERR_OK);
    CHECK_EQUAL(exceptions_seen, 1);
}

static void every_exception_has_words(void)
{
    CHECK(strcmp(AppExceptionName(RTSEXCPT_WATCHDOG), "watchdog expired") == 0);
    CHECK(strcmp(AppExceptionName(RTSEXCPT_STACK_OVERFLOW), "stack overflow") == 0);
    CHECK(strcmp(AppExceptionName(0x12345), "exception") == 0);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(division_by_zero_stops_the_application);
    RUN(access_violation_stops_the_application);
    RUN(illegal_instruction_stops_the_application);
    RUN(a_failed_check_names_the_call_that_raised_it);
    RUN(an_endless_loop_is_broken);
    RUN(an_endless_loop_in_an_event_task_is_broken);
    RUN(other_tasks_do_not_start_another_cycle);
    RUN(reset_clears_the_exception);
    RUN(an_application_with_an_exception_can_be_replaced);
    RUN(initialisation_may_fail_too);
    RUN(an_endless_initialisation_is_broken);
    RUN(of_two_exceptions_the_first_counts);
    RUN(the_exception_is_posted_once);
    RUN(every_exception_has_words);
    return test_result();
}
