/*
 * test_linux_host_names.c - SysSockConnectName: names are looked up beside main, each of several addresses is tried, and
 * the reason is known when there is none. The test is the C library's resolver.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#define _GNU_SOURCE
#include "SysSocket.h"

#include "SysTime.h"
#include "port.h"
#include "rts_config.h"
#include "test.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <netinet/in.h>
#include <semaphore.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { WAIT_MS = 20000, ADDRESSES = 2 };

/* What the resolver says. */
static struct {
    int error;
    struct sockaddr_storage address[ADDRESSES];
    RTS_UI32 count;
    bool waits;
    char asked[SYSSOCK_MAX_NAME + 1];
} resolver;
static sem_t may_reply;
static sem_t has_begun;
static sem_t has_ended; /* all of what a test has asked, before the next one begins */

int __wrap_getaddrinfo(const char *host, const char *service, const struct addrinfo *hints, struct addrinfo **found);
int __wrap_getaddrinfo(const char *host, const char *service, const struct addrinfo *hints, struct addrinfo **found)
{
    static struct addrinfo all[ADDRESSES];

    RTS_UNUSED(service);
    memcpy(resolver.asked, host, strlen(host) + 1);
    (void)sem_post(&has_begun);
    if (resolver.waits)
        (void)sem_wait(&may_reply);
    for (RTS_UI32 i = 0; i < resolver.count; i++) {
        all[i] = (struct addrinfo){.ai_family = resolver.address[i].ss_family,
                                   .ai_socktype = hints->ai_socktype,
                                   .ai_addr = (struct sockaddr *)&resolver.address[i],
                                   .ai_addrlen = resolver.address[i].ss_family == AF_INET6 ? sizeof(struct sockaddr_in6)
                                                                                           : sizeof(struct sockaddr_in),
                                   .ai_next = i + 1 < resolver.count ? &all[i + 1] : NULL};
    }
    *found = resolver.count != 0 ? all : NULL;
    int error = resolver.error;
    (void)sem_post(&has_ended);
    return error;
}

void __wrap_freeaddrinfo(struct addrinfo *found);
void __wrap_freeaddrinfo(struct addrinfo *found)
{
    RTS_UNUSED(found);
}

static void begin(void)
{
    memset(&resolver, 0, sizeof(resolver));
    while (sem_trywait(&has_begun) == 0)
        (void)sem_wait(&has_ended);
}

static void add(RTS_UI32 ip)
{
    struct sockaddr_in *address = (struct sockaddr_in *)&resolver.address[resolver.count++];

    address->sin_family = AF_INET;
    address->sin_addr.s_addr = htonl(ip);
}

static void add_ip6(void)
{
    struct sockaddr_in6 *address = (struct sockaddr_in6 *)&resolver.address[resolver.count++];

    address->sin6_family = AF_INET6;
    address->sin6_addr = in6addr_loopback;
}

/* Listens at 127.0.0.1. */
static int listen_at(RTS_UI16 *port)
{
    struct sockaddr_in own = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof(own);
    int file = socket(AF_INET, SOCK_STREAM, 0);

    CHECK_EQUAL(bind(file, (struct sockaddr *)&own, size), 0);
    CHECK_EQUAL(listen(file, 1), 0);
    CHECK_EQUAL(getsockname(file, (struct sockaddr *)&own, &size), 0);
    *port = ntohs(own.sin_port);
    return file;
}

static RTS_RESULT await(RTS_HANDLE socket)
{
    RTS_I64 deadline = SysTimeGetNs() + WAIT_MS * (RTS_I64)1000000;
    RTS_RESULT result;

    do {
        (void)PortWait(1);
        result = SysSockGetConnected(socket);
    } while ((result == ERR_PENDING || result == ERR_NOT_READY_YET) && SysTimeGetNs() < deadline);
    return result;
}

static void check_connects(int listener, RTS_UI16 port)
{
    RTS_HANDLE socket = SysSockConnectName("meter.plant", port);
    RTS_UI8 byte = 7;
    RTS_UI32 taken;

    CHECK(socket != RTS_INVALID_HANDLE);
    CHECK_EQUAL(await(socket), ERR_OK);
    CHECK_EQUAL(SysSockGetConnected(socket), ERR_OK);
    CHECK(strcmp(resolver.asked, "meter.plant") == 0);
    int peer = accept(listener, NULL, NULL);
    CHECK(peer >= 0);
    CHECK_EQUAL(SysSockSend(socket, &byte, 1, &taken), ERR_OK);
    byte = 0;
    CHECK_EQUAL(read(peer, &byte, 1), 1);
    CHECK_EQUAL(byte, 7);
    SysSockClose(socket);
    close(peer);
}

static void a_host_is_connected_to_by_its_name(void)
{
    RTS_UI16 port;
    int listener = listen_at(&port);

    begin();
    add(INADDR_LOOPBACK);
    check_connects(listener, port);
    close(listener);
}

