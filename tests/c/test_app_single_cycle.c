/*
 * test_app_single_cycle.c - AppSingleCycle: one cycle of each task of an application that is stopped.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpEventMgr.h"
#include "app_device.h"
#include "counting_tasks.h"

static void download_counting(void)
{
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
}

static void each_task_has_one_cycle_and_no_other_one_follows(void)
{
    begin();
    add_counting_task("Fast", KIND_CYCLIC, 1000)->priority = 3;
    add_counting_task("Slow", KIND_CYCLIC, 100000)->priority = 1;
    add_counting_task("Free", KIND_FREEWHEELING, 0)->priority = CDL_PRIORITY_LOWEST;
    download_counting();
    for (RTS_UI32 cycles = 1; cycles <= 3; cycles++) {
        CHECK_EQUAL(AppSingleCycle(), ERR_OK);
        CHECK_EQUAL(app_state(), AS_STOP);
        CHECK_EQUAL(SimAdvance(ms(250)), ERR_OK);
        CHECK(count_of(0) == cycles && count_of(1) == cycles && count_of(2) == cycles);
    }
}

static void tasks_follow_each_other_by_priority(void)
{
    begin();
    RTS_UI32 entry = here(&spec);
    emit_copy(&spec, APP_AREA_DATA, 0, APP_AREA_DATA, 4); /* Last: what First has made of it */
    emit_ret(&spec);
    add_task(&spec, "Last", KIND_CYCLIC, 1000, entry)->priority = 7;
    add_counting_task("First", KIND_CYCLIC, 1000)->priority = 2;
    download_counting();
    CHECK_EQUAL(AppSingleCycle(), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 0), 1);
}

static void a_task_that_waits_for_an_event_runs_if_that_comes_in_the_cycle(void)
{
    enum { EVENT_AT = 8 };

    begin();
    RTS_UI32 entry = here(&spec);
    emit_add(&spec, APP_AREA_DATA, EVENT_AT, 1);
    emit_ret(&spec);
    add_task(&spec, "Maker", KIND_CYCLIC, 1000, entry)->priority = 9;
    CDL_TASK *waits = add_counting_task("Waits", KIND_EVENT, 0);
    waits->event_area = APP_AREA_DATA;
    waits->event_offset = EVENT_AT;
    waits->event_ignored = 0xFE; /* a bit that rises in every second cycle */
    waits->priority = 1;
    download_counting();
    for (RTS_UI32 cycles = 1; cycles <= 4; cycles++) {
        CHECK_EQUAL(AppSingleCycle(), ERR_OK);
        CHECK_EQUAL(count_of(1), (cycles + 1) / 2);
    }
}

static void outputs_are_zero_after_it_and_it_can_be_started_then(void)
{
    APP_BYTES counter;

    start_blank();
    build_counter(&counter, 5);
    CHECK_EQUAL(download(&counter), ERR_OK);
    CHECK_EQUAL(AppSingleCycle(), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 5);
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, OUTPUT_OFFSET), 0);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 10);
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, OUTPUT_OFFSET), 5);
}

static void it_is_refused_without_application_while_one_runs_and_after_an_exception(void)
{
    start_blank();
    CHECK_EQUAL(AppSingleCycle(), ERR_APP_NOT_LOADED);
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(AppSingleCycle(), ERR_CALL_AGAIN);
    CHECK(app_state() == AS_RUN && read_u32(APP_AREA_DATA, COUNTER_OFFSET) == 1);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(AppSingleCycle(), ERR_OK);
}

static void an_exception_in_it_ends_it_and_needs_a_reset(void)
{
    begin();
    RTS_UI32 entry = here(&spec);
    emit_divide_by_zero(&spec);
    emit_ret(&spec);
    add_task(&spec, "Bad", KIND_CYCLIC, 1000, entry)->priority = 1;
    add_counting_task("Good", KIND_CYCLIC, 1000)->priority = 2;
    download_counting();
    CHECK_EQUAL(AppSingleCycle(), ERR_EXCEPTION);
    CHECK(app_state() == AS_STOP && app_exception() == RTSEXCPT_DIVIDEBYZERO && count_of(1) == 0);
    CHECK_EQUAL(AppSingleCycle(), ERR_INVALID_STATE);
    CHECK_EQUAL(AppReset(RESET_OPTION_COLD), ERR_OK);
    CHECK_EQUAL(AppSingleCycle(), ERR_EXCEPTION);
}

static RTS_UI32 posted[4];
static RTS_UI32 posted_count;

static void note_event(EVENT_PARAM *param)
{
    if (posted_count < RTS_COUNT(posted))
        posted[posted_count++] = param->event;
}

static void components_see_a_start_and_a_stop(void)
{
    static const RTS_UI32 all[] = {EVT_PrepareStart, EVT_StartDone, EVT_PrepareStop, EVT_StopDone};
    APP_BYTES counter;

    start_blank();
    build_counter(&counter, 1);
    CHECK_EQUAL(download(&counter), ERR_OK);
    posted_count = 0;
    for (RTS_UI32 i = 0; i < RTS_COUNT(all); i++)
        CHECK_EQUAL(EventRegisterCallback(CMPID_CmpAppEmbedded, all[i], note_event, NULL), ERR_OK);
    CHECK_EQUAL(AppSingleCycle(), ERR_OK);
    CHECK(posted_count == RTS_COUNT(all) && memcmp(posted, all, sizeof(all)) == 0);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(each_task_has_one_cycle_and_no_other_one_follows);
    RUN(tasks_follow_each_other_by_priority);
    RUN(a_task_that_waits_for_an_event_runs_if_that_comes_in_the_cycle);
    RUN(outputs_are_zero_after_it_and_it_can_be_started_then);
    RUN(it_is_refused_without_application_while_one_runs_and_after_an_exception);
    RUN(an_exception_in_it_ends_it_and_needs_a_reset);
    RUN(components_see_a_start_and_a_stop);
    return test_result();
}
