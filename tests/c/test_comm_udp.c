/*
 * test_comm_udp.c - CmpBlkDrvUdp: addresses, scan, and replies that go to the sender only.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include <netinet/in.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "CmpBlkDrvUdp.h"
#include "CmpBytes.h"
#include "CmpChannelServerEmbedded.h"
#include "CmpPackets.h"
#include "comm_fakes.h"
#include "net_client.h"
#include "port.h"
#include "test.h"

/* As programming systems and scanners send it. */
static const RTS_UI8 scan[] = {0xC5, 0x6B, 0x40, 0x03, 0x00, 0x10, 0x00, 0x01, 0x02, 0xC2, 0x00, 0x04, 0, 0, 0, 0};
static const RTS_UI8 long_header_scan[] = {0xC5, 0x7C, 0x40, 0x03, 0x00, 0x10, 0x12, 0x34, 0x00, 0x32,
                                           0x00, 0x00, 0x02, 0xC2, 0x00, 0x04, 0x69, 0x69, 0x20, 0x04};
/* "How many channels?", to a receiver that is not this device. */
static const RTS_UI8 to_another[] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x0B, 0xAD, 0x00, 0x02,
                                     0x00, 0x00, 0xC2, 0x00, 0x01, 0x01, 0x36, 0x65, 0x9D, 0xAB};

static RTS_UI8 packet[1024];

static bool address_is(RTS_UI32 ip, RTS_UI32 prefix, RTS_UI32 index, const char *expected, RTS_UI32 words)
{
    RTS_UI8 address[2 * ROUTER_MAX_NETWORK];

    return BlkDrvUdpPutAddress(ip, prefix, index, address) == words && memcmp(address, expected, 2 * words) == 0;
}

static void an_address_is_the_host_part_and_the_index_of_the_port(void)
{
    CHECK(address_is(0xAC114568, 21, 1, "\x0D\x68", 1)); /* 172.17.69.104/255.255.248.0, port 1741 */
    CHECK(address_is(0xC0A8BEAF, 24, 0, "\x00\xAF", 1)); /* 192.168.190.175/24, port 1740 */
    CHECK(address_is(0xC0A8BEAF, 24, 3, "\x03\xAF", 1));
    CHECK(address_is(0xC0A8BEAF, 18, 3, "\xFE\xAF", 1));
    CHECK(address_is(0xC0A8BEAF, 17, 3, "\x00\x01\xBE\xAF", 2));
    CHECK(address_is(0x7F000001, 8, 2, "\x02\x00\x00\x01", 2));
    CHECK(address_is(0x0A010203, 32, 2, "\x00\x02", 1));
    CHECK(address_is(0xF1020304, 0, 3, "\x00\x03\xF1\x02\x03\x04", 3));
}

static SOCKADDRESS to_all(void)
{
    SOCKADDRESS device = net_device(SYSSOCK_UDP);

    device.ip |= 0x00FFFFFF;
    return device;
}

static bool is_node(RTS_UI32 size)
{
    SOCKADDRESS device = net_device(SYSSOCK_UDP);
    RTS_UI8 own[2 * ROUTER_MAX_NETWORK];
    RTS_UI32 words = BlkDrvUdpPutAddress(device.ip, 8, device.port - UDP_PORT, own);

    return size > 60 && packet[3] == ROUTER_SVC_NAME_RESPONSE && packet[5] == (words << 4 | 1) &&
           memcmp(packet + 8, own, 2 * words) == 0 && packet[12 + 38] == BLK_DRV_TYPE_UDP;
}

/* The next datagram from our device: devices of other processes hear a broadcast too. */
static RTS_UI32 take_from_device(int file)
{
    SOCKADDRESS device = net_device(SYSSOCK_UDP);
    struct sockaddr_in from;
    ssize_t count = 0;

    while (net_has_arrived(file)) {
        socklen_t size = sizeof(from);
        count = recvfrom(file, packet, sizeof(packet), MSG_DONTWAIT, (struct sockaddr *)&from, &size);
        if (count > 0 && ntohs(from.sin_port) == device.port && ntohl(from.sin_addr.s_addr) == device.ip)
            return (RTS_UI32)count;
    }
    return 0;
}

static void a_scan_finds_it_from_near_and_by_broadcast(void)
{
    net_start("", "@");
    int file = net_udp(0);
    net_send_to(file, net_device(SYSSOCK_UDP), scan, sizeof(scan));
    CHECK(is_node(take_from_device(file)));
    net_send_to(file, to_all(), scan, sizeof(scan));
    CHECK(is_node(take_from_device(file)));
    net_send_to(file, to_all(), long_header_scan, sizeof(long_header_scan));
    CHECK(is_node(take_from_device(file)));
    CHECK(packet[6] == 0x00 && packet[7] == 0x32); /* the words before are more of the header */
    close(file);
    net_end();
}

