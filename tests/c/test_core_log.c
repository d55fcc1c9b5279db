/*
 * test_core_log.c - the log ring, also under several writers at once.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "CmpLog.h"
#include "SysAtomic.h"
#include "Sim.h"
#include "test.h"

static void clear(void)
{
    CHECK(CmpLog_Hook(CH_INIT_SYSTEM) == ERR_OK);
}

static void entries_come_back_in_order(void)
{
    LOG_ENTRY entry;

    clear();
    CHECK(LogGetEntry(0, &entry) == ERR_END_OF_OBJECT);
    LogAdd(CMPID_CmpLog, LOG_INFO, 0, "first %u", 1u);
    LogAdd(CMPID_CmpMgr, LOG_ERROR, ERR_FAILED, "second %s", "two");
    CHECK(LogGetEntry(0, &entry) == ERR_OK);
    CHECK(entry.handle == 1);
    CHECK(entry.component == CMPID_CmpLog);
    CHECK(entry.log_class == LOG_INFO);
    CHECK(strcmp(entry.text, "first 1") == 0);
    CHECK(LogGetEntry(2, &entry) == ERR_OK);
    CHECK(entry.handle == 2);
    CHECK(entry.error == ERR_FAILED);
    CHECK(strcmp(entry.text, "second two") == 0);
    CHECK(LogGetEntry(3, &entry) == ERR_END_OF_OBJECT);
    CHECK(LogGetEntry(0xFFFFFFFF, &entry) == ERR_END_OF_OBJECT);
}

static void the_oldest_entries_are_overwritten(void)
{
    LOG_ENTRY entry;
    RTS_UI32 handle;
    RTS_UI32 i;

    clear();
    for (i = 1; i <= 3 * LOG_MAX_ENTRIES + 5; i++)
        LogAdd(CMPID_CmpLog, LOG_INFO, i, "entry %u", (unsigned)i);
    handle = 0;
    for (i = 2 * LOG_MAX_ENTRIES + 6; i <= 3 * LOG_MAX_ENTRIES + 5; i++) {
        CHECK(LogGetEntry(handle, &entry) == ERR_OK);
        CHECK(entry.handle == i);
        CHECK(entry.error == i);
        handle = entry.handle + 1;
    }
    CHECK(LogGetEntry(handle, &entry) == ERR_END_OF_OBJECT);
}

static void long_strings_are_cut(void)
{
    char text[2 * LOG_TEXT_SIZE];
    LOG_ENTRY entry;

    clear();
    memset(text, 'a', sizeof text);
    text[sizeof text - 1] = '\0';
    LogAdd(CMPID_CmpLog, LOG_INFO, 0, "%s", text);
    CHECK(LogGetEntry(1, &entry) == ERR_OK);
    CHECK(strlen(entry.text) == LOG_TEXT_SIZE - 1);
}

static void a_text_is_never_taken_for_a_format(void)
{
    LOG_ENTRY entry;

    clear();
    LogAdd(CMPID_CmpLog, LOG_INFO, 0, "%s", "%s%s%x");
    CHECK(LogGetEntry(1, &entry) == ERR_OK);
    CHECK(strcmp(entry.text, "%s%s%x") == 0);
}

static void entries_carry_the_time(void)
{
    LOG_ENTRY entry;

    CHECK(SimStart() == ERR_OK);
    CHECK(SimAdvance(1234567) == ERR_OK);
    clear();
    LogAdd(CMPID_CmpLog, LOG_INFO, 0, "now");
    CHECK(LogGetEntry(1, &entry) == ERR_OK);
    CHECK(entry.time_ns == 1234567);
}

enum { WRITERS = 3, ENTRIES_TO_READ = 2000 };

static RTS_UI32 reader_done;

static void *write_entries(void *param)
{
    RTS_UI32 writer = (RTS_UI32)(uintptr_t)param;
    RTS_UI32 i;

    for (i = 0; !SysAtomicLoad(&reader_done); i++)
        LogAdd(writer, LOG_INFO, i, "%u %u", (unsigned)writer, (unsigned)i);
    return NULL;
}

/* A reader beside the writers gets entries that are whole, with growing numbers. */
static void writers_and_a_reader_do_not_disturb_each_other(void)
{
    pthread_t thread[WRITERS];
    LOG_ENTRY entry;
    RTS_UI32 handle = 0;
    RTS_UI32 torn = 0;
    RTS_UI32 read = 0;
    char text[32];
    RTS_UI32 i;

    clear();
    reader_done = 0;
    for (i = 0; i < WRITERS; i++)
        CHECK(pthread_create(&thread[i], NULL, write_entries, (void *)(uintptr_t)(i + 1)) == 0);
    while (read < ENTRIES_TO_READ) {
        if (LogGetEntry(handle + 1, &entry) != ERR_OK)
            continue;
        snprintf(text, sizeof text, "%u %u", (unsigned)entry.component, (unsigned)entry.error);
        torn += strcmp(text, entry.text) != 0;
        CHECK(entry.handle > handle);
        handle = entry.handle;
        read++;
    }
    SysAtomicStore(&reader_done, 1);
    for (i = 0; i < WRITERS; i++)
        pthread_join(thread[i], NULL);
    CHECK(torn == 0);
    CHECK(LogGetEntry(handle, &entry) == ERR_OK);
}

int main(void)
{
    RUN(entries_come_back_in_order);
    RUN(the_oldest_entries_are_overwritten);
    RUN(long_strings_are_cut);
    RUN(a_text_is_never_taken_for_a_format);
    RUN(entries_carry_the_time);
    RUN(writers_and_a_reader_do_not_disturb_each_other);
    return test_result();
}
