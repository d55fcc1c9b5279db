/*
 * CanopenSdoClient.c - reads and writes objects of one node at a time.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenSdoClient.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpChecksum.h"

enum { EXPEDITED = 4, SEGMENT = 7, FRAME = 8, HAS_SIZE = 1, IS_EXPEDITED = 2, IS_LAST = 1 };

#if CANOPEN_SDO_BLOCK
enum {
    NO_BLOCK,
    WRITE_BEGINS,
    WRITE_SENDS, /* segments of a block */
    WRITE_WAITS, /* for their acknowledgement */
    WRITE_ENDS,
    READ_ABORTS, /* the normal read that reported the size */
    READ_BEGINS,
    READ_RECEIVES,
    READ_ENDS,
};

enum {
    MOST_SEGMENTS = 127,
    MOST_STUCK = 5,
    BLOCK_IS_LAST = 0x80,
    BLOCK_HAS_CRC = 0x04,
    BLOCK_HAS_SIZE = 0x02,
    WRITE_BLOCK = 0xC6, /* with CRC and size */
    WRITE_BLOCK_BEGUN = 0xA0,
    WRITE_BLOCK_DONE = 0xA2,
    WRITE_BLOCK_END = 0xC1, /* | 4 * bytes that are unused */
    WRITE_BLOCK_ENDED = 0xA1,
    READ_BLOCK = 0xA4, /* with CRC */
    READ_BLOCK_BEGUN = 0xC0,
    READ_BLOCK_START = 0xA3,
    READ_BLOCK_DONE = 0xA2,
    READ_BLOCK_ENDS = 0xC1, /* | 4 * bytes that are unused */
    READ_BLOCK_END = 0xA1,
};
#endif

static RTS_UI8 *begin_request(SDO_CLIENT *client, RTS_UI8 command)
{
    CAN_FRAME *request = &client->request;

    memset(request, 0, sizeof(*request));
    request->id = CANOPEN_SDO_REQUEST + (RTS_UI32)client->node;
    request->size = FRAME;
    request->data[0] = command;
    client->has_request = true;
    return request->data;
}

static RTS_UI8 *begin_of_object(SDO_CLIENT *client, RTS_UI8 command)
{
    RTS_UI8 *data = begin_request(client, command);

    BytesPut16(data + 1, client->index);
    data[3] = client->sub;
    return data + 4;
}

static void begin(SDO_CLIENT *client, RTS_UI8 node, RTS_UI16 index, RTS_UI8 sub, RTS_UI32 now_ms)
{
    client->state = SDO_BUSY;
    client->node = node;
    client->index = index;
    client->sub = sub;
    client->segmented = false;
    client->toggle = 0;
    client->done = 0;
    client->abort = 0;
    client->since_ms = now_ms;
#if CANOPEN_SDO_BLOCK
    client->phase = NO_BLOCK;
    client->without_block = false;
#endif
}

void SdoClientRead(SDO_CLIENT *client, RTS_UI8 node, RTS_UI16 index, RTS_UI8 sub, RTS_UI32 now_ms)
{
    begin(client, node, index, sub, now_ms);
    client->writes = false;
    client->size = 0;
    (void)begin_of_object(client, SDO_READ);
}

/* Of a write. */
static void begin_segments(SDO_CLIENT *client)
{
    client->segmented = true;
    BytesPut32(begin_of_object(client, SDO_WRITE_BEGIN), client->size);
}

void SdoClientWrite(SDO_CLIENT *client, RTS_UI8 node, RTS_UI16 index, RTS_UI8 sub, const RTS_UI8 *data, RTS_UI32 size,
                    RTS_UI32 now_ms)
{
    begin(client, node, index, sub, now_ms);
    client->writes = true;
    client->out = data;
    client->size = size;
    if (size != 0 && size <= EXPEDITED) {
        memcpy(begin_of_object(client, (RTS_UI8)(SDO_WRITE_EXPEDITED | (EXPEDITED - size) << 2)), data, size);
        client->done = size;
        return;
    }
#if CANOPEN_SDO_BLOCK
    if (size >= SDO_BLOCK_FROM) {
        client->phase = WRITE_BEGINS;
        BytesPut32(begin_of_object(client, WRITE_BLOCK), size);
        return;
    }
#endif
    begin_segments(client);
}