/* Width 26: 24 bits of the host, 2 of the index. */
static void ones_alone_are_the_address_of_all(void)
{
    static const RTS_UI8 ones[][4] = {{0xFF, 0xFF, 0xFF, 0xFF}, {0x03, 0xFF, 0xFF, 0xFF}};
    RTS_UI8 to_ones[] = {0xC5, 0x6B, 0x40, 0x03, 0x00, 0x12, 0, 0, 0, 0,
                         0x12, 0x34, 0x02, 0xC2, 0x00, 0x04, 1, 2, 3, 4};

    net_start("", "@");
    int file = net_udp(0);
    for (RTS_UI32 i = 0; i < RTS_COUNT(ones); i++) {
        memcpy(to_ones + 6, ones[i], sizeof(ones[i]));
        net_send_to(file, to_all(), to_ones, sizeof(to_ones));
        CHECK(take_from_device(file) > 60);
    }
    to_ones[6] = 0x01;
    net_send_to(file, to_all(), to_ones, sizeof(to_ones));
    CHECK_EQUAL(take_from_device(file), 0);
    close(file);
    net_end();
}

static void an_answer_to_a_broadcast_comes_from_the_own_address_of_the_device(void)
{
    net_start("", "@");
    int file = net_udp(0);
    net_send_to(file, to_all(), scan, sizeof(scan));
    CHECK(take_from_device(file) > 0);
    close(file);
    net_end();
}

/* With NAT the sender knows another address of the device than the device does. */
static void what_is_sent_to_us_is_for_us_and_what_is_sent_to_all_need_not_be(void)
{
    net_start("", "@");
    int file = net_udp(0);
    net_send_to(file, net_device(SYSSOCK_UDP), to_another, sizeof(to_another));
    CHECK(net_datagram(file, packet, sizeof(packet)) != 0);
    net_send_to(file, to_all(), to_another, sizeof(to_another));
    CHECK_EQUAL(net_datagram(file, packet, sizeof(packet)), 0);
    close(file);
    net_end();
}

/* The sender's address in the packet is that of a victim, which must not receive anything. */
static void it_reflects_nothing(void)
{
    RTS_UI8 forged[] = {0xC5, 0x6B, 0x40, 0x03, 0x00, 0x20, 0, 0, 0, 0, 0, 0, 0x02, 0xC2, 0x00, 0x04, 1, 2, 3, 4};

    net_start("", "@:1740");
    int victim = net_udp(0);
    int attacker = net_udp(0);
    SOCKADDRESS name = net_name(victim);
    for (RTS_UI32 index = 0; index < UDP_PORTS; index++) {
        (void)BlkDrvUdpPutAddress(name.ip, 8, index, forged + 6);
        net_send_to(attacker, net_device(SYSSOCK_UDP), forged, sizeof(forged));
        CHECK(net_datagram(attacker, packet, sizeof(packet)) != 0);
        CHECK(memcmp(packet + 6, forged + 6, 4) == 0);
        CHECK_EQUAL(net_datagram(victim, packet, sizeof(packet)), 0);
    }
    close(victim);
    close(attacker);
    net_end();
}

static void send_packet(void *instance, const RTS_UI8 *data, RTS_UI32 size)
{
    net_send_to(*(int *)instance, net_device(SYSSOCK_UDP), data, size);
}

static RTS_UI32 receive_packet(void *instance, RTS_UI8 *data, RTS_UI32 capacity)
{
    return net_datagram(*(int *)instance, data, capacity);
}

static void a_channel_belongs_to_where_it_was_opened_from(void)
{
    RTS_UI8 package[BLK_MAX_SIZE];
    CLIENT owner;
    CLIENT thief;
    REPLY reply;

    net_start("", "@");
    int files[] = {net_udp(0), net_udp(0)};
    CLIENT_LINK links[] = {{send_packet, receive_packet, &files[0]}, {send_packet, receive_packet, &files[1]}};
    client_init(&owner, 0x0102);
    owner.link = &links[0];
    CHECK(client_open(&owner) && client_login(&owner));
    thief = owner; /* the same address, channel and session, from another port */
    thief.link = &links[1];
    client_send_close(&thief);
    net_settle();
    CHECK(ChannelIsOpen(ChannelGetClient(0)));
    CHECK(!client_request(&thief, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply));
    CHECK(client_request(&owner, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply));
    client_init(&thief, 0x0102);
    thief.link = &links[1];
    CHECK(client_open(&thief) && client_login(&thief)); /* a channel of its own */
    CHECK(client_request(&owner, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply));
    CHECK(client_take(&owner, NULL, package) == 0);
    close(files[0]);
    close(files[1]);
    net_end();
}

