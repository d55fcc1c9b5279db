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

RTS_STATIC_ASSERT(COM_QUEUE_SIZE >= PACKET_MAX + LENGTH_SIZE, com_queue_holds_the_largest_packet);
RTS_STATIC_ASSERT(NS_REPLY_SIZE + ROUTER_HEADER_MAX <= PACKET_MAX, packet_holds_the_name_service_reply);

typedef enum {
    RX_HUNT,      /* between frames */
    RX_HUNT_HASH, /* between frames, after "#" */
    RX_DATA,
    RX_DATA_HASH,
} RX_STATE;

typedef struct {
    RX_STATE state;
    RTS_UI32 size;
    RTS_UI8 frame[PACKET_MAX + CRC_SIZE];
    COM_COUNTERS counters;
} RECEIVER;

/* Packets to send, each after its length, in a ring. */
typedef struct {
    RTS_UI8 data[COM_QUEUE_SIZE];
    RTS_UI32 head; /* where to read */
    RTS_UI32 used;
} QUEUE;

typedef struct {
    QUEUE queue;
    RTS_UI32 left; /* packet bytes still to be encoded */
    RTS_UI16 crc;
    bool in_frame;
    RTS_UI8 chunk[WRITE_CHUNK]; /* encoded, not yet taken by the port */
    RTS_UI32 chunk_size;
    RTS_UI32 chunk_sent;
} SENDER;

typedef struct {
    BLK_DRV driver;
    RTS_UI32 index;
    bool open;
    RECEIVER rx;
    SENDER tx;
} COM_LINE;

static COM_LINE lines[COM_MAX_LINES];

/* ---- receiving ---- */

static void start_frame(RECEIVER *rx)
{
    rx->state = RX_DATA;
    rx->size = 0;
}

/* Hands a frame up when its CRC is right. */
static void end_frame(COM_LINE *line)
{
    RECEIVER *rx = &line->rx;

    rx->state = RX_HUNT;
    if (rx->size <= CRC_SIZE) {
        rx->counters.too_short++;
        return;
    }
    RTS_UI32 size = rx->size - CRC_SIZE;
    if (CRC16Update(CRC16_INIT, rx->frame, size) != BytesGet16(rx->frame + size)) {
        rx->counters.crc_errors++;
        return;
    }
    rx->counters.frames++;
    RouterHandleData(&line->driver, rx->frame, size);
}

static void take_byte(RECEIVER *rx, RTS_UI8 byte)
{
    if (rx->size == sizeof(rx->frame)) {
        rx->counters.overflows++;
        rx->state = RX_HUNT;
        return;
    }
    rx->frame[rx->size++] = byte;
    rx->state = RX_DATA;
}

static void hunt_after_hash(RECEIVER *rx, RTS_UI8 byte)
{
    if (byte == SIMPLECOM_START_2) {
        start_frame(rx);
        return;
    }
    if (byte == SIMPLECOM_END_2)
        rx->counters.ends_without_start++;
    rx->state = byte == SIMPLECOM_START_1 ? RX_HUNT_HASH : RX_HUNT;
}

static void data_after_hash(COM_LINE *line, RTS_UI8 byte)
{
    RECEIVER *rx = &line->rx;

    if (byte == SIMPLECOM_STUFF) {
        take_byte(rx, SIMPLECOM_ESCAPE);
    } else if (byte == SIMPLECOM_END_2) {
        end_frame(line);
    } else if (byte == SIMPLECOM_START_2) {
        rx->counters.unfinished++;
        start_frame(rx);
    } else {
        rx->counters.bad_escapes++;
        rx->state = byte == SIMPLECOM_START_1 ? RX_HUNT_HASH : RX_HUNT;
    }
}