static void end(SDO_CLIENT *client, SDO_STATE state, RTS_UI32 abort)
{
    client->state = state;
    client->abort = abort;
}

/* Ends the transfer in the node, too. */
static void give_up(SDO_CLIENT *client, SDO_STATE state, RTS_UI32 abort)
{
    BytesPut32(begin_of_object(client, SDO_ABORT), abort);
    end(client, state, abort);
}

/* ---- writing ---- */

static void send_segment(SDO_CLIENT *client)
{
    RTS_UI32 left = client->size - client->done;
    RTS_UI32 size = left < SEGMENT ? left : SEGMENT;
    RTS_UI8 *data = begin_request(
        client, (RTS_UI8)(SDO_WRITE_SEGMENT | client->toggle | (SEGMENT - size) << 1 | (size == left ? IS_LAST : 0)));

    memcpy(data + 1, client->out + client->done, size);
    client->done += size;
}

static void take_of_write(SDO_CLIENT *client, const RTS_UI8 *data, bool is_of_object)
{
    if (data[0] == SDO_WRITE_DONE && is_of_object && client->toggle == 0 && client->segmented && client->done == 0) {
        if (client->size == 0)
            end(client, SDO_DONE, 0);
        else
            send_segment(client);
    } else if (data[0] == SDO_WRITE_DONE && is_of_object && !client->segmented) {
        end(client, SDO_DONE, 0);
    } else if (client->segmented && client->done != 0 && (data[0] & SDO_KIND) == SDO_SEGMENT_DONE) {
        if ((data[0] & SDO_TOGGLE) != client->toggle)
            return; /* a reply that came twice */
        client->toggle ^= SDO_TOGGLE;
        if (client->done == client->size)
            end(client, SDO_DONE, 0);
        else
            send_segment(client);
    }
}

/* ---- reading ---- */

static void ask_segment(SDO_CLIENT *client)
{
    (void)begin_request(client, (RTS_UI8)(SDO_READ_SEGMENT | client->toggle));
}

#if CANOPEN_SDO_BLOCK
/* True: the normal read is ended, and one in blocks follows. */
static bool is_worth_blocks(SDO_CLIENT *client, const RTS_UI8 *data)
{
    client->size = (data[0] & HAS_SIZE) != 0 ? BytesGet32(data + 4) : 0;
    if (client->without_block || client->size < SDO_BLOCK_FROM || client->size > client->room)
        return false;
    client->phase = READ_ABORTS;
    BytesPut32(begin_of_object(client, SDO_ABORT), SDO_ABORT_GENERAL);
    return true;
}
#else
#define is_worth_blocks(client, data) false
#endif

static void take_begin(SDO_CLIENT *client, const RTS_UI8 *data)
{
    if ((data[0] & IS_EXPEDITED) != 0) {
        client->done = (data[0] & HAS_SIZE) != 0 ? EXPEDITED - (data[0] >> 2 & 3u) : EXPEDITED;
        memcpy(client->in, data + 4, client->done); /* every room has as many */
        end(client, SDO_DONE, 0);
    } else if (!is_worth_blocks(client, data)) {
        client->segmented = true;
        ask_segment(client);
    }
}

static void take_segment(SDO_CLIENT *client, const RTS_UI8 *data)
{
    RTS_UI32 size = SEGMENT - (data[0] >> 1 & 7u);

    if ((data[0] & SDO_TOGGLE) != client->toggle)
        return;
    if (size > client->room - client->done) {
        memcpy(client->in + client->done, data + 1, client->room - client->done);
        client->done = client->room;
        give_up(client, SDO_ABORTED, SDO_ABORT_MEMORY);
        return;
    }
    if (size == 0 && (data[0] & IS_LAST) == 0) { /* a transfer without end */
        give_up(client, SDO_ABORTED, SDO_ABORT_COMMAND);
        return;
    }
    memcpy(client->in + client->done, data + 1, size);
    client->done += size;
    client->toggle ^= SDO_TOGGLE;
    if ((data[0] & IS_LAST) != 0)
        end(client, SDO_DONE, 0);
    else
        ask_segment(client);
}

