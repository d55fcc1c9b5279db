/*
 * sys/mman.h - mappings of memory on Windows, for the files of the simulator that are the same on all systems.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Only what SysMem.c and SimFlash.c call: memory that is reserved first and accessible later, and memory with code. No
 * process forks here, so all memory is that of one process.
 */
#ifndef WINDOWS_MMAN_H
#define WINDOWS_MMAN_H

#include <stddef.h>

enum { PROT_NONE = 0, PROT_READ = 1, PROT_WRITE = 2, PROT_EXEC = 4 };
enum { MAP_SHARED = 1, MAP_PRIVATE = 2, MAP_ANONYMOUS = 4, MAP_NORESERVE = 8 };

#define MAP_FAILED ((void *)-1)

/* Anonymous memory, anywhere. MAP_FAILED when there is no room. */
void *mmap(void *address, size_t size, int access, int flags, int file, long offset);
/* 0, or -1. */
int mprotect(void *address, size_t size, int access);
int munmap(void *address, size_t size);

#endif
