/*
 * driver.c - runs a fuzz target without libFuzzer: deterministic mutations of its first inputs.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * usage: fuzz_xxx [iterations [seed]]     mutate; the same arguments give the same inputs
 *        fuzz_xxx FILE...                 run these inputs, e.g. a finding
 *
 * With FUZZ_KEEP set in the environment each input is written to fuzz-failure.bin before it runs, so that the last one
 * there is the finding.
 */
#include <stdio.h>
#include <string.h>

#include "fuzz.h"

enum { MAX_INPUT = 2048, MAX_SEEDS = 64, DEFAULT_ITERATIONS = 50000 };

static struct {
    uint8_t data[MAX_INPUT];
    size_t size;
} seeds[MAX_SEEDS];
static unsigned seed_count;
static uint32_t state;

static uint32_t next_random(uint32_t below)
{
    state ^= state << 13;
    state ^= state >> 17;
    state ^= state << 5;
    return below == 0 ? 0 : state % below;
}

static uint8_t interesting_byte(void)
{
    static const uint8_t bytes[] = {0x00, 0x01, 0x7F, 0x80, 0x81, 0x82, 0xFF, 0x23, 0x3C, 0x3E, 0x5F, 0xC5, 0x10, 0x0C};

    return bytes[next_random(sizeof(bytes))];
}

static size_t insert(uint8_t *data, size_t size, size_t at, const uint8_t *bytes, size_t count)
{
    if (count > MAX_INPUT - size)
        count = MAX_INPUT - size;
    memmove(data + at + count, data + at, size - at);
    memcpy(data + at, bytes, count);
    return size + count;
}

static size_t erase(uint8_t *data, size_t size, size_t at, size_t count)
{
    if (count > size - at)
        count = size - at;
    memmove(data + at, data + at + count, size - at - count);
    return size - count;
}

/* A piece of another first input. */
static size_t splice(uint8_t *data, size_t size, size_t at)
{
    unsigned other = next_random(seed_count);
    size_t from = next_random((uint32_t)seeds[other].size);
    size_t count = 1 + next_random((uint32_t)(seeds[other].size - from));

    return insert(data, size, at, seeds[other].data + from, count > seeds[other].size - from ? 0 : count);
}

static size_t mutate(uint8_t *data, size_t size)
{
    size_t at = next_random((uint32_t)size);
    uint8_t byte = interesting_byte();

    switch (next_random(size == 0 ? 2 : 8)) {
    case 0:
        return insert(data, size, at, &byte, 1);
    case 1:
        return splice(data, size, at);
    case 2:
        data[at] ^= (uint8_t)(1u << next_random(8));
        return size;
    case 3:
        data[at] = byte;
        return size;
    case 4:
        data[at] = (uint8_t)next_random(256);
        return size;
    case 5:
        return erase(data, size, at, 1 + next_random(8));
    case 6:
        return at; /* cut */
    default:
        data[at] = (uint8_t)(data[at] + next_random(3) - 1);
        return size;
    }
}

/* Own memory of exactly this size, so that the sanitizer sees the first byte too far. */
static void run(const uint8_t *data, size_t size)
{
    uint8_t *copy = malloc(size + (size == 0));

    if (copy == NULL)
        abort();
    memcpy(copy, data, size);
    (void)LLVMFuzzerTestOneInput(copy, size);
    free(copy);
}

static void keep(const uint8_t *data, size_t size)
{
    FILE *file = fopen("fuzz-failure.bin", "wb");

    if (file == NULL)
        return;
    (void)fwrite(data, 1, size, file);
    (void)fclose(file);
}

static void run_mutations(unsigned long iterations)
{
    int keeps = getenv("FUZZ_KEEP") != NULL;

    for (unsigned long i = 0; i < iterations; i++) {
        uint8_t data[MAX_INPUT];
        unsigned base = next_random(seed_count);
        size_t size = seeds[base].size;
        memcpy(data, seeds[base].data, size);
        if (i >= seed_count)
            for (uint32_t count = 1 + next_random(8); count > 0; count--)
                size = mutate(data, size);
        if (keeps)
            keep(data, size);
        run(data, size);
    }
    printf("%lu inputs\n", iterations);
}

static int run_file(const char *name)
{
    static uint8_t data[1 << 16];
    FILE *file = fopen(name, "rb");

    if (file == NULL) {
        fprintf(stderr, "cannot open %s\n", name);
        return 2;
    }
    size_t size = fread(data, 1, sizeof(data), file);
    (void)fclose(file);
    run(data, size);
    return 0;
}

int main(int argc, char **argv)
{
    unsigned long iterations = DEFAULT_ITERATIONS;
    char *end = NULL;

    while (seed_count < MAX_SEEDS) {
        size_t size = fuzz_seed(seed_count, seeds[seed_count].data, MAX_INPUT);
        if (size == 0)
            break;
        seeds[seed_count++].size = size;
    }
    if (argc > 1)
        iterations = strtoul(argv[1], &end, 10);
    if (end != NULL && *end != '\0') {
        int result = 0;
        for (int i = 1; i < argc; i++)
            result |= run_file(argv[i]);
        return result;
    }
    state = 2463534242u;
    if (argc > 2)
        state += 2654435761u * (uint32_t)strtoul(argv[2], NULL, 10);
    run_mutations(iterations);
    return 0;
}
