/*
 * test_comm_tcp.c - CmpBlkDrvTcp: frames, addresses, partial sending, the end of a connection.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "CmpBlkDrvTcp.h"
#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpPackets.h"
#include "comm_fakes.h"
#include "net_client.h"
#include "test.h"

/* "How many channels?", from an address of four words with another network address, as captured. */
static const RTS_UI8 question[] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x43, 0x2D, 0xDC, 0xC0, 0xA8, 0x38, 0x72, 0x2D, 0xDF,
                                   0x0A, 0x00, 0x02, 0x0F, 0x83, 0x0F, 0xC2, 0x00, 0x01, 0x01, 0x36, 0x65, 0x9D, 0xAB};
enum { QUESTION = sizeof(question), ANSWER = 30 };

RTS_STATIC_ASSERT(TCP_BUFFER_SIZE < 4096, replies_are_longer_than_the_buffer);

static void put_end(RTS_UI8 *address, SOCKADDRESS end)
{
    address[0] = (RTS_UI8)(end.port >> 8);
    address[1] = (RTS_UI8)end.port;
    for (int i = 0; i < 4; i++)
        address[2 + i] = (RTS_UI8)(end.ip >> (24 - 8 * i));
}

static bool is_answered(int file)
{
    RTS_UI8 packet[BLK_MAX_SIZE];

    return net_read_packet(file, packet) == ANSWER && packet[20] == CHANNEL_PKG_RTSINFO_RESP;
}

static bool works(int file)
{
    RTS_UI8 frame[BLK_MAX_SIZE];

    net_write(file, frame, net_frame(question, QUESTION, frame));
    return is_answered(file);
}

static void an_answer_goes_to_the_real_peer_and_keeps_the_rest_of_its_address(void)
{
    RTS_UI8 expected[] = {0xC5, 0x73, 0x40, 0x40, 0x00, 0x34, 0, 0, 0, 0, 0, 0, 0x83, 0x0F, 0, 0, 0, 0, 0, 0};
    RTS_UI8 frame[BLK_MAX_SIZE];
    RTS_UI8 packet[BLK_MAX_SIZE];

    net_start("@:0", "");
    int file = net_dial();
    put_end(expected + 6, net_name(file));
    put_end(expected + 14, net_device(SYSSOCK_TCP));
    net_write(file, frame, net_frame(question, QUESTION, frame));
    CHECK_EQUAL(net_read_packet(file, packet), ANSWER);
    CHECK(memcmp(packet, expected, sizeof(expected)) == 0);
    CHECK_EQUAL(BytesGet16(packet + 28), COMM_MAX_CLIENTS);
    close(file);
    net_end();
}

static void frames_come_in_any_pieces(void)
{
    RTS_UI8 frames[8 * BLK_MAX_SIZE];
    RTS_UI32 size = 0;

    net_start("@:0", "");
    int file = net_dial();
    for (int i = 0; i < 5; i++)
        size += net_frame(question, QUESTION, frames + size);
    for (RTS_UI32 piece = 1; piece < size; piece = 3 * piece + 1) {
        for (RTS_UI32 at = 0; at < size; at += piece) {
            net_write(file, frames + at, size - at < piece ? size - at : piece);
            fakes_cycle(0);
        }
        for (int i = 0; i < 5; i++)
            CHECK(is_answered(file));
    }
    CHECK(net_is_open(file));
    close(file);
    net_end();
}

static void a_frame_of_the_largest_packet_is_taken(void)
{
    RTS_UI8 packet[BLK_MAX_SIZE] = {0};
    RTS_UI8 frame[8 + BLK_MAX_SIZE];

    net_start("@:0", "");
    int file = net_dial();
    memcpy(packet, question, QUESTION); /* what is too long for its package is dropped above */
    net_write(file, frame, net_frame(packet, sizeof(packet), frame));
    CHECK(works(file));
    close(file);
    net_end();
}

