/*
 * test_settings.c - settings in a file of the device: what is read, what is left out, and what follows from them.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpChecksum.h"
#include "CmpSettings.h"
#include "SettingValues.h"
#include "SettingsCheck.h"
#include "FileStore.h"
#include "../../firmware/src/app/AppCommit.h"
#include "../../firmware/src/app/AppLife.h"
#include "app_device.h"

enum { STORE = 16 * 1024 };

static RTS_RESULT put_settings(const char *text)
{
    RTS_UI32 size = (RTS_UI32)strlen(text);
    RTS_RESULT result = FileStoreBegin(SETTINGS_FILE_NAME, size, CRC32Update(0, text, size));

    if (result == ERR_OK)
        result = FileStoreWrite((const RTS_UI8 *)text, size);
    return result == ERR_OK ? FileStoreEnd() : result;
}

/* A device with a file store, and in it this text. */
static void start_with(const char *text)
{
    SimFileStoreSize = STORE;
    CHECK_EQUAL(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(put_settings(text), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
}

/* ---- the text ---- */

static RTS_UI32 fault(const char *text, char *words)
{
    return SettingsCheck(text, (RTS_UI32)strlen(text), 0, words);
}

static void a_file_sets_values_and_all_others_are_the_standard(void)
{
    start_with("\xEF\xBB\xBF; comment\r\n# and\r\n// so\r\n\r\n [ CmpRetain ] \r\nSavePeriod = 0x200 "
               "\r\n[CmpLog]\nLogger.0.Filter=7");
    CHECK_EQUAL(SETTING(RetainSave), 0x200);
    CHECK_EQUAL(SETTING(LogFilter), 7);
    CHECK_EQUAL(SETTING(Watchdog), 0);
    CHECK_EQUAL(SETTING(BootStart), BOOT_START_ALWAYS);
    CHECK(!log_has("left out"));
    CHECK_EQUAL(FileStoreDelete(SETTINGS_FILE_NAME), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(SETTING(RetainSave), 1000);
}

static void a_line_that_is_not_valid_costs_a_warning_and_nothing_else(void)
{
    static const char *const lines[] = {"SavePeriod",
                                        "SavePeriod=99",
                                        "SavePeriod=3600001",
                                        "SavePeriod=1x",
                                        "SavePeriod=",
                                        "SavePeriod=99999999999999999999",
                                        "Unknown=5",
                                        "=5",
                                        "[",
                                        "[]",
                                        "\x01",
                                        "SavePeriod=--5",
                                        "SavePeriod=0x"};
    char text[120];

    for (RTS_UI32 i = 0; i < RTS_COUNT(lines); i++) {
        (void)snprintf(text, sizeof(text), "[CmpRetain]\n%s\n[CmpIecTask]\nWatchdog=500\n", lines[i]);
        start_with(text);
        CHECK_EQUAL(SETTING(RetainSave), 1000);
        CHECK_EQUAL(SETTING(Watchdog), 500);
        CHECK(log_has("Settings.cfg line 2 is left out"));
    }
}

static void a_file_of_bad_lines_leaves_room_in_the_log(void)
{
    LOG_ENTRY entry = {0};
    RTS_UI32 count = 0;
    char text[SETTINGS_FILE_SIZE] = {0};

    memset(text, '\n', sizeof text - 1);
    for (RTS_UI32 i = 0; i < sizeof text - 1; i += 2)
        text[i] = 'x';
    start_with(text);
    CHECK(log_has("Settings.cfg line 3 is left out"));
    CHECK(!log_has("Settings.cfg line 4 is left out"));
    CHECK(log_has("Settings.cfg: 509 more lines are left out"));
    for (; LogGetEntry(entry.handle + 1, &entry) == ERR_OK; count++)
        ;
    CHECK(count < LOG_MAX_ENTRIES / 2);
}

static void a_file_that_is_too_large_is_left_out_as_a_whole(void)
{
    static char text[SETTINGS_FILE_SIZE + 2];

    memset(text, '\n', SETTINGS_FILE_SIZE + 1);
    memcpy(text, "[CmpIecTask]\nWatchdog=500\n", 26);
    start_with(text);
    CHECK_EQUAL(SETTING(Watchdog), 0);
    CHECK(log_has("Settings.cfg is left out: it cannot be read, or has more than 1024 bytes"));
    text[SETTINGS_FILE_SIZE] = '\0';
    start_with(text);
    CHECK_EQUAL(SETTING(Watchdog), 500);
}

static void a_fault_is_said_with_its_line_and_what_to_write(void)
{
    static const struct {
        const char *text;
        RTS_UI32 line;
        const char *words;
    } faults[] = {
        {"\n[CmpRetian]\nSavePeriod=500\n", 3,
         "[CmpRetian] SavePeriod is not a setting: write [CmpRetain] SavePeriod if that is meant"},
        {"[CmpLog]\nsaveperiod=500\n", 2,
         "[CmpLog] saveperiod is not a setting: write [CmpRetain] SavePeriod if that is meant"},
        {"[CmpLog]\nx=500\n", 2, "[CmpLog] x is not a setting: plcrt --help-config lists all"},
        {"[CmpRetain]\nSavePeriod=5\n", 2, "[CmpRetain] SavePeriod=5 is not valid: give a number from 100 to 3600000"},
        {"[CmpApp]\nBootproject.Start=Always", 2,
         "[CmpApp] Bootproject.Start=Always is not valid: give always, never or clean"},
        {"[SysMdns]\nAnnounce=1", 2, "[SysMdns] Announce=1 is not valid: give no or yes"},
        {"[CmpBlkDrvTcp]\nAddress=", 2, "[CmpBlkDrvTcp] Address has no value: give one, or remove the line"},
        {"[CmpLog]\nLogger.0.Filter=1\nLogger.0.Filter=2\n", 3,
         "[CmpLog] Logger.0.Filter is in line 2 already: remove one of the two"},
        {"hello", 1, "not a setting: write [Component], Key=Value, or a comment after ;"},
    };
    char words[SETTINGS_WORDS_SIZE];

    for (RTS_UI32 i = 0; i < RTS_COUNT(faults); i++) {
        CHECK_EQUAL(fault(faults[i].text, words), faults[i].line);
        CHECK(strcmp(words, faults[i].words) == 0);
    }
    CHECK_EQUAL(fault("", words), 0);
    CHECK_EQUAL(fault("[CmpLog]\nLogger.0.Filter=1\n[CmpBlkDrvTcp]\nAddress=0", words), 0);
}

/* ---- what reads them ---- */

static void the_log_leaves_out_what_the_filter_says_but_never_exceptions(void)
{
    start_with("[CmpLog]\nLogger.0.Filter=4\n");
    LogAdd(CMPID_CmpLog, LOG_INFO, ERR_OK, "an information");
    LogAdd(CMPID_CmpLog, LOG_ERROR, ERR_OK, "an error");
    LogAdd(CMPID_CmpLog, LOG_EXCEPTION, ERR_OK, "an exception");
    CHECK(!log_has("an information"));
    CHECK(log_has("an error"));
    CHECK(log_has("an exception"));
}

static void start_counter(const char *text)
{
    APP_BYTES image;

    start_with(text);
    build_counter(&image, 1);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK); /* proven */
}

static void retain_variables_are_saved_as_often_as_the_period_says(void)
{
    start_counter("[CmpRetain]\nSavePeriod=100\n");
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(read_u32(APP_AREA_RETAIN, 0) > 585); /* of 600; with the standard period it would be some 500 */
}

static void a_task_without_watchdog_is_ended_after_the_time_of_the_setting(void)
{
    APP_BYTES image;
    APP_SPEC spec;

    start_with("[CmpIecTask]\nWatchdog=300\n");
    spec_init(&spec);
    add_task(&spec, "Main", KIND_CYCLIC, 10000, here(&spec))->watchdog_us = 0;
    emit_endless_loop(&spec);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(1000)), ERR_OK);
    CHECK(AppHasException());
}

