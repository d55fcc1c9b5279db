/*
 * test_force.c - forced variables: whatever the program and the devices write, what tasks see and devices get is the
 * forced value.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpForce.h"
#include "CyclePhases.h"
#include "counting_tasks.h"

enum { CYCLE_NS = 10000000, POINTER_AT = 32 };

static APP_PLACE place_of(RTS_UI8 area, RTS_UI32 offset, RTS_UI8 size)
{
    APP_PLACE place;

    memset(&place, 0, sizeof place);
    place.area = area;
    place.offset[0] = offset;
    place.size = size;
    place.mask = PLACE_ALL_BITS;
    return place;
}

static MON_RESULT check(const APP_PLACE *place)
{
    RTS_UI32 added = 0;

    return ForceCheck(place, &added);
}

static MON_RESULT set(const APP_PLACE *place, RTS_UI64 value)
{
    FORCED_VALUE forced = {*place, {(RTS_UI32)value, (RTS_UI32)(value >> 32)}};

    return ForceSet(&forced);
}

static MON_RESULT force(RTS_UI8 area, RTS_UI32 offset, RTS_UI8 size, RTS_UI64 value)
{
    APP_PLACE place = place_of(area, offset, size);
    MON_RESULT result = check(&place);

    return result == MONITORING_ERR_OK ? set(&place, value) : result;
}

static void end(RTS_UI8 area, RTS_UI32 offset, RTS_UI8 size)
{
    APP_PLACE place = place_of(area, offset, size);

    ForceEnd(&place);
}

static RTS_UI8 *at(RTS_UI32 area, RTS_UI32 offset)
{
    return AppGetAreaAddress(area, offset, 1);
}

static void run_cycle(void)
{
    CHECK_EQUAL(SimAdvance(CYCLE_NS), ERR_OK);
}

/* A task that counts at data[0], copies the count from there to data[4], input[0] to data[8], and 1 to output[0]. */
static void begin_program(void)
{
    RTS_UI32 entry;

    begin();
    spec.areas[APP_AREA_INPUT] = 16;
    entry = here(&spec);
    add_task(&spec, "Main", KIND_CYCLIC, 10000, entry);
    emit_copy(&spec, APP_AREA_DATA, 4, APP_AREA_DATA, 0);
    emit_add(&spec, APP_AREA_DATA, 0, 1);
    emit_copy(&spec, APP_AREA_DATA, 8, APP_AREA_INPUT, 0);
    emit_set(&spec, APP_AREA_OUTPUT, 0, 1);
    emit_ret(&spec);
}

/* The same, with copies of all inputs and outputs for the task. */
static void share_all(void)
{
    spec.images[0] = (CDL_IMAGE){0, 2, CDL_IMAGE_SHARED};
    spec.images[1] = (CDL_IMAGE){0, 2, CDL_IMAGE_SHARED | CDL_IMAGE_WRITTEN};
    spec.image_count = 2;
}

static void a_forced_variable_is_what_the_program_reads_and_leaves(void)
{
    begin_program();
    load();
    run_cycle();
    CHECK_EQUAL(force(APP_AREA_DATA, 0, 4, 1000), MONITORING_ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 0), 1000); /* at once */
    run_cycle();
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 0), 1000);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 4), 1000);
    *at(APP_AREA_DATA, 0) = 7; /* by a tool */
    run_cycle();
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 0), 1000);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 4), 1000);
    end(APP_AREA_DATA, 0, 4);
    run_cycle();
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 0), 1001);
}

static void a_value_of_each_size_leaves_what_is_around_it(void)
{
    static const RTS_UI8 value[8] = {0xA1, 0xA2, 0xA3, 0xA4, 0xA5, 0xA6, 0xA7, 0xA8};
    RTS_UI64 number;

    memcpy(&number, value, sizeof number);
    for (RTS_UI32 size = 1; size <= 8; size *= 2) {
        for (RTS_UI32 offset = 17; offset < 26; offset++) {
            begin_program();
            load();
            CHECK_EQUAL(force(APP_AREA_DATA, offset, (RTS_UI8)size, number), MONITORING_ERR_OK);
            memset(at(APP_AREA_DATA, 16), 0x55, 20);
            run_cycle();
            CHECK(memcmp(at(APP_AREA_DATA, offset), value, size) == 0);
            CHECK_EQUAL(*at(APP_AREA_DATA, offset - 1), 0x55);
            CHECK_EQUAL(*at(APP_AREA_DATA, offset + size), 0x55);
        }
    }
}

