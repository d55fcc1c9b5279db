/*
 * test_app_mutation.c - images that are cut short, bit-flipped or made up are refused, or run without harm.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "app_image.h"
#include "test.h"

enum { SIMBURN_SIGNATURE = 0x76DDCD81 };

static APP_BYTES good; /* application 2 */
static APP_BYTES bad;
static APP_REFUSAL refusal;

/* A device that runs application 1. */
static void begin(void)
{
    APP_BYTES first;

    CHECK(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF) == ERR_OK);
    CHECK(SimStart() == ERR_OK);
    build_counter(&first, 1);
    CHECK(download(&first) == ERR_OK);
    CHECK(AppStartApplication() == ERR_OK);
    CHECK(SimAdvance(ms(5000)) == ERR_OK);
}

static void check_old_runs(void)
{
    RTS_UI32 before = read_u32(APP_AREA_DATA, COUNTER_OFFSET);

    CHECK(app_state() == AS_RUN);
    CHECK(read_u32(APP_AREA_DATA, STEP_OFFSET) == 1);
    CHECK(SimAdvance(ms(20)) == ERR_OK);
    CHECK(read_u32(APP_AREA_DATA, COUNTER_OFFSET) == before + 2);
}

static void check_refused(RTS_UI32 where)
{
    int failures = test_failures;

    CHECK(download_part(&bad, bad.size, &refusal) != ERR_OK);
    CHECK(refusal.text[0] != '\0');
    check_old_runs();
    if (test_failures != failures)
        fprintf(stderr, "^ at %u: %s\n", (unsigned)where, refusal.text);
}

static void every_truncation_is_refused(void)
{
    begin();
    for (bad = good, bad.size = 0; bad.size < good.size; bad.size++)
        check_refused(bad.size);
    CHECK(SimFlashViolations() == 0);
}

/* As above, but the image says that it is as short as that, and its CRC is right: now the tables are what is cut. */
static void every_truncation_that_hides_itself_is_refused(void)
{
    RTS_UI32 size;

    begin();
    for (size = CDL_HEADER_SIZE; size < good.size; size++) {
        CDL_HEADER header = image_header(&good);
        bad = good;
        bad.size = size;
        header.total_size = size;
        image_set_header(&bad, header);
        check_refused(size);
    }
}

static void every_flipped_bit_is_refused(void)
{
    RTS_UI32 bit;

    begin();
    for (bit = 0; bit < good.size * 8; bit++) {
        bad = good;
        bad.bytes[bit / 8] ^= (RTS_UI8)(1 << bit % 8);
        check_refused(bit);
    }
    CHECK(SimFlashViolations() == 0);
    printf("     %u bits\n", (unsigned)bit);
}

/*
 * Changes that keep the CRC right get past it to the later checks. Whatever comes of it, the runtime must live: the
 * image is refused, or loaded and stopped again. Its code is not started, since it may be anything.
 */
static void try_image(void)
{
    RTS_UI32 i;

    if (download_part(&bad, bad.size, &refusal) != ERR_OK) {
        CHECK(refusal.text[0] != '\0');
        check_old_runs();
        return;
    }
    CHECK(app_state() == AS_STOP);
    for (i = 0; i < 5; i++)
        CHECK(strlen(AppGetInfo(i)) < APP_NAME_SIZE);
    for (i = 0; i < IecTaskGetCount(); i++) {
        IEC_TASK_INFO info;
        CHECK(IecTaskGetInfo(i, &info) == ERR_OK);
        CHECK(memchr(info.name, '\0', sizeof info.name) != NULL);
    }
    CHECK(SimFlashRestore() == ERR_OK);
    CHECK(SimStart() == ERR_OK);
    CHECK(SimAdvance(0) == ERR_OK);
}

/* Bits of the entry offsets would change what runs in GlobalInit; those images are left out. */
static bool changes_code_that_runs(RTS_UI32 byte)
{
    CDL_HEADER header = image_header(&good);
    CDL_HEADER changed = image_header(&bad);

    return (byte >= header.function_table.offset && byte < header.function_table.offset + header.function_table.size) ||
           byte >= header.code.offset || memcmp(&header.code, &changed.code, sizeof header.code) != 0 ||
           memcmp(&header.function_table, &changed.function_table, sizeof header.function_table) != 0;
}

static void every_flipped_bit_with_a_right_crc_is_survived(void)
{
    RTS_UI32 bit;

    begin();
    CHECK(SimFlashSave() == ERR_OK);
    for (bit = 0; bit < good.size * 8; bit++) {
        bad = good;
        bad.bytes[bit / 8] ^= (RTS_UI8)(1 << bit % 8);
        image_fix_crc(&bad);
        if (!changes_code_that_runs(bit / 8))
            try_image();
    }
    CHECK(SimFlashViolations() == 0);
}

static RTS_UI32 next_random(void)
{
    static RTS_UI32 state = 1;

    state = state * 1664525 + 1013904223;
    return state >> 8;
}

static void random_changes_with_a_right_crc_are_survived(void)
{
    static const RTS_UI32 values[] = {0, 1, 3, 4, 104, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFFFFF0, 0xFFFF};
    RTS_UI32 round;

    begin();
    CHECK(SimFlashSave() == ERR_OK);
    for (round = 0; round < 20000; round++) {
        RTS_UI32 changes = next_random() % 4 + 1;
        bool runs = false;
        bad = good;
        while (changes-- > 0) {
            RTS_UI32 at = next_random() % (good.size - 4) & ~3u;
            RTS_UI32 value = values[next_random() % RTS_COUNT(values)];
            memcpy(bad.bytes + at, &value, sizeof value);
            runs = runs || changes_code_that_runs(at);
        }
        image_fix_crc(&bad);
        if (!runs)
            try_image();
    }
}

int main(void)
{
    APP_SPEC spec;

    NEEDS_X86_64;
    spec_counter(&spec, 2);
    add_import(&spec, "simburn", SIMBURN_SIGNATURE, 0x00010000);
    build_image(&good, &spec);
    RUN(every_truncation_is_refused);
    RUN(every_truncation_that_hides_itself_is_refused);
    RUN(every_flipped_bit_is_refused);
    RUN(every_flipped_bit_with_a_right_crc_is_survived);
    RUN(random_changes_with_a_right_crc_are_survived);
    return test_result();
}
