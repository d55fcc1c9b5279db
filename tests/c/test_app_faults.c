/*
 * test_app_faults.c - the flash fails once, at every single call; sectors and the commit log are lost.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A fault that passes must cost nothing: the newest application runs at the next start, whatever was tried meanwhile. A
 * lost sector costs at most what lay in it.
 */
#include "../../firmware/src/app/AppCommit.h"
#include "SysFlashLog.h"
#include "app_device.h"

enum { PROVEN_MS = 5000 };

static APP_BYTES images[4]; /* [step]; 0 unused */
static RTS_UI32 tried;

static RTS_UI32 running_step(void)
{
    return app_state() == AS_RUN ? read_u32(APP_AREA_DATA, STEP_OFFSET) : 0;
}

static void install(RTS_UI32 step)
{
    CHECK_EQUAL(download(&images[step]), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(PROVEN_MS)), ERR_OK);
}

/* `newest` proven applications 1, 2 .. one after the other; the last is in slot A for 1 and 3, in B for 2. */
static void prepare(RTS_UI32 newest, int mapped)
{
    RTS_UI32 step;

    SimFlashSetMapped(mapped);
    CHECK_EQUAL(SimFlashConfigure(32 * 1024, 512, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    for (step = 1; step <= newest; step++)
        install(step);
    SimStop();
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
}

/* ---- a fault at a start ---- */

typedef enum { NOTHING, REFUSED_DOWNLOAD, CUT_DOWNLOAD, HANDS, MEANWHILES } MEANWHILE;

static void try_meanwhile(void *arg)
{
    APP_BYTES bad = images[3];
    APP_REFUSAL refusal;

    switch (*(const MEANWHILE *)arg) {
    case REFUSED_DOWNLOAD:
        bad.bytes[300] ^= 1;
        CHECK(download_part(&bad, bad.size, &refusal) != ERR_OK);
        break;
    case CUT_DOWNLOAD:
        if (AppDownloadBegin(bad.size, image_crc(&bad)) == ERR_OK)
            (void)AppDownloadWrite(0, bad.bytes, 200);
        break;
    case HANDS:
        (void)AppStopApplication();
        (void)AppStartApplication();
        (void)AppReset(RESET_OPTION_WARM);
        break;
    default:
        break;
    }
}

/* Calls of `kind` that a start makes when nothing fails. */
static RTS_UI32 calls_of_start(RTS_UI32 kind)
{
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    return SimFlashCalls(kind);
}

/* `fail`: SimFlashFail or SimFlashFailFrom. A single read that fails is repeated. */
static void fail_at_a_start(void (*fail)(RTS_UI32, RTS_UI32), RTS_UI32 newest, RTS_UI32 kind, RTS_UI32 call,
                            MEANWHILE meanwhile)
{
    int failures = test_failures;

    tried++;
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK); /* forgets plans */
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    fail(kind, call);
    SimFlashAtStart();
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(running_step() == newest || kind != SIM_READ || fail != SimFlashFail);
    CHECK(running_step() == newest || app_state() == AS_STOP || app_state() == AS_NONE);
    CHECK(running_step() == newest || log_has("Boot project refused: ") || log_has("cannot be read"));
    CHECK_EQUAL(SimCall(try_meanwhile, &meanwhile), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), newest);
    CHECK_EQUAL(SimFlashViolations(), 0);
    if (test_failures != failures)
        fprintf(stderr, "^ newest %u, kind %u, call %u, then %u\n", (unsigned)newest, (unsigned)kind, (unsigned)call,
                (unsigned)meanwhile);
}

static void a_call_that_fails_at_a_start_costs_nothing(void)
{
    RTS_UI32 newest;
    RTS_UI32 kind;
    RTS_UI32 call;
    MEANWHILE meanwhile;

    for (newest = 1; newest <= 3; newest++) {
        prepare(newest, 0);
        for (kind = 0; kind < SIM_CALLS; kind++) {
            RTS_UI32 calls = calls_of_start(kind);
            CHECK(calls > 0 || kind == SIM_ERASE);
            for (call = 1; call <= calls; call++) {
                for (meanwhile = NOTHING; meanwhile < MEANWHILES; meanwhile++)
                    fail_at_a_start(SimFlashFail, newest, kind, call, meanwhile);
                if (kind == SIM_READ)
                    fail_at_a_start(SimFlashFailFrom, newest, kind, call, NOTHING);
            }
        }
    }
    printf("     %u starts with a fault\n", (unsigned)tried);
}

