/*
 * test_app_powercut.c - power is cut at every flash operation of a download and of what follows it.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A device runs application 1 (proven). Then application 2 is downloaded, started, proves itself, saves its retain
 * variables, is stopped and started again. Each run of this story is cut at another operation. After it the device must
 * run 1 or 2, never nothing and never a mix, and must accept application 3.
 *
 * With BY_CANOPEN application 2 comes from the manager of a CANopen network, by block transfer to 1F50h.
 */
#include "app_image.h"
#include "test.h"
#ifdef BY_CANOPEN
#include "canopen_download.h"
#else
#define download_by_canopen(image) download(image)
#endif

typedef struct {
    RTS_UI32 program_size;
    RTS_UI8 erased;
    RTS_UI32 sector_size;
} GEOMETRY;

static APP_BYTES images[4]; /* [step]; 0 unused */
static RTS_UI32 cuts;       /* that were tried in all */

static void prepare(const GEOMETRY *g)
{
    CHECK_EQUAL(SimFlashConfigure(32 * 1024, g->sector_size, g->program_size, g->erased), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(download(&images[1]), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(6000)), ERR_OK);
    SimStop();
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
}

static RTS_RESULT story_result;
static bool packed;                           /* application 2 comes packed */
static enum { BOOTS, TRIED, MADE_BOOT } kind; /* how application 2 comes */

static RTS_RESULT download_to_try(const APP_BYTES *image)
{
    APP_REFUSAL refusal;
    RTS_RESULT result = send_part(image, image->size);

    return result == ERR_OK ? AppDownloadTry(&refusal) : result;
}

static RTS_RESULT try_program(void)
{
    RTS_RESULT result = download_to_try(&images[2]);

    if (result == ERR_OK)
        result = AppStartApplication();
    if (result == ERR_OK)
        result = SimAdvance(ms(5000));
    if (result == ERR_OK)
        result = AppStopApplication();
    return result == ERR_OK && kind == MADE_BOOT ? AppCreateBootProject() : result;
}

static RTS_RESULT try_story(void)
{
    RTS_RESULT result = kind != BOOTS ? try_program()
                        : packed      ? download_packed(&images[2])
                                      : download_by_canopen(&images[2]);

    if (result == ERR_OK)
        result = AppStartApplication();
    if (result == ERR_OK)
        result = SimAdvance(ms(8000));
    if (result == ERR_OK)
        result = AppStopApplication();
    if (result == ERR_OK)
        result = AppStartApplication();
    return result == ERR_OK ? SimAdvance(ms(2500)) : result;
}

static void story(void *unused)
{
    RTS_UNUSED(unused);
    story_result = try_story();
}

static RTS_UI32 count_operations(void)
{
    RTS_UI32 before;

    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    before = SimFlashOps();
    CHECK(SimCall(story, NULL) == ERR_OK);
    CHECK_EQUAL(story_result, ERR_OK);
    return SimFlashOps() - before;
}

/* One of the applications runs, whole: code, initial values and retain variables are those of the same. */
static RTS_UI32 check_whole(void)
{
    RTS_UI32 step = read_u32(APP_AREA_DATA, STEP_OFFSET);
    RTS_UI32 retain = read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET);
    APP_STATUS status;

    AppGetStatus(&status);
    CHECK_EQUAL(status.state, AS_RUN);
    CHECK(step == 1 || step == 2);
    if (step != 1 && step != 2)
        return 0;
    CHECK_EQUAL(status.image_crc, image_crc(&images[step]));
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_B_OFFSET), retain);
    CHECK(retain >= 100 * step);
    CHECK_EQUAL(retain % step, 0);
    CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, COUNTER_OFFSET), 11 * step);
    CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), retain + 11 * step);
    return step;
}

static void check_can_be_flashed_again(void)
{
    CHECK_EQUAL(download(&images[3]), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 3);
}

/* Returns which application runs afterwards. */
static RTS_UI32 cut_once(RTS_UI32 operation, RTS_UI32 mode)
{
    RTS_UI32 step;
    int failures = test_failures;

    cuts++;
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    SimFlashCut(operation, mode);
    CHECK(SimCall(story, NULL) == SIM_POWER_CUT);
    CHECK_EQUAL(SimStart(), ERR_OK);
    step = check_whole();
    check_can_be_flashed_again();
    CHECK_EQUAL(SimFlashViolations(), 0);
    if (test_failures != failures)
        fprintf(stderr, "^ operation %u, mode %u: %s\n", (unsigned)operation, (unsigned)mode, SimFlashViolation());
    return step;
}

static void sweep(const GEOMETRY *g)
{
    RTS_UI32 operations;
    RTS_UI32 mode;

    prepare(g);
    operations = count_operations();
    for (mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        RTS_UI32 last = 1;
        RTS_UI32 changes = 0;
        RTS_UI32 k;
        for (k = 1; k <= operations; k++) {
            RTS_UI32 step = cut_once(k, mode);
            changes += step != last;
            last = step;
        }
        CHECK_EQUAL(changes, 1); /* one operation commits: before it the old, after it the new */
        CHECK_EQUAL(last, 2);
    }
    printf("     program size %2u, erased 0x%02X, sector %4u: %u operations\n", (unsigned)g->program_size, g->erased,
           (unsigned)g->sector_size, (unsigned)operations);
}

