/*
 * stores.h - how a RISC-V writes to memory besides bytes, halves and words; for test_rights.c.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
static void swap_atomically(void *arg)
{
    const STORE *store = arg;
    __asm__ volatile("amoswap.w zero, %1, (%0)" ::"r"(store->address & ~3u), "r"(store->value) : "memory");
}

/* With the stack pointer just above it. */
static void push_there(void *arg)
{
    const STORE *store = arg;
    __asm__ volatile("addi sp, %0, 4\n\tsw %1, -4(sp)\n\tli a0, 0\n\tecall" ::"r"(store->address), "r"(store->value)
                     : "memory");
}

#define OTHER_STORES swap_atomically
