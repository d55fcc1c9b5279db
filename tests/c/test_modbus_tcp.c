/*
 * test_modbus_tcp.c - Modbus servers on TCP: frames in pieces, bad frames, floods, and one client more than there is
 * room for.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusPdu.h"
#include "ModbusServerTcp.h"
#include "modbus_fakes.h"
#include "rts_config.h"
#include "test.h"

enum { MS = 1000000, UNIT = 3, REPLY_SIZE = 13 };

static RTS_UI8 registers[20];
static const MODBUS_RANGE range = {MODBUS_HOLDING_REGISTERS, MODBUS_RANGE_WRITABLE, 0, 0, 1, 160};
static const MODBUS_MEMORY memory = {&range, registers};
static const RTS_UI8 read_two[] = {3, 0, 0, 0, 2};
static MODBUS_SERVER server;

static void run_ms(RTS_UI32 ms)
{
    for (RTS_UI32 i = 0; i < ms; i++, fakes.now_ns += MS)
        ModbusServerTcpPoll(fakes.now_ns);
}

static void begin(void)
{
    const SOCKADDRESS own = {0, 502};

    ModbusServerTcpClose();
    fakes_begin();
    memset(&server, 0, sizeof(server));
    server.tcp = true;
    server.unit = 0;
    server.memory = &memory;
    server.range_count = 1;
    CHECK_EQUAL(ModbusServerTcpOpen(&server, &own), ERR_OK);
    run_ms(2);
}

static bool has_reply(FAKE_SOCKET *socket, RTS_UI16 transaction, RTS_UI8 unit)
{
    bool good = socket->out_size == REPLY_SIZE && ModbusGet16(socket->out) == transaction &&
                ModbusGet16(socket->out + 2) == 0 && ModbusGet16(socket->out + 4) == 7 && socket->out[6] == unit &&
                socket->out[7] == 3 && socket->out[8] == 4;
    socket->out_size = 0;
    return good;
}

static bool works(FAKE_SOCKET *socket)
{
    net_put_pdu(socket, 0x1234, UNIT, read_two, sizeof(read_two));
    run_ms(3);
    return has_reply(socket, 0x1234, UNIT);
}

static void a_request_is_replied_to(void)
{
    begin();
    CHECK(works(net_dial()));
}

static void a_frame_may_come_in_pieces(void)
{
    FAKE_SOCKET *socket;
    RTS_UI8 frame[12];

    begin();
    socket = net_dial();
    net_put_pdu(socket, 9, UNIT, read_two, sizeof(read_two));
    memcpy(frame, socket->in, sizeof(frame));
    socket->in_size = 0;
    for (RTS_UI32 i = 0; i < sizeof(frame); i++) {
        CHECK_EQUAL(socket->out_size, 0);
        net_put(socket, frame + i, 1);
        run_ms(2);
    }
    CHECK(has_reply(socket, 9, UNIT));
}

static void several_frames_may_come_at_once(void)
{
    FAKE_SOCKET *socket;

    begin();
    socket = net_dial();
    for (RTS_UI16 i = 0; i < 20; i++)
        net_put_pdu(socket, i, UNIT, read_two, sizeof(read_two));
    run_ms(30);
    CHECK_EQUAL(socket->out_size, 20 * REPLY_SIZE);
    for (RTS_UI32 i = 0; i < 20; i++)
        CHECK_EQUAL(ModbusGet16(socket->out + i * REPLY_SIZE), i);
}

static void a_flood_holds_up_no_other(void)
{
    FAKE_SOCKET *flood;
    FAKE_SOCKET *other;

    begin();
    flood = net_dial();
    other = net_dial();
    for (RTS_UI16 i = 0; i < 300; i++)
        net_put_pdu(flood, i, UNIT, read_two, sizeof(read_two));
    CHECK(works(other));
    CHECK(flood->in_size > 0);
    flood->out_size = FAKE_SOCKET_ROOM; /* it does not read its replies: nothing more is read of it */
    run_ms(10);
    CHECK(flood->in_size > 0);
    CHECK(works(other));
}

static void replies_wait_for_room(void)
{
    FAKE_SOCKET *socket;

    begin();
    socket = net_dial();
    fakes.send_limit = 3;
    net_put_pdu(socket, 1, UNIT, read_two, sizeof(read_two));
    run_ms(10);
    CHECK(has_reply(socket, 1, UNIT));
}

/* It sends requests, and its side of the connection is full of replies. */
static FAKE_SOCKET *dial_without_reading(void)
{
    FAKE_SOCKET *socket = net_dial();

    for (RTS_UI16 i = 0; i < 20; i++)
        net_put_pdu(socket, i, UNIT, read_two, sizeof(read_two));
    socket->out_size = FAKE_SOCKET_ROOM;
    return socket;
}

static void a_client_that_reads_nothing_for_seconds_is_dropped(void)
{
    FAKE_SOCKET *deaf;
    FAKE_SOCKET *other;

    begin();
    deaf = dial_without_reading();
    other = net_dial();
    run_ms(4900);
    CHECK(deaf->open);
    run_ms(200);
    CHECK(!deaf->open);
    CHECK_EQUAL(deaf->out_size, 0); /* it was reset: the system keeps nothing for it */
    CHECK(works(other));
}

