/*
 * test_task_statistics.c - the statistics of a task when its cycles are more than 32 bits can count.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "../../firmware/src/cycle/IecCycle.c"
#include "app_device.h"

static void the_average_starts_again_when_the_count_does(void)
{
    IEC_TASK_INFO info;

    start_with_counter(1);
    tasks.list[0].cycles = 0xFFFFFFFF - 10;
    tasks.list[0].sum_ns = (RTS_UI64)tasks.list[0].cycles * 20000;
    for (RTS_UI32 i = 0; i < 20; i++) {
        account(&tasks.list[0], 0, 20000);
        CHECK_EQUAL(IecCycleGetInfo(0, &info), ERR_OK);
        CHECK_EQUAL(info.avg_us, info.cycles == 0 ? 0 : 20);
    }
    CHECK_EQUAL(info.cycles, 9);
}

static void the_load_counts_tasks_of_every_kind_over_the_time_since_their_start(void)
{
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(1000)), ERR_OK);
    tasks.count = 3;
    tasks.list[0].sum_ns = 250 * (RTS_UI64)NS_PER_MS;
    tasks.list[1].sum_ns = 100 * (RTS_UI64)NS_PER_MS;
    tasks.list[2].sum_ns = 850 * (RTS_UI64)NS_PER_MS;
    CHECK_EQUAL(IecTaskGetLoad(), 120);
    tasks.time_started = false;
    CHECK_EQUAL(IecTaskGetLoad(), 0);
    tasks.count = 1;
    tasks.time_started = true;
}

static RTS_UI32 class_of(RTS_UI32 late_ns)
{
    IEC_LATENESS_COUNT lateness;
    RTS_UI32 number;

    account(&tasks.list[0], late_ns, 20000);
    for (number = 0; IecCycleGetLateness(0, number, &lateness) == ERR_OK && lateness.count == 0; number++) {
    }
    tasks.list[0].late[number] = 0;
    return number;
}

static void each_lateness_has_the_class_that_ends_above_it(void)
{
    static const RTS_UI32 edges[] = {0,     255,   256,     319,        320,        1000,
                                     65535, 65536, 1000000, 0x7FFFFFFF, 0xFFFFFFFE, 0xFFFFFFFF};
    IEC_LATENESS_COUNT lateness;
    IEC_LATENESS_COUNT before;

    start_with_counter(1);
    for (RTS_UI32 i = 0; i < RTS_COUNT(edges); i++) {
        RTS_UI32 number = class_of(edges[i]);
        CHECK_EQUAL(IecCycleGetLateness(0, number, &lateness), ERR_OK);
        CHECK(edges[i] < lateness.below_ns || lateness.below_ns == 0xFFFFFFFF);
        CHECK(number == 0 || IecCycleGetLateness(0, number - 1, &before) == ERR_OK);
        CHECK(number == 0 || edges[i] >= before.below_ns);
    }
    CHECK_EQUAL(class_of(0xFFFFFFFF), IEC_LATENESS_CLASSES - 1);
}

static void lateness_is_asked_of_tasks_and_classes_that_exist(void)
{
    IEC_LATENESS_COUNT lateness;

    start_with_counter(1);
    CHECK_EQUAL(IecCycleGetLateness(0, IEC_LATENESS_CLASSES, &lateness), ERR_INVALIDID);
    CHECK_EQUAL(IecCycleGetLateness(1, 0, &lateness), ERR_INVALIDID);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(the_load_counts_tasks_of_every_kind_over_the_time_since_their_start);
    RUN(the_average_starts_again_when_the_count_does);
    RUN(each_lateness_has_the_class_that_ends_above_it);
    RUN(lateness_is_asked_of_tasks_and_classes_that_exist);
    return test_result();
}
