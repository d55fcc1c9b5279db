/*
 * test_app_death.c - what counts as the death of an application, and what a start-up does about it.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * How the run before ended is what the port says (SysStart.h), and what the flash says about an initialisation that was
 * not finished.
 */
#include "../../firmware/src/app/AppCommit.h"
#include "../../firmware/src/cycle/AppImage.h"
#include "../../firmware/src/app/AppLife.h"
#include "AppAddress.h"
#include "AppException.h"
#include "SysFileFlash.h"
#include "app_device.h"

enum { RUN_AT_ONCE = SYS_BOOT_START, STAY_STOPPED = SYS_BOOT_STOPPED, RUN_PROVEN = SYS_BOOT_PROVEN };

static RTS_RESULT restart(RTS_UI8 cause, RTS_UI8 stay_stopped)
{
    SYS_START start = {cause, stay_stopped, 0, RTSEXCPT_NOEXCEPTION, APP_NO_CODE_OFFSET, ""};

    if (cause == SYS_START_CRASH) {
        start.exception = RTSEXCPT_ACCESS_VIOLATION;
        start.code_offset = 0x12;
        start.text = "signal SIGSEGV";
    }
    SimSetStart(&start);
    return SimStart();
}

/* The next start loses power when all of the initialisation was done but its end was not noted. The application has been
 * started before, so that this note is the last thing that is written. */
static void die_in_initialisation(RTS_UI8 cause)
{
    RTS_UI32 operations;

    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    CHECK_EQUAL(restart(cause, RUN_AT_ONCE), ERR_OK);
    operations = SimFlashOps();
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    SimFlashCut(operations, SIM_CUT_BEFORE);
    SimFlashAtStart();
    CHECK_EQUAL(restart(cause, RUN_AT_ONCE), SIM_POWER_CUT);
}

static RTS_UI32 running_step(void)
{
    return app_state() == AS_RUN ? read_u32(APP_AREA_DATA, STEP_OFFSET) : 0;
}

static RTS_UI32 loaded_crc(void)
{
    APP_STATUS status;

    AppGetStatus(&status);
    return status.image_crc;
}

/* Application 1 is proven. */
static void start_proven(void)
{
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
}

/* Application 1 is proven, 2 has just been started in its place. */
static void start_unproven_after_proven(void)
{
    APP_BYTES image;

    start_proven();
    build_counter(&image, 2);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
}

/* ---- in its cycles ---- */

static bool proved_in_its_cycle;

static bool both_are_proven(void)
{
    return AppCommitIsProven(FILE_SLOT_A) && AppCommitIsProven(FILE_SLOT_B);
}

/* What main does while a cycle runs, where it has a core of its own. */
static void check_proof(RTS_UI32 unused)
{
    RTS_UNUSED(unused);
    AppCheckProof();
    proved_in_its_cycle = both_are_proven();
}

static const CMP_EXT_FUNCTION proof_checker[] = {{"checkproof", 1, 0x00010000, (RTS_PFN)check_proof}};

