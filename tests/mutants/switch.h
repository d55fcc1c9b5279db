/*
 * switch.h - chooses the active mutant of a file that contains all of them.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef MUTANTS_SWITCH_H
#define MUTANTS_SWITCH_H

/* The number of the active mutant from the environment, 0 for none. */
extern int mutant_active;

/* A byte for each number: 1 once the mutant would have decided otherwise. Of MUTANTS_SEEN, a file that outlives a test
 * that is killed. */
extern char *mutant_seen;

/* Returns what the mutant `number` decides if it is active, else what the source does. */
static inline long mutant_pick(int number, long decided, long other)
{
    if (decided != other)
        mutant_seen[number] = 1;
    return mutant_active == number ? other : decided;
}

#endif
