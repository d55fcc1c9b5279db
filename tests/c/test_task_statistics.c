/*
 * test_task_statistics.c - the statistics of a task when its cycles are more than 32 bits can count.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "../../firmware/src/app/IecCycle.c"
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

int main(void)
{
    RUN(the_average_starts_again_when_the_count_does);
    return test_result();
}
