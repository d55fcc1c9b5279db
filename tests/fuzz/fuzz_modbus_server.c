/*
 * fuzz_modbus_server.c - any bytes on a serial line and on a connection of a Modbus server.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * An input is a row of pieces: a byte with the length (7 bits) and whether it goes to the line (0) or the connection (1),
 * then the bytes; length 0 lets time pass. On the line the piece "." (length 127) is a PDU that gets unit and CRC.
 */
#include <string.h>

#include "ModbusPdu.h"
#include "ModbusRtu.h"
#include "ModbusServerTcp.h"
#include "ModbusTunnel.h"
#include "fuzz.h"
#include "modbus_fakes.h"

enum { MS = 1000000, UNIT = 7, FRAMED = 0x7F, GUARD = 0xA5, MEMORY = 250 };

static RTS_UI8 data[MEMORY + 2]; /* a guard on either side */
static RTS_UI8 bits[MEMORY + 2];

static const MODBUS_RANGE ranges[] = {
    {MODBUS_HOLDING_REGISTERS | MODBUS_COILS, MODBUS_RANGE_WRITABLE, 0, 0, 1, 1000},
    {MODBUS_INPUT_REGISTERS | MODBUS_HOLDING_REGISTERS, MODBUS_RANGE_WRITABLE, 100, 0, 4, 960},
    {MODBUS_DISCRETE_INPUTS | MODBUS_COILS, MODBUS_RANGE_WRITABLE, 0, 65536 - 1999, 2, 1999},
};

size_t fuzz_seed(unsigned index, uint8_t *out, size_t capacity)
{
    static const uint8_t seeds[][24] = {
        {0x7F, 5, 3, 0, 0, 0, 10},
        {0x7F, 5, 1, 0, 3, 0, 17},
        {0x7F, 5, 5, 0, 3, 0xFF, 0},
        {0x7F, 9, 16, 0, 99, 0, 2, 4, 1, 2, 3, 4},
        {0x7F, 7, 15, 0xFF, 0xF0, 0, 9, 2, 1, 1},
        {0x7F, 12, 23, 0, 0, 0, 3, 0, 1, 0, 1, 2, 5, 6},
        {0x7F, 7, 22, 0, 4, 0, 0xF2, 0, 0x25},
        {0x7F, 4, 43, 14, 1, 0},
        {0x7F, 1, 17},
        {0x7F, 3, 43, 128, 0, 0x7F, 6, 43, 128, 1, 9, 8, 7, 0x7F, 3, 43, 128, 2},
        {0x7F, 3, 43, 128, 0, 0x7F, 4, 43, 128, 1, 9, 0x7F, 4, 43, 128, 1, 9},
        {0x80 | 12, 0, 1, 0, 0, 0, 6, UNIT, 3, 0, 0, 0, 2},
        {0x80 | 3, 0, 1, 0, 0x80 | 9, 0, 0, 6, UNIT, 3, 0, 0, 0, 2},
    };
    static const uint8_t sizes[] = {7, 7, 7, 12, 10, 15, 9, 6, 3, 18, 17, 13, 14};

    if (index >= sizeof(sizes) || capacity < sizes[index])
        return 0;
    memcpy(out, seeds[index], sizes[index]);
    return sizes[index];
}

static MODBUS_SERVER server_of_line;
static MODBUS_SERVER server_of_net;
static MODBUS_LINK link;

/* The block driver: what comes from tools goes back to them, and sometimes more. */
static void echo(void)
{
    RTS_UI8 bytes[64];
    RTS_UI32 size = ModbusTunnelRead(bytes, sizeof(bytes));

    FUZZ_CHECK(size <= sizeof(bytes));
    FUZZ_CHECK(ModbusTunnelWrite(bytes, size) <= size);
    if (size != 0 && bytes[0] == GUARD)
        FUZZ_CHECK(ModbusTunnelWrite(data, sizeof(data)) <= sizeof(data));
}

