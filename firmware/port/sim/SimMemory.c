/*
 * SimMemory.c - memory that is at two addresses, on Linux.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include <sys/mman.h>
#include <unistd.h>

#include "sim_port.h"

static RTS_UI8 *map(int file, RTS_UI32 size)
{
    void *memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);

    return memory == MAP_FAILED ? NULL : memory;
}

bool SimMapTwice(RTS_UI32 size, RTS_UI8 **first, RTS_UI8 **second)
{
    int file = memfd_create("memory", MFD_CLOEXEC);

    if (file < 0)
        return false;
    if (ftruncate(file, (off_t)size) == 0) {
        *first = map(file, size);
        *second = map(file, size);
    }
    close(file);
    return *first != NULL && *second != NULL;
}
