/*
 * test_task_schedule.c - when tasks run: cyclic by priority, event, external event, freewheeling.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpScheduleTimer.h"
#include "counting_tasks.h"

enum { ORDER_OFFSET = 16, SEEN_OFFSET = 32, EVENT_OFFSET = 60 };

static void set_event(RTS_UI8 value)
{
    *AppGetAreaAddress(APP_AREA_DATA, EVENT_OFFSET, 1) = value;
}

static void every_cyclic_task_has_its_own_interval(void)
{
    begin();
    add_counting_task("A", KIND_CYCLIC, 1000);
    add_counting_task("B", KIND_CYCLIC, 3000);
    add_counting_task("C", KIND_CYCLIC, 1000000);
    load();
    CHECK_EQUAL(SimAdvance(ms(3000)), ERR_OK);
    CHECK_EQUAL(count_of(0), 3001);
    CHECK_EQUAL(count_of(1), 1001);
    CHECK_EQUAL(count_of(2), 4);
}

/* Each task stores how often the other ran: who comes first sees one less. */
static void of_tasks_that_are_due_the_highest_priority_runs_first(void)
{
    begin();
    add_task(&spec, "Low", KIND_CYCLIC, 1000, here(&spec))->priority = 20;
    emit_add(&spec, APP_AREA_DATA, ORDER_OFFSET, 1); /* order += 1 */
    emit_ret(&spec);
    add_task(&spec, "High", KIND_CYCLIC, 1000, here(&spec))->priority = 3;
    emit_set(&spec, APP_AREA_DATA, ORDER_OFFSET, 10); /* order := 10 */
    emit_ret(&spec);
    load();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, ORDER_OFFSET), 11);
}

static CDL_TASK *add_event_task(void)
{
    CDL_TASK *task = add_counting_task("Event", KIND_EVENT, 0);

    task->event_area = APP_AREA_DATA;
    task->event_offset = EVENT_OFFSET;
    return task;
}

static void an_event_task_runs_once_per_rising_edge(void)
{
    begin();
    add_event_task();
    load();
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(count_of(0), 0);
    set_event(1);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(count_of(0), 1);
    set_event(0);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(count_of(0), 1);
    set_event(1);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(count_of(0), 2);
}

static void an_event_that_is_true_at_the_start_is_no_edge(void)
{
    begin();
    add_event_task();
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    set_event(1);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(count_of(0), 0);
}

static void an_edge_counts_however_short_the_variable_was_clear_between_cycles(void)
{
    begin();
    add_event_task();
    add_task(&spec, "Set", KIND_CYCLIC, 1000, here(&spec));
    emit_set(&spec, APP_AREA_DATA, EVENT_OFFSET, 1);
    emit_ret(&spec);
    add_task(&spec, "Clear", KIND_CYCLIC, 1000, here(&spec))->priority = 3; /* before Set, in each cycle */
    emit_set(&spec, APP_AREA_DATA, EVENT_OFFSET, 0);
    emit_ret(&spec);
    load();
    CHECK_EQUAL(SimAdvance(ms(9)), ERR_OK);
    CHECK_EQUAL(count_of(0), 10); /* though it is TRUE whenever time passes */
}

static void what_one_cycle_sets_and_clears_is_no_edge(void)
{
    begin();
    add_event_task();
    add_task(&spec, "Pulse", KIND_CYCLIC, 1000, here(&spec));
    emit_set(&spec, APP_AREA_DATA, EVENT_OFFSET, 1);
    emit_set(&spec, APP_AREA_DATA, EVENT_OFFSET, 0);
    emit_ret(&spec);
    load();
    CHECK_EQUAL(SimAdvance(ms(9)), ERR_OK);
    CHECK_EQUAL(count_of(0), 0);
}

static void an_event_task_runs_as_soon_as_the_cycle_that_set_its_variable_is_over(void)
{
    begin();
    add_task(&spec, "Event", KIND_EVENT, 0, here(&spec))->event_area = APP_AREA_DATA;
    spec.tasks[0].event_offset = EVENT_OFFSET;
    spec.tasks[0].priority = 0;
    emit_add(&spec, APP_AREA_DATA, ORDER_OFFSET, 1); /* order += 1 */
    emit_ret(&spec);
    add_task(&spec, "Set", KIND_CYCLIC, 1000, here(&spec))->priority = 3;
    emit_set(&spec, APP_AREA_DATA, EVENT_OFFSET, 1);
    emit_set(&spec, APP_AREA_DATA, ORDER_OFFSET, 10); /* order := 10 */
    emit_ret(&spec);
    add_task(&spec, "Later", KIND_CYCLIC, 1000, here(&spec))->priority = 4;
    emit_add(&spec, APP_AREA_DATA, ORDER_OFFSET, 100);
    emit_ret(&spec);
    load();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, ORDER_OFFSET), 111);
}