/* ---- whether the program starts ---- */

static RTS_RESULT restart_after(RTS_UI8 cause)
{
    SYS_START start = {cause, SYS_BOOT_START, -1, RTSEXCPT_NOEXCEPTION, APP_NO_CODE_OFFSET, ""};

    SimSetStart(&start);
    return SimStart();
}

static void always_starts_also_after_an_exception(void)
{
    start_counter("[CmpApp]\nBootproject.Start=always\n");
    CHECK_EQUAL(restart_after(SYS_START_CRASH), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
}

static void never_waits_for_a_user_at_each_start(void)
{
    start_counter("[CmpApp]\nBootproject.Start=never\n");
    for (int i = 0; i < 2; i++) {
        CHECK_EQUAL(restart_after(SYS_START_POWER), ERR_OK);
        CHECK_EQUAL(app_state(), AS_STOP);
        CHECK(log_has("Boot project not started"));
        CHECK_EQUAL(AppStartApplication(), ERR_OK);
        CHECK_EQUAL(app_state(), AS_RUN);
    }
}

static void clean_starts_after_a_loss_of_power_and_not_after_a_crash(void)
{
    start_counter("[CmpApp]\nBootproject.Start=clean\n");
    CHECK_EQUAL(restart_after(SYS_START_POWER), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(restart_after(SYS_START_CRASH), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(restart_after(SYS_START_CRASH), ERR_OK); /* nothing ran meanwhile, and it does not get worse */
    CHECK_EQUAL(restart_after(SYS_START_POWER), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK(log_has("Boot project not started"));
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(restart_after(SYS_START_POWER), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK(AppCommitIsProven(AppCommitGet()->active));
}

/* As a fault in a cycle of a program that has proven itself. */
static void fail(void)
{
    AppHandleException(0, RTSEXCPT_DIVIDEBYZERO, 0);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK(AppHasException());
}

static void an_exception_of_a_proven_program_counts_for_clean_only(void)
{
    start_counter("");
    fail();
    CHECK_EQUAL(restart_after(SYS_START_POWER), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);

    start_counter("[CmpApp]\nBootproject.Start=clean\n");
    fail();
    CHECK_EQUAL(restart_after(SYS_START_POWER), ERR_OK);
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK(log_has("Boot project not started: it failed before"));
}

static void a_reset_and_a_start_after_an_exception_are_enough_for_clean(void)
{
    start_counter("[CmpApp]\nBootproject.Start=clean\n");
    fail();
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(restart_after(SYS_START_POWER), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
}

/* It goes back to the previous program, and that waits, too. */
static void after_the_failure_of_a_new_program_clean_starts_neither(void)
{
    APP_BYTES image;

    start_counter("[CmpApp]\nBootproject.Start=clean\n");
    build_counter(&image, 2);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    fail();
    for (int i = 0; i < 2; i++) {
        CHECK_EQUAL(restart_after(SYS_START_POWER), ERR_OK);
        CHECK_EQUAL(app_state(), AS_STOP);
    }
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
}

/* ---- power cuts ---- */

static RTS_RESULT put_result;

static void put_other(void *unused)
{
    RTS_UNUSED(unused);
    put_result = put_settings("[CmpIecTask]\nWatchdog=700\n");
}

static void a_power_cut_while_a_file_is_put_leaves_the_old_or_the_new_settings(void)
{
    RTS_UI32 before = 0;
    RTS_UI32 cuts = 0;

    start_with("[CmpIecTask]\nWatchdog=500\n");
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    for (RTS_UI32 mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        bool cut = true;
        for (RTS_UI32 operation = 1; cut; operation++) {
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            SimFlashCut(operation, mode);
            cut = SimCall(put_other, NULL) == SIM_POWER_CUT;
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK(SETTING(Watchdog) == 500 || SETTING(Watchdog) == 700);
            before += SETTING(Watchdog) == 500;
            cuts += cut;
        }
        CHECK_EQUAL(put_result, ERR_OK);
        CHECK_EQUAL(SETTING(Watchdog), 700);
    }
    CHECK(cuts > 6 && before > 0);
}

int main(void)
{
    RUN(a_file_sets_values_and_all_others_are_the_standard);
    RUN(a_line_that_is_not_valid_costs_a_warning_and_nothing_else);
    RUN(a_file_of_bad_lines_leaves_room_in_the_log);
    RUN(a_file_that_is_too_large_is_left_out_as_a_whole);
    RUN(a_fault_is_said_with_its_line_and_what_to_write);
    RUN(the_log_leaves_out_what_the_filter_says_but_never_exceptions);
    RUN(retain_variables_are_saved_as_often_as_the_period_says);
    RUN(a_task_without_watchdog_is_ended_after_the_time_of_the_setting);
    RUN(always_starts_also_after_an_exception);
    RUN(never_waits_for_a_user_at_each_start);
    RUN(clean_starts_after_a_loss_of_power_and_not_after_a_crash);
    RUN(an_exception_of_a_proven_program_counts_for_clean_only);
    RUN(a_reset_and_a_start_after_an_exception_are_enough_for_clean);
    RUN(after_the_failure_of_a_new_program_clean_starts_neither);
    RUN(a_power_cut_while_a_file_is_put_leaves_the_old_or_the_new_settings);
    return test_result();
}
