/*
 * test_io_mutation.c - every byte of I/O configurations is changed, and they end anywhere: refused, or without harm.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * usage: test_io_mutation FOLDER...    configurations that plctool made (tests/fuzz/make_corpus.py)
 *
 * IO_MUTATION=all in the environment tries all values of each byte; otherwise each bit is changed, and the byte is
 * set to what ends ranges.
 */
#define _GNU_SOURCE
#include "../../firmware/port/linux/SysfsFiles.h"
#include "io_any.h"

#include <dirent.h>
#include <ftw.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MAX_CONFIG = 2048, HEAD = sizeof(IO_CONFIG) };

static RTS_UI8 good[MAX_CONFIG];
static RTS_UI32 good_size;
static RTS_UI8 bad[MAX_CONFIG];
static RTS_UI32 tried;
static RTS_UI32 harmless; /* of those: loaded */
static bool tries_all;

/* ---- one configuration ---- */

static bool check_bad(RTS_UI32 size, const char *how, RTS_UI32 where)
{
    int failures = test_failures;
    bool loaded;
    const char *wrong = any_try(bad, size, &loaded);

    tried++;
    harmless += loaded;
    CHECK(wrong == NULL);
    if (test_failures != failures)
        fprintf(stderr, "^ %s %u: %s\n", how, (unsigned)where, wrong != NULL ? wrong : "");
    return loaded;
}

static void take_good(void)
{
    memcpy(bad, good, good_size);
}

static void change_byte(RTS_UI32 at, RTS_UI32 value)
{
    take_good();
    bad[at] = (RTS_UI8)value;
    if (bad[at] != good[at])
        (void)check_bad(good_size, "byte", at << 8 | value);
}

/* ---- all of them ---- */

static void it_is_right_as_it_is(void)
{
    take_good();
    CHECK(check_bad(good_size, "size", good_size));
    if (any_refusal.text[0] != '\0')
        fprintf(stderr, "^ %s\n", any_refusal.text);
}

static void every_changed_byte_is_refused_or_harmless(void)
{
    static const RTS_UI8 ends[] = {0x00, 0x01, 0x7F, 0x80, 0xFE, 0xFF};
    RTS_UI32 at;
    RTS_UI32 i;

    for (at = 0; at < good_size; at++) {
        for (i = 0; i < 256 && tries_all; i++)
            change_byte(at, i);
        for (i = 0; i < 8 && !tries_all; i++)
            change_byte(at, good[at] ^ 1u << i);
        for (i = 0; i < RTS_COUNT(ends) && !tries_all; i++)
            change_byte(at, ends[i]);
    }
}

/* What says that it is as long as it was is refused. */
static void every_truncation_is_refused(void)
{
    RTS_UI32 size;

    take_good();
    for (size = 1; size < good_size; size++)
        CHECK(!check_bad(size, "size", size));
}

/* What says that it is as short as that may lose data that nothing needs. */
static void every_truncation_that_hides_itself_is_refused_or_harmless(void)
{
    RTS_UI32 size;
    IO_CONFIG head;

    memcpy(&head, good, HEAD);
    for (size = good_size - head.data_size; size < good_size; size += 4) {
        IO_CONFIG cut = head;
        take_good();
        cut.data_size -= good_size - size;
        memcpy(bad, &cut, HEAD);
        (void)check_bad(size, "size", size);
    }
}

/* ---- the folder of the kernel's files ---- */

static char root[] = "/tmp/test_io_mutation.XXXXXX";

static void put(const char *name, const char *text)
{
    char path[256];
    FILE *file;

    (void)snprintf(path, sizeof path, "%s/%s", root, name);
    file = text != NULL ? fopen(path, "w") : NULL;
    CHECK(text == NULL ? mkdir(path, 0777) == 0 : file != NULL && fputs(text, file) >= 0 && fclose(file) == 0);
}

static void begin_kernel(void)
{
    static const char *const files[][2] = {
        {"bus", NULL},
        {"bus/iio", NULL},
        {"bus/iio/devices", NULL},
        {"bus/iio/devices/iio:device0", NULL},
        {"bus/iio/devices/iio:device0/name", "ads1115\n"},
        {"bus/iio/devices/iio:device0/in_voltage0_raw", "100\n"},
        {"bus/iio/devices/iio:device0/in_voltage1_raw", "-7\n"},
        {"bus/iio/devices/iio:device0/in_voltage_scale", "0.125\n"},
        {"bus/iio/devices/iio:device0/out_voltage0_raw", "0\n"},
        {"class", NULL},
        {"class/pwm", NULL},
        {"class/pwm/pwmchip0", NULL},
        {"class/pwm/pwmchip0/npwm", "2\n"},
        {"class/pwm/pwmchip0/pwm1", NULL},
        {"class/pwm/pwmchip0/pwm1/period", "0\n"},
        {"class/pwm/pwmchip0/pwm1/duty_cycle", "0\n"},
        {"class/pwm/pwmchip0/pwm1/enable", "0\n"},
    };
    RTS_UI32 i;

    CHECK(mkdtemp(root) != NULL);
    for (i = 0; i < RTS_COUNT(files); i++)
        put(files[i][0], files[i][1]);
    SysfsSetRoot(root);
    CHECK_EQUAL(IoDrvSysfs_Hook(CH_INIT2), ERR_OK);
}

static int remove_entry(const char *path, const struct stat *status, int flag, struct FTW *walk)
{
    RTS_UNUSED(status);
    RTS_UNUSED(flag);
    RTS_UNUSED(walk);
    return remove(path);
}

static void end_kernel(void)
{
    CHECK_EQUAL(IoDrvSysfs_Hook(CH_EXIT2), ERR_OK);
    CHECK_EQUAL(nftw(root, remove_entry, 8, FTW_DEPTH | FTW_PHYS), 0);
}

/* ---- the configurations ---- */

static void try_all_of_it(const char *name)
{
    printf("%s, %u bytes:\n", name, (unsigned)good_size);
    tried = harmless = 0;
    RUN(it_is_right_as_it_is);
    RUN(every_changed_byte_is_refused_or_harmless);
    RUN(every_truncation_is_refused);
    RUN(every_truncation_that_hides_itself_is_refused_or_harmless);
    printf("     %u tried, %u refused, %u harmless\n", (unsigned)tried, (unsigned)(tried - harmless),
           (unsigned)harmless);
}

static void try_nested(void)
{
    any_spec();
    any_nest("IoDrvTest");
    good_size = spec.io.size;
    memcpy(good, spec.code + spec.io.offset, good_size);
    try_all_of_it("nested");
}

static void try_file(const char *folder, const char *name)
{
    char path[512];
    FILE *file;

    (void)snprintf(path, sizeof path, "%s/%s", folder, name);
    file = fopen(path, "rb");
    CHECK(file != NULL);
    if (file == NULL)
        return;
    good_size = (RTS_UI32)fread(good, 1, sizeof good, file);
    (void)fclose(file);
    try_all_of_it(name);
}

int main(int count, char **arguments)
{
    static const char *const names[] = {"gpio", "modbus_client", "modbus_server", "sim", "sysfs"};
    const char *how = getenv("IO_MUTATION");
    RTS_UI32 i;

    tries_all = how != NULL && strcmp(how, "all") == 0;
    any_begin();
    begin_kernel();
    try_nested();
    for (i = 0; i < RTS_COUNT(names) && count == 2; i++)
        try_file(arguments[1], names[i]);
    end_kernel();
    return test_result();
}
