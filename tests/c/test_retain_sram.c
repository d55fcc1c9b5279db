/*
 * test_retain_sram.c - retain variables with a copy in RAM that keeps its content: nothing is lost without a warning.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SysSram.h"
#include "app_device.h"

enum { SRAM = 2 * 128 }; /* room for the variables of the counter */

static RTS_UI32 counted(void)
{
    return read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET);
}

/* Main passes at the end of each advance, so the copy is that of the last cycle. */
static RTS_UI32 run_with(RTS_UI32 sram)
{
    SimSetSram(sram);
    start_with_counter(1);
    CHECK_EQUAL(SimAdvance(ms(5470)), ERR_OK);
    return counted();
}

static RTS_UI8 *find_copy(RTS_UI32 *size)
{
    return SysSramGet(size);
}

static void a_power_cut_loses_nothing(void)
{
    RTS_UI32 value = run_with(SRAM);

    for (int i = 0; i < 5; i++) {
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(counted(), value);
        CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_B_OFFSET), value);
        CHECK_EQUAL(SimAdvance(ms(130)), ERR_OK);
        CHECK(counted() >= value + 12);
        value = counted();
    }
}

static void an_empty_battery_leaves_the_record_in_flash(void)
{
    RTS_UI32 value = run_with(SRAM);

    SimSetSram(SRAM);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(counted() < value && counted() + 110 > value);
}

static void memory_that_is_too_small_is_not_used(void)
{
    RTS_UI32 size;
    RTS_UI32 value = run_with(48);
    const RTS_UI8 *copy = find_copy(&size);

    for (RTS_UI32 i = 0; i < size; i++)
        CHECK_EQUAL(copy[i], 0xA5);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(counted() < value);
}

/* A bit that has fallen, or a copy that was written halfway. */
static void each_damaged_byte_leaves_the_other_copy_or_the_record_in_flash(void)
{
    RTS_UI32 value = run_with(SRAM);
    RTS_UI32 fell_back = 0;
    RTS_UI32 size;
    RTS_UI8 good[SRAM];

    memcpy(good, find_copy(&size), SRAM);
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    for (RTS_UI32 i = 0; i < SRAM; i++) {
        CHECK_EQUAL(SimFlashRestore(), ERR_OK);
        memcpy(find_copy(&size), good, SRAM);
        find_copy(&size)[i] ^= 0x10;
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK(counted() <= value && counted() + 110 > value);
        CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_B_OFFSET), counted());
        fell_back += counted() < value;
        CHECK_EQUAL(SimStart(), ERR_OK);
    }
    CHECK(fell_back > 20 && fell_back < SRAM);
}

static void a_cut_at_each_flash_operation_loses_nothing(void)
{
    for (RTS_UI32 mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        bool cut = true;
        for (RTS_UI32 operation = 1; cut; operation++) {
            RTS_UI32 value = run_with(SRAM);
            SimFlashCut(operation, mode);
            cut = SimAdvance(ms(1000)) == SIM_POWER_CUT;
            if (!cut)
                value = counted();
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK(counted() >= value);
            CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_B_OFFSET), counted());
        }
    }
}

/* What a reset has cleared does not come back with the power. */
static void a_copy_from_before_a_reset_does_not_count(void)
{
    static APP_BYTES image;
    RTS_UI32 initial;

    SimSetSram(SRAM);
    start_with_counter(1);
    initial = counted();
    CHECK_EQUAL(SimAdvance(ms(5470)), ERR_OK);
    CHECK(counted() > initial);
    CHECK_EQUAL(AppReset(RESET_OPTION_COLD), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(counted(), initial);

    (void)run_with(SRAM);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    build_counter(&image, 1);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(counted(), initial);
}

static void a_changed_program_has_its_own_values(void)
{
    static APP_BYTES image;

    (void)run_with(SRAM);
    build_counter(&image, 2);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(200)), ERR_OK);
    RTS_UI32 value = counted();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(counted(), value);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(a_power_cut_loses_nothing);
    RUN(an_empty_battery_leaves_the_record_in_flash);
    RUN(memory_that_is_too_small_is_not_used);
    RUN(each_damaged_byte_leaves_the_other_copy_or_the_record_in_flash);
    RUN(a_cut_at_each_flash_operation_loses_nothing);
    RUN(a_copy_from_before_a_reset_does_not_count);
    RUN(a_changed_program_has_its_own_values);
    return test_result();
}
