/*
 * test_app_properties.c - properties of the project for components in C, also of damaged images.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppProperties.h"
#include "app_device.h"

/* As plctool writes them (tests/compiler/test_image_file.py). */
static const RTS_UI8 PROPERTIES[] = "TTitle\0\0Pump station\0\0\0\0"
                                    "Ngain\0\0\0\0\0\0\0\0\0\xF8\x3F"
                                    "Btested\0\1\0\0\0"
                                    "Vhw\0"
                                    "2.0.1.0\0"
                                    "Tlast\0\0\0x\0\0\0";

static RTS_RESULT load_with(const void *properties, RTS_UI32 size)
{
    APP_SPEC spec;
    APP_BYTES image;

    start_blank();
    spec_counter(&spec, 3);
    spec.more_info = properties;
    spec.more_info_size = size;
    build_image(&image, &spec);
    return download(&image);
}

static void a_component_reads_properties_of_each_type(void)
{
    char text[16];
    RTS_REAL64 number = 0;
    bool value = false;

    CHECK_EQUAL(load_with(PROPERTIES, sizeof PROPERTIES - 1), ERR_OK);
    CHECK_EQUAL(AppGetTextProperty("Title", text, sizeof text), ERR_OK);
    CHECK(strcmp(text, "Pump station") == 0);
    CHECK_EQUAL(AppGetTextProperty("Title", text, 5), ERR_OK);
    CHECK(strcmp(text, "Pump") == 0);
    CHECK_EQUAL(AppGetNumberProperty("gain", &number), ERR_OK);
    CHECK(number == 1.5);
    CHECK_EQUAL(AppGetBooleanProperty("tested", &value), ERR_OK);
    CHECK(value);
    CHECK_EQUAL(AppGetVersionProperty("hw", text, sizeof text), ERR_OK);
    CHECK(strcmp(text, "2.0.1.0") == 0);
    CHECK_EQUAL(AppGetTextProperty("last", text, sizeof text), ERR_OK);
    CHECK(strcmp(text, "x") == 0);
}

static void a_property_that_is_missing_or_of_another_type_is_an_error(void)
{
    static const char *const keys[] = {"", "T", "Titl", "Title2", "title", "gain ", "TTitle"};
    char text[16] = "before";
    RTS_REAL64 number = 7;
    RTS_SIZE i;

    CHECK_EQUAL(load_with(PROPERTIES, sizeof PROPERTIES - 1), ERR_OK);
    for (i = 0; i < RTS_COUNT(keys); i++)
        CHECK_EQUAL(AppGetTextProperty(keys[i], text, sizeof text), ERR_NO_OBJECT);
    CHECK(strcmp(text, "") == 0);
    CHECK_EQUAL(AppGetNumberProperty("Title", &number), ERR_TYPE_MISMATCH);
    CHECK_EQUAL(AppGetTextProperty("hw", text, sizeof text), ERR_TYPE_MISMATCH);
    CHECK(number == 7);
    CHECK_EQUAL(load_with("", 0), ERR_OK);
    CHECK_EQUAL(AppGetTextProperty("Title", text, sizeof text), ERR_NO_OBJECT);
    start_blank();
    CHECK_EQUAL(AppGetTextProperty("Title", text, sizeof text), ERR_APP_NOT_LOADED);
}

static void properties_that_are_cut_off_are_errors_and_nothing_is_read_past_them(void)
{
    char text[16];
    RTS_REAL64 number;
    bool value;
    RTS_UI32 size;

    for (size = 0; size < sizeof PROPERTIES - 1; size += 4) {
        CHECK_EQUAL(load_with(PROPERTIES, size), ERR_OK);
        (void)AppGetTextProperty("last", text, sizeof text);
        (void)AppGetNumberProperty("gain", &number);
        (void)AppGetBooleanProperty("tested", &value);
        CHECK(AppGetVersionProperty("hw", text, sizeof text) != ERR_OK || size >= 52);
    }
    CHECK_EQUAL(load_with("Ngain\0\0\0\0\0\0\0", 12), ERR_OK);
    CHECK_EQUAL(AppGetNumberProperty("gain", &number), ERR_PARAMETER);
    CHECK_EQUAL(load_with("Tlong", 4), ERR_OK);
    CHECK_EQUAL(AppGetTextProperty("lon", text, sizeof text), ERR_PARAMETER);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_component_reads_properties_of_each_type);
    RUN(a_property_that_is_missing_or_of_another_type_is_an_error);
    RUN(properties_that_are_cut_off_are_errors_and_nothing_is_read_past_them);
    return test_result();
}
