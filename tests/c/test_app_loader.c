/*
 * test_app_loader.c - what the loader refuses, each with its own words, and that the old application runs on.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysFileFlash.h"
#include "app_image.h"
#include "test.h"

static APP_SPEC spec;
static APP_BYTES image;
static CDL_HEADER header;
static APP_REFUSAL refusal;

/* A device on which application 1 runs; `spec` is a good one to be spoilt. */
static void begin(void)
{
    APP_BYTES first;

    CHECK_EQUAL(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    build_counter(&first, 1);
    CHECK_EQUAL(download(&first), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    spec_counter(&spec, 2);
}

static void begin_image(void)
{
    begin();
    build_image(&image, &spec);
    header = image_header(&image);
}

/* The image is refused with `result` and words that contain `text`, and application 1 has not noticed. */
static void check_refused(RTS_RESULT result, const char *text)
{
    RTS_UI32 before = read_u32(APP_AREA_DATA, COUNTER_OFFSET);

    CHECK_EQUAL(download_part(&image, image.size, &refusal), result);
    if (strstr(refusal.text, text) == NULL)
        fprintf(stderr, "refused with: %s\n", refusal.text);
    CHECK(strstr(refusal.text, text) != NULL);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK(read_u32(APP_AREA_DATA, COUNTER_OFFSET) >= before + 10);
}

static void check_spec_refused(RTS_RESULT result, const char *text)
{
    build_image(&image, &spec);
    check_refused(result, text);
}

static void check_header_refused(RTS_RESULT result, const char *text)
{
    image_set_header(&image, header);
    check_refused(result, text);
}

static void check_accepted(void)
{
    CHECK_EQUAL(download_part(&image, image.size, &refusal), ERR_OK);
    CHECK_EQUAL(refusal.text[0], '\0');
}

/* ---- header ---- */

static void an_image_shorter_than_its_header(void)
{
    begin_image();
    image.size = 103;
    check_refused(ERR_SIZE_MISMATCH, "Image of 103 bytes");
    image.size = 0;
    check_refused(ERR_SIZE_MISMATCH, "Image of 0 bytes");
}

static void something_else_than_an_image(void)
{
    begin_image();
    header.header_tag = 0x464C457F;
    check_header_refused(ERR_TYPE_MISMATCH, "Not a compact download image: it starts with 0x464C457F");
}

static void another_header_version(void)
{
    begin_image();
    header.header_version = 2;
    check_header_refused(ERR_VERSION_MISMATCH, "Header version 2 of 104 bytes");
    header.header_version = 1;
    header.header_size = 112;
    check_header_refused(ERR_VERSION_MISMATCH, "Header version 1 of 112 bytes");
}

static void another_total_size(void)
{
    begin_image();
    header.total_size++;
    check_header_refused(ERR_SIZE_MISMATCH, "should have");
}

static void a_wrong_crc(void)
{
    begin_image();
    image.bytes[image.size - 1] ^= 1;
    check_refused(ERR_CRC_FAILED, "damaged");
}

static void another_image_than_announced(void)
{
    begin_image();
    CHECK_EQUAL(AppDownloadBegin(image.size, image_crc(&image) + 1), ERR_OK);
    CHECK_EQUAL(AppDownloadWrite(0, image.bytes, image.size), ERR_OK);
    CHECK_EQUAL(AppDownloadEnd(&refusal), ERR_CRC_FAILED);
    CHECK(strstr(refusal.text, "not the announced one") != NULL);
}

/* ---- target ---- */

static void another_device_type(void)
{
    begin_image();
    header.device_type = 0x1001;
    check_header_refused(ERR_TYPE_MISMATCH, "for device type 0x00001001, this device is 0x00001000");
}

static void another_device_id(void)
{
    begin_image();
    header.device_id = TARGET_ID_CORTEX_M3;
    check_header_refused(ERR_ID_MISMATCH, "for device id 0x00009004, this device is 0x00009001");
}

static void another_major_version(void)
{
    begin_image();
    header.device_version = 0x02000000;
    check_header_refused(ERR_VERSION_MISMATCH, "for device version 2.x, this device has 1.x");
    header.device_version = 0x01020304;
    image_set_header(&image, header);
    check_accepted();
}

/* ---- segments ---- */

typedef struct {
    CDL_SEGMENT *segment;
    const char *name;
    RTS_UI32 align;
} SEGMENT_CASE;

static void every_segment_is_after_the_header_and_within_the_image(void)
{
    const SEGMENT_CASE cases[] = {
        {&header.code, "Code", 16},
        {&header.application_info, "Application info", 4},
        {&header.area_table, "Area table", 4},
        {&header.function_table, "Function table", 4},
        {&header.external_function_table, "External function table", 4},
        {&header.iec_function_table, "IEC function table", 4},
        {&header.blob, "Blob", 4},
    };
    char text[100];
    RTS_SIZE i;

    for (i = 0; i < RTS_COUNT(cases); i++) {
        CDL_SEGMENT *segment = cases[i].segment;
        begin_image();
        segment->size = 16;
        segment->offset = CDL_HEADER_SIZE - 4;
        snprintf(text, sizeof text, "%s segment overlaps the header", cases[i].name);
        check_header_refused(ERR_OUT_OF_LIMITS, text);
        snprintf(text, sizeof text, "%s segment ends beyond", cases[i].name);
        segment->offset = image.size - 15;
        check_header_refused(ERR_OUT_OF_LIMITS, text);
        segment->offset = 0xFFFFFFF0;
        check_header_refused(ERR_OUT_OF_LIMITS, text);
        segment->offset = 112;
        segment->size = 0xFFFFFFF0;
        check_header_refused(ERR_OUT_OF_LIMITS, text);
        segment->offset = 112 + cases[i].align / 2;
        segment->size = 16;
        snprintf(text, sizeof text, "%s segment is not aligned to %u bytes", cases[i].name, (unsigned)cases[i].align);
        check_header_refused(ERR_ALIGNMENT, text);
    }
}

static void an_image_without_code(void)
{
    begin_image();
    header.code.size = 0;
    check_header_refused(ERR_OUT_OF_LIMITS, "no code");
}

static void code_in_another_area_or_larger_than_it(void)
{
    begin_image();
    header.code_area_index = APP_AREA_DATA;
    check_header_refused(ERR_OUT_OF_LIMITS, "not in area 5");
    header.code_area_index = APP_AREA_CODE;
    header.code_area_size = header.code.size - 1;
    check_header_refused(ERR_OUT_OF_LIMITS, "above its 99 bytes");
}

/* ---- areas ---- */

static void areas_larger_than_the_device_has(void)
{
    static const struct {
        RTS_UI32 area;
        RTS_UI32 limit;
        const char *name;
    } cases[] = {
        {APP_AREA_DATA, APP_DATA_SIZE, "data"},
        {APP_AREA_INPUT, APP_INPUT_SIZE, "input"},
        {APP_AREA_OUTPUT, APP_OUTPUT_SIZE, "output"},
        {APP_AREA_MEMORY, APP_MEMORY_SIZE, "memory"},
    };
    char text[100];
    RTS_SIZE i;

    for (i = 0; i < RTS_COUNT(cases); i++) {
        begin();
        spec.areas[cases[i].area] = cases[i].limit + 1;
        snprintf(text, sizeof text, "The %s area needs %u bytes, this device has %u.", cases[i].name,
                 (unsigned)cases[i].limit + 1, (unsigned)cases[i].limit);
        check_spec_refused(ERR_NOMEMORY, text);
        spec.areas[cases[i].area] = cases[i].limit;
        build_image(&image, &spec);
        check_accepted();
        CHECK(AppGetAreaAddress(cases[i].area, cases[i].limit - 1, 1) != NULL);
    }
}

static void a_retain_area_larger_than_its_flash(void)
{
    begin();
    spec.areas[APP_AREA_RETAIN] = SysFileGetArea(FILE_RETAIN)->size / 2 - 19;
    check_spec_refused(ERR_NOMEMORY, "The retain area needs");
    spec.areas[APP_AREA_RETAIN]--;
    build_image(&image, &spec);
    check_accepted();
}

static void an_area_table_with_half_an_entry(void)
{
    begin_image();
    header.area_table.size -= 4;
    check_header_refused(ERR_SIZE_MISMATCH, "Area table segment ends within an entry");
}

static void an_unknown_or_repeated_area(void)
{
    begin_image();
    image.bytes[header.area_table.offset + 4] = APP_AREA_COUNT;
    image_fix_crc(&image);
    check_refused(ERR_OUT_OF_LIMITS, "Area 6 is unknown or listed twice");
    image.bytes[header.area_table.offset + 4] = APP_AREA_RETAIN;
    image_fix_crc(&image);
    check_refused(ERR_OUT_OF_LIMITS, "Area 1 is unknown or listed twice");
}

static void the_code_area_may_be_listed(void)
{
    begin_image();
    image.bytes[header.area_table.offset + 16 + 4] = APP_AREA_CODE;
    image_fix_crc(&image);
    check_accepted();
}

/* ---- function table ---- */

static void a_function_table_of_another_size(void)
{
    begin_image();
    header.function_table.size -= 8;
    check_header_refused(ERR_SIZE_MISMATCH, "Function table has 40 bytes, not 48");
    header.function_table.size = 0;
    check_header_refused(ERR_SIZE_MISMATCH, "Function table has 0 bytes");
}

static void a_function_outside_the_code(void)
{
    begin();
    spec.function[CDL_FUNCTION_CODE_INIT] = (RTS_I32)spec.code_size;
    check_spec_refused(ERR_INVALID_REFERENCE, "Function 0 is outside the code");
    spec.function[CDL_FUNCTION_CODE_INIT] = SPEC_NO_ENTRY;
    spec.function[CDL_FUNCTION_GLOBAL_EXIT] = 0x7FFFFFFF;
    check_spec_refused(ERR_INVALID_REFERENCE, "Function 2 is outside the code");
}

static void functions_that_position_independent_code_does_not_need(void)
{
    int i;

    for (i = CDL_FUNCTION_RELOC; i < CDL_FUNCTION_COUNT; i++) {
        begin();
        spec.function[i] = 0;
        check_spec_refused(ERR_NOT_SUPPORTED, "is not supported");
    }
}

/* ---- external functions ---- */

enum { IECRAISE_SIGNATURE = 0x703B892E, SIMBURN_SIGNATURE = 0x76DDCD81 };

static void every_missing_function_is_named(void)
{
    begin();
    add_import(&spec, "nosuch", 1, 0x00010000);
    add_import(&spec, "iecraise", IECRAISE_SIGNATURE, 0x00010000);
    add_import(&spec, "noneither", 2, 0x00010000);
    add_import(&spec, "simburn", SIMBURN_SIGNATURE + 1, 0x00010000);
    add_import(&spec, "simburn", SIMBURN_SIGNATURE, 0x00010001);
    check_spec_refused(ERR_APP_UNRESOLVED_REFERENCE,
                       "nosuch (missing), noneither (missing), simburn (other parameters), simburn (other version)");
}

static void anything(void)
{
}

/* 10.5.4 of the manual: its author answers for the parameters. */
static void a_function_with_signature_0_is_called_with_any_parameters(void)
{
    static const CMP_EXT_FUNCTION unsigned_functions[] = {{"unchecked", 0, 0x00010000, (RTS_PFN)anything}};

    begin();
    CHECK(CMRegisterExternal(unsigned_functions, RTS_COUNT(unsigned_functions)) == ERR_OK);
    add_import(&spec, "unchecked", 0x12345678, 0x00010000);
    build_image(&image, &spec);
    check_accepted();
    begin();
    CHECK(CMRegisterExternal(unsigned_functions, RTS_COUNT(unsigned_functions)) == ERR_OK);
    add_import(&spec, "unchecked", 0x12345678, 0x00020000);
    check_spec_refused(ERR_APP_VERSION_MISMATCH, "unchecked (other version)");
}

static void the_first_problem_gives_the_result(void)
{
    begin();
    add_import(&spec, "simburn", 1, 0x00010000);
    add_import(&spec, "nosuch", 1, 0x00010000);
    check_spec_refused(ERR_APP_SIGNATURE_MISMATCH, "simburn (other parameters), nosuch (missing)");
}

static void versions_are_compatible_within_the_major(void)
{
    static const struct {
        RTS_UI32 version;
        RTS_RESULT result;
    } cases[] = {
        {0x00010000, ERR_OK},
        {0x00010001, ERR_APP_VERSION_MISMATCH},
        {0x00020000, ERR_APP_VERSION_MISMATCH},
        {0x00000009, ERR_APP_VERSION_MISMATCH},
    };
    RTS_SIZE i;

    for (i = 0; i < RTS_COUNT(cases); i++) {
        begin();
        add_import(&spec, "simburn", SIMBURN_SIGNATURE, cases[i].version);
        build_image(&image, &spec);
        if (cases[i].result == ERR_OK)
            check_accepted();
        else
            check_refused(cases[i].result, "simburn (other version)");
    }
}

static void a_list_of_missing_functions_that_is_too_long_is_cut(void)
{
    RTS_UI32 i;

    begin();
    for (i = 0; i < 40; i++)
        add_import(&spec, "function_that_does_not_exist", 1, 0x00010000);
    check_spec_refused(ERR_APP_UNRESOLVED_REFERENCE, "function_that_does_not_exist (missing), function");
    CHECK_EQUAL(strlen(refusal.text), APP_REFUSAL_SIZE - 1);
}

static void as_many_functions_as_the_device_can_link_but_not_one_more(void)
{
    RTS_UI32 i;

    begin();
    for (i = 0; i < APP_MAX_IMPORTS; i++)
        add_import(&spec, "simburn", SIMBURN_SIGNATURE, 0x00010000);
    build_image(&image, &spec);
    check_accepted();
    begin();
    for (i = 0; i <= APP_MAX_IMPORTS; i++)
        add_import(&spec, "simburn", SIMBURN_SIGNATURE, 0x00010000);
    check_spec_refused(ERR_NOMEMORY, "More than the 128 external functions");
}

static void begin_with_import(void)
{
    begin();
    add_import(&spec, "simburn", SIMBURN_SIGNATURE, 0x00010000);
    build_image(&image, &spec);
    header = image_header(&image);
}

static void an_external_function_without_a_good_name(void)
{
    RTS_UI32 name;

    begin_with_import();
    name = header.external_function_table.offset + EXT_REF_INFO_SIZE;
    image.bytes[name] = '\0';
    image_fix_crc(&image);
    check_refused(ERR_PARAMETER, "Name of external function 0");
    image.bytes[name] = ' ';
    image_fix_crc(&image);
    check_refused(ERR_PARAMETER, "Name of external function 0");
    begin_with_import();
    header.external_function_table.size = EXT_REF_INFO_SIZE + 7; /* without the NUL */
    check_header_refused(ERR_PARAMETER, "Name of external function 0");
}

static void a_name_longer_than_any_function_has(void)
{
    char name[100];

    memset(name, 'a', sizeof name);
    name[APP_NAME_SIZE] = '\0';
    begin();
    add_import(&spec, name, 1, 0x00010000);
    check_spec_refused(ERR_PARAMETER, "too long");
    name[APP_NAME_SIZE - 1] = '\0';
    build_image(&image, &spec);
    check_refused(ERR_APP_UNRESOLVED_REFERENCE, "aaaaaaaa");
}

static void an_external_function_table_that_ends_early(void)
{
    begin_with_import();
    header.external_function_table.size = EXT_REF_INFO_SIZE - 1;
    check_header_refused(ERR_SIZE_MISMATCH, "External function table segment ends within an entry");
    header.external_function_table.size = 28 + 2;
    check_header_refused(ERR_SIZE_MISMATCH, "External function table segment ends within an entry");
}

static void an_external_function_with_another_slot(void)
{
    begin_with_import();
    image.bytes[header.external_function_table.offset + 12] = 8;
    image_fix_crc(&image);
    check_refused(ERR_INVALID_REFERENCE, "simburn is not in import slot 0");
    begin_with_import();
    image.bytes[header.external_function_table.offset + 16] = 0;
    image_fix_crc(&image);
    check_refused(ERR_INVALID_REFERENCE, "simburn is not in import slot 0");
}

/* ---- IEC functions ---- */

/* An image with an IEC function table of one entry at its end. */
static void begin_with_iec_function(RTS_UI32 offset, const char *name, RTS_UI32 name_size)
{
    FUNCTION_INFO info = {0, APP_AREA_CODE, 0, 0, 0, 0};

    begin_image();
    info.offset = offset;
    pad(&image, 4);
    header.iec_function_table.offset = image.size;
    append(&image, &info, sizeof info);
    append(&image, name, name_size);
    header.iec_function_table.size = image.size - header.iec_function_table.offset;
    header.total_size = image.size;
    image_set_header(&image, header);
}

static void iec_functions_are_checked_too(void)
{
    begin_with_iec_function(0, "fn", 3);
    check_accepted();
    begin_with_iec_function(spec.code_size, "fn", 3);
    check_refused(ERR_INVALID_REFERENCE, "IEC function fn is outside the code");
    begin_with_iec_function(0, "fn", 2);
    check_refused(ERR_PARAMETER, "Name in the IEC function table");
    begin_with_iec_function(0, "fn", 3);
    header.iec_function_table.size = 19;
    check_header_refused(ERR_SIZE_MISMATCH, "IEC function table segment ends within an entry");
}

/* ---- application info ---- */

static void info_that_is_not_terminated(void)
{
    begin_image();
    header.application_info.size = 7; /* "Project" without its NUL */
    check_header_refused(ERR_PARAMETER, "Application info 0 is not terminated");
    header.application_info.size = 8 + 3;
    check_header_refused(ERR_PARAMETER, "Application info 1 is not terminated");
}

static void info_may_be_short_or_absent(void)
{
    begin_image();
    header.application_info.size = 8;
    image_set_header(&image, header);
    check_accepted();
    CHECK(strcmp(AppGetInfo(0), "Project") == 0);
    CHECK(strcmp(AppGetInfo(1), "") == 0);
    CHECK(strcmp(AppGetInfo(4), "") == 0);
    begin_image();
    header.application_info.offset = 0;
    header.application_info.size = 0;
    image_set_header(&image, header);
    check_accepted();
    CHECK(strcmp(AppGetInfo(0), "") == 0);
}

/* ---- blobs and tasks ---- */

static void an_application_without_tasks(void)
{
    begin();
    spec.task_count = 0;
    check_spec_refused(ERR_NO_OBJECT, "no task");
    begin_image();
    header.blob.offset = 0;
    header.blob.size = 0;
    check_header_refused(ERR_NO_OBJECT, "no task");
}

static void more_tasks_than_the_device_can_run(void)
{
    begin();
    while (spec.task_count <= APP_MAX_TASKS)
        add_task(&spec, "Task", KIND_CYCLIC, 1000, 0);
    check_spec_refused(ERR_NOMEMORY, "has 17 tasks, this device can run 16");
}

static void a_task_without_a_good_name(void)
{
    begin();
    spec.tasks[0].name[0] = '\0';
    check_spec_refused(ERR_PARAMETER, "Task 0 has no name");
    memset(spec.tasks[0].name, 'x', sizeof spec.tasks[0].name);
    check_spec_refused(ERR_PARAMETER, "Task 0 has no name");
}

static void a_task_with_wrong_values(void)
{
    begin();
    spec.tasks[0].kind = KIND_LEVEL + 1;
    check_spec_refused(ERR_NOT_SUPPORTED, "Task Main has the unknown kind 5");
    spec.tasks[0].kind = KIND_CYCLIC;
    spec.tasks[0].priority = 32;
    check_spec_refused(ERR_OUT_OF_LIMITS, "Task Main has priority 32");
    spec.tasks[0].priority = 31;
    spec.tasks[0].interval_us = 0;
    check_spec_refused(ERR_PARAMETER, "Cyclic task Main has no interval");
    spec.tasks[0].interval_us = 1;
    spec.tasks[0].entry_offset = spec.code_size;
    check_spec_refused(ERR_INVALID_REFERENCE, "Task Main is outside the code");
}

static void an_event_variable_outside_its_area(void)
{
    static const struct {
        RTS_UI16 area;
        RTS_UI32 offset;
    } cases[] = {
        {APP_AREA_DATA, 64}, {APP_AREA_DATA, 0xFFFFFFFF}, {APP_AREA_MEMORY, 0}, {APP_AREA_CODE, 0},
        {APP_AREA_COUNT, 0}, {APP_AREA_NONE, 0},          {0x8000, 0},
    };
    RTS_SIZE i;

    begin();
    spec.tasks[0].kind = KIND_EVENT;
    for (i = 0; i < RTS_COUNT(cases); i++) {
        spec.tasks[0].event_area = cases[i].area;
        spec.tasks[0].event_offset = cases[i].offset;
        check_spec_refused(ERR_INVALID_REFERENCE, "Event of task Main is outside its area");
    }
    spec.tasks[0].event_area = APP_AREA_DATA;
    spec.tasks[0].event_offset = 63;
    build_image(&image, &spec);
    check_accepted();
}

static void blobs_that_are_not_whole(void)
{
    begin_image();
    header.blob.size = 11;
    check_header_refused(ERR_SIZE_MISMATCH, "Blob segment ends within an entry");
    header.blob.size = 12;
    check_header_refused(ERR_OUT_OF_LIMITS, "Blob 1 ends beyond its segment");
    begin_image();
    image.bytes[header.blob.offset] ^= 1;
    image_fix_crc(&image);
    check_refused(ERR_TYPE_MISMATCH, "There is no blob at offset");
    begin_image();
    memset(image.bytes + header.blob.offset + 8, 0xFF, 4); /* its size */
    image_fix_crc(&image);
    check_refused(ERR_OUT_OF_LIMITS, "Blob 1 ends beyond its segment");
    begin_image();
    image.bytes[header.blob.offset + 8]--;
    image_fix_crc(&image);
    check_refused(ERR_SIZE_MISMATCH, "Task list of 55 bytes");
}

/* Refused, and the variable that is wrong is named. */
static void check_kept_refused(RTS_RESULT expected, const char *text)
{
    check_spec_refused(expected, text);
    begin();
}

static void kept_variables_outside_the_retain_area(void)
{
    static const CDL_KEPT_RUN wrong[] = {
        {4, 4, 5, 0},          {4, 4, 0, 0},   {4, 3, 2, 0},
        {0, 4, 1, 0},          {17, 17, 1, 0}, {4, 0, 2, 0},
        {4, 4, 0x40000001, 0}, {1, 1, 0, 1},   {4, 0xFFFF, 0x10002, 0},
        {65535, 65535, 1, 0},
    };
    RTS_UI32 i;

    begin();
    spec.kept[1].variable.place += 1 << CDL_KEPT_OFFSET_SHIFT; /* ends one byte past it */
    check_kept_refused(ERR_OUT_OF_LIMITS, "Kept variable 1 is out of place");
    spec.kept[0].variable.place |= 0xFFFFFFF0;
    check_kept_refused(ERR_OUT_OF_LIMITS, "Kept variable 0 is out of place");
    for (i = 0; i < RTS_COUNT(wrong); i++) {
        add_kept_run(&spec, 'C', 0, 0, wrong[i]);
        check_kept_refused(ERR_OUT_OF_LIMITS, "Kept variable 2 is out of place");
    }
}

static void a_table_of_kept_variables_that_is_cut_off(void)
{
    begin_image();
    image.bytes[header.blob.offset + 12 + sizeof(CDL_TASK) + 8] = 4; /* its size: as plctool wrote it once */
    image_fix_crc(&image);
    check_refused(ERR_OUT_OF_LIMITS, "Kept variable 0 is out of place; build again");
}

static void two_lists_of_tasks(void)
{
    begin_image();
    image.bytes[header.blob.offset + 12 + sizeof(CDL_TASK) + 4] = CDL_BLOB_TASKS;
    image_fix_crc(&image);
    check_refused(ERR_DUPLICATE, "two lists of tasks");
}

/* ---- what tasks use of inputs and outputs ---- */

/* Two tasks that use all of the outputs. */
static void begin_images(void)
{
    CDL_IMAGE all = {0, 16 / CDL_IMAGE_UNIT, CDL_IMAGE_WRITTEN | CDL_IMAGE_SHARED};

    begin();
    add_task(&spec, "Other", KIND_CYCLIC, 1000, 0);
    spec.image_count = 4;
    spec.images[1] = spec.images[3] = all;
}

static void tasks_may_use_all_of_an_area(void)
{
    begin_images();
    build_image(&image, &spec);
    check_accepted();
}

static void a_task_that_uses_more_than_there_is(void)
{
    static const CDL_IMAGE wrong[] = {{0, 3, 0}, {2, 1, 0}, {0xFFFF, 1, 0}, {1, 0xFFFF, 0}, {0xFFFF, 0xFFFF, 0}};
    RTS_UI32 i;

    for (i = 0; i < RTS_COUNT(wrong); i++) {
        begin_images();
        spec.images[3] = wrong[i];
        check_spec_refused(ERR_NOMEMORY, "The process image area needs 524280 bytes, this device has 196608.");
        begin_images();
        spec.images[0] = wrong[i];
        check_spec_refused(ERR_NOMEMORY, "The process image area needs");
    }
}

static void a_list_of_what_fewer_or_more_tasks_use(void)
{
    for (spec.image_count = 3; spec.image_count <= 5; spec.image_count++) {
        RTS_UI32 count = spec.image_count;
        begin_images();
        spec.image_count = count;
        build_image(&image, &spec);
        check_accepted();
    }
}

/* The simulator has as many as all tasks can need, unless they write inputs. */
static void copies_that_need_more_than_the_device_has(void)
{
    CDL_IMAGE all = {0, APP_INPUT_SIZE / CDL_IMAGE_UNIT, CDL_IMAGE_WRITTEN | CDL_IMAGE_SHARED};
    RTS_UI32 i;

    begin();
    spec.areas[APP_AREA_INPUT] = APP_INPUT_SIZE;
    spec.areas[APP_AREA_OUTPUT] = APP_OUTPUT_SIZE;
    while (spec.task_count < APP_MAX_TASKS)
        add_task(&spec, "Other", KIND_CYCLIC, 1000, 0);
    spec.image_count = 2 * APP_MAX_TASKS;
    for (i = 0; i < spec.image_count; i++)
        spec.images[i] = all;
    check_spec_refused(ERR_NOMEMORY, "The process image area needs 262144 bytes, this device has 196608.");
    for (i = 0; i < spec.image_count; i += 2)
        spec.images[i].flags = CDL_IMAGE_SHARED;
    build_image(&image, &spec);
    check_accepted();
}

static void an_unknown_blob_is_left_alone(void)
{
    begin_image();
    image.bytes[header.blob.offset + 12 + sizeof(CDL_TASK) + 4] = 99;
    image_fix_crc(&image);
    check_accepted();
}

/* ---- all of it ---- */

static void a_flash_that_cannot_be_mapped_is_read_instead(void)
{
    SimFlashSetMapped(0);
    begin_image();
    check_accepted();
    CHECK(strcmp(AppGetInfo(3), "Description") == 0);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(20)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 6);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    SimFlashSetMapped(1);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(an_image_shorter_than_its_header);
    RUN(something_else_than_an_image);
    RUN(another_header_version);
    RUN(another_total_size);
    RUN(a_wrong_crc);
    RUN(another_image_than_announced);
    RUN(another_device_type);
    RUN(another_device_id);
    RUN(another_major_version);
    RUN(every_segment_is_after_the_header_and_within_the_image);
    RUN(an_image_without_code);
    RUN(code_in_another_area_or_larger_than_it);
    RUN(areas_larger_than_the_device_has);
    RUN(a_retain_area_larger_than_its_flash);
    RUN(an_area_table_with_half_an_entry);
    RUN(an_unknown_or_repeated_area);
    RUN(the_code_area_may_be_listed);
    RUN(a_function_table_of_another_size);
    RUN(a_function_outside_the_code);
    RUN(functions_that_position_independent_code_does_not_need);
    RUN(every_missing_function_is_named);
    RUN(a_function_with_signature_0_is_called_with_any_parameters);
    RUN(the_first_problem_gives_the_result);
    RUN(versions_are_compatible_within_the_major);
    RUN(a_list_of_missing_functions_that_is_too_long_is_cut);
    RUN(as_many_functions_as_the_device_can_link_but_not_one_more);
    RUN(an_external_function_without_a_good_name);
    RUN(a_name_longer_than_any_function_has);
    RUN(an_external_function_table_that_ends_early);
    RUN(an_external_function_with_another_slot);
    RUN(iec_functions_are_checked_too);
    RUN(info_that_is_not_terminated);
    RUN(info_may_be_short_or_absent);
    RUN(an_application_without_tasks);
    RUN(more_tasks_than_the_device_can_run);
    RUN(a_task_without_a_good_name);
    RUN(a_task_with_wrong_values);
    RUN(an_event_variable_outside_its_area);
    RUN(blobs_that_are_not_whole);
    RUN(kept_variables_outside_the_retain_area);
    RUN(a_table_of_kept_variables_that_is_cut_off);
    RUN(two_lists_of_tasks);
    RUN(tasks_may_use_all_of_an_area);
    RUN(a_task_that_uses_more_than_there_is);
    RUN(a_list_of_what_fewer_or_more_tasks_use);
    RUN(copies_that_need_more_than_the_device_has);
    RUN(an_unknown_blob_is_left_alone);
    RUN(a_flash_that_cannot_be_mapped_is_read_instead);
    return test_result();
}
