/*
 * driver.c - runs a fuzz target: mutates inputs, and keeps those that reach something new.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * usage: fuzz_xxx [-n INPUTS] [-t SECONDS] [-s SEED] [-c FOLDER]... [-k FOLDER] [-f FOLDER]
 *        fuzz_xxx FILE...     run these inputs, e.g. a finding
 *
 *   -n  how many inputs to try, 20000 if neither this nor -t is given; the same arguments give the same inputs
 *   -t  how long to try [s]
 *   -s  another seed gives other inputs
 *   -c  where first inputs are, besides those of the target; all of them are run before any is changed
 *   -k  where to write inputs that reached something new; with -n 0 those of the first inputs that did
 *   -f  where to write a finding, here if not given
 *
 * What is tried runs in a child process. One that dies or does not come back is a finding: its input is written to a
 * file, and the line that runs it again is printed.
 *
 * What inputs reach is known where the target is built with -fsanitize-coverage=trace-pc, by gcc or clang. The entry is
 * that of libFuzzer, which can take the place of this file.
 */
#define _GNU_SOURCE
#include <dirent.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "fuzz.h"

enum {
    INPUT_CAPACITY = 8192,
    MAX_POOL = 4096,
    DEFAULT_INPUTS = 20000,
    PATIENCE_S = 60, /* with one input, on a machine that is busy */
    MAP_SIZE = 1 << 16,
};

typedef struct {
    uint8_t *data;
    size_t size;
} INPUT;

/* What parent and child share. */
typedef struct {
    volatile unsigned long tried;
    volatile size_t size;
    volatile unsigned pool;
    uint8_t data[INPUT_CAPACITY]; /* the input that runs */
} SHARED;

static struct {
    unsigned long inputs;
    unsigned long seconds;
    const char *keep;
    const char *findings;
} options = {DEFAULT_INPUTS, 0, NULL, "."};

static SHARED *shared;
static INPUT pool[MAX_POOL];
static unsigned pool_count;
static uint32_t state = 2463534242u;

/* ---- what an input reaches ---- */

static uint8_t hits[MAP_SIZE];    /* by the input that runs: how often it took a step from one place to another */
static uint8_t reached[MAP_SIZE]; /* by all so far: a bit for each range of numbers */
static __thread bool is_watched;  /* threads of the target are not */
static uintptr_t place_before;

void __sanitizer_cov_trace_pc(void);

void __sanitizer_cov_trace_pc(void)
{
    uintptr_t place;
    uint8_t *count;

    if (!is_watched)
        return;
    place = (uintptr_t)__builtin_return_address(0) - (uintptr_t)&__sanitizer_cov_trace_pc;
    place = (place * 0x9E3779B1u) >> 7;
    count = &hits[(place ^ place_before) % MAP_SIZE];
    *count += *count != UINT8_MAX;
    place_before = place >> 1;
}

static uint8_t range_of(uint8_t count)
{
    static const uint8_t limits[] = {1, 2, 3, 7, 15, 31, 127};
    unsigned range = 0;

    while (range < sizeof(limits) && count > limits[range])
        range++;
    return (uint8_t)(1u << range);
}

/* Those of `count` places from `first` on; true when something is new. */
static bool note_places(size_t first, size_t count)
{
    bool is_new = false;

    for (size_t i = first; i < first + count; i++) {
        uint8_t range = options.inputs == 0 ? 1 : range_of(hits[i]);
        if (hits[i] != 0 && (reached[i] & range) == 0) {
            reached[i] |= range;
            is_new = true;
        }
    }
    return is_new;
}

/* Notes what the last input reached; true when something of it is new. Of inputs that are only sorted out it does not
 * matter how often they reach it: that keeps a corpus small. Few places are reached, and to pass over the others eight
 * by eight makes most targets several times as fast. */
static bool note_hits(void)
{
    bool is_new = false;
    uint64_t eight;

    for (size_t i = 0; i < MAP_SIZE; i += sizeof(eight)) {
        memcpy(&eight, hits + i, sizeof(eight));
        if (eight != 0 && note_places(i, sizeof(eight)))
            is_new = true;
    }
    return is_new;
}

/* ---- inputs ---- */

static void add_input(const uint8_t *data, size_t size)
{
    if (pool_count == MAX_POOL || size > INPUT_CAPACITY)
        return;
    pool[pool_count].data = malloc(size + (size == 0));
    if (pool[pool_count].data == NULL)
        abort();
    memcpy(pool[pool_count].data, data, size);
    pool[pool_count++].size = size;
}

