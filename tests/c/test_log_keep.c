/*
 * test_log_keep.c - the entries of the log that survive power-off, also cut at every flash operation.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpLogKeep.h"
#include "FileStore.h"
#include "SysFlash.h"
#include "app_device.h"

enum { SIZE = 128 * 1024, SECTOR = 1024, KEPT = 8 * SECTOR, STORE = 4 * SECTOR };

static void start_device(RTS_UI32 kept)
{
    SimSetKeptLog(kept);
    SimSetFileStore(STORE);
    CHECK_EQUAL(SimFlashConfigure(SIZE, SECTOR, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
}

static void start_with_program(RTS_UI32 kept)
{
    APP_BYTES image;

    start_device(kept);
    build_counter(&image, 1);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(SimCommCycle(), ERR_OK);
}

/* A line of `class` with a number, and main has its pass. */
static RTS_RESULT add(RTS_UI32 log_class, RTS_UI32 number)
{
    LogAdd(CMPID_CmpMgr, log_class, number, "line %u", (unsigned)number);
    return SimAdvance(ms(LOG_KEEP_REFILL_MS));
}

static RTS_UI32 count_lines(void)
{
    LOG_ENTRY entry = {0};
    LOG_KEPT_FROM from;
    RTS_UI32 count = 0;

    for (; LogKeepGet(entry.handle + 1, &entry, &from) == ERR_OK; count++)
        CHECK(entry.handle > 0);
    return count;
}

/* The line with this text; false: none. */
static bool find(const char *text, LOG_ENTRY *entry, LOG_KEPT_FROM *from)
{
    entry->handle = 0;
    while (LogKeepGet(entry->handle + 1, entry, from) == ERR_OK) {
        if (strstr(entry->text, text) != NULL)
            return true;
    }
    return false;
}

static void starts_stops_and_exceptions_are_there_after_power_off(void)
{
    LOG_ENTRY entry;
    LOG_KEPT_FROM from;

    start_with_program(KEPT);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(50)), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    LogAdd(CMPID_CmpAppEmbedded, LOG_EXCEPTION, 0x51, "Task: index out of range");
    LogAdd(CMPID_CmpMgr, LOG_ERROR, ERR_FAILED, "not kept");
    CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK); /* power was cut */
    CHECK(find("Application loaded", &entry, &from));
    CHECK(find("Application started", &entry, &from));
    CHECK_EQUAL(entry.component, CMPID_CmpAppEmbedded);
    CHECK_EQUAL(entry.log_class, LOG_INFO);
    CHECK_EQUAL(from.start, 1);
    CHECK(from.utc_ns >= SIM_CLOCK_FIRST_S * (RTS_I64)1000000000);
    CHECK(find("Application stopped", &entry, &from));
    CHECK(entry.time_ns >= ms(50));
    CHECK(find("index out of range", &entry, &from));
    CHECK_EQUAL(entry.log_class, LOG_EXCEPTION);
    CHECK_EQUAL(entry.error, 0x51);
    CHECK(!find("not kept", &entry, &from));
}

static void a_later_start_has_the_next_number(void)
{
    LOG_ENTRY entry;
    LOG_KEPT_FROM from;

    start_device(KEPT);
    CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, 1), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, 2), ERR_OK);
    CHECK(find("line 1", &entry, &from) && from.start == 1);
    CHECK(find("line 2", &entry, &from) && from.start == 2);
}

static void what_is_logged_at_shutdown_is_kept_too(void)
{
    LOG_ENTRY entry;
    LOG_KEPT_FROM from;

    start_with_program(KEPT);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    LogAdd(CMPID_CmpMgr, LOG_WARNING | LOG_KEPT, ERR_OK, "last words");
    SimStop();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(find("last words", &entry, &from));
}

static void the_last_ones_are_shown_however_many_there_were(void)
{
    LOG_ENTRY entry;
    LOG_KEPT_FROM from;

    start_device(KEPT);
    for (RTS_UI32 i = 1; i <= 5 * LOG_KEEP; i++) {
        CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, i), ERR_OK);
        CHECK_EQUAL(count_lines(), i < LOG_KEEP ? i : LOG_KEEP);
    }
    CHECK_EQUAL(LogKeepGet(0, &entry, &from), ERR_OK);
    CHECK_EQUAL(entry.error, 4 * LOG_KEEP + 1);
    CHECK_EQUAL(LogKeepGet(5 * LOG_KEEP + 1, &entry, &from), ERR_END_OF_OBJECT);
    CHECK_EQUAL(LogKeepGet(0xFFFFFFFF, &entry, &from), ERR_END_OF_OBJECT);
}

static void a_flood_spares_the_flash_and_is_counted(void)
{
    LOG_ENTRY entry;
    LOG_KEPT_FROM from;
    RTS_UI32 operations;

    start_device(KEPT);
    operations = SimFlashOps();
    for (RTS_UI32 i = 0; i < 1000; i++) {
        LogAdd(CMPID_CmpMgr, LOG_INFO | LOG_KEPT, i, "flood");
        CHECK_EQUAL(SimCommCycle(), ERR_OK);
    }
    CHECK_EQUAL(count_lines(), LOG_KEEP_BURST);
    CHECK(SimFlashOps() - operations < 200);
    CHECK_EQUAL(SimAdvance(ms(LOG_KEEP_REFILL_MS)), ERR_OK);
    CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, 7), ERR_OK);
    CHECK(find("984 entries were not kept: there were too many", &entry, &from));
    CHECK_EQUAL(entry.component, CMPID_CmpLogKeep);
    CHECK(find("line 7", &entry, &from));
}