/* Application 1 also has its own retain variables after it. */
static void a_program_that_is_tried_is_gone_after_any_cut(void)
{
    static const GEOMETRY g = {8, 0xFF, 512};
    RTS_UI32 operations;
    RTS_UI32 mode;
    RTS_UI32 k;

    prepare(&g);
    kind = TRIED;
    operations = count_operations();
    for (mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        for (k = 1; k <= operations + 1; k++) { /* the last one comes after all of them */
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            SimFlashCut(k, mode);
            CHECK_EQUAL(SimCall(story, NULL), k <= operations ? SIM_POWER_CUT : ERR_OK);
            SimFlashPowerOff();
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET) >= 100 + 600);
            CHECK_EQUAL(check_whole(), 1);
            check_can_be_flashed_again();
        }
    }
    printf("     tried: %u operations\n", (unsigned)operations);
    kind = MADE_BOOT;
    sweep(&g);
    kind = BOOTS;
}

static void every_cut_leaves_the_old_or_the_new_application(void)
{
    static const GEOMETRY geometries[] = {
        {1, 0xFF, 512}, {1, 0x00, 512}, {8, 0xFF, 512}, {8, 0x00, 512}, {16, 0xFF, 1024}, {2, 0x00, 256},
    };
    RTS_SIZE i;

    for (i = 0; i < RTS_COUNT(geometries); i++)
        sweep(&geometries[i]);
    printf("     %u cuts\n", (unsigned)cuts);
}

/* Power fails again while the device recovers from the first cut, at each operation of the recovery. */
static void a_second_cut_during_recovery_changes_nothing(void)
{
    static const GEOMETRY g = {8, 0xFF, 512};
    RTS_UI32 operations;
    RTS_UI32 first;
    RTS_UI32 second;

    prepare(&g);
    operations = count_operations();
    for (first = 1; first <= operations; first++) {
        for (second = 1; second <= 6; second++) {
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            SimFlashCut(first, SIM_CUT_TORN);
            CHECK(SimCall(story, NULL) == SIM_POWER_CUT);
            if (SimStart() == ERR_OK) {
                SimFlashCut(second, SIM_CUT_TORN);
                (void)SimAdvance(ms(2000));
            }
            CHECK_EQUAL(SimStart(), ERR_OK);
            (void)check_whole();
            CHECK_EQUAL(SimFlashViolations(), 0);
        }
    }
}

/* A fault is no power cut: the operation fails and the device goes on. The old application must run on, or the new
 * one. */
static void fault_at_any_operation(const GEOMETRY *g)
{
    RTS_UI32 operations;
    RTS_UI32 k;

    prepare(g);
    operations = count_operations();
    for (k = 1; k <= operations; k++) {
        RTS_RESULT result;
        CHECK_EQUAL(SimFlashRestore(), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        SimFlashCut(k, SIM_FAULT);
        CHECK(SimCall(story, NULL) == ERR_OK);
        result = story_result;
        CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), (result == ERR_OK ? 2 : 1));
        CHECK_EQUAL(app_state(), AS_RUN);
        CHECK_EQUAL(SimFlashViolations(), 0);
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(app_state(), AS_RUN);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), (result == ERR_OK ? 2 : 1));
        check_can_be_flashed_again();
    }
}

static void a_flash_fault_at_any_operation_of_a_download_is_survived(void)
{
    static const GEOMETRY geometries[] = {{1, 0x00, 512}, {8, 0xFF, 512}, {16, 0xFF, 512}};
    RTS_SIZE i;

    for (i = 0; i < RTS_COUNT(geometries); i++)
        fault_at_any_operation(&geometries[i]);
}

static void the_same_holds_for_packed_downloads(void)
{
    static const GEOMETRY geometries[] = {{1, 0xFF, 512}, {16, 0x00, 1024}};

    packed = true;
    for (RTS_SIZE i = 0; i < RTS_COUNT(geometries); i++) {
        sweep(&geometries[i]);
        fault_at_any_operation(&geometries[i]);
    }
    packed = false;
}

