/*
 * test_flash_sim.c - the flash simulator itself is as strict as it says.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "Sim.h"
#include "SysFlash.h"
#include "test.h"

static const RTS_UI8 ones[64] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};

static const SYS_FLASH *blank(RTS_UI32 program_size, RTS_UI8 erased)
{
    CHECK_EQUAL(SimFlashConfigure(16 * 1024, 256, program_size, erased), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 0);
    return SysFlashGet();
}

static void only_possible_geometries_are_accepted(void)
{
    CHECK_EQUAL(SimFlashConfigure(0, 256, 1, 0xFF), ERR_PARAMETER);
    CHECK_EQUAL(SimFlashConfigure(1000, 256, 1, 0xFF), ERR_PARAMETER);
    CHECK_EQUAL(SimFlashConfigure(1024, 300, 1, 0xFF), ERR_PARAMETER);
    CHECK_EQUAL(SimFlashConfigure(1024, 256, 3, 0xFF), ERR_PARAMETER);
    CHECK_EQUAL(SimFlashConfigure(1024, 256, 32, 0xFF), ERR_PARAMETER);
    CHECK_EQUAL(SimFlashConfigure(1024, 256, 1, 0x55), ERR_PARAMETER);
    CHECK_EQUAL(SimFlashConfigure(1024, 256, 16, 0x00), ERR_OK);
    CHECK(SimFlashData()[0] == 0 && SimFlashData()[1023] == 0);
    CHECK_EQUAL(SimFlashSize(), 1024);
}

static void a_byte_is_programmed_once(void)
{
    const SYS_FLASH *flash = blank(1, 0xFF);
    RTS_UI8 value = 0xFF;

    CHECK_EQUAL(flash->program(100, ones, 4), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 0);
    CHECK_EQUAL(flash->program(103, ones, 1), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 1);
    CHECK(strcmp(SimFlashViolation(), "programmed twice at offset 103") == 0);
    CHECK_EQUAL(flash->program(200, &value, 1), ERR_OK); /* also when nothing changes */
    CHECK_EQUAL(flash->program(200, &value, 1), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 2);
    CHECK_EQUAL(flash->erase(0), ERR_OK);
    CHECK_EQUAL(flash->program(103, ones, 1), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 2);
}

static void programming_only_changes_bits_away_from_erased(void)
{
    const SYS_FLASH *flash = blank(1, 0xFF);
    RTS_UI8 a = 0xF0;
    RTS_UI8 b = 0x3C;

    CHECK_EQUAL(flash->program(0, &a, 1), ERR_OK);
    CHECK_EQUAL(flash->program(0, &b, 1), ERR_OK);
    CHECK_EQUAL(SimFlashData()[0], 0x30);
    flash = blank(1, 0x00);
    CHECK_EQUAL(flash->program(0, &a, 1), ERR_OK);
    CHECK_EQUAL(flash->program(0, &b, 1), ERR_OK);
    CHECK_EQUAL(SimFlashData()[0], 0xFC);
}

static void misaligned_and_outside_operations_are_refused(void)
{
    const SYS_FLASH *flash = blank(8, 0xFF);
    RTS_UI8 data[16];

    CHECK_EQUAL(flash->program(4, ones, 8), ERR_DEVICE);
    CHECK_EQUAL(flash->program(8, ones, 4), ERR_DEVICE);
    CHECK_EQUAL(flash->program(16 * 1024, ones, 8), ERR_DEVICE);
    CHECK_EQUAL(flash->program(16 * 1024 - 8, ones, 16), ERR_DEVICE);
    CHECK_EQUAL(flash->program(0xFFFFFFF8, ones, 16), ERR_DEVICE);
    CHECK_EQUAL(flash->program(0, ones, 0), ERR_DEVICE);
    CHECK_EQUAL(flash->erase(128), ERR_DEVICE);
    CHECK_EQUAL(flash->erase(16 * 1024), ERR_DEVICE);
    CHECK_EQUAL(flash->read(16 * 1024 - 8, data, 9), ERR_DEVICE);
    CHECK_EQUAL(SimFlashViolations(), 9);
    CHECK_EQUAL(SimFlashOps(), 0);
}

static void an_erase_takes_one_sector(void)
{
    const SYS_FLASH *flash = blank(1, 0xFF);

    CHECK_EQUAL(flash->program(255, ones, 3), ERR_OK);
    CHECK_EQUAL(flash->erase(256), ERR_OK);
    CHECK_EQUAL(SimFlashData()[255], 1);
    CHECK_EQUAL(SimFlashData()[256], 0xFF);
    CHECK_EQUAL(SimFlashOps(), 2);
}

