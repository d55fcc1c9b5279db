/*
 * test_comm_password_device.c - the password of a whole device on the simulator: what it closes, and what it survives.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "AppPassword.h"
#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpDevice.h"
#include "CmpLog.h"
#include "CmpSrv.h"
#include "SimLink.h"
#include "SysFileFlash.h"
#include "app_image.h"
#include "comm_client.h"
#include "password_client.h"
#include "test.h"

static const char first[33] = "the key of the first password...";
static const char second[33] = "the key of the second password..";

static CLIENT client;
static REPLY reply;

static bool log_has(const char *text)
{
    LOG_ENTRY entry = {0};

    while (LogGetEntry(entry.handle + 1, &entry) == ERR_OK)
        if (strstr(entry.text, text) != NULL)
            return true;
    return false;
}

static bool reconnect(void)
{
    SimLinkReset();
    client_init(&client, 0x0102);
    return client_open(&client);
}

static bool gets_in(const char *key)
{
    return reconnect() && password_login(&client, key) == ERR_OK;
}

static bool keeps(const char *key)
{
    USER_VERIFIER verifier = password_verifier(key);

    return memcmp(AppPasswordGet(), &verifier, sizeof(verifier)) == 0;
}

static bool gets_in_without(void)
{
    BTAG_READER login;
    static const RTS_UI8 content[] = {0x22, 0x02, 0x01, 0x00};

    return reconnect() && client_request(&client, SG_DEVICE, SRV_DEV_LOGIN, content, sizeof(content), &reply) &&
           BTagFindContainer(&reply.tags, TAG_DEV_LOGIN_REPLY, &login) == ERR_OK &&
           BTagFindUnsigned(&login, TAG_DEV_SESSION_ID, &client.session) == ERR_OK;
}

static void start_blank(RTS_UI32 sector_size)
{
    CHECK_EQUAL(SimFlashConfigure(64 * 1024, sector_size, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(gets_in_without());
}

static void start_with(const char *key)
{
    start_blank(1024);
    CHECK_EQUAL(password_set(&client, key), ERR_OK);
}

/* ---- what it closes ---- */

static bool is_open_to_all(RTS_UI32 group, RTS_UI32 service)
{
    return group == SG_DEVICE && (service == SRV_DEV_GET_TARGET_IDENT || service == SRV_DEV_LOGIN ||
                                  service == SRV_DEV_LOGOUT || service == SRV_DEV_SESSION_CREATE);
}

/* TAG_ERROR of the reply to a service without content; ERR_OK when there is none. */
static RTS_UI32 error_of(RTS_UI32 group, RTS_UI32 service, RTS_UI32 session)
{
    RTS_UI8 message[20] = {0x55, 0xCD, 0x10};
    BTAG_READER tags;
    RTS_UI32 error = ERR_OK;

    BytesPut16(message + 4, group);
    BytesPut16(message + 6, service);
    BytesPut32(message + 8, session);
    reply.size = SrvHandleMessage(ChannelGetClient(0), message, sizeof(message), reply.message, sizeof(reply.message));
    CHECK(reply.size >= 20);
    BTagReaderInit(&tags, reply.message + 20, reply.size - 20);
    (void)BTagFindUnsigned(&tags, TAG_ERROR, &error);
    return error;
}

/* Asks for every service there may be; returns how many are refused with `expected`. All others that there are must be
 * open to all. */
static RTS_UI32 count_refused(RTS_UI32 session, RTS_UI32 expected)
{
    RTS_UI32 refused = 0;

    for (RTS_UI32 group = 0; group < 0x80; group++) {
        for (RTS_UI32 service = 0; service < 0x100; service++) {
            RTS_UI32 error = error_of(group, service, session);
            if (error == ERR_L7_UNKNOWNCMDGROUP || error == ERR_L7_UNKNOWNCMD || is_open_to_all(group, service))
                continue;
            CHECK_EQUAL(error, expected);
            refused++;
        }
    }
    return refused;
}

/* How many services of the tables of the components need a right. */
static RTS_UI32 closed_services(void)
{
    RTS_UI32 closed = 0;

    for (const SRV_GROUP *group = srv_groups; group < srv_groups + srv_group_room; group++)
        for (RTS_SIZE i = 0; i < group->count; i++)
            closed += group->services[i].right != RIGHT_NONE;
    return closed;
}