static void forced_bits_leave_the_others_to_the_program(void)
{
    APP_PLACE place = place_of(APP_AREA_DATA, 0, 1);

    begin_program();
    load();
    place.mask = 0x84;
    CHECK_EQUAL(check(&place), MONITORING_ERR_OK);
    CHECK_EQUAL(set(&place, 0x04), MONITORING_ERR_OK);
    *at(APP_AREA_DATA, 0) = 0x80;
    run_cycle();
    CHECK_EQUAL(*at(APP_AREA_DATA, 0), 6); /* two cycles */
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 4), 5);
}

/* With copies for the task and without: the same. */
static void inputs_and_outputs_are_forced(bool has_copies)
{
    begin_program();
    if (has_copies)
        share_all();
    load();
    CHECK_EQUAL(force(APP_AREA_INPUT, 0, 2, 0x1234), MONITORING_ERR_OK);
    CHECK_EQUAL(force(APP_AREA_OUTPUT, 0, 1, 0x77), MONITORING_ERR_OK);
    *at(APP_AREA_INPUT, 0) = 1; /* by a driver */
    run_cycle();
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 8), 0x1234);
    CHECK_EQUAL(*at(APP_AREA_OUTPUT, 0), 0x77);
    CHECK_EQUAL(*at(APP_AREA_INPUT, 0), 0x34); /* what tools read */
    end(APP_AREA_OUTPUT, 0, 1);
    run_cycle();
    CHECK_EQUAL(*at(APP_AREA_OUTPUT, 0), 1);
}

static void inputs_and_outputs_that_a_task_has_alone_are_forced(void)
{
    inputs_and_outputs_are_forced(false);
}

static void inputs_and_outputs_that_tasks_have_copies_of_are_forced(void)
{
    inputs_and_outputs_are_forced(true);
}

static void what_no_task_has_a_copy_of_is_forced_where_all_see_it(void)
{
    begin_program();
    share_all();
    spec.images[1].count = 1;
    load();
    CHECK_EQUAL(force(APP_AREA_OUTPUT, 8, 4, 0x01020304), MONITORING_ERR_OK);
    CHECK_EQUAL(force(APP_AREA_OUTPUT, 6, 4, 0x0A0B0C0D), MONITORING_ERR_OK); /* a part of it is copied */
    run_cycle();
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, 8), 0x01020A0B);
    CHECK_EQUAL(read_u32(APP_AREA_OUTPUT, 0), 1);
}

static RTS_RESULT change_to_copies(void)
{
    APP_REFUSAL refusal;
    APP_BYTES next;
    RTS_RESULT result;

    spec.change = (CDL_CHANGE){image_crc(&image), CDL_CHANGE_NO_INIT, 0, 0};
    share_all();
    build_image(&next, &spec);
    result = send_part(&next, next.size);
    return result == ERR_OK ? AppDownloadChange(&refusal) : result;
}

static void what_tasks_have_copies_of_since_an_online_change_stays_forced(void)
{
    begin_program();
    load();
    CHECK_EQUAL(force(APP_AREA_INPUT, 0, 2, 0x1234), MONITORING_ERR_OK);
    CHECK_EQUAL(force(APP_AREA_OUTPUT, 0, 1, 0x77), MONITORING_ERR_OK);
    run_cycle();
    CHECK_EQUAL(change_to_copies(), ERR_OK);
    *at(APP_AREA_INPUT, 0) = 1; /* by a driver */
    run_cycle();
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 8), 0x1234);
    CHECK_EQUAL(*at(APP_AREA_OUTPUT, 0), 0x77);
}

static void put_pointer(uintptr_t value)
{
    memset(at(APP_AREA_DATA, POINTER_AT), 0, APP_POINTER_SIZE);
    memcpy(at(APP_AREA_DATA, POINTER_AT), &value, sizeof value);
}

