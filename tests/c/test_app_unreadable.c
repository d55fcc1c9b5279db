/*
 * test_app_unreadable.c - a flash that cannot be read any more, from any moment of the check of an image on.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The check ends with the read that fails: what was not read decides nothing.
 */
#include "../../firmware/src/load/AppFunctions.h"
#include "../../firmware/src/load/AppLoader.h"
#include "Sim.h"
#include "SysFileFlash.h"
#include "io_driver.h"

static APP_REFUSAL refusal;

/* Checks the image in slot A; from the read with this number on, none succeeds. */
static RTS_RESULT check_until(RTS_UI32 read)
{
    APP_IMAGE checked;
    RTS_RESULT result;

    SimFlashFailFrom(SIM_READ, read);
    result = AppLoaderCheck(FILE_SLOT_A, image.size, image_crc(&image), &checked, &refusal);
    SimFlashFailFrom(SIM_READ, 0);
    return result;
}

enum { TRIES = 3 }; /* of a read */

/* The sentence names the place where a name or a string was expected, elsewhere the flash. */
static bool is_about_a_name(void)
{
    return strstr(refusal.text, "Application info") != NULL || strstr(refusal.text, "Name ") != NULL ||
           strstr(refusal.text, "damaged (table 0, ") != NULL;
}

/* Checks that `names` reads are of names and strings, and returns how many others a check takes. */
static RTS_UI32 check_after_each_read(RTS_UI32 names)
{
    RTS_UI32 found = 0;
    RTS_UI32 read = 1;

    for (;; read++) {
        RTS_UI32 before = SimFlashCalls(SIM_READ);
        if (check_until(read) == ERR_OK)
            break;
        if (is_about_a_name())
            found++;
        else
            CHECK(strcmp(refusal.text, "The flash cannot be read.") == 0);
        CHECK_EQUAL(SimFlashCalls(SIM_READ) - before, read - 1 + TRIES);
    }
    CHECK_EQUAL(refusal.text[0], '\0');
    CHECK_EQUAL(found, names);
    return read - 1 - found;
}

enum { INFO_BYTES = 41 }; /* of spec_init(), with the NULs */

static void an_image_with_inputs_and_outputs(void)
{
    SimFlashSetMapped(0);
    begin_io();
    io_add_parameter(&io, 1, 32, 0);
    io_add_text_parameter(&io, 2, "COM2");
    io_add_connector(&io, "Device", "IoDrvTest");
    add_copying_task("Main", 10000, 0);
    add_copying_task("Other", 20000, 8);
    add_bytes(0, IO_MAP_INPUTS, 0, 4);
    add_bytes(0, IO_MAP_OUTPUTS, 0, 4);
    add_bytes(1, IO_MAP_INPUTS, 8, 4);
    CHECK_EQUAL(load_io(), ERR_OK);
    CHECK(check_after_each_read(INFO_BYTES + 2 * 2) > 20);
    SimFlashSetMapped(1);
}

enum { IECRAISE_SIGNATURE = 0x703B892E };

/* Without inputs and outputs: names of a function that it calls, two tasks, and what these use. */
static void begin_plain(void)
{
    SimFlashSetMapped(0);
    begin_io();
    io.head.connectors = 0;
    spec_counter(&spec, 1);
    spec.kept_count = 0;
    add_import(&spec, "iecraise", IECRAISE_SIGNATURE, 0x00010000);
    add_task(&spec, "Other", KIND_CYCLIC, 1000, 0);
    spec.image_count = 4;
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
}

static void an_image_without_inputs_and_outputs(void)
{
    RTS_UI32 name_bytes = sizeof "iecraise";

    begin_plain();
    CHECK(check_after_each_read(INFO_BYTES + name_bytes) > 10);
    SimFlashSetMapped(1);
}

static void the_tables_of_an_image(void)
{
    static APP_TABLES tables;
    APP_IMAGE checked;
    RTS_UI32 read = 1;

    begin_plain();
    CHECK_EQUAL(AppLoaderCheck(FILE_SLOT_A, image.size, image_crc(&image), &checked, &refusal), ERR_OK);
    for (;; read++) {
        RTS_UI32 before;
        RTS_RESULT result;
        (void)AppLoaderRead(&checked, &tables); /* its name may still be in memory */
        before = SimFlashCalls(SIM_READ);
        SimFlashFailFrom(SIM_READ, read);
        result = AppLoaderRead(&checked, &tables);
        SimFlashFailFrom(SIM_READ, 0);
        if (result == ERR_OK)
            break;
        CHECK_EQUAL(SimFlashCalls(SIM_READ) - before, read - 1 + TRIES);
    }
    CHECK_EQUAL(read - 1, sizeof "iecraise" + 1);
    SimFlashSetMapped(1);
}

static void a_string_of_the_information_is_empty(void)
{
    APP_IMAGE checked;
    RTS_UI32 read;
    char text[16];

    begin_plain();
    CHECK_EQUAL(AppLoaderCheck(FILE_SLOT_A, image.size, image_crc(&image), &checked, &refusal), ERR_OK);
    for (read = 1; read <= sizeof "Project"; read++) {
        SimFlashFailFrom(SIM_READ, read);
        AppLoaderReadInfo(&checked, 0, text, sizeof text);
        SimFlashFailFrom(SIM_READ, 0);
        CHECK_EQUAL(strlen(text), read - 1);
        SimFlashFailFrom(SIM_READ, read);
        AppLoaderReadInfo(&checked, 1, text, sizeof text);
        SimFlashFailFrom(SIM_READ, 0);
        CHECK_EQUAL(text[0], '\0');
    }
    SimFlashSetMapped(1);
}

/* Any bytes of the image may be the table: none is the event's. */
static void the_function_of_an_event(void)
{
    APP_IMAGE checked;
    RTS_UI32 read;

    begin_plain();
    memset(&checked, 0, sizeof checked);
    checked.iec_functions.offset = 16;
    checked.iec_functions.size = 10 * sizeof(FUNCTION_INFO);
    for (read = 1; read <= 2; read++) {
        RTS_UI32 before = SimFlashCalls(SIM_READ);
        SimFlashFailFrom(SIM_READ, read);
        CHECK_EQUAL(AppLoaderFindEvent(&checked, 5), IMAGE_NO_ENTRY);
        SimFlashFailFrom(SIM_READ, 0);
        CHECK_EQUAL(SimFlashCalls(SIM_READ) - before, read - 1 + TRIES);
    }
    SimFlashSetMapped(1);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(an_image_with_inputs_and_outputs);
    RUN(an_image_without_inputs_and_outputs);
    RUN(the_tables_of_an_image);
    RUN(the_function_of_an_event);
    RUN(a_string_of_the_information_is_empty);
    return test_result();
}