/* ---- a place that cannot be read, for good ---- */

static bool is_of_image(RTS_UI32 offset, RTS_UI32 size, RTS_UI32 slot, const APP_BYTES *image)
{
    RTS_UI32 start = SysFileGetArea(slot)->offset;

    return offset < start + image->size && start < offset + size;
}

/* With a fault in the newest application the older one runs at each start; each other place costs no application. When
 * the fault is gone, all is as before. */
static void fail_at_a_place(RTS_UI32 newest, RTS_UI32 offset, RTS_UI32 size)
{
    RTS_UI32 slot = newest == 2 ? FILE_SLOT_B : FILE_SLOT_A;
    RTS_UI32 wanted = is_of_image(offset, size, slot, &images[newest]) ? newest - 1 : newest;
    int failures = test_failures;
    RTS_UI32 i;

    tried++;
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    SimFlashUnreadable(offset, size);
    for (i = 0; i < 2; i++) {
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(running_step(), wanted);
        CHECK(wanted == newest || log_has("Boot project refused: The flash cannot be read."));
        CHECK_EQUAL(SimAdvance(ms(1500)), ERR_OK);
    }
    SimFlashUnreadable(0, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), newest);
    CHECK_EQUAL(SimFlashViolations(), 0);
    if (test_failures != failures)
        fprintf(stderr, "^ newest %u, %u bytes at 0x%X\n", (unsigned)newest, (unsigned)size, (unsigned)offset);
}

static void a_place_that_cannot_be_read_leaves_the_best_whole_application(void)
{
    RTS_UI32 newest;
    RTS_UI32 offset;

    tried = 0;
    for (newest = 1; newest <= 3; newest++) {
        prepare(newest, 0);
        for (offset = 0; offset < SimFlashSize(); offset += 512)
            fail_at_a_place(newest, offset, 512);
        for (offset = 0; offset < SimFlashSize(); offset += FILE_ALIGN) {
            if (SimFlashData()[offset] != 0xFF)
                fail_at_a_place(newest, offset, FILE_ALIGN);
        }
    }
    printf("     %u places\n", (unsigned)tried);
}

/* Both halves of the commit log, too: the seals say which program is the newest. */
static void a_whole_log_that_cannot_be_read_costs_no_application(void)
{
    RTS_UI32 newest;

    for (newest = 1; newest <= 3; newest++) {
        prepare(newest, 0);
        CHECK_EQUAL(SimStart(), ERR_OK);
        const FILE_AREA *commit = SysFileGetArea(FILE_COMMIT);
        const FILE_AREA *values = SysFileGetArea(FILE_RETAIN);
        fail_at_a_place(newest, commit->offset, commit->size);
        CHECK_EQUAL(SimFlashRestore(), ERR_OK);
        fail_at_a_place(newest, values->offset, values->size);
    }
}

static void with_a_commit_log_that_cannot_be_read_a_program_can_be_flashed(void)
{
    const FILE_AREA *area;

    prepare(2, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    area = SysFileGetArea(FILE_COMMIT);
    SimFlashUnreadable(area->offset, area->size);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(log_has("Commit record cannot be read"));
    install(3);
    CHECK(!log_has("Commit record cannot be written"));
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 3);
    SimFlashUnreadable(0, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 3);
}

static void make_newest_unreadable(RTS_UI32 newest)
{
    RTS_UI32 slot = newest == 2 ? FILE_SLOT_B : FILE_SLOT_A;

    SimFlashUnreadable(SysFileGetArea(slot)->offset, 16);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), newest - 1);
}

