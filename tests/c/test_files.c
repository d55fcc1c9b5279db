/*
 * test_files.c - the file services on a whole device of the simulator: what they keep, and what they refuse.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "FileStore.h"
#include "SysFileFlash.h"
#include "SysFlashLog.h"
#include "app_image.h"
#include "files_client.h"
#include "tag_sweep.h"
#include "test.h"

enum { CATALOG_TAG = 0x454C4946 }; /* FileStore.c's own */
enum { SECTOR = 1024, STORE = 16 * SECTOR, MOST = 14 * SECTOR };

static RTS_UI8 pattern[64 * 1024];
static RTS_UI8 got[64 * 1024];

static void setup(void)
{
    for (RTS_UI32 i = 0; i < sizeof(pattern); i++)
        pattern[i] = (RTS_UI8)(i * 7 + i / 251);
    start_device(64 * 1024, SECTOR, STORE);
}

static bool has(const char *name, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 arrived = 0;
    RTS_UI32 result = get(name, got, sizeof(got) - 4096, &arrived);

    return result == ERR_OK && arrived == size && memcmp(got, data, size) == 0;
}

static void what_is_put_is_got_back_also_after_a_restart(void)
{
    static const RTS_UI32 sizes[] = {0, 1, 15, 16, 17, SECTOR - 1, SECTOR, SECTOR + 1, 5000};

    setup();
    for (RTS_UI32 i = 0; i < RTS_COUNT(sizes); i++) {
        CHECK_EQUAL(put("a.bin", pattern + i, sizes[i]), ERR_OK);
        CHECK(has("a.bin", pattern + i, sizes[i]));
    }
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(reconnect());
    CHECK(has("a.bin", pattern + RTS_COUNT(sizes) - 1, 5000));
}

static void names_that_are_none_are_refused(void)
{
    static const char *const names[] = {"/etc/passwd", "../up",     "..",     ".",
                                        ".hidden",     "a//b",      "a/../b", "a\\b",
                                        "a b",         "a\xC3\xA4", "%s",     "123456789012345678901234567890123"};
    RTS_UI32 handle;

    setup();
    for (RTS_UI32 i = 0; i < RTS_COUNT(names); i++) {
        CHECK_EQUAL(put_begin(names[i], pattern, 4, &handle), ERR_PARAMETER);
        CHECK_EQUAL(get_begin(names[i], &handle), ERR_PARAMETER);
        CHECK_EQUAL(ask_named(SRV_FILE_DELETE, names[i], (RTS_UI32)strlen(names[i]), 0), ERR_PARAMETER);
        CHECK_EQUAL(ask_named(SRV_FILE_INFO, names[i], (RTS_UI32)strlen(names[i]), 0), ERR_PARAMETER);
    }
    CHECK_EQUAL(put_begin("a/", pattern, 4, &handle), ERR_PARAMETER); /* a folder */
    CHECK_EQUAL(ask_named(SRV_FILE_INFO, "a\0b", 3, 0), ERR_PARAMETER);
    CHECK_EQUAL(ask_named(SRV_FILE_INFO, "\0\0\0\0", 4, 0), ERR_PARAMETER);
    CHECK_EQUAL(ask_named(SRV_FILE_INFO, pattern, 500, 0), ERR_PARAMETER);
    CHECK_EQUAL(put("12345678901234567890123456789012", pattern, 4), ERR_OK);
}