/* The sender's address may be a lie. */
static void ids_tried_in_the_name_of_a_client_close_nothing(void)
{
    CLIENT owner;
    REPLY reply;

    net_start("", "@");
    int file = net_udp(0);
    CLIENT_LINK link = {send_packet, receive_packet, &file};
    client_init(&owner, 0x0102);
    owner.link = &link;
    CHECK(client_open(&owner) && client_login(&owner));
    client_send_guess_and_close(&owner);
    net_settle();
    CHECK(client_request(&owner, SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply));
    close(file);
    net_end();
}

/* Their sockets are closed without a word. */
static void clients_that_have_vanished_give_way_in_less_than_a_second(void)
{
    int files[COMM_MAX_CLIENTS + 1];
    CLIENT_LINK links[COMM_MAX_CLIENTS + 1];
    CLIENT clients[COMM_MAX_CLIENTS + 1];
    REPLY reply;

    net_start("", "@");
    for (RTS_UI32 i = 0; i <= COMM_MAX_CLIENTS; i++) {
        files[i] = net_udp(0);
        links[i] = (CLIENT_LINK){send_packet, receive_packet, &files[i]};
        client_init(&clients[i], 0x0102);
        clients[i].link = &links[i];
    }
    CLIENT *last = &clients[COMM_MAX_CLIENTS];
    for (RTS_UI32 i = 0; i < COMM_MAX_CLIENTS; i++)
        CHECK(client_open(&clients[i]) && client_login(&clients[i]));
    for (RTS_UI32 i = 0; i < COMM_MAX_CLIENTS - 1; i++)
        close(files[i]);
    CHECK(!client_open(last));
    fakes_cycle(CHANNEL_PROBE_MS);
    CHECK(!client_open(last)); /* this one makes them show themselves */
    net_settle();
    CHECK(client_open(last) && client_login(last));
    while (net_datagram(files[COMM_MAX_CLIENTS - 1], packet, sizeof(packet)) != 0) {
    }
    CHECK(client_request(&clients[COMM_MAX_CLIENTS - 1], SG_DEVICE, SRV_DEV_GET_TARGET_IDENT, NULL, 0, &reply));
    close(files[COMM_MAX_CLIENTS - 1]);
    close(files[COMM_MAX_CLIENTS]);
    net_end();
}

static void what_is_no_packet_is_dropped(void)
{
    RTS_UI8 data[1000] = {0xC5, 0x6B, 0x40, 0x03, 0x00, 0x10, 0x00, 0x01, 0x02, 0xC2, 0x00, 0x04};
    static const RTS_UI32 sizes[] = {0, 1, 5, 7, BLK_MAX_SIZE + 1, sizeof(data)};

    net_start("", "@");
    int file = net_udp(0);
    for (RTS_UI32 i = 0; i < RTS_COUNT(sizes); i++) {
        net_send_to(file, net_device(SYSSOCK_UDP), data, sizes[i]);
        CHECK_EQUAL(net_datagram(file, packet, sizeof(packet)), 0);
    }
    CHECK_EQUAL(BlkDrvUdpGetCounters()->too_long, 2);
    net_send_to(file, net_device(SYSSOCK_UDP), data, BLK_MAX_SIZE);
    CHECK(is_node(net_datagram(file, packet, sizeof(packet))));
    close(file);
    net_end();
}

static void a_flood_is_worked_off_in_pieces(void)
{
    enum { FLOOD = 100 };
    int answers = 0;

    net_start("", "@");
    int file = net_udp(0);
    for (int i = 0; i < FLOOD; i++)
        net_send_to(file, net_device(SYSSOCK_UDP), to_another, sizeof(to_another));
    fakes_cycle(0);
    CHECK(BlkDrvUdpGetCounters()->packets < FLOOD);
    while (net_datagram(file, packet, sizeof(packet)) != 0)
        answers++;
    CHECK_EQUAL(answers, FLOOD);
    close(file);
    net_end();
}

/* Sends requests for the name from several sources; returns how many are answered, and the bytes of the answers. */
static int count_names(const RTS_UI8 *request, RTS_UI32 size, int requests, RTS_UI32 *bytes)
{
    int files[] = {net_udp(0), net_udp(0), net_udp(0)};
    int answers = 0;

    for (int i = 0; i < requests; i++)
        net_send_to(files[i % 3], net_device(SYSSOCK_UDP), request, size);
    for (int i = 0; i < 3; i++)
        for (RTS_UI32 count; (count = net_datagram(files[i], packet, sizeof(packet))) != 0; answers++)
            *bytes += count;
    for (int i = 0; i < 3; i++)
        close(files[i]);
    return answers;
}

