/*
 * test_app_rollback.c - what a start-up does about an application that died or is damaged.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysFileFlash.h"
#include "app_device.h"

/* An application whose task divides by zero in its first cycle. */
static void build_dying(APP_BYTES *image)
{
    APP_SPEC spec;

    spec_counter(&spec, 9);
    spec.tasks[0].entry_offset = here(&spec);
    emit_divide_by_zero(&spec);
    build_image(image, &spec);
}

static void an_application_that_dies_before_it_proved_itself_is_rolled_back(void)
{
    APP_BYTES image;

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    build_dying(&image);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
    CHECK(log_has("Back to the application before"));
    CHECK(log_has("division by zero at code offset 0x")); /* and why */
    CHECK_EQUAL(SimStart(), ERR_OK);                      /* and it stays so */
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
    CHECK(!log_has("Back to"));
    CHECK(!log_has("division by zero"));
}

static void a_download_after_a_death_leaves_the_last_good_application(void)
{
    APP_BYTES image;
    APP_BYTES third;

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    build_dying(&image);
    build_counter(&third, 3);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK_EQUAL(AppDownloadBegin(third.size, image_crc(&third)), ERR_OK);
    CHECK_EQUAL(AppDownloadWrite(0, third.bytes, third.size / 2), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK); /* the download is cut */
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
    CHECK_EQUAL(download(&third), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 3);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

/* Ten times within the time of its proof; then it proves itself. */
static void losing_power_is_not_dying(void)
{
    APP_BYTES image;
    int i;

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    build_counter(&image, 2);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    for (i = 0; i < 10; i++) {
        CHECK_EQUAL(SimAdvance(ms(2900)), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(app_state(), AS_RUN);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 2);
    }
}

static void a_first_application_may_lose_power_as_often_as_it_likes(void)
{
    int i;

    start_with_counter(1);
    for (i = 0; i < 300; i++) { /* numbers of starts wrapped at 256 */
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(app_state(), AS_RUN);
    }
}

static void an_application_that_ran_long_enough_is_not_rolled_back(void)
{
    APP_BYTES image;
    int i;

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    build_counter(&image, 2);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(4100)), ERR_OK);
    for (i = 0; i < 5; i++) {
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(app_state(), AS_RUN);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 2);
    }
}

static void stopping_in_good_order_is_not_dying(void)
{
    APP_BYTES image;
    int i;

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    build_counter(&image, 2);
    CHECK_EQUAL(download(&image), ERR_OK);
    for (i = 0; i < 5; i++) {
        CHECK_EQUAL(AppStartApplication(), ERR_OK);
        CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
        CHECK_EQUAL(AppStopApplication(), ERR_OK);
        SimStop();
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 2);
    }
}

static void a_first_application_that_died_stays_loaded_but_stopped(void)
{
    APP_BYTES image;

    start_blank();
    build_dying(&image);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO); /* it still says why */
    CHECK(log_has("not started: it failed before"));
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK_EQUAL(AppStartApplication(), ERR_OK); /* by hand it starts */
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 9);
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
}

static void a_proven_application_that_had_an_exception_starts_again(void)
{
    APP_SPEC spec;
    APP_BYTES image;
    CDL_TASK *task;

    start_blank();
    spec_counter(&spec, 1);
    task = add_task(&spec, "Trip", KIND_EVENT, 0, here(&spec));
    task->event_area = APP_AREA_DATA;
    task->event_offset = 32;
    emit_divide_by_zero(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(4100)), ERR_OK);
    *AppGetAreaAddress(APP_AREA_DATA, 32, 1) = 1;
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
}

static void a_damaged_boot_project_gives_way_to_the_other_slot(void)
{
    APP_BYTES first;
    APP_BYTES second;

    start_with_counter(1);
    build_counter(&first, 1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    build_counter(&second, 2);
    CHECK_EQUAL(download(&second), ERR_OK); /* slot B */
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    SimFlashData()[SysFileGetArea(FILE_SLOT_B)->offset + 200] ^= 1;
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
    CHECK(log_has("Boot project refused: The image is damaged"));
}

static void a_device_without_any_good_image_still_starts(void)
{
    start_with_counter(1);
    SimFlashData()[200] ^= 1;
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_NONE);
    start_with_counter(1);
    CHECK_EQUAL(app_state(), AS_RUN);
}

static void many_downloads_wrap_the_commit_log(void)
{
    APP_BYTES image;
    RTS_UI32 i;

    start_blank();
    for (i = 1; i <= 200; i++) {
        build_counter(&image, i);
        CHECK_EQUAL(download(&image), ERR_OK);
        CHECK_EQUAL(AppStartApplication(), ERR_OK);
        CHECK_EQUAL(SimAdvance(ms(4100)), ERR_OK);
        if (i % 7 == 0)
            CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), i);
        CHECK_EQUAL(app_state(), AS_RUN);
    }
    CHECK_EQUAL(SimFlashViolations(), 0);
}

static void shutdown_is_orderly_and_can_be_repeated(void)
{
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    SimStop();
    SimStop();
    CHECK_EQUAL(SimAdvance(1), ERR_NOTINITIALIZED);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(an_application_that_dies_before_it_proved_itself_is_rolled_back);
    RUN(a_download_after_a_death_leaves_the_last_good_application);
    RUN(losing_power_is_not_dying);
    RUN(a_first_application_may_lose_power_as_often_as_it_likes);
    RUN(an_application_that_ran_long_enough_is_not_rolled_back);
    RUN(stopping_in_good_order_is_not_dying);
    RUN(a_first_application_that_died_stays_loaded_but_stopped);
    RUN(a_proven_application_that_had_an_exception_starts_again);
    RUN(a_damaged_boot_project_gives_way_to_the_other_slot);
    RUN(a_device_without_any_good_image_still_starts);
    RUN(many_downloads_wrap_the_commit_log);
    RUN(shutdown_is_orderly_and_can_be_repeated);
    return test_result();
}
