/*
 * test_core_text.c - the formatter.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <limits.h>
#include <string.h>

#include "CMUtils.h"
#include "test.h"

static char out[64];

#define FORMATS(expected, ...)                                                                                         \
    (memset(out, 'x', sizeof out), CMUtlsnprintf(out, sizeof out, __VA_ARGS__) == strlen(expected) && strcmp(out, expected) == 0)

static void every_conversion_works(void)
{
    CHECK(FORMATS("", "%s", ""));
    CHECK(FORMATS("plain", "plain"));
    CHECK(FORMATS("a text b", "a %s b", "text"));
    CHECK(FORMATS("(null)", "%s", (const char *)NULL));
    CHECK(FORMATS("0 1 4294967295", "%u %u %u", 0u, 1u, UINT_MAX));
    CHECK(FORMATS("0 7 -7 2147483647", "%d %d %d %d", 0, 7, -7, INT_MAX));
    CHECK(FORMATS("-2147483648", "%d", INT_MIN));
    CHECK(FORMATS("0 a 1f ffffffff", "%x %x %x %x", 0u, 10u, 31u, UINT_MAX));
    CHECK(FORMATS("100%", "%u%%", 100u));
}

static void unknown_conversions_do_no_harm(void)
{
    CHECK(FORMATS("q", "%q"));
    CHECK(FORMATS("end", "end%"));
    CHECK(FORMATS("%", "%%"));
}

static void output_is_cut_to_its_size(void)
{
    char small[8];

    memset(small, 'x', sizeof small);
    CHECK(CMUtlsnprintf(small, 4, "%s", "abcdef") == 3);
    CHECK(strcmp(small, "abc") == 0);
    CHECK(small[4] == 'x');
    CHECK(CMUtlsnprintf(small, 4, "%u", 123456u) == 3);
    CHECK(strcmp(small, "123") == 0);
    CHECK(CMUtlsnprintf(small, 1, "abc") == 0);
    CHECK(small[0] == '\0');
}

int main(void)
{
    RUN(every_conversion_works);
    RUN(unknown_conversions_do_no_harm);
    RUN(output_is_cut_to_its_size);
    return test_result();
}
