/*
 * test_app_change.c - online changes: power cuts and faults at every flash operation, what is refused, the parts of a step.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A device runs application 1 (proven), whose variables have values by now. Application 2 takes its place while it runs, goes
 * on, proves itself, is stopped and started again.
 */
#include "AppAddress.h"
#include "AppException.h"
#include "AppState.h"
#include "CmpEventMgr.h"
#include "IecCycle.h"
#include "app_image.h"
#include "test.h"

#include <stdlib.h>

enum {
    NEW_OFFSET = 32,
    NEW_VALUE = 0x1234,
    POINTER_OFFSET = 8, /* leads to what moves */
    OLD_PLACE = 16,
    NEW_PLACE = 48,
    MOVED_VALUE = 77,
    TO_OBJECT_OFFSET = 24, /* leads to the instance that begins at the same place */
    OBJECT_PLACE = 52,     /* that of the instance, which is not that of its first member */
    PASSED_OFFSET = 40,    /* leads to what is gone */
    GONE_PLACE = 56,
};

static APP_BYTES images[4]; /* [step]; 0 unused */
static RTS_UI32 first = 1;  /* the image that runs when a story begins; the next one takes its place */
static RTS_UI32 least;      /* of its retain variables then */
static RTS_UI32 cuts;

static void emit_step(APP_SPEC *spec, RTS_UI8 kind, RTS_UI8 area, RTS_UI32 to, RTS_UI32 size)
{
    CDL_CHANGE_STEP step = {to, size, 0, kind, area, area, 0};

    emit(spec, (const char *)&step, sizeof step);
}

static void emit_move(APP_SPEC *spec, RTS_UI8 kind, RTS_UI32 from, RTS_UI32 to, RTS_UI32 size)
{
    CDL_CHANGE_STEP step = {to, size, from, kind, APP_AREA_DATA, APP_AREA_DATA, 0};

    emit(spec, (const char *)&step, sizeof step);
}

/* A step of what leads to instances. */
static void emit_object(APP_SPEC *spec, RTS_UI8 kind, RTS_UI32 from, RTS_UI32 to, RTS_UI32 size)
{
    RTS_UI8 objects = CDL_CHANGE_OBJECTS | APP_AREA_DATA;
    RTS_UI8 area = kind == CDL_CHANGE_LEAD ? CDL_CHANGE_OBJECTS : APP_AREA_DATA;
    CDL_CHANGE_STEP step = {to, size, from, kind, area, kind == CDL_CHANGE_LEAD ? APP_AREA_DATA : objects, 0};

    emit(spec, (const char *)&step, sizeof step);
}

/* The counter that counts by `step`, in place of another one; a new variable gets NEW_VALUE, and a second task does
 * nothing. */
static void spec_change(APP_SPEC *spec, RTS_UI32 step, const APP_BYTES *base)
{
    spec_counter(spec, step);
    add_task(spec, "Second", KIND_CYCLIC, 20000, here(spec));
    emit_ret(spec);
    while (spec->code_size % 4 != 0)
        emit_ret(spec);
    spec->change = (CDL_CHANGE){image_crc(base), CDL_CHANGE_NO_INIT, here(spec), 0};
    emit_move(spec, CDL_CHANGE_MOVE, OLD_PLACE, NEW_PLACE, 8);
    emit_move(spec, CDL_CHANGE_GONE, GONE_PLACE, 0, 4);
    emit_object(spec, CDL_CHANGE_FOLLOW, OLD_PLACE, OBJECT_PLACE, 1);
    emit_move(spec, CDL_CHANGE_LEAD, POINTER_OFFSET, 8, APP_POINTER_SIZE);
    emit_object(spec, CDL_CHANGE_LEAD, TO_OBJECT_OFFSET, 8, APP_POINTER_SIZE);
    emit_move(spec, CDL_CHANGE_FORGET, PASSED_OFFSET, 8, APP_POINTER_SIZE);
    emit_step(spec, CDL_CHANGE_CLEAR, APP_AREA_DATA, NEW_OFFSET, 8);
    emit_step(spec, CDL_CHANGE_PUT, APP_AREA_DATA, NEW_OFFSET, 2);
    emit_u32(spec, NEW_VALUE);
    spec->change.size = here(spec) - spec->change.offset;
}

