/*
 * test_app_events.c - what components hear of an application, and what they deny.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppReason.h"
#include "AppRecord.h"
#include "AppState.h"
#include "CmpEventMgr.h"
#include "SysFileFlash.h"
#include "app_device.h"

static const RTS_UI32 all[] = {
    EVT_PrepareStart,
    EVT_StartDone,
    EVT_PrepareStop,
    EVT_StopDone,
    EVT_PrepareReset,
    EVT_ResetDone,
    EVT_PrepareDownload,
    EVT_DownloadDone,
    EVT_CreateBootprojectDone,
    EVT_LoadBootprojectDone,
    EVT_DenyLoadBootproject,
    EVT_PrepareLoadBootproject,
    EVT_DenyStartBootproject,
    EVT_PrepareStartBootproject,
    EVT_StartBootprojectDone,
    EVT_DenyStart,
    EVT_DenyStop,
    EVT_AllBootprojectsLoaded,
};

static RTS_UI32 seen[32];
static RTS_UI32 seen_count;
static RTS_UI32 denied;
static EVTPARAM_CmpApp last;
static bool acts;

static void listen(EVENT_PARAM *event)
{
    if (seen_count < RTS_COUNT(seen))
        seen[seen_count++] = event->event;
    CHECK_EQUAL(event->parameter_id, EVTPARAMID_CmpApp);
    last = *(const EVTPARAM_CmpApp *)event->parameter;
    if (acts) { /* all of them would change what the event is about */
        APP_REFUSAL refusal;
        CHECK_EQUAL(AppStartApplication(), ERR_CALL_AGAIN);
        CHECK_EQUAL(AppStopApplication(), ERR_CALL_AGAIN);
        CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_CALL_AGAIN);
        CHECK_EQUAL(AppReload(), ERR_CALL_AGAIN);
        CHECK_EQUAL(AppDownloadBegin(100, 1), ERR_CALL_AGAIN);
        CHECK_EQUAL(AppDownloadEnd(&refusal), ERR_CALL_AGAIN);
    }
    if (event->event == denied) {
        event->answer = ERR_OPERATION_DENIED;
        event->reason = "the door is open";
    }
}

static void begin(RTS_UI32 event)
{
    RTS_SIZE i;

    for (i = 0; i < RTS_COUNT(all); i++)
        CHECK_EQUAL(EventRegisterCallback(CMPID_CmpAppEmbedded, all[i], listen, NULL), ERR_OK);
    seen_count = 0;
    denied = event;
    acts = false;
    (void)AppTakeReason();
}

/* An application runs, then components begin to listen. */
static void begin_running(RTS_UI32 event)
{
    start_with_counter(1);
    begin(event);
}

/* The end of the runtime and its next start, of which the components hear. */
static void boot(void)
{
    CHECK_EQUAL(CmpAppEmbedded_Hook(CH_EXIT_TASKS), ERR_OK);
    seen_count = 0;
    CHECK_EQUAL(CmpAppEmbedded_Hook(CH_INIT_TASKS), ERR_OK);
}

static void check_seen(const RTS_UI32 *expected, RTS_UI32 count)
{
    CHECK_EQUAL(seen_count, count);
    CHECK(memcmp(seen, expected, count * sizeof *expected) == 0);
}

static RTS_UI32 running_crc(void)
{
    APP_STATUS status;

    AppGetStatus(&status);
    return status.image_crc;
}

#define SEEN(...) check_seen((const RTS_UI32[]){__VA_ARGS__}, RTS_COUNT(((const RTS_UI32[]){__VA_ARGS__})))

static void check_denied(RTS_RESULT result)
{
    CHECK_EQUAL(result, ERR_OPERATION_DENIED);
    CHECK(strcmp(AppTakeReason(), "the door is open") == 0);
    CHECK(strcmp(AppTakeReason(), "") == 0);
}

static void events_of_a_download_come_in_this_order(void)
{
    APP_BYTES image;

    begin_running(0);
    build_counter(&image, 2);
    CHECK_EQUAL(download(&image), ERR_OK);
    SEEN(EVT_DenyStop, EVT_PrepareDownload, EVT_PrepareStop, EVT_StopDone, EVT_CreateBootprojectDone, EVT_DownloadDone);
}

static void events_of_a_start_up_come_in_this_order(void)
{
    begin_running(0);
    boot();
    CHECK_EQUAL(app_state(), AS_RUN);
    SEEN(EVT_DenyLoadBootproject, EVT_PrepareLoadBootproject, EVT_LoadBootprojectDone, EVT_AllBootprojectsLoaded,
         EVT_DenyStartBootproject, EVT_PrepareStartBootproject, EVT_PrepareStart, EVT_StartDone,
         EVT_StartBootprojectDone);
}

static void a_start_up_without_boot_project_is_told_too(void)
{
    start_blank();
    begin(0);
    boot();
    SEEN(EVT_AllBootprojectsLoaded);
    CHECK_EQUAL(last.slot, SLOT_NONE);
    CHECK_EQUAL(last.size, 0);
}

