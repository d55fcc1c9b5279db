/*
 * SysNet.c - sockets of programs, and what plcrt --net lets them reach.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The sockets are those of SysSocket.c. Main does not wait for them: a program that does not fetch its data would else
 * keep main busy.
 */
#include "SysNet.h"

#include "port.h"
#include "rts_config.h"

#include <arpa/inet.h>
#include <errno.h>
#include <limits.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>

enum { RULES = 32, IP_BITS = 32, WIDEST_TEXT = sizeof("255.255.255.255") };

/* Addresses that a program may reach, and their ports. */
typedef struct {
    RTS_UI32 ip;
    RTS_UI32 mask;
    RTS_UI32 first_port;
    RTS_UI32 last_port;
} RULE;

static const RULE this_machine = {0x7F000000, 0xFF000000, 0, UINT16_MAX};

static struct {
    RTS_UI32 count; /* 0: this machine only */
    RULE rule[RULES];
} allowed;

/* ---- rules ---- */

static bool parse_number(const char **text, unsigned long most, RTS_UI32 *number)
{
    char *end;
    errno = 0;
    unsigned long value = **text >= '0' && **text <= '9' ? strtoul(*text, &end, 10) : ULONG_MAX;
    if (errno != 0 || value > most) {
        return false;
    }
    *number = (RTS_UI32)value;
    *text = end;
    return true;
}

static bool parse_ip(const char **text, RTS_UI32 *ip)
{
    char host[WIDEST_TEXT];
    struct in_addr parsed;
    size_t length = strspn(*text, "0123456789.");
    if (length >= sizeof(host)) {
        return false;
    }
    memcpy(host, *text, length);
    host[length] = '\0';
    bool known = inet_pton(AF_INET, host, &parsed) == 1;
    *ip = known ? ntohl(parsed.s_addr) : 0;
    *text += length;
    return known;
}

/* ":PORT" or ":FIRST-LAST" */
static bool parse_ports(const char **text, RULE *rule)
{
    ++*text;
    if (!parse_number(text, UINT16_MAX, &rule->first_port)) {
        return false;
    }
    rule->last_port = rule->first_port;
    if (**text != '-') {
        return true;
    }
    ++*text;
    return parse_number(text, UINT16_MAX, &rule->last_port) && rule->last_port >= rule->first_port;
}

/* "ADDRESS[/BITS][:PORT[-PORT]]" */
static bool parse_rule(const char **text, RULE *rule)
{
    RTS_UI32 bits = IP_BITS;
    *rule = (RULE){.last_port = UINT16_MAX};
    if (!parse_ip(text, &rule->ip)) {
        return false;
    }
    if (**text == '/') {
        ++*text;
        if (!parse_number(text, IP_BITS, &bits)) {
            return false;
        }
    }
    rule->mask = bits == 0 ? 0 : UINT32_MAX << (IP_BITS - bits);
    return **text != ':' || parse_ports(text, rule);
}

bool PortNetAllow(const char *text)
{
    allowed.count = 0; /* those of the command line replace those of --config */
    do {
        if (allowed.count == RULES || !parse_rule(&text, &allowed.rule[allowed.count])) {
            return false;
        }
        allowed.count++;
    } while (*text++ == ',');
    return text[-1] == '\0';
}

static bool fits(const RULE *rule, const SOCKADDRESS *peer)
{
    bool is_port = peer->port == 0 || (peer->port >= rule->first_port && peer->port <= rule->last_port);
    return is_port && ((rule->ip ^ peer->ip) & rule->mask) == 0;
}

bool SysNetMayReach(const SOCKADDRESS *peer)
{
    bool may = allowed.count == 0 && fits(&this_machine, peer);
    for (RTS_UI32 i = 0; i < allowed.count && !may; i++) {
        may = fits(&allowed.rule[i], peer);
    }
    return may;
}

/* ---- sockets ---- */

static RTS_RESULT connect_to(const SOCKADDRESS *peer, RTS_HANDLE *socket)
{
    *socket = SysSockConnect(peer);
    return *socket != RTS_INVALID_HANDLE ? ERR_OK : ERR_DEVICE;
}

static RTS_RESULT open_as(SYSNET_KIND kind, const SOCKADDRESS *address, RTS_HANDLE *socket)
{
    switch (kind) {
    case SYSNET_UDP:
        return PortSockBind(address, socket);
    case SYSNET_LISTENER:
        return SysSockListen(address, socket);
    default:
        return connect_to(address, socket);
    }
}

RTS_RESULT SysNetOpen(SYSNET_KIND kind, const SOCKADDRESS *address, RTS_HANDLE *socket)
{
    RTS_RESULT result = open_as(kind, address, socket);
    if (result == ERR_OK) {
        PortSockQuiet(*socket);
    }
    return result;
}

RTS_RESULT SysNetAccept(RTS_HANDLE listener, SOCKADDRESS *peer, RTS_HANDLE *socket)
{
    *socket = SysSockAccept(listener, peer);
    if (*socket == RTS_INVALID_HANDLE) {
        return ERR_NOTHING_TO_DO;
    }
    PortSockQuiet(*socket);
    return ERR_OK;
}

RTS_RESULT SysNetGetConnected(RTS_HANDLE socket)
{
    return SysSockGetConnected(socket);
}

RTS_RESULT SysNetRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received)
{
    return SysSockRecv(socket, data, size, received);
}

RTS_RESULT SysNetSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken)
{
    return SysSockSend(socket, data, size, taken);
}

RTS_RESULT SysNetRecvFrom(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received)
{
    return SysSockRecvFrom(socket, data, size, from, received);
}

RTS_RESULT SysNetSendTo(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, const SOCKADDRESS *to)
{
    return SysSockSendTo(socket, data, size, to);
}

RTS_RESULT SysNetPeek(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, SOCKADDRESS *from, RTS_UI32 *received)
{
    return PortSockPeek(socket, data, size, from, received);
}

RTS_UI32 SysNetPoll(RTS_HANDLE socket, RTS_UI32 *waiting)
{
    short events = PortSockPoll(socket, waiting);
    if ((events & POLLERR) != 0) {
        return SYSNET_FAILED;
    }
    RTS_UI32 readable = (events & (POLLIN | POLLHUP)) != 0 ? SYSNET_READABLE : 0;
    return readable | ((events & POLLOUT) != 0 ? SYSNET_WRITABLE : 0);
}

void SysNetClose(RTS_HANDLE socket)
{
    SysSockClose(socket);
}
