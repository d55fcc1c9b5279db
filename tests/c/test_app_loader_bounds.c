/*
 * test_app_loader_bounds.c - exact bounds of an image: the last possible value is accepted, the next one refused.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "../../firmware/src/load/AppFunctions.h"
#include "../../firmware/src/load/AppLoader.h"
#include "AppIo.h"
#include "SysFileFlash.h"
#include "app_device.h"

static APP_SPEC spec;
static APP_BYTES image;
static CDL_HEADER header;
static APP_REFUSAL refusal;
static APP_IMAGE checked;

static void begin(void)
{
    start_blank();
    spec_counter(&spec, 2);
}

static void begin_image(void)
{
    begin();
    build_image(&image, &spec);
    header = image_header(&image);
}

/* Checks the image as it is; only what is accepted is loaded. */
static RTS_RESULT try_image(void)
{
    return download_part(&image, image.size, &refusal);
}

static RTS_RESULT try_spec(void)
{
    build_image(&image, &spec);
    return try_image();
}

static RTS_RESULT try_header(void)
{
    image_set_header(&image, header);
    return try_image();
}

static void check_refused(RTS_RESULT actual, RTS_RESULT expected, const char *text)
{
    CHECK_EQUAL(actual, expected);
    CHECK(strstr(refusal.text, text) != NULL);
    if (strstr(refusal.text, text) == NULL)
        fprintf(stderr, "instead of %s: %s\n", text, refusal.text);
}

/* ---- header and segments ---- */

static void a_header_alone_has_no_code(void)
{
    CDL_HEADER bare;

    begin_image();
    bare = header;
    memset(&bare.code, 0, sizeof bare.code);
    bare.application_info = bare.area_table = bare.function_table = bare.code;
    bare.external_function_table = bare.iec_function_table = bare.blob = bare.code;
    bare.total_size = image.size = CDL_HEADER_SIZE;
    image_set_header(&image, bare);
    check_refused(try_image(), ERR_OUT_OF_LIMITS, "no code");
}

static void a_segment_one_byte_before_or_after_its_place(void)
{
    begin_image();
    header.blob.offset = CDL_HEADER_SIZE - 1;
    check_refused(try_header(), ERR_OUT_OF_LIMITS, "Blob segment overlaps the header");
    header.blob.offset = image.size + 1;
    check_refused(try_header(), ERR_OUT_OF_LIMITS, "Blob segment ends beyond the image");
}

/* ---- areas ---- */

/* In the table after those of `spec`, whose last one it replaces. */
static void list_area(RTS_UI16 index, RTS_UI32 size)
{
    AREA_INFO *area;

    begin_image();
    area = (AREA_INFO *)(void *)(image.bytes + header.area_table.offset + header.area_table.size - sizeof *area);
    area->index = index;
    area->size = size;
    image_fix_crc(&image);
}

static void a_listed_code_area_has_any_size(void)
{
    list_area(APP_AREA_CODE, 0xFFFFFFFFu);
    CHECK_EQUAL(try_image(), ERR_OK);
}

