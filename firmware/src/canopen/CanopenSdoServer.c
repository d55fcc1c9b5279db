/*
 * CanopenSdoServer.c - the SDO server of a CANopen device.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A value is read when its transfer begins and written when it has ended, so that a client never sees or makes half of one.
 */
#include "CanopenSdoServer.h"

#include <string.h>

#include "CanopenAccess.h"
#include "CmpBytes.h"
#include "CmpChecksum.h"

#if CANOPEN_DEVICE_DATA > 0

enum {
    EXPEDITED = 4,
    SEGMENT = 7,
    FRAME = 8,
    AGAIN_MS = 1,
    MOST_SEGMENTS = 127,
    /* requests: the three highest bits */
    WRITE_SEGMENT = 0,
    WRITE_BEGIN = 1,
    READ_BEGIN = 2,
    READ_SEGMENT = 3,
    ABORT = 4,
    READ_BLOCK = 5,
    WRITE_BLOCK = 6,
    /* bits of requests and replies */
    HAS_SIZE = 0x01,
    IS_EXPEDITED = 0x02,
    IS_LAST = 0x01,
    BLOCK_HAS_SIZE = 0x02,
    BLOCK_HAS_CRC = 0x04,
    BLOCK_IS_LAST = 0x80,
    BLOCK_KIND = 0x03, /* of READ_BLOCK: what follows; WRITE_BLOCK has one bit of it */
    BLOCK_BEGINS = 0,
    BLOCK_ENDS = 1,
    BLOCK_REPLIES = 2,
    BLOCK_STARTS = 3,
    READ_SIZE = 0x41,
    WRITE_BLOCK_BEGUN = 0xA4,
    WRITE_BLOCK_DONE = 0xA2,
    WRITE_BLOCK_ENDED = 0xA1,
    READ_BLOCK_BEGUN = 0xC6,
    READ_BLOCK_ENDS = 0xC1,
};

/* ---- replies ---- */

static RTS_UI8 *reply(CANOPEN_SLAVE *slave, RTS_UI8 command)
{
    CAN_FRAME *frame = &slave->server.reply;

    memset(frame, 0, sizeof(*frame));
    frame->id = CANOPEN_SDO_REPLY + (RTS_UI32)slave->node;
    frame->size = FRAME;
    frame->data[0] = command;
    slave->server.has_reply = true;
    return frame->data;
}

static RTS_UI8 *reply_of_object(CANOPEN_SLAVE *slave, RTS_UI8 command)
{
    RTS_UI8 *data = reply(slave, command);

    BytesPut16(data + 1, slave->server.object.index);
    data[3] = slave->server.object.sub;
    return data + 4;
}

static void end_by(CANOPEN_SLAVE *slave, RTS_UI32 abort)
{
    BytesPut32(reply_of_object(slave, SDO_ABORT), abort);
    slave->server.state = SERVER_IDLE;
    slave->counters.aborts++;
    slave->counters.last_abort = abort;
}

/* ---- a program ---- */

#if CANOPEN_PROGRAM_DOWNLOAD
/* A program has more bytes than there is room for: parts of it are passed on. */
static bool is_stream(const SDO_SERVER *server)
{
    return server->object.where == CANOPEN_PROGRAM_OBJECT && server->object.place == PROGRAM_DATA;
}

static RTS_UI32 begin_stream(CANOPEN_SLAVE *slave)
{
    SDO_SERVER *server = &slave->server;

    server->passed_on = 0;
    server->crc = 0;
    return slave->program->begin(server->has_size, server->size);
}

static RTS_UI32 pass_on(CANOPEN_SLAVE *slave)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 size = server->done;

    server->crc = CRC16Update(server->crc, server->data, size);
    server->passed_on += size;
    server->done = 0;
    return slave->program->write(server->data, size);
}

static RTS_UI32 end_stream(CANOPEN_SLAVE *slave)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 abort = pass_on(slave);

    if (abort == 0 && server->has_size && server->size != server->passed_on)
        abort = SDO_ABORT_LENGTH;
    return abort == 0 ? slave->program->end() : abort;
}