/* Its watchdog may take longer than the proof. */
static void nothing_is_proven_in_a_long_cycle_that_may_never_end(void)
{
    enum { SIMBURN_SIGNATURE = 0x76DDCD81, LONG_US = 4000000 };
    APP_BYTES image;
    APP_SPEC spec;

    start_proven();
    CHECK_EQUAL(CMRegisterExternal(proof_checker, 1), ERR_OK);
    spec_init(&spec);
    add_import(&spec, "simburn", SIMBURN_SIGNATURE, 0x00010000);
    add_import(&spec, "checkproof", 1, 0x00010000);
    add_task(&spec, "Main", KIND_CYCLIC, 10000, here(&spec));
    emit_call(&spec, 0, LONG_US);
    emit_call(&spec, 1, 0);
    emit_ret(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    proved_in_its_cycle = true;
    CHECK_EQUAL(SimAdvance(ms(1)), ERR_OK);
    CHECK(!proved_in_its_cycle);
    CHECK(both_are_proven()); /* it has ended */
}

static void one_crash_of_an_unproven_application_rolls_it_back(void)
{
    start_unproven_after_proven();
    CHECK_EQUAL(restart(SYS_START_CRASH, RUN_AT_ONCE), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    CHECK(log_has("signal SIGSEGV: access violation at code offset 0x00000012"));
    CHECK(log_has("Back to the application before"));
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
}

static void a_first_application_that_crashed_stays_stopped_until_it_is_started_by_hand(void)
{
    int i;

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(restart(SYS_START_CRASH, RUN_AT_ONCE), ERR_OK);
    for (i = 0; i < 3; i++) {
        CHECK_EQUAL(app_state(), AS_STOP);
        CHECK_EQUAL(app_exception(), RTSEXCPT_ACCESS_VIOLATION);
        CHECK(log_has("signal SIGSEGV"));
        CHECK(log_has("not started: it failed before"));
        CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 0); /* nothing of it was called */
        CHECK_EQUAL(SimStart(), ERR_OK);
    }
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
}

/* Its pointers are NULL, and lead nowhere, as they do in a process in which nothing was loaded before. */
static void pointers_of_one_that_stays_stopped_can_be_followed(void)
{
    AREA_ADDRESS address = {APP_AREA_DATA, 0};

    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    AppImageAttach(NULL);
    CHECK_EQUAL(restart(SYS_START_CRASH, RUN_AT_ONCE), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(AppAddressFollow(&address), MONITORING_ERR_INVALID_POINTER);
}

static void a_proven_application_that_crashed_runs_again(void)
{
    start_proven();
    CHECK_EQUAL(restart(SYS_START_CRASH, RUN_AT_ONCE), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
}

static void a_crash_of_the_runtime_beside_a_stopped_application_is_not_its_own(void)
{
    start_unproven_after_proven();
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(restart(SYS_START_CRASH, RUN_AT_ONCE), ERR_OK);
    CHECK_EQUAL(running_step(), 2);
}

static void a_reset_of_unknown_cause_counts_nothing_in_its_cycles(void)
{
    int i;

    start_unproven_after_proven();
    for (i = 0; i < 5; i++) {
        CHECK_EQUAL(restart(SYS_START_UNKNOWN, RUN_AT_ONCE), ERR_OK);
        CHECK_EQUAL(running_step(), 2);
    }
}

static void a_crash_without_a_known_exception_is_a_crash(void)
{
    SYS_START start = {SYS_START_CRASH, RUN_AT_ONCE, -1, RTSEXCPT_NOEXCEPTION, APP_NO_CODE_OFFSET, ""};

    start_with_counter(1);
    SimSetStart(&start);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_BOOTPROJECT_CRASH);
    CHECK(log_has("Before this start: crash"));
}

/* ---- when the port wants it to stay stopped ---- */

static void what_stays_stopped_is_not_called(void)
{
    start_unproven_after_proven();
    CHECK_EQUAL(restart(SYS_START_CRASH, STAY_STOPPED), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(app_exception(), RTSEXCPT_ACCESS_VIOLATION);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 0);
    CHECK_EQUAL(SimAdvance(ms(3000)), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    SimStop(); /* nor at the end */
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);                                               /* and the next start decides */
    CHECK(log_has("signal SIGSEGV: access violation at code offset 0x00000012")); /* which knows why */
    CHECK(log_has("Back to the application before"));
}

static void starting_what_stayed_stopped_rolls_it_back_too(void)
{
    start_unproven_after_proven();
    CHECK_EQUAL(restart(SYS_START_CRASH, STAY_STOPPED), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
}

static void a_proven_application_that_stayed_stopped_runs_at_the_next_start_or_by_hand(void)
{
    start_proven();
    CHECK_EQUAL(restart(SYS_START_CRASH, STAY_STOPPED), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(app_exception(), RTSEXCPT_ACCESS_VIOLATION);
    CHECK(log_has("Boot project not started"));
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
}

static void crashing_while_it_stays_stopped_changes_nothing(void)
{
    start_proven();
    CHECK_EQUAL(restart(SYS_START_CRASH, STAY_STOPPED), ERR_OK);
    CHECK_EQUAL(restart(SYS_START_CRASH, STAY_STOPPED), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
}

/* Its variables are all zero until it is initialised: that is not to be saved. */
static void retain_variables_without_a_record_get_their_initial_values_when_it_is_started(void)
{
    const FILE_AREA *area;

    start_proven();
    area = SysFileGetArea(FILE_RETAIN);
    memset(SimFlashData() + area->offset, 0, area->size);
    CHECK_EQUAL(restart(SYS_START_CRASH, STAY_STOPPED), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), 100);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), 100);
}

/* A value that kills the application can be corrected before it is started again. */
static void retain_variables_can_be_written_while_it_stays_stopped(void)
{
    static const RTS_UI32 value = 7000;

    start_proven();
    CHECK_EQUAL(restart(SYS_START_CRASH, STAY_STOPPED), ERR_OK);
    CHECK(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET) >= 500);
    memcpy(AppGetAreaAddress(APP_AREA_RETAIN, RETAIN_A_OFFSET, 4), &value, 4);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), value + 1);
}