static bool add_file(const char *name)
{
    static uint8_t data[INPUT_CAPACITY];
    FILE *file = fopen(name, "rb");

    if (file == NULL)
        return false;
    add_input(data, fread(data, 1, sizeof(data), file));
    (void)fclose(file);
    return true;
}

static int is_input(const struct dirent *entry)
{
    return entry->d_name[0] != '.';
}

/* In the order of their names, so that every run tries the same. */
static void add_folder(const char *folder)
{
    struct dirent **entries;
    int count = scandir(folder, &entries, is_input, alphasort);
    char path[4096];

    if (count < 0) {
        fprintf(stderr, "cannot read folder %s\n", folder);
        exit(2);
    }
    for (int i = 0; i < count; i++) {
        (void)snprintf(path, sizeof(path), "%s/%s", folder, entries[i]->d_name);
        (void)add_file(path);
        free(entries[i]);
    }
    free(entries);
}

static void add_first_inputs(void)
{
    static uint8_t data[INPUT_CAPACITY];
    size_t size;

    for (unsigned i = 0; (size = fuzz_seed(i, data, INPUT_CAPACITY)) != 0; i++)
        add_input(data, size);
}

/* Writes an input to a file that is named by what is in it, so that one finding is one file; returns its name. */
static const char *write_input(const char *folder, const char *kind, const uint8_t *data, size_t size)
{
    static char path[4096];
    uint32_t hash = 2166136261u;
    FILE *file;

    for (size_t i = 0; i < size; i++)
        hash = (hash ^ data[i]) * 16777619u;
    (void)snprintf(path, sizeof(path), "%s/%s-%08x", folder, kind, (unsigned)hash);
    file = fopen(path, "wb");
    if (file != NULL) {
        (void)fwrite(data, 1, size, file);
        (void)fclose(file);
    }
    return path;
}

/* ---- mutations ---- */

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

/* An aligned word becomes a value that a check may have forgotten, or one near what it was. */
static void change_word(uint8_t *data, size_t size, size_t at)
{
    static const uint32_t words[] = {0,          1,          4,          16,         0xFF,      0xFFFF,
                                     0x7FFFFFFF, 0x80000000, 0xFFFFFFFC, 0xFFFFFFF0, 0xFFFFFFFF};
    uint32_t word;

    at &= ~(size_t)3;
    if (size < 4 || at > size - 4)
        return;
    memcpy(&word, data + at, sizeof(word));
    word = next_random(2) != 0 ? words[next_random(sizeof(words) / sizeof(words[0]))] : word + next_random(65) - 32;
    memcpy(data + at, &word, sizeof(word));
}

