/*
 * test_app_retain.c - retain variables over power cuts, resets and downloads.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysFileFlash.h"
#include "app_device.h"

enum { RECORD_MAGIC = 0x474F4C52 };

static APP_SPEC spec;
static APP_BYTES image;

static void load(void)
{
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
}

/* The counter, as `spec`, which a test may go on from. */
static void start_and_load(RTS_UI32 step)
{
    start_blank();
    spec_counter(&spec, step);
    load();
}

enum { TRIP_OFFSET = 32 };

/* A task that divides by zero, to be triggered by trip(). */
static void add_trip(void)
{
    CDL_TASK *task = add_task(&spec, "Trip", KIND_EVENT, 0, here(&spec));

    task->event_area = APP_AREA_DATA;
    task->event_offset = TRIP_OFFSET;
    emit_divide_by_zero(&spec);
}

static void trip(void)
{
    *AppGetAreaAddress(APP_AREA_DATA, TRIP_OFFSET, 1) = 1;
}

static RTS_UI32 retain_value(void)
{
    RTS_UI32 a = read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET);

    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_B_OFFSET), a);
    return a;
}

static void a_power_cut_loses_at_most_a_second(void)
{
    RTS_UI32 before;

    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(7350)), ERR_OK);
    before = retain_value();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(retain_value() <= before);
    CHECK(retain_value() >= before - 101);
    CHECK(retain_value() > 100);
}

static void stop_saves_at_once(void)
{
    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(330)), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(retain_value(), 134);
}

static void shutdown_saves(void)
{
    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(330)), ERR_OK);
    SimStop();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(retain_value(), 134);
}

/* GlobalExit adds it to both numbers. */
static void add_exit(RTS_UI32 value)
{
    spec.function[CDL_FUNCTION_GLOBAL_EXIT] = (RTS_I32)here(&spec);
    emit_add(&spec, APP_AREA_RETAIN, RETAIN_A_OFFSET, value);
    emit_add(&spec, APP_AREA_RETAIN, RETAIN_B_OFFSET, value);
    emit_ret(&spec);
}

static void shutdown_saves_what_the_end_of_the_program_writes(void)
{
    start_blank();
    spec_counter(&spec, 1);
    add_exit(1000);
    load();
    CHECK_EQUAL(SimAdvance(ms(330)), ERR_OK);
    SimStop();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(retain_value(), 1134);
}

static void shutdown_saves_what_was_written_after_a_stop(void)
{
    start_and_load(1);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    *AppGetAreaAddress(APP_AREA_RETAIN, RETAIN_A_OFFSET, 1) = 7;
    *AppGetAreaAddress(APP_AREA_RETAIN, RETAIN_B_OFFSET, 1) = 7;
    SimStop();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(retain_value(), 7);
}

static void an_exception_saves(void)
{
    start_blank();
    spec_counter(&spec, 1);
    add_trip();
    load();
    CHECK_EQUAL(SimAdvance(ms(5330)), ERR_OK);
    trip();
    CHECK_EQUAL(SimAdvance(ms(9)), ERR_OK);
    CHECK(app_exception() != RTSEXCPT_NOEXCEPTION);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(retain_value(), 634);
}

static void unchanged_variables_are_not_saved_again(void)
{
    RTS_UI32 operations;

    start_blank();
    spec_counter(&spec, 1);
    spec.tasks[0].interval_us = 3600000000u; /* runs once at the start */
    load();
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    operations = SimFlashOps();
    CHECK_EQUAL(SimAdvance(ms(3000000)), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(SimFlashOps(), operations);
}

static void changing_variables_are_saved_once_per_second(void)
{
    RTS_UI32 operations;

    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    operations = SimFlashOps();
    CHECK_EQUAL(SimAdvance(ms(10000)), ERR_OK);
    CHECK(SimFlashOps() - operations >= 9 * 2);      /* a record is two to four programs */
    CHECK(SimFlashOps() - operations <= 10 * 4 + 8); /* and at most one change of the half */
}

static void an_application_without_retain_variables_saves_nothing(void)
{
    RTS_UI32 operations;

    start_blank();
    spec_init(&spec);
    spec.areas[APP_AREA_RETAIN] = 0;
    add_task(&spec, "Main", KIND_CYCLIC, 1000, here(&spec));
    emit_ret(&spec);
    load();
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    operations = SimFlashOps();
    CHECK_EQUAL(SimAdvance(ms(10000)), ERR_OK);
    CHECK_EQUAL(SimFlashOps(), operations);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
}

static void values_go_on_over_many_power_cuts(void)
{
    RTS_UI32 before = 100;
    int i;

    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(4100)), ERR_OK);
    for (i = 0; i < 300; i++) {
        CHECK(retain_value() >= before);
        before = retain_value();
        CHECK_EQUAL(SimAdvance(ms(1010)), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
    }
    CHECK(before > 300 * 95);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

static void a_download_gives_initial_values(void)
{
    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    load();
    CHECK_EQUAL(retain_value(), 100);
    CHECK_EQUAL(SimStart(), ERR_OK); /* also when power is lost right after it */
    CHECK_EQUAL(retain_value(), 100);
}

static void a_cold_reset_gives_initial_values_for_good(void)
{
    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_COLD), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(retain_value(), 100);
}

