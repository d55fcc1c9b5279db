/*
 * test_modbus_tunnel.c - a line of tools within Modbus: sequence numbers, lost replies, full buffers, and a server that
 * is set up again in the middle.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CmpPackets.h"
#include "ModbusPdu.h"
#include "ModbusRtu.h"
#include "ModbusServer.h"
#include "ModbusTunnel.h"
#include "modbus_fakes.h"
#include "test.h"

enum {
    UNIT = 247,
    BAUD = 19200,
    HEAD = sizeof(MODBUS_TUNNEL_REQUEST),
    REPLY_HEAD = sizeof(MODBUS_TUNNEL_REPLY),
    TAKES = MODBUS_MAX_PDU - HEAD,
    GIVES = MODBUS_MAX_PDU - REPLY_HEAD,
    STEP_NS = 100000,
};

static MODBUS_SERVER server;
static RTS_UI8 pdu[MODBUS_MAX_PDU + 8];
static RTS_UI8 bytes[1024];

static void begin(void)
{
    fakes_begin();
    ModbusTunnelReset();
    memset(&server, 0, sizeof(server));
    server.unit = UNIT;
    server.tunnel = true;
    for (RTS_UI32 i = 0; i < sizeof(bytes); i++)
        bytes[i] = (RTS_UI8)(i * 31 + i / 256);
}

/* Size of the reply, which is in `pdu`. */
static RTS_UI32 ask(RTS_UI8 sequence, const RTS_UI8 *data, RTS_UI32 size)
{
    const RTS_UI8 head[HEAD] = {MODBUS_ENCAPSULATED, MODBUS_TUNNEL_MEI, sequence};

    memset(pdu, 0xEE, sizeof(pdu));
    memcpy(pdu, head, HEAD);
    if (size != 0)
        memcpy(pdu + HEAD, data, size);
    size = ModbusServerReply(&server, pdu, HEAD + size);
    CHECK(size <= MODBUS_MAX_PDU);
    CHECK_EQUAL(pdu[MODBUS_MAX_PDU], 0xEE);
    return size;
}

/* Whether the reply in `pdu` says so and has these bytes. */
static bool is_reply(RTS_UI32 size, RTS_UI8 sequence, RTS_UI32 taken, const RTS_UI8 *data, RTS_UI32 data_size)
{
    const RTS_UI8 head[REPLY_HEAD] = {MODBUS_ENCAPSULATED, MODBUS_TUNNEL_MEI, sequence, (RTS_UI8)taken,
                                      (RTS_UI8)data_size};

    return size == REPLY_HEAD + data_size && memcmp(pdu, head, REPLY_HEAD) == 0 &&
           memcmp(pdu + REPLY_HEAD, data, data_size) == 0;
}

static bool is_exception(RTS_UI32 size, RTS_UI8 code)
{
    return size == 2 && pdu[0] == (MODBUS_ENCAPSULATED | MODBUS_EXCEPTION) && pdu[1] == code;
}

/* Whether these are all bytes that the block driver gets. */
static bool has_come(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI8 there[512];

    return ModbusTunnelRead(there, sizeof(there)) == size && memcmp(there, data, size) == 0;
}

static void bytes_go_in_both_directions(void)
{
    begin();
    CHECK(is_reply(ask(0, NULL, 0), 0, 0, bytes, 0));
    CHECK(is_reply(ask(1, bytes, 5), 1, 5, bytes, 0));
    CHECK(has_come(bytes, 5));
    CHECK_EQUAL(ModbusTunnelWrite(bytes + 7, 9), 9);
    CHECK(is_reply(ask(2, NULL, 0), 2, 0, bytes + 7, 9));
    CHECK(is_reply(ask(3, NULL, 0), 3, 0, bytes, 0));
    CHECK_EQUAL(server.requests, 4);
    CHECK_EQUAL(server.errors, 0);
}

/* Also while more has come to be sent. */
static void a_repeated_request_is_not_taken_twice_and_gets_the_same_reply(void)
{
    begin();
    (void)ask(0, NULL, 0);
    (void)ModbusTunnelWrite(bytes + 50, 3);
    CHECK(is_reply(ask(1, bytes, 4), 1, 4, bytes + 50, 3));
    (void)ModbusTunnelWrite(bytes + 53, 20);
    CHECK(is_reply(ask(1, bytes, 4), 1, 4, bytes + 50, 3));
    CHECK(has_come(bytes, 4));
    CHECK(is_reply(ask(1, bytes, 4), 1, 4, bytes + 50, 3));
    CHECK(has_come(bytes, 0));
    CHECK(is_reply(ask(2, NULL, 0), 2, 0, bytes + 53, 20));
}

