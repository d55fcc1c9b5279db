/*
 * mman.h - memory mapping where there is none: the simulator's flash makes code executable through it.
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
#define MAP_FAILED ((void *)-1)

void *mmap(void *where, size_t size, int protection, int flags, int file, long offset);
int mprotect(void *memory, size_t size, int protection);
int munmap(void *memory, size_t size);

#endif