static void a_full_store_of_files_leaves_the_log_its_room(void)
{
    static const RTS_UI8 content[2 * SECTOR] = {1};
    LOG_ENTRY entry;
    LOG_KEPT_FROM from;

    start_device(KEPT);
    CHECK_EQUAL(SimPutFile("all.bin", content, sizeof content), ERR_OK);
    CHECK_EQUAL(SimPutFile("more.bin", content, 1), ERR_DISK_FULL);
    for (RTS_UI32 i = 1; i <= 2 * LOG_KEEP; i++)
        CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, i), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(count_lines(), LOG_KEEP);
    CHECK(find("line 64", &entry, &from));
    CHECK(FileStoreFind("all.bin") != NULL);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

static void without_flash_for_it_nothing_is_kept(void)
{
    LOG_ENTRY entry;
    LOG_KEPT_FROM from;

    start_device(0);
    CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, 1), ERR_OK);
    CHECK_EQUAL(LogKeepGet(0, &entry, &from), ERR_NOT_SUPPORTED);
}

static void a_flash_that_fails_ends_the_writing_and_nothing_else(void)
{
    LOG_ENTRY entry;
    LOG_KEPT_FROM from;

    start_with_program(KEPT);
    SimFlashFailFrom(SIM_PROGRAM, 1);
    CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, 1), ERR_OK);
    CHECK(log_has("The log is not kept: the flash fails"));
    CHECK(find("Application loaded", &entry, &from));
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(SimStart(), ERR_OK); /* the fault has passed */
    CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, 2), ERR_OK);
    CHECK(find("line 2", &entry, &from));
}

static void a_part_that_cannot_be_read_is_given_up(void)
{
    LOG_ENTRY entry;
    LOG_KEPT_FROM from;

    start_device(KEPT);
    CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, 1), ERR_OK);
    SimStop();
    SimFlashSetMapped(0);
    SimFlashUnreadable(SIZE - KEPT, SECTOR);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, 2), ERR_OK);
    CHECK(find("line 2", &entry, &from));
    SimStop();
    SimFlashSetMapped(1);
}

/* Lines `first` to `last` are there, in order, but for the one that was being written. */
static RTS_UI32 check_lines(RTS_UI32 before)
{
    LOG_ENTRY entry = {0};
    LOG_KEPT_FROM from;
    RTS_UI32 last = 0;
    RTS_UI32 count = 0;
    char text[32];

    for (; LogKeepGet(entry.handle + 1, &entry, &from) == ERR_OK; count++) {
        snprintf(text, sizeof text, "line %u", (unsigned)entry.error);
        CHECK(strcmp(entry.text, text) == 0);
        CHECK(last == 0 || entry.error == last + 1);
        last = entry.error;
    }
    CHECK(last == before || last == before + 1);
    CHECK(count >= LOG_KEEP - 1);
    return last;
}

static void a_cut_at_each_operation_costs_at_most_the_line_that_is_written(void)
{
    RTS_UI32 cuts = 0;
    RTS_UI32 written = 0;

    start_device(KEPT);
    for (RTS_UI32 i = 1; i <= LOG_KEEP + 3; i++) /* the next but one begins the other half */
        CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, i), ERR_OK);
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    for (RTS_UI32 mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        bool cut = true;
        for (RTS_UI32 operation = 1; cut; operation++) {
            RTS_UI32 i = LOG_KEEP + 3;
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            SimFlashCut(operation, mode);
            while ((cut = add(LOG_INFO | LOG_KEPT, i + 1) == SIM_POWER_CUT) == false && i < LOG_KEEP + 10)
                i++;
            CHECK_EQUAL(SimStart(), ERR_OK);
            RTS_UI32 last = check_lines(i);
            cuts += cut;
            written += cut && last == i + 1;
            CHECK_EQUAL(add(LOG_INFO | LOG_KEPT, last + 1), ERR_OK); /* it goes on after that */
            (void)check_lines(last + 1);
        }
    }
    CHECK_EQUAL(SimFlashViolations(), 0);
    CHECK(cuts > 150 && written > 0);
}

int main(void)
{
    RUN(starts_stops_and_exceptions_are_there_after_power_off);
    RUN(a_later_start_has_the_next_number);
    RUN(what_is_logged_at_shutdown_is_kept_too);
    RUN(the_last_ones_are_shown_however_many_there_were);
    RUN(a_flood_spares_the_flash_and_is_counted);
    RUN(a_full_store_of_files_leaves_the_log_its_room);
    RUN(without_flash_for_it_nothing_is_kept);
    RUN(a_flash_that_fails_ends_the_writing_and_nothing_else);
    RUN(a_part_that_cannot_be_read_is_given_up);
    RUN(a_cut_at_each_operation_costs_at_most_the_line_that_is_written);
    return test_result();
}