static void a_pointer_is_followed_in_each_cycle(void)
{
    APP_PLACE place = place_of(APP_AREA_DATA, POINTER_AT, 4);

    place.pointers = 1;
    place.offset[1] = 4;
    begin_program();
    load();
    CHECK_EQUAL(check(&place), MONITORING_ERR_INVALID_POINTER);
    put_pointer((uintptr_t)at(APP_AREA_DATA, 40));
    CHECK_EQUAL(check(&place), MONITORING_ERR_OK);
    CHECK_EQUAL(set(&place, 99), MONITORING_ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 44), 99);
    put_pointer((uintptr_t)at(APP_AREA_RETAIN, 0));
    run_cycle();
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, 4), 99);
    put_pointer(0);
    run_cycle();
    put_pointer((uintptr_t)at(APP_AREA_RETAIN, 15)); /* not all of it is in the area */
    run_cycle();
    put_pointer((uintptr_t)at(APP_AREA_CODE, 0)); /* not written, or this test would fault */
    run_cycle();
    CHECK_EQUAL(check(&place), MONITORING_ERR_OPERATION_DENIED);
    CHECK_EQUAL(AppGetState(), AS_RUN);
    ForceEnd(&place);
    CHECK_EQUAL(ForceGetCount(), 0);
}

static void a_stopped_program_has_safe_outputs_and_after_the_start_forced_ones(void)
{
    begin_program();
    load();
    CHECK_EQUAL(force(APP_AREA_OUTPUT, 0, 1, 0x77), MONITORING_ERR_OK);
    run_cycle();
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(*at(APP_AREA_OUTPUT, 0), 0);
    CHECK_EQUAL(force(APP_AREA_OUTPUT, 1, 1, 0x78), MONITORING_ERR_OK);
    CHECK_EQUAL(*at(APP_AREA_OUTPUT, 1), 0);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    run_cycle();
    CHECK_EQUAL(*at(APP_AREA_OUTPUT, 0), 0x77);
    CHECK_EQUAL(*at(APP_AREA_OUTPUT, 1), 0x78);
}

static void an_exception_leaves_safe_outputs(void)
{
    begin_program();
    spec.code_size--; /* the return */
    emit_divide_by_zero(&spec);
    emit_ret(&spec);
    load();
    CHECK_EQUAL(force(APP_AREA_OUTPUT, 0, 1, 0x77), MONITORING_ERR_OK);
    run_cycle();
    CHECK_EQUAL(CMCallHook(CH_COMM_CYCLE), ERR_OK);
    CHECK_EQUAL(AppGetState(), AS_STOP);
    CHECK_EQUAL(*at(APP_AREA_OUTPUT, 0), 0);
    CHECK_EQUAL(ForceGetCount(), 1);
}

static void forces_end_with_the_variables(void)
{
    begin_program();
    for (RTS_UI32 option = RESET_OPTION_WARM; option <= RESET_OPTION_ORIGIN; option++) {
        load();
        CHECK_EQUAL(force(APP_AREA_DATA, 0, 4, 1), MONITORING_ERR_OK);
        CHECK_EQUAL(AppReset(option), ERR_OK);
        CHECK_EQUAL(ForceGetCount(), 0);
    }
    load();
    CHECK_EQUAL(force(APP_AREA_DATA, 0, 4, 1), MONITORING_ERR_OK);
    load(); /* a download */
    CHECK_EQUAL(ForceGetCount(), 0);
    CHECK_EQUAL(force(APP_AREA_DATA, 0, 4, 1), MONITORING_ERR_OK);
    CHECK_EQUAL(AppReload(), ERR_OK);
    CHECK_EQUAL(ForceGetCount(), 0);
    CHECK_EQUAL(force(APP_AREA_DATA, 0, 4, 1), MONITORING_ERR_OK);
    SimStop();
    CHECK_EQUAL(SimStart(), ERR_OK); /* power off and on */
    CHECK_EQUAL(ForceGetCount(), 0);
    CHECK_EQUAL(CyclePhasesGet(), 0);
}