static void every_service_but_identity_and_login_needs_it(void)
{
    start_with(first);
    CHECK(reconnect());
    CHECK_EQUAL(count_refused(L7_SESSION_EMPTY, ERR_INVALID_SESSION_ID), closed_services());
    CHECK_EQUAL(count_refused(L7_SESSION_INITIAL, ERR_INVALID_SESSION_ID), closed_services());
    CHECK_EQUAL(count_refused(0x80000001, ERR_INVALID_SESSION_ID), closed_services());
}

static void a_session_without_login_opens_nothing(void)
{
    start_with(first);
    CHECK(reconnect());
    for (RTS_UI32 group = 0; group < 0x80; group++) {
        for (RTS_UI32 service = 0; service < 0x100; service++) {
            RTS_UI32 session = SrvCreateSession(ChannelGetClient(0)); /* services may end it */
            RTS_UI32 error = error_of(group, service, session);
            if (error != ERR_L7_UNKNOWNCMDGROUP && error != ERR_L7_UNKNOWNCMD && !is_open_to_all(group, service))
                CHECK_EQUAL(error, ERR_NO_ACCESS_RIGHTS);
        }
    }
}

static void nothing_gives_away_what_the_device_keeps(void)
{
    USER_VERIFIER kept = password_verifier(first);

    start_with(first);
    RTS_UI32 session = client.session;
    for (RTS_UI32 group = 0; group < 0x80; group++) {
        for (RTS_UI32 service = 0; service < 0x100; service++) {
            if (group == SG_DEVICE && (service == SRV_DEV_SESSION_CREATE || service == SRV_DEV_LOGOUT))
                continue; /* they end the login */
            (void)error_of(group, service, session);
            for (RTS_UI32 at = 0; at + 8 <= reply.size; at++)
                for (RTS_UI32 part = 0; part < sizeof(kept.key); part += 8)
                    CHECK(memcmp(reply.message + at, kept.key + part, 8) != 0);
        }
    }
    CHECK(SrvIsLoggedIn(ChannelGetClient(0)));
}

static void the_identity_is_there_for_all(void)
{
    start_with(first);
    CHECK(reconnect());
    CHECK_EQUAL(error_of(SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, 0), ERR_OK);
    CHECK(reply.size > 40);
}

/* ---- what it survives ---- */