static void an_address_that_refuses_is_followed_by_the_next_one(void)
{
    RTS_UI16 port;
    int listener = listen_at(&port);

    begin();
    add(0x7F000009);
    add(INADDR_LOOPBACK);
    check_connects(listener, port);
    begin();
    add_ip6(); /* refused, or without IPv6 no way there */
    add(INADDR_LOOPBACK);
    check_connects(listener, port);
    close(listener);
}

static void the_reason_for_no_connection_is_known(void)
{
    static const struct {
        int error;
        RTS_RESULT result;
    } cases[] = {{EAI_NONAME, ERR_NO_OBJECT},
                 {EAI_NODATA, ERR_NO_OBJECT},
                 {EAI_AGAIN, ERR_TIMEOUT},
                 {EAI_FAIL, ERR_TIMEOUT},
                 {0, ERR_NO_OBJECT /* no address */}};

    for (RTS_UI32 i = 0; i < RTS_COUNT(cases); i++) {
        begin();
        resolver.error = cases[i].error;
        RTS_HANDLE socket = SysSockConnectName("meter.plant", 502);
        CHECK(socket != RTS_INVALID_HANDLE);
        CHECK_EQUAL(await(socket), cases[i].result);
        SysSockReset(socket);
    }
    RTS_UI16 port;
    close(listen_at(&port));
    begin();
    add(INADDR_LOOPBACK);
    RTS_HANDLE socket = SysSockConnectName("meter.plant", port);
    CHECK_EQUAL(await(socket), ERR_NET_NOTCONNECTED);
    SysSockReset(socket);
}

static void main_goes_on_while_a_name_server_is_silent(void)
{
    begin();
    resolver.waits = true;
    add(INADDR_LOOPBACK);
    RTS_HANDLE socket = SysSockConnectName("meter.plant", 502);
    CHECK_EQUAL(sem_wait(&has_begun), 0);
    (void)sem_post(&has_begun);
    for (int i = 0; i < 3; i++)
        CHECK_EQUAL(SysSockGetConnected(socket), ERR_NOT_READY_YET);
    SysSockReset(socket); /* the answer comes when it is not wanted any more */
    (void)sem_post(&may_reply);
}

/* Each that is given up is still being asked for: there is room for some, then none, and all of it in the end. */
static void questions_that_are_given_up_take_room_only_until_they_are_answered(void)
{
    enum { MANY = 1000 };
    int count = 0;
    RTS_HANDLE socket;
    RTS_I64 deadline = SysTimeGetNs() + WAIT_MS * (RTS_I64)1000000;

    begin();
    resolver.waits = true;
    while (count < MANY && (socket = SysSockConnectName("meter.plant", 502)) != RTS_INVALID_HANDLE) {
        SysSockReset(socket);
        count++;
    }
    CHECK(count >= MODBUS_MAX_CLIENTS && count < MANY);
    for (int i = 0; i < count; i++)
        (void)sem_post(&may_reply);
    for (int i = 0; i < count; i++)
        (void)sem_wait(&has_ended);
    for (int i = 0; i < count; i++)
        (void)sem_wait(&has_begun);
    resolver.waits = false;
    do {
        (void)PortWait(1);
        socket = SysSockConnectName("meter.plant", 502);
    } while (socket == RTS_INVALID_HANDLE && SysTimeGetNs() < deadline);
    CHECK(socket != RTS_INVALID_HANDLE);
    CHECK_EQUAL(await(socket), ERR_NO_OBJECT);
    SysSockReset(socket);
}

static void a_name_that_is_too_long_has_no_way_there(void)
{
    char name[SYSSOCK_MAX_NAME + 2];

    begin();
    memset(name, 'a', sizeof(name) - 1);
    name[sizeof(name) - 1] = '\0';
    CHECK_EQUAL(SysSockConnectName(name, 502), RTS_INVALID_HANDLE);
    name[SYSSOCK_MAX_NAME] = '\0';
    RTS_HANDLE socket = SysSockConnectName(name, 502);
    CHECK_EQUAL(await(socket), ERR_NO_OBJECT);
    CHECK(strcmp(resolver.asked, name) == 0);
    SysSockReset(socket);
}

int main(void)
{
    CHECK_EQUAL(sem_init(&may_reply, 0, 0), 0);
    CHECK_EQUAL(sem_init(&has_begun, 0, 0), 0);
    CHECK_EQUAL(sem_init(&has_ended, 0, 0), 0);
    RUN(a_host_is_connected_to_by_its_name);
    RUN(an_address_that_refuses_is_followed_by_the_next_one);
    RUN(the_reason_for_no_connection_is_known);
    RUN(main_goes_on_while_a_name_server_is_silent);
    RUN(questions_that_are_given_up_take_room_only_until_they_are_answered);
    RUN(a_name_that_is_too_long_has_no_way_there);
    return test_result();
}