static void phases_are_there_only_while_something_is_forced(void)
{
    begin_program();
    load();
    for (RTS_UI32 i = 0; i < 3 * CYCLE_MAX_PHASES; i++) {
        CHECK_EQUAL(CyclePhasesGet(), 0);
        CHECK_EQUAL(force(APP_AREA_DATA, 0, 4, i), MONITORING_ERR_OK);
        CHECK_EQUAL(force(APP_AREA_DATA, 4, 4, i), MONITORING_ERR_OK);
        CHECK(CyclePhasesGet() != 0);
        end(APP_AREA_DATA, 0, 4);
        CHECK(CyclePhasesGet() != 0);
        run_cycle();
        CHECK_EQUAL(read_u32(APP_AREA_DATA, 4), i);
        ForceEndAll();
    }
    CHECK_EQUAL(CyclePhasesGet(), 0);
    for (RTS_UI32 i = 0; i < CYCLE_MAX_PHASES; i++) /* forces took no place of those that stay */
        CHECK_EQUAL(CyclePhaseRegister(CYCLE_RECORD, NULL), ERR_OK);
}

static void a_full_list_takes_new_values_of_what_it_has(void)
{
    RTS_UI32 serial;

    begin_program();
    spec.areas[APP_AREA_DATA] = 64 + FORCE_MAX;
    load();
    for (RTS_UI32 i = 0; i < FORCE_MAX; i++)
        CHECK_EQUAL(force(APP_AREA_DATA, 64 + i, 1, i), MONITORING_ERR_OK);
    CHECK_EQUAL(force(APP_AREA_DATA, 12, 1, 1), MONITORING_ERR_FORCE_FAILED);
    serial = ForceGetSerial();
    CHECK_EQUAL(force(APP_AREA_DATA, 64, 1, 0x99), MONITORING_ERR_OK);
    CHECK(ForceGetSerial() != serial);
    CHECK_EQUAL(ForceGetCount(), FORCE_MAX);
    run_cycle();
    CHECK_EQUAL(*at(APP_AREA_DATA, 64), 0x99);
    CHECK_EQUAL(*at(APP_AREA_DATA, 65), 1);
    CHECK_EQUAL(*at(APP_AREA_DATA, 64 + FORCE_MAX - 1), (RTS_UI8)(FORCE_MAX - 1));
    CHECK(ForceGet(FORCE_MAX) == NULL);
    CHECK_EQUAL(ForceGet(FORCE_MAX - 1)->place.offset[0], 64);
}

static void of_two_that_overlap_the_last_one_holds(void)
{
    begin_program();
    load();
    CHECK_EQUAL(force(APP_AREA_DATA, 16, 1, 0x11), MONITORING_ERR_OK);
    CHECK_EQUAL(force(APP_AREA_DATA, 16, 4, 0x22222222), MONITORING_ERR_OK);
    run_cycle();
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 16), 0x22222222);
    CHECK_EQUAL(force(APP_AREA_DATA, 16, 1, 0x33), MONITORING_ERR_OK);
    run_cycle();
    CHECK_EQUAL(read_u32(APP_AREA_DATA, 16), 0x22222233);
}

/* Values of all sizes, as many as `count` of 4 bytes, one that is reached by way of a pointer, and ones that overlap. */
static void force_mixed(RTS_UI32 count)
{
    APP_PLACE by_pointer = place_of(APP_AREA_DATA, POINTER_AT, 2);
    RTS_UI32 i;

    by_pointer.pointers = 1;
    begin_program();
    load();
    put_pointer((uintptr_t)at(APP_AREA_RETAIN, 4));
    CHECK_EQUAL(force(APP_AREA_RETAIN, 0, 1, 0x11), MONITORING_ERR_OK);
    for (i = 0; i < count; i++)
        CHECK_EQUAL(force(APP_AREA_DATA, 4 + 4 * i, 4, 1000 + i), MONITORING_ERR_OK);
    CHECK_EQUAL(force(APP_AREA_RETAIN, 8, 8, 0x0102030405060708), MONITORING_ERR_OK);
    CHECK_EQUAL(force(APP_AREA_RETAIN, 2, 2, 0x2233), MONITORING_ERR_OK);
    CHECK_EQUAL(set(&by_pointer, 0x4455), MONITORING_ERR_OK);
    CHECK_EQUAL(force(APP_AREA_RETAIN, 5, 1, 0x66), MONITORING_ERR_OK); /* after what the pointer leads to */
    memset(at(APP_AREA_RETAIN, 0), 0xEE, 16);
    memset(at(APP_AREA_DATA, 4), 0xEE, 4 * count);
    run_cycle();
    for (i = 1; i < count; i++)
        CHECK_EQUAL(read_u32(APP_AREA_DATA, 4 + 4 * i), 1000 + i);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, 0), 0x2233EE11);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, 4), 0xEEEE6655);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, 8), 0x05060708);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, 12), 0x01020304);
}

