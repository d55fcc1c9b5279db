/*
 * CmpBlkDrvSimpleCom.c - the serial block driver: frames "#<" packet crc "#>".
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Reception collects one frame at a time and hands it up when its CRC is right. Sending takes packets from a queue and
 * escapes them straight into the port's buffer, as far as that takes them.
 */
#include "CmpBlkDrvSimpleCom.h"

#include <string.h>

#include "CmpBytes.h"
#include "CmpChecksum.h"
#include "CmpLog.h"
#include "SysCom.h"
#include "rts_config.h"

enum {
    CRC_SIZE = 2,
    READ_CHUNK = 64,
    READ_MAX = 2048, /* bytes per cycle, so that a babbling line does not stop the rest of the runtime */
    WRITE_CHUNK = 32,
    LENGTH_SIZE = 2, /* before each packet in the queue */
    ROUTER_HEADER_MAX = 2 * ROUTER_HEADER_WORDS + 4 * ROUTER_MAX_ADDRESS + 2, /* addresses of both sides, filler */
    /* A packet with the largest message of the channel in one block. No packet is larger, in either direction. */
    MESSAGE_MAX = ROUTER_HEADER_MAX + CHANNEL_FIRST_SIZE + NETSERVER_MESSAGE_SIZE,
    PACKET_MAX = MESSAGE_MAX < BLK_MAX_SIZE ? MESSAGE_MAX : BLK_MAX_SIZE,
};

RTS_STATIC_ASSERT(COM_QUEUE_SIZE >= LENGTH_SIZE + PACKET_MAX + CRC_SIZE, com_queue_holds_the_largest_packet);
RTS_STATIC_ASSERT(NS_REPLY_SIZE + ROUTER_HEADER_MAX <= PACKET_MAX, packet_holds_the_name_service_reply);

typedef struct {
    bool in_frame;
    bool escape; /* the last byte was "#" */
    RTS_UI32 size;
    RTS_UI8 frame[PACKET_MAX + CRC_SIZE];
} RECEIVER;

/* Packets to send, each between its length and its CRC, in a ring. */
typedef struct {
    RTS_UI32 head; /* where to read */
    RTS_UI32 used;
    RTS_UI8 data[COM_QUEUE_SIZE];
} QUEUE;

typedef struct {
    RTS_UI32 left; /* bytes of the frame still to be encoded; 0 between frames */
    RTS_UI32 chunk_size;
    RTS_UI32 chunk_sent;
    RTS_UI8 chunk[WRITE_CHUNK]; /* encoded, not yet taken by the port */
    QUEUE queue;
} SENDER;

typedef struct {
    RTS_UI32 index;
    bool open;
    BLK_DRV driver;
    SENDER tx;
    RECEIVER rx;
} COM_LINE;

static COM_LINE lines[COM_MAX_LINES];
static COM_COUNTERS counters[COM_MAX_LINES];

/* ---- receiving ---- */

/* Hands a frame up when its CRC is right. */
static void end_frame(COM_LINE *line)
{
    RECEIVER *rx = &line->rx;

    if (rx->size <= CRC_SIZE) {
        COMM_COUNT(counters[line->index].too_short);
        return;
    }
    RTS_UI32 size = rx->size - CRC_SIZE;
    if (CRC16Update(CRC16_INIT, rx->frame, size) != BytesGet16(rx->frame + size)) {
        COMM_COUNT(counters[line->index].crc_errors);
        return;
    }
    COMM_COUNT(counters[line->index].frames);
    RouterHandleData(&line->driver, rx->frame, size);
}

/* A byte of a frame; between frames it belongs to nothing. */
static void take_byte(COM_LINE *line, RTS_UI8 byte)
{
    RECEIVER *rx = &line->rx;

    if (!rx->in_frame)
        return;
    if (rx->size == sizeof(rx->frame)) {
        COMM_COUNT(counters[line->index].overflows);
        rx->in_frame = false;
        return;
    }
    rx->frame[rx->size++] = byte;
}

/* The byte after "#". All but "_" end a frame, rightly or not. */
static void take_escaped(COM_LINE *line, RTS_UI8 byte)
{
    RECEIVER *rx = &line->rx;
    bool in_frame = rx->in_frame;

    if (byte == SIMPLECOM_STUFF) {
        take_byte(line, SIMPLECOM_ESCAPE);
        return;
    }
    rx->in_frame = byte == SIMPLECOM_START_2;
    rx->escape = byte == SIMPLECOM_ESCAPE;
    if (byte == SIMPLECOM_END_2) {
        if (in_frame)
            end_frame(line);
        else
            COMM_COUNT(counters[line->index].ends_without_start);
    } else if (byte == SIMPLECOM_START_2) {
        rx->size = 0;
        if (in_frame)
            COMM_COUNT(counters[line->index].unfinished);
    } else if (in_frame) {
        COMM_COUNT(counters[line->index].bad_escapes);
    }
}

static void receive_byte(COM_LINE *line, RTS_UI8 byte)
{
    bool escaped = line->rx.escape;

    line->rx.escape = !escaped && byte == SIMPLECOM_ESCAPE;
    if (escaped)
        take_escaped(line, byte);
    else if (byte != SIMPLECOM_ESCAPE)
        take_byte(line, byte);
}

static void receive(COM_LINE *line)
{
    RTS_UI8 chunk[READ_CHUNK];
    RTS_UI32 total = 0;
    RTS_UI32 size;

    do {
        size = SysComRead(line->index, chunk, sizeof(chunk));
        for (RTS_UI32 i = 0; i < size; i++)
            receive_byte(line, chunk[i]);
        total += size;
    } while (size == sizeof(chunk) && total < READ_MAX);
}

