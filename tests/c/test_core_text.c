/*
 * test_core_text.c - the formatter, and what else there is for text.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <limits.h>
#include <string.h>

#include "CMUtils.h"
#include "test.h"

static char out[64];

/* The compiler is not to know that it has a format: some here are wrong. */
static RTS_SIZE (*volatile format_any)(char *out, RTS_SIZE size, const char *format, ...) = CMUtlsnprintf;

#define FORMATS(expected, ...)     \
    (memset(out, 'x', sizeof out), \
     format_any(out, sizeof out, __VA_ARGS__) == strlen(expected) && strcmp(out, expected) == 0)

static void every_conversion_works(void)
{
    CHECK(FORMATS("", "%s", ""));
    CHECK(FORMATS("plain", "plain"));
    CHECK(FORMATS("a text b", "a %s b", "text"));
    CHECK(FORMATS("(null)", "%s", (const char *)NULL));
    CHECK(FORMATS("0 1 4294967295", "%u %u %u", 0u, 1u, UINT_MAX));
    CHECK(FORMATS("0 7 -7 2147483647", "%d %d %d %d", 0, 7, -7, INT_MAX));
    CHECK(FORMATS("-2147483648", "%d", INT_MIN));
    CHECK(FORMATS("00000000 0000000A 0000001F FFFFFFFF", "%X %X %X %X", 0u, 10u, 31u, UINT_MAX));
    CHECK(FORMATS("0000000A FFFFFFFF", "%x %x", 10u, UINT_MAX));
    CHECK(FORMATS("adc at 0x00000005 is ok", "adc at 0x%x is %s", 5u, "ok"));
    CHECK(FORMATS("100%", "%u%%", 100u));
}

/* No number is taken for the address of a string. */
static void an_unknown_conversion_ends_the_formatting(void)
{
    CHECK(FORMATS("%q", "%q"));
    CHECK(FORMATS("end%", "end%"));
    CHECK(FORMATS("a 1 %ld %s", "a %d %ld %s", 1, 2L, "text"));
    CHECK(FORMATS("%5d %s", "%5d %s", 7, "text"));
    CHECK(FORMATS("%llu of %s", "%llu of %s", 7ull, "text"));
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

static void length_of_a_text_ends_at_its_nul_or_the_limit(void)
{
    static const char unterminated[3] = {'a', 'b', 'c'};

    CHECK(CMUtlStrNLen("", 5) == 0);
    CHECK(CMUtlStrNLen("abc", 5) == 3);
    CHECK(CMUtlStrNLen("abc", 2) == 2);
    CHECK(CMUtlStrNLen(unterminated, sizeof unterminated) == 3);
}

static void wide_text_has_two_bytes_a_character_and_a_nul(void)
{
    RTS_UI8 wide[8];

    memset(wide, 'x', sizeof wide);
    CHECK(CMUtlPutWide(wide, "a\xE4zz", 2) == wide + 6);
    CHECK(memcmp(wide, "a\0\xE4\0\0\0xx", sizeof wide) == 0);
    CHECK(CMUtlPutWide(wide, "", 0) == wide + 2);
}

int main(void)
{
    RUN(every_conversion_works);
    RUN(an_unknown_conversion_ends_the_formatting);
    RUN(output_is_cut_to_its_size);
    RUN(length_of_a_text_ends_at_its_nul_or_the_limit);
    RUN(wide_text_has_two_bytes_a_character_and_a_nul);
    return test_result();
}