static void take_of_read(SDO_CLIENT *client, const RTS_UI8 *data, bool is_of_object)
{
    if ((data[0] & SDO_KIND) == SDO_READ && is_of_object && !client->segmented)
        take_begin(client, data);
    else if ((data[0] & SDO_KIND) == 0 && client->segmented)
        take_segment(client, data);
}

/* ---- blocks ---- */

#if CANOPEN_SDO_BLOCK
static bool take_block_size(SDO_CLIENT *client, RTS_UI8 size)
{
    client->block = size;
    if (size != 0 && size <= MOST_SEGMENTS)
        return true;
    give_up(client, SDO_ABORTED, SDO_ABORT_BLOCK_SIZE);
    return false;
}

static void send_block_segment(SDO_CLIENT *client)
{
    RTS_UI32 left = client->size - client->done;
    RTS_UI32 size = left < SEGMENT ? left : SEGMENT;
    RTS_UI8 *data = begin_request(client, (RTS_UI8)(++client->sequence | (size == left ? BLOCK_IS_LAST : 0)));

    memcpy(data + 1, client->out + client->done, size);
    client->done += size;
    client->phase = size == left || client->sequence == client->block ? WRITE_WAITS : WRITE_SENDS;
}

static void send_block(SDO_CLIENT *client)
{
    client->sequence = 0;
    client->block_start = client->done;
    send_block_segment(client);
}

static void end_blocks(SDO_CLIENT *client)
{
    RTS_UI32 unused = SEGMENT - 1 - (client->size - 1) % SEGMENT;
    RTS_UI8 *data = begin_request(client, (RTS_UI8)(WRITE_BLOCK_END | unused << 2));

    client->phase = WRITE_ENDS;
    BytesPut16(data + 1, client->has_crc ? CRC16Update(0, client->out, client->size) : 0);
}

/* Segments after the last one in order are sent again. */
static void take_acknowledgement(SDO_CLIENT *client, const RTS_UI8 *data)
{
    RTS_UI32 done = client->block_start + data[1] * (RTS_UI32)SEGMENT;

    client->stuck = data[1] == 0 ? client->stuck + 1 : 0;
    if (data[1] > client->sequence || client->stuck > MOST_STUCK) {
        give_up(client, SDO_ABORTED, SDO_ABORT_SEQUENCE);
        return;
    }
    client->done = done < client->size ? done : client->size;
    if (client->done == client->size)
        end_blocks(client);
    else if (take_block_size(client, data[2]))
        send_block(client);
}

static void take_of_block_write(SDO_CLIENT *client, const RTS_UI8 *data, bool is_of_object)
{
    if (client->phase == WRITE_BEGINS && (data[0] & ~BLOCK_HAS_CRC) == WRITE_BLOCK_BEGUN && is_of_object) {
        client->has_crc = (data[0] & BLOCK_HAS_CRC) != 0;
        client->stuck = 0;
        if (take_block_size(client, data[4]))
            send_block(client);
    } else if (client->phase == WRITE_WAITS && data[0] == WRITE_BLOCK_DONE) {
        take_acknowledgement(client, data);
    } else if (client->phase == WRITE_ENDS && data[0] == WRITE_BLOCK_ENDED) {
        end(client, SDO_DONE, 0);
    }
}

static void begin_block_read(SDO_CLIENT *client)
{
    client->phase = READ_BEGINS;
    *begin_of_object(client, READ_BLOCK) = SDO_READ_BLOCK;
}

static void start_block_read(SDO_CLIENT *client, const RTS_UI8 *data)
{
    if ((data[0] & BLOCK_HAS_SIZE) != 0)
        client->size = BytesGet32(data + 4); /* it may have grown since */
    if (client->size > client->room) {
        give_up(client, SDO_ABORTED, SDO_ABORT_MEMORY);
        return;
    }
    client->has_crc = (data[0] & BLOCK_HAS_CRC) != 0;
    client->phase = READ_RECEIVES;
    client->sequence = client->stuck = 0;
    (void)begin_request(client, READ_BLOCK_START);
}

