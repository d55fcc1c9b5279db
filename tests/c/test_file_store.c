/*
 * test_file_store.c - exact bounds of the file store: names, places, and the entries of a catalog.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "FileStore.h"

#include "CmpChecksum.h"
#include "Sim.h"
#include "SysFileFlash.h"
#include "SysFlashLog.h"
#include "app_device.h"
#include "test.h"

enum { CATALOG_TAG = 0x454C4946 }; /* FileStore.c's own */
enum { SECTOR = 1024, STORE = 34 * SECTOR, SECTORS = 32 /* without the catalog */ };

static RTS_UI8 content[STORE];
static RTS_UI8 got[STORE];

static void begin(void)
{
    RTS_UI32 i;

    for (i = 0; i < sizeof content; i++)
        content[i] = (RTS_UI8)(i * 7 + i / 251);
    SimFileStoreSize = STORE;
    CHECK_EQUAL(SimFlashConfigure(96 * SECTOR, SECTOR, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(SysFileGetArea(FILE_STORE)->size, SECTORS * SECTOR);
}

/* The content of a file begins at its name. */
static RTS_RESULT put(char name, RTS_UI32 sectors)
{
    const char text[] = {name, '\0'};
    const RTS_UI8 *data = content + name;
    RTS_RESULT result = FileStoreBegin(text, sectors * SECTOR, CRC32Update(0, data, sectors * SECTOR));

    if (result == ERR_OK)
        result = FileStoreWrite(data, sectors * SECTOR);
    return result == ERR_OK ? FileStoreEnd() : result;
}

static bool has(char name, RTS_UI32 sectors)
{
    const char text[] = {name, '\0'};
    const FILE_ENTRY *file = FileStoreFind(text);

    return file != NULL && file->size == sectors * SECTOR && FileStoreRead(file, 0, got, file->size) == ERR_OK &&
           memcmp(got, content + name, file->size) == 0;
}

static RTS_RESULT delete(char name)
{
    const char text[] = {name, '\0'};

    return FileStoreDelete(text);
}

static void a_name_has_letters_digits_and_three_signs(void)
{
    static const char good[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789._-";
    RTS_UI32 c;

    for (c = 1; c < 256; c++) {
        char name[] = {'a', (char)c, '\0'};
        CHECK_EQUAL(FileStoreIsName(name), strchr(good, (int)c) != NULL);
    }
}

static void a_name_has_1_to_32_characters(void)
{
    char name[FILE_NAME_MAX + 4];
    RTS_UI32 length;

    for (length = 0; length < sizeof name; length++) {
        memset(name, 'n', sizeof name);
        name[length] = '\0';
        CHECK_EQUAL(FileStoreIsName(name), length >= 1 && length <= FILE_NAME_MAX);
    }
}

static void nothing_is_read_past_the_end_of_a_file(void)
{
    static const RTS_UI32 good[][2] = {{0, SECTOR}, {SECTOR, 0}, {SECTOR - 1, 1}, {1, SECTOR - 1}};
    static const RTS_UI32 bad[][2] = {
        {0, SECTOR + 1}, {1, SECTOR},     {SECTOR, 1},     {SECTOR + 1, 0},
        {0xFFFFFFFF, 1}, {0xFFFFFFFF, 2}, {1, 0xFFFFFFFF}, {2 * SECTOR, 0xFFFFFFFF - SECTOR + 1}};
    RTS_UI32 i;

    begin();
    CHECK_EQUAL(put('a', 1), ERR_OK);
    CHECK_EQUAL(put('b', 2), ERR_OK);
    for (i = 0; i < RTS_COUNT(good); i++)
        CHECK_EQUAL(FileStoreRead(FileStoreFind("a"), good[i][0], got, good[i][1]), ERR_OK);
    for (i = 0; i < RTS_COUNT(bad); i++)
        CHECK_EQUAL(FileStoreRead(FileStoreFind("a"), bad[i][0], got, bad[i][1]), ERR_OUT_OF_LIMITS);
}

static void no_more_is_written_than_was_said(void)
{
    begin();
    CHECK_EQUAL(FileStoreBegin("a", SECTOR, CRC32Update(0, content, SECTOR)), ERR_OK);
    CHECK_EQUAL(FileStoreWrite(content, SECTOR + 1), ERR_FT_FILE_SIZE_MISMATCH);
    CHECK_EQUAL(FileStoreWrite(content, SECTOR - 1), ERR_OK);
    CHECK_EQUAL(FileStoreWrite(content + SECTOR - 1, 2), ERR_FT_FILE_SIZE_MISMATCH);
    CHECK_EQUAL(FileStoreWrite(content + SECTOR - 1, 1), ERR_OK);
    CHECK_EQUAL(FileStoreEnd(), ERR_OK);
    CHECK(FileStoreRead(FileStoreFind("a"), 0, got, SECTOR) == ERR_OK && memcmp(got, content, SECTOR) == 0);
}

static void a_file_takes_the_whole_store(void)
{
    begin();
    CHECK_EQUAL(put('a', SECTORS + 1), ERR_DISK_FULL);
    CHECK_EQUAL(put('a', SECTORS), ERR_OK);
    CHECK(has('a', SECTORS));
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(has('a', SECTORS));
    CHECK_EQUAL(FileStoreRoom(), 0);
    CHECK_EQUAL(put('b', 1), ERR_DISK_FULL);
    CHECK(has('a', SECTORS));
}

/* Files are in the catalog in another order than in flash. */
static void a_file_is_put_into_the_smallest_gap_that_has_room_for_it(void)
{
    begin();
    CHECK_EQUAL(put('a', 3), ERR_OK);
    CHECK_EQUAL(put('b', 1), ERR_OK);
    CHECK_EQUAL(put('c', 2), ERR_OK);
    CHECK_EQUAL(put('d', SECTORS - 7), ERR_OK);
    CHECK_EQUAL(FileStoreRoom(), SECTOR); /* at the end */
    CHECK_EQUAL(delete ('a'), ERR_OK);
    CHECK_EQUAL(delete ('c'), ERR_OK);
    CHECK_EQUAL(FileStoreRoom(), 3 * SECTOR); /* at the start; 2 in the midst */
    CHECK_EQUAL(put('e', 4), ERR_DISK_FULL);
    CHECK_EQUAL(put('f', 1), ERR_OK);
    CHECK_EQUAL(FileStoreFind("f")->start, (SECTORS - 1) * SECTOR);
    CHECK_EQUAL(put('g', 2), ERR_OK);
    CHECK_EQUAL(FileStoreFind("g")->start, 4 * SECTOR);
    CHECK_EQUAL(put('h', 3), ERR_OK);
    CHECK_EQUAL(FileStoreFind("h")->start, 0);
    CHECK_EQUAL(FileStoreRoom(), 0);
    CHECK(has('b', 1) && has('d', SECTORS - 7) && has('f', 1) && has('g', 2) && has('h', 3));
}

static void a_full_catalog_changes_a_file_in_the_gap_at_the_start(void)
{
    char name;

    begin();
    CHECK_EQUAL(put('0', 1), ERR_OK);
    for (name = 'a'; name < 'a' + FILE_STORE_FILES - 1; name++)
        CHECK_EQUAL(put(name, 1), ERR_OK);
    CHECK_EQUAL(put('x', 1), ERR_DISK_FULL);
    CHECK_EQUAL(FileStoreRoom(), 0);
    CHECK_EQUAL(delete ('0'), ERR_OK);
    CHECK_EQUAL(put('y', SECTORS - FILE_STORE_FILES), ERR_OK); /* to the end */
    CHECK_EQUAL(put('b', 2), ERR_DISK_FULL);
    CHECK_EQUAL(put('b', 1), ERR_OK);
    CHECK_EQUAL(FileStoreFind("b")->start, 0);
    CHECK(has('a', 1) && has('b', 1) && has('c', 1) && has('y', SECTORS - FILE_STORE_FILES));
    CHECK_EQUAL(put('c', 1), ERR_OK); /* where b was */
    CHECK_EQUAL(FileStoreRoom(), 0);
}

static void what_is_copied_is_in_the_file_already(void)
{
    begin();
    SysFileCreateAt(FILE_STORE, 0);
    CHECK_EQUAL(SysFileWrite(FILE_STORE, content, 100), ERR_OK);
    CHECK_EQUAL(SysFileCopy(FILE_STORE, 0, 1), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(SysFileCopy(FILE_STORE, 101, 1), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(SysFileCopy(FILE_STORE, 0xFFFFFFFF, 1), ERR_OUT_OF_LIMITS);
    CHECK_EQUAL(SysFileCopy(FILE_STORE, 100, 150), ERR_OK); /* more than there is: what is copied is copied again */
    CHECK_EQUAL(SysFileClose(FILE_STORE), ERR_OK);
    CHECK_EQUAL(SysFileRead(FILE_STORE, 0, got, 250), ERR_OK);
    CHECK(memcmp(got, content, 100) == 0 && memcmp(got + 100, content, 100) == 0);
    CHECK(memcmp(got + 200, content, 50) == 0);
}

/* ---- a catalog that anything may have written ---- */

static void start_with(const FILE_ENTRY *first, const FILE_ENTRY *second)
{
    FILE_ENTRY catalog[FILE_STORE_FILES];
    FLASH_LOG log;

    begin();
    memset(catalog, 0, sizeof catalog);
    catalog[0] = *first;
    catalog[1] = *second;
    CHECK_EQUAL(FlashLogOpen(&log, FILE_CATALOG), ERR_OK);
    CHECK_EQUAL(FlashLogAppend(&log, CATALOG_TAG, catalog, sizeof catalog), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
}

static void entries_end_with_the_store(void)
{
    static const FILE_ENTRY whole = {"a", 0, SECTORS * SECTOR, 0};
    static const FILE_ENTRY last = {"b", (SECTORS - 1) * SECTOR, SECTOR, 0};
    static const FILE_ENTRY over = {"a", (SECTORS - 1) * SECTOR, SECTOR + 1, 0};
    static const FILE_ENTRY larger = {"b", 0, SECTORS * SECTOR + 1, 0};

    start_with(&whole, &last);
    CHECK(FileStoreGet(0) != NULL && FileStoreGet(1) != NULL);
    start_with(&over, &larger);
    CHECK(FileStoreGet(0) == NULL && FileStoreGet(1) == NULL);
    CHECK(FileStoreGet(FILE_STORE_FILES) == NULL && FileStoreGet(0xFFFFFFFF) == NULL);
}

static void there_is_no_room_within_files_that_overlap(void)
{
    static const FILE_ENTRY inner = {"a", 4 * SECTOR, 2 * SECTOR, 0};
    static const FILE_ENTRY outer = {"b", 2 * SECTOR, (SECTORS - 2) * SECTOR, 0};

    start_with(&inner, &outer);
    CHECK(FileStoreGet(0) != NULL && FileStoreGet(1) != NULL);
    CHECK_EQUAL(FileStoreRoom(), 2 * SECTOR);
    CHECK_EQUAL(put('c', 3), ERR_DISK_FULL);
    CHECK_EQUAL(put('c', 2), ERR_OK);
    CHECK(has('c', 2));
}

int main(void)
{
    RUN(a_name_has_letters_digits_and_three_signs);
    RUN(a_name_has_1_to_32_characters);
    RUN(nothing_is_read_past_the_end_of_a_file);
    RUN(no_more_is_written_than_was_said);
    RUN(a_file_takes_the_whole_store);
    RUN(a_file_is_put_into_the_smallest_gap_that_has_room_for_it);
    RUN(a_full_catalog_changes_a_file_in_the_gap_at_the_start);
    RUN(what_is_copied_is_in_the_file_already);
    RUN(entries_end_with_the_store);
    RUN(there_is_no_room_within_files_that_overlap);
    return test_result();
}
