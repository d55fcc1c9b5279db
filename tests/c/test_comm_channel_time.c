/*
 * test_comm_channel_time.c - CmpChannelServerEmbedded: keepalives, silence, restarts.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "channel_fixture.h"

static void keepalives_are_sent_when_there_is_nothing_else(void)
{
    setup();
    fakes_cycle(999);
    CHECK(is_silent());
    fakes_cycle(1);
    CHECK_EQUAL(take(CHANNEL_PKG_KEEPALIVE), sizeof(CHANNEL_HEADER));
    CHECK(BytesGet16(package + 2) == client.channel && package[1] == 0);
    fakes_cycle(999);
    CHECK(is_silent());
}

static void silent_client_loses_the_channel_after_thirty_seconds(void)
{
    setup();
    CHECK(client_login(&client));
    for (int i = 0; i < 299; i++) {
        fakes_cycle(100);
        while (client_take(&client, NULL, package) != 0)
            CHECK(package[0] != CHANNEL_PKG_CLOSE);
    }
    fakes_cycle(100);
    CHECK(is_close(ERR_CHS_TIMEOUT));
    CHECK(!SrvIsLoggedIn(ChannelGetClient(0)));
}

static void keepalives_keep_the_channel(RTS_UI8 flags)
{
    setup();
    RTS_UI8 keepalive[] = {CHANNEL_PKG_KEEPALIVE, flags, 0, 0};
    BytesPut16(keepalive + 2, client.channel);
    for (int i = 0; i < 50; i++) {
        fakes_cycle(1000);
        client_send_package(&client, keepalive, sizeof(keepalive));
        while (client_take(&client, NULL, package) != 0)
            CHECK_EQUAL(package[0], CHANNEL_PKG_KEEPALIVE);
    }
    CHECK(works(&client));
}

static void keepalives_of_the_client_keep_the_channel(void)
{
    keepalives_keep_the_channel(CHANNEL_FLAG_TO_SERVER);
}

static void so_do_those_without_a_direction(void)
{
    keepalives_keep_the_channel(0);
}

static void shutdown_closes_the_channel(void)
{
    setup();
    fakes_hook(CH_EXIT_COMM);
    CHECK(is_close(ERR_CHS_SHUTDOWN));
}

static void restart_of_the_runtime_forgets_the_channel(void)
{
    setup();
    CHECK(client_login(&client));
    fakes_start();
    CHECK(!SrvIsLoggedIn(ChannelGetClient(0)));
    CHECK(!works(&client));
    CHECK(client_open(&client));
    CHECK(works(&client));
}

/* Random loss in both directions with a client that repeats: the same message always comes through. */
static void messages_survive_random_loss(void)
{
    RTS_UI32 seed = 1;

    setup();
    for (int round = 0; round < 30; round++) {
        RTS_UI32 size = echo_message(900 + 20 * (RTS_UI32)round);
        RTS_UI32 first = client.sent + 1;
        RTS_UI32 expected = client.received + 1;
        RTS_UI32 acked = client.sent;
        RTS_UI32 blocks = (size + 399) / 400;
        RTS_UI32 fill = 0;
        RTS_UI32 length = 1;
        for (int attempt = 0; attempt < 200 && fill < length; attempt++) {
            for (RTS_UI32 i = acked + 1 - first; i < blocks; i++) {
                seed = seed * 1664525u + 1013904223u;
                if (seed >> 30 != 0)
                    client_send_block(&client, first + i, i == 0 ? FIRST : NEXT, message, size, 400 * i,
                                      i + 1 < blocks ? 400 : size - 400 * i);
            }
            fakes_cycle(250);
            RTS_UI32 got;
            while ((got = client_take(&client, NULL, package)) != 0) {
                seed = seed * 1664525u + 1013904223u;
                if (seed >> 30 == 0)
                    continue;
                if (package[0] == CHANNEL_PKG_ACK)
                    acked = BytesGet32(package + 4);
                if (package[0] != CHANNEL_PKG_DATA)
                    continue;
                acked = BytesGet32(package + 8);
                if (BytesGet32(package + 4) == expected) {
                    RTS_UI32 head = package[1] & CHANNEL_FLAG_FIRST ? 20 : 12;
                    if (head == 20)
                        length = BytesGet32(package + 12);
                    memcpy(reply + fill, package + head, got - head);
                    fill += got - head;
                    client.received = expected++;
                }
            }
            if (fill < length)
                client_send_ack(&client, client.received, fill != 0 ? CHANNEL_FLAG_MISSING : 0);
        }
        client.sent = first + blocks - 1;
        CHECK_EQUAL(fill, length);
        RTS_UI32 data = 900 + 20 * (RTS_UI32)round;
        CHECK(memcmp(reply + length - data, message + size - data, data) == 0);
        while (client_take(&client, NULL, package) != 0)
            ;
    }
}

int main(void)
{
    RUN(keepalives_are_sent_when_there_is_nothing_else);
    RUN(silent_client_loses_the_channel_after_thirty_seconds);
    RUN(keepalives_of_the_client_keep_the_channel);
    RUN(so_do_those_without_a_direction);
    RUN(shutdown_closes_the_channel);
    RUN(restart_of_the_runtime_forgets_the_channel);
    RUN(messages_survive_random_loss);
    return test_result();
}
