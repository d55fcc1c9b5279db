/*
 * test_comm_password.c - CmpUserMgr: who gets in with a password, who does not, and how often one may try.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpSrv.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "password_client.h"
#include "test.h"

static const char right[33] = "the key of the right password...";
static const char wrong[33] = "the key of some other password..";

static CLIENT client;
static CLIENT other;
static REPLY reply;

/* A device with a password, and two channels without login. */
static void setup(void)
{
    fakes_start();
    fakes.password = password_verifier(right);
    client_init(&client, 0x0102);
    client_init(&other, 0x0103);
    CHECK(client_open(&client));
    CHECK(client_open(&other));
}

static bool may_look(CLIENT *who)
{
    return client_request(who, SG_APPLICATION, SRV_APP_READ_STATUS, NULL, 0, &reply) && reply_error(&reply) == ERR_OK;
}

/* Lets time pass. Replies are acknowledged, so that they are not repeated meanwhile; keepalives are of no interest. */
static void wait(RTS_UI32 ms)
{
    RTS_UI8 package[BLK_MAX_SIZE];

    client_send_ack(&client, client.received, 0);
    client_send_ack(&other, other.received, 0);
    fakes_cycle(0);
    fakes_cycle(ms);
    while (client_take(&client, NULL, package) != 0 || client_take(&other, NULL, package) != 0) {
    }
}

/* ---- right and wrong ---- */

static void the_right_one_gets_in(void)
{
    setup();
    CHECK(!may_look(&client));
    CHECK_EQUAL(password_login(&client, right), ERR_OK);
    CHECK_EQUAL(client.session >> 31, 1);
    CHECK(may_look(&client) && client_login_app(&client));
}

static void a_wrong_one_does_not(void)
{
    setup();
    CHECK_EQUAL(password_login(&client, wrong), ERR_NO_ACCESS_RIGHTS);
    CHECK(!SrvIsLoggedIn(ChannelGetClient(0)) && !may_look(&client));
}

static void what_the_device_keeps_does_not_get_in(void)
{
    char stored[sizeof(right)];

    setup();
    memcpy(stored, fakes.password.key, sizeof(fakes.password.key));
    CHECK_EQUAL(password_login(&client, stored), ERR_NO_ACCESS_RIGHTS);
}

static void a_login_without_the_password_is_refused(void)
{
    static const RTS_UI8 content[] = {0x22, 0x02, 0x01, 0x00};
    BTAG_READER login;
    RTS_UI32 value = 0;

    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_LOGIN, content, sizeof(content), &reply));
    CHECK_EQUAL(BTagFindContainer(&reply.tags, TAG_DEV_LOGIN_REPLY, &login), ERR_OK);
    CHECK(BTagFindUnsigned(&login, TAG_DEV_LOGIN_RESULT, &value) == ERR_OK && value == ERR_NO_ACCESS_RIGHTS);
    CHECK(BTagFindUnsigned(&login, TAG_DEV_SESSION_ID, &value) == ERR_L7_TAG_MISSING);
    CHECK(!may_look(&client));
}

static void every_bit_of_a_proof_counts(void)
{
    setup();
    for (RTS_UI32 bit = 0; bit < 8 * sizeof(DEV_PROOF); bit += 7) {
        DEV_CHALLENGE challenge;
        CHECK_EQUAL(password_ask(&client, &challenge), ERR_PENDING);
        DEV_PROOF proof = password_proof(right, &challenge);
        ((RTS_UI8 *)&proof)[bit / 8] ^= (RTS_UI8)(1 << bit % 8);
        wait(PASSWORD_PAUSE_MS);
        CHECK_EQUAL(password_answer(&client, &proof), ERR_NO_ACCESS_RIGHTS);
    }
    CHECK(!may_look(&client));
}

static void a_session_says_which_login_is_needed(void)
{
    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_SESSION_CREATE, NULL, 0, &reply));
    CHECK_EQUAL(reply_number(&reply, TAG_DEV_AUTH_TYPE), DEV_CRYPT_PROOF);
}

static void a_login_keeps_the_session_that_was_created(void)
{
    RTS_UI32 created;

    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_SESSION_CREATE, NULL, 0, &reply));
    created = client.session = reply_number(&reply, TAG_DEV_SESSION_ID);
    CHECK_EQUAL(password_login(&client, right), ERR_OK);
    CHECK_EQUAL(client.session, created);
}

/* ---- what was heard on the line ---- */

static void a_proof_is_good_once(void)
{
    DEV_CHALLENGE challenge;

    setup();
    CHECK_EQUAL(password_ask(&client, &challenge), ERR_PENDING);
    DEV_PROOF proof = password_proof(right, &challenge);
    CHECK_EQUAL(password_answer(&client, &proof), ERR_OK);
    CHECK_EQUAL(password_answer(&client, &proof), ERR_NO_ACCESS_RIGHTS);
    CHECK_EQUAL(password_ask(&other, &challenge), ERR_PENDING);
    CHECK_EQUAL(password_answer(&other, &proof), ERR_NO_ACCESS_RIGHTS);
}

