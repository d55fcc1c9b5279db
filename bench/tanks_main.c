/*
 * tanks_main.c - times the C twin of the tanks example: prints ns per control cycle and plant cycle, and the checksum
 * of the levels.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Each function is called back to back after the loop has run in, as `plctool bench` does with the compiled program.
 */
#define _GNU_SOURCE
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "tanks.h"

enum { BATCHES = 9, INTERVAL_MS = 10 };

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

/* The best of several batches, in ns per call; the time of the task advances by its interval. */
static double best(void (*cycle)(int32_t), long calls)
{
    double least = 1e18;
    int32_t time_ms = 0;

    for (int batch = 0; batch < BATCHES; batch++) {
        double begin = now_ns();
        for (long i = 0; i < calls / BATCHES; i++)
            cycle(time_ms += INTERVAL_MS);
        double each = (now_ns() - begin) / (double)(calls / BATCHES);
        least = each < least ? each : least;
    }
    return least;
}

int main(int argc, char **argv)
{
    long cycles = argc > 1 ? atol(argv[1]) : 1000;
    long calls = argc > 2 ? atol(argv[2]) : 900000;

    tanks_init();
    for (long i = 0; i < cycles; i++) {
        plant_cycle((int32_t)(INTERVAL_MS * i));
        control_cycle((int32_t)(INTERVAL_MS * i));
    }
    printf("%u", tanks_checksum());
    printf(" %.2f %.2f\n", best(control_cycle, calls), best(plant_cycle, calls));
    return 0;
}
