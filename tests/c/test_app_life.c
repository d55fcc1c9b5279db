/*
 * test_app_life.c - download, start, stop, reset, boot project.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppRecord.h"
#include "CmpEventMgr.h"
#include "SysFlashLog.h"
#include "SysTimer.h"
#include "app_device.h"

static void a_blank_device_has_no_application(void)
{
    APP_STATUS status;

    start_blank();
    AppGetStatus(&status);
    CHECK_EQUAL(status.state, AS_NONE);
    CHECK_EQUAL(status.op_state, 0);
    CHECK_EQUAL(AppStartApplication(), ERR_APP_NOT_LOADED);
    CHECK_EQUAL(AppStopApplication(), ERR_APP_NOT_LOADED);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_APP_NOT_LOADED);
    CHECK_EQUAL(AppReset(RESET_OPTION_COLD), ERR_APP_NOT_LOADED);
    CHECK_EQUAL(AppReset(3), ERR_PARAMETER);
    CHECK(AppGetAreaAddress(APP_AREA_DATA, 0, 0) == NULL);
    CHECK_EQUAL(AppGetAreaSize(APP_AREA_DATA), 0);
    CHECK_EQUAL(AppGetInfo(0)[0], '\0');
    CHECK_EQUAL(IecTaskGetCount(), 0);
}

static void a_download_leaves_the_application_stopped_and_initialised(void)
{
    APP_STATUS status;
    APP_BYTES image;

    start_blank();
    build_counter(&image, 3);
    CHECK_EQUAL(download(&image), ERR_OK);
    AppGetStatus(&status);
    CHECK_EQUAL(status.state, AS_STOP);
    CHECK_EQUAL(status.op_state, (OS_PROGRAM_LOADED | OS_BOOTPROJECT_VALID));
    CHECK_EQUAL(status.image_crc, image_crc(&image));
    CHECK_EQUAL(status.image_size, image.size);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 3);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), 300);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 0);
}

static void the_first_cycle_runs_at_the_start_and_then_one_per_interval(void)
{
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 1);
    CHECK_EQUAL(SimAdvance(ms(10) - 1), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 1);
    CHECK_EQUAL(SimAdvance(1), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 2);
    CHECK_EQUAL(SimAdvance(ms(990)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 101);
}

static void stop_ends_the_cycles_and_zeroes_the_outputs(void)
{
    start_with_counter(5);
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, OUTPUT_OFFSET), 5);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, OUTPUT_OFFSET), 0);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 15);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 20);
}

static void warm_reset_keeps_retain_and_clears_the_rest(void)
{
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 0);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), 106);
}

static void cold_reset_clears_retain_too(void)
{
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_COLD), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 0);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), 100);
}

static void origin_reset_deletes_the_application_and_its_boot_project(void)
{
    APP_STATUS status;

    start_with_counter(1);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    AppGetStatus(&status);
    CHECK_EQUAL(status.state, AS_NONE);
    CHECK_EQUAL(status.op_state, 0);
    CHECK_EQUAL(status.image_crc, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_NONE);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
}

static void origin_reset_ends_a_download_of_another_client(void)
{
    APP_BYTES second;

    start_with_counter(1);
    build_counter(&second, 2);
    CHECK_EQUAL(AppDownloadBegin(second.size, image_crc(&second)), ERR_OK);
    CHECK_EQUAL(AppDownloadWrite(0, second.bytes, 100), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK_EQUAL(AppDownloadWrite(100, second.bytes + 100, 100), ERR_INVALID_SEQUENCE);
    CHECK_EQUAL(download(&second), ERR_OK);
}

static void the_boot_project_runs_after_power_on(void)
{
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(SimAdvance(ms(30)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 4);
}

static void a_second_download_replaces_the_first(void)
{
    APP_BYTES second;

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    build_counter(&second, 7);
    CHECK_EQUAL(download(&second), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 7);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 0);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), 700);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 7);
}

static void the_old_application_runs_on_while_a_new_one_arrives(void)
{
    APP_BYTES second;
    APP_STATUS status;

    start_with_counter(1);
    build_counter(&second, 7);
    CHECK_EQUAL(AppDownloadBegin(second.size, image_crc(&second)), ERR_OK);
    CHECK_EQUAL(AppDownloadWrite(0, second.bytes, 100), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    AppGetStatus(&status);
    CHECK_EQUAL(status.state, AS_RUN);
    CHECK((status.op_state & OS_DOWNLOAD) != 0);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 11);
    CHECK_EQUAL(AppDownloadOffset(), 100);
    AppDownloadAbort();
    CHECK_EQUAL(AppDownloadOffset(), 0);
    CHECK_EQUAL(AppDownloadWrite(100, second.bytes + 100, 100), ERR_INVALID_SEQUENCE);
}

static void download_calls_out_of_order_are_refused(void)
{
    APP_BYTES image;
    APP_REFUSAL refusal;

    start_with_counter(1);
    build_counter(&image, 2);
    CHECK_EQUAL(AppDownloadEnd(&refusal), ERR_INVALID_SEQUENCE);
    CHECK(refusal.text[0] != '\0');
    CHECK_EQUAL(AppDownloadWrite(0, image.bytes, 8), ERR_INVALID_SEQUENCE);
    CHECK_EQUAL(AppDownloadBegin(1000000, 0), ERR_NOMEMORY);
    CHECK_EQUAL(AppDownloadBegin(image.size, image_crc(&image)), ERR_OK);
    CHECK_EQUAL(AppDownloadWrite(8, image.bytes, 8), ERR_INVALID_SEQUENCE);
    CHECK_EQUAL(AppDownloadWrite(0, image.bytes, image.size + 1), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(AppDownloadEnd(&refusal), ERR_SIZE_MISMATCH);
    CHECK_EQUAL(AppDownloadWrite(0, image.bytes, image.size), ERR_OK);
    CHECK_EQUAL(AppDownloadEnd(&refusal), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 2);
}

static void begin_again_starts_from_zero(void)
{
    APP_BYTES image;

    start_with_counter(1);
    build_counter(&image, 2);
    CHECK_EQUAL(AppDownloadBegin(image.size, image_crc(&image)), ERR_OK);
    CHECK_EQUAL(AppDownloadWrite(0, image.bytes, 300), ERR_OK);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 2);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

/* The application before fails as well, when it comes back with the retain variables it had: both are known to fail
 * then, and later start-ups write nothing. */
