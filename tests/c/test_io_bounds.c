/*
 * test_io_bounds.c - exact bounds of an I/O configuration: the last possible value is taken, the next one is refused.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A refusal names table and entry, so that each case shows which check has found it.
 */
#include "Sim.h"
#include "io_driver.h"

enum { CONNECTORS, PARAMETERS, TASK_MAPS, CONNECTOR_MAPS, CHANNEL_MAPS, WHOLE };

static APP_REFUSAL refusal;

/* A bus with two parameters and a device with one, of whose memory a task reads and writes a byte. */
static void begin(void)
{
    begin_io();
    plant.is_careless = true; /* the driver finds nothing that the loader let pass */
    io_add_parameter(&io, 1, 32, 0);
    io_add_text_parameter(&io, 2, "COM2");
    io_add_connector(&io, "Device", "IoDrvTest")->parent = 0;
    io_add_parameter(&io, 7, 8, 0);
    add_copying_task("Main", 10000, 0);
    add_bytes(0, IO_MAP_INPUTS, 0, 1);
    add_bytes(0, IO_MAP_OUTPUTS, 1, 1);
}

static RTS_RESULT try_image(void)
{
    memset(&refusal, 0, sizeof refusal);
    return download_part(&image, image.size, &refusal);
}

static RTS_RESULT try_load(void)
{
    emit_io(&spec, &io);
    build_image(&image, &spec);
    return try_image();
}

static void check_result(RTS_RESULT result, RTS_UI32 table, RTS_UI32 entry)
{
    char expected[64];

    snprintf(expected, sizeof expected, "is damaged (table %u, entry %u): build again.", table, entry);
    CHECK(result != ERR_OK);
    CHECK(strstr(refusal.text, expected) != NULL);
    if (strstr(refusal.text, expected) == NULL)
        fprintf(stderr, "instead of %s: %s\n", expected, refusal.text);
}

static void check_refused(RTS_UI32 table, RTS_UI32 entry)
{
    check_result(try_load(), table, entry);
}

/* ---- in the head, and around it ---- */

/* Changes what was emitted, which is at `at` of the configuration. */
static void patch(RTS_UI32 at, const void *bytes, RTS_UI32 size)
{
    memcpy(image.bytes + image_header(&image).code.offset + spec.io.offset + at, bytes, size);
    image_fix_crc(&image);
}

static void check_head_refused(const IO_CONFIG *head)
{
    patch(0, head, sizeof *head);
    check_result(try_image(), WHOLE, 0);
}

static void the_size_of_the_data_is_all_that_follows_the_tables(void)
{
    IO_CONFIG head;

    begin();
    CHECK_EQUAL(try_load(), ERR_OK);
    head = io.head;
    head.data_size -= 4;
    check_head_refused(&head);
    head.data_size += 8;
    check_head_refused(&head);
}

static void tables_that_end_after_the_configuration(void)
{
    IO_CONFIG head;

    begin();
    CHECK_EQUAL(try_load(), ERR_OK);
    head = io.head;
    head.parameters = 0xFFFF;
    head.data_size -= (0xFFFFu - io.head.parameters) * (RTS_UI32)sizeof(IoConfigParameter); /* wraps */
    check_head_refused(&head);
}

/* Gives the configuration another place and size, in the blob that says so, at the end of the blobs. */
static RTS_RESULT try_place(RTS_UI32 offset, RTS_UI32 size)
{
    CDL_SEGMENT blob = image_header(&image).blob;
    IO_CONFIG_PLACE place = {offset, size};

    memcpy(image.bytes + blob.offset + blob.size - sizeof place, &place, sizeof place);
    image_fix_crc(&image);
    return try_image();
}

static void the_data_is_whole_words(void)
{
    IO_CONFIG head;

    begin();
    emit_io(&spec, &io);
    emit(&spec, "\0\0\0\0", 4);
    build_image(&image, &spec);
    head = io.head;
    head.data_size++;
    patch(0, &head, sizeof head);
    check_result(try_place(spec.io.offset, spec.io.size + 1), WHOLE, 0);
}

