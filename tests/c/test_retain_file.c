/*
 * test_retain_file.c - retain variables as the file Retain.bin: saved elsewhere, put back, and what is refused.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "FileStore.h"
#include "../../firmware/src/app/AppLife.h"
#include "RetainFile.h"
#include "app_image.h"
#include "files_client.h"
#include "test.h"

enum { SECTOR = 1024, STORE = 16 * SECTOR };

static RTS_UI8 file[4096];
static RTS_UI32 size;

static void flash_counter(RTS_UI32 step)
{
    APP_BYTES image;

    build_counter(&image, step);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK(reconnect()); /* the channel has been idle */
}

static RTS_UI32 value(void)
{
    return read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET);
}

/* A device whose counter has counted, and its file from before it went on. */
static RTS_UI32 save_and_go_on(void)
{
    RTS_UI32 saved;

    start_device(64 * 1024, SECTOR, STORE);
    flash_counter(1);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    saved = value();
    CHECK_EQUAL(get(FILE_NAME_RETAIN, file, sizeof file, &size), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(1000)), ERR_OK);
    CHECK(reconnect());
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK(value() > saved);
    return saved;
}

static void what_was_saved_is_put_back_and_lasts(void)
{
    RTS_UI32 saved = save_and_go_on();

    CHECK_EQUAL(put(FILE_NAME_RETAIN, file, size), ERR_OK);
    CHECK_EQUAL(value(), saved);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_B_OFFSET), saved);
    CHECK(FileStoreFind(FILE_NAME_RETAIN) == NULL);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(value() >= saved && value() <= saved + 2);
}

static void it_can_be_got_while_the_program_runs(void)
{
    start_device(64 * 1024, SECTOR, STORE);
    flash_counter(1);
    CHECK_EQUAL(get(FILE_NAME_RETAIN, file, sizeof file, &size), ERR_OK);
    CHECK(size > 16);
}

static void it_is_refused_while_the_program_runs(void)
{
    RTS_UI32 handle;

    (void)save_and_go_on();
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(put_begin(FILE_NAME_RETAIN, file, size, &handle), ERR_CALL_AGAIN);
}

static void one_that_was_begun_before_a_start_is_refused_at_its_end(void)
{
    RTS_UI32 now;
    RTS_UI32 handle;

    (void)save_and_go_on();
    CHECK_EQUAL(put_begin(FILE_NAME_RETAIN, file, size, &handle), ERR_OK);
    CHECK_EQUAL(put_part(handle, 0, file, size), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    now = value();
    CHECK_EQUAL(end_file(SRV_FILE_END, handle), ERR_CALL_AGAIN);
    CHECK(value() >= now);
    CHECK(FileStoreFind(FILE_NAME_RETAIN) == NULL);
}

static void that_of_another_program_is_refused(void)
{
    RTS_UI32 before;

    (void)save_and_go_on();
    flash_counter(2);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    before = value();
    CHECK_EQUAL(put(FILE_NAME_RETAIN, file, size), ERR_VERSION_MISMATCH);
    CHECK_EQUAL(value(), before);
}

static void without_a_program_there_is_none(void)
{
    RTS_UI32 handle;

    start_device(64 * 1024, SECTOR, STORE);
    CHECK_EQUAL(get_begin(FILE_NAME_RETAIN, &handle), ERR_NO_OBJECT);
    CHECK_EQUAL(put_begin(FILE_NAME_RETAIN, file, 16, &handle), ERR_APP_NOT_LOADED);
}

static void a_damaged_one_changes_nothing(void)
{
    RTS_UI32 before;

    (void)save_and_go_on();
    before = value();
    for (RTS_UI32 at = 0; at < size; at++) {
        file[at] ^= 0x10;
        CHECK(put(FILE_NAME_RETAIN, file, size) != ERR_OK);
        CHECK_EQUAL(value(), before);
        file[at] ^= 0x10;
    }
    for (RTS_UI32 cut = 0; cut < size; cut++)
        CHECK_EQUAL(put(FILE_NAME_RETAIN, file, cut), ERR_CRC_FAILED);
    CHECK_EQUAL(value(), before);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(value() >= before);
}

static RTS_UI32 put_result;

static void put_it(void *unused)
{
    RTS_UNUSED(unused);
    put_result = put(FILE_NAME_RETAIN, file, size);
}

static void a_power_cut_while_it_is_put_leaves_all_old_or_all_new_values(void)
{
    RTS_UI32 saved = save_and_go_on();
    RTS_UI32 before = value();
    RTS_UI32 cuts = 0;

    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    for (RTS_UI32 mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        bool cut = true;
        for (RTS_UI32 operation = 1; cut; operation++) {
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK_EQUAL(AppStopApplication(), ERR_OK);
            before = value();
            CHECK(reconnect());
            SimFlashCut(operation, mode);
            cut = SimCall(put_it, NULL) == SIM_POWER_CUT;
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK((value() >= before && value() <= before + 2) || (value() >= saved && value() <= saved + 2));
            CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_B_OFFSET), value());
            CHECK(FileStoreFind(FILE_NAME_RETAIN) == NULL);
            cuts += cut;
        }
        CHECK_EQUAL(put_result, ERR_OK);
        CHECK(value() >= saved && value() <= saved + 2);
    }
    CHECK(cuts > 9);
}

int main(void)
{
    RUN(what_was_saved_is_put_back_and_lasts);
    RUN(it_can_be_got_while_the_program_runs);
    RUN(it_is_refused_while_the_program_runs);
    RUN(one_that_was_begun_before_a_start_is_refused_at_its_end);
    RUN(that_of_another_program_is_refused);
    RUN(without_a_program_there_is_none);
    RUN(a_damaged_one_changes_nothing);
    RUN(a_power_cut_while_it_is_put_leaves_all_old_or_all_new_values);
    return test_result();
}
