/*
 * test_io_blank.c - the blank driver, which a vendor copies, does what one has to do.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IoDrvBlank.h"
#include "io_driver.h"

static APP_REFUSAL refusal;

static void begin_blank(void)
{
    begin_io();
    CHECK_EQUAL(IoDrvBlank_Hook(CH_INIT), ERR_OK);
    CHECK_EQUAL(IoDrvBlank_Hook(CH_INIT2), ERR_OK);
    io_init(&io);
    io_add_connector(&io, "Terminals", "IoDrvBlank")->state = 16;
    add_copying_task("Main", 10000, 0);
    add_bytes(0, IO_MAP_INPUTS, 0, 8);
    add_bytes(0, IO_MAP_OUTPUTS, 0, 8);
}

static void check_refused(const char *text)
{
    emit_io(&spec, &io);
    build_image(&image, &spec);
    CHECK(download_part(&image, image.size, &refusal) != ERR_OK);
    CHECK(strstr(refusal.text, text) != NULL);
}

static void it_runs_and_says_that_it_is_well(void)
{
    IO_DEVICE_STATE state;

    begin_blank();
    start_io();
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    memcpy(&state, AppGetAreaAddress(APP_AREA_DATA, 16, sizeof state), sizeof state);
    CHECK(state.ok == 1 && state.errors == 0 && state.age_ms <= 10);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK_EQUAL(IoDrvBlank_Hook(CH_EXIT2), ERR_OK);
}

static void it_refuses_what_it_has_not(void)
{
    begin_blank();
    add_bytes(0, IO_MAP_INPUTS, 8, 1);
    check_refused("Terminals (IoDrvBlank): it has no bit 64 of parameter 1.");
}

static void it_refuses_a_second_device(void)
{
    begin_blank();
    io_add_connector(&io, "More", "IoDrvBlank");
    check_refused("More (IoDrvBlank): this board has one of them.");
}

int main(void)
{
    NEEDS_X86_64;
    RUN(it_runs_and_says_that_it_is_well);
    RUN(it_refuses_what_it_has_not);
    RUN(it_refuses_a_second_device);
    return test_result();
}
