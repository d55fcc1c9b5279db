/*
 * test_power_fail.c - the power is about to fail: what is saved, and what follows if it does not.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppPowerFails.h"
#include "../../firmware/src/app/AppLife.h"
#include "CmpRetain.h"
#include "app_device.h"

enum { IDLE_MS = 1100 }; /* within which main makes a pass */

/* Proven, with values that were saved at most a second ago; and of the last cycles, which were not. */
static RTS_UI32 run_until_unsaved(void)
{
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5500)), ERR_OK);
    return read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET);
}

static void what_was_not_saved_is_lost_without_a_warning(void)
{
    RTS_UI32 value = run_until_unsaved();

    CHECK_EQUAL(SimStart(), ERR_OK); /* power was cut */
    CHECK(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET) < value);
}

static void the_values_of_the_last_cycle_survive_if_the_port_warns(void)
{
    RTS_UI32 value = run_until_unsaved();

    AppPowerFails();
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK(log_has("The power fails: program stopped and values saved in"));
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, OUTPUT_OFFSET), 0);
    value = read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET) >= value + 10);
    CHECK(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET) <= value + 12);
}

static void what_a_tool_wrote_while_it_is_stopped_is_saved_too(void)
{
    (void)run_until_unsaved();
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    *(RTS_UI32 *)(void *)(AppGetContext()->area[APP_AREA_RETAIN] + RETAIN_A_OFFSET) = 7777;
    AppPowerFails();
    CHECK_EQUAL(SimAdvance(ms(1)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET) >= 7777);
}

static void the_program_runs_again_if_the_power_stays(void)
{
    (void)run_until_unsaved();
    AppPowerFails();
    CHECK_EQUAL(SimAdvance(ms(APP_POWER_BACK_MS - 100)), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(SimAdvance(ms(IDLE_MS)), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK(log_has("The power is back"));
}

static void another_warning_makes_it_wait_again(void)
{
    (void)run_until_unsaved();
    AppPowerFails();
    CHECK_EQUAL(SimAdvance(ms(APP_POWER_BACK_MS - IDLE_MS)), ERR_OK);
    AppPowerFails();
    CHECK_EQUAL(SimAdvance(ms(APP_POWER_BACK_MS - IDLE_MS)), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(SimAdvance(ms(2 * IDLE_MS)), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
}

static void a_program_that_a_user_stopped_is_not_started(void)
{
    (void)run_until_unsaved();
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    AppPowerFails();
    CHECK_EQUAL(SimAdvance(ms(2 * APP_POWER_BACK_MS)), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);

    (void)run_until_unsaved();
    AppPowerFails();
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(2 * APP_POWER_BACK_MS)), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
}

static void without_a_program_nothing_happens(void)
{
    start_blank();
    AppPowerFails();
    CHECK_EQUAL(SimAdvance(ms(2 * APP_POWER_BACK_MS)), ERR_OK);
    CHECK_EQUAL(app_state(), AS_NONE);
}

/* The warning came too late, or the power fails while it is saved: the previous record counts. */
static void a_cut_at_each_write_after_the_warning_leaves_the_old_or_the_new_values(void)
{
    RTS_UI32 saved = 0;

    (void)run_until_unsaved();
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    for (RTS_UI32 mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        bool cut = true;
        for (RTS_UI32 operation = 1; cut; operation++) {
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            RTS_UI32 before = read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET);
            CHECK_EQUAL(SimAdvance(ms(500)), ERR_OK);
            SimFlashCut(operation, mode);
            AppPowerFails();
            cut = SimAdvance(ms(20)) == SIM_POWER_CUT;
            CHECK_EQUAL(SimStart(), ERR_OK);
            RTS_UI32 after = read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET);
            CHECK(after >= before && after <= before + 60);
            CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_B_OFFSET), after);
            saved += after >= before + 50;
        }
    }
    CHECK(saved > 0);
}

int main(void)
{
    RUN(what_was_not_saved_is_lost_without_a_warning);
    RUN(the_values_of_the_last_cycle_survive_if_the_port_warns);
    RUN(what_a_tool_wrote_while_it_is_stopped_is_saved_too);
    RUN(the_program_runs_again_if_the_power_stays);
    RUN(another_warning_makes_it_wait_again);
    RUN(a_program_that_a_user_stopped_is_not_started);
    RUN(without_a_program_nothing_happens);
    RUN(a_cut_at_each_write_after_the_warning_leaves_the_old_or_the_new_values);
    return test_result();
}
