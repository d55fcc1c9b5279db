/*
 * SysMdns.c - announces this device by multicast DNS, so that tools find it and its name leads to it. RFC 6762.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Mdns.c has the messages; here is when they are sent, and on which networks: those on which TCP is served. The names are
 * the node name, first asked for (probed), then announced. A name that another device has gets a number. Only machines of
 * the own networks are replied to, and no more than REPLIES_MAX at once, since the sender of a datagram may be forged.
 */
#define _GNU_SOURCE
#include "CmpItf.h"
#include "CmpLog.h"
#include "CMUtils.h"
#include "Mdns.h"
#include "NodeName.h"
#include "SysSocket.h"
#include "SysTarget.h"
#include "SysTime.h"
#include "port.h"
#include "rts_config.h"

#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum {
    READ_MAX = 16, /* datagrams in a pass, so that a flood does not stop the rest of the runtime */
    PROBES = 3,
    PROBE_MS = 250,
    ANNOUNCEMENTS = 2,
    STEPS = PROBES + ANNOUNCEMENTS,
    SECOND_MS = 1000, /* between announcements, and after a name was lost */
    REST_MS = 5000,   /* after many lost names: RFC 6762 section 8.1 */
    MANY_CLASHES = 15,
    LAST_NUMBER = 99,    /* of a name; then it begins again */
    LOOK_MS = 5000,      /* how often networks and the node name are looked at */
    REPLIES_MAX = 32,    /* replies at once ... */
    REPLY_EVERY_MS = 50, /* ... and one more after each such time */
    HOPS = 255,          /* RFC 6762 section 11 */
};

static PORT_SOURCE source = {.file = -1};

static struct {
    SOCKNETWORK network[SRV_NETWORKS];
    RTS_UI32 networks;
    char name[MDNS_LABEL_SIZE]; /* of the node, as it was when it was asked for */
    RTS_UI32 number;            /* that the name got, 1: none */
    RTS_UI32 clashes;           /* since the name was announced */
    RTS_UI32 step;              /* of STEPS: how many of the probes and announcements were sent */
    RTS_UI32 due_ms;            /* when the next one is sent */
    RTS_UI32 look_ms;           /* when networks and name are looked at again */
    RTS_UI32 replies;           /* that may be sent now, as of replies_ms */
    RTS_UI32 replies_ms;
} mdns;

static bool is_due(RTS_UI32 at_ms)
{
    return (RTS_I32)(SysTimeGetMs() - at_ms) >= 0;
}

/* ---- what is said ---- */

static MDNS_DEVICE describe(RTS_UI32 network)
{
    MDNS_DEVICE device = {.ip = mdns.network[network].ip};
    SOCKADDRESS tcp = {0, 0};
    SOCKADDRESS udp;
    (void)PortSockAddress(SYSSOCK_TCP, &tcp);
    device.port = tcp.port;
    MdnsMakeLabel(device.instance, mdns.name, mdns.number, false);
    MdnsMakeLabel(device.host, mdns.name, mdns.number, true);
    (void)snprintf(device.text[0], MDNS_TEXT_SIZE, "device=%s", SysTargetGet()->device_name);
    (void)snprintf(device.text[1], MDNS_TEXT_SIZE, "serial=%s", SysTargetGet()->serial_number);
    if (PortSockAddress(SYSSOCK_UDP, &udp)) {
        (void)snprintf(device.text[2], MDNS_TEXT_SIZE, "udp=%u", udp.port);
    }
    return device;
}

static void send_to(const RTS_UI8 *message, RTS_UI32 size, RTS_UI32 ip, RTS_UI16 port)
{
    struct sockaddr_in place = {.sin_family = AF_INET, .sin_port = htons(port)};
    place.sin_addr.s_addr = htonl(ip);
    (void)!sendto(source.file, message, size, MSG_DONTWAIT | MSG_NOSIGNAL, (struct sockaddr *)&place, sizeof(place));
}

static void send_to_group(RTS_UI32 network, const RTS_UI8 *message, RTS_UI32 size)
{
    struct in_addr own = {htonl(mdns.network[network].ip)};
    if (setsockopt(source.file, IPPROTO_IP, IP_MULTICAST_IF, &own, sizeof(own)) == 0) {
        send_to(message, size, MDNS_GROUP, MDNS_PORT);
    }
}

static void announce_all(bool leaves)
{
    RTS_UI8 message[MDNS_REPLY_SIZE];
    for (RTS_UI32 i = 0; i < mdns.networks; i++) {
        MDNS_DEVICE device = describe(i);
        send_to_group(i, message, MdnsAnnounce(&device, leaves, message));
    }
}