static void what_is_no_frame_ends_the_connection(void)
{
    static const RTS_UI32 lengths[] = {0, 7, 8, 15, 521, 0x10000, 0xFFFFFFFF};
    RTS_UI8 frame[BLK_MAX_SIZE];

    net_start("@:0", "");
    for (RTS_UI32 i = 0; i < RTS_COUNT(lengths); i++) {
        int file = net_dial();
        CHECK(works(file));
        RTS_UI32 size = net_frame(question, QUESTION, frame);
        BytesPut32(frame + 4, lengths[i]);
        net_write(file, frame, size);
        CHECK(net_is_closed(file));
        CHECK_EQUAL(BlkDrvTcpGetCounters()->bad_length, i + 1);
        close(file);
    }
    for (RTS_UI32 i = 0; i < 4; i++) {
        int file = net_dial();
        RTS_UI32 size = net_frame(question, QUESTION, frame);
        frame[i] ^= 1;
        net_write(file, frame, size);
        CHECK(net_is_closed(file));
        CHECK_EQUAL(BlkDrvTcpGetCounters()->bad_magic, i + 1);
        close(file);
    }
    int file = net_dial();
    CHECK(works(file));
    close(file);
    net_end();
}

static bool echoes(CLIENT *client, RTS_UI32 size)
{
    static RTS_UI8 content[NETSERVER_MESSAGE_SIZE];
    static REPLY reply;
    BTAG_WRITER writer;

    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite32(&writer, TAG_DEV_ECHO_REPLY_LENGTH, size);
    BTagOpen(&writer, TAG_DEV_ECHO_DATA, BTAG_ALIGN_0);
    for (RTS_UI32 i = 0; i < size; i++)
        BTagAppend(&writer, &(RTS_UI8){(RTS_UI8)(i * 7)}, 1);
    BTagClose(&writer);
    return client_call(client, SG_DEVICE, SRV_DEV_ECHO, &writer, &reply) && reply.size > size;
}

static void long_replies_arrive_although_the_buffer_is_short(void)
{
    CLIENT client;
    CLIENT_LINK link;

    net_start("@:0", "");
    int file = net_dial();
    net_client(&client, &link, &file);
    CHECK(client_open(&client) && client_login(&client));
    CHECK(echoes(&client, 100));
    CHECK(echoes(&client, 15000));
    CHECK_EQUAL(ChannelGetCounters()->repeats, 0);
    close(file);
    net_end();
}

/* As long as the peer reads nothing, what is on its way waits, and the rest of the device goes on. */
static void a_peer_that_does_not_read_loses_nothing(void)
{
    enum { QUESTIONS = 20000 };
    RTS_UI8 frame[BLK_MAX_SIZE];
    RTS_UI32 size = net_frame(question, QUESTION, frame);
    int small = 2048;
    int answered = 0;

    net_start("@:0", "");
    int lazy = net_dial();
    int other = net_dial();
    CHECK_EQUAL(setsockopt(lazy, SOL_SOCKET, SO_RCVBUF, &small, sizeof(small)), 0);
    CHECK(works(lazy));
    for (int i = 0; i < QUESTIONS; i++) {
        if (send(lazy, frame, size, MSG_DONTWAIT | MSG_NOSIGNAL) != (ssize_t)size)
            break;
        fakes_cycle(0);
    }
    CHECK(works(other));
    while (net_has_arrived(lazy) && is_answered(lazy)) /* what was not answered for want of room was dropped whole */
        answered++;
    CHECK(answered > 20);
    CHECK(works(lazy) || is_answered(lazy));
    close(lazy);
    close(other);
    net_end();
}

static void the_next_login_need_not_wait_for_those_that_ended_abruptly(void)
{
    CLIENT clients[COMM_MAX_CLIENTS];
    CLIENT_LINK links[COMM_MAX_CLIENTS];
    int files[COMM_MAX_CLIENTS];
    CLIENT next;
    CLIENT_LINK link;

    net_start("@:0", "");
    for (int i = 0; i < COMM_MAX_CLIENTS; i++) {
        files[i] = net_dial();
        net_client(&clients[i], &links[i], &files[i]);
        CHECK(client_open(&clients[i]) && client_login(&clients[i]));
    }
    int file = net_dial();
    net_client(&next, &link, &file);
    CHECK(!client_open(&next)); /* all are in use */
    for (int i = 0; i < COMM_MAX_CLIENTS; i++) {
        if (i % 2 == 0)
            net_reset(files[i]);
        else
            close(files[i]);
    }
    net_settle(); /* without any time */
    CHECK(client_open(&next) && client_login(&next));
    for (RTS_UI32 i = 0; i < COMM_MAX_CLIENTS; i++)
        CHECK_EQUAL(ChannelIsOpen(ChannelGetClient(i)), (ChannelGetClient(i)->channel.id == next.channel));
    close(file);
    net_end();
}

