/*
 * test_comm_hosts.c - machines on a network, each with many ports or connections, and what is on a serial line: none of
 * them gets all channels, or all connections. The sockets are the test's, because on loopback all is one machine.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBlkDrvTcp.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpChecksum.h"
#include "CmpPackets.h"
#include "SysSocket.h"
#include "comm_client.h"
#include "comm_fakes.h"
#include "test.h"

RTS_STATIC_ASSERT(COMM_HOST_CHANNELS == 3 && COMM_MAX_CLIENTS == 4, one_channel_is_for_others);

enum {
    DEVICE_IP = 0x0A000001,
    CROWDED_IP = 0x0A000010, /* the machine with many */
    OTHER_IP = 0x0A000020,
    LOCAL_IP = 0x7F000001,
    LISTENER = 100,
    UDP,
    DIALLED = 16,
    DATAGRAMS = 16,
    ATTEMPTS = 20,
};

/* ---- sockets ---- */

typedef struct {
    SOCKADDRESS peer;
    RTS_UI32 size;
    RTS_UI8 data[BLK_MAX_SIZE];
} DATAGRAM;

static struct {
    DATAGRAM in; /* waits for the device; size 0: none */
    DATAGRAM out[DATAGRAMS];
    RTS_UI32 out_count;
    RTS_UI32 dialled_ip[DIALLED];
    bool closed[DIALLED];
    RTS_UI32 dialled;
    RTS_UI32 accepted;
} net;

RTS_HANDLE SysSockOpen(SYSSOCK_PURPOSE purpose)
{
    if (purpose == SYSSOCK_TCP)
        return LISTENER;
    return purpose == SYSSOCK_UDP ? UDP : (RTS_HANDLE)RTS_INVALID_HANDLE;
}

RTS_RESULT SysSockGetOwn(RTS_HANDLE socket, SOCKADDRESS *own, RTS_UI32 *prefix)
{
    *own = (SOCKADDRESS){DEVICE_IP, socket == UDP ? UDP_PORT : TCP_PORT};
    *prefix = 24;
    return ERR_OK;
}

RTS_HANDLE SysSockAccept(RTS_HANDLE listener, SOCKADDRESS *peer)
{
    RTS_UNUSED(listener);
    if (net.accepted == net.dialled)
        return (RTS_HANDLE)RTS_INVALID_HANDLE;
    *peer = (SOCKADDRESS){net.dialled_ip[net.accepted], (RTS_UI16)(50000 + net.accepted)};
    return net.accepted++;
}

RTS_RESULT SysSockRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received)
{
    RTS_UNUSED(socket);
    RTS_UNUSED(data);
    RTS_UNUSED(size);
    *received = 0;
    return ERR_OK;
}

RTS_RESULT SysSockSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken)
{
    RTS_UNUSED(socket);
    RTS_UNUSED(data);
    *taken = size;
    return ERR_OK;
}

RTS_RESULT SysSockRecvFrom(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received)
{
    RTS_UNUSED(socket);
    if (net.in.size == 0 || net.in.size > size)
        return ERR_NOTHING_TO_DO;
    memcpy(data, net.in.data, net.in.size);
    *from = net.in.peer;
    *received = net.in.size;
    net.in.size = 0;
    return ERR_OK;
}

RTS_RESULT SysSockSendTo(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, const SOCKADDRESS *to)
{
    DATAGRAM *datagram = &net.out[net.out_count];

    RTS_UNUSED(socket);
    if (net.out_count == DATAGRAMS)
        return ERR_NOBUFFER;
    datagram->peer = *to;
    datagram->size = size;
    memcpy(datagram->data, data, size);
    net.out_count++;
    return ERR_OK;
}

RTS_RESULT SysSockRecvRefused(RTS_HANDLE socket, SOCKADDRESS *to)
{
    RTS_UNUSED(socket);
    RTS_UNUSED(to);
    return ERR_NOTHING_TO_DO;
}

void SysSockClose(RTS_HANDLE socket)
{
    if (socket < DIALLED)
        net.closed[socket] = true;
}

/* ---- tools that send datagrams ---- */

typedef struct {
    CLIENT client;
    CLIENT_LINK link;
    SOCKADDRESS at;
} TOOL;

static void send(void *instance, const RTS_UI8 *packet, RTS_UI32 size)
{
    const TOOL *tool = instance;

    net.in.peer = tool->at;
    net.in.size = size;
    memcpy(net.in.data, packet, size);
    fakes_cycle(0);
}

/* The oldest datagram that is for the tool. */
static RTS_UI32 receive(void *instance, RTS_UI8 *packet, RTS_UI32 capacity)
{
    const TOOL *tool = instance;

    for (RTS_UI32 i = 0; i < net.out_count; i++) {
        RTS_UI32 size = net.out[i].size;
        if (net.out[i].peer.ip != tool->at.ip || net.out[i].peer.port != tool->at.port || size > capacity)
            continue;
        memcpy(packet, net.out[i].data, size);
        net.out_count--;
        memmove(&net.out[i], &net.out[i + 1], (net.out_count - i) * sizeof(net.out[i]));
        return size;
    }
    return 0;
}