static void program_16(void *unused)
{
    RTS_UNUSED(unused);
    (void)SysFlashGet()->program(0, ones, 16);
    (void)SysFlashGet()->program(16, ones, 16);
    (void)SysFlashGet()->erase(0);
}

static RTS_UI32 programmed_bytes(void)
{
    RTS_UI32 count = 0;
    RTS_UI32 i;

    for (i = 0; i < 256; i++)
        count += SimFlashData()[i] == 1;
    return count;
}

static void a_cut_hits_the_operation_it_was_planned_for(void)
{
    static const RTS_UI32 expected[3][4] = {{0, 16, 32, 0}, {16, 32, 0, 0}, {8, 24, 0, 0}};
    RTS_UI32 mode;
    RTS_UI32 k;

    for (mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        for (k = 1; k <= 3; k++) {
            (void)blank(1, 0xFF);
            SimFlashCut(k, mode);
            CHECK(SimCall(program_16, NULL) == SIM_POWER_CUT);
            CHECK_EQUAL(programmed_bytes(), expected[mode][k - 1]);
            CHECK(SimCall(program_16, NULL) == SIM_POWER_CUT);
            CHECK_EQUAL(SimAdvance(1), SIM_POWER_CUT);
            CHECK_EQUAL(SimCommCycle(), SIM_POWER_CUT);
            CHECK_EQUAL(SimRunCycles(1), SIM_POWER_CUT);
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK_EQUAL(SimAdvance(1), ERR_OK);
        }
    }
}

static void a_torn_erase_takes_half_a_sector(void)
{
    const SYS_FLASH *flash = blank(1, 0xFF);

    CHECK_EQUAL(flash->program(0, ones, 1), ERR_OK);
    CHECK_EQUAL(flash->program(255, ones, 1), ERR_OK);
    SimFlashCut(1, SIM_CUT_TORN);
    CHECK_EQUAL(flash->erase(0), ERR_DEVICE);
    CHECK_EQUAL(SimFlashData()[0], 0xFF);
    CHECK_EQUAL(SimFlashData()[255], 1);
}

static void a_half_programmed_unit_is_used_up(void)
{
    const SYS_FLASH *flash = blank(8, 0xFF);

    SimFlashCut(1, SIM_FAULT);
    CHECK_EQUAL(flash->program(0, ones, 8), ERR_DEVICE);
    CHECK_EQUAL(programmed_bytes(), 4);
    CHECK_EQUAL(flash->program(8, ones, 8), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 0);
    CHECK_EQUAL(flash->program(0, ones, 8), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 1);
}