#define crc_before(server) (is_stream(server) ? (server)->crc : 0u)
#define replies_later(abort) ((abort) == CANOPEN_REPLIES_LATER)
#else
#define is_stream(server) false
#define begin_stream(slave) 0
#define pass_on(slave) 0
#define end_stream(slave) 0
#define crc_before(server) 0
#define replies_later(abort) false
#endif

/* Bytes that `data` may have. */
static RTS_UI32 get_room(const SDO_SERVER *server)
{
    return is_stream(server) ? CANOPEN_DEVICE_SDO / SEGMENT * SEGMENT : server->object.size;
}

/* ---- the beginning ---- */

static RTS_UI32 begin(CANOPEN_SLAVE *slave, const RTS_UI8 *data)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI16 index = BytesGet16(data + 1);

    server->state = SERVER_IDLE;
    server->toggle = 0;
    server->sequence = 0;
    server->size = server->done = 0;
    server->is_last = server->has_size = server->has_crc = false;
    slave->counters.transfers++;
    server->object = (CANOPEN_OBJECT){.index = index, .sub = data[3]};
    return CanopenDictFind(slave, index, data[3], &server->object);
}

/* The value is whole. */
static RTS_UI32 write_value(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    SDO_SERVER *server = &slave->server;

    if (is_stream(server))
        return end_stream(slave);
    if (server->has_size && server->size != server->done)
        return SDO_ABORT_LENGTH;
    return CanopenAccessWrite(slave, &server->object, server->data, server->done, now_ms);
}

static void write_expedited(CANOPEN_SLAVE *slave, const RTS_UI8 *data, RTS_UI32 now_ms)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 size = (data[0] & HAS_SIZE) != 0 ? EXPEDITED - (data[0] >> 2 & 3u) : EXPEDITED;

    if ((data[0] & HAS_SIZE) == 0 && server->object.size < size)
        size = server->object.size;
    memcpy(server->data, data + 4, size);
    RTS_UI32 abort = CanopenAccessWrite(slave, &server->object, server->data, size, now_ms);
    if (replies_later(abort))
        return;
    if (abort != 0)
        end_by(slave, abort);
    else
        (void)reply_of_object(slave, SDO_WRITE_DONE);
}

/* Checks the size that a client says before it sends the value. */
static RTS_UI32 note_size(CANOPEN_SLAVE *slave, bool has_size, RTS_UI32 size)
{
    SDO_SERVER *server = &slave->server;

    server->has_size = has_size;
    server->size = size;
    if (is_stream(server))
        return begin_stream(slave);
    return CanopenAccessCheck(&server->object, has_size ? size : server->object.size);
}

static void begin_write(CANOPEN_SLAVE *slave, const RTS_UI8 *data, RTS_UI32 now_ms)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 abort = begin(slave, data);

    if (abort == 0 && (data[0] & IS_EXPEDITED) != 0) {
        write_expedited(slave, data, now_ms);
        return;
    }
    if (abort == 0)
        abort = note_size(slave, (data[0] & HAS_SIZE) != 0, BytesGet32(data + 4));
    if (abort != 0) {
        end_by(slave, abort);
        return;
    }
    server->state = SERVER_WRITE;
    (void)reply_of_object(slave, SDO_WRITE_DONE);
}

static RTS_UI32 begin_to_read(CANOPEN_SLAVE *slave, const RTS_UI8 *data)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 abort = begin(slave, data);

    return abort != 0 ? abort : CanopenAccessRead(slave, &server->object, server->data, &server->size);
}

static void reply_value(CANOPEN_SLAVE *slave)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 size = server->size;

    if (size > 0 && size <= EXPEDITED) {
        memcpy(reply_of_object(slave, (RTS_UI8)(READ_SIZE | IS_EXPEDITED | (EXPEDITED - size) << 2)), server->data,
               size);
        return;
    }
    BytesPut32(reply_of_object(slave, READ_SIZE), size);
    server->state = SERVER_READ;
}

