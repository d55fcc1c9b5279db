/*
 * test_modbus_client_tcp.c - a Modbus client on TCP: connections that are refused, slow, lost; gateways; late replies.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusClient.h"
#include "ModbusPdu.h"
#include "ModbusTcp.h"
#include "modbus_fakes.h"
#include "rts_config.h"
#include "test.h"

enum { MS = 1000000, TIMEOUT_MS = 100, INTERVAL_MS = 50, REQUEST_SIZE = 12, NO_UNIT = 0xFF };

static const MODBUS_JOB job = {MODBUS_READ_HOLDING_REGISTERS, 0, 0, 1, 0, 0, 0, INTERVAL_MS};
static const MODBUS_JOB write_job = {MODBUS_WRITE_REGISTER, 0, 0, 0, 0, 1, 0, INTERVAL_MS};
static MODBUS_CLIENT client;
static MODBUS_DEVICE devices[2];
static MODBUS_JOB_STATE states[2];
static RTS_UI8 in[2][2];
static bool silent;
static RTS_UI8 silent_unit;
static bool is_cut;  /* the network: what is sent waits */
static bool refuses; /* the gateway: for unit 2 */
static RTS_UI16 transaction_offset;
static RTS_UI32 asked;

static void begin(RTS_UI32 count)
{
    const SOCKADDRESS peer = {0x0A000001, 502};

    fakes_begin();
    memset(&client, 0, sizeof(client));
    memset(devices, 0, sizeof(devices));
    memset(states, 0, sizeof(states));
    memset(in, 0, sizeof(in));
    silent = refuses = false;
    is_cut = false;
    silent_unit = NO_UNIT;
    transaction_offset = 0;
    asked = 0;
    for (RTS_UI32 i = 0; i < 2; i++) {
        states[i] = (MODBUS_JOB_STATE){.job = &job, .in = in[i]};
        devices[i] = (MODBUS_DEVICE){.unit = (RTS_UI8)(i + 1), .timeout_ms = TIMEOUT_MS, .job_count = 1};
        devices[i].retries = MODBUS_RETRIES;
        devices[i].ask_again_ms = MODBUS_RETRY_MS;
        devices[i].jobs = &states[i];
    }
    ModbusTcpBeginClient(&client.link, &peer);
    ModbusClientBegin(&client, devices, count);
}

static FAKE_SOCKET *newest(void)
{
    return &fakes.sockets[fakes.used - 1];
}

static void reply_to(FAKE_SOCKET *socket, RTS_UI8 unit)
{
    RTS_UI16 transaction = ModbusGet16(socket->out);

    if (refuses && unit == 2)
        net_put_pdu(socket, transaction, unit, (const RTS_UI8[]){0x83, MODBUS_NO_TARGET}, 2);
    else if (socket->out[7] == MODBUS_WRITE_REGISTER)
        net_put_pdu(socket, transaction, unit, socket->out + 7, REQUEST_SIZE - 7);
    else
        net_put_pdu(socket, (RTS_UI16)(transaction + transaction_offset), unit,
                    (const RTS_UI8[]){3, 2, 0, (RTS_UI8)asked}, 4);
}

/* The server at the other end of the newest connection: its register has the number of requests so far. */
static void serve(void)
{
    FAKE_SOCKET *socket = newest();
    RTS_UI8 unit = socket->out[6];

    if (fakes.used == 0 || is_cut || !socket->open || socket->out_size < REQUEST_SIZE)
        return;
    asked++;
    if (!silent && unit != silent_unit)
        reply_to(socket, unit);
    socket->out_size = 0;
}

static void run_ms(RTS_UI32 ms)
{
    for (RTS_UI32 i = 0; i < ms; i++, fakes.now_ns += MS) {
        ModbusClientPoll(&client, fakes.now_ns);
        if (fakes.used != 0)
            serve();
    }
}

