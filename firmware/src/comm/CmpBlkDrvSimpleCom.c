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
#include "CmpPackets.h"
#include "ModbusTunnel.h"
#include "SysCom.h"
#include "rts_config.h"

enum {
    CRC_SIZE = 2,
    READ_CHUNK = 64,
    READ_MAX = 2048, /* bytes per cycle, so that a babbling line does not stop the rest of the runtime */
    WRITE_CHUNK = 32,
    LENGTH_SIZE = 2,                                                        /* before each packet in the queue */
    ROUTER_HEADER_MAX = sizeof(ROUTER_HEADER) + 4 * ROUTER_MAX_ADDRESS + 2, /* addresses of both sides, filler */
    /* A packet with the largest message of the channel in one block. No packet is larger, in either direction. */
    MESSAGE_MAX = ROUTER_HEADER_MAX + CHANNEL_FIRST_SIZE + NETSERVER_MESSAGE_SIZE,
    PACKET_MAX = MESSAGE_MAX < BLK_MAX_SIZE ? MESSAGE_MAX : BLK_MAX_SIZE,
    TAKES_MAX = COM_PACKET_SIZE > BLK_MAX_SIZE ? COM_PACKET_SIZE : PACKET_MAX,
};

RTS_STATIC_ASSERT(COM_PACKET_SIZE >= BLK_MAX_SIZE && COM_PACKET_SIZE <= 0xFFFF, packets_of_the_field_are_taken);

RTS_STATIC_ASSERT(COM_QUEUE_SIZE >= LENGTH_SIZE + PACKET_MAX + CRC_SIZE, com_queue_holds_the_largest_packet);
RTS_STATIC_ASSERT(NS_REPLY_SIZE + ROUTER_HEADER_MAX <= PACKET_MAX, packet_holds_the_name_service_reply);

/* Numbers before buffers, where short instructions reach them. */
typedef struct {
    RTS_UI32 index;
    bool open;
    /* the frame that arrives */
    bool in_frame;
    bool escape; /* the last byte was "#" */
    RTS_UI32 fill;
    /* the queue of packets to send, each between its length and its CRC: a ring */
    RTS_UI32 head;
    RTS_UI32 used;
    /* the frame on its way out */
    RTS_UI32 left; /* bytes still to be encoded; 0 between frames */
    RTS_UI32 chunk_size;
    RTS_UI32 chunk_sent;
    BLK_DRV driver;
    RTS_UI8 chunk[WRITE_CHUNK]; /* encoded, not yet taken by the port */
    RTS_UI8 queue[COM_QUEUE_SIZE];
    RTS_UI8 frame[TAKES_MAX + CRC_SIZE];
} COM_LINE;

enum {
    TUNNEL_LINE = COM_MAX_LINES, /* within Modbus, after those of the port */
    LINES = COM_MAX_LINES + (MODBUS_TUNNEL ? 1 : 0),
};

static COM_LINE lines[LINES];
static COM_COUNTERS counters[LINES];

static const char *const counter_names[] = {"frames",      "CRC errors", "too long",          "too short",
                                            "bad escapes", "unfinished", "ends without start"};
RTS_STATIC_ASSERT(sizeof(COM_COUNTERS) == sizeof(RTS_UI32) * RTS_COUNT(counter_names), each_counter_has_a_name);
const BLK_COUNTERS BlkDrvComCounters = {"serial", counter_names, RTS_COUNT(counter_names), &counters[0].frames, LINES};

/* ---- lines ---- */

#if MODBUS_TUNNEL
static RTS_UI32 read_line(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    return index == TUNNEL_LINE ? ModbusTunnelRead(data, size) : SysComRead(index, data, size);
}

static RTS_UI32 write_line(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    return index == TUNNEL_LINE ? ModbusTunnelWrite(data, size) : SysComWrite(index, data, size);
}
#else
#define read_line SysComRead
#define write_line SysComWrite
#endif

/* ---- receiving ---- */

static bool has_crc(const RTS_UI8 *stored, RTS_UI16 crc)
{
    if (BytesGet16(stored) == crc)
        return true;
    return COM_CRC_EITHER_ORDER && stored[0] == crc >> 8 && stored[1] == (crc & 0xFF);
}

