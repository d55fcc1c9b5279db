/*
 * test_modbus_rtu_tcp.c - a Modbus client whose serial line is at the other end of a TCP connection: RTU over TCP.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusTcp.h"
#include "modbus_remotes.h"
#include "rts_config.h"
#include "test.h"

enum { READ_MS = 20, WHOLE = 300 };

static RTS_UI32 piece;      /* bytes that arrive in one ms */
static bool is_silent;      /* the network takes what is sent, and brings nothing */
static bool is_noisy;       /* something is before and after each reply */
static RTS_UI8 other_first; /* a reply of this unit comes before the right one; 0: none */
static RTS_UI8 stream[2000];
static RTS_UI32 stream_size;

static void begin_rtu_tcp(RTS_UI32 count)
{
    const SOCKADDRESS peer = {0x0A000001, 8899};

    begin(count);
    piece = WHOLE;
    is_silent = is_noisy = false;
    other_first = 0;
    stream_size = 0;
    ModbusTcpBeginRtuClient(&client.link, &peer);
    ModbusClientBegin(&client, devices, count);
}

static FAKE_SOCKET *newest(void)
{
    return &fakes.sockets[fakes.used - 1];
}

static void put(const RTS_UI8 *data, RTS_UI32 size)
{
    memcpy(stream + stream_size, data, size);
    stream_size += size;
}

static void put_frame(RTS_UI8 unit, const RTS_UI8 *pdu, RTS_UI32 size)
{
    RTS_UI8 frame[WHOLE];
    RTS_UI16 crc;

    frame[0] = unit;
    memcpy(frame + 1, pdu, size);
    crc = ModbusCrc(frame, 1 + size);
    frame[1 + size] = (RTS_UI8)crc;
    frame[2 + size] = (RTS_UI8)(crc >> 8);
    put(frame, size + 3);
}

static void reply(REMOTE *remote, const RTS_UI8 *request, RTS_UI32 size)
{
    RTS_UI8 pdu[MODBUS_MAX_PDU];

    remote->asked++;
    memcpy(pdu, request + 1, size - 3);
    size = ModbusServerReply(&remote->server, pdu, size - 3);
    if (request[0] == MODBUS_BROADCAST || remote->fault == SILENT)
        return;
    if (is_noisy)
        put((const RTS_UI8 *)"\x00\xFF\x01\x03", 4);
    if (other_first != 0)
        put_frame(other_first, pdu, size);
    put_frame(remote->fault == WRONG_UNIT ? 9 : request[0], pdu, size);
    if (is_noisy)
        put((const RTS_UI8 *)"\x55", 1);
}

/* The gateway at the other end of the newest connection. */
static void serve(void)
{
    FAKE_SOCKET *socket = newest();
    RTS_UI32 size = socket->out_size;

    if (is_silent || !socket->open || size == 0)
        return;
    CHECK_EQUAL(ModbusCrc(socket->out, size), 0);
    for (RTS_UI32 i = 0; i < DEVICES; i++) {
        if (socket->out[0] == i + 1 || socket->out[0] == MODBUS_BROADCAST)
            reply(&remotes[i], socket->out, size);
    }
    socket->out_size = 0;
}

static void run_net_ms(RTS_UI32 ms)
{
    for (RTS_UI32 i = 0; i < ms; i++, fakes.now_ns += MS) {
        RTS_UI32 size = stream_size < piece ? stream_size : piece;
        ModbusClientPoll(&client, fakes.now_ns);
        if (fakes.used == 0)
            continue;
        if (newest()->in_size + size > sizeof(newest()->in))
            size = 0; /* its window is closed */
        net_put(newest(), stream, size);
        stream_size -= size;
        memmove(stream, stream + size, stream_size);
        serve();
    }
}

static void frames_have_a_crc_and_no_header(void)
{
    begin_rtu_tcp(1);
    add(0, read_job(READ_MS));
    is_silent = true;
    run_net_ms(5);
    CHECK_EQUAL(newest()->out_size, 8);
    CHECK(memcmp(newest()->out, "\x01\x03\x00\x00\x00\x02\xC4\x0B", 8) == 0);
}

static void registers_are_read_and_written(void)
{
    begin_rtu_tcp(2);
    add(0, read_job(READ_MS));
    add(1, write_job(MODBUS_JOB_ON_CHANGE | MODBUS_JOB_VERIFY, 0));
    states[1][0].has_out = true;
    out[1][0][0] = 7;
    remotes[0].data[0] = 0x42;
    run_net_ms(500);
    CHECK_EQUAL(in[0][0][0], 0x42);
    CHECK_EQUAL(remotes[1].data[8], 7);
    CHECK(ModbusDeviceIsGood(&devices[0]) && ModbusDeviceIsGood(&devices[1]));
    CHECK_EQUAL(fakes.connects, 1);
}