static void a_client_that_reads_slowly_stays(void)
{
    FAKE_SOCKET *slow;

    begin();
    slow = dial_without_reading();
    for (RTS_UI32 i = 0; i < 2 * REPLY_SIZE; i++) {
        run_ms(4900);
        CHECK(slow->open);
        slow->out_size--;
    }
}

/* What a header with these words does: the connection is closed, and counted. */
static void check_bad_header(RTS_UI16 protocol, RTS_UI16 length)
{
    RTS_UI8 header[7] = {0, 1};
    FAKE_SOCKET *socket;

    begin();
    socket = net_dial();
    ModbusPut16(header + 2, protocol);
    ModbusPut16(header + 4, length);
    net_put(socket, header, sizeof(header));
    run_ms(3);
    CHECK(!socket->open);
    CHECK_EQUAL(ModbusServerTcpGetCounters()->bad_frames, 1);
    CHECK(works(net_dial()));
}

static void what_is_no_frame_ends_the_connection(void)
{
    check_bad_header(1, 6);
    check_bad_header(0, 0);
    check_bad_header(0, 1);
    check_bad_header(0, 255);
    check_bad_header(0, 65535);
}

static void half_a_frame_and_its_end(void)
{
    FAKE_SOCKET *socket;

    begin();
    socket = net_dial();
    net_put_pdu(socket, 9, UNIT, read_two, sizeof(read_two));
    socket->in_size -= 3;
    socket->peer_gone = true;
    run_ms(3);
    CHECK(!socket->open);
    CHECK(works(net_dial()));
}

static void one_client_more_replaces_the_idlest(void)
{
    FAKE_SOCKET *sockets[MODBUS_MAX_CONNECTIONS];
    FAKE_SOCKET *more;

    begin();
    for (RTS_UI32 i = 0; i < MODBUS_MAX_CONNECTIONS; i++) {
        sockets[i] = net_dial();
        run_ms(5);
    }
    for (RTS_UI32 i = 0; i < MODBUS_MAX_CONNECTIONS; i++) {
        if (i != 2)
            CHECK(works(sockets[i]));
    }
    more = net_dial();
    CHECK(works(more));
    CHECK(!sockets[2]->open);
    CHECK_EQUAL(ModbusServerTcpGetCounters()->displaced, 1);
    CHECK_EQUAL(ModbusServerTcpGetCounters()->accepted, MODBUS_MAX_CONNECTIONS + 1);
    for (RTS_UI32 i = 0; i < MODBUS_MAX_CONNECTIONS; i++) {
        if (i != 2)
            CHECK(works(sockets[i]));
    }
}

static void units_of_others_are_not_there(void)
{
    FAKE_SOCKET *socket;
    static const RTS_UI8 own[] = {UNIT, 0, 255};

    begin();
    server.unit = UNIT;
    socket = net_dial();
    for (RTS_UI32 i = 0; i < sizeof(own); i++) {
        net_put_pdu(socket, 1, own[i], read_two, sizeof(read_two));
        run_ms(3);
        CHECK(has_reply(socket, 1, own[i]));
    }
    net_put_pdu(socket, 1, UNIT + 1, read_two, sizeof(read_two));
    run_ms(3);
    CHECK_EQUAL(socket->out_size, 9);
    CHECK_EQUAL(socket->out[7], 0x83);
    CHECK_EQUAL(socket->out[8], MODBUS_NO_TARGET);
}

static void a_port_that_is_in_use_is_tried_again(void)
{
    const SOCKADDRESS own = {0, 502};

    ModbusServerTcpClose();
    fakes_begin();
    fakes.listen_result = ERR_DUPLICATE;
    CHECK_EQUAL(ModbusServerTcpOpen(&server, &own), ERR_OK);
    run_ms(2);
    CHECK_EQUAL(ModbusServerTcpGetState(&server), ERR_DUPLICATE);
    fakes.listen_result = ERR_OK;
    run_ms(1010);
    CHECK_EQUAL(ModbusServerTcpGetState(&server), ERR_OK);
    CHECK(works(net_dial()));
}

static void the_end_closes_everything(void)
{
    FAKE_SOCKET *socket;

    begin();
    socket = net_dial();
    CHECK(works(socket));
    ModbusServerTcpClose();
    CHECK(!socket->open);
    CHECK_EQUAL(fakes.listeners, 0);
}

int main(void)
{
    RUN(a_request_is_replied_to);
    RUN(a_frame_may_come_in_pieces);
    RUN(several_frames_may_come_at_once);
    RUN(a_flood_holds_up_no_other);
    RUN(replies_wait_for_room);
    RUN(a_client_that_reads_nothing_for_seconds_is_dropped);
    RUN(a_client_that_reads_slowly_stays);
    RUN(what_is_no_frame_ends_the_connection);
    RUN(half_a_frame_and_its_end);
    RUN(one_client_more_replaces_the_idlest);
    RUN(units_of_others_are_not_there);
    RUN(a_port_that_is_in_use_is_tried_again);
    RUN(the_end_closes_everything);
    return test_result();
}