static void the_stand_in_goes_on_with_its_values_and_may_be_stopped_and_reset(void)
{
    RTS_UI32 value;

    prepare(2, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    make_newest_unreadable(2);
    CHECK_EQUAL(SimAdvance(ms(5000)), ERR_OK);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    value = read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET);
    CHECK(value > 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    CHECK(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET) >= value);
    CHECK_EQUAL(AppReset(RESET_OPTION_COLD), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    SimFlashUnreadable(0, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 2);
    CHECK(AppCommitIsProven(FILE_SLOT_A) && AppCommitIsProven(FILE_SLOT_B));
}

static void a_program_that_is_flashed_takes_the_place_of_the_one_that_cannot_be_read(void)
{
    prepare(2, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    make_newest_unreadable(2);
    CHECK_EQUAL(AppDownloadBegin(images[3].size, image_crc(&images[3])), ERR_OK);
    SimFlashUnreadable(0, 0); /* to be programmed again often repairs it */
    install(3);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 3);
    SimFlashData()[SysFileGetArea(FILE_SLOT_B)->offset + 400] ^= 1;
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
}

/* Firmware of another build, for one start. */
static void firmware_that_refuses_it_for_some_starts_costs_nothing(void)
{
    APP_SPEC spec;
    APP_BYTES image;
    RTS_UI32 i;

    prepare(1, 1);
    CHECK_EQUAL(SimStart(), ERR_OK);
    SimSetTarget(TARGET_TYPE_PROGRAMMABLE, 7, 0x01000000);
    for (i = 0; i < 3; i++) {
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(app_state(), AS_NONE);
        CHECK(log_has("Boot project refused: The image is for device id"));
        spec_counter(&spec, 2);
        build_image(&image, &spec);
        CHECK(download(&image) != ERR_OK); /* it is not for this device either */
    }
    SimSetTarget(TARGET_TYPE_PROGRAMMABLE, OWN_TARGET_ID, 0x01000000);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
}

/* Application 2, which came for the device `id` with `version`, meets the firmware of application 1 for a start. */
static void start_with_the_firmware_before(RTS_UI32 id, RTS_UI32 version, const char *reason)
{
    APP_BYTES newest = images[2];
    CDL_HEADER header = image_header(&newest);

    prepare(1, 1);
    SimSetTarget(TARGET_TYPE_PROGRAMMABLE, id, version);
    CHECK_EQUAL(SimStart(), ERR_OK);
    header.device_id = id;
    header.device_version = version;
    image_set_header(&newest, header);
    CHECK_EQUAL(download(&newest), ERR_OK);
    SimSetTarget(TARGET_TYPE_PROGRAMMABLE, OWN_TARGET_ID, 0x01000000);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_NONE);
    CHECK(log_has(reason));
    SimSetTarget(TARGET_TYPE_PROGRAMMABLE, id, version);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 2);
    SimSetTarget(TARGET_TYPE_PROGRAMMABLE, OWN_TARGET_ID, 0x01000000);
}

static void a_program_for_another_device_waits_for_its_firmware(void)
{
    start_with_the_firmware_before(7, 0x01000000, "Boot project refused: The image is for device id");
    start_with_the_firmware_before(OWN_TARGET_ID, 0x02000000,
                                   "Boot project refused: The image is for device version 2.x");
}

/* ---- a fault in a download, and in what follows ---- */

static RTS_RESULT story_result;

static void story(void *unused)
{
    RTS_UNUSED(unused);
    story_result = download(&images[2]);
    if (story_result == ERR_OK)
        (void)AppStartApplication();
    (void)SimAdvance(ms(1500));
    (void)SimAdvance(ms(3000));
    (void)AppStopApplication();
}

static RTS_UI32 calls_of_story(RTS_UI32 kind)
{
    RTS_UI32 before;

    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    before = SimFlashCalls(kind);
    CHECK(SimCall(story, NULL) == ERR_OK);
    CHECK_EQUAL(story_result, ERR_OK);
    return SimFlashCalls(kind) - before;
}

/* What a download promised is there after a power cut, also when a sync failed and what it did not save is lost. */
static void fail_one_call_of_the_story(RTS_UI32 kind, RTS_UI32 call)
{
    int failures = test_failures;
    RTS_UI32 step;

    tried++;
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    SimFlashFail(kind, call);
    CHECK(SimCall(story, NULL) == ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    step = running_step();
    CHECK(step == 2 || (step == 1 && story_result != ERR_OK));
    install(3);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 3);
    CHECK_EQUAL(SimFlashViolations(), 0);
    if (test_failures != failures)
        fprintf(stderr, "^ kind %u, call %u\n", (unsigned)kind, (unsigned)call);
}

static void a_call_that_fails_in_a_download_leaves_the_old_or_the_new_application(void)
{
    RTS_UI32 kind;
    RTS_UI32 call;

    tried = 0;
    prepare(1, 0);
    for (kind = 0; kind < SIM_CALLS; kind++) {
        RTS_UI32 calls = calls_of_story(kind);
        CHECK(calls > 0);
        for (call = 1; call <= calls; call++)
            fail_one_call_of_the_story(kind, call);
    }
    printf("     %u downloads with a fault\n", (unsigned)tried);
}