static void begin_read(CANOPEN_SLAVE *slave, const RTS_UI8 *data)
{
    RTS_UI32 abort = begin_to_read(slave, data);

    if (abort != 0)
        end_by(slave, abort);
    else
        reply_value(slave);
}

/* ---- segments ---- */

static void take_segment(CANOPEN_SLAVE *slave, const RTS_UI8 *data, RTS_UI32 now_ms)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 size = SEGMENT - (data[0] >> 1 & 7u);
    RTS_UI32 abort = 0;

    if (server->state != SERVER_WRITE)
        abort = SDO_ABORT_COMMAND;
    else if ((data[0] & SDO_TOGGLE) != server->toggle)
        abort = SDO_ABORT_TOGGLE;
    else if (server->done + size > get_room(server))
        abort = SDO_ABORT_TOO_LONG;
    if (abort == 0) {
        memcpy(server->data + server->done, data + 1, size);
        server->done += size;
        if ((data[0] & IS_LAST) != 0)
            abort = write_value(slave, now_ms);
        else if (is_stream(server))
            abort = pass_on(slave);
    }
    if (abort != 0) {
        end_by(slave, abort);
        return;
    }
    (void)reply(slave, (RTS_UI8)(SDO_SEGMENT_DONE | server->toggle));
    server->toggle ^= SDO_TOGGLE;
    if ((data[0] & IS_LAST) != 0)
        server->state = SERVER_IDLE;
}

static void give_segment(CANOPEN_SLAVE *slave, const RTS_UI8 *data)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 left = server->size - server->done;
    RTS_UI32 size = left < SEGMENT ? left : SEGMENT;

    if (server->state != SERVER_READ || (data[0] & SDO_TOGGLE) != server->toggle) {
        end_by(slave, server->state != SERVER_READ ? SDO_ABORT_COMMAND : SDO_ABORT_TOGGLE);
        return;
    }
    RTS_UI8 last = size == left ? IS_LAST : 0;
    memcpy(reply(slave, (RTS_UI8)(server->toggle | (SEGMENT - size) << 1 | last)) + 1, server->data + server->done,
           size);
    server->done += size;
    server->toggle ^= SDO_TOGGLE;
    if (last != 0)
        server->state = SERVER_IDLE;
}

/* ---- blocks that are written ---- */

/* So many segments as there is room for. */
static RTS_UI8 get_block(const SDO_SERVER *server)
{
    RTS_UI32 room = get_room(server);
    RTS_UI32 left = room > server->done ? room - server->done : 0;
    RTS_UI32 segments = (left + SEGMENT - 1) / SEGMENT;

    if (segments == 0)
        return 1;
    return (RTS_UI8)(segments < MOST_SEGMENTS ? segments : MOST_SEGMENTS);
}

static void begin_block_write(CANOPEN_SLAVE *slave, const RTS_UI8 *data)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 abort = begin(slave, data);

    if (abort == 0)
        abort = note_size(slave, (data[0] & BLOCK_HAS_SIZE) != 0, BytesGet32(data + 4));
    if (abort != 0) {
        end_by(slave, abort);
        return;
    }
    server->has_crc = (data[0] & BLOCK_HAS_CRC) != 0;
    server->state = SERVER_BLOCK_WRITE;
    server->block = get_block(server);
    *reply_of_object(slave, WRITE_BLOCK_BEGUN) = server->block;
}

static void reply_to_block(CANOPEN_SLAVE *slave)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 abort = is_stream(server) && !server->is_last ? pass_on(slave) : 0;

    if (abort != 0) {
        end_by(slave, abort);
        return;
    }
    RTS_UI8 *data = reply(slave, WRITE_BLOCK_DONE);

    data[1] = server->sequence;
    server->block = get_block(server);
    data[2] = server->block;
    server->sequence = 0;
    if (server->is_last)
        server->state = SERVER_BLOCK_WRITE_END;
}