static void a_configuration_is_whole_words_within_the_code(void)
{
    CDL_HEADER header;

    begin();
    CHECK_EQUAL(try_load(), ERR_OK);
    check_result(try_place(spec.io.offset + 2, spec.io.size - 2), WHOLE, 0);
    check_result(try_place(spec.io.offset, sizeof(IO_CONFIG) - 4), WHOLE, 0);
    CHECK_EQUAL(try_place(spec.io.offset, spec.io.size), ERR_OK);
    header = image_header(&image);
    header.code.size = header.code_area_size = spec.code_size - 4; /* the last word is in the image, not in the code */
    image_set_header(&image, header);
    check_result(try_place(spec.io.offset, spec.io.size), WHOLE, 0);
    header.code.size = header.code_area_size = spec.io.offset - 4; /* nor is the first one */
    image_set_header(&image, header);
    check_result(try_place(spec.io.offset, spec.io.size), WHOLE, 0);
}

/* A configuration of no bytes would be one without devices. */
static void a_configuration_smaller_than_its_head(void)
{
    static const RTS_UI32 sizes[] = {0, sizeof(IO_CONFIG) - 1};
    RTS_UI32 i;

    begin();
    CHECK_EQUAL(try_load(), ERR_OK);
    for (i = 0; i < RTS_COUNT(sizes); i++) {
        CHECK_EQUAL(try_place(spec.io.offset, sizes[i]), ERR_INVALID_REFERENCE);
        check_result(try_image(), WHOLE, 0);
    }
}

static void code_that_ends_within_a_word_of_the_configuration(void)
{
    CDL_HEADER header;

    begin();
    CHECK_EQUAL(try_load(), ERR_OK);
    header = image_header(&image);
    header.code.size = header.code_area_size = spec.code_size - 1;
    image_set_header(&image, header);
    check_result(try_image(), WHOLE, 0);
    header.code.size = header.code_area_size = spec.io.offset - 1;
    image_set_header(&image, header);
    check_result(try_image(), WHOLE, 0);
}

static void two_configurations(void)
{
    RTS_UI32 id = CDL_BLOB_IO;
    CDL_SEGMENT blob;

    begin();
    emit_io(&spec, &io);
    spec.exports = &spec.io;
    spec.exports_size = sizeof spec.io;
    build_image(&image, &spec);
    CHECK_EQUAL(try_image(), ERR_OK);
    blob = image_header(&image).blob;
    memcpy(image.bytes + blob.offset + blob.size - sizeof spec.io - 8, &id, sizeof id);
    image_fix_crc(&image);
    check_result(try_image(), WHOLE, 0);
}

static void another_version(void)
{
    static const RTS_UI16 versions[] = {IO_CONFIG_VERSION - 1, IO_CONFIG_VERSION + 1};
    RTS_UI32 i;

    begin();
    for (i = 0; i < RTS_COUNT(versions); i++) {
        io.head.version = versions[i];
        CHECK_EQUAL(try_load(), ERR_VERSION_MISMATCH);
        CHECK(strstr(refusal.text, "this device knows 2.") != NULL);
    }
}

static void a_configuration_for_any_board_fits_one_with_a_name(void)
{
    begin();
    SimSetBoard("IO-8");
    CHECK_EQUAL(try_load(), ERR_OK);
    SimSetBoard(NULL);
}

static void a_configuration_begins_with_a_word(void)
{
    begin();
    emit_io(&spec, &io);
    memmove(spec.code + spec.io.offset + 2, spec.code + spec.io.offset, spec.io.size);
    spec.io.offset += 2;
    spec.code_size += 2;
    build_image(&image, &spec);
    check_result(try_image(), WHOLE, 0);
}