static void receive_byte(COM_LINE *line, RTS_UI8 byte)
{
    RECEIVER *rx = &line->rx;

    switch (rx->state) {
    case RX_HUNT:
        if (byte == SIMPLECOM_START_1)
            rx->state = RX_HUNT_HASH;
        break;
    case RX_HUNT_HASH:
        hunt_after_hash(rx, byte);
        break;
    case RX_DATA:
        if (byte == SIMPLECOM_ESCAPE)
            rx->state = RX_DATA_HASH;
        else
            take_byte(rx, byte);
        break;
    case RX_DATA_HASH:
        data_after_hash(line, byte);
        break;
    }
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
    for (RTS_UI32 i = 0; i < size; i++)
        queue->data[(queue->head + queue->used++) % COM_QUEUE_SIZE] = data[i];
}

static RTS_UI8 pop(QUEUE *queue)
{
    RTS_UI8 byte = queue->data[queue->head];

    queue->head = (queue->head + 1) % COM_QUEUE_SIZE;
    queue->used--;
    return byte;
}

static RTS_RESULT com_send(const BLK_DRV *driver, const BLK_PART *parts, RTS_UI32 count)
{
    COM_LINE *line = driver->instance;
    QUEUE *queue = &line->tx.queue;
    RTS_UI8 length[LENGTH_SIZE];
    RTS_UI32 size = 0;

    for (RTS_UI32 i = 0; i < count; i++)
        size += parts[i].size;
    if (size == 0 || size > PACKET_MAX)
        return ERR_NET_MSGSIZE;
    if (size + LENGTH_SIZE > COM_QUEUE_SIZE - queue->used)
        return ERR_NOBUFFER;
    BytesPut16(length, size);
    push(queue, length, sizeof(length));
    for (RTS_UI32 i = 0; i < count; i++)
        push(queue, parts[i].data, parts[i].size);
    return ERR_OK;
}

static void put_raw(SENDER *tx, RTS_UI8 byte)
{
    tx->chunk[tx->chunk_size++] = byte;
}

static void put_escaped(SENDER *tx, RTS_UI8 byte)
{
    put_raw(tx, byte);
    if (byte == SIMPLECOM_ESCAPE)
        put_raw(tx, SIMPLECOM_STUFF);
}

static void encode_start(SENDER *tx)
{
    tx->left = pop(&tx->queue);
    tx->left |= (RTS_UI32)pop(&tx->queue) << 8;
    tx->crc = CRC16_INIT;
    tx->in_frame = true;
    put_raw(tx, SIMPLECOM_START_1);
    put_raw(tx, SIMPLECOM_START_2);
}

static void encode_end(SENDER *tx)
{
    put_escaped(tx, (RTS_UI8)tx->crc);
    put_escaped(tx, (RTS_UI8)(tx->crc >> 8));
    put_raw(tx, SIMPLECOM_START_1);
    put_raw(tx, SIMPLECOM_END_2);
    tx->in_frame = false;
}

/* Fills the chunk; no step adds more than 6 bytes. */
static void encode_chunk(SENDER *tx)
{
    tx->chunk_size = 0;
    tx->chunk_sent = 0;
    while (tx->chunk_size + 6 <= WRITE_CHUNK && (tx->in_frame || tx->queue.used != 0)) {
        if (!tx->in_frame) {
            encode_start(tx);
        } else if (tx->left == 0) {
            encode_end(tx);
        } else {
            RTS_UI8 byte = pop(&tx->queue);
            tx->left--;
            tx->crc = CRC16Update(tx->crc, &byte, 1);
            put_escaped(tx, byte);
        }
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
    return line < COM_MAX_LINES ? &lines[line].rx.counters : NULL;
}

RTS_RESULT CmpBlkDrvSimpleCom_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        memset(lines, 0, sizeof(lines));
    else if (hook == CH_INIT_COMM)
        open_lines();
    else if (hook == CH_COMM_CYCLE)
        cycle();
    else if (hook == CH_EXIT3) /* not CH_EXIT_COMM: there the channel server takes leave */
        close_lines();
    return ERR_OK;
}