/* Hands a frame up when its CRC is right. */
static void end_frame(COM_LINE *line)
{
    if (line->fill <= CRC_SIZE) {
        COMM_COUNT(counters[line->index].too_short);
        return;
    }
    RTS_UI32 size = line->fill - CRC_SIZE;
    if (!has_crc(line->frame + size, CRC16Update(CRC16_INIT, line->frame, size))) {
        COMM_COUNT(counters[line->index].crc_errors);
        return;
    }
    COMM_COUNT(counters[line->index].frames);
    RouterHandleData(&line->driver, line->frame, size);
}

/* A byte of a frame; between frames it belongs to nothing. */
static void take_byte(COM_LINE *line, RTS_UI8 byte)
{
    if (!line->in_frame)
        return;
    if (line->fill == sizeof(line->frame)) {
        COMM_COUNT(counters[line->index].overflows);
        line->in_frame = false;
        return;
    }
    line->frame[line->fill++] = byte;
}

/* The byte after "#". All but "_" end a frame, rightly or not. */
static void take_escaped(COM_LINE *line, RTS_UI8 byte)
{
    bool in_frame = line->in_frame;

    if (byte == SIMPLECOM_STUFF) {
        take_byte(line, SIMPLECOM_ESCAPE);
        return;
    }
    line->in_frame = byte == SIMPLECOM_START_2;
    line->escape = byte == SIMPLECOM_ESCAPE;
    if (byte == SIMPLECOM_END_2) {
        if (in_frame)
            end_frame(line);
        else
            COMM_COUNT(counters[line->index].ends_without_start);
    } else if (byte == SIMPLECOM_START_2) {
        line->fill = 0;
        if (in_frame)
            COMM_COUNT(counters[line->index].unfinished);
    } else if (in_frame) {
        COMM_COUNT(counters[line->index].bad_escapes);
    }
}

static void receive_byte(COM_LINE *line, RTS_UI8 byte)
{
    bool escaped = line->escape;

    line->escape = !escaped && byte == SIMPLECOM_ESCAPE;
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
        size = read_line(line->index, chunk, sizeof(chunk));
        for (RTS_UI32 i = 0; i < size; i++)
            receive_byte(line, chunk[i]);
        total += size;
    } while (size == sizeof(chunk) && total < READ_MAX);
}

/* ---- sending ---- */

static void push(COM_LINE *line, const RTS_UI8 *data, RTS_UI32 size)
{
    for (RTS_UI32 i = 0; i < size; i++) {
        RTS_UI32 tail = line->head + line->used++;
        line->queue[tail < COM_QUEUE_SIZE ? tail : tail - COM_QUEUE_SIZE] = data[i];
    }
}

static RTS_UI8 pop(COM_LINE *line)
{
    RTS_UI8 byte = line->queue[line->head++];

    if (line->head == COM_QUEUE_SIZE)
        line->head = 0;
    line->used--;
    return byte;
}

static void push16(COM_LINE *line, RTS_UI32 value)
{
    RTS_UI8 bytes[2];

    BytesPut16(bytes, value);
    push(line, bytes, sizeof(bytes));
}

static RTS_RESULT com_send(const ROUTER_PEER *peer, const BLK_PART *parts, RTS_UI32 count)
{
    COM_LINE *line = peer->driver->instance;
    RTS_UI32 size = CRC_SIZE;
    RTS_UI16 crc = CRC16_INIT;

    for (RTS_UI32 i = 0; i < count; i++)
        size += parts[i].size;
    if (size > PACKET_MAX + CRC_SIZE)
        return ERR_NET_MSGSIZE;
    if (LENGTH_SIZE + size > COM_QUEUE_SIZE - line->used)
        return ERR_NOBUFFER;
    push16(line, size);
    for (RTS_UI32 i = 0; i < count; i++) {
        crc = CRC16Update(crc, parts[i].data, parts[i].size);
        push(line, parts[i].data, parts[i].size);
    }
    push16(line, crc);
    return ERR_OK;
}

static void put(COM_LINE *line, RTS_UI8 byte)
{
    line->chunk[line->chunk_size++] = byte;
}