static void place_tool(TOOL *tool, RTS_UI32 ip, RTS_UI32 port)
{
    client_init(&tool->client, 0x0102);
    tool->at = (SOCKADDRESS){ip, (RTS_UI16)(50000 + port)};
    tool->link = (CLIENT_LINK){send, receive, tool};
    tool->client.link = &tool->link;
}

static bool logs_in(TOOL *tool)
{
    return client_open(&tool->client) && client_login(&tool->client);
}

static bool is_served(TOOL *tool)
{
    REPLY reply;

    return client_request(&tool->client, SG_APPLICATION, SRV_APP_READ_APPLICATION_LIST, NULL, 0, &reply) &&
           reply_error(&reply) == ERR_OK;
}

static void start(void)
{
    memset(&net, 0, sizeof(net));
    fakes_start();
    fakes_cycle(0);
}

/* ---- channels ---- */

static void one_machine_leaves_a_channel_to_others(void)
{
    TOOL crowd[COMM_MAX_CLIENTS];
    TOOL other;

    start();
    for (RTS_UI32 i = 0; i < COMM_MAX_CLIENTS; i++) {
        place_tool(&crowd[i], CROWDED_IP, i);
        CHECK_EQUAL(logs_in(&crowd[i]), i < COMM_HOST_CHANNELS);
    }
    place_tool(&other, OTHER_IP, 0);
    CHECK(logs_in(&other) && is_served(&other));
    for (RTS_UI32 i = 0; i < COMM_HOST_CHANNELS; i++)
        CHECK(is_served(&crowd[i]));
}

static void a_machine_that_opens_without_end_does_not_end_the_login_of_another_one(void)
{
    TOOL crowd[COMM_MAX_CLIENTS];
    TOOL other;

    start();
    for (RTS_UI32 i = 0; i < COMM_HOST_CHANNELS; i++) {
        place_tool(&crowd[i], CROWDED_IP, i);
        CHECK(client_open(&crowd[i].client));
    }
    place_tool(&other, OTHER_IP, 0);
    CHECK(client_open(&other.client));
    for (RTS_UI32 i = 0; i < ATTEMPTS; i++) { /* before its first message */
        place_tool(&crowd[COMM_MAX_CLIENTS - 1], CROWDED_IP, COMM_MAX_CLIENTS + i);
        CHECK(client_open(&crowd[COMM_MAX_CLIENTS - 1].client)); /* in place of one of its own */
        net.out_count = 0;
        fakes_cycle(1);
    }
    CHECK(client_login(&other.client) && is_served(&other));
}

static void a_machine_with_its_share_gets_what_its_own_tools_leave(void)
{
    TOOL crowd[COMM_HOST_CHANNELS];
    TOOL next;

    start();
    for (RTS_UI32 i = 0; i < COMM_HOST_CHANNELS; i++) {
        place_tool(&crowd[i], CROWDED_IP, i);
        CHECK(logs_in(&crowd[i]));
    }
    place_tool(&next, CROWDED_IP, COMM_MAX_CLIENTS);
    CHECK(!client_open(&next.client));
    client_send_close(&crowd[0].client);
    CHECK(logs_in(&next) && is_served(&next));
    fakes_cycle(CHANNEL_IDLE_MS - 1);
    net.out_count = 0;
    CHECK(is_served(&next));
    fakes_cycle(1); /* the others have gone without a word */
    net.out_count = 0;
    place_tool(&crowd[0], CROWDED_IP, 0);
    CHECK(logs_in(&crowd[0]));
    CHECK(is_served(&next));
}

static void tools_on_the_machine_of_the_device_may_have_all_channels(void)
{
    TOOL tools[COMM_MAX_CLIENTS];

    start();
    for (RTS_UI32 i = 0; i < COMM_MAX_CLIENTS; i++) {
        place_tool(&tools[i], LOCAL_IP, i);
        CHECK(logs_in(&tools[i]));
    }
}

/* ---- a serial line ---- */

static void put_line(RTS_UI8 byte, bool escaped)
{
    fakes.line_in[fakes.line_in_size++] = byte;
    if (escaped && byte == '#')
        fakes.line_in[fakes.line_in_size++] = '_';
}

static void send_on_line(void *instance, const RTS_UI8 *packet, RTS_UI32 size)
{
    RTS_UI16 crc = CRC16Update(CRC16_INIT, packet, size);

    RTS_UNUSED(instance);
    fakes.line_in_size = fakes.line_in_read = 0;
    put_line('#', false);
    put_line('<', false);
    for (RTS_UI32 i = 0; i < size; i++)
        put_line(packet[i], true);
    put_line((RTS_UI8)crc, true);
    put_line((RTS_UI8)(crc >> 8), true);
    put_line('#', false);
    put_line('>', false);
    fakes_cycle(0);
}