/* ---- in its initialisation ---- */

static void an_unproven_application_that_crashes_in_its_initialisation_is_rolled_back(void)
{
    start_unproven_after_proven();
    die_in_initialisation(SYS_START_POWER);
    CHECK_EQUAL(restart(SYS_START_CRASH, RUN_AT_ONCE), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
}

static void a_first_application_that_crashes_in_its_initialisation_stays_stopped(void)
{
    start_with_counter(1);
    CHECK_EQUAL(AppStopApplication(), ERR_OK); /* so that only the initialisation is left to count */
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    die_in_initialisation(SYS_START_POWER);
    CHECK_EQUAL(restart(SYS_START_CRASH, RUN_AT_ONCE), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK(log_has("not started: it failed before"));
}

/* A proven application that died there: loaded, stopped, at every start. */
static void halt_proven(void)
{
    start_proven();
    die_in_initialisation(SYS_START_POWER);
    CHECK_EQUAL(restart(SYS_START_CRASH, RUN_AT_ONCE), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(SimStart(), ERR_OK);
}

static void a_proven_application_that_crashes_in_its_initialisation_stays_stopped(void)
{
    int i;

    halt_proven();
    for (i = 0; i < 3; i++) {
        CHECK_EQUAL(app_state(), AS_STOP);
        CHECK_EQUAL(app_exception(), RTSEXCPT_ACCESS_VIOLATION);
        CHECK(log_has("signal SIGSEGV"));
        CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 0);
        CHECK_EQUAL(SimStart(), ERR_OK);
    }
}

static void start_is_a_way_out(void)
{
    halt_proven();
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    CHECK_EQUAL(SimStart(), ERR_OK); /* it came through its initialisation */
    CHECK_EQUAL(running_step(), 1);
}

static void cold_reset_is_a_way_out(void)
{
    halt_proven();
    CHECK_EQUAL(AppReset(RESET_OPTION_COLD), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(app_exception(), RTSEXCPT_NOEXCEPTION);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), 100);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
}

static void a_download_is_a_way_out(void)
{
    APP_BYTES image;

    halt_proven();
    build_counter(&image, 3);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 3);
    CHECK_EQUAL(loaded_crc(), image_crc(&image));
}

static void what_dies_again_by_hand_stays_stopped_again(void)
{
    halt_proven();
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    die_in_initialisation(SYS_START_POWER);
    CHECK_EQUAL(restart(SYS_START_CRASH, STAY_STOPPED), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
}

static void losing_power_in_initialisation_is_not_dying(void)
{
    int i;

    start_unproven_after_proven();
    for (i = 0; i < 300; i++)
        die_in_initialisation(SYS_START_POWER);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 2);
}

static void one_reset_of_unknown_cause_in_initialisation_is_forgiven(void)
{
    start_unproven_after_proven();
    die_in_initialisation(SYS_START_UNKNOWN);
    CHECK_EQUAL(restart(SYS_START_UNKNOWN, RUN_AT_ONCE), ERR_OK);
    CHECK_EQUAL(running_step(), 2);
    die_in_initialisation(SYS_START_UNKNOWN); /* not the second in a row */
    CHECK_EQUAL(restart(SYS_START_UNKNOWN, RUN_AT_ONCE), ERR_OK);
    CHECK_EQUAL(running_step(), 2);
}