static void set_one(RTS_UI32 at, RTS_UI32 offset)
{
    uintptr_t pointer = (uintptr_t)AppGetAreaAddress(APP_AREA_DATA, 0, 64) + offset;

    memcpy(AppGetAreaAddress(APP_AREA_DATA, 0, 64) + at, &pointer, sizeof pointer);
}

/* The way back from it: the image of before, as a change. What has moved moves back, and the new variable is gone. */
static void spec_way_back(APP_SPEC *spec, RTS_UI32 step, const APP_BYTES *base)
{
    spec_counter(spec, step);
    while (spec->code_size % 4 != 0)
        emit_ret(spec);
    spec->change = (CDL_CHANGE){image_crc(base), CDL_CHANGE_NO_INIT, here(spec), 0};
    emit_move(spec, CDL_CHANGE_GONE, NEW_OFFSET, 0, 8);
    emit_move(spec, CDL_CHANGE_MOVE, NEW_PLACE, OLD_PLACE, 8);
    emit_move(spec, CDL_CHANGE_LEAD, POINTER_OFFSET, 8, APP_POINTER_SIZE);
    spec->change.size = here(spec) - spec->change.offset;
}

/* The program would have set its pointers. */
static void set_pointer(RTS_UI32 offset)
{
    set_one(POINTER_OFFSET, offset);
    set_one(TO_OBJECT_OFFSET, OLD_PLACE);
    set_one(PASSED_OFFSET, GONE_PLACE);
    AppGetAreaAddress(APP_AREA_DATA, 0, 64)[offset] = MOVED_VALUE;
}

static uintptr_t get_pointer(RTS_UI32 at)
{
    uintptr_t pointer;

    memcpy(&pointer, AppGetAreaAddress(APP_AREA_DATA, 0, 64) + at, sizeof pointer);
    return pointer;
}

static RTS_UI32 leads_to(RTS_UI32 at)
{
    return (RTS_UI32)(get_pointer(at) - (uintptr_t)AppGetAreaAddress(APP_AREA_DATA, 0, 64));
}

static RTS_UI32 pointer_leads_to(void)
{
    return leads_to(POINTER_OFFSET);
}

static RTS_RESULT change_to(const APP_BYTES *image)
{
    APP_REFUSAL refusal;
    RTS_RESULT result = send_part(image, image->size);

    return result == ERR_OK ? AppDownloadChange(&refusal) : result;
}

static void prepare(RTS_UI32 program_size, RTS_UI8 erased, RTS_UI32 sector_size)
{
    CHECK_EQUAL(SimFlashConfigure(32 * 1024, sector_size, program_size, erased), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(download(&images[1]), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(6000)), ERR_OK);
    SimStop();
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
}

static void start_again(void)
{
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    least = read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET); /* as saved */
    CHECK_EQUAL(SimAdvance(ms(500)), ERR_OK);
}

static RTS_RESULT story_result;

static RTS_RESULT try_story(void)
{
    RTS_RESULT result;

    set_pointer(first == 1 ? OLD_PLACE : NEW_PLACE);
    result = change_to(&images[first + 1]);
    if (result == ERR_OK)
        result = SimAdvance(ms(8000));
    if (result == ERR_OK)
        result = AppStopApplication();
    return result == ERR_OK ? AppStartApplication() : result;
}

static void story(void *unused)
{
    RTS_UNUSED(unused);
    story_result = try_story();
}