static void a_reply_may_come_in_pieces(void)
{
    for (piece = 1; piece <= 9; piece++) {
        RTS_UI32 size = piece;
        begin_rtu_tcp(1);
        piece = size;
        add(0, read_job(READ_MS));
        run_net_ms(1000);
        CHECK(ModbusDeviceIsGood(&devices[0]));
        CHECK_EQUAL(devices[0].counters.timeouts, 0);
        CHECK(remotes[0].asked > 20);
    }
}

static void noise_of_the_line_is_passed_over(void)
{
    begin_rtu_tcp(1);
    add(0, read_job(READ_MS));
    is_noisy = true;
    run_net_ms(1000);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK_EQUAL(devices[0].counters.timeouts, 0);
    CHECK_EQUAL(fakes.connects, 1);
}

static void a_reply_of_another_unit_before_the_right_one_is_passed_over(void)
{
    begin_rtu_tcp(1);
    add(0, read_job(READ_MS));
    other_first = 5;
    run_net_ms(1000);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK_EQUAL(devices[0].counters.timeouts, 0);
}

static void a_device_that_replies_as_another_one_is_lost(void)
{
    begin_rtu_tcp(1);
    add(0, read_job(READ_MS));
    remotes[0].fault = WRONG_UNIT;
    run_net_ms(1000);
    CHECK(ModbusDeviceIsLost(&devices[0]));
    CHECK_EQUAL(devices[0].miss, MODBUS_MISS_UNIT);
    CHECK_EQUAL(devices[0].missed_unit, 9);
}

/* It comes on the next connection, and would be taken as the reply to the next request. */
static void the_late_reply_of_a_device_is_not_taken_as_another(void)
{
    begin_rtu_tcp(1);
    add(0, read_job(READ_MS));
    add(0, (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 4, 2, 0, 0, 0, READ_MS});
    run_net_ms(300);
    for (RTS_UI32 late_ms = TIMEOUT_MS; late_ms < 2 * TIMEOUT_MS; late_ms += 5) {
        memset(remotes[0].data, 0x11, 8);
        memset(remotes[0].data + 8, 0x22, 8);
        while (client.device == NULL || !client.sent)
            run_net_ms(1);
        is_silent = true;
        run_net_ms(late_ms);
        is_silent = false;
        put_frame(1, (const RTS_UI8[]){3, 4, 0x77, 0x77, 0x77, 0x77}, 6);
        run_net_ms(400);
        CHECK(in[0][0][0] != 0x77 && in[0][1][0] != 0x77);
        CHECK(ModbusDeviceIsGood(&devices[0]));
    }
}

static void a_babbling_line_is_lost_and_comes_back(void)
{
    static RTS_UI8 noise[200];

    begin_rtu_tcp(1);
    add(0, read_job(READ_MS));
    run_net_ms(200);
    remotes[0].fault = SILENT;
    for (RTS_UI32 i = 0; i < 400; i++) {
        memset(noise, (int)i, sizeof(noise));
        if (stream_size < 1000)
            put(noise, sizeof(noise));
        run_net_ms(1);
    }
    CHECK(ModbusDeviceIsLost(&devices[0]));
    CHECK(client.link.bad_frames > 0);
    remotes[0].fault = WELL;
    stream_size = 0;
    run_net_ms(2500);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

static void unit_0_is_all_devices(void)
{
    begin_rtu_tcp(1);
    devices[0].unit = MODBUS_BROADCAST;
    add(0, write_job(0, 200));
    states[0][0].has_out = true;
    out[0][0][0] = 5;
    run_net_ms(500);
    CHECK_EQUAL(remotes[0].data[8], 5);
    CHECK_EQUAL(remotes[2].data[8], 5);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

static void a_gateway_that_restarts_may_have_devices_that_did_too(void)
{
    begin_rtu_tcp(1);
    add(0, write_job(MODBUS_JOB_ON_CHANGE, 0));
    add(0, read_job(READ_MS));
    states[0][0].has_out = true;
    out[0][0][0] = 5;
    run_net_ms(500);
    newest()->peer_gone = true;
    memset(remotes[0].data, 0, sizeof(remotes[0].data));
    run_net_ms(500);
    CHECK_EQUAL(remotes[0].data[8], 5);
}

int main(void)
{
    RUN(frames_have_a_crc_and_no_header);
    RUN(registers_are_read_and_written);
    RUN(a_reply_may_come_in_pieces);
    RUN(noise_of_the_line_is_passed_over);
    RUN(a_reply_of_another_unit_before_the_right_one_is_passed_over);
    RUN(a_device_that_replies_as_another_one_is_lost);
    RUN(the_late_reply_of_a_device_is_not_taken_as_another);
    RUN(a_babbling_line_is_lost_and_comes_back);
    RUN(unit_0_is_all_devices);
    RUN(a_gateway_that_restarts_may_have_devices_that_did_too);
    return test_result();
}