/* The last blob of the image becomes one that says where the configuration is, too; its size is another one. */
static void a_place_of_another_size(void)
{
    RTS_UI32 id = CDL_BLOB_IO;
    CDL_SEGMENT blob;

    begin();
    spec.change.base = 1;
    emit_io(&spec, &io);
    build_image(&image, &spec);
    blob = image_header(&image).blob;
    memcpy(image.bytes + blob.offset + blob.size - sizeof(CDL_CHANGE) - 8, &id, sizeof id);
    image_fix_crc(&image);
    CHECK_EQUAL(try_image(), ERR_SIZE_MISMATCH);
    check_result(try_image(), WHOLE, 0);
}

static void a_configuration_of_a_head_alone(void)
{
    begin();
    io_init(&io);
    io.channel_count = 0;
    CHECK_EQUAL(try_load(), ERR_OK);
    CHECK_EQUAL(refusal.text[0], '\0');
    CHECK_EQUAL(spec.io.size, sizeof(IO_CONFIG));
}

/* ---- connectors ---- */

/* Emits `count` connectors of the same name after each other. */
static RTS_RESULT try_connectors(RTS_UI16 count)
{
    IO_CONFIG head;
    RTS_UI16 i;

    begin_io();
    add_copying_task("Main", 10000, 0);
    while (spec.code_size % 4 != 0)
        emit_ret(&spec);
    head = io.head;
    head.connectors = count;
    spec.io.offset = here(&spec);
    emit(&spec, (const char *)&head, sizeof head);
    for (i = 0; i < count; i++)
        emit(&spec, (const char *)&io.connectors[0], sizeof io.connectors[0]);
    emit(&spec, (const char *)io.data, io.head.data_size);
    spec.io.size = here(&spec) - spec.io.offset;
    build_image(&image, &spec);
    return try_image();
}

static void as_many_connectors_as_the_device_has_room_for(void)
{
    CHECK_EQUAL(try_connectors(IO_MAX_CONNECTORS), ERR_OK);
    CHECK_EQUAL(try_connectors(IO_MAX_CONNECTORS + 1), ERR_NOMEMORY);
    CHECK(strcmp(refusal.text, "There are 257 devices and buses, this device can have 256.") == 0);
}

static void the_parameters_of_the_last_connector_end_with_the_table(void)
{
    begin();
    io.connectors[1].parameter_count++;
    check_refused(CONNECTORS, 1);
    io.connectors[1].parameter_count--;
    CHECK_EQUAL(try_load(), ERR_OK);
}

/* Loads what is followed by bytes that are not of the configuration. */
static RTS_RESULT try_followed_by(const char *bytes, RTS_UI32 size)
{
    emit_io(&spec, &io);
    emit(&spec, bytes, size);
    build_image(&image, &spec);
    return try_image();
}

static void a_name_after_the_data(void)
{
    begin();
    io.connectors[0].name = io.head.data_size + 4;
    check_result(try_followed_by("\0\0\0\0Name", 9), CONNECTORS, 0);
}

static void a_name_that_ends_after_the_data(void)
{
    begin();
    io.connectors[1].name = io_add_data(&io, "Name", 4);
    check_result(try_followed_by("s\0", 2), CONNECTORS, 1);
    io.data[io.connectors[1].name + 3] = '\0';
    CHECK_EQUAL(try_followed_by("s\0", 2), ERR_OK);
}

/* Of 31 bytes of the data, with the NUL of a name of 32 right after them. */
static void a_name_that_ends_one_byte_after_the_data(void)
{
    begin();
    io.connectors[1].name = io_add_data(&io, "1234567890123456789012345678901", 32) + 1;
    io.data[io.connectors[1].name + 30] = '2';
    check_result(try_followed_by("\0", 1), CONNECTORS, 1);
    io.data[io.connectors[1].name + 30] = '\0';
    CHECK_EQUAL(try_followed_by("\0", 1), ERR_OK);
}

static void a_name_of_the_greatest_length(void)
{
    char name[IO_CONFIG_MAX_NAME + 1];

    begin();
    memset(name, 'n', sizeof name);
    name[IO_CONFIG_MAX_NAME] = '\0';
    io.connectors[1].name = io_add_text(&io, name);
    check_refused(CONNECTORS, 1);
    io.connectors[1].name++;
    CHECK_EQUAL(try_load(), ERR_OK);
}

