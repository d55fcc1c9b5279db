/*
 * CmpMemPool.h - pools of equal blocks over static memory. Manual 3.11.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * From main only.
 */
#ifndef CMPMEMPOOL_H
#define CMPMEMPOOL_H

#include "CmpErrors.h"
#include "CmpStd.h"

typedef struct {
    RTS_UI8 *memory;
    RTS_UI32 block_size; /* bytes, a multiple of MEMPOOL_ALIGN */
    RTS_UI32 count;
    RTS_UI32 used;
    RTS_UI32 most_used;
    void *free; /* list of free blocks, linked through their first word */
} MEM_POOL;

enum { MEMPOOL_ALIGN = sizeof(RTS_I64) };

/* Makes a pool of size / block_size blocks; block_size is rounded up to MEMPOOL_ALIGN. `memory` is aligned to it
 * (ERR_ALIGNMENT). ERR_NOMEMORY when not even one block fits. */
RTS_RESULT MemPoolCreateStatic(MEM_POOL *pool, void *memory, RTS_UI32 size, RTS_UI32 block_size);

/* A block with undefined content, NULL when all are in use. */
void *MemPoolGetBlock(MEM_POOL *pool);

/* Gives a block back. ERR_PARAMETER when it is not a block of this pool, ERR_DUPLICATE when it is free already. */
RTS_RESULT MemPoolPutBlock(MEM_POOL *pool, void *block);

#endif