static void a_download_whose_commit_is_not_synced_is_refused(void)
{
    APP_BYTES image = images[2];
    APP_REFUSAL refusal;
    RTS_UI32 call;
    RTS_UI32 refused = 0;

    prepare(1, 1);
    for (call = 1; call <= 2; call++) { /* the image, its seal */
        CHECK_EQUAL(SimFlashRestore(), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        SimFlashFail(SIM_SYNC, call);
        if (download_part(&image, image.size, &refusal) != ERR_OK)
            refused++;
        CHECK(strcmp(refusal.text, "The flash cannot be written.") == 0);
        CHECK_EQUAL(running_step(), 1);
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(running_step(), 1);
    }
    CHECK_EQUAL(refused, 2);
}

/* ---- a fault in an origin reset ---- */

/* Returns whether the call was made at all. */
static bool fail_one_call_of_an_origin_reset(RTS_UI32 kind, RTS_UI32 call)
{
    RTS_UI32 before;
    bool made;

    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    before = SimFlashCalls(kind);
    SimFlashFail(kind, call);
    if (AppReset(RESET_OPTION_ORIGIN) != ERR_OK) {
        CHECK_EQUAL(AppCommitGet()->active, FILE_SLOT_A);
        CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
        CHECK_EQUAL(AppStartApplication(), ERR_OK);
        CHECK_EQUAL(running_step(), 1);
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(running_step(), 1);
        return true;
    }
    made = SimFlashCalls(kind) - before >= call;
    CHECK_EQUAL(app_state(), AS_NONE);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_NONE);
    return made;
}

static void an_origin_reset_that_fails_leaves_the_application_as_it_was(void)
{
    RTS_UI32 kind;

    prepare(1, 1);
    for (kind = SIM_PROGRAM; kind <= SIM_SYNC; kind++) {
        RTS_UI32 call = 1;
        while (fail_one_call_of_an_origin_reset(kind, call))
            call++;
        CHECK(call > 1);
    }
}

/* ---- a fault in a rollback ---- */

static void fail_one_call_of_a_rollback(RTS_UI32 kind, RTS_UI32 call)
{
    SYS_START start = {SYS_START_CRASH, 0, 0, RTSEXCPT_ACCESS_VIOLATION, 0, "crash"};
    int failures = test_failures;

    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    SimFlashFail(kind, call);
    SimFlashAtStart();
    SimSetStart(&start);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(running_step() != 2);
    SimSetStart(&start);
    CHECK_EQUAL(SimStart(), ERR_OK); /* when the death could not be read or written, it dies again */
    CHECK_EQUAL(running_step(), 1);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    if (test_failures != failures)
        fprintf(stderr, "^ kind %u, call %u\n", (unsigned)kind, (unsigned)call);
}