static size_t insert(uint8_t *data, size_t size, size_t at, const uint8_t *bytes, size_t count)
{
    if (count > INPUT_CAPACITY - size)
        count = INPUT_CAPACITY - size;
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

/* A piece of another input, put in or written over. */
static size_t splice(uint8_t *data, size_t size, size_t at, bool over)
{
    const INPUT *other = &pool[next_random(pool_count)];
    size_t from = next_random((uint32_t)other->size);
    size_t count = 1 + next_random((uint32_t)(other->size - from));

    if (count > other->size - from)
        return size;
    if (!over)
        return insert(data, size, at, other->data + from, count);
    memcpy(data + at, other->data + from, count < size - at ? count : size - at);
    return size;
}

static size_t mutate(uint8_t *data, size_t size)
{
    size_t at = next_random((uint32_t)size);
    uint8_t byte = interesting_byte();

    switch (next_random(size == 0 ? 2 : 11)) {
    case 0:
        return insert(data, size, at, &byte, 1);
    case 1:
        return splice(data, size, at, false);
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
    case 7:
        return splice(data, size, at, true);
    case 8:
    case 9:
        change_word(data, size, at);
        return size;
    default:
        data[at] = (uint8_t)(data[at] + next_random(3) - 1);
        return size;
    }
}

/* ---- running, in the child ---- */

/* Own memory of exactly this size, so that the sanitizer sees the first byte too far. */
static void call_target(const uint8_t *data, size_t size)
{
    uint8_t *copy = malloc(size + (size == 0));

    if (copy == NULL)
        abort();
    memcpy(copy, data, size);
    memset(hits, 0, sizeof(hits));
    place_before = 0;
    is_watched = true;
    (void)LLVMFuzzerTestOneInput(copy, size);
    is_watched = false;
    free(copy);
}

/* Runs an input; true when it reached something new. The parent can see which one it is. */
static bool run(const uint8_t *data, size_t size)
{
    memcpy(shared->data, data, size);
    shared->size = size;
    call_target(data, size);
    shared->tried++;
    return note_hits();
}

static int compare_sizes(const void *a, const void *b)
{
    const INPUT *x = a;
    const INPUT *y = b;

    return (x->size > y->size) - (x->size < y->size);
}

/* The small ones first, so that of several that reach the same a small one is kept. */
static void run_pool(void)
{
    qsort(pool, pool_count, sizeof(pool[0]), compare_sizes);
    for (unsigned i = 0; i < pool_count; i++) {
        if (run(pool[i].data, pool[i].size) && options.inputs == 0 && options.keep != NULL)
            (void)write_input(options.keep, "input", pool[i].data, pool[i].size);
    }
}

static bool is_over(time_t begin)
{
    if (options.seconds != 0)
        return (unsigned long)(time(NULL) - begin) >= options.seconds;
    return shared->tried >= options.inputs;
}

static void run_mutations(void)
{
    static uint8_t data[INPUT_CAPACITY];
    time_t begin = time(NULL);

    while (!is_over(begin)) {
        const INPUT *base = &pool[next_random(pool_count)];
        size_t size = base->size;
        memcpy(data, base->data, size);
        for (uint32_t count = 1 + next_random(8); count > 0; count--)
            size = mutate(data, size);
        if (!run(data, size))
            continue;
        add_input(data, size);
        shared->pool = pool_count;
        if (options.keep != NULL)
            (void)write_input(options.keep, "input", data, size);
    }
}

/* ---- watching, in the parent ---- */

enum { NO_INPUTS = 2 }; /* exit status */

/* The child's status; it is killed when it stays with one input for too long. */
static int wait_for(pid_t child)
{
    unsigned long seen = 0;
    unsigned quiet = 0;
    int status;

    while (waitpid(child, &status, WNOHANG) == 0) {
        const struct timespec pause = {0, 20 * 1000000L};
        nanosleep(&pause, NULL);
        quiet = shared->tried == seen ? quiet + 1 : 0;
        seen = shared->tried;
        if (quiet > PATIENCE_S * 50)
            (void)kill(child, SIGKILL);
    }
    return status;
}

static int report(int status, const char *program)
{
    const char *kind = WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL ? "hang" : "crash";

    if (WIFEXITED(status) && WEXITSTATUS(status) == NO_INPUTS) {
        fprintf(stderr, "there are no first inputs\n");
        return NO_INPUTS;
    }
    if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
        printf("%lu inputs, %u of them reach something of their own\n", shared->tried, shared->pool);
        return 0;
    }
    fprintf(stderr, "input %lu is a finding; run it again with:\n  %s %s\n", shared->tried, program,
            write_input(options.findings, kind, shared->data, shared->size));
    return 1;
}

/* A target may start threads when it makes its first inputs: where it is forked after that, they may have had locks of
 * the memory. */
static int fuzz(const char *program)
{
    pid_t child;

    (void)fflush(stdout);
    child = fork();
    if (child == 0) {
        add_first_inputs();
        if (pool_count == 0)
            _exit(NO_INPUTS);
        run_pool();
        shared->pool = pool_count;
        run_mutations();
        _exit(0);
    }
    return child < 0 ? 2 : report(wait_for(child), program);
}

/* In this process, for a debugger. */
static int run_files(int count, char **names)
{
    for (int i = 0; i < count; i++) {
        if (!add_file(names[i])) {
            fprintf(stderr, "cannot open %s\n", names[i]);
            return 2;
        }
    }
    run_pool();
    return 0;
}

int main(int argc, char **argv)
{
    int option;

    shared = mmap(NULL, sizeof(*shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (shared == MAP_FAILED)
        return 2;
    while ((option = getopt(argc, argv, "n:t:s:c:k:f:")) != -1) {
        switch (option) {
        case 'n':
            options.inputs = strtoul(optarg, NULL, 10);
            break;
        case 't':
            options.seconds = strtoul(optarg, NULL, 10);
            break;
        case 's':
            state += 2654435761u * (uint32_t)strtoul(optarg, NULL, 10);
            break;
        case 'c':
            add_folder(optarg);
            break;
        case 'k':
            options.keep = optarg;
            break;
        case 'f':
            options.findings = optarg;
            break;
        default:
            return 2;
        }
    }
    if (optind < argc)
        return run_files(argc - optind, argv + optind);
    return fuzz(argv[0]);
}
