/*
 * test_iec_socket.c - sockets and serial ports of a program, by the functions that its blocks call: what a bad program
 * asks for.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpAppCalls.h"
#include "CmpAppEmbedded.h"
#include "IecCom.h"
#include "IecSocket.h"
#include "Sim.h"
#include "SysNet.h"
#include "app_image.h"
#include "test.h"

enum { LOOPBACK = 0x7F000001, TOO_MANY = IEC_SOCKET_TOO_MANY };

static RTS_UI32 result;

static RTS_I32 function(const char *name, RTS_UI32 a, RTS_UI32 b, RTS_UI32 c)
{
    return ((RTS_I32(*)(RTS_UI32, RTS_UI32, RTS_UI32))CMFindExternal(name)->function)(a, b, c);
}

/* True if the call ended well; `result` is that of the call or its error, 0: it did not end. */
static bool carry_out(RTS_I32 number, RTS_UI32 size)
{
    RTS_I32 state = 0;

    CHECK(number > 0);
    CHECK(function("call_send", (RTS_UI32)number, size, 0) != 0);
    for (int i = 0; i < 10 && state == 0; i++) {
        (void)SimCommCycle();
        state = function("call_state", (RTS_UI32)number, 0, 0);
    }
    result = state == 1 ? (RTS_UI32)function("call_result", (RTS_UI32)number, 0, 0) : (RTS_UI32)-state;
    (void)function("call_free", (RTS_UI32)number, 0, 0);
    return state == 1;
}

static bool call(RTS_UI32 operation, RTS_UI32 port, RTS_UI32 handle, RTS_UI32 value, RTS_UI32 size)
{
    return carry_out(function("socket_call", operation | port << 16, handle, value), size);
}

static bool call_com(RTS_UI32 operation, RTS_UI32 handle, RTS_UI32 value)
{
    return carry_out(function("com_call", operation, handle, value), 0);
}