static void the_numbers_go_round_without_the_one_to_begin(void)
{
    RTS_UI32 number = 0;

    begin();
    (void)ask(0, NULL, 0);
    for (RTS_UI32 i = 0; i < 1000; i++) {
        number = number == 255 ? 1 : number + 1;
        CHECK(is_reply(ask((RTS_UI8)number, bytes + i % 500, 2), (RTS_UI8)number, 2, bytes, 0));
        CHECK(has_come(bytes + i % 500, 2));
    }
}

static void a_number_that_does_not_follow_is_refused(void)
{
    begin();
    CHECK(is_exception(ask(1, bytes, 4), MODBUS_ILLEGAL_VALUE)); /* nothing has begun */
    (void)ask(0, NULL, 0);
    CHECK(is_exception(ask(2, bytes, 4), MODBUS_ILLEGAL_VALUE));
    CHECK(is_reply(ask(1, bytes, 4), 1, 4, bytes, 0));
    CHECK(is_exception(ask(255, bytes, 4), MODBUS_ILLEGAL_VALUE));
    CHECK(is_exception(ask(3, bytes, 4), MODBUS_ILLEGAL_VALUE));
    CHECK(is_exception(ask(0, bytes, 4), MODBUS_ILLEGAL_VALUE)); /* the beginning has no data */
    CHECK(has_come(bytes, 4));
    CHECK(is_reply(ask(2, bytes, 4), 2, 4, bytes, 0));
}

static void a_beginning_drops_both_directions(void)
{
    begin();
    (void)ask(0, NULL, 0);
    (void)ask(1, bytes, 10);
    (void)ModbusTunnelWrite(bytes, 10);
    (void)ask(2, NULL, 0);
    CHECK(is_reply(ask(0, NULL, 0), 0, 0, bytes, 0));
    CHECK(has_come(bytes, 0));
    CHECK(is_reply(ask(1, bytes + 20, 3), 1, 3, bytes, 0));
    CHECK(has_come(bytes + 20, 3));
}

static void what_does_not_fit_is_not_taken(void)
{
    begin();
    (void)ask(0, NULL, 0);
    CHECK(is_reply(ask(1, bytes, TAKES), 1, TAKES, bytes, 0));
    CHECK(is_reply(ask(2, bytes, 10), 2, 0, bytes, 0));
    CHECK(has_come(bytes, TAKES));
    CHECK(is_reply(ask(3, bytes, 200), 3, 200, bytes, 0));
    CHECK(is_reply(ask(4, bytes + 200, 200), 4, TAKES - 200, bytes, 0));
    CHECK(has_come(bytes, TAKES));
}

static void the_block_driver_waits_while_the_buffer_is_full(void)
{
    RTS_UI32 written;

    begin();
    (void)ask(0, NULL, 0);
    written = ModbusTunnelWrite(bytes, sizeof(bytes));
    CHECK_EQUAL(written, 2 * GIVES);
    CHECK_EQUAL(ModbusTunnelWrite(bytes, 1), 0);
    CHECK(is_reply(ask(1, NULL, 0), 1, 0, bytes, GIVES));
    CHECK_EQUAL(ModbusTunnelWrite(bytes + written, 1), 0); /* the reply may be lost */
    CHECK(is_reply(ask(2, NULL, 0), 2, 0, bytes + GIVES, GIVES));
    CHECK_EQUAL(ModbusTunnelWrite(bytes + written, sizeof(bytes) - written), GIVES);
    CHECK(is_reply(ask(3, NULL, 0), 3, 0, bytes + 2 * GIVES, GIVES));
}

static void a_request_that_is_too_short_is_refused(void)
{
    begin();
    (void)ask(0, NULL, 0);
    pdu[0] = MODBUS_ENCAPSULATED;
    pdu[1] = MODBUS_TUNNEL_MEI;
    CHECK(is_exception(ModbusServerReply(&server, pdu, 2), MODBUS_ILLEGAL_VALUE));
    pdu[0] = MODBUS_ENCAPSULATED;
    CHECK(is_exception(ModbusServerReply(&server, pdu, 1), MODBUS_ILLEGAL_VALUE));
    CHECK(is_reply(ask(1, bytes, 1), 1, 1, bytes, 0));
}

static void only_a_server_with_the_line_of_tools_has_it(void)
{
    begin();
    server.tunnel = false;
    CHECK(is_exception(ask(0, NULL, 0), MODBUS_ILLEGAL_FUNCTION));
    server.tcp = true;
    CHECK(is_exception(ask(0, bytes, 100), MODBUS_ILLEGAL_FUNCTION));
}

