/*
 * twin.c - runs a C twin on a Cortex-M: prints its checksum and its instructions per cycle.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <stdio.h>

#include "clock.h"

int64_t now_ms;
extern uint32_t chk;
void scan_init(void);
void scan(void);

int main(void)
{
    uint64_t instructions;

    scan_init();
    clock_start();
    for (int i = 0; i < CYCLES; i++) {
        scan();
        now_ms++;
    }
    instructions = clock_instructions();
    printf("%lu %lu\n", (unsigned long)chk, (unsigned long)(instructions / CYCLES));
    return 0;
}