static void a_state_fills_the_variables(void)
{
    begin();
    spec.areas[APP_AREA_DATA] = sizeof(IO_DEVICE_STATE);
    io.connectors[0].state = 0;
    CHECK_EQUAL(try_load(), ERR_OK);
    spec.areas[APP_AREA_DATA] = sizeof(IO_DEVICE_STATE) - 4;
    check_refused(CONNECTORS, 0);
}

static void a_state_begins_with_a_word_and_ends_in_the_variables(void)
{
    begin();
    io.connectors[0].state = 2;
    check_refused(CONNECTORS, 0);
    io.connectors[0].state = 0;
    spec.areas[APP_AREA_DATA] = sizeof(IO_DEVICE_STATE) - 1;
    check_refused(CONNECTORS, 0);
    io.connectors[0].state = 4;
    spec.areas[APP_AREA_DATA] = sizeof(IO_DEVICE_STATE) + 3;
    check_refused(CONNECTORS, 0);
    spec.areas[APP_AREA_DATA]++;
    CHECK_EQUAL(try_load(), ERR_OK);
}

static void a_connector_with_an_unknown_flag(void)
{
    begin();
    io.connectors[0].flags |= 4;
    check_refused(CONNECTORS, 0);
}

/* ---- parameters ---- */

static void a_value_in_the_table_has_32_bits_at_most(void)
{
    begin();
    io.parameters[0].bits = 33;
    check_refused(PARAMETERS, 0);
    io.parameters[0].bits = 32;
    CHECK_EQUAL(try_load(), ERR_OK);
}

static void a_value_in_the_data_begins_with_a_word_of_it(void)
{
    begin();
    io.parameters[1].bits = 8;
    io.parameters[1].value++;
    check_refused(PARAMETERS, 1);
    io.parameters[1].bits = 0;
    io.parameters[1].value = io.head.data_size;
    CHECK_EQUAL(try_load(), ERR_OK);
    io.parameters[1].value = io.head.data_size + 4;
    check_refused(PARAMETERS, 1);
}

static void a_parameter_with_an_unknown_flag(void)
{
    begin();
    io.parameters[1].flags = PVF_POINTER + 1;
    check_refused(PARAMETERS, 1);
}

static void the_greatest_number_of_a_parameter(void)
{
    begin();
    io.parameters[1].id = 0xFFFFFFFFu; /* no greater one could follow */
    check_refused(PARAMETERS, 1);
    io.parameters[1].id--;
    CHECK_EQUAL(try_load(), ERR_OK);
}

/* ---- maps ---- */

/* Of the configuration of begin(). */
enum { TASK_MAPS_AT = sizeof(IO_CONFIG) + 2 * sizeof(IoConfigConnector) + 3 * sizeof(IoConfigParameter) };

static void a_map_of_the_task_after_the_last_one(void)
{
    RTS_UI16 task = 1;

    begin();
    CHECK_EQUAL(try_load(), ERR_OK);
    patch(TASK_MAPS_AT, &task, sizeof task);
    check_result(try_image(), TASK_MAPS, 0);
}

static void a_map_of_neither_inputs_nor_outputs(void)
{
    RTS_UI16 type = IO_MAP_OUTPUTS + 1;

    begin();
    CHECK_EQUAL(try_load(), ERR_OK);
    patch(TASK_MAPS_AT + offsetof(IoConfigTaskMap, type), &type, sizeof type);
    check_result(try_image(), TASK_MAPS, 0);
}

static void two_maps_of_the_same_inputs(void)
{
    RTS_UI16 type = IO_MAP_INPUTS;

    begin();
    CHECK_EQUAL(try_load(), ERR_OK);
    patch(TASK_MAPS_AT + sizeof(IoConfigTaskMap) + offsetof(IoConfigTaskMap, type), &type, sizeof type);
    check_result(try_image(), TASK_MAPS, 1);
}

