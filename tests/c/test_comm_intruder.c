/*
 * test_comm_intruder.c - on a network: peers that open channels for nothing, guess ids, or pretend to be another one.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "channel_fixture.h"
#include "tag_sweep.h"

RTS_STATIC_ASSERT(COMM_ENDPOINTS, built_for_a_network);
RTS_STATIC_ASSERT(COMM_MAX_CLIENTS == 4, built_for_four_clients);

enum { ADDRESS = 0x0102, INTRUDER = 0x0666, STORM = 3 };

static REPLY answer;

/* ---- a line with several peers, one for each address; SimLink is a line with one ---- */

static BLK_DRV bus;

static void bus_send(void *instance, const RTS_UI8 *packet, RTS_UI32 size)
{
    RTS_UI16 sender = (RTS_UI16)(packet[8] << 8 | packet[9]);

    RTS_UNUSED(instance);
    RouterHandleDataFrom(&bus, sender, packet, size);
}

static RTS_UI32 bus_receive(void *instance, RTS_UI8 *packet, RTS_UI32 capacity)
{
    RTS_UNUSED(instance);
    return SimLinkReceive(packet, capacity);
}

static const CLIENT_LINK to_bus = {bus_send, bus_receive, NULL};

/* A client on the bus. */
static void join(CLIENT *who, RTS_UI16 address)
{
    client_init(who, address);
    who->link = &to_bus;
}

/* Replies to what comes over the bus are where those of SimLink are. */
static void make_bus(void)
{
    setup();
    bus = *ChannelGetClient(0)->channel.peer.driver;
}

/* ---- tests ---- */

static void a_device_whose_ids_might_be_guessed_says_so(void)
{
    fakes_start();
    RTS_UI32 logged = fakes.log_added;
    fakes_run_init_hooks();
    CHECK_EQUAL(fakes.log_added, logged);
    fakes.no_generator = true;
    fakes_run_init_hooks();
    CHECK_EQUAL(fakes.log_added, logged + 1);
}

static bool is_served(CLIENT *who)
{
    return client_request(who, SG_APPLICATION, SRV_APP_READ_APPLICATION_LIST, NULL, 0, &answer) &&
           reply_error(&answer) == ERR_OK;
}

/* Time passes, and what the device says meanwhile is ignored. */
static void pass(RTS_UI32 ms)
{
    fakes_cycle(ms);
    while (SimLinkReceive(package, sizeof(package)) != 0) {
    }
}

/* Opens a channel, whatever the device says to others because of it. */
static bool comes_in(CLIENT *who)
{
    int result = -1;

    client_send_open(who, 7, NETSERVER_MESSAGE_SIZE);
    for (RTS_UI32 i = 0; i < COMM_MAX_CLIENTS && result == -1; i++)
        result = client_take_open(who);
    return result == CHANNEL_OPEN_OK;
}

/* The client logs in. */
static void log_client_in(void)
{
    CHECK(client_open(&client) && client_login(&client) && client_login_app(&client) && is_served(&client));
    pass(CHANNEL_COMPLAINT_MS);
}

/* A client that is logged in, on the bus. */
static void start(void)
{
    fakes_start();
    join(&client, ADDRESS);
    log_client_in();
}

/* All ids as quickly as the line has them, from `address`, in packages of this type. */
static void guess_all_ids(RTS_UI16 address, RTS_UI8 type)
{
    CLIENT guess = {.address = address, .link = client.link};

    for (RTS_UI32 id = 1; id <= CHANNEL_ID_MAX; id++) {
        guess.channel = (RTS_UI16)id;
        if (type == CHANNEL_PKG_CLOSE_REQ)
            client_send_close(&guess);
        else
            client_send_block(&guess, client.sent + 1, NEXT, message, 8, 0, 8);
        pass(id % 1000 == 0);
    }
}

static void guessing_all_ids_from_elsewhere_closes_nothing(void)
{
    start();
    guess_all_ids(INTRUDER, CHANNEL_PKG_CLOSE_REQ);
    guess_all_ids(INTRUDER, CHANNEL_PKG_DATA);
    CHECK(is_served(&client));
}

static void guessing_all_ids_in_the_name_of_the_client_closes_nothing(void)
{
    start();
    guess_all_ids(ADDRESS, CHANNEL_PKG_CLOSE_REQ);
    CHECK(is_served(&client));
}

static void a_close_request_works_again_when_the_guessing_has_ended(void)
{
    start();
    guess_all_ids(ADDRESS, CHANNEL_PKG_CLOSE_REQ);
    client_send_close(&client);
    CHECK(is_served(&client));
    pass(CHANNEL_COMPLAINT_MS);
    client_send_close(&client);
    CHECK(!is_served(&client));
}

