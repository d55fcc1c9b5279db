/*
 * mman.h - memory mapping where there is none: what the simulator's flash is made of, and makes code executable with.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef HOSTED_MMAN_H
#define HOSTED_MMAN_H

#include <stddef.h>

#define PROT_READ 1
#define PROT_WRITE 2
#define PROT_EXEC 4
#define MAP_PRIVATE 1
#define MAP_ANONYMOUS 2
#define MAP_SHARED 4
#define MAP_FAILED ((void *)-1)

void *mmap(void *where, size_t size, int protection, int flags, int file, long offset);
int mprotect(void *memory, size_t size, int protection);
int munmap(void *memory, size_t size);

#define MFD_CLOEXEC 1

int memfd_create(const char *name, unsigned flags);

#endif
