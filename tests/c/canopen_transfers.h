/*
 * canopen_transfers.h - SDO transfers between a client and a CANopen device on a simulated bus, in virtual time: by
 * CanopenSdoClient.h, and in blocks also by a client of the tests. Client and device take no time.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef CANOPEN_TRANSFERS_H
#define CANOPEN_TRANSFERS_H

#include <string.h>

#include "../../firmware/port/sim/SimCan.h"
#include "CanopenDevice.h"
#include "CanopenSdoClient.h"
#include "CmpBytes.h"

enum { LONGEST = 2000, NODE = 5, CLIENT = 1, BIT_RATE = 500000, TIMEOUT_MS = 1000, SEGMENT = 7, BLOCK = 127 };
enum { NO_FAULT = 0xFFFFFF, WORD = 0x2000, TEXT = 0x2001, WORD_PLACE = 0, TEXT_PLACE = 8 };

static CANOPEN_SLAVE slave;
static RTS_UI8 values[LONGEST + 16];
static SDO_CLIENT client;
static RTS_UI8 received[LONGEST + 8];
static RTS_UI32 received_size;

static const CANOPEN_OBJECT objects[] = {
    {OBJECT_IDENTITY, 0, CANOPEN_UNSIGNED8, CANOPEN_ACCESS_READ, CANOPEN_CONSTANT, 1, 4},
    {WORD, 0, CANOPEN_UNSIGNED32, CANOPEN_ACCESS_READ | CANOPEN_ACCESS_WRITE, CANOPEN_IN_VALUES, 4, WORD_PLACE},
    {TEXT, 0, CANOPEN_VISIBLE_STRING, CANOPEN_ACCESS_READ | CANOPEN_ACCESS_WRITE, CANOPEN_IN_VALUES, LONGEST,
     TEXT_PLACE},
};

/* ---- the bus ---- */

/* Numbers of frames, of both directions, since the last begin(): one that gets lost, one that arrives twice, one that
 * arrives `delay_ms` later. */
static RTS_UI32 frames, lost_frame, doubled_frame, delayed_frame, delay_ms;
static bool is_without_blocks; /* the device */
static bool has_twice;         /* the client gets `twice` next */
static CAN_FRAME twice;

static struct {
    bool is_held, is_for_client;
    RTS_I64 until_ns;
    CAN_FRAME frame;
} held;

static RTS_UI32 now_ms(void)
{
    return 1 + (RTS_UI32)(SimCanNow() / 1000000);
}

static RTS_I64 ns_of(RTS_UI32 ms)
{
    return ((RTS_I64)ms - 1) * 1000000;
}

static bool send_of_device(const CAN_FRAME *frame)
{
    return SimCanSend(SIM_CAN_DEVICE, frame) == ERR_OK;
}

static bool send_of_client(void *owner, const CAN_FRAME *frame)
{
    RTS_UNUSED(owner);
    return SimCanSend(CLIENT, frame) == ERR_OK;
}

static RTS_UI32 copies_of_frame(const CAN_FRAME *frame, bool is_for_client)
{
    RTS_UI32 number = frames++;

    if (number == delayed_frame) {
        held.is_held = true;
        held.is_for_client = is_for_client;
        held.until_ns = SimCanNow() + (RTS_I64)delay_ms * 1000000;
        held.frame = *frame;
        return 0;
    }
    return number == lost_frame ? 0 : number == doubled_frame ? 2 : 1;
}

/* As a device that knows no blocks. */
static bool refuses(const CAN_FRAME *frame)
{
    CAN_FRAME reply = {.id = CANOPEN_SDO_REPLY + NODE, .size = 8, .data = {SDO_ABORT}};

    if (!is_without_blocks || (frame->data[0] != 0xC6 && frame->data[0] != 0xA4))
        return false;
    memcpy(reply.data + 1, frame->data + 1, 3);
    BytesPut32(reply.data + 4, SDO_ABORT_COMMAND);
    return send_of_device(&reply);
}

static void give_to_device(const CAN_FRAME *frame)
{
    if (!refuses(frame))
        CanopenDeviceTake(&slave, frame, BIT_RATE / 1000, now_ms());
}

static void release_held(void)
{
    if (!held.is_held || held.until_ns > SimCanNow())
        return;
    held.is_held = false;
    if (held.is_for_client) {
        twice = held.frame;
        has_twice = true;
    } else {
        give_to_device(&held.frame);
    }
}