/* Though Set takes 2 ms, what was due with it comes by priority. */
static void an_event_task_takes_its_turn_by_priority(void)
{
    static const RTS_UI8 priority[2] = {20, 6};
    enum { BY_EVENT = 1, BY_OTHER = 2 };
    RTS_UI32 i;

    for (i = 0; i < 2; i++) {
        begin();
        add_event_task()->priority = priority[i];
        spec.tasks[0].entry_offset = here(&spec);
        emit_set(&spec, APP_AREA_DATA, ORDER_OFFSET, BY_EVENT);
        emit_ret(&spec);
        add_import(&spec, "simburn", 0x76DDCD81, 0x00010000);
        add_task(&spec, "Set", KIND_CYCLIC, 10000, here(&spec))->priority = 3;
        emit_set(&spec, APP_AREA_DATA, EVENT_OFFSET, 1);
        emit_call(&spec, 0, 2000);
        emit_ret(&spec);
        add_task(&spec, "Other", KIND_CYCLIC, 10000, here(&spec))->priority = 10;
        emit_set(&spec, APP_AREA_DATA, ORDER_OFFSET, BY_OTHER);
        emit_ret(&spec);
        load();
        CHECK_EQUAL(SimAdvance(0), ERR_OK);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, ORDER_OFFSET), (i == 0 ? BY_EVENT : BY_OTHER)); /* who came last */
    }
}

static void an_event_may_be_one_bit_of_a_byte(void)
{
    begin();
    add_event_task()->event_ignored = 0xFF ^ 1 << 3;
    load();
    set_event(0xF7);
    CHECK_EQUAL(SimAdvance(ms(1)), ERR_OK);
    CHECK_EQUAL(count_of(0), 0);
    set_event(0x08);
    CHECK_EQUAL(SimAdvance(ms(1)), ERR_OK);
    CHECK_EQUAL(count_of(0), 1);
    set_event(0xFF); /* it stays as it is */
    CHECK_EQUAL(SimAdvance(ms(1)), ERR_OK);
    CHECK_EQUAL(count_of(0), 1);
}

static void several_tasks_may_wait_for_one_variable(void)
{
    begin();
    add_event_task();
    add_event_task()->priority = 5;
    load();
    set_event(1);
    CHECK_EQUAL(SimAdvance(ms(1)), ERR_OK);
    CHECK(count_of(0) == 1 && count_of(1) == 1);
}

static void an_edge_of_one_interval_is_not_missed(void)
{
    begin();
    add_event_task();
    add_task(&spec, "Set", KIND_CYCLIC, 2000, here(&spec))->priority = 3;
    emit_set(&spec, APP_AREA_DATA, EVENT_OFFSET, 1);
    emit_ret(&spec);
    add_task(&spec, "Clear", KIND_CYCLIC, 3000, here(&spec));
    emit_set(&spec, APP_AREA_DATA, EVENT_OFFSET, 0);
    emit_ret(&spec);
    load();
    CHECK_EQUAL(SimAdvance(ms(11)), ERR_OK); /* set at 0 2 4 6 8 10, cleared after it at 0 3 6 9: edges at 0 2 4 8 10 */
    CHECK_EQUAL(count_of(0), 5);
}

static void freewheeling_tasks_run_again_after_a_pause(void)
{
    begin();
    add_counting_task("Free", KIND_FREEWHEELING, 0);
    load();
    CHECK_EQUAL(SimAdvance(ms(1000)), ERR_OK);
    CHECK_EQUAL(count_of(0), 1001);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(count_of(0), 1001);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(1)), ERR_OK);
    CHECK_EQUAL(count_of(0), 1003);
}

/* Cycles of 50 ms and pauses of a fifth of it: a task below, of the same processor, has its share. */
static void a_freewheeling_task_pauses_for_a_fifth_of_its_cycle(void)
{
    begin();
    add_import(&spec, "simburn", 0x76DDCD81, 0x00010000);
    add_task(&spec, "Free", KIND_FREEWHEELING, 0, here(&spec))->priority = 0;
    emit_call(&spec, 0, 50000);
    emit_add(&spec, APP_AREA_DATA, 0, 1);
    emit_ret(&spec);
    add_counting_task("Below", KIND_CYCLIC, 10000);
    load();
    CHECK_EQUAL(SimAdvance(ms(60) * 20), ERR_OK);
    CHECK(count_of(0) >= 20 && count_of(0) <= 21);
    CHECK(count_of(1) >= 20);
}