static void one_connection_serves_all_devices_of_a_gateway(void)
{
    begin(2);
    run_ms(1000);
    CHECK_EQUAL(fakes.connects, 1);
    CHECK_EQUAL(newest()->peer.ip, 0x0A000001);
    CHECK(ModbusDeviceIsGood(&devices[0]) && ModbusDeviceIsGood(&devices[1]));
    CHECK(asked >= 38 && asked <= 42);
}

static void a_refused_connection_is_tried_every_second(void)
{
    begin(1);
    fakes.connect_result = ERR_NET_NOTCONNECTED;
    run_ms(10000);
    CHECK(ModbusDeviceIsLost(&devices[0]));
    CHECK(fakes.connects >= 5 && fakes.connects <= 11);
    fakes.connect_result = ERR_OK;
    run_ms(2500);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

static void a_slow_connection_is_waited_for(void)
{
    begin(1);
    fakes.connect_result = ERR_PENDING;
    run_ms(2000);
    CHECK_EQUAL(fakes.connects, 1);
    fakes.connect_result = ERR_OK;
    run_ms(1500);
    CHECK_EQUAL(fakes.connects, 1);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

static void a_connection_that_never_comes_is_given_up(void)
{
    begin(1);
    fakes.connect_result = ERR_PENDING;
    run_ms(MODBUS_CONNECT_MS + 3000);
    CHECK(fakes.connects >= 2);
    CHECK(!fakes.sockets[0].open);
}

/* The device is lost, and nothing is asked of it for a while: what is not looked at would wake main all the time. */
static void a_connection_that_comes_or_fails_while_nothing_is_asked_is_seen(void)
{
    static const RTS_RESULT results[] = {ERR_OK, ERR_NET_NOTCONNECTED};

    for (RTS_UI32 i = 0; i < RTS_COUNT(results); i++) {
        begin(1);
        fakes.connect_result = ERR_PENDING;
        while (!ModbusDeviceIsLost(&devices[0]))
            run_ms(1);
        run_ms(10);
        CHECK(newest()->open && !newest()->connected);
        fakes.connect_result = results[i];
        run_ms(2);
        CHECK_EQUAL(newest()->connected, i == 0);
        CHECK_EQUAL(newest()->open, i == 0);
        CHECK_EQUAL(devices[0].counters.requests, 0);
        fakes.connect_result = ERR_OK;
        run_ms(2500);
        CHECK(ModbusDeviceIsGood(&devices[0]));
        CHECK_EQUAL(fakes.connects, i == 0 ? 1 : 2);
    }
}

static void a_lost_connection_is_made_again(void)
{
    begin(1);
    run_ms(3000);
    newest()->peer_gone = true;
    run_ms(300);
    CHECK_EQUAL(fakes.connects, 2);
    CHECK(!fakes.sockets[0].open);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK_EQUAL(devices[0].counters.timeouts, 0); /* it was closed between two requests */
}

static void a_reply_of_another_transaction_is_passed_over(void)
{
    begin(1);
    run_ms(200);
    transaction_offset = 1;
    run_ms(3000);
    CHECK(ModbusDeviceIsLost(&devices[0]));
    CHECK(devices[0].counters.others >= 2);
    transaction_offset = 0;
    run_ms(1500);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

static void a_device_that_the_gateway_does_not_reach_is_lost(void)
{
    begin(2);
    refuses = true;
    run_ms(2000);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK(ModbusDeviceIsLost(&devices[1]));
    CHECK_EQUAL(devices[1].counters.last_exception, MODBUS_NO_TARGET);
    CHECK(devices[1].counters.requests <= 3);
    refuses = false;
    run_ms(MODBUS_RETRY_SOON_MS);
    CHECK(ModbusDeviceIsGood(&devices[1]));
}

/* What was asked may be on its way still. */
static void a_request_without_reply_ends_the_connection(void)
{
    begin(1);
    run_ms(200);
    silent = true;
    while (devices[0].counters.timeouts == 0)
        run_ms(1);
    CHECK(!fakes.sockets[0].open);
    silent = false;
    run_ms(INTERVAL_MS);
    CHECK_EQUAL(fakes.connects, 2);
    CHECK_EQUAL(devices[0].counters.timeouts, 1);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

static void a_silent_device_of_a_gateway_costs_the_others_little(void)
{
    RTS_UI32 before;

    begin(2);
    silent_unit = 2;
    run_ms(60000);
    CHECK(ModbusDeviceIsLost(&devices[1]));
    before = devices[0].counters.requests;
    run_ms(120000);
    CHECK(devices[0].counters.requests - before >= 120000 / INTERVAL_MS - 120000 / MODBUS_RETRY_MS * 3);
    CHECK_EQUAL(devices[0].counters.timeouts, 0);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

/* Its window is closed: it takes no bytes, or half a request. */
static void a_peer_that_takes_nothing_is_lost_and_comes_back(void)
{
    for (RTS_UI32 taken = 0; taken < REQUEST_SIZE; taken += REQUEST_SIZE / 2) {
        begin(1);
        run_ms(200);
        fakes.window = taken;
        run_ms(3000);
        CHECK(ModbusDeviceIsLost(&devices[0]));
        fakes.window = FAKE_SOCKET_ROOM;
        run_ms(2500);
        CHECK(ModbusDeviceIsGood(&devices[0]));
    }
}

/* Frames that are no reply do not keep a request from being late. */
static void a_peer_that_talks_all_the_time_is_lost(void)
{
    begin(1);
    run_ms(200);
    silent = true;
    for (RTS_UI32 i = 0; i < 500; i++) {
        net_put_pdu(newest(), 0x5A5A, 1, (const RTS_UI8[]){3, 2, 0, 0}, 4);
        run_ms(1);
    }
    CHECK(ModbusDeviceIsLost(&devices[0]));
}

static RTS_UI32 bytes_on_their_way(void)
{
    RTS_UI32 size = 0;

    for (RTS_UI32 i = 0; i < fakes.used; i++)
        size += fakes.sockets[i].out_size;
    return size;
}

static void begin_writes(RTS_UI8 unit)
{
    static RTS_UI8 out[2];
    static RTS_UI8 written[2];

    begin(1);
    devices[0].unit = unit;
    states[0] = (MODBUS_JOB_STATE){.job = &write_job, .out = out, .written = written, .has_out = true};
    run_ms(200);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

/* The network brings what it has taken when it is back, minutes later, but not what was reset. */
static void what_was_not_replied_to_is_not_written_later(void)
{
    for (RTS_UI8 unit = 0; unit <= 1; unit++) {
        begin_writes(unit);
        is_cut = true;
        for (RTS_UI32 i = 0; i < 50; i++) {
            run_ms(100);
            CHECK(bytes_on_their_way() <= REQUEST_SIZE);
        }
        CHECK(ModbusDeviceIsLost(&devices[0]));
        is_cut = false;
        run_ms(2500);
        CHECK(ModbusDeviceIsGood(&devices[0]));
    }
}

static void what_is_on_its_way_is_not_written_after_the_application(void)
{
    begin_writes(1);
    is_cut = true;
    while (bytes_on_their_way() == 0)
        run_ms(1);
    client.link.type->close(&client.link);
    CHECK_EQUAL(bytes_on_their_way(), 0);
}

static void what_is_no_frame_ends_the_connection(void)
{
    static const RTS_UI8 garbage[] = "HTTP/1.1 400 Bad Request";

    begin(1);
    run_ms(200);
    net_put(newest(), garbage, sizeof(garbage));
    run_ms(2500);
    CHECK(!fakes.sockets[0].open);
    CHECK_EQUAL(fakes.connects, 2);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

/* ---- by name ---- */

static void begin_by_name(void)
{
    begin(1);
    ModbusTcpSetHost(&client.link, "meter.plant");
}

static void a_host_is_looked_up_for_each_connection(void)
{
    begin_by_name();
    run_ms(1000);
    CHECK(newest()->host != NULL && strcmp(newest()->host, "meter.plant") == 0);
    CHECK_EQUAL(newest()->peer.port, 502);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK(ModbusTcpExplainName(&client.link) == NULL);
    newest()->peer_gone = true;
    run_ms(300);
    CHECK_EQUAL(fakes.connects, 2);
    CHECK(newest()->host != NULL);
}

static void a_name_that_is_not_known_is_asked_for_again_and_is_the_reason(void)
{
    begin_by_name();
    fakes.lookup_result = ERR_NO_OBJECT;
    run_ms(10000);
    CHECK(ModbusDeviceIsLost(&devices[0]));
    CHECK_EQUAL(devices[0].miss, MODBUS_MISS_NO_ENTRANCE);
    CHECK(strcmp(ModbusTcpExplainName(&client.link), "its host name is not known") == 0);
    CHECK(fakes.connects >= 5 && fakes.connects <= 11);
    fakes.lookup_result = ERR_TIMEOUT;
    run_ms(2000);
    CHECK(strcmp(ModbusTcpExplainName(&client.link), "no name server replies") == 0);
    fakes.lookup_result = ERR_OK;
    run_ms(2500);
    CHECK(ModbusDeviceIsGood(&devices[0]));
    CHECK(ModbusTcpExplainName(&client.link) == NULL);
}

/* The device is lost meanwhile, but the question stays: asked again each time, a slow server would never be heard. */
static void a_slow_name_server_is_waited_for_longer_than_for_a_connection(void)
{
    begin_by_name();
    fakes.lookup_result = ERR_NOT_READY_YET;
    run_ms(MODBUS_CONNECT_MS * 3);
    CHECK_EQUAL(fakes.connects, 1);
    CHECK(ModbusDeviceIsLost(&devices[0]));
    CHECK(strcmp(ModbusTcpExplainName(&client.link), "no name server replies") == 0);
    fakes.lookup_result = ERR_PENDING;
    run_ms(MODBUS_CONNECT_MS - 1000);
    CHECK_EQUAL(fakes.connects, 1); /* its time begins when the name is known */
    CHECK(ModbusTcpExplainName(&client.link) == NULL);
    fakes.lookup_result = ERR_OK;
    run_ms(2500);
    CHECK_EQUAL(fakes.connects, 1);
    CHECK(ModbusDeviceIsGood(&devices[0]));
}

int main(void)
{
    RUN(a_host_is_looked_up_for_each_connection);
    RUN(a_name_that_is_not_known_is_asked_for_again_and_is_the_reason);
    RUN(a_slow_name_server_is_waited_for_longer_than_for_a_connection);
    RUN(one_connection_serves_all_devices_of_a_gateway);
    RUN(a_refused_connection_is_tried_every_second);
    RUN(a_slow_connection_is_waited_for);
    RUN(a_connection_that_never_comes_is_given_up);
    RUN(a_connection_that_comes_or_fails_while_nothing_is_asked_is_seen);
    RUN(a_lost_connection_is_made_again);
    RUN(a_reply_of_another_transaction_is_passed_over);
    RUN(a_device_that_the_gateway_does_not_reach_is_lost);
    RUN(a_request_without_reply_ends_the_connection);
    RUN(a_silent_device_of_a_gateway_costs_the_others_little);
    RUN(a_peer_that_takes_nothing_is_lost_and_comes_back);
    RUN(a_peer_that_talks_all_the_time_is_lost);
    RUN(what_was_not_replied_to_is_not_written_later);
    RUN(what_is_on_its_way_is_not_written_after_the_application);
    RUN(what_is_no_frame_ends_the_connection);
    return test_result();
}
