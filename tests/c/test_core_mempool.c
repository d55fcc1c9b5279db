/*
 * test_core_mempool.c - pools of equal blocks.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpMemPool.h"
#include "test.h"

static RTS_I64 memory[16];
static MEM_POOL pool;

static void all_blocks_can_be_taken_and_no_more(void)
{
    RTS_UI8 *block[4];
    int i;
    int k;

    CHECK(MemPoolCreateStatic(&pool, memory, sizeof memory, 32) == ERR_OK);
    CHECK(pool.count == 4);
    for (i = 0; i < 4; i++) {
        block[i] = MemPoolGetBlock(&pool);
        CHECK(block[i] != NULL);
        if (block[i] == NULL)
            return;
        memset(block[i], i, 32);
    }
    CHECK(MemPoolGetBlock(&pool) == NULL);
    CHECK(pool.used == 4);
    for (i = 0; i < 4; i++) {
        for (k = 0; k < 32; k++)
            CHECK(block[i][k] == i);
    }
}

static void a_block_given_back_can_be_taken_again(void)
{
    void *a;
    void *b;

    CHECK(MemPoolCreateStatic(&pool, memory, sizeof memory, 64) == ERR_OK);
    a = MemPoolGetBlock(&pool);
    b = MemPoolGetBlock(&pool);
    CHECK(MemPoolGetBlock(&pool) == NULL);
    CHECK(MemPoolPutBlock(&pool, a) == ERR_OK);
    CHECK(pool.used == 1);
    CHECK(MemPoolGetBlock(&pool) == a);
    CHECK(MemPoolPutBlock(&pool, b) == ERR_OK);
    CHECK(MemPoolPutBlock(&pool, a) == ERR_OK);
    CHECK(pool.used == 0);
    CHECK(pool.most_used == 2);
}

static void what_is_no_block_is_not_taken_back(void)
{
    RTS_I64 other;
    RTS_UI8 *block;

    CHECK(MemPoolCreateStatic(&pool, memory, sizeof memory, 32) == ERR_OK);
    block = MemPoolGetBlock(&pool);
    CHECK(MemPoolPutBlock(&pool, NULL) == ERR_PARAMETER);
    CHECK(MemPoolPutBlock(&pool, &other) == ERR_PARAMETER);
    CHECK(MemPoolPutBlock(&pool, block + 8) == ERR_PARAMETER);
    CHECK(MemPoolPutBlock(&pool, memory + 16) == ERR_PARAMETER);
    CHECK(MemPoolPutBlock(&pool, block) == ERR_OK);
    CHECK(MemPoolPutBlock(&pool, block) == ERR_DUPLICATE);
    CHECK(pool.used == 0);
}

static void sizes_are_rounded_up_to_the_alignment(void)
{
    CHECK(MemPoolCreateStatic(&pool, memory, sizeof memory, 1) == ERR_OK);
    CHECK(pool.block_size == MEMPOOL_ALIGN && pool.count == 16);
    CHECK(MemPoolCreateStatic(&pool, memory, sizeof memory, 9) == ERR_OK);
    CHECK(pool.block_size == 16 && pool.count == 8);
    CHECK(MemPoolCreateStatic(&pool, memory, 127, 64) == ERR_OK);
    CHECK(pool.count == 1);
}

static void impossible_pools_are_refused(void)
{
    CHECK(MemPoolCreateStatic(&pool, memory, sizeof memory, 0) == ERR_NOMEMORY);
    CHECK(MemPoolCreateStatic(&pool, memory, 64, 65) == ERR_NOMEMORY);
    CHECK(MemPoolCreateStatic(&pool, memory, 63, 62) == ERR_NOMEMORY);
    CHECK(MemPoolGetBlock(&pool) == NULL);
    CHECK(MemPoolCreateStatic(&pool, (RTS_UI8 *)memory + 1, 64, 8) == ERR_ALIGNMENT);
}

int main(void)
{
    RUN(all_blocks_can_be_taken_and_no_more);
    RUN(a_block_given_back_can_be_taken_again);
    RUN(what_is_no_block_is_not_taken_back);
    RUN(sizes_are_rounded_up_to_the_alignment);
    RUN(impossible_pools_are_refused);
    return test_result();
}