static void a_rollback_to_an_application_that_fails_too_is_written_down(void)
{
    APP_BYTES image;
    APP_SPEC spec;
    int i;

    start_blank();
    spec_counter(&spec, 1);
    spec.function[CDL_FUNCTION_GLOBAL_INIT] = (RTS_I32)here(&spec);
    emit_skip_unless_init_retains(&spec, 1);
    emit_ret(&spec);
    emit_divide_by_zero(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
    spec_counter(&spec, 2);
    spec.function[CDL_FUNCTION_GLOBAL_INIT] = (RTS_I32)here(&spec);
    emit_divide_by_zero(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    for (i = 0; i < 3; i++) {
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(app_state(), AS_STOP);
        CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
        CHECK_EQUAL((SimFlashOps() != 0), (i == 0));
    }
}

static void never_called(void)
{
}

/* The timers are found to be too few when the old application has been given up. */
static void an_application_without_timers_for_its_tasks_makes_room_for_the_old_one(void)
{
    RTS_HANDLE timer;
    APP_REFUSAL refusal;
    APP_BYTES image;
    APP_SPEC spec;

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5330)), ERR_OK);
    while (SysTimerCreate((SYS_TIMER_CALLBACK)never_called, NULL, 1000, 0, &timer) == ERR_OK)
        ;
    spec_counter(&spec, 2);
    add_task(&spec, "Second", KIND_CYCLIC, 10000, spec.tasks[0].entry_offset);
    spec.function[CDL_FUNCTION_GLOBAL_EXIT] = (RTS_I32)here(&spec); /* of what was never initialised: not called */
    emit_divide_by_zero(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download_part(&image, image.size, &refusal), ERR_NOMEMORY);
    CHECK(strstr(refusal.text, "timers") != NULL);
    CHECK(!log_has("division by zero"));
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), 100 + 534 + 11);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
}

static void a_start_that_fails_leaves_no_outputs(void)
{
    RTS_HANDLE timer;

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5)), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    for (timer = 0; SysTimerDelete(timer) == ERR_OK; timer++)
        ;
    CHECK(timer > 0);
    *AppGetAreaAddress(APP_AREA_OUTPUT, OUTPUT_OFFSET, 1) = 1; /* as if a task had run and the next failed to start */
    CHECK(AppStartApplication() != ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, OUTPUT_OFFSET), 0);
}