static void a_close_request_in_vain_does_not_make_the_next_one_vain(void)
{
    start();
    guess_all_ids(ADDRESS, CHANNEL_PKG_CLOSE_REQ);
    RTS_UI32 foreign = counters()->foreign;
    pass(CHANNEL_COMPLAINT_MS - 1);
    client_send_close(&client);
    CHECK_EQUAL(counters()->foreign, foreign);
    CHECK(is_served(&client));
    pass(1);
    client_send_close(&client);
    CHECK(!is_served(&client));
}

static void right_after_the_start_nothing_has_been_guessed(void)
{
    fakes_init();
    fakes.now_ms = 1;
    fakes_run_init_hooks();
    join(&client, ADDRESS);
    CHECK(client_open(&client) && client_login(&client));
    client_send_close(&client);
    CHECK(!is_served(&client));
}

static void blocks_in_the_name_of_the_client_close_nothing(void)
{
    start();
    guess_all_ids(ADDRESS, CHANNEL_PKG_DATA);
    CHECK_EQUAL(counters()->failed, 0);
    CHECK(ChannelIsOpen(ChannelGetClient(0)));
}

/* An echo request as a whole, with this CRC. */
static void send_request(CLIENT *who, RTS_UI32 spoiled)
{
    RTS_UI32 size = echo_message(4);
    RTS_UI8 block[BLK_MAX_SIZE] = {CHANNEL_PKG_DATA, FIRST};

    BytesPut16(block + 2, who->channel);
    BytesPut32(block + 4, who->sent + 1);
    BytesPut32(block + 12, size);
    BytesPut32(block + 16, CRC32Update(0, message, size) ^ spoiled);
    memcpy(block + 20, message, size);
    client_send_package(who, block, 20 + size);
}

/* A message without a layer-7 header: no reply can be made. */
static bool is_closed_by_what_cannot_be_answered(void)
{
    memset(message, 0, 8);
    client_send_message(&client, message, 8);
    return is_close(ERR_CHS_REQNOTHANDLED);
}

static void a_client_that_has_gone_does_not_delay_the_end_of_another_channel(void)
{
    start();
    guess_all_ids(INTRUDER, CHANNEL_PKG_DATA);
    SimLinkReset();
    CHECK(is_closed_by_what_cannot_be_answered());
}

static void what_was_left_of_a_channel_does_not_delay_the_end_of_the_next_one_of_its_client(void)
{
    start();
    CLIENT before = client;
    client_send_close(&client);
    client_send_block(&before, before.sent + 1, NEXT, message, 8, 0, 8);
    SimLinkReset();
    CHECK(client_open(&client));
    CHECK(is_closed_by_what_cannot_be_answered());
}

static void on_a_line_with_one_peer_nobody_pretends_so_packages_end_channels(void)
{
    fakes_start();
    client_init(&client, ADDRESS);
    log_client_in();
    CLIENT wrong = client;
    wrong.channel ^= 1;
    client_send_close(&wrong);
    CHECK(is_closed_by_what_cannot_be_answered());
    log_client_in();
    client_send_guess_and_close(&client);
    CHECK(!is_served(&client));
}

static void on_a_line_with_one_peer_a_wrong_crc_ends_the_channel(void)
{
    fakes_start();
    client_init(&client, ADDRESS);
    log_client_in();
    send_request(&client, 1);
    CHECK(is_close(ERR_CHS_CHECKSUM));
}

static void wrong_crcs_in_the_name_of_the_client_close_nothing(void)
{
    start();
    RTS_UI32 foreign = counters()->foreign;
    for (RTS_UI32 i = 0; i < 100; i++) {
        send_request(&client, 1u << i % 32);
        pass(i);
    }
    CHECK_EQUAL(counters()->foreign, foreign + 100);
    CHECK_EQUAL(counters()->failed, 0);
    CHECK(is_served(&client));
}

static void a_channel_without_login_ends(void)
{
    CLIENT idle;

    start();
    join(&idle, INTRUDER);
    CHECK(client_open(&idle));
    for (RTS_UI32 ms = 0; ms < CHANNEL_LOGIN_MS; ms += CHANNEL_KEEPALIVE_MS) {
        CHECK(works(&idle)); /* what it says without a login does not help */
        pass(CHANNEL_KEEPALIVE_MS);
    }
    CHECK(!works(&idle));
    CHECK(is_served(&client));
}

static void a_channel_with_login_stays(void)
{
    start();
    for (RTS_UI32 ms = 0; ms < 3 * CHANNEL_LOGIN_MS; ms += CHANNEL_KEEPALIVE_MS) {
        pass(CHANNEL_KEEPALIVE_MS);
        CHECK(is_served(&client));
    }
}