/* ---- sending ---- */

static void push(QUEUE *queue, const RTS_UI8 *data, RTS_UI32 size)
{
    for (RTS_UI32 i = 0; i < size; i++) {
        RTS_UI32 tail = queue->head + queue->used++;
        queue->data[tail < COM_QUEUE_SIZE ? tail : tail - COM_QUEUE_SIZE] = data[i];
    }
}

static RTS_UI8 pop(QUEUE *queue)
{
    RTS_UI8 byte = queue->data[queue->head++];

    if (queue->head == COM_QUEUE_SIZE)
        queue->head = 0;
    queue->used--;
    return byte;
}

static void push16(QUEUE *queue, RTS_UI32 value)
{
    RTS_UI8 bytes[2];

    BytesPut16(bytes, value);
    push(queue, bytes, sizeof(bytes));
}

static RTS_RESULT com_send(const BLK_DRV *driver, const BLK_PART *parts, RTS_UI32 count)
{
    COM_LINE *line = driver->instance;
    QUEUE *queue = &line->tx.queue;
    RTS_UI32 size = CRC_SIZE;
    RTS_UI16 crc = CRC16_INIT;

    for (RTS_UI32 i = 0; i < count; i++)
        size += parts[i].size;
    if (size > PACKET_MAX + CRC_SIZE)
        return ERR_NET_MSGSIZE;
    if (LENGTH_SIZE + size > COM_QUEUE_SIZE - queue->used)
        return ERR_NOBUFFER;
    push16(queue, size);
    for (RTS_UI32 i = 0; i < count; i++) {
        crc = CRC16Update(crc, parts[i].data, parts[i].size);
        push(queue, parts[i].data, parts[i].size);
    }
    push16(queue, crc);
    return ERR_OK;
}

static void put(SENDER *tx, RTS_UI8 byte)
{
    tx->chunk[tx->chunk_size++] = byte;
}

static void encode_start(SENDER *tx)
{
    tx->left = pop(&tx->queue);
    tx->left |= (RTS_UI32)pop(&tx->queue) << 8;
    put(tx, SIMPLECOM_START_1);
    put(tx, SIMPLECOM_START_2);
}

static void encode_byte(SENDER *tx)
{
    RTS_UI8 byte = pop(&tx->queue);

    put(tx, byte);
    if (byte == SIMPLECOM_ESCAPE)
        put(tx, SIMPLECOM_STUFF);
    if (--tx->left == 0) {
        put(tx, SIMPLECOM_START_1);
        put(tx, SIMPLECOM_END_2);
    }
}

static void encode_chunk(SENDER *tx)
{
    enum { STEP_MAX = 4 }; /* an escaped byte and the end */

    tx->chunk_size = 0;
    tx->chunk_sent = 0;
    while (tx->chunk_size <= WRITE_CHUNK - STEP_MAX && tx->queue.used != 0) {
        if (tx->left == 0)
            encode_start(tx);
        else
            encode_byte(tx);
    }
}

static void transmit(COM_LINE *line)
{
    SENDER *tx = &line->tx;

    for (;;) {
        if (tx->chunk_sent == tx->chunk_size)
            encode_chunk(tx);
        RTS_UI32 offered = tx->chunk_size - tx->chunk_sent;
        if (offered == 0)
            return;
        RTS_UI32 taken = SysComWrite(line->index, tx->chunk + tx->chunk_sent, offered);
        tx->chunk_sent += taken < offered ? taken : offered;
        if (taken < offered)
            return;
    }
}

/* ---- life ---- */

static void reset_lines(void)
{
    memset(lines, 0, sizeof(lines));
    if (COMM_COUNTERS)
        memset(counters, 0, sizeof(counters));
}

static void open_lines(void)
{
    RTS_UI32 count = SysComGetCount();

    for (RTS_UI32 i = 0; i < COM_MAX_LINES && i < count; i++) {
        COM_LINE *line = &lines[i];
        line->index = i;
        line->driver.type = BLK_DRV_TYPE_COM;
        line->driver.point_to_point = 1;
        line->driver.address_words = 1;
        line->driver.address[1] = (RTS_UI8)(i + 1); /* the line's number, as the field counts COM ports */
        line->driver.instance = line;
        line->driver.send = com_send;
        RTS_RESULT result = SysComOpen(i);
        line->open = result == ERR_OK;
        if (!line->open)
            LogAdd(CMPID_CmpBlkDrvSimpleCom, LOG_ERROR, result, "Serial line %u cannot be opened", (unsigned)i);
    }
}

static void close_lines(void)
{
    for (RTS_UI32 i = 0; i < COM_MAX_LINES; i++) {
        if (!lines[i].open)
            continue;
        transmit(&lines[i]);
        SysComClose(i);
        lines[i].open = false;
    }
}

static void cycle(void)
{
    for (RTS_UI32 i = 0; i < COM_MAX_LINES; i++) {
        if (!lines[i].open)
            continue;
        receive(&lines[i]);
        transmit(&lines[i]);
    }
}

const COM_COUNTERS *BlkDrvComGetCounters(RTS_UI32 line)
{
    return line < COM_MAX_LINES ? &counters[line] : NULL;
}

RTS_RESULT CmpBlkDrvSimpleCom_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        reset_lines();
    else if (hook == CH_INIT_COMM)
        open_lines();
    else if (hook == CH_COMM_CYCLE)
        cycle();
    else if (hook == CH_EXIT3) /* not CH_EXIT_COMM: there the channel server takes leave */
        close_lines();
    return ERR_OK;
}