static void acknowledge(SDO_CLIENT *client, bool is_end)
{
    RTS_UI8 *data = begin_request(client, READ_BLOCK_DONE);

    data[1] = client->sequence;
    data[2] = SDO_READ_BLOCK;
    client->stuck = client->sequence == 0 ? client->stuck + 1 : 0;
    client->sequence = 0;
    if (is_end)
        client->phase = READ_ENDS;
    else if (client->stuck > MOST_STUCK)
        give_up(client, SDO_ABORTED, SDO_ABORT_SEQUENCE);
}

/* A segment out of order is ignored: the acknowledgement of the block names the last one in order. */
static void receive_segment(SDO_CLIENT *client, const RTS_UI8 *data, RTS_UI32 now_ms)
{
    RTS_UI8 sequence = data[0] & ~BLOCK_IS_LAST;
    bool is_last = (data[0] & BLOCK_IS_LAST) != 0;
    bool is_next = sequence == client->sequence + 1;
    RTS_UI32 left = client->size - client->done;

    if (sequence == 0 || sequence > SDO_READ_BLOCK)
        return;
    if (is_next && is_last != (left <= SEGMENT)) { /* not the size that it has reported */
        give_up(client, SDO_ABORTED, SDO_ABORT_LENGTH);
        return;
    }
    client->since_ms = now_ms;
    if (is_next) {
        RTS_UI32 size = left < SEGMENT ? left : SEGMENT;
        memcpy(client->in + client->done, data + 1, size);
        client->done += size;
        client->sequence = sequence;
    }
    if (is_last || sequence == SDO_READ_BLOCK)
        acknowledge(client, is_next && is_last);
}

static void end_block_read(SDO_CLIENT *client, const RTS_UI8 *data)
{
    RTS_UI32 unused = SEGMENT - 1 - (client->size - 1) % SEGMENT;

    if ((data[0] >> 2 & 7u) != unused) {
        give_up(client, SDO_ABORTED, SDO_ABORT_LENGTH);
    } else if (client->has_crc && BytesGet16(data + 1) != CRC16Update(0, client->in, client->done)) {
        give_up(client, SDO_ABORTED, SDO_ABORT_CRC);
    } else {
        (void)begin_request(client, READ_BLOCK_END);
        end(client, SDO_DONE, 0);
    }
}

/* A node may reply as to a normal read. */
static void read_without_blocks(SDO_CLIENT *client, const RTS_UI8 *data)
{
    client->phase = NO_BLOCK;
    client->without_block = true;
    take_begin(client, data);
}

static void take_of_block_read(SDO_CLIENT *client, const RTS_UI8 *data, bool is_of_object, RTS_UI32 now_ms)
{
    if (client->phase == READ_BEGINS && (data[0] & ~(BLOCK_HAS_CRC | BLOCK_HAS_SIZE)) == READ_BLOCK_BEGUN &&
        is_of_object)
        start_block_read(client, data);
    else if (client->phase == READ_BEGINS && (data[0] & SDO_KIND) == SDO_READ && is_of_object)
        read_without_blocks(client, data);
    else if (client->phase == READ_RECEIVES)
        receive_segment(client, data, now_ms);
    else if (client->phase == READ_ENDS && (data[0] & ~0x1Cu) == READ_BLOCK_ENDS)
        end_block_read(client, data);
}

static void take_of_blocks(SDO_CLIENT *client, const RTS_UI8 *data, bool is_of_object, RTS_UI32 now_ms)
{
    if (client->writes)
        take_of_block_write(client, data, is_of_object);
    else
        take_of_block_read(client, data, is_of_object, now_ms);
}

/* A node without block transfer. */
static bool is_refused(const SDO_CLIENT *client, const RTS_UI8 *data)
{
    return (client->phase == WRITE_BEGINS || client->phase == READ_BEGINS) && BytesGet32(data + 4) == SDO_ABORT_COMMAND;
}

static void do_without_blocks(SDO_CLIENT *client)
{
    client->phase = NO_BLOCK;
    client->without_block = true;
    if (client->writes)
        begin_segments(client);
    else
        (void)begin_of_object(client, SDO_READ);
}