static void setup(void)
{
    static APP_BYTES image;

    CHECK_EQUAL(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    build_counter(&image, 1);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
}

/* A call whose result no block fetches. */
static void abandon_call(RTS_I32 number)
{
    CHECK(function("call_send", (RTS_UI32)number, 3, 0) != 0);
    (void)SimCommCycle();
    CHECK_EQUAL(SimAdvance(61000000000), ERR_OK);
    (void)SimCommCycle();
    CHECK_EQUAL(function("call_state", (RTS_UI32)number, 0, 0), -1);
}

static void abandon(RTS_UI32 operation, RTS_UI32 port, RTS_UI32 handle, RTS_UI32 value)
{
    abandon_call(function("socket_call", operation | port << 16, handle, value));
}

static RTS_UI32 poll_socket(RTS_UI32 handle)
{
    return call(IEC_SOCKET_POLL, 0, handle, 0, 0) ? result : SYSNET_FAILED;
}

static RTS_UI32 create(RTS_UI32 type)
{
    CHECK(call(IEC_SOCKET_CREATE, 0, 0, type, 0));
    return result;
}

/* ---- tests ---- */

static int open_many(RTS_UI32 operation, int count)
{
    int opened = 0;

    for (int i = 0; i < count; i++) {
        bool is_open = call(operation, 0, 0, 0, 0);
        opened += is_open;
        CHECK(is_open || result == TOO_MANY);
    }
    return opened;
}

static void ten_thousand_opens_are_refused_past_the_limit_and_leak_nothing(void)
{
    setup();
    CHECK_EQUAL(open_many(IEC_SOCKET_UDP_OPEN, 10000), IEC_SOCKETS);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(open_many(IEC_SOCKET_TCP_LISTEN, 100), IEC_SOCKETS);
    CHECK_EQUAL(AppStopApplication(), ERR_OK);
    (void)SimCommCycle();
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
    CHECK_EQUAL(open_many(IEC_SOCKET_UDP_OPEN, 100), IEC_SOCKETS);
    setup(); /* a download */
    CHECK_EQUAL(open_many(IEC_SOCKET_UDP_OPEN, 100), IEC_SOCKETS);
}

static void connections_that_no_program_accepts_are_refused_past_the_limit(void)
{
    setup();
    CHECK(call(IEC_SOCKET_TCP_LISTEN, 502, 0, 0, 0));
    RTS_UI32 listener = result;
    for (int turn = 0; turn < 100; turn++) {
        CHECK(call(IEC_SOCKET_TCP_CONNECT, 502, 0, LOOPBACK, 0));
        RTS_UI32 client = result;
        CHECK(call(IEC_SOCKET_STATE, 0, client, 0, 0) ? result == 1 : result == IEC_SOCKET_TCP_CONNECT_ERROR);
        CHECK(call(IEC_SOCKET_CLOSE, 0, client, 0, 0) || result == IEC_SOCKET_INVALID_HANDLE);
    }
    CHECK(call(IEC_SOCKET_ACCEPT, 0, listener, 0, 0) && result > 0);
    CHECK(!call(IEC_SOCKET_READ, 0, result, 10, 0) && result == IEC_SOCKET_NO_CONNECTION);
    CHECK(call(IEC_SOCKET_CLOSE, 0, listener, 0, 0));
    CHECK(!call(IEC_SOCKET_CLOSE, 0, listener, 0, 0) && result == IEC_SOCKET_INVALID_HANDLE);
}

static void a_handle_of_another_kind_or_of_a_socket_that_was_closed_is_refused(void)
{
    setup();
    CHECK(call(IEC_SOCKET_UDP_OPEN, 77, 0, 0, 0));
    RTS_UI32 udp = result;
    CHECK(!call(IEC_SOCKET_UDP_OPEN, 77, 0, 0, 0) && result == IEC_SOCKET_UDP_OPEN_ERROR);
    CHECK(!call(IEC_SOCKET_READ, 0, udp, 10, 0) && result == IEC_SOCKET_INVALID_HANDLE);
    CHECK(!call(IEC_SOCKET_ACCEPT, 0, udp, 0, 0) && result == IEC_SOCKET_INVALID_HANDLE);
    CHECK(call(IEC_SOCKET_CLOSE, 0, udp, 0, 0));
    CHECK(!call(IEC_SOCKET_RECEIVE, 0, udp, 10, 0) && result == IEC_SOCKET_INVALID_HANDLE);
    CHECK(call(IEC_SOCKET_UDP_OPEN, 77, 0, 0, 0) && result != udp);
    CHECK(!call(IEC_SOCKET_RECEIVE, 0, udp, 10, 0) && result == IEC_SOCKET_INVALID_HANDLE);
}

static void every_operation_with_every_odd_argument_ends(void)
{
    static const RTS_UI32 odd[] = {0, 1, 2, 255, 256, 257, 0x7FFFFFFF, 0x80000000, UINT32_MAX};

    setup();
    CHECK(call(IEC_SOCKET_UDP_OPEN, 77, 0, 0, 0));
    RTS_UI32 udp = result;
    for (RTS_UI32 operation = 0; operation < 24; operation++) {
        for (RTS_UI32 i = 0; i < RTS_COUNT(odd) * 2; i++) {
            RTS_UI32 handle = i % 2 == 0 ? odd[i / 2] : udp;
            if ((operation == IEC_SOCKET_CLOSE || operation >= IEC_SOCKET_SHUTDOWN) && handle == udp)
                continue;
            for (RTS_UI32 size = 0; size <= APP_CALL_DATA; size += APP_CALL_DATA / 2)
                CHECK(call(operation, odd[i / 2] & 0xFFFF, handle, odd[i / 2], size) || result != 0);
        }
    }
    CHECK(call(IEC_SOCKET_CLOSE, 0, udp, 0, 0));
}

static void a_socket_whose_open_is_not_fetched_is_closed_after_a_minute(void)
{
    setup();
    abandon(IEC_SOCKET_UDP_OPEN, 77, 0, 0);
    abandon(IEC_SOCKET_TCP_LISTEN, 77, 0, 0);
    abandon(IEC_SOCKET_CREATE, 0, 0, IEC_SOCKET_STREAM);
    CHECK(call(IEC_SOCKET_UDP_OPEN, 77, 0, 0, 0)); /* the port is free again */
    CHECK(call(IEC_SOCKET_TCP_LISTEN, 77, 0, 0, 0));
    CHECK_EQUAL(open_many(IEC_SOCKET_UDP_OPEN, 100), IEC_SOCKETS - 2);
}

static void data_whose_result_is_not_fetched_are_sent_once(void)
{
    static SIM_NET_PACKET packet;

    setup();
    CHECK(call(IEC_SOCKET_UDP_OPEN, 77, 0, 0, 0));
    abandon(IEC_SOCKET_SEND_TO, 5, result, 0x0A000001);
    CHECK_EQUAL(SimNetGet(&packet), ERR_OK);
    CHECK_EQUAL(packet.size, 3);
    CHECK_EQUAL(SimNetGet(&packet), ERR_NOTHING_TO_DO);
}

static void ten_thousand_opens_of_serial_ports_are_refused_past_the_limit(void)
{
    int opened = 0;

    setup();
    for (RTS_UI32 i = 0; i < 10000; i++)
        opened += call_com(IEC_COM_OPEN, i % (IEC_COMS + 3), 9600);
    CHECK_EQUAL(opened, IEC_COMS);
    CHECK(!call_com(IEC_COM_OPEN, 1, 9600) && result == IEC_COM_IN_USE);
    CHECK_EQUAL(AppReset(RESET_OPTION_WARM), ERR_OK);
    CHECK(call_com(IEC_COM_OPEN, 1, 9600));
}

static void a_serial_port_whose_open_is_not_fetched_is_closed_after_a_minute(void)
{
    setup();
    abandon_call(function("com_call", IEC_COM_OPEN, 1, 9600));
    CHECK(call_com(IEC_COM_OPEN, 1, 9600));
    RTS_UI32 com = result;
    CHECK(!call_com(IEC_COM_SETTINGS, com, 0) && result == IEC_COM_WRONG_PARAMETER);
    CHECK(!call_com(IEC_COM_READ, com, 10) && result == IEC_COM_WRONG_HANDLE);
    CHECK(call_com(IEC_COM_SETTINGS, com, 19200) && call_com(IEC_COM_READ, com, 10));
    CHECK(call_com(IEC_COM_CLOSE, com, 0));
    CHECK(!call_com(IEC_COM_SETTINGS, com, 19200) && result == IEC_COM_WRONG_HANDLE);
}

static void sockets_are_created_bound_and_connected_step_by_step(void)
{
    setup();
    RTS_UI32 server = create(IEC_SOCKET_STREAM);
    RTS_UI32 client = create(IEC_SOCKET_STREAM);
    CHECK_EQUAL(poll_socket(client), 0);
    CHECK(call(IEC_SOCKET_BIND, 502, server, 0, 0) && call(IEC_SOCKET_LISTEN, 0, server, 0, 0));
    CHECK_EQUAL(poll_socket(server), 0);
    CHECK(call(IEC_SOCKET_CONNECT, 502, client, LOOPBACK, 0));
    CHECK(!call(IEC_SOCKET_CONNECT, 502, client, LOOPBACK, 0) && result == IEC_SOCKET_IS_CONNECTED);
    CHECK_EQUAL(poll_socket(server), SYSNET_READABLE);
    CHECK(call(IEC_SOCKET_ACCEPT, 0, server, 0, 0) && result > 0);
    RTS_UI32 accepted = result;
    CHECK(call(IEC_SOCKET_WRITE, 0, accepted, 0, 5) && result == 5);
    CHECK_EQUAL(poll_socket(client), SYSNET_READABLE | SYSNET_WRITABLE | 5 << IEC_SOCKET_WAITING);
    CHECK(call(IEC_SOCKET_SHUTDOWN, 0, accepted, 0, 0));
    CHECK(!call(IEC_SOCKET_WRITE, 0, accepted, 0, 5) && result == IEC_SOCKET_SHUT);
    CHECK(!call(IEC_SOCKET_BIND, 5, accepted, 0, 5) && result == IEC_SOCKET_SHUT);
    CHECK(call(IEC_SOCKET_READ, 0, client, 9, 0) && result == 5);
    CHECK_EQUAL(poll_socket(client), SYSNET_READABLE); /* the end */
    CHECK(call(IEC_SOCKET_CLOSE, 0, accepted, 0, 0) && call(IEC_SOCKET_CLOSE, 0, client, 0, 0));

    RTS_UI32 refused = create(IEC_SOCKET_STREAM);
    CHECK(call(IEC_SOCKET_CONNECT, 9, refused, LOOPBACK, 0));
    CHECK_EQUAL(poll_socket(refused), SYSNET_FAILED);
    CHECK(!call(IEC_SOCKET_LISTEN, 0, refused, 0, 0) && result == IEC_SOCKET_WRONG_PARAMETER);
    RTS_UI32 udp = create(IEC_SOCKET_DATAGRAM);
    CHECK(!call(IEC_SOCKET_CONNECT, 9, udp, LOOPBACK, 0) && result == IEC_SOCKET_WRONG_PARAMETER);
    CHECK(call(IEC_SOCKET_SEND_TO, 9, udp, LOOPBACK, 3)); /* from a port that is free */
    CHECK_EQUAL(poll_socket(udp), SYSNET_WRITABLE);
    CHECK(!call(IEC_SOCKET_CREATE, 0, 0, 3, 0) && result == IEC_SOCKET_WRONG_PARAMETER);
}

static void packets_that_are_none_are_refused(void)
{
    static SIM_NET_PACKET packet;

    setup();
    for (RTS_UI32 kind = 0; kind < 10; kind++) {
        packet = (SIM_NET_PACKET){.kind = kind, .from_ip = 1, .to_ip = LOOPBACK, .to_port = 5, .from_port = 5};
        CHECK_EQUAL(SimNetPut(&packet), kind <= SIM_NET_END ? ERR_OK : ERR_PARAMETER);
        packet.size = SIM_NET_DATA + 1;
        CHECK_EQUAL(SimNetPut(&packet), ERR_PARAMETER);
        packet = (SIM_NET_PACKET){.kind = kind, .to_port = 65536, .from_port = 1};
        CHECK_EQUAL(SimNetPut(&packet), ERR_PARAMETER);
    }
}

int main(void)
{
    NEEDS_X86_64;
    RUN(ten_thousand_opens_are_refused_past_the_limit_and_leak_nothing);
    RUN(connections_that_no_program_accepts_are_refused_past_the_limit);
    RUN(a_handle_of_another_kind_or_of_a_socket_that_was_closed_is_refused);
    RUN(every_operation_with_every_odd_argument_ends);
    RUN(a_socket_whose_open_is_not_fetched_is_closed_after_a_minute);
    RUN(data_whose_result_is_not_fetched_are_sent_once);
    RUN(ten_thousand_opens_of_serial_ports_are_refused_past_the_limit);
    RUN(a_serial_port_whose_open_is_not_fetched_is_closed_after_a_minute);
    RUN(sockets_are_created_bound_and_connected_step_by_step);
    RUN(packets_that_are_none_are_refused);
    return test_result();
}
