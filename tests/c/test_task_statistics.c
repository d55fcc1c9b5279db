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

int main(void)
{
    NEEDS_X86_64;
    RUN(the_load_counts_tasks_of_every_kind_over_the_time_since_their_start);
    RUN(the_average_starts_again_when_the_count_does);
    return test_result();
}