static void the_application_info_can_be_read(void)
{
    start_with_counter(1);
    CHECK(strcmp(AppGetInfo(0), "Project") == 0);
    CHECK(strcmp(AppGetInfo(1), "Author") == 0);
    CHECK(strcmp(AppGetInfo(2), "1.2.3") == 0);
    CHECK(strcmp(AppGetInfo(3), "Description") == 0);
    CHECK(strcmp(AppGetInfo(4), "Profile") == 0);
    CHECK_EQUAL(AppGetInfo(5)[0], '\0');
}

static void info_longer_than_its_buffer_is_cut(void)
{
    char text[200];
    APP_SPEC spec;
    APP_BYTES image;

    memset(text, 'x', sizeof text);
    text[sizeof text - 1] = '\0';
    start_blank();
    spec_counter(&spec, 1);
    spec.info[0] = text;
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(strlen(AppGetInfo(0)), APP_NAME_SIZE - 1);
    CHECK(strcmp(AppGetInfo(1), "Author") == 0);
}

static void area_addresses_are_checked_to_the_byte(void)
{
    start_with_counter(1);
    CHECK_EQUAL(AppGetAreaSize(APP_AREA_RETAIN), 16);
    CHECK(AppGetAreaAddress(APP_AREA_RETAIN, 0, 16) != NULL);
    CHECK(AppGetAreaAddress(APP_AREA_RETAIN, 16, 0) != NULL);
    CHECK(AppGetAreaAddress(APP_AREA_RETAIN, 0, 17) == NULL);
    CHECK(AppGetAreaAddress(APP_AREA_RETAIN, 15, 2) == NULL);
    CHECK(AppGetAreaAddress(APP_AREA_RETAIN, 17, 0) == NULL);
    CHECK(AppGetAreaAddress(APP_AREA_RETAIN, 0xFFFFFFFF, 1) == NULL);
    CHECK(AppGetAreaAddress(APP_AREA_RETAIN, 1, 0xFFFFFFFF) == NULL);
    CHECK(AppGetAreaAddress(APP_AREA_MEMORY, 0, 1) == NULL);
    CHECK(AppGetAreaAddress(APP_AREA_COUNT, 0, 0) == NULL);
    CHECK(AppGetAreaAddress(0xFFFF, 0, 0) == NULL);
    CHECK(AppGetAreaAddress(APP_AREA_CODE, 0, 1) != NULL);
}

static void pointers_are_found_in_their_area_to_the_byte(void)
{
    RTS_UI32 area, offset;

    start_with_counter(1);
    uintptr_t retain = (uintptr_t)AppGetAreaAddress(APP_AREA_RETAIN, 0, 16);
    CHECK(AppFindArea(retain, &area, &offset) && area == APP_AREA_RETAIN && offset == 0);
    CHECK(AppFindArea(retain + 15, &area, &offset) && area == APP_AREA_RETAIN && offset == 15);
    CHECK(!AppFindArea(retain + 16, &area, &offset));
    CHECK(!AppFindArea(retain - 1, &area, &offset));
    CHECK(AppFindArea((uintptr_t)AppGetAreaAddress(APP_AREA_CODE, 4, 1), &area, &offset));
    CHECK(area == APP_AREA_CODE && offset == 4);
    CHECK(!AppFindArea(0, &area, &offset));
    CHECK(!AppFindArea(UINTPTR_MAX, &area, &offset));
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK(!AppFindArea(retain, &area, &offset) && !AppFindArea(0, &area, &offset));
}

static RTS_UI32 seen_events[16];
static RTS_UI32 seen_count;

static void note_event(EVENT_PARAM *param)
{
    if (seen_count < RTS_COUNT(seen_events))
        seen_events[seen_count++] = param->event;
}

static void start_stop_reset_and_download_are_announced(void)
{
    static const RTS_UI32 events[] = {EVT_PrepareStart, EVT_StartDone,       EVT_PrepareStop, EVT_StopDone,
                                      EVT_PrepareReset, EVT_PrepareDownload, EVT_ResetDone,   EVT_DownloadDone};
    static const RTS_UI32 expected[] = {EVT_PrepareDownload, EVT_DownloadDone, EVT_PrepareStart, EVT_StartDone,
                                        EVT_PrepareStop,     EVT_StopDone,     EVT_PrepareReset, EVT_ResetDone};
    APP_BYTES image;
    RTS_SIZE i;

    start_blank();
    build_counter(&image, 1);
    seen_count = 0;
    for (i = 0; i < RTS_COUNT(events); i++)
        CHECK(EventRegisterCallback(CMPID_CmpAppEmbedded, events[i], note_event, NULL) == ERR_OK);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK); /* runs already: nothing happens */
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(seen_count, RTS_COUNT(expected));
    CHECK(memcmp(seen_events, expected, sizeof expected) == 0);
}