static void variables_go_on_in_the_new_code(void)
{
    RTS_UI32 counter;

    prepare(8, 0xFF, 512);
    start_again();
    counter = read_u32(APP_AREA_DATA, COUNTER_OFFSET);
    set_pointer(OLD_PLACE + 4);
    CHECK_EQUAL(change_to(&images[2]), ERR_OK);
    CHECK_EQUAL(pointer_leads_to(), NEW_PLACE + 4);
    CHECK_EQUAL(leads_to(TO_OBJECT_OFFSET), OBJECT_PLACE);
    CHECK(get_pointer(PASSED_OFFSET) == 0);
    CHECK_EQUAL(AppGetAreaAddress(APP_AREA_DATA, 0, 64)[NEW_PLACE + 4], MOVED_VALUE);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), counter);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1); /* set by the initialisation of the old one only */
    CHECK_EQUAL(read_u32(APP_AREA_DATA, NEW_OFFSET), NEW_VALUE);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), counter + 20);
}

/* One of both runs, whole, with the values that its retain variables had: not older than a save, and never initial ones. */
static RTS_UI32 check_whole(void)
{
    RTS_UI32 step = read_u32(APP_AREA_DATA, STEP_OFFSET);
    RTS_UI32 retain = read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET);
    APP_STATUS status;

    AppGetStatus(&status);
    CHECK_EQUAL(status.state, AS_RUN);
    CHECK(step == first || step == first + 1);
    CHECK_EQUAL(status.image_crc, image_crc(&images[step]));
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_B_OFFSET), retain);
    CHECK(retain >= least && least >= 600);
    return step;
}

/* From the state of the flash that was saved last. */
static void sweep(void)
{
    RTS_UI32 operations;
    RTS_UI32 mode;
    RTS_UI32 k;

    start_again();
    operations = SimFlashOps();
    CHECK(SimCall(story, NULL) == ERR_OK);
    CHECK_EQUAL(story_result, ERR_OK);
    operations = SimFlashOps() - operations;
    for (mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        RTS_UI32 last = first;
        RTS_UI32 changes = 0;
        for (k = 1; k <= operations; k++, cuts++) {
            RTS_UI32 step;
            start_again();
            SimFlashCut(k, mode);
            CHECK(SimCall(story, NULL) == SIM_POWER_CUT);
            CHECK_EQUAL(SimStart(), ERR_OK);
            step = check_whole();
            changes += step != last;
            last = step;
            CHECK_EQUAL(SimFlashViolations(), 0);
        }
        CHECK_EQUAL(changes, 1); /* one operation commits */
        CHECK_EQUAL(last, first + 1);
    }
}

static void every_cut_leaves_the_old_or_the_new_application(void)
{
    prepare(1, 0xFF, 512);
    sweep();
    prepare(8, 0x00, 512);
    sweep();
    prepare(16, 0xFF, 1024);
    sweep();
    printf("     %u cuts\n", (unsigned)cuts);
}

static void every_cut_of_the_way_back_leaves_one_of_both_with_the_retain_values_of_now(void)
{
    prepare(8, 0xFF, 512);
    start_again();
    set_pointer(OLD_PLACE);
    CHECK_EQUAL(change_to(&images[2]), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(6000)), ERR_OK);
    SimStop();
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    first = 2;
    start_again();
    CHECK(least >= 600 + 2 * 500); /* both programs have counted, the second one by 2 */
    cuts = 0;
    sweep();
    first = 1;
    printf("     %u cuts\n", (unsigned)cuts);
}

static void a_fault_at_any_operation_leaves_one_of_both_running(void)
{
    RTS_UI32 k;

    prepare(8, 0xFF, 512);
    for (k = 1; k < 60; k++) {
        RTS_UI32 counter;
        RTS_RESULT result;
        start_again();
        counter = read_u32(APP_AREA_DATA, COUNTER_OFFSET);
        set_pointer(OLD_PLACE);
        SimFlashCut(k, SIM_FAULT);
        result = change_to(&images[2]);
        CHECK_EQUAL(pointer_leads_to(), (result == ERR_OK ? NEW_PLACE : OLD_PLACE));
        CHECK_EQUAL(leads_to(TO_OBJECT_OFFSET), (result == ERR_OK ? OBJECT_PLACE : OLD_PLACE));
        CHECK(get_pointer(PASSED_OFFSET) == 0 || leads_to(PASSED_OFFSET) == GONE_PLACE);
        CHECK_EQUAL(IecTaskGetCount(), (result == ERR_OK ? 2u : 1u));
        CHECK_EQUAL(app_state(), AS_RUN);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), counter);
        SimFlashCut(0, 0);
        CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), counter + (result == ERR_OK ? 20u : 10u));
        CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(check_whole(), (result == ERR_OK ? 2u : 1u));
    }
}

