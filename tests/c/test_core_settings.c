/*
 * test_core_settings.c - settings from the table of the port.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The component is compiled a second time here, with a table.
 */
#define SETTINGS_TABLE {"CmpA", "Number", 42, NULL}, {"CmpA", "Text", 0, "forty-two"}, {"CmpB", "Number", -1, NULL},
#define SettgGetIntValue test_get_int
#define SettgGetStringValue test_get_string
#include "../../firmware/src/core/CmpSettingsEmbedded.c"

#include "test.h"

static void values_are_found_by_component_and_key(void)
{
    CHECK_EQUAL(SettgGetIntValue("CmpA", "Number", 1), 42);
    CHECK_EQUAL(SettgGetIntValue("CmpB", "Number", 1), -1);
    CHECK(strcmp(SettgGetStringValue("CmpA", "Text", ""), "forty-two") == 0);
}

static void what_is_not_in_the_table_has_the_default(void)
{
    CHECK_EQUAL(SettgGetIntValue("CmpA", "Nothing", 5), 5);
    CHECK_EQUAL(SettgGetIntValue("CmpC", "Number", -5), -5);
    CHECK(SettgGetStringValue("CmpB", "Text", NULL) == NULL);
}

static void a_value_of_the_other_type_does_not_count(void)
{
    CHECK_EQUAL(SettgGetIntValue("CmpA", "Text", 7), 7);
    CHECK(strcmp(SettgGetStringValue("CmpA", "Number", "none"), "none") == 0);
}

int main(void)
{
    RUN(values_are_found_by_component_and_key);
    RUN(what_is_not_in_the_table_has_the_default);
    RUN(a_value_of_the_other_type_does_not_count);
    return test_result();
}