/* GlobalExit counts in the memory of the test, since its own is initialised right after it. */
static RTS_UI32 exits;

static void count_exit(RTS_UI32 step)
{
    exits += step;
}

static const CMP_EXT_FUNCTION exit_counter[] = {{"countexit", 1, 0x00010000, (RTS_PFN)count_exit}};

static void start_with_exit(APP_BYTES *image)
{
    APP_SPEC spec;

    start_blank();
    CHECK_EQUAL(CMRegisterExternal(exit_counter, 1), ERR_OK);
    spec_counter(&spec, 1);
    add_import(&spec, "countexit", 1, 0x00010000);
    spec.function[CDL_FUNCTION_GLOBAL_EXIT] = (RTS_I32)here(&spec);
    emit_call(&spec, 0, 1);
    emit_ret(&spec);
    build_image(image, &spec);
    CHECK_EQUAL(download(image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    exits = 0;
}

static void global_exit_runs_before_the_application_goes(void)
{
    APP_BYTES image;

    start_with_exit(&image);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(exits, 0);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(exits, 1);
    CHECK_EQUAL(AppReset(RESET_OPTION_COLD), ERR_OK);
    CHECK_EQUAL(exits, 2);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(exits, 3);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK_EQUAL(exits, 4);
    start_with_exit(&image);
    SimStop();
    CHECK_EQUAL(exits, 1);
}

static void global_exit_does_not_run_after_an_exception(void)
{
    APP_BYTES image;

    start_with_exit(&image);
    AppHandleException(0, RTSEXCPT_WATCHDOG, 0);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(exits, 0);
}

static void reset_of_a_running_application_stops_it_first(void)
{
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    seen_count = 0;
    CHECK(EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_StopDone, note_event, NULL) == ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_COLD), ERR_OK);
    CHECK_EQUAL(seen_count, 1);
}

static void power_on_of_a_proven_application_writes_one_record(void)
{
    RTS_UI32 operations;

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    SimStop();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    operations = SimFlashOps();
    CHECK(operations <= (FLASH_LOG_HEAD_SIZE + COMMIT_RECORD_SIZE + 15) / 16 + 1); /* and marks it */
    CHECK_EQUAL(SimFlashCalls(SIM_ERASE), 0);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimFlashOps(), operations);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_blank_device_has_no_application);
    RUN(a_download_leaves_the_application_stopped_and_initialised);
    RUN(the_first_cycle_runs_at_the_start_and_then_one_per_interval);
    RUN(stop_ends_the_cycles_and_zeroes_the_outputs);
    RUN(warm_reset_keeps_retain_and_clears_the_rest);
    RUN(cold_reset_clears_retain_too);
    RUN(origin_reset_deletes_the_application_and_its_boot_project);
    RUN(origin_reset_ends_a_download_of_another_client);
    RUN(the_boot_project_runs_after_power_on);
    RUN(a_second_download_replaces_the_first);
    RUN(the_old_application_runs_on_while_a_new_one_arrives);
    RUN(download_calls_out_of_order_are_refused);
    RUN(begin_again_starts_from_zero);
    RUN(a_rollback_to_an_application_that_fails_too_is_written_down);
    RUN(an_application_without_timers_for_its_tasks_makes_room_for_the_old_one);
    RUN(a_start_that_fails_leaves_no_outputs);
    RUN(the_application_info_can_be_read);
    RUN(info_longer_than_its_buffer_is_cut);
    RUN(area_addresses_are_checked_to_the_byte);
    RUN(pointers_are_found_in_their_area_to_the_byte);
    RUN(start_stop_reset_and_download_are_announced);
    RUN(global_exit_runs_before_the_application_goes);
    RUN(global_exit_does_not_run_after_an_exception);
    RUN(reset_of_a_running_application_stops_it_first);
    RUN(power_on_of_a_proven_application_writes_one_record);
    return test_result();
}