static RTS_RESULT try_spec(const APP_SPEC *spec)
{
    APP_BYTES image;

    build_image(&image, spec);
    start_again();
    return change_to(&image);
}

static void fail_after_the_look(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    IecCycleStop(); /* as a task does that fails, before it tells main */
}

static void what_does_not_fit_what_runs_is_refused(void)
{
    APP_SPEC good;
    APP_SPEC spec;

    prepare(8, 0xFF, 512);
    spec_change(&good, 2, &images[1]);
    CHECK_EQUAL(try_spec(&good), ERR_OK);
    spec = good;
    spec.change.base++;
    CHECK_EQUAL(try_spec(&spec), ERR_ID_MISMATCH);
    spec = good;
    add_task(&spec, "Other", KIND_EXTERNAL, 0, 0)->event_offset = 0x1234;
    CHECK_EQUAL(try_spec(&spec), ERR_NO_OBJECT);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(check_whole(), 1);
}

/* A program that fails after the last look of main is not changed, and the failure is its own. */
static void failure_just_before_the_exchange_is_that_of_the_previous_program(void)
{
    APP_STATUS status;

    prepare(8, 0xFF, 512);
    start_again();
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_PrepareOnlineChange, fail_after_the_look, NULL),
                ERR_OK);
    CHECK_EQUAL(change_to(&images[2]), ERR_INVALID_STATE);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, NEW_OFFSET), 0);
    AppHandleException(0, RTSEXCPT_DIVIDEBYZERO, 0);
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    AppGetStatus(&status);
    CHECK_EQUAL(status.state, AS_STOP);
    CHECK_EQUAL(status.image_crc, image_crc(&images[1]));
}

static void tasks_may_change_and_their_number_too(void)
{
    RTS_UI32 counter;
    APP_BYTES changed;
    APP_SPEC spec;

    prepare(8, 0xFF, 512);
    start_again();
    spec_change(&spec, 2, &images[1]);
    spec.tasks[0].interval_us = 2 * spec.tasks[0].interval_us;
    add_task(&spec, "Other", KIND_CYCLIC, spec.tasks[0].interval_us / 4, spec.tasks[0].entry_offset);
    build_image(&changed, &spec);
    counter = read_u32(APP_AREA_DATA, COUNTER_OFFSET);
    CHECK_EQUAL(change_to(&changed), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(200)), ERR_OK);
    counter = read_u32(APP_AREA_DATA, COUNTER_OFFSET) - counter;
    CHECK(counter >= 2 * (10 + 40) - 4 && counter <= 2 * (10 + 40) + 4);
}

