/*
 * CmpMemPool.c - pools of equal blocks over static memory.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpMemPool.h"

#include <string.h>

/* The link to the next free block is its first word; copied, because a block has no type. */
static void *next_of(const void *block)
{
    void *next;

    memcpy(&next, block, sizeof next);
    return next;
}

static void push(MEM_POOL *pool, void *block)
{
    memcpy(block, &pool->free, sizeof pool->free);
    pool->free = block;
}

RTS_RESULT MemPoolCreateStatic(MEM_POOL *pool, void *memory, RTS_UI32 size, RTS_UI32 block_size)
{
    RTS_UI32 i;

    if ((uintptr_t)memory % MEMPOOL_ALIGN != 0)
        return ERR_ALIGNMENT;
    if (block_size == 0 || block_size > size)
        return ERR_NOMEMORY;
    pool->block_size = (block_size + MEMPOOL_ALIGN - 1) / MEMPOOL_ALIGN * MEMPOOL_ALIGN;
    pool->count = size / pool->block_size;
    pool->memory = memory;
    pool->used = 0;
    pool->most_used = 0;
    pool->free = NULL;
    for (i = pool->count; i > 0; i--)
        push(pool, pool->memory + (RTS_SIZE)(i - 1) * pool->block_size);
    return pool->count > 0 ? ERR_OK : ERR_NOMEMORY;
}

void *MemPoolGetBlock(MEM_POOL *pool)
{
    void *block = pool->free;

    if (block == NULL)
        return NULL;
    pool->free = next_of(block);
    pool->used++;
    if (pool->used > pool->most_used)
        pool->most_used = pool->used;
    return block;
}

static bool is_block(const MEM_POOL *pool, const void *block)
{
    uintptr_t offset = (uintptr_t)block - (uintptr_t)pool->memory;

    return offset < (uintptr_t)pool->count * pool->block_size && offset % pool->block_size == 0;
}

RTS_RESULT MemPoolPutBlock(MEM_POOL *pool, void *block)
{
    void *free;

    if (!is_block(pool, block))
        return ERR_PARAMETER;
    for (free = pool->free; free != NULL; free = next_of(free)) {
        if (free == block)
            return ERR_DUPLICATE;
    }
    push(pool, block);
    pool->used--;
    return ERR_OK;
}