static void encode_start(COM_LINE *line)
{
    line->left = pop(line);
    line->left |= (RTS_UI32)pop(line) << 8;
    put(line, SIMPLECOM_START_1);
    put(line, SIMPLECOM_START_2);
}

static void encode_byte(COM_LINE *line)
{
    RTS_UI8 byte = pop(line);

    put(line, byte);
    if (byte == SIMPLECOM_ESCAPE)
        put(line, SIMPLECOM_STUFF);
    if (--line->left == 0) {
        put(line, SIMPLECOM_START_1);
        put(line, SIMPLECOM_END_2);
    }
}

static void encode_chunk(COM_LINE *line)
{
    enum { STEP_MAX = 4 }; /* an escaped byte and the end */

    line->chunk_size = 0;
    line->chunk_sent = 0;
    while (line->chunk_size <= WRITE_CHUNK - STEP_MAX && line->used != 0) {
        if (line->left == 0)
            encode_start(line);
        else
            encode_byte(line);
    }
}

static void transmit(COM_LINE *line)
{
    for (;;) {
        if (line->chunk_sent == line->chunk_size)
            encode_chunk(line);
        RTS_UI32 offered = line->chunk_size - line->chunk_sent;
        if (offered == 0)
            return;
        RTS_UI32 taken = write_line(line->index, line->chunk + line->chunk_sent, offered);
        line->chunk_sent += taken < offered ? taken : offered;
        if (taken < offered)
            return;
    }
}

/* ---- life ---- */

static void reset_lines(void)
{
    CMP_CLEAR(lines);
    if (COMM_COUNTERS)
        CMP_CLEAR(counters);
}

#if COMM_HOST_CHANNELS
/* What is at the other end, whatever addresses it gives: the line's number, which is the address of no machine. */
static RTS_UI32 host_of(const ROUTER_PEER *peer)
{
    return peer->driver->address[1];
}
#endif

static COM_LINE *begin_line(RTS_UI32 index)
{
    COM_LINE *line = &lines[index];

    line->index = index;
    line->driver.type = BLK_DRV_TYPE_COM;
    line->driver.point_to_point = 1;
    line->driver.address_words = 1;
    line->driver.address[1] = (RTS_UI8)(index + 1); /* the line's number, as the field counts COM ports */
#if BLK_LONG_PACKETS
    line->driver.takes = COM_PACKET_SIZE;
#endif
    line->driver.instance = line;
    line->driver.send = com_send;
#if COMM_HOST_CHANNELS
    line->driver.host_of = host_of;
#endif
    return line;
}

static void open_lines(void)
{
    RTS_UI32 count = SysComGetCount();

    if (MODBUS_TUNNEL)
        begin_line(TUNNEL_LINE)->open = true;
    for (RTS_UI32 i = 0; i < COM_MAX_LINES && i < count; i++) {
        COM_LINE *line = begin_line(i);
        RTS_RESULT result = SysComOpen(i);
        line->open = result == ERR_OK;
        if (!line->open)
            LogAdd(CMPID_CmpBlkDrvSimpleCom, LOG_ERROR, result, "Serial line %u cannot be opened", (unsigned)i);
    }
}

static void close_lines(void)
{
    for (RTS_UI32 i = 0; i < LINES; i++) {
        if (!lines[i].open)
            continue;
        transmit(&lines[i]);
        if (i != TUNNEL_LINE)
            SysComClose(i);
        lines[i].open = false;
    }
}

static void cycle(void)
{
    for (RTS_UI32 i = 0; i < LINES; i++) {
        if (!lines[i].open)
            continue;
        receive(&lines[i]);
        transmit(&lines[i]);
    }
}

const COM_COUNTERS *BlkDrvComGetCounters(RTS_UI32 line)
{
    return line < LINES ? &counters[line] : NULL;
}

RTS_RESULT CmpBlkDrvSimpleCom_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT)
        reset_lines();
    else if (hook == CH_INIT3) /* before an application can take the line */
        open_lines();
    else if (hook == CH_COMM_CYCLE)
        cycle();
    else if (hook == CH_EXIT3) /* not CH_EXIT_COMM: the channel server still sends its close there */
        close_lines();
    return ERR_OK;
}
