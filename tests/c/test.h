/*
 * test.h - the few macros C tests need.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A test program is a main that RUNs its tests and returns test_result(). A failed CHECK is printed, with both values
 * where it is CHECK_EQUAL, and the test goes on. With TEST_ONLY in the environment only the tests whose name contains it
 * are run.
 */
#ifndef TEST_H
#define TEST_H

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int test_failures;

#define CHECK(condition)                                                                  \
    do {                                                                                  \
        if (!(condition)) {                                                               \
            fprintf(stderr, "%s:%d: %s: %s\n", __FILE__, __LINE__, __func__, #condition); \
            test_failures++;                                                              \
        }                                                                                 \
    } while (0)

/* Of integers. */
#define CHECK_EQUAL(actual, expected) \
    test_check_equal((long long)(actual), (long long)(expected), #actual " == " #expected, __FILE__, __LINE__, __func__)

/* Of pointers. */
#define CHECK_SAME(actual, expected) CHECK_EQUAL((uintptr_t)(actual), (uintptr_t)(expected))

static inline void test_check_equal(long long actual, long long expected, const char *condition, const char *file,
                                    int line, const char *function)
{
    if (actual != expected) {
        fprintf(stderr, "%s:%d: %s: %s: is %lld (0x%llX), not %lld (0x%llX)\n", file, line, function, condition, actual,
                (unsigned long long)actual, expected, (unsigned long long)expected);
        test_failures++;
    }
}

static inline bool test_is_wanted(const char *name)
{
    const char *only = getenv("TEST_ONLY");

    return only == NULL || strstr(name, only) != NULL;
}

#define RUN(test)                                                            \
    do {                                                                     \
        int before = test_failures;                                          \
        if (!test_is_wanted(#test))                                          \
            break;                                                           \
        test();                                                              \
        printf("%s %s\n", test_failures == before ? "ok  " : "FAIL", #test); \
    } while (0)

static inline int test_result(void)
{
    return test_failures == 0 ? 0 : 1;
}

#endif