static void each_number_of_the_list_is_checked(void)
{
    static const RTS_UI32 wrong[] = {0x7FFFFFFC, 0xFFFFFFFC, 0xFFFFFFFF};
    APP_SPEC good;
    APP_SPEC spec;
    CDL_CHANGE_STEP *step;
    RTS_SIZE i;

    prepare(8, 0xFF, 512);
    spec_change(&good, 2, &images[1]);
    for (i = 0; i < RTS_COUNT(wrong); i++) {
        spec = good;
        spec.change.offset = wrong[i];
        CHECK_EQUAL(try_spec(&spec), ERR_OUT_OF_LIMITS);
        spec = good;
        spec.change.size = wrong[i];
        CHECK_EQUAL(try_spec(&spec), ERR_OUT_OF_LIMITS);
        spec = good;
        spec.change.init = wrong[i] - 1;
        CHECK_EQUAL(try_spec(&spec), ERR_OUT_OF_LIMITS);
        spec = good;
        step = (CDL_CHANGE_STEP *)(void *)(spec.code + spec.change.offset);
        step->to = wrong[i];
        CHECK_EQUAL(try_spec(&spec), ERR_OUT_OF_LIMITS);
        spec = good;
        step->size = wrong[i];
        CHECK_EQUAL(try_spec(&spec), ERR_OUT_OF_LIMITS);
        spec = good;
        step->from = wrong[i];
        CHECK_EQUAL(try_spec(&spec), ERR_OUT_OF_LIMITS);
    }
    spec = good;
    step->area = APP_AREA_CODE;
    CHECK_EQUAL(try_spec(&spec), ERR_OUT_OF_LIMITS);
    spec = good;
    spec.change.size -= 4; /* a step ends within its data */
    CHECK_EQUAL(try_spec(&spec), ERR_OUT_OF_LIMITS);
    spec = good;
    step->from_area = APP_AREA_CODE;
    CHECK_EQUAL(try_spec(&spec), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(check_whole(), 1);
}

/* In the list of spec_change. */
enum { AT_GONE = 1, AT_OBJECT, AT_LEAD, AT_LEAD_OBJECT, AT_FORGET };

/* The list with another number in one step is refused. */
static void check_field(const APP_SPEC *good, RTS_UI32 at, RTS_SIZE offset, RTS_SIZE size, RTS_UI32 value)
{
    APP_SPEC spec = *good;
    CDL_CHANGE_STEP *steps = (CDL_CHANGE_STEP *)(void *)(spec.code + spec.change.offset);

    memcpy((RTS_UI8 *)&steps[at] + offset, &value, size);
    CHECK_EQUAL(try_spec(&spec), ERR_OUT_OF_LIMITS);
}

#define CHECK_FIELD(at, field, value) \
    check_field(&good, at, offsetof(CDL_CHANGE_STEP, field), sizeof(((CDL_CHANGE_STEP *)0)->field), (RTS_UI32)(value))

static void each_bound_of_pointers_and_objects_is_checked(void)
{
    APP_SPEC good;
    RTS_UI32 at;
    RTS_UI32 distance;

    prepare(8, 0xFF, 512);
    spec_change(&good, 2, &images[1]);
    for (at = AT_GONE; at <= AT_FORGET; at++) {
        CHECK_FIELD(at, from, 0xFFFFFFFC);
        CHECK_FIELD(at, from, good.areas[APP_AREA_DATA] + 1);
        CHECK_FIELD(at, size, 0xFFFFFFFC);
        CHECK_FIELD(at, size, good.areas[APP_AREA_DATA] + 1);
        CHECK_FIELD(at, from_area, at == AT_OBJECT ? CDL_CHANGE_OBJECTS | APP_AREA_CODE : APP_AREA_CODE);
        CHECK_FIELD(at, from_area, 0xFF);
        CHECK_FIELD(at, kind, CDL_CHANGE_SIGN + 1);
    }
    for (at = AT_LEAD; at <= AT_FORGET; at++) {
        for (distance = 0; distance < APP_POINTER_SIZE; distance++)
            CHECK_FIELD(at, to, distance);
        CHECK_FIELD(at, area, 1);
        CHECK_FIELD(at, area, 0x7F);
        CHECK_FIELD(at, area, 0x81);
        CHECK_FIELD(at, from_area, CDL_CHANGE_OBJECTS | APP_AREA_DATA);
        CHECK_FIELD(at, kind, CDL_CHANGE_GONE); /* not among those that come first */
        CHECK_FIELD(at, kind, CDL_CHANGE_FOLLOW);
    }
    CHECK_FIELD(AT_OBJECT, to, good.areas[APP_AREA_DATA]);
    CHECK_FIELD(AT_OBJECT, to, 0xFFFFFFFF);
    CHECK_FIELD(AT_OBJECT, area, APP_AREA_CODE);
    CHECK_FIELD(AT_OBJECT, area, CDL_CHANGE_OBJECTS | APP_AREA_DATA);
    CHECK_FIELD(AT_OBJECT, from_area, APP_AREA_DATA); /* before the one in front of it */
    CHECK_FIELD(AT_GONE, from, OLD_PLACE + 4);
    CHECK_FIELD(AT_GONE, from_area, CDL_CHANGE_OBJECTS | APP_AREA_DATA);
    CHECK_EQUAL(check_whole(), 1);
    CHECK_EQUAL(try_spec(&good), ERR_OK);
}

static void without_a_program_that_runs_there_is_no_change(void)
{
    CHECK_EQUAL(SimFlashConfigure(32 * 1024, 512, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(change_to(&images[2]), ERR_INVALID_STATE);
    CHECK_EQUAL(app_state(), AS_NONE);
}

static void fail_in_event(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    AppHandleException(APP_IN_EVENT, RTSEXCPT_DIVIDEBYZERO, 0);
}

static void a_program_that_fails_when_it_is_asked_stays_and_is_not_changed(void)
{
    APP_STATUS status;

    prepare(8, 0xFF, 512);
    start_again();
    CHECK_EQUAL(EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_PrepareOnlineChange, fail_in_event, NULL), ERR_OK);
    CHECK_EQUAL(change_to(&images[2]), ERR_INVALID_STATE);
    AppGetStatus(&status);
    CHECK_EQUAL(status.state, AS_STOP);
    CHECK_EQUAL(status.image_crc, image_crc(&images[1]));
    CHECK_EQUAL(read_u32(APP_AREA_DATA, NEW_OFFSET), 0);
}

/* It goes to the slot of the one before the last, like a download. */
static void many_changes_in_a_row_go_on(void)
{
    const char *asked = getenv("CHANGES"); /* 10 000: make changes */
    RTS_UI32 rounds = asked != NULL ? (RTS_UI32)strtoul(asked, NULL, 10) : 200;
    APP_BYTES next[2];
    APP_SPEC spec;
    RTS_UI32 round;
    RTS_UI32 counter;

    prepare(8, 0xFF, 512);
    start_again();
    next[1] = images[1];
    for (round = 0; round < rounds; round++) {
        spec_change(&spec, 1 + round % 3, &next[(round + 1) % 2]);
        build_image(&next[round % 2], &spec);
        counter = read_u32(APP_AREA_DATA, COUNTER_OFFSET);
        CHECK_EQUAL(change_to(&next[round % 2]), ERR_OK);
        CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), counter + 10 * (1 + round % 3));
    }
    CHECK_EQUAL(SimFlashViolations(), 0);
}

int main(void)
{
    APP_SPEC spec;

    NEEDS_X86_64;
    build_counter(&images[1], 1);
    spec_change(&spec, 2, &images[1]);
    build_image(&images[2], &spec);
    spec_way_back(&spec, 3, &images[2]);
    build_image(&images[3], &spec);
    RUN(variables_go_on_in_the_new_code);
    RUN(every_cut_leaves_the_old_or_the_new_application);
    RUN(every_cut_of_the_way_back_leaves_one_of_both_with_the_retain_values_of_now);
    RUN(a_fault_at_any_operation_leaves_one_of_both_running);
    RUN(what_does_not_fit_what_runs_is_refused);
    RUN(failure_just_before_the_exchange_is_that_of_the_previous_program);
    RUN(tasks_may_change_and_their_number_too);
    RUN(each_number_of_the_list_is_checked);
    RUN(each_bound_of_pointers_and_objects_is_checked);
    RUN(without_a_program_that_runs_there_is_no_change);
    RUN(a_program_that_fails_when_it_is_asked_stays_and_is_not_changed);
    RUN(many_changes_in_a_row_go_on);
    return test_result();
}