static void a_tool_puts_files_into_folders_and_deletes_those_that_are_empty(void)
{
    setup();
    CHECK_EQUAL(put("trend/2026/may", pattern, 4), ERR_OK);
    CHECK_EQUAL(put("trend/2026", pattern, 4), ERR_DUPLICATE);
    CHECK_EQUAL(put("trend/2026/may/x", pattern, 4), ERR_DUPLICATE);
    CHECK_EQUAL(FileStoreCreateFolder("trend/empty"), ERR_OK);
    CHECK_EQUAL(ask_named(SRV_FILE_DELETE, "trend/", 6, 0), ERR_ENTRIES_REMAINING);
    CHECK_EQUAL(ask_named(SRV_FILE_DELETE, "trend/empty/", 12, 0), ERR_OK);
    CHECK_EQUAL(ask_named(SRV_FILE_DELETE, "trend/empty/", 12, 0), ERR_NO_OBJECT);
    CHECK_EQUAL(ask_named(SRV_FILE_DELETE, "../", 3, 0), ERR_PARAMETER);
    CHECK_EQUAL(ask_named(SRV_FILE_DELETE, "/", 1, 0), ERR_PARAMETER);
    CHECK_EQUAL(ask_named(SRV_FILE_DELETE, "trend/2026/may", 14, 0), ERR_OK);
    CHECK(!FileStoreIsFolder("trend"));
}

static void what_there_is_not_is_said(void)
{
    RTS_UI32 handle;

    setup();
    CHECK_EQUAL(get_begin("none", &handle), ERR_NO_OBJECT);
    CHECK_EQUAL(get_begin("Application.cdl", &handle), ERR_NO_OBJECT);
    CHECK_EQUAL(ask_named(SRV_FILE_DELETE, "none", 4, 0), ERR_NO_OBJECT);
    CHECK_EQUAL(ask_named(SRV_FILE_INFO, "none", 4, 0), ERR_NO_OBJECT);
}

static void what_the_device_makes_cannot_be_changed(void)
{
    RTS_UI32 handle;

    setup();
    CHECK_EQUAL(put_begin("Application.cdl", pattern, 4, &handle), ERR_OPERATION_DENIED);
    CHECK_EQUAL(put_begin("PlcLog.txt", pattern, 4, &handle), ERR_OPERATION_DENIED);
    CHECK_EQUAL(ask_named(SRV_FILE_DELETE, "PlcLog.txt", 10, 0), ERR_OPERATION_DENIED);
}

static void a_full_store_says_so_and_keeps_what_it_has(void)
{
    RTS_UI32 handle;

    setup();
    CHECK_EQUAL(put("a", pattern, MOST - SECTOR), ERR_OK);
    CHECK_EQUAL(put_begin("b", pattern, SECTOR + 1, &handle), ERR_DISK_FULL);
    CHECK_EQUAL(put_begin("b", NULL, 0xFFFFFFFF, &handle), ERR_DISK_FULL);
    CHECK_EQUAL(put_begin("a", pattern + 1, MOST - SECTOR, &handle), ERR_DISK_FULL); /* both would need room */
    CHECK(has("a", pattern, MOST - SECTOR));
    CHECK_EQUAL(ask_named(SRV_FILE_DELETE, "a", 1, 0), ERR_OK);
    CHECK_EQUAL(put("b", pattern, MOST), ERR_OK);
    CHECK(has("b", pattern, MOST));
}

static void there_are_so_many_files_at_most(void)
{
    char name[2] = "a";
    RTS_UI32 handle;

    setup();
    for (RTS_UI32 i = 0; i < FILE_STORE_FILES; i++) {
        name[0] = (char)('a' + i);
        CHECK_EQUAL(put(name, NULL, 0), ERR_OK);
    }
    CHECK_EQUAL(put_begin("z", pattern, 0, &handle), ERR_DISK_FULL);
    CHECK_EQUAL(put("a", pattern, 10), ERR_OK);
    CHECK_EQUAL(ask_named(SRV_FILE_DELETE, "b", 1, 0), ERR_OK);
    CHECK_EQUAL(put("z", pattern, 20), ERR_OK);
    CHECK(has("a", pattern, 10) && has("z", pattern, 20));
}

static void gaps_are_used_again(void)
{
    setup();
    for (RTS_UI32 i = 0; i < 200; i++) {
        char name[2] = {(char)('a' + i % 4), '\0'};
        RTS_UI32 size = i * 37 % (2 * SECTOR);
        CHECK_EQUAL(put(name, pattern + i, size), ERR_OK);
        CHECK(has(name, pattern + i, size));
    }
    CHECK_EQUAL(SimFlashViolations(), 0);
}

