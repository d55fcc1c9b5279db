/*
 * test_comm_tunnel.c - the serial block driver with one more line: that within Modbus.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpBlkDrvSimpleCom.h"
#include "CmpChecksum.h"
#include "CmpPackets.h"
#include "ModbusTunnel.h"
#include "comm_fakes.h"
#include "test.h"

enum { TUNNEL_LINE = COM_MAX_LINES, REPLY_HEAD = sizeof(MODBUS_TUNNEL_REPLY) };

/* A packet that is answered on its own: RTSINFO, to any node, from node 1. */
static const RTS_UI8 question[] = {0xC5, 0x6B, 0x40, 0x40, 0x00, 0x11, 0x00, 0x01, 0x00, 0x23,
                                   0x00, 0x00, 0xC2, 0x00, 0x01, 0x01, 0x36, 0x65, 0x9D, 0xAB};

static RTS_UI8 sequence;
static RTS_UI8 pdu[MODBUS_MAX_PDU];

/* The size of the reply, which is in `pdu`. */
static RTS_UI32 ask(RTS_UI8 number, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI8 exception = 0;

    sequence = number;
    pdu[0] = MODBUS_ENCAPSULATED;
    pdu[1] = MODBUS_TUNNEL_MEI;
    pdu[2] = number;
    if (size != 0)
        memcpy(pdu + sizeof(MODBUS_TUNNEL_REQUEST), data, size);
    size = ModbusTunnelReply(pdu, (RTS_UI32)sizeof(MODBUS_TUNNEL_REQUEST) + size, &exception);
    CHECK_EQUAL(exception, 0);
    return size;
}

static RTS_UI32 make_frame(RTS_UI8 *frame)
{
    RTS_UI16 crc = CRC16Update(CRC16_INIT, question, sizeof(question));
    RTS_UI32 size = 0;

    frame[size++] = '#';
    frame[size++] = '<';
    for (RTS_UI32 i = 0; i < sizeof(question); i++) {
        frame[size++] = question[i];
        if (question[i] == '#')
            frame[size++] = '_';
    }
    frame[size++] = (RTS_UI8)crc;
    frame[size++] = (RTS_UI8)(crc >> 8);
    frame[size++] = '#';
    frame[size++] = '>';
    return size;
}

static void begin(void)
{
    fakes_start();
    ModbusTunnelReset();
    (void)ask(0, NULL, 0);
}

static bool has_frame(RTS_UI32 size)
{
    return size > REPLY_HEAD + 4 && memcmp(pdu + REPLY_HEAD, "#<", 2) == 0 && memcmp(pdu + size - 2, "#>", 2) == 0;
}

/* Nothing is done within the request, which a server takes in the middle of its own work. */
static void a_question_is_answered_in_the_cycle_of_the_driver(void)
{
    RTS_UI8 frame[64];
    RTS_UI32 size = make_frame(frame);

    begin();
    CHECK_EQUAL(ask(1, frame, size), REPLY_HEAD);
    CHECK_EQUAL(BlkDrvComGetCounters(TUNNEL_LINE)->frames, 0);
    CHECK_EQUAL(ask(2, NULL, 0), REPLY_HEAD);
    fakes_cycle(1);
    CHECK_EQUAL(BlkDrvComGetCounters(TUNNEL_LINE)->frames, 1);
    CHECK(has_frame(ask(3, NULL, 0)));
    CHECK(has_frame(ask(3, NULL, 0)));
    CHECK_EQUAL(ask(4, NULL, 0), REPLY_HEAD);
    CHECK_EQUAL(fakes.line_out_size, 0);
    CHECK_EQUAL(BlkDrvComGetCounters(0)->frames, 0);
}

static void a_question_in_pieces_is_one(void)
{
    RTS_UI8 frame[64];
    RTS_UI32 size = make_frame(frame);

    begin();
    for (RTS_UI32 i = 0; i < size; i++) {
        (void)ask((RTS_UI8)(1 + i), frame + i, 1);
        fakes_cycle(1);
    }
    CHECK(has_frame(ask((RTS_UI8)(1 + size), NULL, 0)));
}

/* Its buffers hold what they can, the queue of the driver some more; what has no room is dropped as on any line. */
static void answers_that_are_not_fetched_do_no_harm(void)
{
    RTS_UI8 frame[64];
    RTS_UI32 size = make_frame(frame);
    RTS_UI8 number = 1;
    RTS_UI32 answered = 0;

    begin();
    for (RTS_UI32 i = 0; i < 100; i++) {
        (void)ask(1, frame, size);
        ModbusTunnelReset();
        (void)ask(0, NULL, 0);
        (void)ask(1, frame, size);
        fakes_cycle(1);
    }
    for (RTS_UI32 i = 0; i < 20; i++) {
        answered += ask(++number, NULL, 0) > REPLY_HEAD;
        fakes_cycle(1);
    }
    CHECK(answered > 0);
    (void)ask(++number, frame, size);
    fakes_cycle(1);
    CHECK(has_frame(ask(++number, NULL, 0)));
}

static void the_line_of_the_port_works_beside_it(void)
{
    begin();
    fakes.line_in_size = make_frame(fakes.line_in);
    fakes_cycle(1);
    CHECK_EQUAL(BlkDrvComGetCounters(0)->frames, 1);
    CHECK(fakes.line_out_size != 0);
    CHECK_EQUAL(ask(1, NULL, 0), REPLY_HEAD);
    CHECK(BlkDrvComGetCounters(TUNNEL_LINE + 1) == NULL);
}

int main(void)
{
    RUN(a_question_is_answered_in_the_cycle_of_the_driver);
    RUN(a_question_in_pieces_is_one);
    RUN(answers_that_are_not_fetched_do_no_harm);
    RUN(the_line_of_the_port_works_beside_it);
    return test_result();
}