static void another_layout_is_not_restored(void)
{
    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    spec_counter(&spec, 2);
    spec.kept[1].variable.hash[1]++;
    load();
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(retain_value() > 1000);
    CHECK(!log_has("initial values"));
}

static void download_image(void *arg)
{
    RTS_UNUSED(arg);
    (void)download(&image);
}

/* Power fails at some time during the download of image 2, while application 1 runs and changes its values. Those are
 * of the same layout, but never become those of application 2. */
static void values_of_the_application_before_are_not_taken_over(void)
{
    RTS_UI32 taken_over = 0;
    RTS_UI32 k;

    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    spec_counter(&spec, 2);
    build_image(&image, &spec);
    for (k = 1; k < 1000; k++) {
        CHECK_EQUAL(SimFlashRestore(), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(SimAdvance(ms(330)), ERR_OK);
        SimFlashCut(k, SIM_CUT_AFTER);
        if (SimCall(download_image, NULL) == ERR_OK)
            break;
        CHECK_EQUAL(SimStart(), ERR_OK);
        if (read_u32(APP_AREA_DATA, STEP_OFFSET) == 2) {
            CHECK_EQUAL(retain_value(), 200);
            taken_over++;
        }
    }
    CHECK(k < 1000 && taken_over > 3); /* cuts after the commit: in the last save of 1, in the first of 2 */
}

/* Application 2, of the same layout, runs for a moment, saves, and dies: application 1 goes on with what it had
 * itself. */
static void a_rollback_brings_back_the_values_of_its_application(void)
{
    int i;

    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(retain_value(), 601);
    spec_counter(&spec, 2);
    add_trip();
    load();
    CHECK_EQUAL(SimAdvance(ms(2500)), ERR_OK);
    trip();
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    for (i = 0; i < 3; i++) {
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
        CHECK_EQUAL(retain_value(), 601);
    }
    CHECK_EQUAL(SimAdvance(ms(2000)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(retain_value() > 700);
}

/* The same when application 1 ran until application 2 took over: what it had in the end, not what was saved some time
 * before. */
static void a_rollback_brings_back_the_last_values_of_an_application_that_ran(void)
{
    start_blank();
    spec_counter(&spec, 1);
    add_exit(1000);
    load();
    CHECK_EQUAL(SimAdvance(ms(5330)), ERR_OK);
    CHECK_EQUAL(retain_value(), 634);
    spec_counter(&spec, 2);
    spec.function[CDL_FUNCTION_GLOBAL_INIT] = (RTS_I32)here(&spec);
    emit_divide_by_zero(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
    CHECK_EQUAL(retain_value(), 1634);
}

static void start_up(void *unused)
{
    RTS_UNUSED(unused);
    (void)CMInit();
}

/* The same when a half of the log holds one record only, and power fails at any operation of the start-up that goes
 * back. */
static void a_rollback_brings_back_large_values_too(void)
{
    RTS_UI32 k;
    int i;

    CHECK_EQUAL(SimFlashConfigure(1024 * 1024, 4096, 16, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    spec_counter(&spec, 1);
    spec.areas[APP_AREA_RETAIN] = APP_RETAIN_SIZE;
    load();
    CHECK_EQUAL(SimAdvance(ms(5330)), ERR_OK);
    spec_counter(&spec, 2);
    spec.areas[APP_AREA_RETAIN] = APP_RETAIN_SIZE;
    add_trip();
    load();
    CHECK_EQUAL(SimAdvance(ms(2500)), ERR_OK);
    trip();
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    for (k = 1; k < 10000; k += k < 40 ? 1 : 97) {
        CHECK_EQUAL(SimFlashRestore(), ERR_OK);
        SimFlashCut(k, SIM_CUT_AFTER);
        if (SimCall(start_up, NULL) == ERR_OK)
            break;
        for (i = 0; i < 2; i++) {
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
            CHECK_EQUAL(retain_value(), 634);
        }
    }
    CHECK(k > 40 && k < 10000);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

/* The retain log is gone, the commit record is not: saving starts again and works. */
static void a_lost_log_costs_its_values_only(void)
{
    const FILE_AREA *area = SysFileGetArea(FILE_RETAIN);

    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    load(); /* the records of this download are numbered from six or so */
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    memset(SimFlashData() + area->offset, 0x55, area->size);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(retain_value(), 100);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(retain_value() > 500);
}

static void damaged_values_give_way_to_initial_ones(void)
{
    const FILE_AREA *area = SysFileGetArea(FILE_RETAIN);
    RTS_UI32 i;

    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    for (i = 0; i < area->size; i += 4) {
        RTS_UI32 word;
        memcpy(&word, SimFlashData() + area->offset + i, sizeof word);
        if (word == RECORD_MAGIC)
            SimFlashData()[area->offset + i + 16] ^= 1; /* the CRC of the record */
    }
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(retain_value(), 100);
    CHECK_EQUAL(SimAdvance(ms(2000)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(retain_value() > 200);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

/* ---- PERSISTENT ---- */

enum { PLAIN_OFFSET = RETAIN_A_OFFSET, MOVED_OFFSET = RETAIN_B_OFFSET };

/* Application 1, with its first number PERSISTENT, to which its end adds `at_exit`, has run until `spec` takes its place,
 * where that number is the second. */
static void prepare_take_over_of(RTS_UI32 at_exit)
{
    start_blank();
    spec_counter(&spec, 1);
    spec.kept[0].variable.place |= CDL_KEPT_PERSISTENT;
    add_exit(at_exit);
    load();
    CHECK_EQUAL(SimAdvance(ms(5330)), ERR_OK);
    CHECK_EQUAL(retain_value(), 634);
    spec_counter(&spec, 2);
    spec.kept_count = 0;
    add_kept(&spec, 'A', MOVED_OFFSET, CDL_KEPT_PERSISTENT);
    add_kept(&spec, 'C', PLAIN_OFFSET, CDL_KEPT_PERSISTENT);
}

static void prepare_take_over(void)
{
    prepare_take_over_of(0);
}

static bool is_application(RTS_UI32 step)
{
    return read_u32(APP_AREA_DATA, STEP_OFFSET) == step;
}

static RTS_UI32 plain(void)
{
    return read_u32(APP_AREA_RETAIN, PLAIN_OFFSET);
}

static RTS_UI32 moved(void)
{
    return read_u32(APP_AREA_RETAIN, MOVED_OFFSET);
}

static void a_download_keeps_persistent_values_wherever_they_lie_then(void)
{
    prepare_take_over();
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK(moved() == 634 && plain() == 200);
    CHECK(log_has("1 taken over, 0 dropped"));
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(is_application(2) && moved() == 634 && plain() == 200);
}

static void what_a_download_drops_is_counted(void)
{
    prepare_take_over();
    spec.kept[0].variable.hash[1]++; /* another type */
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK(moved() == 200 && plain() == 200);
    CHECK(log_has("0 taken over, 1 dropped"));
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(is_application(2));
    CHECK(!log_has("dropped")); /* it has values of its own now */
}

static void download_and_run(void *unused)
{
    RTS_UNUSED(unused);
    (void)download(&image);
    (void)AppStartApplication();
    (void)SimAdvance(ms(2000));
}

static void a_download_keeps_what_the_end_of_the_program_writes(void)
{
    prepare_take_over_of(1000);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK(moved() == 1634 && plain() == 200);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(is_application(2) && moved() == 1634 && plain() == 200);
}

/* Application 1 goes on with its values, or application 2 with those that it takes over: what was saved while
 * application 1 ran, when it stopped, or when it ended. */
static void check_taken_over(RTS_UI32 at_exit)
{
    RTS_UI32 begun_with = moved() - plain() + 200;

    if (is_application(1)) {
        CHECK(retain_value() >= 534 && retain_value() <= 1000);
        return;
    }
    CHECK(is_application(2) && plain() % 2 == 0);
    if (begun_with >= 534 + at_exit)
        begun_with -= at_exit;
    CHECK(begun_with >= 534 && begun_with <= 634);
}

/* Power fails at any operation of the download, of the first start and of the first saves. A second cut follows at
 * once. */
static void cut_take_over_anywhere(RTS_UI32 at_exit)
{
    RTS_UI32 k;
    RTS_UI32 taken_over = 0;

    prepare_take_over_of(at_exit);
    build_image(&image, &spec);
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    for (k = 1; k < 1000; k++) {
        CHECK_EQUAL(SimFlashRestore(), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        SimFlashCut(k, k % 2 != 0 ? SIM_CUT_AFTER : SIM_CUT_TORN);
        if (SimCall(download_and_run, NULL) == ERR_OK)
            break;
        SimFlashCut(k % 7 + 1, SIM_CUT_AFTER);
        (void)SimCall(start_up, NULL);
        CHECK_EQUAL(SimStart(), ERR_OK);
        check_taken_over(at_exit);
        taken_over += is_application(2);
    }
    CHECK(k < 1000 && taken_over > 3);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

static void a_take_over_survives_every_power_cut(void)
{
    cut_take_over_anywhere(0);
}

static void a_take_over_of_what_the_end_of_the_program_writes_survives_every_power_cut(void)
{
    cut_take_over_anywhere(1000);
}

/* An application whose first number is PERSISTENT, with so large an area that a half of the log has one record only. */
static void spec_large(RTS_UI32 step)
{
    spec_counter(&spec, step);
    spec.areas[APP_AREA_RETAIN] = APP_RETAIN_SIZE;
    spec.kept[0].variable.place |= CDL_KEPT_PERSISTENT;
    add_exit(1000);
}

/* The same when application 1 has not proven itself, so that the record of application 3 is kept: until
 * application 2 is in its place. */
static void a_take_over_from_a_new_application_survives_every_power_cut(void)
{
    RTS_UI32 least;
    RTS_UI32 k;
    RTS_UI32 taken_over = 0;

    CHECK_EQUAL(SimFlashConfigure(1024 * 1024, 4096, 16, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    spec_large(3);
    load();
    CHECK_EQUAL(SimAdvance(ms(5330)), ERR_OK);
    spec_large(1);
    load();
    CHECK_EQUAL(SimAdvance(ms(2330)), ERR_OK);
    least = plain() - 100; /* saved a second ago */
    spec_large(2);
    build_image(&image, &spec);
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    for (k = 1; k < 100000; k += 41) {
        CHECK_EQUAL(SimFlashRestore(), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        SimFlashCut(k, SIM_CUT_AFTER);
        if (SimCall(download_and_run, NULL) == ERR_OK)
            break;
        CHECK_EQUAL(SimStart(), ERR_OK);
        if (is_application(2)) {
            CHECK(plain() >= least);
            taken_over++;
        }
    }
    CHECK(k < 100000 && taken_over > 300);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

/* Application 2 dies in its initialisation; application 3 takes its slot's place and finds the value all the same. */
static void a_program_that_fails_at_once_hands_values_on(void)
{
    prepare_take_over();
    spec.function[CDL_FUNCTION_GLOBAL_INIT] = (RTS_I32)here(&spec);
    emit_divide_by_zero(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(app_exception(), RTSEXCPT_DIVIDEBYZERO);
    spec_counter(&spec, 3);
    spec.kept[0].variable.place |= CDL_KEPT_PERSISTENT;
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK(is_application(3));
    CHECK(plain() == 634 && moved() == 300);
}

/* An application between without such a variable ends its life: it does not come back from the past. */
static void a_value_that_was_dropped_does_not_come_back(void)
{
    prepare_take_over();
    spec.kept_count = 0;
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK(log_has("0 taken over, 1 dropped"));
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    spec_counter(&spec, 1);
    spec.kept[0].variable.place |= CDL_KEPT_PERSISTENT;
    load();
    CHECK_EQUAL(retain_value(), 100);
}

static void origin_ends_persistent_values_too(void)
{
    prepare_take_over();
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(moved(), 200);
}

/* Elements by their index, a text that has more room: in a table of runs. */
static void runs_are_taken_over_by_index(void)
{
    static const CDL_KEPT_RUN old_array = {2, 2, 4, 1}, new_array = {2, 3, 3, 3};
    static const CDL_KEPT_RUN old_text = {4, 4, 1, 0}, new_text = {6, 6, 1, 0};
    static const RTS_UI8 values[] = {10, 0, 20, 0, 30, 0, 40, 0, 'a', 'b', 'c', 0, 'x', 'y'};
    static const RTS_UI8 expected[] = {30, 0, 0xEE, 40, 0, 0xEE, 0xEE, 0xEE, 'a', 'b', 'c', 0, 0, 0};
    RTS_UI8 *area;

    start_blank();
    spec_counter(&spec, 1);
    spec.kept_count = 0;
    spec.tasks[0].interval_us = 3600000000u;
    spec.areas[APP_AREA_RETAIN] = 32;
    add_kept_run(&spec, 'E', 16, CDL_KEPT_PERSISTENT, old_array);
    add_kept_run(&spec, 'F', 24, CDL_KEPT_PERSISTENT, old_text);
    load();
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    area = AppGetAreaAddress(APP_AREA_RETAIN, 0, 32);
    memcpy(area + 16, values, sizeof values);
    spec.kept_count = 0;
    add_kept_run(&spec, 'E', 16, CDL_KEPT_PERSISTENT, new_array);
    add_kept_run(&spec, 'F', 24, CDL_KEPT_PERSISTENT, new_text);
    spec.function[CDL_FUNCTION_CODE_INIT] = (RTS_I32)here(&spec);
    emit_set(&spec, APP_AREA_RETAIN, 16, 0xEEEEEEEE);
    emit_set(&spec, APP_AREA_RETAIN, 20, 0xEEEEEEEE);
    emit_ret(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK(memcmp(AppGetAreaAddress(APP_AREA_RETAIN, 16, sizeof expected), expected, sizeof expected) == 0);
}

/* data[ASKED_OFFSET] += 1 when a value among the `size` bytes of the retain area at `offset` was put back. */
enum { ASKED_OFFSET = 40 };
static void emit_ask(RTS_UI32 offset, RTS_UI32 size)
{
    emit(&spec, "\x57\x48\x8B\x57\x40", 5); /* push rdi; mov rdx, [rdi + 64] */
    emit_load_area(&spec, APP_AREA_RETAIN);
    emit(&spec, "\x48\x8D\xB8", 3); /* lea rdi, [rax + offset] */
    emit_u32(&spec, offset);
    emit(&spec, "\xBE", 1); /* mov esi, size */
    emit_u32(&spec, size);
    emit(&spec, "\xFF\x12\x5F\x0F\xB6\xC8", 6); /* call [rdx]; pop rdi; movzx ecx, al */
    emit_load_area(&spec, APP_AREA_DATA);
    emit(&spec, "\x01\x88", 2); /* add [rax + ASKED_OFFSET], ecx */
    emit_u32(&spec, ASKED_OFFSET);
}

/* An application with a PERSISTENT value at 0 and a RETAIN value at 12, which asks `times` for `size` bytes at `offset`. */
static void load_asking(RTS_UI32 times, RTS_UI32 offset, RTS_UI32 size)
{
    start_blank();
    spec_counter(&spec, 1);
    spec.kept[0].variable.place |= CDL_KEPT_PERSISTENT;
    add_import(&spec, "ieckept", 0xEBCA3613, 0x00010000);
    spec.function[CDL_FUNCTION_GLOBAL_INIT] = (RTS_I32)here(&spec);
    while (times-- > 0)
        emit_ask(offset, size);
    emit_ret(&spec);
    load();
}

static RTS_UI32 answers(void)
{
    return read_u32(APP_AREA_DATA, ASKED_OFFSET);
}

static void check_answers(RTS_UI32 offset, RTS_UI32 size, RTS_UI32 warm, RTS_UI32 cold)
{
    load_asking(1, offset, size);
    CHECK_EQUAL(answers(), 0);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(answers(), warm);
    CHECK_EQUAL(AppReset(RESET_OPTION_COLD), ERR_OK);
    CHECK_EQUAL(answers(), cold);
}

static void an_initialisation_learns_what_was_put_back(void)
{
    check_answers(0, 16, 1, 1);
    check_answers(0, 1, 1, 1);
    check_answers(1, 11, 0, 0);
    check_answers(1, 12, 1, 0);
    check_answers(12, 4, 1, 0);
    check_answers(13, 0xFFFFFFFF, 0, 0);
}

/* Calls that a reset makes to read the flash. */
static RTS_UI32 reads_of_a_reset(RTS_UI32 questions)
{
    RTS_UI32 before;

    load_asking(questions, 0, 16);
    before = SimFlashCalls(SIM_READ);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(answers(), questions);
    return SimFlashCalls(SIM_READ) - before;
}

static void what_was_put_back_is_looked_up_once_for_all_questions(void)
{
    SimFlashSetMapped(0);
    CHECK_EQUAL(reads_of_a_reset(50), reads_of_a_reset(1));
    SimFlashSetMapped(1);
}

static void what_is_not_in_the_table_is_not_kept(void)
{
    start_blank();
    spec_counter(&spec, 1);
    spec.kept_count = 1;
    load();
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), 601);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_B_OFFSET), 100);
}

static void a_flash_fault_does_not_stop_the_application(void)
{
    start_and_load(1);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    SimFlashCut(1, SIM_FAULT);
    CHECK_EQUAL(SimAdvance(ms(10000)), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK(log_has("cannot be saved"));
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(retain_value() > 1300); /* and it was saved again afterwards */
    CHECK_EQUAL(SimFlashViolations(), 0);
}

static void a_large_retain_area_is_saved_whole(void)
{
    RTS_UI32 size = APP_RETAIN_SIZE;
    const CDL_KEPT_RUN rest = {1, 1, size - 16, 0};
    RTS_UI8 *area;
    RTS_UI32 i;

    CHECK_EQUAL(SimFlashConfigure(1024 * 1024, 4096, 16, 0), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    spec_counter(&spec, 1);
    spec.areas[APP_AREA_RETAIN] = size;
    add_kept_run(&spec, 'C', 16, 0, rest);
    load();
    area = AppGetAreaAddress(APP_AREA_RETAIN, 0, size);
    for (i = 16; i < size; i++)
        area[i] = (RTS_UI8)(i * 7 >> 3);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    area = AppGetAreaAddress(APP_AREA_RETAIN, 0, size);
    for (i = 16; i < size && area[i] == (RTS_UI8)(i * 7 >> 3); i++)
        ;
    CHECK_EQUAL(i, size);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_power_cut_loses_at_most_a_second);
    RUN(stop_saves_at_once);
    RUN(shutdown_saves);
    RUN(shutdown_saves_what_the_end_of_the_program_writes);
    RUN(shutdown_saves_what_was_written_after_a_stop);
    RUN(an_exception_saves);
    RUN(unchanged_variables_are_not_saved_again);
    RUN(changing_variables_are_saved_once_per_second);
    RUN(an_application_without_retain_variables_saves_nothing);
    RUN(values_go_on_over_many_power_cuts);
    RUN(a_download_gives_initial_values);
    RUN(a_cold_reset_gives_initial_values_for_good);
    RUN(another_layout_is_not_restored);
    RUN(values_of_the_application_before_are_not_taken_over);
    RUN(a_rollback_brings_back_the_values_of_its_application);
    RUN(a_rollback_brings_back_the_last_values_of_an_application_that_ran);
    RUN(a_rollback_brings_back_large_values_too);
    RUN(a_lost_log_costs_its_values_only);
    RUN(damaged_values_give_way_to_initial_ones);
    RUN(a_download_keeps_persistent_values_wherever_they_lie_then);
    RUN(what_a_download_drops_is_counted);
    RUN(a_download_keeps_what_the_end_of_the_program_writes);
    RUN(a_take_over_survives_every_power_cut);
    RUN(a_take_over_of_what_the_end_of_the_program_writes_survives_every_power_cut);
    RUN(a_take_over_from_a_new_application_survives_every_power_cut);
    RUN(a_program_that_fails_at_once_hands_values_on);
    RUN(a_value_that_was_dropped_does_not_come_back);
    RUN(origin_ends_persistent_values_too);
    RUN(runs_are_taken_over_by_index);
    RUN(an_initialisation_learns_what_was_put_back);
    RUN(what_was_put_back_is_looked_up_once_for_all_questions);
    RUN(what_is_not_in_the_table_is_not_kept);
    RUN(a_flash_fault_does_not_stop_the_application);
    RUN(a_large_retain_area_is_saved_whole);
    return test_result();
}