static void after_a_logout_there_is_time_for_another_login(void)
{
    start();
    pass(CHANNEL_LOGIN_MS - 1);
    CHECK(is_served(&client));
    pass(1);
    SrvEndSession(ChannelGetClient(0));
    pass(CHANNEL_LOGIN_MS - 1);
    CHECK(client_login(&client) && client_login_app(&client) && is_served(&client));
}

static void a_storm_of_open_requests_does_not_end_a_login(void)
{
    CLIENT crowd[2 * COMM_MAX_CLIENTS];
    CLIENT newcomer;

    fakes_start();
    for (RTS_UI16 i = 0; i < RTS_COUNT(crowd); i++)
        join(&crowd[i], (RTS_UI16)(INTRUDER + i));
    join(&newcomer, ADDRESS);
    for (RTS_UI32 i = 0; i < COMM_MAX_CLIENTS; i++)
        client_send_open(&crowd[i], 1, NETSERVER_MESSAGE_SIZE);
    pass(0);
    CHECK(comes_in(&newcomer) && works(&newcomer));
    for (RTS_UI32 i = 0; i < RTS_COUNT(crowd); i++)
        client_send_open(&crowd[i], 2, NETSERVER_MESSAGE_SIZE);
    pass(0);
    CHECK(client_login(&newcomer) && client_login_app(&newcomer) && is_served(&newcomer));
}

/* All channels are of peers that have not logged in. */
static void take_all_channels(CLIENT *crowd)
{
    fakes_start();
    for (RTS_UI16 i = 0; i < COMM_MAX_CLIENTS; i++) {
        join(&crowd[i], (RTS_UI16)(INTRUDER + i));
        CHECK(client_open(&crowd[i]) && works(&crowd[i]));
    }
}

static void those_who_hold_channels_without_login_give_way_after_a_while(void)
{
    CLIENT crowd[COMM_MAX_CLIENTS];
    CLIENT newcomer;

    take_all_channels(crowd);
    join(&newcomer, ADDRESS);
    CHECK(!comes_in(&newcomer));
    pass(CHANNEL_SETTLE_MS);
    CHECK(comes_in(&newcomer) && client_login(&newcomer));
}

static void those_who_open_again_and_again_give_way_after_a_while(void)
{
    CLIENT crowd[COMM_MAX_CLIENTS];
    CLIENT newcomer;

    take_all_channels(crowd);
    join(&newcomer, ADDRESS);
    for (RTS_UI32 ms = 0; ms < CHANNEL_SETTLE_MS; ms += 100) {
        CHECK(!comes_in(&newcomer));
        for (RTS_UI32 i = 0; i < RTS_COUNT(crowd); i++)
            CHECK(client_open(&crowd[i]) && works(&crowd[i]));
        pass(100);
    }
    CHECK(comes_in(&newcomer) && client_login(&newcomer) && client_login_app(&newcomer) && is_served(&newcomer));
}

/* With time that passes as it does, cycle by cycle. */
static void those_who_logged_in_and_went_without_a_word_give_way_after_a_while(void)
{
    CLIENT gone[COMM_MAX_CLIENTS];
    CLIENT newcomer;

    fakes_start();
    for (RTS_UI16 i = 0; i < RTS_COUNT(gone); i++) {
        join(&gone[i], (RTS_UI16)(INTRUDER + i));
        CHECK(client_open(&gone[i]) && client_login(&gone[i]));
    }
    join(&newcomer, ADDRESS);
    for (RTS_UI32 ms = 0; ms < CHANNEL_IDLE_MS; ms += 500) {
        CHECK(!comes_in(&newcomer));
        pass(500);
    }
    CHECK(comes_in(&newcomer) && client_login(&newcomer));
}

/* All channels that `client` leaves. */
static void fill(CLIENT others[COMM_MAX_CLIENTS - 1])
{
    for (RTS_UI32 i = 0; i < COMM_MAX_CLIENTS - 1; i++) {
        join(&others[i], (RTS_UI16)(INTRUDER + i));
        CHECK(client_open(&others[i]) && client_login(&others[i]));
    }
}

static void those_who_cannot_be_reached_give_way_at_once_unless_they_are_heard_again(void)
{
    CLIENT others[COMM_MAX_CLIENTS - 1];
    CLIENT newcomer;

    start();
    fill(others);
    join(&newcomer, INTRUDER - 1);
    CHECK(!comes_in(&newcomer));
    RouterUnreachable(&bus, ADDRESS);
    for (RTS_UI32 i = 0; i < RTS_COUNT(others); i++)
        RouterUnreachable(&bus, others[i].address);
    CHECK(is_served(&client));
    for (RTS_UI32 i = 1; i < RTS_COUNT(others); i++)
        CHECK(is_served(&others[i]));
    CHECK(comes_in(&newcomer) && client_login(&newcomer));
    CHECK(!is_served(&others[0]));
    CHECK(is_served(&client) && is_served(&newcomer));
    join(&newcomer, INTRUDER - 2);
    CHECK(!comes_in(&newcomer));
}

