/*
 * test_modbus_restart.c - a Modbus device that restarts has lost its outputs, and gets them again; on RTU and on TCP.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusTcp.h"
#include "modbus_remotes.h"
#include "rts_config.h"
#include "test.h"

enum {
    ON_CHANGE = MODBUS_JOB_ON_CHANGE,
    EVERY_MS = 1000,
    READ_MS = 20,
    HOLDING_BYTE = 8, /* of the register that write_job() writes */
    SPEED = 9,
    /* docs/modbus.md: "at the latest" */
    BACK_MS = MODBUS_RETRY_ALONE_MS + 2 * TIMEOUT_MS + 100,
};

static const RTS_UI32 down_times_ms[] = {1,    2,    5,    10,   20,   50,   75,    99,    100,  101,
                                         130,  199,  200,  201,  250,  300,  500,   800,   999,  1000,
                                         1001, 1200, 1500, 2000, 4000, 9999, 10500, 31000, 60000};

static RTS_UI32 random_state;

static RTS_UI32 random_below(RTS_UI32 end)
{
    random_state = random_state * 1664525 + 1013904223;
    return (random_state >> 8) % end;
}

static void forget_all(RTS_UI32 device)
{
    memset(remotes[device].data, 0, sizeof(remotes[device].data));
}

static bool has_output(RTS_UI32 device)
{
    return remotes[device].data[HOLDING_BYTE] == SPEED;
}

static void begin_output(RTS_UI32 device, RTS_UI32 every_ms)
{
    add(device, write_job(ON_CHANGE, every_ms));
    states[device][0].has_out = true;
    out[device][0][0] = SPEED;
}

/* ---- RTU ---- */

static void restart_rtu(RTS_UI32 down_ms)
{
    remotes[0].fault = SILENT;
    run_ms(down_ms);
    forget_all(0);
    remotes[0].fault = WELL;
}

/* A restart that no request has met cannot be seen on a serial line: `every` is for that. */
static void a_device_on_a_serial_line_that_restarts_gets_its_outputs_again(void)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(down_times_ms); i++) {
        for (RTS_UI32 phase = 0; phase < 4; phase++) {
            RTS_UI32 every_ms = down_times_ms[i] <= 2 * READ_MS ? EVERY_MS : 0;
            begin(1);
            begin_output(0, every_ms);
            add(0, read_job(READ_MS));
            run_ms(300 + random_below(200));
            CHECK(has_output(0));
            restart_rtu(down_times_ms[i]);
            run_ms(BACK_MS + every_ms);
            CHECK(has_output(0));
            CHECK(ModbusDeviceIsGood(&devices[0]));
        }
    }
}

static void a_restarted_device_among_others_gets_its_outputs_again(void)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(down_times_ms); i++) {
        begin(2);
        begin_output(0, EVERY_MS);
        add(0, read_job(READ_MS));
        add(1, read_job(READ_MS));
        run_ms(300 + random_below(200));
        restart_rtu(down_times_ms[i]);
        run_ms(MODBUS_RETRY_MS + BACK_MS);
        CHECK(has_output(0));
    }
}

/* It does not forget, and its memory may wear out. */
static void one_missed_reply_writes_the_outputs_again_once(void)
{
    RTS_UI32 written;

    begin(1);
    begin_output(0, 0);
    add(0, read_job(READ_MS));
    run_ms(500);
    written = remotes[0].server.written;
    remotes[0].fault = SILENT;
    run_ms(READ_MS + 5);
    remotes[0].fault = WELL;
    run_ms(5000);
    CHECK_EQUAL(devices[0].counters.timeouts, 1);
    CHECK_EQUAL(remotes[0].server.written - written, 1);
}

/* It starts with its memory empty, and refuses while it does. */
static void a_device_that_refuses_what_it_did_gets_its_outputs_again(void)
{
    begin(1);
    begin_output(0, 0);
    add(0, read_job(READ_MS));
    run_ms(500);
    forget_all(0);
    remotes[0].fault = EXCEPTION;
    run_ms(5000);
    remotes[0].fault = WELL;
    run_ms(BACK_MS);
    CHECK(has_output(0));
}

static void a_device_that_always_refuses_one_read_is_not_written_all_the_time(void)
{
    begin(1);
    begin_output(0, 0);
    add(0, read_job(READ_MS));
    add(0, (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 500, 1, 0, 0, 0, READ_MS});
    run_ms(5000);
    CHECK_EQUAL(remotes[0].server.written, 1);
}

/* ---- TCP ---- */

typedef enum {
    STAYS,         /* a connection stays open */
    CLOSES,        /* after each reply */
    CLOSES_LATELY, /* after each reply, but when the next request is on its way */
} HABIT;

static HABIT habit;
static bool is_down;
static bool is_dark; /* while it is down, nothing refuses connections */

static void begin_tcp(HABIT of_device)
{
    const SOCKADDRESS peer = {0x0A000001, 502};

    begin(1);
    habit = of_device;
    is_down = false;
    ModbusTcpBeginClient(&client.link, &peer);
    ModbusClientBegin(&client, devices, 1);
}

/* NULL: there is none yet. */
static FAKE_SOCKET *newest(void)
{
    return fakes.used > 0 ? &fakes.sockets[fakes.used - 1] : NULL;
}

