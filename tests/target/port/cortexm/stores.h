/*
 * stores.h - how an Armv7-M writes to memory besides bytes, halves and words; for test_rights.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
static void store_two_words(void *arg)
{
    const STORE *store = arg;
    __asm__ volatile("strd %1, %1, [%0]" ::"r"(store->address), "r"(store->value) : "memory");
}

static void store_four_words(void *arg)
{
    const STORE *store = arg;
    __asm__ volatile("mov r0, %1\n\tmov r1, %1\n\tmov r2, %1\n\tmov r3, %1\n\tstmia %0, {r0-r3}" ::"r"(store->address),
                     "r"(store->value)
                     : "r0", "r1", "r2", "r3", "memory");
}

/* With the stack pointer just above it: then it is the frame of the fault that has no room. */
static void push_there(void *arg)
{
    const STORE *store = arg;
    __asm__ volatile("adds r3, %0, #4\n\tmov sp, r3\n\tpush {%1}\n\tmovs r0, #0\n\tsvc 0" ::"r"(store->address),
                     "r"(store->value)
                     : "r3", "memory");
}

static void store_by_unprivileged_instruction(void *arg)
{
    const STORE *store = arg;
    __asm__ volatile("strt %1, [%0]" ::"r"(store->address), "r"(store->value) : "memory");
}

#define OTHER_STORES store_two_words, store_by_unprivileged_instruction, store_four_words