static void probe_all(void)
{
    RTS_UI8 message[MDNS_REPLY_SIZE];
    for (RTS_UI32 i = 0; i < mdns.networks; i++) {
        MDNS_DEVICE device = describe(i);
        send_to_group(i, message, MdnsProbe(&device, message));
    }
}

/* ---- the name ---- */

static bool is_announced(void)
{
    return mdns.step > PROBES;
}

static void begin(RTS_UI32 wait_ms)
{
    mdns.step = 0;
    mdns.due_ms = SysTimeGetMs() + wait_ms;
}

/* A device that had the name before asks again; one that asks for it takes the next. */
static void lose_name(void)
{
    if (!is_announced()) {
        mdns.number = mdns.number < LAST_NUMBER ? mdns.number + 1 : 2;
    }
    mdns.clashes++;
    begin(mdns.clashes > MANY_CLASHES ? REST_MS : SECOND_MS);
}

static void log_name(void)
{
    char host[MDNS_LABEL_SIZE];
    MdnsMakeLabel(host, mdns.name, mdns.number, true);
    LogAdd(CMPID_SysMdns, LOG_INFO, ERR_OK, "Announced as %s.local by multicast DNS%s", host,
           mdns.number > 1 ? ": another device has the name without the number" : "");
}

static void do_step(void)
{
    if (mdns.step == STEPS || mdns.networks == 0 || !is_due(mdns.due_ms)) {
        return;
    }
    if (mdns.step < PROBES) {
        probe_all();
        mdns.due_ms = SysTimeGetMs() + PROBE_MS;
    } else {
        announce_all(false);
        mdns.due_ms = SysTimeGetMs() + SECOND_MS;
    }
    mdns.step++;
    if (mdns.step == STEPS) {
        mdns.clashes = 0;
        log_name();
    }
}

/* ---- networks ---- */

static bool serves_tcp(const SOCKNETWORK *network)
{
    SOCKADDRESS own;
    return PortSockAddress(SYSSOCK_TCP, &own) && (own.ip == 0 || own.ip == network->ip);
}

/* A network that it is a member on already is no error. */
static void join(const SOCKNETWORK *network)
{
    struct ip_mreq member;
    member.imr_multiaddr.s_addr = htonl(MDNS_GROUP);
    member.imr_interface.s_addr = htonl(network->ip);
    (void)setsockopt(source.file, IPPROTO_IP, IP_ADD_MEMBERSHIP, &member, sizeof(member));
}

/* Finds the networks; true if they are others than before. */
static bool find_networks(void)
{
    SOCKNETWORK found[SRV_NETWORKS];
    RTS_UI32 count = 0;
    SOCKNETWORK network;
    memset(found, 0, sizeof(found));
    for (RTS_UI32 i = 0; count < SRV_NETWORKS && SysSockGetNetwork(i, &network) == ERR_OK; i++) {
        if (serves_tcp(&network)) {
            join(&network);
            found[count++] = network;
        }
    }
    bool changed = count != mdns.networks || memcmp(found, mdns.network, sizeof(found)) != 0;
    memcpy(mdns.network, found, sizeof(found));
    mdns.networks = count;
    return changed;
}

/* The name may be changed by a tool, and networks come and go. */
static void look(void)
{
    char name[MDNS_LABEL_SIZE];
    (void)snprintf(name, sizeof(name), "%s", NodeNameOf(SysTargetGet()));
    bool renamed = strcmp(name, mdns.name) != 0;
    if (renamed) {
        if (is_announced()) {
            announce_all(true);
        }
        memcpy(mdns.name, name, sizeof(name));
        mdns.number = 1;
    }
    if (find_networks() || renamed) {
        begin(SysTargetRandom() % PROBE_MS); /* devices that were switched on together do not ask together */
    }
    mdns.look_ms = SysTimeGetMs() + LOOK_MS;
}

/* ---- messages of others ---- */

static bool may_reply(void)
{
    RTS_UI32 earned = (SysTimeGetMs() - mdns.replies_ms) / REPLY_EVERY_MS;
    mdns.replies_ms += earned * REPLY_EVERY_MS;
    mdns.replies = earned < REPLIES_MAX - mdns.replies ? mdns.replies + earned : REPLIES_MAX;
    if (mdns.replies == 0) {
        return false;
    }
    mdns.replies--;
    return true;
}