static void an_event_says_which_application_it_is_about(void)
{
    APP_BYTES image;
    APP_SPEC spec;

    start_blank();
    begin(EVT_PrepareDownload);
    spec_counter(&spec, 1);
    spec.info[0] = "Press";
    build_image(&image, &spec);
    CHECK(download(&image) != ERR_OK);
    seen_count = 0;
    denied = 0;
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK(strcmp(last.name, "Press") == 0);
    CHECK(last.slot == FILE_SLOT_A || last.slot == FILE_SLOT_B);
    CHECK_EQUAL(last.size, image.size);
    CHECK(last.crc != 0);
}

static void a_denied_stop_lets_the_application_run(void)
{
    begin_running(EVT_DenyStop);
    check_denied(AppStopApplication());
    check_denied(AppReset(RESET_OPTION_WARM));
    check_denied(AppReset(RESET_OPTION_COLD));
    check_denied(AppReload());
    CHECK_EQUAL(app_state(), AS_RUN);
    SEEN(EVT_DenyStop, EVT_DenyStop, EVT_DenyStop, EVT_DenyStop);
    CHECK(log_has("Stop denied: the door is open"));
}

static void a_denied_start_leaves_the_application_stopped(void)
{
    begin_running(EVT_DenyStart);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    check_denied(AppStartApplication());
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    check_denied(AppStartApplication());
    denied = 0;
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
}

static void a_denied_download_changes_nothing(void)
{
    static const RTS_UI32 events[] = {EVT_DenyStop, EVT_PrepareDownload};
    APP_BYTES image;
    RTS_SIZE i;

    build_counter(&image, 2);
    for (i = 0; i < RTS_COUNT(events); i++) {
        RTS_UI32 crc;
        begin_running(events[i]);
        crc = running_crc();
        CHECK_EQUAL(download(&image), ERR_OPERATION_DENIED);
        CHECK_EQUAL(app_state(), AS_RUN);
        CHECK_EQUAL(running_crc(), crc);
        SimStop();
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(app_state(), AS_RUN);
        CHECK_EQUAL(running_crc(), crc);
        CHECK_EQUAL(download(&image), ERR_OK);
    }
}

static void a_denied_boot_project_is_neither_loaded_nor_started(void)
{
    begin_running(EVT_DenyLoadBootproject);
    boot();
    CHECK_EQUAL(app_state(), AS_NONE);
    SEEN(EVT_DenyLoadBootproject, EVT_AllBootprojectsLoaded);
    denied = EVT_DenyStartBootproject;
    boot();
    CHECK_EQUAL(app_state(), AS_STOP);
    CHECK_EQUAL(seen[seen_count - 1], EVT_DenyStartBootproject);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
}

static void what_keeps_a_device_reachable_is_not_asked(void)
{
    RTS_SIZE i;

    for (i = 0; i < RTS_COUNT(all); i++) {
        begin_running(all[i]);
        AppHandleException(0, RTSEXCPT_WATCHDOG, 0);
        CHECK_EQUAL(CmpAppEmbedded_Hook(CH_COMM_CYCLE), ERR_OK);
        CHECK_EQUAL(app_state(), AS_STOP);
        CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
        begin_running(all[i]);
        CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
        CHECK_EQUAL(app_state(), AS_NONE);
        begin_running(all[i]);
        CHECK_EQUAL(CmpAppEmbedded_Hook(CH_EXIT_TASKS), ERR_OK);
        CHECK_EQUAL(app_state(), AS_NONE);
    }
}

static void a_callback_cannot_act_on_the_application(void)
{
    APP_BYTES image;

    begin_running(0);
    acts = true;
    build_counter(&image, 2);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(AppReload(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
}

/* ---- a power cut ---- */

static APP_BYTES next_image;

static void deny_download(void *unused)
{
    RTS_UNUSED(unused);
    begin(EVT_PrepareDownload);
    (void)download(&next_image);
}

static void power_may_be_cut_at_any_operation_of_a_denied_download(void)
{
    RTS_UI32 crc;
    RTS_UI32 mode;
    RTS_UI32 cuts = 0;

    start_with_counter(1);
    crc = running_crc();
    SimStop();
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    build_counter(&next_image, 2);
    for (mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        RTS_UI32 operation = 0;
        RTS_RESULT end;
        do {
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            SimFlashCut(++operation, mode);
            end = SimCall(deny_download, NULL);
            SimFlashCut(0, mode);
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK_EQUAL(app_state(), AS_RUN);
            CHECK_EQUAL(running_crc(), crc);
            CHECK_EQUAL(download(&next_image), ERR_OK);
            cuts += end == SIM_POWER_CUT;
        } while (end == SIM_POWER_CUT);
        CHECK_EQUAL(end, ERR_OK);
        CHECK(operation > 10);
    }
    printf("     %u cuts\n", (unsigned)cuts);
}

int main(void)
{
    NEEDS_X86_64;
    RUN(events_of_a_download_come_in_this_order);
    RUN(events_of_a_start_up_come_in_this_order);
    RUN(a_start_up_without_boot_project_is_told_too);
    RUN(an_event_says_which_application_it_is_about);
    RUN(a_denied_stop_lets_the_application_run);
    RUN(a_denied_start_leaves_the_application_stopped);
    RUN(a_denied_download_changes_nothing);
    RUN(a_denied_boot_project_is_neither_loaded_nor_started);
    RUN(what_keeps_a_device_reachable_is_not_asked);
    RUN(a_callback_cannot_act_on_the_application);
    RUN(power_may_be_cut_at_any_operation_of_a_denied_download);
    return test_result();
}