static void outside_of_a_call_a_cut_leaves_the_flash_dead_until_power_on(void)
{
    const SYS_FLASH *flash = blank(1, 0xFF);

    SimFlashCut(1, SIM_CUT_AFTER);
    CHECK_EQUAL(flash->program(0, ones, 4), ERR_DEVICE);
    CHECK_EQUAL(flash->program(4, ones, 4), ERR_DEVICE);
    CHECK_EQUAL(flash->erase(0), ERR_DEVICE);
    CHECK_EQUAL(flash->sync(), ERR_DEVICE);
    CHECK_EQUAL(SimFlashData()[3], 1);
    CHECK_EQUAL(SimFlashData()[4], 0xFF);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(flash->program(4, ones, 4), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

static void content_is_kept_and_brought_back_with_what_was_programmed(void)
{
    const SYS_FLASH *flash = blank(1, 0xFF);

    CHECK_EQUAL(flash->program(0, ones, 4), ERR_OK);
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    CHECK_EQUAL(flash->erase(0), ERR_OK);
    CHECK_EQUAL(flash->program(8, ones, 4), ERR_OK);
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimFlashData()[0], 1);
    CHECK_EQUAL(SimFlashData()[8], 0xFF);
    CHECK_EQUAL(flash->program(8, ones, 4), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 0);
    CHECK_EQUAL(flash->program(0, ones, 4), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 1);
    CHECK_EQUAL(SimFlashConfigure(1024, 256, 1, 0xFF), ERR_OK);
    CHECK_EQUAL(SimFlashRestore(), ERR_NO_OBJECT);
}

static void code_is_mapped_per_slot_and_aligned(void)
{
    const SYS_FLASH *flash = blank(1, 0xFF);
    const RTS_UI8 *a;
    const RTS_UI8 *b;

    CHECK_EQUAL(flash->program(0x20, ones, 16), ERR_OK);
    a = SysFlashMapCode(0, 0x20, 64);
    b = SysFlashMapCode(1, 0x20, 64);
    CHECK(a != NULL && b != NULL && a != b);
    CHECK_EQUAL((uintptr_t)a % 16, 0);
    CHECK(memcmp(a, ones, 16) == 0 && memcmp(b, ones, 16) == 0);
    SysFlashReleaseCode(0);
    SysFlashReleaseCode(0);
    CHECK_EQUAL(b[0], 1);
    CHECK(SysFlashMapCode(2, 0, 16) == NULL);
    CHECK(SysFlashMapCode(0, 0, 0) == NULL);
    CHECK(SysFlashMapCode(0, 16 * 1024 - 8, 16) == NULL);
    SysFlashReleaseCode(1);
    SysFlashReleaseCode(2);
}

static void a_call_that_is_planned_to_fail_fails_once_and_does_nothing(void)
{
    const SYS_FLASH *flash = blank(8, 0xFF);
    RTS_UI8 data[8];

    SimFlashFail(SIM_PROGRAM, 2);
    SimFlashFail(SIM_ERASE, 1);
    SimFlashFail(SIM_READ, 1);
    CHECK_EQUAL(flash->program(0, ones, 8), ERR_OK);
    CHECK_EQUAL(flash->program(8, ones, 8), ERR_DEVICE);
    CHECK_EQUAL(SimFlashData()[8], 0xFF);
    CHECK_EQUAL(flash->program(8, ones, 8), ERR_OK); /* not programmed twice */
    CHECK_EQUAL(flash->erase(0), ERR_DEVICE);
    CHECK_EQUAL(SimFlashData()[0], 1);
    CHECK_EQUAL(flash->read(0, data, 8), ERR_DEVICE);
    CHECK_EQUAL(flash->read(0, data, 8), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 0);
}

static void what_a_sync_did_not_save_is_lost_with_power(void)
{
    const SYS_FLASH *flash = blank(8, 0xFF);

    SimFlashFail(SIM_SYNC, 2);
    CHECK_EQUAL(flash->program(0, ones, 8), ERR_OK);
    CHECK_EQUAL(flash->sync(), ERR_OK);
    CHECK_EQUAL(flash->program(8, ones, 8), ERR_OK);
    CHECK_EQUAL(flash->sync(), ERR_DEVICE);
    CHECK_EQUAL(SimFlashData()[8], 1);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(SimFlashData()[0], 1);
    CHECK_EQUAL(SimFlashData()[8], 0xFF);
}

static void a_plan_for_the_next_start_counts_from_there(void)
{
    RTS_UI32 calls;

    (void)blank(8, 0xFF);
    SimFlashSetMapped(0);
    SimFlashFail(SIM_READ, 1);
    SimFlashAtStart();
    CHECK_EQUAL(SimStart(), ERR_OK); /* a read that fails is repeated, so more is read in all */
    calls = SimFlashCalls(SIM_READ);
    CHECK_EQUAL(SimStart(), ERR_OK); /* and the plan is over */
    CHECK(calls > SimFlashCalls(SIM_READ));
    SimFlashSetMapped(1);
}

static void bytes_that_cannot_be_read_fail_each_read_until_others_are_named(void)
{
    const SYS_FLASH *flash = blank(8, 0xFF);
    RTS_UI8 data[16];

    SimFlashUnreadable(16, 8);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(flash->read(0, data, 16) == ERR_OK && flash->read(24, data, 8) == ERR_OK);
    CHECK(flash->read(23, data, 1) == ERR_DEVICE && flash->read(9, data, 8) == ERR_DEVICE);
    CHECK_EQUAL(flash->read(16, data, 1), ERR_DEVICE);
    SimFlashUnreadable(0, 0);
    CHECK_EQUAL(flash->read(16, data, 1), ERR_OK);
}

static void calls_can_fail_from_one_on(void)
{
    const SYS_FLASH *flash = blank(1, 0xFF);

    SimFlashFailFrom(SIM_PROGRAM, 2);
    CHECK_EQUAL(flash->program(8, ones, 1), ERR_OK);
    CHECK(flash->program(9, ones, 1) == ERR_DEVICE && flash->program(9, ones, 1) == ERR_DEVICE);
    SimFlashFail(SIM_PROGRAM, 0);
    CHECK_EQUAL(flash->program(9, ones, 1), ERR_OK);
    SimFlashFailFrom(SIM_PROGRAM, 1);
    SimFlashAtStart();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(flash->program(10, ones, 1) == ERR_DEVICE && flash->program(10, ones, 1) == ERR_DEVICE);
    SimFlashFail(SIM_MAP_CODE, 1);
    CHECK(SysFlashMapCode(0, 0, 16) == NULL && SysFlashMapCode(0, 0, 16) != NULL);
}

static void what_is_loaded_counts_as_programmed(void)
{
    static RTS_UI8 content[16 * 1024];
    const SYS_FLASH *flash = blank(1, 0xFF);

    memset(content, 0xFF, sizeof content);
    content[5] = 1;
    CHECK_EQUAL(SimFlashLoad(content, 100), ERR_PARAMETER);
    CHECK_EQUAL(SimFlashLoad(content, sizeof content), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(flash->program(4, ones, 1), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 0);
    CHECK_EQUAL(flash->program(5, ones, 1), ERR_OK);
    CHECK_EQUAL(SimFlashViolations(), 1);
}

/* What a process programmed is there after it died; a store of its own into the flash is what it dies of. */
static void cells_survive_the_process_and_are_not_written_by_stores(void)
{
    const SYS_FLASH *flash = blank(1, 0xFF);
    int status = 0;
    pid_t child = fork();

    if (child == 0) {
        (void)flash->program(0, ones, 1);
        *(volatile RTS_UI8 *)(uintptr_t)flash->mapped = 7;
        _exit(0);
    }
    CHECK(child > 0 && waitpid(child, &status, 0) == child);
    CHECK(!WIFEXITED(status) || WEXITSTATUS(status) != 0);
    CHECK_EQUAL(SimFlashData()[0], 1);
}

/* Also what a child process or a test has changed. */
static void a_new_flash_of_the_same_size_is_erased_everywhere(void)
{
    static const RTS_UI32 places[] = {0, 60, 4092, 4096, 8191, 16 * 1024 - 64};
    const SYS_FLASH *flash = blank(1, 0xFF);
    pid_t child;

    for (RTS_UI32 i = 0; i < RTS_COUNT(places); i++)
        CHECK_EQUAL(flash->program(places[i], ones, i == 4 ? 2 : 1), ERR_OK);
    child = fork();
    if (child == 0)
        _exit(flash->program(12000, ones, 64) == ERR_OK ? 0 : 1);
    (void)waitpid(child, NULL, 0);
    CHECK_EQUAL(flash->mapped[12000], 1);
    for (int poked = 0; poked < 2; poked++) {
        flash = blank(1, 0xFF);
        for (RTS_UI32 i = 0; i < SimFlashSize(); i++)
            CHECK_EQUAL(flash->mapped[i], 0xFF);
        for (RTS_UI32 i = 0; i < SimFlashSize(); i += sizeof ones)
            CHECK_EQUAL(flash->program(i, ones, sizeof ones), ERR_OK);
        CHECK_EQUAL(SimFlashViolations(), 0);
        memset(SimFlashData(), 0x5A, SimFlashSize());
    }
}

static void a_new_flash_of_a_child_process_is_its_own(void)
{
    const SYS_FLASH *flash = blank(1, 0xFF);
    pid_t child;

    CHECK_EQUAL(flash->program(0, ones, sizeof ones), ERR_OK);
    child = fork();
    if (child == 0) {
        flash = blank(1, 0xFF);
        _exit(flash->program(4096, ones, sizeof ones) == ERR_OK && flash->mapped[0] == 0xFF ? 0 : 1);
    }
    (void)waitpid(child, NULL, 0);
    CHECK_EQUAL(flash->mapped[0], 1);
    CHECK_EQUAL(flash->mapped[4096], 0xFF);
}

int main(void)
{
    RUN(only_possible_geometries_are_accepted);
    RUN(a_byte_is_programmed_once);
    RUN(programming_only_changes_bits_away_from_erased);
    RUN(misaligned_and_outside_operations_are_refused);
    RUN(an_erase_takes_one_sector);
    RUN(a_cut_hits_the_operation_it_was_planned_for);
    RUN(a_torn_erase_takes_half_a_sector);
    RUN(a_half_programmed_unit_is_used_up);
    RUN(outside_of_a_call_a_cut_leaves_the_flash_dead_until_power_on);
    RUN(content_is_kept_and_brought_back_with_what_was_programmed);
    RUN(code_is_mapped_per_slot_and_aligned);
    RUN(a_call_that_is_planned_to_fail_fails_once_and_does_nothing);
    RUN(what_a_sync_did_not_save_is_lost_with_power);
    RUN(a_plan_for_the_next_start_counts_from_there);
    RUN(bytes_that_cannot_be_read_fail_each_read_until_others_are_named);
    RUN(calls_can_fail_from_one_on);
    RUN(what_is_loaded_counts_as_programmed);
    RUN(a_new_flash_of_the_same_size_is_erased_everywhere);
    RUN(cells_survive_the_process_and_are_not_written_by_stores);
    RUN(a_new_flash_of_a_child_process_is_its_own);
    return test_result();
}
