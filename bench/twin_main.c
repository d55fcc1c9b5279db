/*
 * twin_main.c - times a C twin: prints its checksum after CYCLES cycles and the ns of one cycle, the best of several
 * batches.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { BATCHES = 10 };

int64_t now_ms;
extern uint32_t chk;
void scan_init(void);
void scan(void);

static double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static double run(long cycles)
{
    double begin = now_ns();

    for (long i = 0; i < cycles; i++) {
        scan();
        now_ms++;
    }
    return (now_ns() - begin) / (double)cycles;
}

int main(int argc, char **argv)
{
    long cycles = argc > 1 ? atol(argv[1]) : BATCHES;
    double best;

    scan_init();
    best = run(CYCLES);
    printf("%lu ", (unsigned long)chk);
    for (int batch = 0; batch < BATCHES; batch++) {
        double each = run(cycles / BATCHES);
        best = each < best ? each : best;
    }
    printf("%.2f\n", best);
    return 0;
}