static void freewheeling_tasks_run_by_priority(void)
{
    begin();
    add_task(&spec, "Low", KIND_FREEWHEELING, 0, here(&spec))->priority = 20;
    emit_add(&spec, APP_AREA_DATA, ORDER_OFFSET, 1);
    emit_ret(&spec);
    add_task(&spec, "High", KIND_FREEWHEELING, 0, here(&spec))->priority = 3;
    emit_set(&spec, APP_AREA_DATA, ORDER_OFFSET, 10);
    emit_ret(&spec);
    add_task(&spec, "Middle", KIND_FREEWHEELING, 0, here(&spec))->priority = 10;
    emit_add(&spec, APP_AREA_DATA, ORDER_OFFSET, 100);
    emit_ret(&spec);
    load();
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, ORDER_OFFSET), 111);
}

static CDL_TASK *add_external_task(const char *name, const char *event)
{
    CDL_TASK *task = add_counting_task(name, KIND_EXTERNAL, 0);

    task->event_offset = CRC32Update(0, event, strlen(event));
    return task;
}

static void an_external_event_runs_its_task_once_per_post(void)
{
    RTS_RESULT result = ERR_FAILED;
    RTS_HANDLE event;

    begin();
    add_external_task("Pulse", "pulse");
    event = SchedRegisterExternalEvent("pulse", &result);
    CHECK_EQUAL(result, ERR_OK);
    CHECK_EQUAL(SchedPostExternalEvent(event), ERR_OK); /* before the start: does not count */
    load();
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(count_of(0), 0);
    CHECK_EQUAL(SchedPostExternalEvent(event), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(count_of(0), 1);
    CHECK_EQUAL(SchedPostExternalEvent(event), ERR_OK);
    CHECK_EQUAL(SchedPostExternalEvent(event), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(count_of(0), 3);
    CHECK_EQUAL(SchedUnregisterExternalEvent(event), ERR_OK);
    CHECK_EQUAL(SchedPostExternalEvent(event), ERR_INVALID_HANDLE);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(count_of(0), 3);
}

static void external_events_are_limited_and_unique(void)
{
    char name[] = "a";
    RTS_RESULT result = ERR_OK;
    RTS_HANDLE event;
    int i;

    begin();
    for (i = 0; i < SCHED_MAX_EXTERNAL_EVENTS; i++, name[0]++)
        event = SchedRegisterExternalEvent(name, NULL);
    CHECK_EQUAL(SchedRegisterExternalEvent("a", &result), RTS_INVALID_HANDLE);
    CHECK_EQUAL(result, ERR_DUPLICATE);
    CHECK_EQUAL(SchedRegisterExternalEvent(name, &result), RTS_INVALID_HANDLE);
    CHECK_EQUAL(result, ERR_NOMEMORY);
    CHECK_EQUAL(SchedUnregisterExternalEvent(event), ERR_OK);
    CHECK_EQUAL(SchedUnregisterExternalEvent(event), ERR_INVALID_HANDLE);
    CHECK_EQUAL(SchedUnregisterExternalEvent(99), ERR_INVALID_HANDLE);
    CHECK_EQUAL(SchedPostExternalEvent(RTS_INVALID_HANDLE), ERR_INVALID_HANDLE);
    CHECK(SchedRegisterExternalEvent(name, &result) != RTS_INVALID_HANDLE);
    CHECK_EQUAL(result, ERR_OK);
}

static void posts_beyond_what_may_wait_are_lost_and_counted(void)
{
    IEC_TASK_INFO info;
    RTS_UI32 i;

    begin();
    add_external_task("One", "pulse");
    add_external_task("Other", "pulse");
    CHECK_EQUAL(SimAddEvent("pulse"), ERR_OK);
    load();
    for (i = 0; i < SCHED_MAX_WAITING_EVENTS + 7; i++)
        CHECK_EQUAL(SimPostEvent("pulse"), ERR_OK);
    CHECK_EQUAL(SimPostEvent("other"), ERR_NO_OBJECT);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK(count_of(0) == SCHED_MAX_WAITING_EVENTS && count_of(1) == SCHED_MAX_WAITING_EVENTS);
    CHECK(IecTaskGetInfo(0, &info) == ERR_OK && info.overruns == 7);
    CHECK_EQUAL(SimPostEvent("pulse"), ERR_OK);
    CHECK_EQUAL(SimAdvance(0), ERR_OK);
    CHECK_EQUAL(count_of(0), SCHED_MAX_WAITING_EVENTS + 1);
    CHECK(IecTaskGetInfo(0, &info) == ERR_OK && info.overruns == 7);
    SimForgetEvents();
}

static void a_program_that_waits_for_an_unknown_event_is_refused(void)
{
    begin();
    add_external_task("Pulse", "pulse");
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_NO_OBJECT);
    CHECK_EQUAL(SimAddEvent("pulse"), ERR_OK);
    CHECK_EQUAL(download(&image), ERR_OK);
    SimForgetEvents();
}

static void as_many_tasks_as_the_device_can_run(void)
{
    char name[] = "Task_";
    RTS_UI32 i;

    begin();
    spec.areas[APP_AREA_DATA] = 4 * APP_MAX_TASKS;
    for (i = 0; i < APP_MAX_TASKS; i++) {
        name[4] = (char)('a' + i);
        add_counting_task(name, KIND_CYCLIC, 1000 * (i + 1));
    }
    load();
    CHECK_EQUAL(SimAdvance(ms(720)), ERR_OK);
    for (i = 0; i < APP_MAX_TASKS; i++)
        CHECK_EQUAL(count_of(i), 720 / (i + 1) + 1);
}

static void downloads_free_the_timers_of_the_tasks_before(void)
{
    RTS_UI32 i;

    begin();
    for (i = 0; i < APP_MAX_TASKS; i++)
        add_task(&spec, "Task", KIND_CYCLIC, 1000, 0);
    emit_ret(&spec);
    for (i = 0; i < 10; i++)
        load();
    CHECK_EQUAL(IecTaskGetCount(), APP_MAX_TASKS);
}

static void run_cycles_counts_cycles_of_the_first_task(void)
{
    begin();
    add_counting_task("A", KIND_CYCLIC, 7000);
    add_counting_task("B", KIND_CYCLIC, 1000);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(SimRunCycles(1), ERR_INVALID_STATE);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimRunCycles(1), ERR_OK);
    CHECK_EQUAL(SimNow(), 0);
    CHECK_EQUAL(SimRunCycles(100), ERR_OK);
    CHECK_EQUAL(count_of(0), 101);
    CHECK_EQUAL(SimNow(), ms(700));
    CHECK_EQUAL(count_of(1), 701);
    CHECK_EQUAL(SimRunCycles(0), ERR_OK);
    CHECK_EQUAL(SimNow(), ms(700));
}

