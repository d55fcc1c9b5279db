/*
 * SimMemory.c - memory that is at two addresses, on Linux and macOS.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <sys/mman.h>
#include <unistd.h>

#include "sim_port.h"

static RTS_UI8 *map(int file, RTS_UI32 size)
{
    void *memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);

    return memory == MAP_FAILED ? NULL : memory;
}

#ifdef __APPLE__
/* Shared memory has to have a name, for a moment. */
static int open_memory(void)
{
    static RTS_UI32 count;
    char name[32];
    int file;

    snprintf(name, sizeof name, "/plcsim-%ld-%u", (long)getpid(), (unsigned)count++);
    file = shm_open(name, O_RDWR | O_CREAT | O_EXCL, 0600);
    if (file >= 0)
        (void)shm_unlink(name);
    return file;
}
#else
static int open_memory(void)
{
    return memfd_create("memory", MFD_CLOEXEC);
}
#endif

bool SimMapTwice(RTS_UI32 size, RTS_UI8 **first, RTS_UI8 **second)
{
    int file = open_memory();

    if (file < 0)
        return false;
    if (ftruncate(file, (off_t)size) == 0) {
        *first = map(file, size);
        *second = map(file, size);
    }
    close(file);
    return *first != NULL && *second != NULL;
}