static void prepare_death(void)
{
    prepare(1, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(download(&images[2]), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
}

static void a_call_that_fails_in_a_rollback_delays_it_at_most(void)
{
    RTS_UI32 kind;
    RTS_UI32 call;

    prepare_death();
    for (kind = 0; kind < SIM_CALLS; kind++) {
        for (call = 1; call <= 60; call++)
            fail_one_call_of_a_rollback(kind, call);
    }
}

static void a_cut_in_a_rollback_leaves_it_to_the_next_start(void)
{
    const RTS_UI32 record = SysFileAlign(FLASH_LOG_HEAD_SIZE + COMMIT_RECORD_SIZE) / FILE_ALIGN; /* operations */
    SYS_START start = {SYS_START_CRASH, 0, 0, RTSEXCPT_ACCESS_VIOLATION, 0, "crash"};
    RTS_UI32 mode;
    RTS_UI32 operation;

    prepare_death();
    for (mode = SIM_CUT_BEFORE; mode <= SIM_CUT_TORN; mode++) {
        for (operation = 1; operation < 100; operation++) {
            RTS_RESULT result;
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            SimFlashCut(operation, mode);
            SimFlashAtStart();
            SimSetStart(&start);
            result = SimStart();
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK(running_step() == 1 ||
                  (running_step() == 2 && operation <= record + 1)); /* its death was not noted */
            CHECK_EQUAL(SimFlashViolations(), 0);
            if (result == ERR_OK)
                break;
        }
        CHECK(operation > 10 && operation < 100);
    }
}

/* ---- lost sectors ---- */

static void spoil(RTS_UI32 offset, RTS_UI32 size, int how)
{
    RTS_UI32 state = offset + 1;
    RTS_UI32 i;

    for (i = 0; i < size; i++) {
        state = state * 1664525 + 1013904223;
        SimFlashData()[offset + i] = (RTS_UI8)(how == 0 ? 0xFF : how == 1 ? 0 : state >> 24);
    }
}

/* Any of the halves of the commit log, or both. */
static void a_lost_commit_log_costs_no_application(void)
{
    RTS_UI32 newest;
    RTS_UI32 which;
    RTS_UI32 round;
    int how;

    for (newest = 1; newest <= 3; newest++) {
        prepare(newest, 1);
        for (round = 0; round < 12; round++) { /* the log changes halves meanwhile */
            for (which = 1; which <= 3; which++) {
                for (how = 0; how < 3; how++) {
                    const FILE_AREA *area;
                    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
                    CHECK_EQUAL(SimStart(), ERR_OK);
                    area = SysFileGetArea(FILE_COMMIT);
                    if ((which & 1) != 0)
                        spoil(area->offset, area->size / 2, how);
                    if ((which & 2) != 0)
                        spoil(area->offset + area->size / 2, area->size / 2, how);
                    CHECK_EQUAL(SimStart(), ERR_OK);
                    CHECK_EQUAL(running_step(), newest);
                    CHECK(which != 3 || log_has("No commit record"));
                    install(newest % 3 + 1);
                    CHECK_EQUAL(SimStart(), ERR_OK);
                    CHECK_EQUAL(running_step(), newest % 3 + 1);
                }
            }
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            SimStop();
            CHECK_EQUAL(SimFlashSave(), ERR_OK);
        }
    }
}

static void with_a_lost_commit_log_the_older_application_is_there_to_go_back_to(void)
{
    const FILE_AREA *area;

    prepare(2, 1);
    CHECK_EQUAL(SimStart(), ERR_OK);
    area = SysFileGetArea(FILE_COMMIT);
    spoil(area->offset, area->size, 2);
    SimFlashData()[SysFileGetArea(FILE_SLOT_B)->offset + 400] ^= 1;
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    CHECK(log_has("No commit record"));
}

static void a_lost_commit_log_does_not_bring_back_what_was_given_up(void)
{
    const FILE_AREA *area;
    SYS_START start = {SYS_START_CRASH, 0, 0, RTSEXCPT_ACCESS_VIOLATION, 0, "crash"};

    prepare_death();
    SimSetStart(&start);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    area = SysFileGetArea(FILE_COMMIT);
    spoil(area->offset, area->size, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 1);
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    spoil(area->offset, area->size, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_NONE);
    CHECK(log_has("No boot project"));
}

/* The newest application is whole, or what lay in the sector is what is lost. */
static void a_lost_sector_anywhere_costs_at_most_what_lay_there(void)
{
    RTS_UI32 offset;
    int how;

    prepare(2, 1);
    for (offset = 0; offset < SimFlashSize(); offset += 512) {
        for (how = 0; how < 3; how++) {
            RTS_UI32 step;
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            spoil(offset, 512, how);
            CHECK_EQUAL(SimStart(), ERR_OK);
            step = running_step();
            CHECK(step == 2 || (step == 1 && offset >= SysFileGetArea(FILE_SLOT_B)->offset &&
                                offset < SysFileGetArea(FILE_SLOT_B)->offset + images[2].size));
        }
    }
}

/* ---- seals that remain of an image ---- */

/* Application 2, in more sectors than the others. */
static void build_large(APP_BYTES *image)
{
    APP_SPEC spec;

    spec_counter(&spec, 2);
    while (here(&spec) < 2048)
        emit_ret(&spec);
    build_image(image, &spec);
}

/* Power fails when a download of it has begun. */
static void begin_and_cut(const APP_BYTES *image)
{
    CHECK_EQUAL(AppDownloadBegin(image->size, image_crc(image)), ERR_OK);
    CHECK_EQUAL(AppDownloadWrite(0, image->bytes, 200), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
}

/* It was in slot B before a smaller one, after which its seal is still there. */
static void an_interrupted_download_of_an_earlier_program_discredits_no_record(void)
{
    APP_BYTES large;

    build_large(&large);
    prepare(1, 1);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(download(&large), ERR_OK);
    install(1);
    install(2);
    install(3);
    begin_and_cut(&large);
    CHECK_EQUAL(running_step(), 3);
    CHECK(AppCommitIsProven(FILE_SLOT_A));
    CHECK(!log_has("No commit record"));
}

/* Its first download failed when it was sealed, and it was deleted. */
static void an_interrupted_second_attempt_costs_the_running_application_no_values(void)
{
    APP_BYTES large;
    RTS_UI32 value;

    build_large(&large);
    prepare(1, 1);
    CHECK_EQUAL(SimStart(), ERR_OK);
    SimFlashFail(SIM_SYNC, 2);
    CHECK_EQUAL(download(&large), ERR_DEVICE);
    CHECK_EQUAL(SimAdvance(ms(10000)), ERR_OK);
    value = read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET);
    begin_and_cut(&large);
    CHECK_EQUAL(running_step(), 1);
    CHECK(read_u32(APP_AREA_RETAIN, RETAIN_A_OFFSET) + 110 >= value);
    CHECK(!log_has("damaged"));
}

/* ---- firmware that is not this one ---- */

/* Makes the CRC of the record in a log right again: what another firmware wrote is a record like any other. */
static void records_of_another_firmware_are_said_and_survived(void)
{
    static const RTS_UI8 other[30] = {1, 2, 3};
    FLASH_LOG log;

    prepare(2, 1);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(FlashLogOpen(&log, FILE_COMMIT), ERR_OK);
    CHECK_EQUAL(FlashLogAppend(&log, 0x12345678, other, sizeof other), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(running_step(), 2);
    CHECK(log_has("laid out by another firmware"));
    CHECK_EQUAL(SimStart(), ERR_OK); /* and from then on there are records again */
    CHECK_EQUAL(running_step(), 2);
    CHECK(!log_has("laid out by another firmware"));
}

static void hostile_records_are_survived(void)
{
    RTS_UI32 state = 1;
    RTS_UI32 i;

    prepare(2, 1);
    for (i = 0; i < 600; i++) {
        COMMIT_RECORD record;
        RTS_UI8 *bytes = (RTS_UI8 *)&record;
        RTS_UI32 k;
        FLASH_LOG log;
        CHECK_EQUAL(SimFlashRestore(), ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        memset(&record, 0, sizeof record);
        record.commit = *AppCommitGet();
        for (k = 0; k < i % 40 + 1; k++) {
            state = state * 1664525 + 1013904223;
            bytes[state % (i % 3 == 0 ? 8 : sizeof record)] = (RTS_UI8)(state >> 24);
        }
        CHECK_EQUAL(FlashLogOpen(&log, FILE_COMMIT), ERR_OK);
        CHECK_EQUAL(FlashLogAppend(&log, 0x324D4D43 + SysFileGetArea(FILE_SLOT_B)->offset, &record, sizeof record),
                    ERR_OK);
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(SimAdvance(ms(100)), ERR_OK);
        if (AppReset(RESET_OPTION_ORIGIN) == ERR_OK)
            install(3);
        CHECK_EQUAL(running_step(), 3);
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK_EQUAL(running_step(), 3);
    }
}

int main(void)
{
    RTS_UI32 step;

    NEEDS_X86_64;
    for (step = 1; step <= 3; step++)
        build_counter(&images[step], step);
    RUN(a_call_that_fails_at_a_start_costs_nothing);
    RUN(a_place_that_cannot_be_read_leaves_the_best_whole_application);
    RUN(a_whole_log_that_cannot_be_read_costs_no_application);
    RUN(with_a_commit_log_that_cannot_be_read_a_program_can_be_flashed);
    RUN(the_stand_in_goes_on_with_its_values_and_may_be_stopped_and_reset);
    RUN(a_program_that_is_flashed_takes_the_place_of_the_one_that_cannot_be_read);
    RUN(firmware_that_refuses_it_for_some_starts_costs_nothing);
    RUN(a_program_for_another_device_waits_for_its_firmware);
    RUN(a_call_that_fails_in_a_download_leaves_the_old_or_the_new_application);
    RUN(a_download_whose_commit_is_not_synced_is_refused);
    RUN(an_origin_reset_that_fails_leaves_the_application_as_it_was);
    RUN(a_call_that_fails_in_a_rollback_delays_it_at_most);
    RUN(a_cut_in_a_rollback_leaves_it_to_the_next_start);
    RUN(a_lost_commit_log_costs_no_application);
    RUN(with_a_lost_commit_log_the_older_application_is_there_to_go_back_to);
    RUN(a_lost_commit_log_does_not_bring_back_what_was_given_up);
    RUN(a_lost_sector_anywhere_costs_at_most_what_lay_there);
    RUN(an_interrupted_download_of_an_earlier_program_discredits_no_record);
    RUN(an_interrupted_second_attempt_costs_the_running_application_no_values);
    RUN(records_of_another_firmware_are_said_and_survived);
    RUN(hostile_records_are_survived);
    return test_result();
}