static void the_list_has_all_in_parts_that_fit(void)
{
    enum { LIMIT = 300 };
    RTS_UI8 buffer[32];
    BTAG_WRITER writer;
    RTS_UI32 next = 0;
    RTS_UI32 count = 0;
    RTS_UI32 parts = 0;

    setup();
    for (char name[2] = "a"; name[0] <= 'j'; name[0]++)
        CHECK_EQUAL(put(name, pattern, (RTS_UI32)name[0]), ERR_OK);
    client_send_close(&client);
    client_send_open(&client, 99, LIMIT);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    client.sent = client.received = 0;
    CHECK(client_login(&client));
    do {
        BTAG_READER list;
        BTAG tag;
        BTagWriterInit(&writer, buffer, sizeof(buffer));
        BTagWrite32(&writer, TAG_FILE_START, next);
        CHECK(client_call(&client, SG_FILE_TRANSFER, SRV_FILE_DIRECTORY, &writer, &reply));
        CHECK_EQUAL(reply_error(&reply), ERR_OK);
        next = reply_number(&reply, TAG_FILE_START);
        CHECK_EQUAL(BTagFindContainer(&reply.tags, TAG_FILE_LIST, &list), ERR_OK);
        while (BTagReadNext(&list, &tag) == ERR_OK)
            count += tag.id == TAG_FILE_ENTRY;
        parts++;
    } while (next != 0 && parts < 20);
    CHECK_EQUAL(count, 11); /* and the log */
    CHECK(parts > 1 && parts < 20);
}

static void a_folder_that_is_none_is_refused(void)
{
    static const char *const paths[] = {"sub", "..", "/etc", "//"};
    RTS_UI8 buffer[32];
    BTAG_WRITER writer;

    setup();
    for (RTS_UI32 i = 0; i < RTS_COUNT(paths); i++) {
        BTagWriterInit(&writer, buffer, sizeof(buffer));
        BTagWriteText(&writer, TAG_FILE_PATH, paths[i], 10);
        CHECK_EQUAL(ask(SRV_FILE_DIRECTORY, &writer, 0), ERR_NO_OBJECT);
    }
}

static void a_file_that_changes_while_it_is_read_is_an_error(void)
{
    RTS_UI32 handle;
    RTS_UI32 other;
    RTS_UI32 count;

    setup();
    CHECK_EQUAL(put("a", pattern, 40), ERR_OK);
    CHECK_EQUAL(get_begin("a", &handle), ERR_OK);
    CHECK_EQUAL(put("a", pattern + 1, 40), ERR_OK);
    CHECK_EQUAL(get_part(handle, 0, got, &count), ERR_NO_CONSISTENCY);
    CHECK_EQUAL(get_begin("a", &handle), ERR_OK);
    CHECK_EQUAL(ask_named(SRV_FILE_DELETE, "a", 1, 0), ERR_OK);
    CHECK_EQUAL(put_begin("b", pattern, 40, &other), ERR_OK); /* in the same sectors */
    CHECK_EQUAL(get_part(handle, 0, got, &count), ERR_NO_CONSISTENCY);
}

