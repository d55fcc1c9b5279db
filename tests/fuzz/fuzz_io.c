/*
 * fuzz_io.c - any I/O configuration in an image that is right otherwise: it is refused, or runs and stops without harm.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Input: a configuration. The corpus has those of descriptions (make_corpus.py); io_any.h says which drivers are there.
 */
#include "fuzz.h"
#include "io_any.h"

enum { MAX_CONFIG = 2048 };

/* Of the corpus none has connectors within connectors, or one of the driver of io_driver.h. */
size_t fuzz_seed(unsigned index, uint8_t *data, size_t capacity)
{
    if (index > 1)
        return 0;
    any_spec();
    any_nest(index == 0 ? "IoDrvTest" : "IoDrvSim");
    if (spec.io.size > capacity)
        return 0;
    memcpy(data, spec.code + spec.io.offset, spec.io.size);
    return spec.io.size;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static bool is_prepared;
    const char *wrong;
    bool loaded;

    if (size == 0 || size > MAX_CONFIG)
        return 0;
    if (!is_prepared)
        any_begin();
    is_prepared = true;
    wrong = any_try(data, (RTS_UI32)size, &loaded);
    if (wrong != NULL)
        fprintf(stderr, "%s\n", wrong);
    FUZZ_CHECK(wrong == NULL);
    FUZZ_CHECK(test_failures == 0);
    return 0;
}