static void it_is_there_after_the_next_start(void)
{
    start_with(first);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(!gets_in_without());
    CHECK(gets_in(first));
    CHECK_EQUAL(password_set(&client, NULL), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(gets_in_without());
}

static void downloads_starts_and_resets_leave_it(void)
{
    start_with(first);
    for (RTS_UI32 step = 1; step <= 3; step++) {
        APP_BYTES image;
        build_counter(&image, step);
        CHECK_EQUAL(download(&image), ERR_OK);
        CHECK_EQUAL(AppStartApplication(), ERR_OK);
        CHECK_EQUAL(SimAdvance(ms(6000)), ERR_OK);
        CHECK(!gets_in_without() && gets_in(first));
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK(!gets_in_without() && gets_in(first));
    }
    CHECK_EQUAL(AppReset(RESET_OPTION_ORIGIN), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(!gets_in_without() && gets_in(first));
}

static void setting_it_leaves_the_program_as_it_is(void)
{
    start_blank(1024);
    APP_BYTES image;
    build_counter(&image, 1);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(SimAdvance(ms(6000)), ERR_OK);
    CHECK(gets_in_without());
    CHECK_EQUAL(password_set(&client, first), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK_EQUAL(app_state(), AS_RUN);
    CHECK(gets_in(first));
}

static void what_nobody_can_know_is_refused(void)
{
    static const RTS_UI32 numbers[] = {1, PASSWORD_MIN_ITERATIONS - 1, PASSWORD_MAX_ITERATIONS + 1, 0xFFFFFFFF};
    RTS_UI8 content[2 + sizeof(USER_VERIFIER)] = {TAG_USER_VERIFIER, sizeof(USER_VERIFIER)};
    USER_VERIFIER verifier = password_verifier(second);

    start_with(first);
    for (RTS_UI32 i = 0; i <= RTS_COUNT(numbers); i++) {
        if (i < RTS_COUNT(numbers))
            BytesPut32(verifier.iterations, numbers[i]);
        else
            verifier = (USER_VERIFIER){.iterations = {0, 0x27}};
        memcpy(content + 2, &verifier, sizeof(verifier));
        CHECK(client_request(&client, SG_USERMGR, SRV_USER_SET_CREDENTIALS, content, sizeof(content), &reply));
        CHECK_EQUAL(reply_number(&reply, TAG_SERVICE_RESULT), ERR_PARAMETER);
        CHECK(keeps(first));
    }
}

static RTS_UI32 set_result;

static void change(void *key)
{
    USER_VERIFIER verifier = password_verifier(key);

    set_result = AppPasswordSet(&verifier);
}

/* Power is cut, or the flash fails, at each operation of a change from one password to the other, in logs that are full
 * to different degrees. */
static void every_cut_leaves_the_old_or_the_new_one(void)
{
    static const RTS_UI32 modes[] = {SIM_CUT_BEFORE, SIM_CUT_AFTER, SIM_CUT_TORN, SIM_FAULT};
    RTS_UI32 cuts = 0;

    for (RTS_UI32 before = 0; before < 12; before++) {
        start_with(first);
        for (RTS_UI32 i = 0; i < before; i++)
            CHECK_EQUAL(password_set(&client, first), ERR_OK);
        CHECK_EQUAL(SimFlashSave(), ERR_OK);
        for (RTS_UI32 mode = 0; mode < RTS_COUNT(modes); mode++) {
            RTS_UI32 operation = 0;
            bool done = false;
            while (!done) {
                CHECK_EQUAL(SimFlashRestore(), ERR_OK);
                CHECK_EQUAL(SimStart(), ERR_OK);
                RTS_UI32 ops = SimFlashOps();
                SimFlashCut(++operation, modes[mode]);
                done = SimCall(change, (void *)second) == ERR_OK; /* a fault is no cut */
                bool refused = done && set_result != ERR_OK;
                done = done && (modes[mode] != SIM_FAULT || SimFlashOps() - ops < operation);
                CHECK(!refused || keeps(first));
                CHECK_EQUAL(SimStart(), ERR_OK);
                CHECK(!refused || keeps(first));
                CHECK(!gets_in_without());
                CHECK(keeps(first) != keeps(second));
                CHECK(gets_in(keeps(first) ? first : second));
                CHECK(!done || keeps(second));
                CHECK_EQUAL(SimFlashViolations(), 0);
                cuts++;
            }
        }
    }
    printf("     %u cuts\n", (unsigned)cuts);
}

/* ---- lost and unreadable sectors of the commit log ---- */

static const FILE_AREA *log_half(RTS_UI32 half)
{
    static FILE_AREA area;

    area = *SysFileGetArea(FILE_COMMIT);
    area.size /= 2;
    area.offset += half * area.size;
    return &area;
}

static void lose(RTS_UI32 half, int how)
{
    const FILE_AREA *area = log_half(half);

    for (RTS_UI32 i = 0; i < area->size; i++)
        SimFlashData()[area->offset + i] = (RTS_UI8)(how == 0 ? 0xFF : how == 1 ? 0 : (i * 2654435761u) >> 13);
}

/* Whether the device, with the flash as it was saved, knows `key` when either half is lost. */
static void check_every_loss(const char *key)
{
    CHECK_EQUAL(SimFlashSave(), ERR_OK);
    for (RTS_UI32 half = 0; half < 2; half++) {
        for (int how = 0; how < 3; how++) {
            CHECK_EQUAL(SimFlashRestore(), ERR_OK);
            CHECK_EQUAL(SimStart(), ERR_OK);
            lose(half, how);
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK(key == NULL ? gets_in_without() : keeps(key) && !gets_in_without() && gets_in(key));
        }
    }
    CHECK_EQUAL(SimFlashRestore(), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
}

/* In logs that are full to different degrees, also by what programs do. */
static void a_lost_sector_leaves_the_password_that_was_set_last(void)
{
    APP_BYTES image;

    build_counter(&image, 1);
    for (RTS_UI32 before = 0; before < 12; before++) {
        start_with(first);
        check_every_loss(first);
        CHECK(gets_in(first));
        CHECK_EQUAL(download(&image), ERR_OK);
        for (RTS_UI32 i = 0; i < before; i++)
            CHECK(AppStartApplication() == ERR_OK && AppStopApplication() == ERR_OK);
        check_every_loss(first);
        CHECK(gets_in(first));
        CHECK_EQUAL(password_set(&client, second), ERR_OK);
        check_every_loss(second);
        CHECK_EQUAL(AppPasswordSet(&(USER_VERIFIER){0}), ERR_OK);
        check_every_loss(NULL);
    }
}

static void make_unreadable(const FILE_AREA *area)
{
    SimFlashUnreadable(area->offset, area->size);
    CHECK_EQUAL(SimStart(), ERR_OK);
}

static void a_half_that_cannot_be_read_leaves_it(void)
{
    SimFlashSetMapped(0);
    start_with(first);
    for (RTS_UI32 half = 0; half < 2; half++) {
        make_unreadable(log_half(half));
        CHECK(keeps(first) && !gets_in_without() && gets_in(first));
    }
    SimFlashSetMapped(1);
}

static void nothing_logs_in_while_it_is_unknown_whether_there_is_one(void)
{
    APP_BYTES image;

    build_counter(&image, 1);
    SimFlashSetMapped(0);
    start_with(first);
    CHECK_EQUAL(download(&image), ERR_OK);
    make_unreadable(SysFileGetArea(FILE_COMMIT));
    CHECK(log_has("Password cannot be read: no login without a reset of it"));
    CHECK(!gets_in_without() && !gets_in(first) && !gets_in(second));
    SimFlashUnreadable(0, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(keeps(first) && gets_in(first));
    SimFlashSetMapped(1);
}

/* The sector can be programmed again, or only the other one can. */
static void a_reset_of_the_password_gives_up_what_cannot_be_read(void)
{
    APP_BYTES image;

    build_counter(&image, 1);
    for (RTS_UI32 half = 0; half < 3; half++) {
        SimFlashSetMapped(0);
        start_with(first);
        CHECK_EQUAL(download(&image), ERR_OK);
        make_unreadable(half < 2 ? log_half(half) : SysFileGetArea(FILE_COMMIT));
        SimStop();
        CHECK_EQUAL(AppPasswordReset(), half < 2 ? ERR_OK : ERR_DEVICE);
        if (half == 2) {
            CHECK_EQUAL(SimStart(), ERR_OK);
            CHECK(!gets_in_without());
            SimFlashUnreadable(0, 0);
        }
        CHECK_EQUAL(SimStart(), ERR_OK);
        CHECK(gets_in_without());
        SimFlashSetMapped(1);
    }
}

static void a_device_that_knows_programs_only_says_that_it_has_no_password(void)
{
    APP_BYTES image;

    build_counter(&image, 1);
    start_with(first);
    CHECK_EQUAL(download(&image), ERR_OK);
    lose(0, 0);
    lose(1, 0);
    CHECK_EQUAL(SimStart(), ERR_OK);
    CHECK(log_has("No commit record: newest program taken, no password known"));
}

int main(void)
{
    NEEDS_X86_64;
    RUN(every_service_but_identity_and_login_needs_it);
    RUN(a_session_without_login_opens_nothing);
    RUN(nothing_gives_away_what_the_device_keeps);
    RUN(the_identity_is_there_for_all);
    RUN(it_is_there_after_the_next_start);
    RUN(downloads_starts_and_resets_leave_it);
    RUN(setting_it_leaves_the_program_as_it_is);
    RUN(what_nobody_can_know_is_refused);
    RUN(every_cut_leaves_the_old_or_the_new_one);
    RUN(a_lost_sector_leaves_the_password_that_was_set_last);
    RUN(a_half_that_cannot_be_read_leaves_it);
    RUN(nothing_logs_in_while_it_is_unknown_whether_there_is_one);
    RUN(a_reset_of_the_password_gives_up_what_cannot_be_read);
    RUN(a_device_that_knows_programs_only_says_that_it_has_no_password);
    return test_result();
}