static void run_cycles_gives_up_on_a_task_that_never_runs(void)
{
    begin();
    add_event_task();
    load();
    CHECK_EQUAL(SimRunCycles(1), ERR_TIMEOUT);
}

static void run_cycles_works_for_freewheeling_tasks(void)
{
    begin();
    add_counting_task("Free", KIND_FREEWHEELING, 0);
    load();
    CHECK_EQUAL(SimRunCycles(50), ERR_OK);
    CHECK_EQUAL(count_of(0), 50);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(every_cyclic_task_has_its_own_interval);
    RUN(of_tasks_that_are_due_the_highest_priority_runs_first);
    RUN(an_event_task_runs_once_per_rising_edge);
    RUN(an_event_that_is_true_at_the_start_is_no_edge);
    RUN(an_edge_counts_however_short_the_variable_was_clear_between_cycles);
    RUN(what_one_cycle_sets_and_clears_is_no_edge);
    RUN(an_event_task_runs_as_soon_as_the_cycle_that_set_its_variable_is_over);
    RUN(an_event_task_takes_its_turn_by_priority);
    RUN(an_event_may_be_one_bit_of_a_byte);
    RUN(several_tasks_may_wait_for_one_variable);
    RUN(an_edge_of_one_interval_is_not_missed);
    RUN(freewheeling_tasks_run_again_after_a_pause);
    RUN(a_freewheeling_task_pauses_for_a_fifth_of_its_cycle);
    RUN(freewheeling_tasks_run_by_priority);
    RUN(an_external_event_runs_its_task_once_per_post);
    RUN(external_events_are_limited_and_unique);
    RUN(posts_beyond_what_may_wait_are_lost_and_counted);
    RUN(a_program_that_waits_for_an_unknown_event_is_refused);
    RUN(as_many_tasks_as_the_device_can_run);
    RUN(downloads_free_the_timers_of_the_tasks_before);
    RUN(run_cycles_counts_cycles_of_the_first_task);
    RUN(run_cycles_gives_up_on_a_task_that_never_runs);
    RUN(run_cycles_works_for_freewheeling_tasks);
    return test_result();
}
