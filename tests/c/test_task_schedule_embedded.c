/*
 * test_task_schedule_embedded.c - tasks in a super loop. The simulator makes a pass of it every 10 ms.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpScheduleTimer.h"
#include "counting_tasks.h"

enum { ORDER_OFFSET = 16, EVENT_OFFSET = 60 };

static IEC_TASK_INFO info_of(RTS_UI32 task)
{
    IEC_TASK_INFO info;

    CHECK(IecTaskGetInfo(task, &info) == ERR_OK);
    return info;
}

static void every_cyclic_task_has_its_own_interval(void)
{
    begin();
    add_counting_task("A", KIND_CYCLIC, 10000);
    add_counting_task("B", KIND_CYCLIC, 30000);
    load();
    CHECK(SimAdvance(ms(3000)) == ERR_OK);
    CHECK(count_of(0) == 301);
    CHECK(count_of(1) == 101);
    CHECK(info_of(0).overruns == 0);
    CHECK(info_of(0).jitter_us == 0);
}

static void a_task_that_waits_for_the_loop_is_late_and_keeps_its_rate(void)
{
    begin();
    add_counting_task("Odd", KIND_CYCLIC, 15000);
    load();
    CHECK(SimAdvance(ms(3000)) == ERR_OK);
    CHECK(count_of(0) == 201);
    CHECK(info_of(0).jitter_us == 5000);
}

static void due_times_the_loop_was_too_slow_for_are_overruns(void)
{
    begin();
    add_counting_task("Fast", KIND_CYCLIC, 2000);
    load();
    CHECK(SimAdvance(ms(1000)) == ERR_OK);
    CHECK(count_of(0) >= 100 && count_of(0) <= 102);
    CHECK(info_of(0).jitter_us <= 10000);
}

static void the_highest_priority_runs_first(void)
{
    begin();
    add_task(&spec, "Low", KIND_CYCLIC, 10000, here(&spec))->priority = 20;
    emit_add(&spec, APP_AREA_DATA, ORDER_OFFSET, 1);
    emit_ret(&spec);
    add_task(&spec, "High", KIND_FREEWHEELING, 0, here(&spec))->priority = 3;
    emit_set(&spec, APP_AREA_DATA, ORDER_OFFSET, 10);
    emit_ret(&spec);
    add_task(&spec, "Middle", KIND_CYCLIC, 10000, here(&spec))->priority = 10;
    emit_add(&spec, APP_AREA_DATA, ORDER_OFFSET, 100);
    emit_ret(&spec);
    load();
    CHECK(SimCommCycle() == ERR_OK);
    CHECK(read_u32(APP_AREA_DATA, ORDER_OFFSET) == 111);
}

static void an_event_task_runs_once_per_rising_edge(void)
{
    CDL_TASK *task;

    begin();
    task = add_counting_task("Event", KIND_EVENT, 0);
    task->event_area = APP_AREA_DATA;
    task->event_offset = EVENT_OFFSET;
    load();
    CHECK(SimAdvance(ms(50)) == ERR_OK);
    CHECK(count_of(0) == 0);
    *AppGetAreaAddress(APP_AREA_DATA, EVENT_OFFSET, 1) = 1;
    CHECK(SimAdvance(ms(50)) == ERR_OK);
    CHECK(count_of(0) == 1);
}

static void stopped_tasks_stay_stopped_and_start_again(void)
{
    RTS_UI32 before;

    begin();
    add_counting_task("A", KIND_CYCLIC, 10000);
    load();
    CHECK(SimAdvance(ms(100)) == ERR_OK);
    CHECK(AppStopApplication() == ERR_OK);
    before = count_of(0);
    CHECK(SimAdvance(ms(1000)) == ERR_OK);
    CHECK(count_of(0) == before);
    CHECK(AppStartApplication() == ERR_OK);
    CHECK(SimCommCycle() == ERR_OK);
    CHECK(SimAdvance(ms(100)) == ERR_OK);
    CHECK(count_of(0) >= before + 10 && count_of(0) <= before + 12);
    CHECK(info_of(0).overruns == 0); /* the time it stood still was not missed */
}

static void an_exception_ends_all_tasks(void)
{
    APP_STATUS status;
    RTS_UI32 before;

    begin();
    add_counting_task("A", KIND_CYCLIC, 10000);
    add_task(&spec, "Bad", KIND_CYCLIC, 50000, here(&spec));
    emit_divide_by_zero(&spec);
    load();
    CHECK(SimAdvance(ms(100)) == ERR_OK);
    AppGetStatus(&status);
    CHECK((status.op_state & OS_EXCEPTION) != 0);
    CHECK(status.exception.task == 1);
    before = count_of(0);
    CHECK(SimAdvance(ms(100)) == ERR_OK);
    CHECK(count_of(0) == before);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(every_cyclic_task_has_its_own_interval);
    RUN(a_task_that_waits_for_the_loop_is_late_and_keeps_its_rate);
    RUN(due_times_the_loop_was_too_slow_for_are_overruns);
    RUN(the_highest_priority_runs_first);
    RUN(an_event_task_runs_once_per_rising_edge);
    RUN(stopped_tasks_stay_stopped_and_start_again);
    RUN(an_exception_ends_all_tasks);
    return test_result();
}