/* The next thing that happens until a time [ns]; false: nothing will. */
static bool step_until(RTS_I64 end_ns)
{
    RTS_I64 next = SimCanNext();
    CAN_FRAME frame;

    if (held.is_held && held.until_ns < next)
        next = held.until_ns;
    if (next > end_ns || next == INT64_MAX) {
        if (end_ns != INT64_MAX && end_ns > SimCanNow())
            SimCanAdvance(end_ns);
        CanopenDevicePoll(&slave, now_ms());
        return false;
    }
    SimCanAdvance(next);
    while (SimCanReceive(SIM_CAN_DEVICE, &frame) == ERR_OK)
        for (RTS_UI32 count = copies_of_frame(&frame, false); count > 0; count--)
            give_to_device(&frame);
    release_held();
    CanopenDevicePoll(&slave, now_ms());
    return true;
}

static bool step(void)
{
    return step_until(INT64_MAX);
}

/* The next reply of the device until a time [ns]; false: there is none. */
static bool receive_until(CAN_FRAME *frame, RTS_I64 end_ns)
{
    for (;;) {
        if (has_twice) {
            *frame = twice;
            has_twice = false;
            return true;
        }
        while (SimCanReceive(CLIENT, frame) == ERR_OK) {
            RTS_UI32 count = frame->id == CANOPEN_SDO_REPLY + NODE ? copies_of_frame(frame, true) : 0;
            if (count == 2) {
                has_twice = true;
                twice = *frame;
            }
            if (count != 0)
                return true;
        }
        if (!step_until(end_ns))
            return false;
    }
}

static bool receive(CAN_FRAME *frame)
{
    return receive_until(frame, INT64_MAX);
}

/* Replies that no transfer has waited for, such as those to a request that has come twice. */
static void become_quiet(void)
{
    CAN_FRAME frame;

    while (receive(&frame))
        ;
}

static void begin(void)
{
    SimCanReset(BIT_RATE, 0);
    SimCanStart(SIM_CAN_DEVICE);
    SimCanStart(CLIENT);
    memset(&slave, 0, sizeof slave);
    slave.send = send_of_device;
    slave.objects = objects;
    slave.object_count = RTS_COUNT(objects);
    slave.values = values;
    slave.values_size = sizeof values;
    slave.first_node = NODE;
    memset(&client, 0, sizeof client);
    client.timeout_ms = TIMEOUT_MS;
    client.in = received;
    client.room = sizeof received;
    has_twice = is_without_blocks = held.is_held = false;
    lost_frame = doubled_frame = delayed_frame = NO_FAULT;
    (void)CanopenDeviceBegin(&slave, now_ms());
    CanopenDevicePoll(&slave, now_ms());
    while (step())
        ;
    frames = 0;
}

/* ---- by CanopenSdoClient.h ---- */

static bool end_transfer(void)
{
    CAN_FRAME frame;

    while (client.state == SDO_BUSY) {
        bool is_sent = SdoClientSend(&client, send_of_client, NULL, now_ms());
        if (receive_until(&frame, ns_of(is_sent ? client.since_ms + TIMEOUT_MS : now_ms() + 1)))
            SdoClientTake(&client, &frame, now_ms());
        SdoClientPoll(&client, now_ms());
    }
    while (!SdoClientSend(&client, send_of_client, NULL, now_ms())) /* an abort, or the end of a read in blocks */
        (void)step_until(ns_of(now_ms() + 1));
    received_size = client.done;
    return client.state == SDO_DONE;
}

static bool write_object(RTS_UI16 index, const RTS_UI8 *data, RTS_UI32 size)
{
    SdoClientWrite(&client, NODE, index, 0, data, size, now_ms());
    return end_transfer();
}

static bool read_object(RTS_UI16 index)
{
    SdoClientRead(&client, NODE, index, 0, now_ms());
    return end_transfer();
}

/* In segments, or expedited: longer values after the device has refused blocks. */
static bool write_segments(RTS_UI16 index, const RTS_UI8 *data, RTS_UI32 size)
{
    is_without_blocks = true;
    bool is_done = write_object(index, data, size);
    is_without_blocks = false;
    return is_done;
}

static bool read_segments(RTS_UI16 index)
{
    is_without_blocks = true;
    bool is_done = read_object(index);
    is_without_blocks = false;
    return is_done;
}

/* ---- in blocks, by a client of the tests ---- */

static void say(const RTS_UI8 *data)
{
    CAN_FRAME frame = {.id = CANOPEN_SDO_REQUEST + NODE, .size = 8};

    memcpy(frame.data, data, 8);
    while (SimCanSend(CLIENT, &frame) != ERR_OK && step())
        ;
}

static void give_up(void)
{
    static const RTS_UI8 abort[8] = {SDO_ABORT, TEXT & 0xFF, TEXT >> 8};

    say(abort);
    become_quiet();
}

