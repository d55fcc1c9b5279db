/*
 * test_app_retain_threads.c - retain variables are saved as they are between two cycles, though a task runs beside.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * CmpRetain is compiled a second time here, with a flash log and a task that are fakes: a thread that fills the whole
 * area with one number per cycle. A copy taken within a cycle would hold two numbers.
 */
#define _GNU_SOURCE
#include <pthread.h>
#include <string.h>

#include "SysAtomic.h"

#define RetainCapacity test_capacity
#define RetainAttach test_attach
#define RetainRestore test_restore
#define RetainGetSequence test_sequence
#define RetainSave test_save
#define RetainKeep test_keep
#define RetainKeepNone test_keep_none
#define CmpRetain_Hook test_hook
#define FlashLogOpen fake_open
#define FlashLogRead fake_read
#define FlashLogAppend fake_append
#define FlashLogCapacity fake_capacity
#define IecTaskGetActivity fake_activity
#define SysTimeGetNs fake_time
#include "../../firmware/src/app/CmpRetain.c"

#include "test.h"

enum { AREA_SIZE = 16 * 1024, SAVES = 300 };

static RTS_UI8 area[AREA_SIZE];
static RTS_UI32 phase;
static RTS_UI32 quit;
static RTS_I64 now_ns;
static RTS_UI32 saves;
static RTS_UI32 mixed;

RTS_RESULT fake_open(FLASH_LOG *log, RTS_UI32 file)
{
    RTS_UNUSED(file);
    memset(log, 0, sizeof *log);
    return ERR_OK;
}

RTS_RESULT fake_read(const FLASH_LOG *log, FLASH_LOG_RANGE range, RTS_UI32 tag, void *data, RTS_UI32 size)
{
    RTS_UNUSED(log);
    RTS_UNUSED(range);
    RTS_UNUSED(tag);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    return ERR_NO_OBJECT;
}

RTS_RESULT fake_append(FLASH_LOG *log, RTS_UI32 tag, const void *data, RTS_UI32 size)
{
    const RTS_UI8 *bytes = data;
    RTS_UI32 i;

    RTS_UNUSED(log);
    RTS_UNUSED(tag);
    saves++;
    for (i = 1; i < size && bytes[i] == bytes[0]; i++)
        ;
    mixed += i < size;
    return ERR_OK;
}

RTS_UI32 fake_capacity(const FLASH_LOG *log)
{
    RTS_UNUSED(log);
    return AREA_SIZE;
}

RTS_UI32 fake_activity(bool *busy)
{
    RTS_UI32 now;

    SysAtomicFence();
    now = SysAtomicLoad(&phase);
    *busy = (now & 1) != 0;
    return now;
}

RTS_I64 fake_time(void)
{
    return now_ns;
}

/* Cycles with pauses, so that some copies fall between two cycles and some do not. */
static void *run_task(void *unused)
{
    RTS_UI32 cycle;

    RTS_UNUSED(unused);
    for (cycle = 1; SysAtomicLoad(&quit) == 0; cycle++) {
        volatile RTS_UI32 pause = 20000;
        SysAtomicStore(&phase, phase + 1);
        SysAtomicFence();
        memset(area, (int)(cycle & 0xFF), sizeof area);
        SysAtomicStore(&phase, phase + 1);
        while (pause > 0)
            pause--;
    }
    return NULL;
}

static void begin(void)
{
    now_ns = 0;
    saves = 0;
    mixed = 0;
    CHECK(CmpRetain_Hook(CH_INIT) == ERR_OK);
    CHECK(CmpRetain_Hook(CH_INIT2) == ERR_OK);
    RetainAttach(area, sizeof area, 1);
}

static void a_copy_is_taken_between_two_cycles(void)
{
    pthread_t thread;
    RTS_UI32 tries;

    begin();
    quit = 0;
    CHECK(pthread_create(&thread, NULL, run_task, NULL) == 0);
    for (tries = 0; tries < 20000000 && saves < SAVES; tries++) {
        RTS_UI32 before = saves;
        CHECK(CmpRetain_Hook(CH_COMM_CYCLE) == ERR_OK);
        if (saves != before || retain.last_check_ns + SAVE_NS > now_ns)
            now_ns = retain.last_check_ns + SAVE_NS; /* due again at once, but never so late that any copy would do */
    }
    SysAtomicStore(&quit, 1);
    pthread_join(thread, NULL);
    CHECK(saves == SAVES);
    CHECK(mixed == 0);
}

static void a_task_that_never_pauses_is_saved_after_twice_the_time(void)
{
    begin();
    phase = 1; /* in its cycle for ever */
    now_ns = SAVE_NS;
    CHECK(CmpRetain_Hook(CH_COMM_CYCLE) == ERR_OK);
    now_ns = 2 * SAVE_NS - 1;
    CHECK(CmpRetain_Hook(CH_COMM_CYCLE) == ERR_OK);
    CHECK(saves == 0);
    now_ns = 2 * SAVE_NS;
    CHECK(CmpRetain_Hook(CH_COMM_CYCLE) == ERR_OK);
    CHECK(saves == 1);
}

int main(void)
{
    RUN(a_copy_is_taken_between_two_cycles);
    RUN(a_task_that_never_pauses_is_saved_after_twice_the_time);
    return test_result();
}