static void two_resets_of_unknown_cause_in_initialisation_are_a_death(void)
{
    start_unproven_after_proven();
    die_in_initialisation(SYS_START_UNKNOWN);
    die_in_initialisation(SYS_START_UNKNOWN);
    CHECK_EQUAL(restart(SYS_START_UNKNOWN, RUN_AT_ONCE), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    CHECK(log_has("Before this start: crash"));
    die_in_initialisation(SYS_START_UNKNOWN);
    die_in_initialisation(SYS_START_UNKNOWN);
    CHECK_EQUAL(restart(SYS_START_UNKNOWN, RUN_AT_ONCE), ERR_OK); /* this one is proven */
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
}

/* ---- by an exception ---- */

/* Its GlobalInit divides by zero. */
static void an_exception_in_initialisation_rolls_back_and_says_why(void)
{
    APP_SPEC spec;
    APP_BYTES image;

    start_proven();
    spec_counter(&spec, 2);
    spec.function[CDL_FUNCTION_GLOBAL_INIT] = (RTS_I32)here(&spec);
    emit_divide_by_zero(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    CHECK(log_has("Before this start: division by zero at code offset 0x"));
}

/* ---- a program that was not started ---- */

static void a_program_that_was_never_started_is_the_boot_project(void)
{
    APP_BYTES image;

    start_blank();
    build_counter(&image, 1);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    CHECK_EQUAL(AppStopApplication(), ERR_OK); /* nor does it matter that a user stopped it */
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
}

static void only_a_proven_application_runs_again_where_that_is_asked_for(void)
{
    RTS_UI8 cause;

    for (cause = SYS_START_POWER; cause <= SYS_START_CRASH; cause++) {
        start_proven();
        CHECK_EQUAL(restart(cause, RUN_PROVEN), ERR_OK);
        CHECK_EQUAL(running_step(), 1);
        CHECK_EQUAL(AppExceptionGet()->code, RTSEXCPT_NOEXCEPTION);
        start_unproven_after_proven();
        CHECK_EQUAL(restart(cause, RUN_PROVEN), ERR_OK);
        CHECK_EQUAL(app_state(), AS_STOP);
        CHECK(log_has("Boot project not started"));
        start_with_counter(1);
        CHECK_EQUAL(restart(cause, RUN_PROVEN), ERR_OK);
        CHECK_EQUAL(app_state(), AS_STOP);
    }
}

static void a_proven_application_that_crashed_in_its_initialisation_does_not_run_again(void)
{
    start_proven();
    die_in_initialisation(SYS_START_POWER);
    CHECK_EQUAL(restart(SYS_START_CRASH, RUN_PROVEN), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK(log_has("Boot project not started: it failed before"));
}

int main(void)
{
    NEEDS_X86_64;
    RUN(nothing_is_proven_in_a_long_cycle_that_may_never_end);
    RUN(one_crash_of_an_unproven_application_rolls_it_back);
    RUN(a_first_application_that_crashed_stays_stopped_until_it_is_started_by_hand);
    RUN(pointers_of_one_that_stays_stopped_can_be_followed);
    RUN(a_proven_application_that_crashed_runs_again);
    RUN(a_crash_of_the_runtime_beside_a_stopped_application_is_not_its_own);
    RUN(a_reset_of_unknown_cause_counts_nothing_in_its_cycles);
    RUN(a_crash_without_a_known_exception_is_a_crash);
    RUN(what_stays_stopped_is_not_called);
    RUN(starting_what_stayed_stopped_rolls_it_back_too);
    RUN(a_proven_application_that_stayed_stopped_runs_at_the_next_start_or_by_hand);
    RUN(crashing_while_it_stays_stopped_changes_nothing);
    RUN(retain_variables_without_a_record_get_their_initial_values_when_it_is_started);
    RUN(retain_variables_can_be_written_while_it_stays_stopped);
    RUN(an_unproven_application_that_crashes_in_its_initialisation_is_rolled_back);
    RUN(a_first_application_that_crashes_in_its_initialisation_stays_stopped);
    RUN(a_proven_application_that_crashes_in_its_initialisation_stays_stopped);
    RUN(start_is_a_way_out);
    RUN(cold_reset_is_a_way_out);
    RUN(a_download_is_a_way_out);
    RUN(what_dies_again_by_hand_stays_stopped_again);
    RUN(losing_power_in_initialisation_is_not_dying);
    RUN(one_reset_of_unknown_cause_in_initialisation_is_forgiven);
    RUN(two_resets_of_unknown_cause_in_initialisation_are_a_death);
    RUN(an_exception_in_initialisation_rolls_back_and_says_why);
    RUN(a_program_that_was_never_started_is_the_boot_project);
    RUN(only_a_proven_application_runs_again_where_that_is_asked_for);
    RUN(a_proven_application_that_crashed_in_its_initialisation_does_not_run_again);
    return test_result();
}