/* True if a reply with this command comes; others are left out. */
static bool hears(RTS_UI8 command, RTS_UI8 mask, CAN_FRAME *frame)
{
    while (receive(frame))
        if ((frame->data[0] & mask) == command || frame->data[0] == SDO_ABORT)
            return frame->data[0] != SDO_ABORT;
    return false;
}

static RTS_UI16 crc_of(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 crc = 0;

    for (RTS_UI32 i = 0; i < size; i++) {
        crc ^= (RTS_UI32)data[i] << 8;
        for (int bit = 0; bit < 8; bit++)
            crc = (crc & 0x8000) != 0 ? crc << 1 ^ 0x1021 : crc << 1;
    }
    return (RTS_UI16)crc;
}

/* Segments `done` + 1 and on, of a block; after a lost one the device says the last in order. */
static bool send_blocks(const RTS_UI8 *data, RTS_UI32 size, RTS_UI8 block)
{
    RTS_UI32 segments = (size + SEGMENT - 1) / SEGMENT;
    RTS_UI32 stuck = 0;
    CAN_FRAME frame;

    for (RTS_UI32 done = 0; done < segments;) {
        RTS_UI32 of_block = segments - done < block ? segments - done : block;
        for (RTS_UI32 i = 1; i <= of_block; i++) {
            RTS_UI8 segment[8] = {(RTS_UI8)(i | (done + i == segments ? 0x80u : 0u))};
            RTS_UI32 at = (done + i - 1) * SEGMENT;
            memcpy(segment + 1, data + at, size - at < SEGMENT ? size - at : SEGMENT);
            say(segment);
        }
        if (!hears(0xA2, 0xFF, &frame) || frame.data[1] > of_block || frame.data[2] == 0)
            return false;
        stuck = frame.data[1] == 0 ? stuck + 1 : 0;
        if (stuck > 2)
            return false;
        done += frame.data[1];
        block = frame.data[2];
    }
    return true;
}

static bool write_blocks(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI8 request[8] = {0xC6, TEXT & 0xFF, TEXT >> 8};
    RTS_UI8 end[8] = {(RTS_UI8)(0xC1 | (SEGMENT - 1 - (size - 1) % SEGMENT) << 2)};
    CAN_FRAME frame;

    BytesPut32(request + 4, size);
    BytesPut16(end + 1, crc_of(data, size));
    say(request);
    if (hears(0xA4, 0xFF, &frame) && send_blocks(data, size, frame.data[4])) {
        say(end);
        if (hears(0xA1, 0xFF, &frame))
            return true;
    }
    give_up();
    return false;
}

/* Takes the segments of a block in order, and acknowledges them. 0: none has come. */
static RTS_UI32 take_block(RTS_UI32 done, bool *is_last)
{
    RTS_UI8 reply[8] = {0xA2, 0, BLOCK};
    RTS_UI32 next = 1;
    CAN_FRAME frame;

    while (next <= BLOCK && receive(&frame) && frame.data[0] != SDO_ABORT) {
        if ((frame.data[0] & 0x7F) != next || (done + next) * SEGMENT > sizeof received)
            continue;
        memcpy(received + (done + next - 1) * SEGMENT, frame.data + 1, SEGMENT);
        *is_last = (frame.data[0] & 0x80) != 0;
        next++;
        if (*is_last)
            break;
    }
    reply[1] = (RTS_UI8)(next - 1);
    say(reply);
    return next - 1;
}

static bool read_blocks(void)
{
    static const RTS_UI8 request[8] = {0xA4, TEXT & 0xFF, TEXT >> 8, 0, BLOCK}, go[8] = {0xA3}, end[8] = {0xA1};
    RTS_UI32 segments = 0, stuck = 0;
    bool is_last = false;
    CAN_FRAME frame;

    say(request);
    if (!hears(0xC6, 0xFF, &frame)) {
        give_up();
        return false;
    }
    RTS_UI32 size = BytesGet32(frame.data + 4);
    say(go);
    while (!is_last && stuck < 3) {
        RTS_UI32 more = take_block(segments, &is_last);
        segments += more;
        stuck = more == 0 ? stuck + 1 : 0;
    }
    if (!is_last || !hears(0xC1, 0xE3, &frame)) {
        give_up();
        return false;
    }
    received_size = segments * SEGMENT - (frame.data[0] >> 2 & 7u);
    bool is_right = received_size == size && BytesGet16(frame.data + 1) == crc_of(received, received_size);
    say(end); /* the next request may follow at once */
    return is_right;
}

#endif
