/*
 * check.h - the smallest test frame: CHECK counts and prints what is wrong, TEST_RUN prints the name of each test.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CHECK_H
#define CHECK_H

#include "BareMetal.h"
#include "family.h"
#include "semihost.h"

#if APP_POWER_FAIL
/* The interrupt of the supply monitor leads into the runtime, of which these tests have only the port. */
void AppPowerFails(void)
{
}
#endif

static int check_failures;

static inline void check_print_number(int64_t value)
{
    char text[24];
    char *end = text + sizeof(text) - 1;
    uint64_t rest = value < 0 ? (uint64_t)-value : (uint64_t)value;
    *end = '\0';
    do
        *--end = (char)('0' + rest % 10);
    while (rest /= 10);
    if (value < 0)
        *--end = '-';
    semihost_print(end);
}

static inline void check_failed(const char *file, int line, const char *what, int64_t got, int64_t wanted)
{
    check_failures++;
    semihost_print(file);
    semihost_print(":");
    check_print_number(line);
    semihost_print(": ");
    semihost_print(what);
    semihost_print(": got ");
    check_print_number(got);
    semihost_print(", wanted ");
    check_print_number(wanted);
    semihost_print("\n");
}

#define CHECK_EQUAL(got, wanted)                                    \
    do {                                                            \
        int64_t got_ = (int64_t)(got), wanted_ = (int64_t)(wanted); \
        if (got_ != wanted_)                                        \
            check_failed(__FILE__, __LINE__, #got, got_, wanted_);  \
    } while (0)

#define CHECK(condition) CHECK_EQUAL(!!(condition), 1)

/* A fault outside of SysExceptTry restarts the controller, and would restart the tests for ever. */
#define TEST_BEGIN()                                                                                          \
    do {                                                                                                      \
        if (ResetGet()->cause != RESET_POWER_ON) {                                                            \
            check_failed(__FILE__, __LINE__, "program counter of a fault of the runtime", ResetGet()->pc, 0); \
            semihost_exit(1);                                                                                 \
        }                                                                                                     \
    } while (0)

#define TEST_RUN(test)              \
    do {                            \
        semihost_print(#test "\n"); \
        test();                     \
    } while (0)

#define TEST_END() semihost_exit(check_failures != 0)

#endif