static void a_reset_in_the_middle_of_a_reply_frees_the_channel(void)
{
    RTS_UI8 content[64];
    RTS_UI8 message[128];
    BTAG_WRITER writer;
    CLIENT client;
    CLIENT_LINK link;

    net_start("@:0", "");
    int file = net_dial();
    net_client(&client, &link, &file);
    CHECK(client_open(&client) && client_login(&client));
    BTagWriterInit(&writer, content, sizeof(content));
    BTagWrite32(&writer, TAG_DEV_ECHO_REPLY_LENGTH, 15000);
    RTS_UI32 size = client_message(&client, SG_DEVICE, SRV_DEV_ECHO, content, writer.size, message);
    client_send_message(&client, message, size);
    net_reset(file);
    net_settle();
    CHECK(!ChannelIsOpen(ChannelGetClient(0)));
    CHECK_EQUAL(BlkDrvTcpGetCounters()->disconnected, 1);
    file = net_dial();
    net_client(&client, &link, &file);
    CHECK(client_open(&client) && client_login(&client) && echoes(&client, 1000));
    close(file);
    net_end();
}

static void a_wrong_id_does_not_keep_its_connection_from_ending_the_channel(void)
{
    CLIENT client;
    CLIENT_LINK link;

    net_start("@:0", "");
    int file = net_dial();
    net_client(&client, &link, &file);
    CHECK(client_open(&client) && client_login(&client));
    client_send_guess_and_close(&client);
    net_settle();
    CHECK(!ChannelIsOpen(ChannelGetClient(0)));
    close(file);
    net_end();
}

static void a_reply_is_not_repeated_because_time_passes(void)
{
    CLIENT client;
    CLIENT_LINK link;
    REPLY reply;

    net_start("@:0", "");
    int file = net_dial();
    net_client(&client, &link, &file);
    CHECK(client_open(&client) && client_login(&client));
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply)); /* not acknowledged */
    for (int i = 0; i < 25; i++)
        fakes_cycle(1000);
    CHECK_EQUAL(ChannelGetCounters()->repeats, 0);
    CHECK(client_request(&client, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply) ||
          ChannelIsOpen(ChannelGetClient(0)));
    close(file);
    net_end();
}

static void the_end_of_the_runtime_is_told(void)
{
    RTS_UI8 packet[BLK_MAX_SIZE];
    CLIENT client;
    CLIENT_LINK link;

    net_start("@:0", "");
    int file = net_dial();
    net_client(&client, &link, &file);
    CHECK(client_open(&client) && client_login(&client));
    net_end();
    RTS_UI8 data[512];
    ssize_t size = recv(file, data, sizeof(data), 0);
    CHECK(size == 8 + 16 + 12 && data[8 + 16] == CHANNEL_PKG_CLOSE);
    CHECK_EQUAL(recv(file, packet, sizeof(packet), 0), 0);
    close(file);
}

int main(void)
{
    RUN(an_answer_goes_to_the_real_peer_and_keeps_the_rest_of_its_address);
    RUN(frames_come_in_any_pieces);
    RUN(a_frame_of_the_largest_packet_is_taken);
    RUN(what_is_no_frame_ends_the_connection);
    RUN(long_replies_arrive_although_the_buffer_is_short);
    RUN(a_peer_that_does_not_read_loses_nothing);
    RUN(the_next_login_need_not_wait_for_those_that_ended_abruptly);
    RUN(a_reset_in_the_middle_of_a_reply_frees_the_channel);
    RUN(a_wrong_id_does_not_keep_its_connection_from_ending_the_channel);
    RUN(a_reply_is_not_repeated_because_time_passes);
    RUN(the_end_of_the_runtime_is_told);
    return test_result();
}
