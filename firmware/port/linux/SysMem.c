/*
 * SysMem.c - the memory of the application's areas on Linux: a mapping of its own.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Shared by the linux and the sim port. The guards cost address space only. They are wide for the sake of programs that
 * count beyond the end of an array in large steps.
 */
#define _GNU_SOURCE
#include "SysMem.h"

#include <sys/mman.h>

#define GUARD_SIZE ((size_t)(sizeof(void *) > 4 ? 256 : 64) * 1024 * 1024)

/* Sizes are rounded up to pages by the system. */
static void *map_guarded(size_t size)
{
    char *memory =
        mmap(NULL, GUARD_SIZE + size + GUARD_SIZE, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (memory == MAP_FAILED) {
        return NULL;
    }
    if (mprotect(memory + GUARD_SIZE, size, PROT_READ | PROT_WRITE) != 0) {
        munmap(memory, GUARD_SIZE + size + GUARD_SIZE);
        return NULL;
    }
    return memory + GUARD_SIZE;
}

void *SysMemAllocArea(size_t size)
{
    static void *area;
    if (area == NULL) {
        area = map_guarded(size);
    }
    return area;
}