static void reply_to(FAKE_SOCKET *socket)
{
    RTS_UI8 pdu[MODBUS_MAX_PDU];
    RTS_UI32 size = socket->out_size - MODBUS_AT_PDU;

    memcpy(pdu, socket->out + MODBUS_AT_PDU, size);
    size = ModbusServerReply(&remotes[0].server, pdu, size);
    net_put_pdu(socket, ModbusGet16(socket->out), socket->out[MODBUS_AT_UNIT], pdu, size);
    socket->out_size = 0;
}

/* After a restart a connection of before is one that the device does not know. */
static void serve_tcp(void)
{
    FAKE_SOCKET *socket = newest();

    if (socket == NULL || !socket->open || socket->out_size == 0 || is_down)
        return;
    if (socket->peer.port == 0) {
        socket->peer_gone = true;
        return;
    }
    reply_to(socket);
    if (habit == CLOSES)
        socket->peer_gone = true;
    else if (habit == CLOSES_LATELY)
        socket->peer.port = 0;
}

static void run_tcp_ms(RTS_UI32 ms)
{
    for (RTS_UI32 i = 0; i < ms; i++, fakes.now_ns += MS) {
        if (fakes.used == FAKE_SOCKETS && !newest()->open)
            fakes.used = 0; /* room for more of them */
        ModbusClientPoll(&client, fakes.now_ns);
        serve_tcp();
    }
}

static void restart_tcp(RTS_UI32 down_ms)
{
    is_down = true;
    fakes.connect_result = is_dark ? ERR_PENDING : ERR_NET_NOTCONNECTED;
    if (newest() != NULL && is_dark)
        newest()->peer.port = 0;
    else if (newest() != NULL)
        newest()->peer_gone = true;
    run_tcp_ms(down_ms);
    forget_all(0);
    fakes.connect_result = ERR_OK;
    is_down = false;
}

/* An attempt to connect that met the device while it was away may take MODBUS_CONNECT_MS to fail. */
static void a_device_on_the_network_that_restarts_gets_its_outputs_again(void)
{
    for (RTS_UI32 i = 0; i < 2 * RTS_COUNT(down_times_ms); i++) {
        for (RTS_UI32 phase = 0; phase < 4; phase++) {
            is_dark = i % 2 != 0;
            begin_tcp(STAYS);
            begin_output(0, 0);
            add(0, read_job(READ_MS));
            run_tcp_ms(300 + random_below(200));
            CHECK(has_output(0));
            restart_tcp(down_times_ms[i / 2]);
            run_tcp_ms(BACK_MS);
            CHECK(has_output(0));
            CHECK(ModbusDeviceIsGood(&devices[0]));
        }
    }
}

static void a_device_of_outputs_only_gets_them_again_when_its_connection_ends(void)
{
    begin_tcp(STAYS);
    begin_output(0, 0);
    run_tcp_ms(300);
    is_dark = false;
    restart_tcp(50);
    run_tcp_ms(BACK_MS);
    CHECK(has_output(0));
}

static void a_device_that_restarts_again_and_again_gets_its_outputs_each_time(void)
{
    begin_tcp(STAYS);
    begin_output(0, 0);
    add(0, read_job(READ_MS));
    is_dark = false;
    for (RTS_UI32 i = 0; i < 20; i++) {
        run_tcp_ms(MODBUS_SHORT_CONNECTION_MS + 1000);
        restart_tcp(1);
        run_tcp_ms(BACK_MS);
        CHECK(has_output(0));
    }
}

/* Each of its connections is new, and says nothing: what is written on change would be written all the time. */
static void a_device_that_closes_after_each_reply_is_well_and_written_on_change_only(void)
{
    for (habit = CLOSES; habit <= CLOSES_LATELY; habit++) {
        begin_tcp(habit);
        begin_output(0, 0);
        add(0, read_job(READ_MS));
        run_tcp_ms(200);
        CHECK_EQUAL(devices[0].counters.timeouts, 0);
        RTS_UI32 written = remotes[0].server.written;
        for (RTS_UI32 i = 0; i < 20; i++) {
            run_tcp_ms(500);
            CHECK(ModbusDeviceIsGood(&devices[0]));
        }
        CHECK_EQUAL(devices[0].counters.timeouts, 0);
        CHECK(devices[0].counters.requests >= 10000 / READ_MS / 2);
        CHECK(written <= MODBUS_CLOSINGS + 2);
        CHECK_EQUAL(remotes[0].server.written, written);
        is_dark = false;
        restart_tcp(200);
        run_tcp_ms(BACK_MS);
        CHECK(has_output(0));
    }
}

int main(void)
{
    RUN(a_device_on_a_serial_line_that_restarts_gets_its_outputs_again);
    RUN(a_restarted_device_among_others_gets_its_outputs_again);
    RUN(one_missed_reply_writes_the_outputs_again_once);
    RUN(a_device_that_refuses_what_it_did_gets_its_outputs_again);
    RUN(a_device_that_always_refuses_one_read_is_not_written_all_the_time);
    RUN(a_device_on_the_network_that_restarts_gets_its_outputs_again);
    RUN(a_device_of_outputs_only_gets_them_again_when_its_connection_ends);
    RUN(a_device_that_restarts_again_and_again_gets_its_outputs_each_time);
    RUN(a_device_that_closes_after_each_reply_is_well_and_written_on_change_only);
    return test_result();
}
