/*
 * test_iec_socket.c - the sockets of a program, by the function that its blocks call: what a bad program asks for.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpAppCalls.h"
#include "CmpAppEmbedded.h"
#include "IecSocket.h"
#include "Sim.h"
#include "app_image.h"
#include "test.h"

enum { LOOPBACK = 0x7F000001, TOO_MANY = IEC_SOCKET_TOO_MANY };

static RTS_UI32 result;

static RTS_I32 function(const char *name, RTS_UI32 a, RTS_UI32 b, RTS_UI32 c)
{
    return ((RTS_I32(*)(RTS_UI32, RTS_UI32, RTS_UI32))CMFindExternal(name)->function)(a, b, c);
}

/* True if the call ended well; `result` is that of the call or its error, 0: it did not end. */
static bool call(RTS_UI32 operation, RTS_UI32 port, RTS_UI32 handle, RTS_UI32 value, RTS_UI32 size)
{
    RTS_I32 number = function("socket_call", operation | port << 16, handle, value);
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

static void setup(void)
{
    static APP_BYTES image;

    CHECK_EQUAL(SimFlashConfigure(64 * 1024, 1024, 8, 0xFF), ERR_OK);
    CHECK_EQUAL(SimStart(), ERR_OK);
    build_counter(&image, 1);
    CHECK_EQUAL(download(&image), ERR_OK);
    CHECK_EQUAL(AppStartApplication(), ERR_OK);
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
    for (RTS_UI32 operation = 0; operation < 16; operation++) {
        for (RTS_UI32 i = 0; i < RTS_COUNT(odd) * 2; i++) {
            RTS_UI32 handle = i % 2 == 0 ? odd[i / 2] : udp;
            if (operation == IEC_SOCKET_CLOSE && handle == udp)
                continue;
            for (RTS_UI32 size = 0; size <= APP_CALL_DATA; size += APP_CALL_DATA / 2)
                CHECK(call(operation, odd[i / 2] & 0xFFFF, handle, odd[i / 2], size) || result != 0);
        }
    }
    CHECK(call(IEC_SOCKET_CLOSE, 0, udp, 0, 0));
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
    RUN(packets_that_are_none_are_refused);
    return test_result();
}
