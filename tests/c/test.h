/*
 * test.h - the few macros C tests need.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A test program is a main that RUNs its tests and returns test_result(). A failed CHECK is printed and the test goes
 * on.
 */
#ifndef TEST_H
#define TEST_H

#include <stdio.h>

static int test_failures;

#define CHECK(condition)                                                                  \
    do {                                                                                  \
        if (!(condition)) {                                                               \
            fprintf(stderr, "%s:%d: %s: %s\n", __FILE__, __LINE__, __func__, #condition); \
            test_failures++;                                                              \
        }                                                                                 \
    } while (0)

#define RUN(test)                                                            \
    do {                                                                     \
        int before = test_failures;                                          \
        test();                                                              \
        printf("%s %s\n", test_failures == before ? "ok  " : "FAIL", #test); \
    } while (0)

static inline int test_result(void)
{
    return test_failures == 0 ? 0 : 1;
}

#endif
