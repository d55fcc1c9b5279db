/*
 * test_cycle_phases.c - what components do before and after the code of a cycle, and in the safe state.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CyclePhases.h"
#include "counting_tasks.h"

enum { INPUT_VALUE = 0x5A, FORCED = 0x21, OUTPUTS_SEEN = 8 };

static char order[64];
static RTS_UI8 output_at[OUTPUTS_SEEN]; /* the first shared output, at each letter of `order` */
static RTS_UI32 tasks_seen;             /* a bit for each */

static void note(char what)
{
    RTS_SIZE length = strlen(order);

    if (length < OUTPUTS_SEEN)
        output_at[length] = *AppGetAreaAddress(APP_AREA_OUTPUT, 0, 1);
    if (length + 1 < sizeof order)
        order[length] = what;
}

static void read_inputs(RTS_UI32 task, const IEC_CONTEXT *context)
{
    RTS_UNUSED(context);
    tasks_seen |= 1u << task;
    *AppGetAreaAddress(APP_AREA_INPUT, 0, 1) = INPUT_VALUE;
    note('i');
}

static void force_input(RTS_UI32 task, const IEC_CONTEXT *context)
{
    RTS_UNUSED(task);
    CHECK_EQUAL(context->area[APP_AREA_INPUT][0], INPUT_VALUE);
    context->area[APP_AREA_INPUT][1] = FORCED;
    note('f');
}

static void force_output(RTS_UI32 task, const IEC_CONTEXT *context)
{
    RTS_UNUSED(task);
    CHECK_EQUAL(context->area[APP_AREA_OUTPUT][0], 1); /* what the code has written */
    context->area[APP_AREA_OUTPUT][0] = FORCED;
    note('F');
}

static void write_outputs(RTS_UI32 task, const IEC_CONTEXT *context)
{
    RTS_UNUSED(task);
    RTS_UNUSED(context);
    CHECK_EQUAL(*AppGetAreaAddress(APP_AREA_OUTPUT, 0, 1), FORCED);
    note('o');
}

static void record(RTS_UI32 task, const IEC_CONTEXT *context)
{
    RTS_UNUSED(task);
    CHECK(context->time_ns >= 0);
    note('r');
}

static void be_safe(RTS_UI32 task, const IEC_CONTEXT *context)
{
    RTS_UNUSED(task);
    RTS_UNUSED(context);
    CHECK_EQUAL(*AppGetAreaAddress(APP_AREA_OUTPUT, 0, 1), 0);
    note('s');
}

/* A task that sets the first output to 1 and fails when `fails`. */
static void begin_with(bool fails)
{
    RTS_UI32 entry;

    begin();
    memset(order, 0, sizeof order);
    tasks_seen = 0;
    spec.areas[APP_AREA_INPUT] = 16;
    entry = here(&spec);
    add_task(&spec, "Main", KIND_CYCLIC, 10000, entry);
    emit_add(&spec, APP_AREA_OUTPUT, 0, 1);
    if (fails)
        emit_divide_by_zero(&spec);
    emit_ret(&spec);
}

static void a_cycle_has_its_phases_in_order(void)
{
    begin_with(false);
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_RECORD, record), ERR_OK); /* whatever the order of registration */
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_OUTPUTS, write_outputs), ERR_OK);
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_INPUTS, read_inputs), ERR_OK);
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_BEFORE_CODE, force_input), ERR_OK);
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_AFTER_CODE, force_output), ERR_OK);
    load();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK(strcmp(order, "ifFor") == 0);
    CHECK_EQUAL(tasks_seen, 1);
}

static void no_more_phases_than_there_is_room_for(void)
{
    RTS_UI32 i;

    begin_with(false);
    for (i = 0; i < CYCLE_MAX_PHASES; i++)
        CHECK_EQUAL(CyclePhaseRegister(CYCLE_RECORD, record), ERR_OK);
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_RECORD, record), ERR_NOMEMORY);
    SimStop();
    CHECK_EQUAL(SimStart(), ERR_OK); /* a start forgets them */
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_RECORD, record), ERR_OK);
}

static void a_stop_enters_the_safe_state(void)
{
    begin_with(false);
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_SAFE_STATE, be_safe), ERR_OK);
    load();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(*AppGetAreaAddress(APP_AREA_OUTPUT, 0, 1), 1);
    CHECK(strcmp(order, "") == 0);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK(strcmp(order, "s") == 0);
}

static void after_code_that_failed_there_is_nothing_but_the_safe_state(void)
{
    begin_with(true);
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_INPUTS, read_inputs), ERR_OK);
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_OUTPUTS, write_outputs), ERR_OK);
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_RECORD, record), ERR_OK);
    CHECK_EQUAL(CyclePhaseRegister(CYCLE_SAFE_STATE, be_safe), ERR_OK);
    load();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK(strcmp(order, "iss") == 0); /* from the task at once, and from main when no task is in its cycle */
    CHECK(output_at[1] == 0 && output_at[2] == 0);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_cycle_has_its_phases_in_order);
    RUN(no_more_phases_than_there_is_room_for);
    RUN(a_stop_enters_the_safe_state);
    RUN(after_code_that_failed_there_is_nothing_but_the_safe_state);
    return test_result();
}
