/*
 * test_iec_file.c - the files of a program, by the functions that its blocks call: power cuts, and what a bad program asks for.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpAppCalls.h"
#include "CmpAppEmbedded.h"
#include "FileStore.h"
#include "IecFile.h"
#include "Sim.h"
#include "app_image.h"
#include "test.h"

enum { SECTOR = 1024, STORE = 16 * SECTOR };

static RTS_UI8 pattern[8192];
static RTS_UI8 got[8192];

/* ---- the functions as a program finds them ---- */

static RTS_I32 file_call(RTS_UI32 operation, RTS_UI32 handle, RTS_UI32 value)
{
    return ((RTS_I32(*)(RTS_UI32, RTS_UI32, RTS_UI32))CMFindExternal("file_call")->function)(operation, handle, value);
}

static RTS_UI8 call_put(RTS_I32 number, RTS_UI32 index, const RTS_UI64 *w)
{
    return (
        (RTS_UI8(*)(RTS_I32, RTS_UI32, RTS_UI64, RTS_UI64, RTS_UI64, RTS_UI64))CMFindExternal("call_put")->function)(
        number, index, w[0], w[1], w[2], w[3]);
}

static RTS_UI8 call_send(RTS_I32 number, RTS_UI32 size)
{
    return ((RTS_UI8(*)(RTS_I32, RTS_UI32))CMFindExternal("call_send")->function)(number, size);
}

static RTS_I32 call_state(RTS_I32 number)
{
    return ((RTS_I32(*)(RTS_I32))CMFindExternal("call_state")->function)(number);
}

static RTS_UI32 call_result(RTS_I32 number)
{
    return ((RTS_UI32(*)(RTS_I32))CMFindExternal("call_result")->function)(number);
}

static RTS_UI64 call_get(RTS_I32 number, RTS_UI32 index)
{
    return ((RTS_UI64(*)(RTS_I32, RTS_UI32))CMFindExternal("call_get")->function)(number, index);
}

static RTS_UI8 call_wait(RTS_I32 number)
{
    return ((RTS_UI8(*)(RTS_I32))CMFindExternal("call_wait")->function)(number);
}

static RTS_UI8 call_free(RTS_I32 number)
{
    return ((RTS_UI8(*)(RTS_I32))CMFindExternal("call_free")->function)(number);
}

/* ---- what blocks do with them ---- */

static RTS_UI32 result;
static bool waits; /* for a call, as SysFileOpen does */

static void put_bytes(RTS_I32 number, const RTS_UI8 *data, RTS_UI32 size)
{
    for (RTS_UI32 at = 0; at < size; at += APP_CALL_PART) {
        RTS_UI64 words[4] = {0};
        memcpy(words, data + at, size - at < sizeof words ? size - at : sizeof words);
        CHECK(call_put(number, at / APP_CALL_PART, words));
    }
}

/* True if the call ended well; `result` is that of the call or its error. */
static bool call(RTS_UI32 operation, RTS_UI32 handle, RTS_UI32 value, const void *data, RTS_UI32 size)
{
    RTS_I32 number = file_call(operation, handle, value);

    CHECK(number > 0);
    put_bytes(number, data, size);
    CHECK(call_send(number, size));
    RTS_I32 state = 0;
    if (waits && !call_wait(number))
        return false;
    for (int i = 0; i < 100 && state == 0; i++) {
        (void)SimCommCycle();
        state = call_state(number);
    }
    result = state == 1 ? call_result(number) : (RTS_UI32)-state;
    for (RTS_UI32 i = 0; operation == IEC_FILE_READ && state == 1 && i < result; i += 8) {
        RTS_UI64 word = call_get(number, i / 8);
        memcpy(got + i, &word, sizeof word);
    }
    CHECK(call_free(number));
    return state == 1;
}

static bool open_as(const char *name, RTS_UI32 mode)
{
    return call(IEC_FILE_OPEN, 0, mode, name, (RTS_UI32)strlen(name) + 1);
}

/* Writes a whole file; true if it is there now. */
static bool put_file(const char *name, RTS_UI32 mode, const RTS_UI8 *data, RTS_UI32 size)
{
    if (!open_as(name, mode))
        return false;
    RTS_UI32 handle = result;
    for (RTS_UI32 at = 0; at < size; at += APP_CALL_DATA) {
        RTS_UI32 part = size - at < APP_CALL_DATA ? size - at : APP_CALL_DATA;
        if (!call(IEC_FILE_WRITE, handle, 0, data + at, part))
            return false;
    }
    return call(IEC_FILE_CLOSE, handle, 0, NULL, 0);
}