static RTS_UI32 receive_on_line(void *instance, RTS_UI8 *packet, RTS_UI32 capacity)
{
    RTS_UI32 size = 0;
    RTS_UI32 i = 2; /* after the start of the frame */

    RTS_UNUSED(instance);
    if (fakes.line_out_size == 0)
        return 0;
    for (; memcmp(fakes.line_out + i, "#>", 2) != 0 && size < capacity; i++) {
        packet[size++] = fakes.line_out[i];
        i += fakes.line_out[i] == '#';
    }
    i += 2;
    fakes.line_out_size -= i;
    memmove(fakes.line_out, fakes.line_out + i, fakes.line_out_size);
    return size - (RTS_UI32)sizeof(RTS_UI16);
}

/* With an address of its own for each channel. */
static void what_is_on_a_serial_line_leaves_a_channel_to_others(void)
{
    static const CLIENT_LINK line = {send_on_line, receive_on_line, NULL};
    CLIENT many[COMM_MAX_CLIENTS];
    TOOL other;

    start();
    for (RTS_UI32 i = 0; i < COMM_MAX_CLIENTS; i++) {
        client_init(&many[i], (RTS_UI16)(0x1000 + i));
        many[i].link = &line;
        CHECK_EQUAL(client_open(&many[i]) && client_login(&many[i]), i < COMM_HOST_CHANNELS);
    }
    place_tool(&other, OTHER_IP, 0);
    CHECK(logs_in(&other) && is_served(&other));
}

/* Two tools want the last channel at the same time. */
static void a_tool_whose_new_channel_was_taken_opens_again(void)
{
    TOOL tools[COMM_MAX_CLIENTS + 1];
    RTS_UI8 package[BLK_MAX_SIZE];
    TOOL *first = &tools[COMM_MAX_CLIENTS - 1];
    TOOL *second = &tools[COMM_MAX_CLIENTS];

    start();
    for (RTS_UI32 i = 0; i <= COMM_MAX_CLIENTS; i++) {
        place_tool(&tools[i], OTHER_IP + i, i);
        if (i < COMM_MAX_CLIENTS - 1)
            CHECK(logs_in(&tools[i]));
    }
    CHECK(client_open(&first->client) && client_open(&second->client));
    CHECK(client_take(&first->client, NULL, package) != 0 && package[0] == CHANNEL_PKG_CLOSE);
    CHECK(client_open(&first->client));
    CHECK(client_login(&first->client) && is_served(first));
    CHECK(client_take(&second->client, NULL, package) != 0 && package[0] == CHANNEL_PKG_CLOSE);
    CHECK(!client_open(&second->client)); /* busy: it waits, and says so */
}

/* A reply would reach many nodes, or none. */
static void what_says_it_is_of_no_single_machine_is_not_answered(void)
{
    static const SOCKADDRESS nobody[] = {{0xFFFFFFFF, 1740}, {0xE0000001, 1740}, {0xEFFFFFFF, 1740},
                                         {0xF0000001, 1740}, {0, 1740},          {OTHER_IP, 0}};
    TOOL tool;

    start();
    place_tool(&tool, OTHER_IP, 0);
    CHECK(client_open(&tool.client));
    for (RTS_UI32 i = 0; i < RTS_COUNT(nobody); i++) {
        tool.at = nobody[i];
        client_send_open(&tool.client, 8 + i, NETSERVER_MESSAGE_SIZE);
    }
    CHECK_EQUAL(net.out_count, 0);
    CHECK_EQUAL(ChannelGetCounters()->opened, 1);
}

/* ---- connections ---- */

static RTS_UI32 dial(RTS_UI32 ip)
{
    RTS_UI32 socket = net.dialled++;

    net.dialled_ip[socket] = ip;
    fakes_cycle(1); /* a place becomes free */
    fakes_cycle(1);
    return socket;
}

static void connections_of_one_machine_displace_its_own(void)
{
    start();
    RTS_UI32 other = dial(OTHER_IP);
    for (RTS_UI32 i = 0; i < TCP_MAX_CONNECTIONS - 1; i++)
        (void)dial(CROWDED_IP);
    RTS_UI32 second = dial(OTHER_IP);
    CHECK(!net.closed[other]);
    for (RTS_UI32 i = 0; i < TCP_MAX_CONNECTIONS; i++)
        CHECK(!net.closed[dial(CROWDED_IP)]);
    CHECK(!net.closed[other] && !net.closed[second]);
    CHECK_EQUAL(BlkDrvTcpGetCounters()->displaced, TCP_MAX_CONNECTIONS + 1);
}

int main(void)
{
    RUN(one_machine_leaves_a_channel_to_others);
    RUN(a_machine_that_opens_without_end_does_not_end_the_login_of_another_one);
    RUN(a_machine_with_its_share_gets_what_its_own_tools_leave);
    RUN(tools_on_the_machine_of_the_device_may_have_all_channels);
    RUN(what_is_on_a_serial_line_leaves_a_channel_to_others);
    RUN(a_tool_whose_new_channel_was_taken_opens_again);
    RUN(what_says_it_is_of_no_single_machine_is_not_answered);
    RUN(connections_of_one_machine_displace_its_own);
    return test_result();
}