static void a_map_of_the_connector_after_the_last_one(void)
{
    begin();
    io.channels[0].connector = 2;
    check_refused(CONNECTOR_MAPS, 0);
    io.channels[0].connector = 1;
    CHECK_EQUAL(try_load(), ERR_OK);
}

static void every_connector_of_a_map_is_checked(void)
{
    begin();
    io_add_channel(&io, 0, IO_MAP_OUTPUTS, 1, DRIVER_OUTPUTS, 0, 16, 0);
    check_refused(CHANNEL_MAPS, 2);
}

typedef struct {
    RTS_UI32 area_bit;
    RTS_UI32 parameter_bit;
    RTS_UI16 bits;
    RTS_UI16 flags;
} BITS;

static RTS_RESULT try_bits(const BITS *bits)
{
    begin();
    io.channels[0].map.area_bit = bits->area_bit;
    io.channels[0].map.parameter_bit = bits->parameter_bit;
    io.channels[0].map.bits = bits->bits;
    io.channels[0].map.flags = bits->flags;
    return try_load();
}

static void bits_of_a_channel_are_within_a_byte_unless_all_are_whole_bytes(void)
{
    static const BITS good[] = {{4, 0, 4, IO_ZERO},  {0, 4, 4, IO_ZERO},      {8, 16, 24, IO_ZERO},
                                {0, 0, 1, IO_VALUE}, {8 * 31, 0, 8, IO_ZERO}, {0, 0x7FFFFFFF, 1, IO_ZERO}};
    static const BITS bad[] = {{4, 0, 5, IO_ZERO},          {0, 4, 5, IO_ZERO},
                               {4, 0, 8, IO_ZERO},          {0, 4, 8, IO_ZERO},
                               {8, 16, 0, IO_ZERO},         {0, 0, 1, IO_VALUE + 1},
                               {8, 16, 12, IO_ZERO},        {0, 0, 1, IO_CHANNEL_BIG_ENDIAN << 1},
                               {0, 0x80000000u, 1, IO_ZERO}};
    RTS_UI32 i;

    for (i = 0; i < RTS_COUNT(good); i++)
        CHECK_EQUAL(try_bits(&good[i]), ERR_OK);
    for (i = 0; i < RTS_COUNT(bad); i++)
        check_result(try_bits(&bad[i]), CHANNEL_MAPS, 0);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(the_size_of_the_data_is_all_that_follows_the_tables);
    RUN(tables_that_end_after_the_configuration);
    RUN(the_data_is_whole_words);
    RUN(a_configuration_is_whole_words_within_the_code);
    RUN(a_configuration_smaller_than_its_head);
    RUN(code_that_ends_within_a_word_of_the_configuration);
    RUN(two_configurations);
    RUN(another_version);
    RUN(a_configuration_for_any_board_fits_one_with_a_name);
    RUN(a_configuration_begins_with_a_word);
    RUN(a_place_of_another_size);
    RUN(a_configuration_of_a_head_alone);
    RUN(as_many_connectors_as_the_device_has_room_for);
    RUN(the_parameters_of_the_last_connector_end_with_the_table);
    RUN(a_name_after_the_data);
    RUN(a_name_that_ends_after_the_data);
    RUN(a_name_that_ends_one_byte_after_the_data);
    RUN(a_name_of_the_greatest_length);
    RUN(a_state_fills_the_variables);
    RUN(a_state_begins_with_a_word_and_ends_in_the_variables);
    RUN(a_connector_with_an_unknown_flag);
    RUN(a_value_in_the_table_has_32_bits_at_most);
    RUN(a_value_in_the_data_begins_with_a_word_of_it);
    RUN(a_parameter_with_an_unknown_flag);
    RUN(the_greatest_number_of_a_parameter);
    RUN(a_map_of_the_task_after_the_last_one);
    RUN(a_map_of_neither_inputs_nor_outputs);
    RUN(two_maps_of_the_same_inputs);
    RUN(a_map_of_the_connector_after_the_last_one);
    RUN(every_connector_of_a_map_is_checked);
    RUN(bits_of_a_channel_are_within_a_byte_unless_all_are_whole_bytes);
    return test_result();
}