static void run(RTS_UI32 ms)
{
    RTS_UI8 sent[512];

    for (RTS_UI32 i = 0; i < 2 * ms; i++, fakes.now_ns += MS / 2) {
        (void)ModbusServerPoll(&server_of_line, &link, fakes.now_ns);
        ModbusServerTcpPoll(fakes.now_ns);
        echo();
        (void)line_take(sent, sizeof(sent));
        for (RTS_UI32 k = 0; k < fakes.used; k++)
            fakes.sockets[k].out_size = 0;
    }
}

static void begin(void)
{
    const SYSCOM_SETTINGS settings = {115200, SYSCOM_PARITY_EVEN, 1, false};
    const SOCKADDRESS own = {0, MODBUS_PORT};
    static MODBUS_MEMORY memory[] = {{&ranges[0], data + 1}, {&ranges[1], data + 1 + 125}, {&ranges[2], bits + 1}};

    ModbusServerTcpClose();
    ModbusTunnelReset();
    fakes_begin();
    fakes.char_ns = 95000;
    memset(data, GUARD, sizeof(data));
    memset(bits, GUARD, sizeof(bits));
    memset(&server_of_line, 0, sizeof(server_of_line));
    memset(&link, 0, sizeof(link));
    server_of_line.unit = UNIT;
    server_of_line.memory = memory;
    server_of_line.range_count = 3;
    server_of_line.object[0] = "vendor";
    server_of_net = server_of_line;
    server_of_net.tcp = true;
    server_of_line.tunnel = true;
    ModbusRtuBegin(&link, 0, &settings);
    (void)ModbusServerTcpOpen(&server_of_net, &own);
}

/* The connection that pieces go to: another one when the server has closed it. */
static FAKE_SOCKET *connection(void)
{
    static FAKE_SOCKET *socket;

    if (fakes.used == 0 || (!socket->open && fakes.used < FAKE_SOCKETS))
        socket = net_dial();
    run(1);
    return socket;
}

static void check_that_both_work(void)
{
    static const RTS_UI8 on_line[] = {UNIT, 3, 0, 0, 0, 1};
    static const RTS_UI8 of_tool[] = {UNIT, 43, 128, 0};
    static const RTS_UI8 on_net[] = {3, 0, 0, 0, 1};
    RTS_UI32 before;
    FAKE_SOCKET *socket;

    run(100);
    before = server_of_line.requests; /* what came last may have been one, too */
    line_send_frame(on_line, sizeof(on_line));
    run(20);
    FUZZ_CHECK(server_of_line.requests == before + 1);
    before = server_of_line.errors;
    line_send_frame(of_tool, sizeof(of_tool));
    run(20);
    FUZZ_CHECK(server_of_line.errors == before);
    if (fakes.used == FAKE_SOCKETS)
        return;
    socket = net_dial();
    net_put_pdu(socket, 1, UNIT, on_net, sizeof(on_net));
    before = server_of_net.requests;
    run(5);
    FUZZ_CHECK(server_of_net.requests >= before + 1);
}

int LLVMFuzzerTestOneInput(const uint8_t *input, size_t size)
{
    begin();
    for (size_t i = 0; i < size;) {
        uint8_t head = input[i++];
        bool to_net = (head & 0x80) != 0;
        bool framed = !to_net && (head & 0x7F) == FRAMED && i < size;
        size_t length = framed ? input[i++] : (size_t)(head & 0x7F);
        RTS_UI8 frame[1 + 255];
        if (length > size - i)
            length = size - i;
        frame[0] = UNIT;
        memcpy(frame + 1, input + i, length);
        if (framed)
            line_send_frame(frame, (RTS_UI32)length + 1);
        else if (!to_net)
            line_send(frame + 1, (RTS_UI32)length);
        else if (length != 0 && connection()->in_size + length < FAKE_SOCKET_ROOM)
            net_put(connection(), frame + 1, (RTS_UI32)length);
        run(length == 0 || framed ? 30 : 1);
        i += length;
    }
    check_that_both_work();
    FUZZ_CHECK(data[0] == GUARD && data[sizeof(data) - 1] == GUARD);
    FUZZ_CHECK(bits[0] == GUARD && bits[sizeof(bits) - 1] == GUARD);
    FUZZ_CHECK((bits[MEMORY] & 0x80) == (GUARD & 0x80)); /* the last bit belongs to nothing */
    FUZZ_CHECK(!fakes.locked);
    return 0;
}