/* A segment out of order is ignored: the reply to the block names the last one in order. */
static void take_block_segment(CANOPEN_SLAVE *slave, const RTS_UI8 *data)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 sequence = data[0] & ~(RTS_UI32)BLOCK_IS_LAST;
    bool is_last = (data[0] & BLOCK_IS_LAST) != 0;

    if (sequence == 0 || sequence > server->block) {
        end_by(slave, SDO_ABORT_SEQUENCE);
        return;
    }
    if (sequence == server->sequence + 1u && !server->is_last) {
        if (server->done >= get_room(server)) {
            end_by(slave, SDO_ABORT_TOO_LONG);
            return;
        }
        memcpy(server->data + server->done, data + 1, SEGMENT);
        server->done += SEGMENT;
        server->sequence = (RTS_UI8)sequence;
        server->is_last = is_last;
    }
    if (is_last || sequence == server->block)
        reply_to_block(slave);
}

static void end_block_write(CANOPEN_SLAVE *slave, const RTS_UI8 *data, RTS_UI32 now_ms)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 unused = data[0] >> 2 & 7u;
    RTS_UI32 abort = 0;

    if (unused > SEGMENT || unused > server->done) {
        end_by(slave, SDO_ABORT_LENGTH);
        return;
    }
    server->done -= unused;
    if (server->has_crc && BytesGet16(data + 1) != CRC16Update(crc_before(server), server->data, server->done))
        abort = SDO_ABORT_CRC;
    if (abort == 0)
        abort = write_value(slave, now_ms);
    if (abort != 0) {
        end_by(slave, abort);
        return;
    }
    (void)reply(slave, WRITE_BLOCK_ENDED);
    server->state = SERVER_IDLE;
}

static void take_write_block(CANOPEN_SLAVE *slave, const RTS_UI8 *data, RTS_UI32 now_ms)
{
    if ((data[0] & BLOCK_ENDS) == 0)
        begin_block_write(slave, data);
    else if (slave->server.state == SERVER_BLOCK_WRITE_END)
        end_block_write(slave, data, now_ms);
    else
        end_by(slave, SDO_ABORT_COMMAND);
}

/* ---- blocks that are read ---- */

static void begin_block_read(CANOPEN_SLAVE *slave, const RTS_UI8 *data)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 abort = begin_to_read(slave, data);

    if (abort == 0 && (data[4] == 0 || data[4] > MOST_SEGMENTS))
        abort = SDO_ABORT_BLOCK_SIZE;
    if (abort != 0) {
        end_by(slave, abort);
        return;
    }
    if (data[5] != 0 && server->size <= data[5]) { /* so few bytes that the client prefers segments */
        reply_value(slave);
        return;
    }
    server->has_crc = (data[0] & BLOCK_HAS_CRC) != 0;
    server->block = data[4];
    server->block_start = 0;
    server->state = SERVER_BLOCK_READ_READY;
    BytesPut32(reply_of_object(slave, READ_BLOCK_BEGUN), server->size);
}

/* The next segment of a block. An empty value has one empty segment. */
static void give_block_segment(CANOPEN_SLAVE *slave)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 left = server->size - server->done;
    RTS_UI32 size = left < SEGMENT ? left : SEGMENT;

    server->sequence++;
    server->is_last = size == left;
    memcpy(reply(slave, (RTS_UI8)(server->sequence | (server->is_last ? BLOCK_IS_LAST : 0))) + 1,
           server->data + server->done, size);
    server->done += size;
    if (server->is_last || server->sequence == server->block)
        server->state = SERVER_BLOCK_READ_WAIT;
}

static void start_block(SDO_SERVER *server)
{
    server->has_reply = false;
    server->sequence = 0;
    server->block_start = server->done;
    server->state = SERVER_BLOCK_READ;
}