static bool has(const char *name, const RTS_UI8 *data, RTS_UI32 size)
{
    const FILE_ENTRY *entry = FileStoreFind(name);

    return entry != NULL && entry->size == size && FileStoreRead(entry, 0, got, size) == ERR_OK &&
           memcmp(got, data, size) == 0;
}

static void setup(void)
{
    static APP_BYTES image;

    for (RTS_UI32 i = 0; i < sizeof pattern; i++)
        pattern[i] = (RTS_UI8)(i * 7 + i / 251);
    SimFileStoreSize = STORE;
    CHECK_EQUAL(SimFlashConfigure(64 * 1024, SECTOR, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    build_counter(&image, 1);
    CHECK_EQUAL(download(&image), ERR_OK);
    if (waits)
        CHECK_EQUAL(AppStartApplication(), ERR_OK); /* for its tasks only */
}

/* ---- tests ---- */

static void ten_thousand_opens_are_refused_past_the_limit_and_leak_nothing(void)
{
    setup();
    CHECK(put_file("a", IEC_FILE_MODE_WRITE, pattern, 100));
    for (int turn = 0; turn < 2; turn++) {
        int opened = 0;
        for (int i = 0; i < 10000; i++) {
            bool is_open = open_as("a", IEC_FILE_MODE_READ);
            opened += is_open;
            CHECK(is_open || result == IEC_FILE_TOO_MANY);
        }
        CHECK_EQUAL(opened, IEC_FILES);
        CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    }
    CHECK(has("a", pattern, 100));
}

static void ten_thousand_calls_that_are_not_fetched_take_all_slots_until_the_reset(void)
{
    setup();
    for (int turn = 0; turn < 2; turn++) {
        int taken = 0;
        for (int i = 0; i < 10000; i++)
            taken += file_call(IEC_FILE_SIZE, 0, 0) > 0;
        CHECK_EQUAL(taken, APP_CALLS);
        CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    }
}

static void a_call_that_is_abandoned_is_free_after_a_minute(void)
{
    RTS_I32 number = 0;

    setup();
    for (int i = 0; i < APP_CALLS; i++) {
        number = file_call(IEC_FILE_OPEN_DIR, 0, 0);
        CHECK(number > 0 && call_send(number, 0));
    }
    CHECK_EQUAL(SimAdvance((RTS_I64)59 * 1000000000), ERR_OK);
    CHECK_EQUAL(file_call(IEC_FILE_SIZE, 0, 0), 0);
    CHECK_EQUAL(SimAdvance((RTS_I64)3 * 1000000000), ERR_OK);
    CHECK(file_call(IEC_FILE_SIZE, 0, 0) > 0);
    CHECK_EQUAL(call_state(number), -1);
}

static void numbers_that_are_none_change_nothing(void)
{
    static const RTS_UI64 words[4];
    static const RTS_I32 bad[] = {0, 1, -1, 255, 256, 511, INT32_MAX, INT32_MIN};

    setup();
    for (RTS_UI32 i = 0; i < RTS_COUNT(bad); i++) {
        CHECK_EQUAL(call_put(bad[i], 0, words), 0);
        CHECK_EQUAL(call_send(bad[i], 0), 0);
        CHECK_EQUAL(call_state(bad[i]), -1);
        CHECK_EQUAL(call_result(bad[i]), 0);
        CHECK_EQUAL(call_get(bad[i], 0), 0);
        CHECK_EQUAL(call_free(bad[i]), 0);
    }
    RTS_I32 number = file_call(IEC_FILE_SIZE, 0, 0);
    CHECK_EQUAL(call_put(number, APP_CALL_DATA / APP_CALL_PART, words), 0);
    CHECK_EQUAL(call_put(number, UINT32_MAX, words), 0);
    CHECK_EQUAL(call_send(number, APP_CALL_DATA + 1), 0);
    CHECK_EQUAL(call_send(number, UINT32_MAX), 0);
    CHECK_EQUAL(call_get(number, APP_CALL_DATA / 8), 0);
    CHECK_EQUAL(call_get(number, UINT32_MAX), 0);
    CHECK(call_free(number));
    CHECK_EQUAL(call_send(number, 0), 0);
}

static void every_operation_with_every_odd_argument_is_an_error_of_the_library(void)
{
    static const RTS_UI32 odd[] = {0, 1, 2, 255, 256, 257, 0x7FFFFFFF, 0x80000000, UINT32_MAX};
    RTS_UI8 data[APP_CALL_DATA];

    setup();
    memset(data, 'a', sizeof data); /* no end */
    for (RTS_UI32 operation = 0; operation < 20; operation++) {
        for (RTS_UI32 i = 0; i < RTS_COUNT(odd); i++) {
            for (RTS_UI32 size = 0; size <= sizeof data; size += sizeof data / 2) {
                CHECK(!call(operation, odd[i], odd[i], data, size));
                CHECK(result >= IEC_FILE_HANDLE_INVALID && result <= IEC_FILE_TOO_MANY);
            }
        }
    }
    CHECK_EQUAL(FileStoreIsWriting(), 0);
}

/* Numbers of files can be guessed: the one that the program gets when its copy is complete is the next one. */
static void a_file_that_is_copied_to_append_cannot_be_closed_before(void)
{
    RTS_I32 number;
    RTS_UI32 next;

    setup();
    CHECK(put_file("a", IEC_FILE_MODE_WRITE, pattern, 1000));
    CHECK(open_as("a", IEC_FILE_MODE_READ));
    next = result + 256;
    CHECK(call(IEC_FILE_CLOSE, result, 0, NULL, 0));
    number = file_call(IEC_FILE_OPEN, 0, IEC_FILE_MODE_APPEND);
    put_bytes(number, (const RTS_UI8 *)"a", 2);
    CHECK(call_send(number, 2));
    CHECK(!call(IEC_FILE_CLOSE, next, 0, NULL, 0)); /* in the same pass */
    CHECK_EQUAL(result, IEC_FILE_HANDLE_INVALID);
    for (int i = 0; i < 10; i++)
        (void)SimCommCycle();
    CHECK_EQUAL(call_state(number), 1);
    CHECK_EQUAL(call_result(number), next);
    CHECK(call(IEC_FILE_CLOSE, next, 0, NULL, 0));
    CHECK(!FileStoreIsWriting());
    CHECK(has("a", pattern, 1000));
}

static void a_name_without_end_is_refused(void)
{
    setup();
    CHECK(!call(IEC_FILE_RENAME, 0, 0, "a", 2));
    CHECK_EQUAL(result, IEC_FILE_WRONG_PARAMETER);
    CHECK(!call(IEC_FILE_RENAME, 0, 0, "a\0b", 3));
    CHECK_EQUAL(result, IEC_FILE_WRONG_PARAMETER);
    CHECK(!call(IEC_FILE_COPY, 0, 0, "a\0b", 3));
    CHECK_EQUAL(result, IEC_FILE_WRONG_PARAMETER);
    CHECK(!call(IEC_FILE_RENAME_DIR, 0, 0, "a\0b", 3));
    CHECK_EQUAL(result, IEC_FILE_WRONG_PARAMETER);
}

/* Its marks count as files. */
static void folders_end_with_the_entries_of_the_catalog(void)
{
    char name[] = "d00";

    setup();
    for (int i = 0; i < FILE_STORE_FILES; i++) {
        name[1] = (char)('0' + i / 10);
        name[2] = (char)('0' + i % 10);
        CHECK(call(IEC_FILE_CREATE_DIR, 0, 0, name, sizeof name));
    }
    CHECK(!call(IEC_FILE_CREATE_DIR, 0, 0, "more", 5));
    CHECK_EQUAL(result, IEC_FILE_INCOMPLETE);
    CHECK(!put_file("file", IEC_FILE_MODE_WRITE, pattern, 1));
    CHECK(call(IEC_FILE_DELETE_DIR, 0, 0, "d00", 4));
    CHECK(put_file("d01/file", IEC_FILE_MODE_WRITE, pattern, 1));
    CHECK(!call(IEC_FILE_DELETE_DIR, 0, 0, "d01", 4));
    CHECK_EQUAL(result, IEC_FILE_NOT_EMPTY);
}

/* Main does not wait for itself: what has the simulator serve it is the task that waits. */
static void a_call_of_a_program_that_is_stopped_is_not_waited_for(void)
{
    RTS_I32 number;

    setup();
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    number = file_call(IEC_FILE_SIZE, 0, 0);
    put_bytes(number, (const RTS_UI8 *)"a", 2);
    CHECK(call_send(number, 2));
    CHECK(!call_wait(number));
    CHECK(!call_wait(number + 1));
    CHECK(!call_wait(0));
    CHECK_EQUAL(SimCommCycle(), ERR_OK);
    CHECK_EQUAL(call_state(number), -IEC_FILE_NOT_EXIST);
}

/* ---- power cuts ---- */

static void replace(void *mode)
{
    (void)put_file("a", *(const RTS_UI32 *)mode, pattern + 1, 2500);
}

static void rename_and_delete(void *unused)
{
    RTS_UNUSED(unused);
    (void)call(IEC_FILE_RENAME, 0, 0, "b\0c", 4);
    (void)call(IEC_FILE_DELETE, 0, 0, "c", 2);
}

/* The story with a cut at each flash operation, until it comes to its end; `is_right` is asked after each restart. */
static void cut_everywhere(void (*story)(void *), void *arg, bool (*is_right)(void), RTS_UI32 at_least)
{
    for (RTS_UI32 mode = 0; mode < 3; mode++) {
        RTS_UI32 cut = 1;
        bool finished = false;
        for (; !finished && cut < 2000; cut++) {
            setup();
            CHECK(put_file("a", IEC_FILE_MODE_WRITE, pattern, 1000));
            CHECK(put_file("b", IEC_FILE_MODE_WRITE, pattern + 2, 100));
            SimFlashCut(cut, mode);
            finished = SimCall(story, arg) != SIM_POWER_CUT;
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK(is_right());
            CHECK(put_file("d", IEC_FILE_MODE_WRITE, pattern, 2000) && has("d", pattern, 2000));
            CHECK_EQUAL(SimFlashViolations(), 0);
        }
        CHECK(finished && cut > at_least);
    }
}

static bool old_or_new(void)
{
    return has("a", pattern, 1000) != has("a", pattern + 1, 2500) && has("b", pattern + 2, 100);
}

static bool old_or_longer(void)
{
    static RTS_UI8 both[3500];

    memcpy(both, pattern, 1000);
    memcpy(both + 1000, pattern + 1, 2500);
    return has("a", pattern, 1000) != has("a", both, 3500) && has("b", pattern + 2, 100);
}

static bool one_name_or_none(void)
{
    bool is_b = has("b", pattern + 2, 100);
    bool is_c = has("c", pattern + 2, 100);

    return has("a", pattern, 1000) && !(is_b && is_c);
}

static void a_power_cut_leaves_the_previous_file_or_the_new_one(void)
{
    RTS_UI32 mode = IEC_FILE_MODE_WRITE;

    cut_everywhere(replace, &mode, old_or_new, 100);
}

static void a_power_cut_while_appending_leaves_the_previous_file_or_the_longer_one(void)
{
    RTS_UI32 mode = IEC_FILE_MODE_APPEND;

    cut_everywhere(replace, &mode, old_or_longer, 100);
}

static void a_power_cut_while_renaming_leaves_one_name(void)
{
    cut_everywhere(rename_and_delete, NULL, one_name_or_none, 10);
}

static void move_and_delete_folder(void *unused)
{
    RTS_UNUSED(unused);
    (void)call(IEC_FILE_CREATE_DIR, 0, 1, "x/y", 4);
    (void)put_file("x/a", IEC_FILE_MODE_WRITE, pattern, 10);
    (void)put_file("x/y/b", IEC_FILE_MODE_WRITE, pattern, 10);
    (void)call(IEC_FILE_RENAME_DIR, 0, 0, "x\0z", 4);
    (void)call(IEC_FILE_DELETE_DIR, 0, 1, "z", 2);
}

static bool all_or_none(void)
{
    bool was_moved = FileStoreIsFolder("z");
    const FILE_ENTRY *first = FileStoreFind(was_moved ? "z/a" : "x/a");
    const FILE_ENTRY *second = FileStoreFind(was_moved ? "z/y/b" : "x/y/b");

    return has("a", pattern, 1000) && !(was_moved && FileStoreIsFolder("x")) && !(second != NULL && first == NULL) &&
           !(was_moved && second == NULL);
}

static void a_power_cut_while_a_folder_is_moved_or_deleted_leaves_all_of_it_or_none(void)
{
    cut_everywhere(move_and_delete_folder, NULL, all_or_none, 30);
}

static void copy_file(void *unused)
{
    RTS_UNUSED(unused);
    (void)call(IEC_FILE_COPY, 0, 1, "a\0b", 4);
}

static bool copy_or_not(void)
{
    return has("a", pattern, 1000) && has("b", pattern + 2, 100) != has("b", pattern, 1000);
}

static void a_power_cut_while_copying_leaves_the_previous_file_or_the_copy(void)
{
    cut_everywhere(copy_file, NULL, copy_or_not, 50);
}

/* Over the begin of the file: the rest comes when it is closed. */
static void update(void *unused)
{
    RTS_UNUSED(unused);
    if (!open_as("a", IEC_FILE_MODE_UPDATE))
        return;
    RTS_UI32 handle = result;
    if (call(IEC_FILE_WRITE, handle, 0, pattern + 1, 300))
        (void)call(IEC_FILE_CLOSE, handle, 0, NULL, 0);
}

static bool old_or_updated(void)
{
    static RTS_UI8 both[1000];

    memcpy(both, pattern + 1, 300);
    memcpy(both + 300, pattern + 300, 700);
    return has("a", pattern, 1000) != has("a", both, 1000) && has("b", pattern + 2, 100);
}

static void a_power_cut_while_updating_leaves_the_previous_file_or_the_new_one(void)
{
    cut_everywhere(update, NULL, old_or_updated, 50);
}

static void a_power_cut_while_a_task_waits_leaves_the_previous_file_or_the_new_one(void)
{
    RTS_UI32 mode = IEC_FILE_MODE_WRITE;

    waits = true;
    cut_everywhere(replace, &mode, old_or_new, 100);
    waits = false;
}

/* A fault of one flash operation, without a cut. */
static void a_flash_fault_leaves_the_previous_file_or_the_new_one(void)
{
    RTS_UI32 mode = IEC_FILE_MODE_WRITE;

    for (RTS_UI32 fault = 1; fault < 450; fault++) {
        setup();
        CHECK(put_file("a", IEC_FILE_MODE_WRITE, pattern, 1000));
        CHECK(put_file("b", IEC_FILE_MODE_WRITE, pattern + 2, 100));
        SimFlashCut(fault, SIM_FAULT);
        replace(&mode);
        CHECK(!FileStoreIsWriting());
        CHECK(old_or_new());
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK(old_or_new());
    }
}

/* The block was called once and never again: the task has no handle to close. */
static void a_file_whose_open_is_not_fetched_is_closed_after_a_minute(void)
{
    static const RTS_UI32 modes[] = {IEC_FILE_MODE_READ, IEC_FILE_MODE_WRITE};

    setup();
    CHECK(put_file("a", IEC_FILE_MODE_WRITE, pattern, 100));
    for (RTS_UI32 m = 0; m < 2; m++) {
        for (RTS_UI32 i = 0; i < (m == 0 ? IEC_FILES : 1); i++) {
            RTS_I32 number = file_call(IEC_FILE_OPEN, 0, modes[m]);
            put_bytes(number, (const RTS_UI8 *)"a", 2);
            CHECK(call_send(number, 2));
            CHECK_EQUAL(SimCommCycle(), ERR_OK);
        }
        CHECK(!open_as("a", m == 0 ? IEC_FILE_MODE_READ : IEC_FILE_MODE_WRITE));
        CHECK_EQUAL(result, IEC_FILE_TOO_MANY);
        CHECK_EQUAL(SimAdvance(61000000000), ERR_OK);
        CHECK_EQUAL(SimCommCycle(), ERR_OK);
    }
    CHECK(has("a", pattern, 100)); /* what was opened to write was not put in its place */
    CHECK(put_file("a", IEC_FILE_MODE_WRITE, pattern, 50));
    CHECK(has("a", pattern, 50));
}

int main(void)
{
    NEEDS_X86_64;
    RUN(ten_thousand_opens_are_refused_past_the_limit_and_leak_nothing);
    RUN(ten_thousand_calls_that_are_not_fetched_take_all_slots_until_the_reset);
    RUN(a_call_that_is_abandoned_is_free_after_a_minute);
    RUN(a_file_whose_open_is_not_fetched_is_closed_after_a_minute);
    RUN(numbers_that_are_none_change_nothing);
    RUN(every_operation_with_every_odd_argument_is_an_error_of_the_library);
    RUN(a_file_that_is_copied_to_append_cannot_be_closed_before);
    RUN(a_name_without_end_is_refused);
    RUN(a_power_cut_leaves_the_previous_file_or_the_new_one);
    RUN(a_power_cut_while_appending_leaves_the_previous_file_or_the_longer_one);
    RUN(a_power_cut_while_renaming_leaves_one_name);
    RUN(folders_end_with_the_entries_of_the_catalog);
    RUN(a_call_of_a_program_that_is_stopped_is_not_waited_for);
    RUN(a_power_cut_while_a_folder_is_moved_or_deleted_leaves_all_of_it_or_none);
    RUN(a_power_cut_while_copying_leaves_the_previous_file_or_the_copy);
    RUN(a_power_cut_while_updating_leaves_the_previous_file_or_the_new_one);
    RUN(a_power_cut_while_a_task_waits_leaves_the_previous_file_or_the_new_one);
    RUN(a_flash_fault_leaves_the_previous_file_or_the_new_one);
    return test_result();
}