static void a_retain_area_is_at_most_that_of_the_device(void)
{
    begin();
    CHECK_EQUAL(SimFlashConfigure(1024 * 1024, 4096, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    spec.areas[APP_AREA_RETAIN] = APP_RETAIN_SIZE + 1;
    check_refused(try_spec(), ERR_NOMEMORY, "this device has 65536");
    spec.areas[APP_AREA_RETAIN] = APP_RETAIN_SIZE;
    CHECK_EQUAL(try_spec(), ERR_OK);
}

/* ---- functions ---- */

static void a_function_may_be_the_last_byte_of_the_code(void)
{
    begin();
    spec.function[CDL_FUNCTION_GLOBAL_EXIT] = (RTS_I32)here(&spec);
    emit_ret(&spec);
    CHECK_EQUAL(spec.function[CDL_FUNCTION_GLOBAL_EXIT], (RTS_I32)spec.code_size - 1);
    spec.tasks[0].entry_offset = spec.code_size - 1;
    CHECK_EQUAL(try_spec(), ERR_OK);
}

static void a_function_in_another_area_than_the_code(void)
{
    RTS_UI16 area = APP_AREA_DATA;

    begin_image();
    memcpy(image.bytes + header.function_table.offset + offsetof(POU_REF, area), &area, sizeof area);
    image_fix_crc(&image);
    check_refused(try_image(), ERR_INVALID_REFERENCE, "Function 0 is outside the code");
}

static RTS_RESULT try_import(const char *name)
{
    begin();
    add_import(&spec, name, 1, 0x00010000);
    return try_spec();
}

static void names_are_of_visible_characters(void)
{
    check_refused(try_import("!"), ERR_APP_UNRESOLVED_REFERENCE, "! (missing)");
    check_refused(try_import("a~"), ERR_APP_UNRESOLVED_REFERENCE, "a~ (missing)");
    check_refused(try_import("a\x7F"), ERR_PARAMETER, "Name of external function 0");
    check_refused(try_import("a "), ERR_PARAMETER, "Name of external function 0");
}

enum { EVENT = 77 };

/* Appends an IEC function table with functions of the identifiers, at offsets 1, 2 .. of the code. */
static void begin_with_functions(const RTS_UI32 *identifiers, RTS_UI32 count)
{
    RTS_UI32 i;

    begin_image();
    pad(&image, 4);
    header.iec_function_table.offset = image.size;
    for (i = 0; i < count; i++) {
        FUNCTION_INFO info = {0, APP_AREA_CODE, i + 1, 0, identifiers[i], 0};
        append(&image, &info, sizeof info);
        append(&image, "abc", 4);
    }
    header.iec_function_table.size = image.size - header.iec_function_table.offset;
    append(&image, "\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0", 20);
    header.total_size = image.size;
    image_set_header(&image, header);
    CHECK_EQUAL(try_image(), ERR_OK);
    CHECK_EQUAL(AppLoaderCheck(FILE_SLOT_A, image.size, image_crc(&image), &checked, &refusal), ERR_OK);
}

static void the_function_of_an_event_is_found_anywhere_in_the_table(void)
{
    static const RTS_UI32 identifiers[] = {5, 0, EVENT};

    begin_with_functions(identifiers, RTS_COUNT(identifiers));
    CHECK_EQUAL(AppLoaderFindEvent(&checked, 5), 1);
    CHECK_EQUAL(AppLoaderFindEvent(&checked, EVENT), 3);
    CHECK_EQUAL(AppLoaderFindEvent(&checked, EVENT + 1), IMAGE_NO_ENTRY);
}

/* What follows the table looks like an entry with this identifier. */
static void the_table_of_functions_ends_where_the_header_says(void)
{
    static const RTS_UI32 identifiers[] = {5, EVENT};

    begin_with_functions(identifiers, RTS_COUNT(identifiers));
    checked.iec_functions.size -= (RTS_UI32)sizeof(FUNCTION_INFO) + 4;
    CHECK_EQUAL(AppLoaderFindEvent(&checked, EVENT), IMAGE_NO_ENTRY);
    checked.iec_functions.size = 0;
    CHECK_EQUAL(AppLoaderFindEvent(&checked, 5), IMAGE_NO_ENTRY);
}

/* ---- application info ---- */

static void a_string_of_the_information_is_cut_to_its_room(void)
{
    char text[16];

    begin_image();
    CHECK_EQUAL(try_image(), ERR_OK);
    CHECK_EQUAL(AppLoaderCheck(FILE_SLOT_A, image.size, image_crc(&image), &checked, &refusal), ERR_OK);
    memset(text, 'x', sizeof text);
    AppLoaderReadInfo(&checked, 0, text, 8);
    CHECK(memcmp(text, "Project\0x", 9) == 0);
    AppLoaderReadInfo(&checked, 0, text, 7);
    CHECK(memcmp(text, "Projec\0\0x", 9) == 0);
    AppLoaderReadInfo(&checked, 0, text, 1);
    CHECK(memcmp(text, "\0rojec\0", 7) == 0);
    memset(text, 'x', sizeof text);
    AppLoaderReadInfo(&checked, 0, text, sizeof text);
    CHECK(memcmp(text, "Project\0xxx", 11) == 0);
}

/* ---- blobs and tasks ---- */

/* Makes the last blob of the image another one. */
static void set_last_blob(RTS_UI32 data_size, RTS_UI32 id, RTS_UI32 size)
{
    RTS_UI8 *at = image.bytes + header.blob.offset + header.blob.size - data_size - sizeof(CDL_BLOB);

    memcpy(at + offsetof(CDL_BLOB, id), &id, sizeof id);
    memcpy(at + offsetof(CDL_BLOB, size), &size, sizeof size);
    image_fix_crc(&image);
}

static void begin_with_blob(const void *data, RTS_UI32 size)
{
    begin();
    spec.exports = data;
    spec.exports_size = size;
    build_image(&image, &spec);
    header = image_header(&image);
}

static void a_blob_that_ends_one_byte_after_its_segment(void)
{
    begin_with_blob("1234", 4);
    set_last_blob(4, CDL_BLOB_EXPORTS, 5);
    check_refused(try_image(), ERR_OUT_OF_LIMITS, "ends beyond its segment");
    set_last_blob(4, CDL_BLOB_EXPORTS, 4);
    CHECK_EQUAL(try_image(), ERR_OK);
}

static void numbers_from_this_one_on_name_what_a_program_needs(void)
{
    begin_with_blob("1234", 4);
    set_last_blob(4, CDL_BLOB_REQUIRED - 1, 4);
    CHECK_EQUAL(try_image(), ERR_OK);
    set_last_blob(4, CDL_BLOB_REQUIRED, 4);
    check_refused(try_image(), ERR_NOT_SUPPORTED, "needs what this firmware lacks");
}

static void a_change_of_another_size_is_ignored(void)
{
    begin_with_blob("1234", 4);
    set_last_blob(4, CDL_BLOB_CHANGE, 4);
    CHECK_EQUAL(try_image(), ERR_OK);
}

static void an_io_configuration_needs_an_io_manager(void)
{
    const APP_IO *manager = AppIoGet();

    begin_with_blob("\0\0\0\0\0\0\0\0", 8);
    set_last_blob(8, CDL_BLOB_IO, 8);
    AppIoRegister(NULL);
    check_refused(try_image(), ERR_NOT_SUPPORTED, "needs what this firmware lacks");
    AppIoRegister(manager);
}

static void an_event_may_be_the_last_byte_of_the_last_area(void)
{
    begin();
    spec.areas[APP_AREA_MEMORY] = 4;
    spec.tasks[0].kind = KIND_LEVEL;
    spec.tasks[0].event_area = APP_AREA_MEMORY;
    spec.tasks[0].event_offset = 3;
    CHECK_EQUAL(try_spec(), ERR_OK);
}

/* ---- external events ---- */

enum { NOTHING_POSTS_IT = 12345 };

static void any_task_may_wait_in_vain(void)
{
    RTS_UI32 waits;

    for (waits = 0; waits < 3; waits++) {
        begin();
        add_task(&spec, "Second", KIND_CYCLIC, 1000, 0);
        add_task(&spec, "Third", KIND_CYCLIC, 1000, 0);
        spec.tasks[waits].kind = KIND_EXTERNAL;
        spec.tasks[waits].event_offset = NOTHING_POSTS_IT;
        check_refused(try_spec(), ERR_NO_OBJECT, "waits for an event that nothing posts");
        CHECK(strstr(refusal.text, spec.tasks[waits].name) != NULL);
    }
}

/* No driver can post it. */
static void without_an_io_manager_a_task_may_wait_in_vain_too(void)
{
    const APP_IO *manager = AppIoGet();

    begin();
    spec.tasks[0].kind = KIND_EXTERNAL;
    spec.tasks[0].event_offset = NOTHING_POSTS_IT;
    AppIoRegister(NULL);
    check_refused(try_spec(), ERR_NO_OBJECT, "waits for an event that nothing posts");
    spec_counter(&spec, 2);
    CHECK_EQUAL(try_spec(), ERR_OK);
    AppIoRegister(manager);
}

/* An entry that follows the last task looks like one that waits. */
static void what_follows_the_tasks_is_none(void)
{
    RTS_UI8 others[64];

    memset(others, KIND_EXTERNAL, sizeof others);
    start_blank();
    spec_counter(&spec, 2);
    spec.kept_count = 0;
    spec.exports = others;
    spec.exports_size = sizeof others;
    CHECK_EQUAL(try_spec(), ERR_OK);
}

/* ---- what tasks use of inputs and outputs ---- */

static const CDL_IMAGE too_large = {0, 0xFFFF, 0};

static void an_entry_after_that_of_the_last_task_is_ignored(void)
{
    begin();
    spec.image_count = 3;
    spec.images[2] = too_large;
    CHECK_EQUAL(try_spec(), ERR_OK);
}

static void a_part_of_an_entry_is_ignored(void)
{
    begin();
    spec.image_count = 2;
    spec.images[1] = too_large;
    build_image(&image, &spec);
    header = image_header(&image);
    header.blob.size--;
    image_set_header(&image, header);
    set_last_blob(2 * sizeof(CDL_IMAGE) - 1, CDL_BLOB_IMAGES, 2 * sizeof(CDL_IMAGE) - 1);
    CHECK_EQUAL(try_image(), ERR_OK);
}

/* A unit may end after the area, which is not whole units. */
static void an_image_covers_the_last_byte_of_an_area(void)
{
    CDL_IMAGE units = {0, 2, 0};

    begin();
    spec.areas[APP_AREA_INPUT] = CDL_IMAGE_UNIT + 1;
    spec.image_count = 2;
    spec.images[0] = units;
    CHECK_EQUAL(try_spec(), ERR_OK);
    spec.areas[APP_AREA_INPUT] = CDL_IMAGE_UNIT;
    check_refused(try_spec(), ERR_NOMEMORY, "process image");
}

/* All tasks write all outputs and read all inputs: that is what the simulator has room for. */
static void one_unit_more_than_the_device_has(void)
{
    CDL_IMAGE outputs = {0, APP_OUTPUT_SIZE / CDL_IMAGE_UNIT, CDL_IMAGE_WRITTEN | CDL_IMAGE_SHARED};
    CDL_IMAGE inputs = {0, APP_INPUT_SIZE / CDL_IMAGE_UNIT, CDL_IMAGE_SHARED};
    RTS_UI32 i;

    begin();
    spec.areas[APP_AREA_INPUT] = APP_INPUT_SIZE;
    spec.areas[APP_AREA_OUTPUT] = APP_OUTPUT_SIZE;
    while (spec.task_count < APP_MAX_TASKS)
        add_task(&spec, "Other", KIND_CYCLIC, 1000, 0);
    spec.image_count = 2 * APP_MAX_TASKS;
    for (i = 0; i < spec.image_count; i++)
        spec.images[i] = i % 2 == 0 ? inputs : outputs;
    CHECK_EQUAL(try_spec(), ERR_OK);
    spec.images[0].flags |= CDL_IMAGE_WRITTEN; /* counts twice */
    spec.images[0].count = inputs.count / 2 + 1;
    spec.images[2].count = inputs.count - 1;
    check_refused(try_spec(), ERR_NOMEMORY, "needs 196616 bytes, this device has 196608.");
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_header_alone_has_no_code);
    RUN(a_segment_one_byte_before_or_after_its_place);
    RUN(a_listed_code_area_has_any_size);
    RUN(a_retain_area_is_at_most_that_of_the_device);
    RUN(a_function_may_be_the_last_byte_of_the_code);
    RUN(a_function_in_another_area_than_the_code);
    RUN(names_are_of_visible_characters);
    RUN(the_function_of_an_event_is_found_anywhere_in_the_table);
    RUN(the_table_of_functions_ends_where_the_header_says);
    RUN(a_string_of_the_information_is_cut_to_its_room);
    RUN(a_blob_that_ends_one_byte_after_its_segment);
    RUN(numbers_from_this_one_on_name_what_a_program_needs);
    RUN(a_change_of_another_size_is_ignored);
    RUN(an_io_configuration_needs_an_io_manager);
    RUN(an_event_may_be_the_last_byte_of_the_last_area);
    RUN(any_task_may_wait_in_vain);
    RUN(without_an_io_manager_a_task_may_wait_in_vain_too);
    RUN(what_follows_the_tasks_is_none);
    RUN(an_entry_after_that_of_the_last_task_is_ignored);
    RUN(a_part_of_an_entry_is_ignored);
    RUN(an_image_covers_the_last_byte_of_an_area);
    RUN(one_unit_more_than_the_device_has);
    return test_result();
}
