/*
 * test_task_load.c - how much of the processor each task takes, its limit, and the status of cyclic tasks.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Time is virtual: each cycle takes what the test says.
 */
#include "CmpTaskLoad.h"
#include "SettingValues.h"
#include "app_device.h"

static APP_SPEC spec;
static APP_BYTES image;
static RTS_UI32 cycle_us[3]; /* what the cycles of the tasks take */

static void burn(RTS_UI32 us)
{
    ((void (*)(RTS_UI32))CMFindExternal("simburn")->function)(us);
}

static void burn_first(RTS_UI32 unused)
{
    RTS_UNUSED(unused);
    burn(cycle_us[0]);
}

static void burn_second(RTS_UI32 unused)
{
    RTS_UNUSED(unused);
    burn(cycle_us[1]);
}

static void burn_third(RTS_UI32 unused)
{
    RTS_UNUSED(unused);
    burn(cycle_us[2]);
}

static const CMP_EXT_FUNCTION burners[] = {{"burn0", 1, 0x00010000, (RTS_PFN)burn_first},
                                           {"burn1", 1, 0x00010000, (RTS_PFN)burn_second},
                                           {"burn2", 1, 0x00010000, (RTS_PFN)burn_third}};

static void add(const char *name, RTS_UI32 kind, RTS_UI32 interval_us)
{
    static const char *const names[] = {"burn0", "burn1", "burn2"};
    RTS_UI32 number = spec.task_count;

    add_import(&spec, names[number], 1, 0x00010000);
    (void)add_task(&spec, name, kind, interval_us, here(&spec));
    emit_call(&spec, number, 0);
    emit_ret(&spec);
}

/* Fast every 10 ms, Slow every 100 ms, and perhaps Free, which is freewheeling. */
static void begin(RTS_UI32 fast_us, RTS_UI32 slow_us, RTS_UI32 free_us)
{
    cycle_us[0] = fast_us;
    cycle_us[1] = slow_us;
    cycle_us[2] = free_us;
    start_blank();
    CHECK_EQUAL(CMRegisterExternal(burners, RTS_COUNT(burners)), ERR_OK);
    setting_values[SETTING_MaxLoad] = 0;
    spec_init(&spec);
    add("Fast", KIND_CYCLIC, 10000);
    add("Slow", KIND_CYCLIC, 100000);
    if (free_us != 0)
        add("Free", KIND_FREEWHEELING, 0);
    build_image(&image, &spec);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
}

/* Two windows, in which main looks every 10 ms. */
static void run(void)
{
    RTS_I64 end_ns = SimNow() + ms(2 * TASK_LOAD_WINDOW_MS);

    while (SimNow() < end_ns) {
        CHECK_EQUAL(SimAdvance(ms(10)), ERR_OK);
        CHECK_EQUAL(CMCallHook(CH_COMM_CYCLE), ERR_OK);
    }
}

static bool about(RTS_UI32 percent, RTS_UI32 expected)
{
    return percent + 2 >= expected && percent <= expected + 2;
}

static RTS_UI32 exception_code(void)
{
    APP_STATUS status;

    AppGetStatus(&status);
    return status.exception.code;
}

static void each_task_has_its_load_and_all_have_the_sum(void)
{
    begin(1000, 20000, 0);
    run();
    CHECK(about(TaskLoadGet(0), 10));
    CHECK(about(TaskLoadGet(1), 20));
    CHECK(about(TaskLoadGet(2), 30));
    CHECK_EQUAL(TaskLoadGet(3), 0);
}

static void the_load_is_that_of_the_last_window_only(void)
{
    begin(1000, 20000, 0);
    run();
    cycle_us[0] = 0;
    cycle_us[1] = 0;
    run();
    CHECK(about(TaskLoadGet(2), 0));
}