static void values_of_all_sizes_are_forced_together(void)
{
    for (RTS_UI32 count = 0; count <= 4; count++)
        force_mixed(count);
}

static void what_cannot_be_forced_is_refused(void)
{
    APP_PLACE place = place_of(APP_AREA_DATA, 0, 2);

    begin_program();
    load();
    CHECK_EQUAL(force(APP_AREA_CODE, 0, 4, 1), MONITORING_ERR_OPERATION_DENIED);
    CHECK_EQUAL(force(APP_AREA_COUNT, 0, 4, 1), MONITORING_ERR_INVALID_AREA);
    CHECK_EQUAL(force(0xFF, 0, 4, 1), MONITORING_ERR_INVALID_AREA);
    CHECK_EQUAL(force(APP_AREA_DATA, 64, 1, 1), MONITORING_ERR_INVALID_INDEX);
    CHECK_EQUAL(force(APP_AREA_DATA, 61, 4, 1), MONITORING_ERR_INVALID_INDEX);
    CHECK_EQUAL(force(APP_AREA_DATA, 0xFFFFFFFF, 8, 1), MONITORING_ERR_INVALID_INDEX);
    for (RTS_UI32 size = 0; size <= 0xFF; size++)
        if (size != 1 && size != 2 && size != 4 && size != 8)
            CHECK_EQUAL(force(APP_AREA_DATA, 0, (RTS_UI8)size, 1), MONITORING_ERR_UNSUPPORTED_DATATYPE);
    place.mask = 1;
    CHECK_EQUAL(check(&place), MONITORING_ERR_UNSUPPORTED_DATATYPE);
    CHECK_EQUAL(ForceGetCount(), 0);
}

static void the_status_says_that_something_is_forced(void)
{
    APP_STATUS status;

    begin_program();
    load();
    AppGetStatus(&status);
    CHECK_EQUAL(status.op_state & OS_FORCE_ACTIVE, 0);
    CHECK_EQUAL(force(APP_AREA_DATA, 0, 4, 1), MONITORING_ERR_OK);
    AppGetStatus(&status);
    CHECK_EQUAL(status.op_state & OS_FORCE_ACTIVE, OS_FORCE_ACTIVE);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_forced_variable_is_what_the_program_reads_and_leaves);
    RUN(a_value_of_each_size_leaves_what_is_around_it);
    RUN(forced_bits_leave_the_others_to_the_program);
    RUN(inputs_and_outputs_that_a_task_has_alone_are_forced);
    RUN(inputs_and_outputs_that_tasks_have_copies_of_are_forced);
    RUN(what_no_task_has_a_copy_of_is_forced_where_all_see_it);
    RUN(what_tasks_have_copies_of_since_an_online_change_stays_forced);
    RUN(a_pointer_is_followed_in_each_cycle);
    RUN(a_stopped_program_has_safe_outputs_and_after_the_start_forced_ones);
    RUN(an_exception_leaves_safe_outputs);
    RUN(forces_end_with_the_variables);
    RUN(phases_are_there_only_while_something_is_forced);
    RUN(a_full_list_takes_new_values_of_what_it_has);
    RUN(of_two_that_overlap_the_last_one_holds);
    RUN(values_of_all_sizes_are_forced_together);
    RUN(what_cannot_be_forced_is_refused);
    RUN(the_status_says_that_something_is_forced);
    return test_result();
}