static void requests_of_forged_senders_are_answered_seldom(void)
{
    enum { FLOOD = 100, BURST = 32 };
    RTS_UI32 bytes = 0;

    net_start("", "@");
    int answers = count_names(scan, sizeof(scan), FLOOD, &bytes);
    CHECK(answers >= BURST && answers < FLOOD / 2); /* the fakes let some time pass */
    CHECK_EQUAL(BlkDrvUdpGetCounters()->not_named, (RTS_UI32)(FLOOD - answers));
    fakes_cycle(1000 * 1000); /* no more than at the start, however long it was quiet */
    answers = count_names(scan, sizeof(scan), FLOOD, &bytes);
    CHECK(answers >= BURST && answers < FLOOD / 2);
    net_end();
}

static void a_request_as_long_as_the_answer_is_always_answered(void)
{
    enum { FLOOD = 100, LONG = 300 };
    RTS_UI8 request[LONG] = {0};
    RTS_UI32 bytes = 0;

    net_start("", "@");
    (void)count_names(scan, sizeof(scan), FLOOD, &bytes);
    memcpy(request, scan, sizeof(scan));
    bytes = 0;
    CHECK_EQUAL(count_names(request, sizeof(request), FLOOD, &bytes), FLOOD);
    CHECK(bytes <= FLOOD * LONG);
    net_end();
}

static void the_first_free_port_is_taken_or_the_one_asked_for(void)
{
    PORT_REASON reason;
    char text[64];
    char name[64];

    net_start("", "@:1742");
    CHECK_EQUAL(net_device(SYSSOCK_UDP).port, UDP_PORT + 2);
    int file = net_udp(0);
    net_send_to(file, to_all(), scan, sizeof(scan)); /* to its port */
    CHECK(is_node(net_datagram(file, packet, sizeof(packet))));
    snprintf(text, sizeof(text), "%s:1742", net_own());
    CHECK(PortSockName(SYSSOCK_UDP, name, sizeof(name)) && strcmp(name, text) == 0);
    close(file);
    net_end();

    int files[UDP_PORTS];
    for (RTS_UI16 i = 0; i < UDP_PORTS; i++) {
        net_start("", "@");
        CHECK_EQUAL(net_device(SYSSOCK_UDP).port, UDP_PORT + i);
        net_end();
        files[i] = net_udp(UDP_PORT + i);
        snprintf(text, sizeof(text), "%s:%d", net_own(), UDP_PORT + i);
        CHECK(!PortUdpOpen(text, &reason) && reason.busy);
    }
    CHECK(!PortUdpOpen(net_own(), &reason) && reason.busy);
    for (int i = 0; i < UDP_PORTS; i++)
        close(files[i]);
}

static void what_is_no_place_is_refused(void)
{
    static const char *const wrong_udp[] = {"",
                                            ":",
                                            "1",
                                            "127.0.0.1:4",
                                            "127.0.0.1:-1",
                                            "127.0.0.1:3",
                                            "127.0.0.1:1739",
                                            "127.0.0.1:1744",
                                            "host",
                                            "127.0.0.1:",
                                            "127.0.0.1:0x1",
                                            "300.0.0.1",
                                            "127.0.0.1.1.1.1.1.1.1:1740"};
    static const char *const wrong_tcp[] = {"", ":", ":1", "65536", "-1", "127.0.0.1:65536", "host:1", "127.0.0:1"};
    PORT_REASON reason;

    for (RTS_UI32 i = 0; i < RTS_COUNT(wrong_udp); i++)
        CHECK(!PortUdpOpen(wrong_udp[i], &reason) && !reason.busy);
    for (RTS_UI32 i = 0; i < RTS_COUNT(wrong_tcp); i++)
        CHECK(!PortTcpOpen(wrong_tcp[i], &reason) && !reason.busy);
    CHECK(!PortTcpOpen("192.0.2.77:0", &reason)); /* no address of this machine */
}

int main(void)
{
    RUN(an_address_is_the_host_part_and_the_index_of_the_port);
    RUN(a_scan_finds_it_from_near_and_by_broadcast);
    RUN(ones_alone_are_the_address_of_all);
    RUN(an_answer_to_a_broadcast_comes_from_the_own_address_of_the_device);
    RUN(what_is_sent_to_us_is_for_us_and_what_is_sent_to_all_need_not_be);
    RUN(it_reflects_nothing);
    RUN(a_channel_belongs_to_where_it_was_opened_from);
    RUN(ids_tried_in_the_name_of_a_client_close_nothing);
    RUN(clients_that_have_vanished_give_way_in_less_than_a_second);
    RUN(what_is_no_packet_is_dropped);
    RUN(a_flood_is_worked_off_in_pieces);
    RUN(requests_of_forged_senders_are_answered_seldom);
    RUN(a_request_as_long_as_the_answer_is_always_answered);
    RUN(the_first_free_port_is_taken_or_the_one_asked_for);
    RUN(what_is_no_place_is_refused);
    return test_result();
}