static void an_online_change_begins_the_load_again(void)
{
    IEC_TASK_INFO info;
    APP_REFUSAL refusal;

    begin(1000, 20000, 0);
    run();
    CHECK(about(TaskLoadGet(0), 10) && about(TaskLoadGet(1), 20));
    while (spec.code_size % 4 != 0)
        emit_ret(&spec);
    spec.change = (CDL_CHANGE){image_crc(&image), CDL_CHANGE_NO_INIT, here(&spec), 0};
    build_image(&image, &spec);
    cycle_us[1] = 0;
    CHECK_EQUAL(send_part(&image, image.size), ERR_OK);
    CHECK_EQUAL(AppDownloadChange(&refusal), ERR_OK);
    CHECK_EQUAL(CMCallHook(CH_COMM_CYCLE), ERR_OK);
    CHECK_EQUAL(TaskLoadGet(0), 0);
    CHECK_EQUAL(TaskLoadGet(1), 0);
    CHECK(IecTaskGetInfo(0, &info) == ERR_OK && info.cycles > 2 * TASK_LOAD_WINDOW_MS / 10 / 2); /* statistics go on */
    run();
    CHECK(about(TaskLoadGet(0), 10) && TaskLoadGet(1) == 0); /* nothing of the cycles before */
}

static void a_stopped_program_takes_nothing(void)
{
    begin(1000, 20000, 0);
    run();
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(TaskLoadGet(2), 0);
    CHECK_EQUAL(TaskLoadGetStatus(0), 0);
}

static void a_program_above_the_limit_ends_and_names_the_task_that_takes_the_most(void)
{
    begin(1000, 50000, 0);
    setting_values[SETTING_MaxLoad] = 50;
    run();
    CHECK_EQUAL(exception_code(), RTSEXCPT_NOEXCEPTION);
    run();
    run();
    CHECK_EQUAL(exception_code(), RTSEXCPT_PROCESSORLOAD_WATCHDOG);
    CHECK(log_has("Slow: processor load above MaxProcessorLoad"));
}

static void a_program_at_the_limit_runs_on_and_a_short_peak_is_forgiven(void)
{
    begin(1000, 20000, 0);
    setting_values[SETTING_MaxLoad] = 40;
    run();
    cycle_us[1] = 60000;
    run();
    cycle_us[1] = 20000;
    run();
    cycle_us[1] = 60000;
    run();
    cycle_us[1] = 20000;
    run();
    CHECK_EQUAL(exception_code(), RTSEXCPT_NOEXCEPTION);
}

static void a_program_that_ended_by_its_load_runs_again_after_a_reset(void)
{
    begin(1000, 50000, 0);
    setting_values[SETTING_MaxLoad] = 50;
    run();
    run();
    run();
    CHECK_EQUAL(exception_code(), RTSEXCPT_PROCESSORLOAD_WATCHDOG);
    cycle_us[1] = 1000;
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    run();
    run();
    CHECK_EQUAL(exception_code(), RTSEXCPT_NOEXCEPTION);
}

static void a_freewheeling_task_pauses_for_the_limit_and_is_never_blamed(void)
{
    begin(100, 100, 20000);
    run();
    CHECK(about(TaskLoadGet(2), 82));
    setting_values[SETTING_MaxLoad] = 40;
    run();
    run();
    run();
    CHECK(about(TaskLoadGet(2), 40));
    CHECK_EQUAL(exception_code(), RTSEXCPT_NOEXCEPTION);
}

static void two_bits_say_whether_a_cyclic_task_ends_in_time(void)
{
    begin(1000, 2000, 1000);
    run();
    CHECK_EQUAL(TaskLoadGetStatus(0), TASK_IN_TIME | TASK_IN_TIME << 2 | TASK_IDLE << 4);
    begin(11000, 20000, 0);
    run();
    CHECK_EQUAL(TaskLoadGetStatus(0) & 3, TASK_TOO_LATE);
    begin(1000, 60000, 0); /* Fast waits for the other one here */
    run();
    CHECK_EQUAL(TaskLoadGetStatus(0), TASK_LATE | TASK_IN_TIME << 2);
    CHECK_EQUAL(TaskLoadGetStatus(1), 0);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(each_task_has_its_load_and_all_have_the_sum);
    RUN(the_load_is_that_of_the_last_window_only);
    RUN(an_online_change_begins_the_load_again);
    RUN(a_stopped_program_takes_nothing);
    RUN(a_program_above_the_limit_ends_and_names_the_task_that_takes_the_most);
    RUN(a_program_at_the_limit_runs_on_and_a_short_peak_is_forgiven);
    RUN(a_program_that_ended_by_its_load_runs_again_after_a_reset);
    RUN(a_freewheeling_task_pauses_for_the_limit_and_is_never_blamed);
    RUN(two_bits_say_whether_a_cyclic_task_ends_in_time);
    return test_result();
}