/* The first program on a blank device: afterwards nothing or the application, and the device can be used. */
static void the_first_download_can_be_cut_anywhere(void)
{
    RTS_UI32 mode;
    RTS_UI32 k;

    for (mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        for (k = 1; k < 1000; k++) {
            CHECK_EQUAL(SimFlashConfigure(32 * 1024, 512, 8, 0xFF), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            SimFlashCut(k, mode);
            if (SimCall(story, NULL) == ERR_OK)
                break;
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK(app_state() == AS_NONE || read_u32(APP_AREA_DATA, STEP_OFFSET) == 2);
            check_can_be_flashed_again();
            CHECK_EQUAL(SimFlashViolations(), 0);
        }
        CHECK(k > 20 && k < 1000);
    }
}

/* Cuts in the deletion: the application is there, or it is gone, and does not come back. */
static void origin_reset(void *unused)
{
    RTS_UNUSED(unused);
    story_result = AppReset(RESET_OPTION_ORIGIN);
}

static void an_origin_reset_can_be_cut_anywhere(void)
{
    static const GEOMETRY g = {1, 0xFF, 512};
    RTS_UI32 mode;
    RTS_UI32 k;

    prepare(&g);
    for (mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        for (k = 1; k < 100; k++) {
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            SimFlashCut(k, mode);
            if (SimCall(origin_reset, NULL) == ERR_OK)
                break;
            CHECK_EQUAL(SimStart(), ERR_OK);
            if (app_state() != AS_NONE)
                CHECK_EQUAL(check_whole(), 1);
        }
        CHECK(k > 1 && k < 100);
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(app_state(), AS_NONE);
    }
}

/* Many stories one after the other on the same flash, cut at places that move on: the logs wrap in every state. */
static void cuts_go_on_for_ever(void)
{
    static const GEOMETRY g = {8, 0x00, 256};
    RTS_UI32 round;

    prepare(&g);
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    for (round = 0; round < 1500; round++) {
        RTS_UI32 next = round % 3 + 1;
        RTS_UI32 step;
        SimFlashCut(round * 7 % 41 + 1, round % 3);
        if (download(&images[next]) == ERR_OK && AppStartApplication() == ERR_OK)
            (void)SimAdvance(ms(4000 + round % 7 * 500));
        CHECK_EQUAL(SimStart(), ERR_OK);
        step = read_u32(APP_AREA_DATA, STEP_OFFSET);
        CHECK(step >= 1 && step <= 3);
        CHECK_EQUAL(app_state(), AS_RUN);
        CHECK_EQUAL(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET), read_u32(APP_AREA_RETAIN, RETAIN_B_OFFSET));
        if (SimFlashViolations() != 0)
            break;
    }
    CHECK_EQUAL(SimFlashViolations(), 0);
}

#ifdef BY_CANOPEN
/* Until the image was started the old application runs, also after a restart. */
static void a_manager_may_be_killed_at_each_frame(void)
{
    static const GEOMETRY g = {8, 0xFF, 512};
    int last = 0;

    prepare(&g);
    do {
        CHECK_EQUAL(SimFlashRestore(), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        download_last_frame = last++;
        RTS_RESULT result = download_by_canopen(&images[2]);
        CHECK_EQUAL(app_state(), AS_RUN);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), (result == ERR_OK ? 2 : 1));
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(check_whole(), (RTS_UI32)(result == ERR_OK ? 2 : 1));
        if (result == ERR_OK)
            break;
    } while (last < 1000);
    CHECK(last > 50 && last < 1000);
    download_last_frame = NO_FRAME;
    check_can_be_flashed_again();
}

/* Whatever byte is wrong, the image is refused, and the old application runs. */
static void an_image_with_a_wrong_byte_is_refused(void)
{
    static const GEOMETRY g = {8, 0xFF, 512};
    static APP_BYTES wrong;

    prepare(&g);
    for (RTS_UI32 at = 0; at < images[2].size; at++) {
        CHECK_EQUAL(SimFlashRestore(), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        wrong = images[2];
        wrong.bytes[at] ^= 0x10;
        CHECK_EQUAL(download_by_canopen(&wrong), ERR_FAILED);
        CHECK_EQUAL(download_reply.data[0], SDO_ABORT);
        CHECK_EQUAL(app_state(), AS_RUN);
        CHECK_EQUAL(read_u32(APP_AREA_DATA, STEP_OFFSET), 1);
    }
    check_can_be_flashed_again();
}
#endif

int main(void)
{
    RTS_UI32 step;

    NEEDS_X86_64;
    for (step = 1; step <= 3; step++)
        build_counter(&images[step], step);
#ifdef BY_CANOPEN
    RUN(a_manager_may_be_killed_at_each_frame);
    RUN(an_image_with_a_wrong_byte_is_refused);
    RUN(every_cut_leaves_the_old_or_the_new_application);
    RUN(a_flash_fault_at_any_operation_of_a_download_is_survived);
    return test_result();
#endif
    RUN(every_cut_leaves_the_old_or_the_new_application);
    RUN(a_second_cut_during_recovery_changes_nothing);
    RUN(a_flash_fault_at_any_operation_of_a_download_is_survived);
    RUN(the_same_holds_for_packed_downloads);
    RUN(the_first_download_can_be_cut_anywhere);
    RUN(an_origin_reset_can_be_cut_anywhere);
    RUN(a_program_that_is_tried_is_gone_after_any_cut);
    RUN(cuts_go_on_for_ever);
    return test_result();
}
