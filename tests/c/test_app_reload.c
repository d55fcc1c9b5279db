/*
 * test_app_reload.c - AppReload: the boot project once more, as after a start-up.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "app_device.h"

static void what_is_in_ram_is_lost_and_retain_variables_are_kept(void)
{
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 6);
    CHECK_EQUAL(AppReload(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 1);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), 107);
}

static void a_stopped_application_runs_after_it(void)
{
    start_with_counter(1);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(AppReload(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
}

static void without_boot_project_there_is_nothing_to_reload(void)
{
    start_blank();
    CHECK_EQUAL(AppReload(), ERR_APP_NOT_LOADED);
    start_with_counter(1);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK_EQUAL(AppReload(), ERR_APP_NOT_LOADED);
}

static void after_a_failure_the_application_before_comes_back(void)
{
    APP_SPEC spec;
    APP_BYTES image;

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK); /* it has proven itself */
    spec_counter(&spec, 9);
    spec.tasks[0].entry_offset = here(&spec);
    emit_divide_by_zero(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK_EQUAL(AppReload(), ERR_OK);
    CHECK(app_state() == AS_RUN && app_exception() == RTSEXCPT_NOEXCEPTION);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
}

static void a_download_that_is_under_way_can_go_on(void)
{
    APP_BYTES second;
    APP_REFUSAL refusal;

    start_with_counter(1);
    build_counter(&second, 7);
    CHECK_EQUAL(AppDownloadBegin(second.size, image_crc(&second)), ERR_OK);
    CHECK_EQUAL(AppDownloadWrite(0, second.bytes, 200), ERR_OK);
    CHECK_EQUAL(AppReload(), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
    CHECK_EQUAL(AppDownloadWrite(200, second.bytes + 200, second.size - 200), ERR_OK);
    CHECK_EQUAL(AppDownloadEnd(&refusal), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 7);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(what_is_in_ram_is_lost_and_retain_variables_are_kept);
    RUN(a_stopped_application_runs_after_it);
    RUN(without_boot_project_there_is_nothing_to_reload);
    RUN(after_a_failure_the_application_before_comes_back);
    RUN(a_download_that_is_under_way_can_go_on);
    return test_result();
}