static void a_server_without_memory_has_no_registers(void)
{
    static const RTS_UI8 read_one[] = {MODBUS_READ_HOLDING_REGISTERS, 0, 0, 0, 1};
    static const RTS_UI8 identify[] = {MODBUS_ENCAPSULATED, MODBUS_DEVICE_IDENTIFICATION, 1, 0};

    begin();
    memcpy(pdu, read_one, sizeof(read_one));
    CHECK_EQUAL(ModbusServerReply(&server, pdu, sizeof(read_one)), 2);
    CHECK_EQUAL(pdu[1], MODBUS_ILLEGAL_FUNCTION);
    memcpy(pdu, identify, sizeof(identify));
    CHECK(ModbusServerReply(&server, pdu, sizeof(identify)) > MODBUS_ID_HEAD);
}

/* ---- on a line ---- */

static MODBUS_LINK link;
static RTS_UI8 frame[512];

static void begin_line(RTS_UI8 unit)
{
    const SYSCOM_SETTINGS settings = {BAUD, SYSCOM_PARITY_EVEN, 1, false};

    memset(&server, 0, sizeof(server));
    memset(&link, 0, sizeof(link));
    server.unit = unit;
    server.tunnel = true;
    ModbusRtuBegin(&link, 1, &settings);
}

/* Size of the frame that comes back, which is in `frame`. */
static RTS_UI32 send_frame(RTS_UI8 unit, RTS_UI8 sequence, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI8 request[1 + MODBUS_MAX_PDU] = {unit, MODBUS_ENCAPSULATED, MODBUS_TUNNEL_MEI, sequence};
    RTS_I64 end = fakes.now_ns + 500000000;
    RTS_UI32 received = 0;

    if (size != 0)
        memcpy(request + 1 + HEAD, data, size);
    line_send_frame(request, 1 + HEAD + size);
    for (; fakes.now_ns < end; fakes.now_ns += STEP_NS) {
        (void)ModbusServerPoll(&server, &link, fakes.now_ns);
        received += line_take(frame + received, sizeof(frame) - received);
    }
    return received;
}

/* As a download does: what was taken from the old server is replied to by the new one. */
static void a_server_that_is_set_up_again_goes_on(void)
{
    begin();
    begin_line(UNIT);
    CHECK_EQUAL(send_frame(UNIT, 0, NULL, 0), 1 + REPLY_HEAD + MODBUS_CRC_SIZE);
    CHECK_EQUAL(send_frame(UNIT, 1, bytes, 8), 1 + REPLY_HEAD + MODBUS_CRC_SIZE);
    begin_line(5); /* other settings, as those of a program */
    CHECK_EQUAL(send_frame(UNIT, 1, bytes, 8), 0);
    CHECK(has_come(bytes, 8));
    (void)ModbusTunnelWrite(bytes + 100, 6);
    CHECK_EQUAL(send_frame(5, 1, bytes, 8), 1 + REPLY_HEAD + MODBUS_CRC_SIZE); /* the reply that was lost */
    CHECK(has_come(bytes, 0));
    CHECK_EQUAL(send_frame(5, 2, NULL, 0), 1 + REPLY_HEAD + 6 + MODBUS_CRC_SIZE);
    CHECK(memcmp(frame + 1 + REPLY_HEAD, bytes + 100, 6) == 0);
}

static void the_longest_frames_arrive(void)
{
    begin();
    begin_line(UNIT);
    (void)send_frame(UNIT, 0, NULL, 0);
    (void)ModbusTunnelWrite(bytes, GIVES + 10);
    CHECK_EQUAL(send_frame(UNIT, 1, bytes, TAKES), 1 + MODBUS_MAX_PDU + MODBUS_CRC_SIZE);
    CHECK(has_come(bytes, TAKES));
}

static void a_broadcast_is_for_no_tool(void)
{
    begin();
    begin_line(UNIT);
    (void)send_frame(UNIT, 0, NULL, 0);
    CHECK_EQUAL(send_frame(MODBUS_BROADCAST, 1, bytes, 5), 0);
    CHECK(has_come(bytes, 0));
    CHECK_EQUAL(send_frame(UNIT, 1, bytes, 5), 1 + REPLY_HEAD + MODBUS_CRC_SIZE);
    CHECK(has_come(bytes, 5));
}

int main(void)
{
    RUN(bytes_go_in_both_directions);
    RUN(a_repeated_request_is_not_taken_twice_and_gets_the_same_reply);
    RUN(the_numbers_go_round_without_the_one_to_begin);
    RUN(a_number_that_does_not_follow_is_refused);
    RUN(a_beginning_drops_both_directions);
    RUN(what_does_not_fit_is_not_taken);
    RUN(the_block_driver_waits_while_the_buffer_is_full);
    RUN(a_request_that_is_too_short_is_refused);
    RUN(only_a_server_with_the_line_of_tools_has_it);
    RUN(a_server_without_memory_has_no_registers);
    RUN(a_server_that_is_set_up_again_goes_on);
    RUN(the_longest_frames_arrive);
    RUN(a_broadcast_is_for_no_tool);
    return test_result();
}