static void reply(RTS_UI32 network, const RTS_UI8 *message, RTS_UI32 size, const SOCKADDRESS *from)
{
    RTS_UI8 text[MDNS_REPLY_SIZE];
    RTS_UI32 text_size = 0;
    MDNS_DEVICE device = describe(network);
    MDNS_RECEIVER receiver = MdnsReply(&device, message, size, from->port, text, &text_size);
    if (receiver == MDNS_SILENCE || !may_reply()) {
        return;
    }
    if (receiver == MDNS_TO_ALL) {
        send_to_group(network, text, text_size);
    } else {
        send_to(text, text_size, from->ip, from->port);
    }
}

static bool is_own(RTS_UI32 ip)
{
    for (RTS_UI32 i = 0; i < mdns.networks; i++) {
        if (mdns.network[i].ip == ip) {
            return true;
        }
    }
    return false;
}

static void take(RTS_UI32 network, const RTS_UI8 *message, RTS_UI32 size, const SOCKADDRESS *from)
{
    MDNS_DEVICE device = describe(network);
    MDNS_CLASH clash =
        from->port == MDNS_PORT ? MdnsFindClash(&device, message, size, is_own(from->ip)) : MDNS_NO_CLASH;
    if (clash == MDNS_TAKEN) {
        lose_name();
    } else if (clash == MDNS_RACE && mdns.step <= PROBES) {
        begin(SECOND_MS);
    } else if (is_announced()) {
        reply(network, message, size, from);
    }
}

static void receive(void)
{
    RTS_UI8 message[MDNS_QUERY_SIZE];
    for (int i = 0; i < READ_MAX; i++) {
        struct sockaddr_in sender = {.sin_family = AF_INET};
        socklen_t length = sizeof(sender);
        ssize_t size = recvfrom(source.file, message, sizeof(message), MSG_DONTWAIT | MSG_TRUNC,
                                (struct sockaddr *)&sender, &length);
        if (size < 0) {
            return;
        }
        PortWaitNotNow();
        SOCKADDRESS from = {ntohl(sender.sin_addr.s_addr), ntohs(sender.sin_port)};
        for (RTS_UI32 n = 0; n < mdns.networks && size <= MDNS_QUERY_SIZE && from.port != 0; n++) {
            if (((from.ip ^ mdns.network[n].ip) & mdns.network[n].mask) == 0) {
                take(n, message, (RTS_UI32)size, &from);
                break;
            }
        }
    }
}

/* ---- life ---- */

bool PortMdnsOpen(PORT_REASON *reason)
{
    struct sockaddr_in place = {.sin_family = AF_INET, .sin_port = htons(MDNS_PORT)};
    int on = 1;
    int off = 0;
    int hops = HOPS;
    source.file = socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    source.events = POLLIN;
    if (source.file < 0 || setsockopt(source.file, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)) != 0 ||
        bind(source.file, (struct sockaddr *)&place, sizeof(place)) != 0) {
        PortReason(reason, "--mdns: UDP port %d cannot be used: %s", MDNS_PORT, strerror(errno));
        PortMdnsClose();
        return false;
    }
    (void)setsockopt(source.file, IPPROTO_IP, IP_MULTICAST_TTL, &hops, sizeof(hops));
    (void)setsockopt(source.file, IPPROTO_IP, IP_TTL, &hops, sizeof(hops));
    (void)setsockopt(source.file, IPPROTO_IP, IP_MULTICAST_ALL, &off, sizeof(off));
    return true;
}

void PortMdnsClose(void)
{
    if (source.file >= 0) {
        (void)close(source.file);
    }
    source.file = -1;
}

static void start(void)
{
    memset(&mdns, 0, sizeof(mdns));
    mdns.look_ms = SysTimeGetMs();
    mdns.replies = REPLIES_MAX;
    mdns.replies_ms = SysTimeGetMs();
    (void)PortWaitAdd(&source);
}

static void cycle(void)
{
    if (is_due(mdns.look_ms)) {
        look();
    }
    do_step();
    receive();
}

static void end(void)
{
    if (is_announced()) {
        announce_all(true);
    }
    PortWaitRemove(&source);
}

RTS_RESULT SysMdns_Hook(CMP_HOOK hook)
{
    if (source.file < 0) {
        return ERR_OK;
    }
    if (hook == CH_INIT3) {
        start();
    } else if (hook == CH_COMM_CYCLE) {
        cycle();
    } else if (hook == CH_EXIT3) {
        end();
    }
    return ERR_OK;
}