/* The session lasts, and so does what it knows of the challenge. */
static void a_proof_is_good_once_in_one_session(void)
{
    DEV_CHALLENGE challenge;

    setup();
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_SESSION_CREATE, NULL, 0, &reply));
    client.session = reply_number(&reply, TAG_DEV_SESSION_ID);
    CHECK_EQUAL(password_ask(&client, &challenge), ERR_PENDING);
    DEV_PROOF proof = password_proof(right, &challenge);
    CHECK_EQUAL(password_answer(&client, &proof), ERR_OK);
    CHECK_EQUAL(password_answer(&client, &proof), ERR_NO_ACCESS_RIGHTS);
}

static void a_proof_for_one_channel_is_none_for_another(void)
{
    DEV_CHALLENGE challenge;

    setup();
    CHECK_EQUAL(password_ask(&client, &challenge), ERR_PENDING);
    DEV_PROOF proof = password_proof(right, &challenge);
    CHECK_EQUAL(password_answer(&other, &proof), ERR_NO_ACCESS_RIGHTS);
    CHECK_EQUAL(password_answer(&client, &proof), ERR_OK);
}

static void a_new_challenge_replaces_the_one_before(void)
{
    DEV_CHALLENGE first;
    DEV_CHALLENGE second;

    setup();
    CHECK_EQUAL(password_ask(&client, &first), ERR_PENDING);
    CHECK_EQUAL(password_ask(&client, &second), ERR_PENDING);
    CHECK(memcmp(first.nonce, second.nonce, sizeof(first.nonce)) != 0);
    DEV_PROOF proof = password_proof(right, &first);
    CHECK_EQUAL(password_answer(&client, &proof), ERR_NO_ACCESS_RIGHTS);
}

static void a_challenge_ends_with_its_channel(void)
{
    DEV_CHALLENGE challenge;

    setup();
    CHECK_EQUAL(password_ask(&client, &challenge), ERR_PENDING);
    DEV_PROOF proof = password_proof(right, &challenge);
    client_send_open(&client, 99, NETSERVER_MESSAGE_SIZE);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    CHECK_EQUAL(password_answer(&client, &proof), ERR_NO_ACCESS_RIGHTS);
}

/* ---- guessing ---- */

static void after_a_wrong_one_its_channel_has_to_wait(void)
{
    setup();
    CHECK_EQUAL(password_login(&client, wrong), ERR_NO_ACCESS_RIGHTS);
    CHECK_EQUAL(password_login(&client, right), ERR_NOT_READY_YET);
    wait(PASSWORD_PAUSE_MS - 1);
    CHECK_EQUAL(password_login(&client, right), ERR_NOT_READY_YET);
    wait(1);
    CHECK_EQUAL(password_login(&client, right), ERR_OK);
}

static void opening_the_channel_again_does_not_end_the_pause(void)
{
    setup();
    CHECK_EQUAL(password_login(&client, wrong), ERR_NO_ACCESS_RIGHTS);
    client_send_open(&client, 99, NETSERVER_MESSAGE_SIZE);
    CHECK_EQUAL(client_take_open(&client), CHANNEL_OPEN_OK);
    CHECK_EQUAL(password_login(&client, right), ERR_NOT_READY_YET);
}

static void a_stranger_does_not_delay_others(void)
{
    setup();
    CHECK_EQUAL(password_login(&client, wrong), ERR_NO_ACCESS_RIGHTS);
    CHECK_EQUAL(password_login(&other, right), ERR_OK);
}

/* A stranger who never pauses. */
static void guesses_are_few_though_a_stranger_takes_channel_after_channel(void)
{
    enum { SECONDS = 60 };
    RTS_UI32 guesses = 0;

    setup();
    for (RTS_UI32 i = 0; i < 10 * SECONDS; i++) {
        CLIENT stranger;
        client_init(&stranger, (RTS_UI16)(0x0200 + i));
        if (client_open(&stranger))
            guesses += password_login(&stranger, wrong) == ERR_NO_ACCESS_RIGHTS;
        fakes_cycle(100);
    }
    CHECK(guesses > 0 && guesses <= COMM_MAX_CLIENTS * (1000 * SECONDS / PASSWORD_PAUSE_MS + 1));
}

static void wrong_ones_in_a_row_are_one_line_of_the_log(void)
{
    setup();
    RTS_UI32 before = fakes.log_added;
    for (int i = 0; i < 20; i++) {
        CHECK_EQUAL(password_login(&client, wrong), ERR_NO_ACCESS_RIGHTS);
        wait(PASSWORD_PAUSE_MS);
    }
    CHECK_EQUAL(fakes.log_added - before, 1);
    CHECK_EQUAL(password_login(&client, right), ERR_OK);
    CHECK_EQUAL(password_login(&client, wrong), ERR_NO_ACCESS_RIGHTS);
    CHECK_EQUAL(fakes.log_added - before, 2);
}

