/*
 * fuzz.h - what every fuzz target offers: the entry libFuzzer knows, and its first inputs.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef FUZZ_H
#define FUZZ_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

/* Runs one input; a finding is an abort, a sanitizer's report or a crash. */
int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Copies first input `index` to `data` and returns its size; 0 when there are no more. */
size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity);

/* A property that holds for every input. */
#define FUZZ_CHECK(condition)                                                             \
    do {                                                                                  \
        if (!(condition)) {                                                               \
            fprintf(stderr, "%s:%d: %s: %s\n", __FILE__, __LINE__, __func__, #condition); \
            abort();                                                                      \
        }                                                                                 \
    } while (0)

#endif