static bool has_block_begun(const SDO_CLIENT *client)
{
    return client->phase != NO_BLOCK && client->phase != WRITE_BEGINS && client->phase != READ_ABORTS &&
           client->phase != READ_BEGINS;
}

/* What follows a frame that was sent, without a reply in between. */
static void follow_sent(SDO_CLIENT *client, RTS_UI32 now_ms)
{
    if (client->state != SDO_BUSY)
        return;
    if (client->phase == READ_ABORTS) {
        begin_block_read(client);
    } else if (client->phase == WRITE_SENDS) {
        client->since_ms = now_ms;
        send_block_segment(client);
    }
}

/* Segments wait for their millisecond, so that they do not fill the queue before PDOs. */
static bool may_send(SDO_CLIENT *client, RTS_UI32 now_ms)
{
    if (client->burst == 0 || (client->phase != WRITE_SENDS && client->phase != WRITE_WAITS))
        return true;
    if (client->burst_ms != now_ms)
        client->burst_left = client->burst;
    client->burst_ms = now_ms;
    if (client->burst_left == 0)
        return false;
    client->burst_left--;
    return true;
}
#else
#define take_of_blocks(client, data, is_of_object, now_ms) RTS_UNUSED(now_ms)
#define is_refused(client, data) false
#define do_without_blocks(client) ((void)0)
#define has_block_begun(client) false
#define follow_sent(client, now_ms) RTS_UNUSED(now_ms)
#define may_send(client, now_ms) true
#endif

/* ---- both ---- */

bool SdoClientSend(SDO_CLIENT *client, PF_CANOPEN_SEND send, void *owner, RTS_UI32 now_ms)
{
    while (client->has_request && may_send(client, now_ms)) {
        if (!send(owner, &client->request))
            return false;
        client->has_request = false;
        follow_sent(client, now_ms);
    }
    return !client->has_request;
}

static bool is_in_blocks(const SDO_CLIENT *client)
{
#if CANOPEN_SDO_BLOCK
    return client->phase != NO_BLOCK;
#else
    RTS_UNUSED(client);
    return false;
#endif
}

/* True if the node has replied to the beginning of a transfer in segments or blocks, which it may abort at any time. */
static bool has_begun(const SDO_CLIENT *client)
{
    return has_block_begun(client) || (client->segmented && (!client->writes || client->done != 0));
}

/* Only a reply that moves the transfer on begins a new wait. */
void SdoClientTake(SDO_CLIENT *client, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    const RTS_UI8 *data = frame->data;

    if (client->state != SDO_BUSY || frame->size != FRAME || frame->id != CANOPEN_SDO_REPLY + (RTS_UI32)client->node)
        return;
    bool is_of_object = BytesGet16(data + 1) == client->index && data[3] == client->sub;
    bool is_abort = data[0] == SDO_ABORT && is_of_object;
    if (client->has_request && !(is_abort && has_begun(client)))
        return;
    client->has_request = false;
    if (is_abort && is_refused(client, data))
        do_without_blocks(client);
    else if (is_abort)
        end(client, SDO_ABORTED, BytesGet32(data + 4));
    else if (is_in_blocks(client))
        take_of_blocks(client, data, is_of_object, now_ms);
    else if (client->writes)
        take_of_write(client, data, is_of_object);
    else
        take_of_read(client, data, is_of_object);
    if (client->has_request)
        client->since_ms = now_ms;
}

void SdoClientPoll(SDO_CLIENT *client, RTS_UI32 now_ms)
{
    if (client->state == SDO_BUSY && now_ms - client->since_ms >= client->timeout_ms)
        give_up(client, SDO_SILENT, SDO_ABORT_TIMEOUT);
}

bool SdoClientCancel(SDO_CLIENT *client)
{
    bool is_busy = client->state == SDO_BUSY;

    if (is_busy)
        give_up(client, SDO_ABORTED, SDO_ABORT_GENERAL);
    return is_busy;
}

RTS_UI32 SdoClientGetNumber(const SDO_CLIENT *client)
{
    RTS_UI32 number = 0;

    for (RTS_UI32 i = 0; i < client->done && i < EXPEDITED; i++)
        number |= (RTS_UI32)client->in[i] << 8 * i;
    return number;
}