static RTS_UI32 packages_in(RTS_UI32 ms)
{
    RTS_UI32 count = 0;

    fakes_cycle(ms);
    while (SimLinkReceive(package, sizeof(package)) != 0)
        count++;
    return count;
}

static void those_who_are_silent_are_sent_something_when_another_one_finds_no_channel(void)
{
    CLIENT others[COMM_MAX_CLIENTS - 1];
    CLIENT newcomer;

    start();
    fill(others);
    join(&newcomer, INTRUDER - 1);
    pass(CHANNEL_PROBE_MS);
    for (RTS_UI32 i = 0; i < STORM; i++)
        client_send_open(&newcomer, i, NETSERVER_MESSAGE_SIZE);
    CHECK_EQUAL(packages_in(0), STORM + COMM_MAX_CLIENTS); /* the refusals, and one to each client */
    CHECK_EQUAL(packages_in(CHANNEL_PROBE_MS), 0);
}

/* Reads memory and files in other runtimes: groups 8 and its neighbours. */
static void there_are_no_services_but_those_of_the_documentation(void)
{
    start();
    for (RTS_UI16 group = 0; group < L7_REPLY; group++) {
        bool known = group == SG_DEVICE || group == SG_APPLICATION || group == SG_LOG || group == SG_PLCSHELL ||
                     group == SG_MONITORING2 || (BP_MAX > 0 && group == SG_APPLICATION_BP) ||
                     (TRACE_BUFFER > 0 && group == SG_TRACE) || (COMM_PASSWORD && group == SG_USERMGR) ||
                     (SRV_OTHER_CLIENTS && group == SG_SETTINGS);
        CHECK(client_request(&client, group, 0xFE, NULL, 0, &answer));
        CHECK_EQUAL(reply_error(&answer), known ? ERR_L7_UNKNOWNCMD : ERR_L7_UNKNOWNCMDGROUP);
    }
}

static const RTS_UI16 groups[] = {SG_DEVICE,      SG_APPLICATION,    SG_LOG,  SG_SETTINGS, SG_PLCSHELL, SG_USERMGR,
                                  SG_MONITORING2, SG_APPLICATION_BP, SG_TRACE};

static void log_in(void)
{
    if (!SrvIsLoggedIn(ChannelGetClient(0)))
        CHECK(client_login(&client) && client_login_app(&client));
}

static void every_service_survives_every_tag_of_every_size(void)
{
    start();
    for (RTS_UI32 g = 0; g < RTS_COUNT(groups); g++)
        (void)sweep_tags(&client, groups[g], log_in);
    CHECK(client_login(&client) && client_login_app(&client) && is_served(&client));
}

int main(void)
{
    make_bus();
    RUN(a_device_whose_ids_might_be_guessed_says_so);
    RUN(guessing_all_ids_from_elsewhere_closes_nothing);
    RUN(guessing_all_ids_in_the_name_of_the_client_closes_nothing);
    RUN(a_close_request_works_again_when_the_guessing_has_ended);
    RUN(a_close_request_in_vain_does_not_make_the_next_one_vain);
    RUN(right_after_the_start_nothing_has_been_guessed);
    RUN(blocks_in_the_name_of_the_client_close_nothing);
    RUN(a_client_that_has_gone_does_not_delay_the_end_of_another_channel);
    RUN(what_was_left_of_a_channel_does_not_delay_the_end_of_the_next_one_of_its_client);
    RUN(on_a_line_with_one_peer_nobody_pretends_so_packages_end_channels);
    RUN(on_a_line_with_one_peer_a_wrong_crc_ends_the_channel);
    RUN(wrong_crcs_in_the_name_of_the_client_close_nothing);
    RUN(a_channel_without_login_ends);
    RUN(a_channel_with_login_stays);
    RUN(after_a_logout_there_is_time_for_another_login);
    RUN(a_storm_of_open_requests_does_not_end_a_login);
    RUN(those_who_hold_channels_without_login_give_way_after_a_while);
    RUN(those_who_open_again_and_again_give_way_after_a_while);
    RUN(those_who_logged_in_and_went_without_a_word_give_way_after_a_while);
    RUN(those_who_cannot_be_reached_give_way_at_once_unless_they_are_heard_again);
    RUN(those_who_are_silent_are_sent_something_when_another_one_finds_no_channel);
    RUN(there_are_no_services_but_those_of_the_documentation);
    RUN(every_service_survives_every_tag_of_every_size);
    return test_result();
}