/* ---- setting it ---- */

static void it_is_set_by_a_client_that_has_logged_in(void)
{
    setup();
    fakes.password = password_verifier(NULL);
    CHECK_EQUAL(password_set(&client, right), ERR_INVALID_SESSION_ID);
    CHECK(client_login(&client));
    CHECK_EQUAL(password_set(&client, right), ERR_OK);
    CHECK(may_look(&client));
    CHECK_EQUAL(password_login(&other, right), ERR_OK);
}

static void others_lose_the_login_they_had_without_it(void)
{
    setup();
    fakes.password = password_verifier(NULL);
    CHECK(client_login(&client) && client_login(&other) && client_login_app(&other));
    CHECK_EQUAL(password_set(&client, right), ERR_OK);
    CHECK(!may_look(&other));
    CHECK_EQUAL(reply_error(&reply), ERR_INVALID_SESSION_ID);
}

static void a_changed_one_ends_logins_with_the_previous_one(void)
{
    setup();
    CHECK_EQUAL(password_login(&client, right), ERR_OK);
    CHECK_EQUAL(password_login(&other, right), ERR_OK);
    CHECK_EQUAL(password_set(&client, wrong), ERR_OK);
    CHECK(may_look(&client) && !may_look(&other));
    CHECK_EQUAL(password_login(&other, right), ERR_NO_ACCESS_RIGHTS);
    wait(PASSWORD_PAUSE_MS);
    CHECK_EQUAL(password_login(&other, wrong), ERR_OK);
}

static void removed_it_is_as_if_there_had_never_been_one(void)
{
    setup();
    CHECK_EQUAL(password_login(&client, right), ERR_OK);
    CHECK_EQUAL(password_set(&client, NULL), ERR_OK);
    CHECK(may_look(&other) && client_login(&other) && client_login_app(&other));
}

static void one_that_cannot_be_kept_is_not_set(void)
{
    setup();
    CHECK_EQUAL(password_login(&client, right), ERR_OK);
    fakes.password_result = ERR_DEVICE;
    CHECK_EQUAL(password_set(&client, wrong), ERR_DEVICE);
    CHECK_EQUAL(password_login(&other, right), ERR_OK);
    CHECK(may_look(&client));
}

static void elements_of_another_size_are_refused(void)
{
    RTS_UI8 content[2 + 100] = {TAG_USER_VERIFIER};
    RTS_UI8 login[6 + 2 + 100] = {TAG_DEV_CRYPT_TYPE, 4, 0, 1, 0, 0, TAG_DEV_PROOF};

    setup();
    CHECK_EQUAL(password_login(&client, right), ERR_OK);
    for (RTS_UI8 size = 1; size <= 100; size++) {
        content[1] = login[7] = size;
        CHECK(client_request(&client, SG_USERMGR, SRV_USER_SET_CREDENTIALS, content, 2u + size, &reply));
        CHECK((reply_error(&reply) == ERR_SIZE_MISMATCH) == (size != sizeof(USER_VERIFIER)));
        fakes.password = password_verifier(right); /* one size has removed it */
        CHECK(client_request(&client, SG_DEVICE, SRV_DEV_LOGIN, login, 8u + size, &reply));
        CHECK((reply_error(&reply) == ERR_SIZE_MISMATCH) == (size != sizeof(DEV_PROOF)));
    }
}

int main(void)
{
    RUN(the_right_one_gets_in);
    RUN(a_wrong_one_does_not);
    RUN(what_the_device_keeps_does_not_get_in);
    RUN(a_login_without_the_password_is_refused);
    RUN(every_bit_of_a_proof_counts);
    RUN(a_session_says_which_login_is_needed);
    RUN(a_login_keeps_the_session_that_was_created);
    RUN(a_proof_is_good_once);
    RUN(a_proof_is_good_once_in_one_session);
    RUN(a_proof_for_one_channel_is_none_for_another);
    RUN(a_new_challenge_replaces_the_one_before);
    RUN(a_challenge_ends_with_its_channel);
    RUN(after_a_wrong_one_its_channel_has_to_wait);
    RUN(opening_the_channel_again_does_not_end_the_pause);
    RUN(a_stranger_does_not_delay_others);
    RUN(guesses_are_few_though_a_stranger_takes_channel_after_channel);
    RUN(wrong_ones_in_a_row_are_one_line_of_the_log);
    RUN(it_is_set_by_a_client_that_has_logged_in);
    RUN(others_lose_the_login_they_had_without_it);
    RUN(a_changed_one_ends_logins_with_the_previous_one);
    RUN(removed_it_is_as_if_there_had_never_been_one);
    RUN(one_that_cannot_be_kept_is_not_set);
    RUN(elements_of_another_size_are_refused);
    return test_result();
}