static void past_the_end_there_is_nothing(void)
{
    RTS_UI32 handle;
    RTS_UI32 count;

    setup();
    CHECK_EQUAL(put("a", pattern, 40), ERR_OK);
    CHECK_EQUAL(get_begin("a", &handle), ERR_OK);
    CHECK_EQUAL(get_part(handle, 41, got, &count), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(get_part(handle, 0xFFFFFFFF, got, &count), ERR_OUT_OF_LIMITS);
    CHECK(get_part(handle, 39, got, &count) == ERR_OK && count == 1 && got[0] == pattern[39]);
    CHECK(get_part(handle, 0, got, &count) == ERR_OK && count == 0);
    CHECK(get_part(handle, 40, got, &count) == ERR_OK && count == 0);
    CHECK_EQUAL(get_part(handle + 1, 0, got, &count), ERR_INVALID_HANDLE);
    CHECK_EQUAL(end_file(SRV_FILE_END, handle), ERR_OK);
    CHECK_EQUAL(get_part(handle, 0, got, &count), ERR_INVALID_HANDLE);
    CHECK_EQUAL(get_part(0, 0, got, &count), ERR_INVALID_HANDLE);
    CHECK_EQUAL(get_begin("PlcLog.txt", &handle), ERR_OK);
    CHECK_EQUAL(get_part(handle, number_in(TAG_FILE_STARTED, TAG_FILE_CONTENT) + 100000, got, &count),
                ERR_OUT_OF_LIMITS);
}

static void a_handle_that_is_another_one_changes_nothing(void)
{
    RTS_UI32 handle;

    setup();
    CHECK_EQUAL(put_begin("a", pattern, 40, &handle), ERR_OK);
    CHECK_EQUAL(put_part(handle ^ 1, 0, pattern, 40), ERR_INVALID_HANDLE);
    CHECK_EQUAL(put_part(0, 0, pattern, 40), ERR_INVALID_HANDLE);
    CHECK_EQUAL(end_file(SRV_FILE_CANCEL, handle ^ 1), ERR_INVALID_HANDLE);
    CHECK_EQUAL(put_part(handle, 0, pattern, 40), ERR_OK);
    CHECK_EQUAL(end_file(SRV_FILE_END, handle ^ 1), ERR_INVALID_HANDLE);
    CHECK_EQUAL(end_file(SRV_FILE_END, handle), ERR_OK);
    CHECK(has("a", pattern, 40));
}

static void a_file_that_is_not_what_was_said_is_not_taken(void)
{
    RTS_UI32 handle;

    setup();
    CHECK_EQUAL(put("a", pattern, 40), ERR_OK);
    CHECK_EQUAL(put_begin("a", pattern, 50, &handle), ERR_OK);
    CHECK_EQUAL(put_part(handle, 0, pattern + 1, 50), ERR_OK);
    CHECK_EQUAL(end_file(SRV_FILE_END, handle), ERR_FT_CRC_MISMATCH);
    CHECK_EQUAL(put_begin("a", pattern, 50, &handle), ERR_OK);
    CHECK_EQUAL(put_part(handle, 0, pattern, 49), ERR_OK);
    CHECK_EQUAL(put_part(handle, 51, pattern, 1), ERR_INVALID_SEQUENCE);
    CHECK_EQUAL(put_part(handle, 40, pattern, 11), ERR_FT_FILE_SIZE_MISMATCH);
    CHECK_EQUAL(end_file(SRV_FILE_END, handle), ERR_FT_FILE_SIZE_MISMATCH);
    CHECK_EQUAL(end_file(SRV_FILE_END, handle), ERR_INVALID_HANDLE);
    CHECK_EQUAL(put_part(handle, 0, pattern, 1), ERR_INVALID_HANDLE);
    CHECK(has("a", pattern, 40));
}

static void a_part_that_comes_twice_counts_once(void)
{
    RTS_UI32 handle;

    setup();
    CHECK_EQUAL(put_begin("a", pattern, 50, &handle), ERR_OK);
    CHECK_EQUAL(put_part(handle, 0, pattern, 30), ERR_OK);
    CHECK_EQUAL(put_part(handle, 0, pattern, 30), ERR_OK);
    CHECK_EQUAL(put_part(handle, 20, pattern + 20, 30), ERR_OK);
    CHECK_EQUAL(end_file(SRV_FILE_END, handle), ERR_OK);
    CHECK(has("a", pattern, 50));
}

static void a_client_that_vanishes_leaves_the_previous_file(void)
{
    RTS_UI32 handle;
    RTS_UI32 count;

    setup();
    CHECK_EQUAL(put("a", pattern, 40), ERR_OK);
    CHECK_EQUAL(put_begin("a", pattern + 1, 40, &handle), ERR_OK);
    CHECK_EQUAL(put_part(handle, 0, pattern + 1, 40), ERR_OK);
    CHECK(reconnect());
    CHECK_EQUAL(end_file(SRV_FILE_END, handle), ERR_INVALID_HANDLE); /* it belonged to the session */
    CHECK_EQUAL(get_part(handle, 0, got, &count), ERR_INVALID_HANDLE);
    CHECK(has("a", pattern, 40));
    CHECK_EQUAL(put("a", pattern + 2, 40), ERR_OK);
    CHECK_EQUAL(put_begin("a", pattern + 1, 40, &handle), ERR_OK);
    CHECK_EQUAL(end_file(SRV_FILE_CANCEL, handle), ERR_OK);
    CHECK(has("a", pattern + 2, 40));
}

static void without_login_there_is_nothing(void)
{
    setup();
    CHECK_EQUAL(put("a", pattern, 40), ERR_OK);
    client.session = 0;
    for (RTS_UI16 service = 1; service <= SRV_FILE_DELETE; service++) {
        RTS_UI32 error = ask_named(service, "a", 1, 0);
        CHECK(error == ERR_INVALID_SESSION_ID || error == ERR_L7_UNKNOWNCMD);
    }
}

static void the_program_and_the_log_are_files(void)
{
    static APP_BYTES image;
    RTS_UI32 size;
    RTS_UI32 handle;
    RTS_UI32 count;

    setup();
    build_counter(&image, 1);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK(has("Application.cdl", image.bytes, image.size));
    CHECK_EQUAL(get("PlcLog.txt", got, sizeof(got) - 4096, &size), ERR_OK);
    got[size] = '\0';
    CHECK(size > 20 && strstr((char *)got, " ms CmpAppEmbedded: ") != NULL);
    CHECK_EQUAL(get_begin("Application.cdl", &handle), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK_EQUAL(get_part(handle, 0, got, &count), ERR_NO_CONSISTENCY);
}

static void a_device_without_store_has_the_program_and_the_log(void)
{
    RTS_UI32 handle;

    start_device(64 * 1024, SECTOR, 0);
    CHECK_EQUAL(get_begin("PlcLog.txt", &handle), ERR_OK);
    CHECK_EQUAL(put_begin("a", pattern, 0, &handle), ERR_DEVICE);
}

static void a_catalog_of_garbage_is_an_empty_store(void)
{
    setup();
    CHECK_EQUAL(put("a", pattern, 40), ERR_OK);
    SimStop();
    memset(SimFlashData() + 48 * 1024, 0x5A, 2 * SECTOR);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(reconnect());
    CHECK_EQUAL(ask_named(SRV_FILE_INFO, "a", 1, 0), ERR_NO_OBJECT);
    CHECK_EQUAL(put("a", pattern, 40), ERR_OK);
    CHECK(has("a", pattern, 40));
}

/* Of a device that was tampered with: the record is whole, what it says cannot be. */
static void entries_of_a_catalog_that_cannot_be_are_left_out(void)
{
    static const FILE_ENTRY bad[] = {
        {"../up", 0, 40, 0},          {"", 0, 40, 0},
        {"a", 0, STORE + 1, 0},       {"a", STORE, 1, 0},
        {"a", 0xFFFFFC00, 2048, 0},   {"a", 0, 0xFFFFFFFF, 0},
        {"a", SECTOR / 2, SECTOR, 0}, {"12345678901234567890123456789012345", 0, 40, 0},
    };
    struct {
        FILE_ENTRY file[FILE_STORE_FILES];
    } catalog;
    FLASH_LOG log;

    for (RTS_UI32 i = 0; i < RTS_COUNT(bad); i++) {
        setup();
        CHECK_EQUAL(put("b", pattern, 40), ERR_OK);
        CHECK_EQUAL(FlashLogOpen(&log, FILE_CATALOG), ERR_OK);
        CHECK_EQUAL(FlashLogReadNewest(&log, CATALOG_TAG, &catalog, sizeof(catalog)), ERR_OK);
        catalog.file[1] = bad[i];
        CHECK_EQUAL(FlashLogAppend(&log, CATALOG_TAG, &catalog, sizeof(catalog)), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK(reconnect());
        CHECK(FileStoreGet(0) != NULL && FileStoreGet(1) == NULL);
        CHECK(has("b", pattern, 40));
    }
}

/* ---- power cuts ---- */

static RTS_UI32 story_result;

static void story(void *unused)
{
    RTS_UNUSED(unused);
    story_result = put("a", pattern + 1, 3000);
    if (story_result == ERR_OK)
        story_result = ask_named(SRV_FILE_DELETE, "b", 1, 0);
}

static void stay(void)
{
    /* No service of these groups ends the login. */
}

static void every_service_survives_every_tag_of_every_size(void)
{
    setup();
    CHECK_EQUAL(put("a.bin", pattern, 100), ERR_OK);
    CHECK(sweep_tags(&client, SG_FILE_TRANSFER, stay) >= 8);
    CHECK(sweep_tags(&client, SG_IOMGR, stay) >= 1);
    CHECK(reconnect());
    CHECK(has("a.bin", pattern, 100));
}

static void a_power_cut_leaves_the_previous_file_or_the_new_one(void)
{
    for (RTS_UI32 mode = 0; mode < 3; mode++) {
        RTS_UI32 cut = 1;
        bool finished = false;
        for (; !finished && cut < 2000; cut++) {
            setup();
            CHECK_EQUAL(put("a", pattern, 2500), ERR_OK);
            CHECK_EQUAL(put("b", pattern + 2, 100), ERR_OK);
            SimFlashCut(cut, mode);
            finished = SimCall(story, NULL) != SIM_POWER_CUT;
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK(reconnect());
            CHECK(has("a", pattern, 2500) != has("a", pattern + 1, 3000));
            CHECK(has("b", pattern + 2, 100) || ask_named(SRV_FILE_INFO, "b", 1, 0) == ERR_NO_OBJECT);
            CHECK_EQUAL(put("c", pattern, 2000), ERR_OK);
            CHECK(has("c", pattern, 2000));
            CHECK_EQUAL(SimFlashViolations(), 0);
        }
        CHECK(finished && cut > 100);
    }
}

int main(void)
{
    NEEDS_X86_64;
    RUN(what_is_put_is_got_back_also_after_a_restart);
    RUN(names_that_are_none_are_refused);
    RUN(a_tool_puts_files_into_folders_and_deletes_those_that_are_empty);
    RUN(what_there_is_not_is_said);
    RUN(what_the_device_makes_cannot_be_changed);
    RUN(a_full_store_says_so_and_keeps_what_it_has);
    RUN(there_are_so_many_files_at_most);
    RUN(gaps_are_used_again);
    RUN(the_list_has_all_in_parts_that_fit);
    RUN(a_folder_that_is_none_is_refused);
    RUN(a_file_that_changes_while_it_is_read_is_an_error);
    RUN(past_the_end_there_is_nothing);
    RUN(a_handle_that_is_another_one_changes_nothing);
    RUN(a_file_that_is_not_what_was_said_is_not_taken);
    RUN(a_part_that_comes_twice_counts_once);
    RUN(a_client_that_vanishes_leaves_the_previous_file);
    RUN(without_login_there_is_nothing);
    RUN(the_program_and_the_log_are_files);
    RUN(a_device_without_store_has_the_program_and_the_log);
    RUN(a_catalog_of_garbage_is_an_empty_store);
    RUN(entries_of_a_catalog_that_cannot_be_are_left_out);
    RUN(every_service_survives_every_tag_of_every_size);
    RUN(a_power_cut_leaves_the_previous_file_or_the_new_one);
    return test_result();
}