static void take_block_reply(CANOPEN_SLAVE *slave, const RTS_UI8 *data)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 done = server->block_start + data[1] * (RTS_UI32)SEGMENT;

    if (data[1] > server->sequence) {
        end_by(slave, SDO_ABORT_SEQUENCE);
        return;
    }
    if (data[1] == server->sequence && server->is_last) {
        RTS_UI32 segments = (server->size + SEGMENT - 1) / SEGMENT;
        RTS_UI32 unused = (segments == 0 ? 1 : segments) * SEGMENT - server->size;
        server->state = SERVER_BLOCK_READ_END;
        BytesPut16(reply(slave, (RTS_UI8)(READ_BLOCK_ENDS | unused << 2)) + 1,
                   server->has_crc ? CRC16Update(0, server->data, server->size) : 0);
        return;
    }
    if (data[2] == 0 || data[2] > MOST_SEGMENTS) {
        end_by(slave, SDO_ABORT_BLOCK_SIZE);
        return;
    }
    server->block = data[2];
    server->done = done;
    start_block(server);
}

static void take_read_block(CANOPEN_SLAVE *slave, const RTS_UI8 *data)
{
    SDO_SERVER *server = &slave->server;
    RTS_UI32 kind = data[0] & BLOCK_KIND;

    if (kind == BLOCK_BEGINS)
        begin_block_read(slave, data);
    else if (kind == BLOCK_STARTS && server->state == SERVER_BLOCK_READ_READY)
        start_block(server);
    else if (kind == BLOCK_REPLIES && (server->state == SERVER_BLOCK_READ_WAIT || server->state == SERVER_BLOCK_READ))
        take_block_reply(slave, data);
    else if (kind == BLOCK_ENDS && server->state == SERVER_BLOCK_READ_END)
        server->state = SERVER_IDLE;
    else
        end_by(slave, SDO_ABORT_COMMAND);
}

/* ---- requests ---- */

static void take(CANOPEN_SLAVE *slave, const RTS_UI8 *data, RTS_UI32 now_ms)
{
    switch (data[0] >> 5) {
    case WRITE_SEGMENT:
        take_segment(slave, data, now_ms);
        break;
    case WRITE_BEGIN:
        begin_write(slave, data, now_ms);
        break;
    case READ_BEGIN:
        begin_read(slave, data);
        break;
    case READ_SEGMENT:
        give_segment(slave, data);
        break;
    case READ_BLOCK:
        take_read_block(slave, data);
        break;
    case WRITE_BLOCK:
        take_write_block(slave, data, now_ms);
        break;
    default:
        end_by(slave, SDO_ABORT_COMMAND);
        break;
    }
}

void SdoServerTake(CANOPEN_SLAVE *slave, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    SDO_SERVER *server = &slave->server;

    if (frame->size != FRAME || (frame->flags & CAN_FLAG_REMOTE) != 0)
        return;
    server->since_ms = now_ms;
    if (frame->data[0] == SDO_ABORT)
        server->state = SERVER_IDLE;
    else if (server->state == SERVER_BLOCK_WRITE)
        take_block_segment(slave, frame->data);
    else
        take(slave, frame->data, now_ms);
    SdoServerPoll(slave, now_ms);
}

static bool flush(CANOPEN_SLAVE *slave)
{
    if (slave->server.has_reply)
        slave->server.has_reply = !slave->send(&slave->server.reply);
    return !slave->server.has_reply;
}

void SdoServerPoll(CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    SDO_SERVER *server = &slave->server;

    if (server->state != SERVER_IDLE && now_ms - server->since_ms >= SDO_SERVER_MS)
        end_by(slave, SDO_ABORT_TIMEOUT);
    while (flush(slave) && server->state == SERVER_BLOCK_READ)
        give_block_segment(slave);
}

void SdoServerReset(CANOPEN_SLAVE *slave)
{
    slave->server.state = SERVER_IDLE;
    slave->server.has_reply = false;
}

RTS_UI32 SdoServerGetWaitMs(const CANOPEN_SLAVE *slave, RTS_UI32 now_ms)
{
    const SDO_SERVER *server = &slave->server;
    RTS_UI32 since_ms = now_ms - server->since_ms;

    if (server->has_reply)
        return AGAIN_MS;
    if (server->state == SERVER_IDLE)
        return UINT32_MAX;
    return since_ms < SDO_SERVER_MS ? SDO_SERVER_MS - since_ms : 0;
}

#endif
