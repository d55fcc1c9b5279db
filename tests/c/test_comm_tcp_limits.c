/*
 * test_comm_tcp_limits.c - CmpBlkDrvTcp: slow, silent or many connections do not block others.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include <sys/socket.h>
#include <unistd.h>

#include "CmpBlkDrvTcp.h"
#include "comm_fakes.h"
#include "net_client.h"
#include "test.h"

static const RTS_UI8 question[] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x00, 0x01, 0x00, 0x02,
                                   0x00, 0x00, 0xC2, 0x00, 0x01, 0x01, 0x36, 0x65, 0x9D, 0xAB};
enum { CROWD = 100 };

static RTS_UI8 frame[64];
static RTS_UI32 frame_size;

static void start(void)
{
    frame_size = net_frame(question, sizeof(question), frame);
    net_start("@:0", "");
}

static bool works(int file)
{
    RTS_UI8 packet[BLK_MAX_SIZE];

    net_write(file, frame, frame_size);
    return net_read_packet(file, packet) != 0;
}

/* Open after `ms`, closed one later. */
static void ends_after(int file, RTS_UI32 ms)
{
    fakes_cycle(ms - 1);
    CHECK(net_is_open(file));
    fakes_cycle(1);
    CHECK(net_is_closed(file));
    close(file);
}

static void who_says_nothing_is_not_waited_for(void)
{
    start();
    int file = net_dial();
    net_settle();
    ends_after(file, TCP_FRAME_MS);
    CHECK_EQUAL(BlkDrvTcpGetCounters()->late_frames, 1);
    net_end();
}

static void half_a_header_is_not_waited_for(void)
{
    for (RTS_UI32 size = 1; size < frame_size; size += 5) {
        start();
        int file = net_dial();
        net_write(file, frame, size);
        net_settle();
        ends_after(file, TCP_FRAME_MS);
        net_end();
    }
}

static void half_a_frame_after_a_whole_one_is_not_waited_for(void)
{
    start();
    int file = net_dial();
    CHECK(works(file));
    fakes_cycle(TCP_FRAME_MS);
    net_write(file, frame, frame_size - 1);
    net_settle();
    ends_after(file, TCP_FRAME_MS);
    net_end();
}

/* A frame in bytes that come one by one, the last one never. */
static void dribble(int file)
{
    RTS_UI32 sent = 0;

    while (net_is_open(file) && sent < frame_size) {
        net_write(file, frame + sent++, 1);
        net_settle();
        fakes_cycle(TCP_FRAME_MS / 10);
    }
    CHECK_EQUAL(sent, 10);
    CHECK(net_is_closed(file));
    close(file);
}

static void a_byte_now_and_then_is_too_slow(void)
{
    start();
    dribble(net_dial());
    net_end();
}

static void a_byte_now_and_then_is_too_slow_after_a_whole_frame_too(void)
{
    start();
    int file = net_dial();
    CHECK(works(file));
    fakes_cycle(TCP_FRAME_MS);
    dribble(file);
    net_end();
}

static void an_idle_connection_ends_and_one_in_use_does_not(void)
{
    start();
    int file = net_dial();
    for (int i = 0; i < 5; i++) {
        CHECK(works(file));
        fakes_cycle(TCP_IDLE_MS - 1);
    }
    CHECK(works(file));
    ends_after(file, TCP_IDLE_MS);
    CHECK_EQUAL(BlkDrvTcpGetCounters()->idle, 1);
    net_end();
}

static void a_crowd_blocks_no_client(void)
{
    int files[CROWD];
    REPLY reply;
    CLIENT first;
    CLIENT second;
    CLIENT_LINK links[2];

    start();
    int one = net_dial();
    net_client(&first, &links[0], &one);
    CHECK(client_open(&first) && client_login(&first));
    for (int i = 0; i < CROWD; i++) {
        files[i] = net_dial();
        net_settle();
    }
    int two = net_dial();
    net_client(&second, &links[1], &two);
    CHECK(client_open(&second) && client_login(&second));
    CHECK(client_request(&first, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply)); /* it had to stay */
    for (int i = 0; i < CROWD; i++)
        close(files[i]);
    CHECK_EQUAL(BlkDrvTcpGetCounters()->displaced, CROWD + 2 - TCP_MAX_CONNECTIONS);
    close(one);
    close(two);
    net_end();
}

/* A crowd that comes at once, before the device has looked. */
static void a_crowd_at_once_blocks_no_client(void)
{
    enum { AT_ONCE = 12 }; /* what fits the queue of the system */
    int files[AT_ONCE];

    start();
    for (int i = 0; i < AT_ONCE; i++)
        files[i] = net_dial();
    int file = net_dial();
    CHECK(works(file));
    for (int i = 0; i < AT_ONCE; i++)
        close(files[i]);
    close(file);
    net_end();
}

static void who_has_said_something_stays_longer_than_who_has_not(void)
{
    int files[TCP_MAX_CONNECTIONS];

    start();
    for (int i = 0; i < TCP_MAX_CONNECTIONS; i++) {
        files[i] = net_dial();
        net_settle();
        if (i != 1)
            CHECK(works(files[i]));
        fakes_cycle(10);
    }
    int next = net_dial();
    CHECK(works(next));
    CHECK(net_is_closed(files[1])); /* silent, although the first has been idle longer */
    CHECK(works(files[0]));
    int another = net_dial();
    CHECK(works(another));
    CHECK(net_is_closed(files[2])); /* the one that has been idle longest now */
    CHECK(works(files[0]) && works(files[3]) && works(next));
    for (int i = 0; i < TCP_MAX_CONNECTIONS; i++)
        close(files[i]);
    close(next);
    close(another);
    net_end();
}

/* All logged in: the connection that is left is for the next one, which is refused: the device is in use. */
static void when_all_are_in_use_the_next_is_refused(void)
{
    CLIENT clients[COMM_MAX_CLIENTS];
    CLIENT_LINK links[COMM_MAX_CLIENTS + 1];
    int files[COMM_MAX_CLIENTS];
    CLIENT next;
    REPLY reply;

    start();
    for (int i = 0; i < COMM_MAX_CLIENTS; i++) {
        files[i] = net_dial();
        net_client(&clients[i], &links[i], &files[i]);
        CHECK(client_open(&clients[i]) && client_login(&clients[i]));
    }
    for (int i = 0; i < 3; i++) {
        int file = net_dial();
        net_client(&next, &links[COMM_MAX_CLIENTS], &file);
        client_send_open(&next, 1, NETSERVER_MESSAGE_SIZE);
        CHECK_EQUAL(client_take_open(&next), CHANNEL_OPEN_NO_CHANNEL);
        close(file);
    }
    for (int i = 0; i < COMM_MAX_CLIENTS; i++) {
        CHECK(client_request(&clients[i], SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply));
        close(files[i]);
    }
    net_end();
}

int main(void)
{
    RUN(who_says_nothing_is_not_waited_for);
    RUN(half_a_header_is_not_waited_for);
    RUN(half_a_frame_after_a_whole_one_is_not_waited_for);
    RUN(a_byte_now_and_then_is_too_slow);
    RUN(a_byte_now_and_then_is_too_slow_after_a_whole_frame_too);
    RUN(an_idle_connection_ends_and_one_in_use_does_not);
    RUN(a_crowd_blocks_no_client);
    RUN(a_crowd_at_once_blocks_no_client);
    RUN(who_has_said_something_stays_longer_than_who_has_not);
    RUN(when_all_are_in_use_the_next_is_refused);
    return test_result();
}
