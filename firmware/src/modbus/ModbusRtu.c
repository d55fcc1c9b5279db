/*
 * ModbusRtu.c - frames of Modbus on a serial line.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusRtu.h"

#include <string.h>

#include "ModbusPdu.h"
#include "rts_config.h"

enum {
    NS_PER_S = 1000000000,
    NS_PER_MS = 1000000,
    FAST_BAUD = 19200, /* above, silence does not get shorter */
    FAST_SILENCE_NS = 1750000,
    HALVES_OF_SILENCE = 7, /* 3.5 characters */
    AROUND_PDU = 1 + MODBUS_CRC_SIZE,
    FRAME_MIN = AROUND_PDU + 1,
    FRAME_MAX = AROUND_PDU + MODBUS_MAX_PDU,
    ROOM = MODBUS_FRAME_SIZE - MODBUS_AT_UNIT,
    IN_PIECES = SYSCOM_HELD_CHARS > 0 || SYSCOM_HELD_MS > 0, /* else silence ends a frame, and only that */
    READS_MAX = 4, /* in one pass: a line that babbles does not hold up main */
};

RTS_UI16 ModbusCrc(const RTS_UI8 *data, RTS_UI32 size)
{
    static const RTS_UI16 of_nibble[16] = {
        0x0000, 0xCC01, 0xD801, 0x1400, 0xF001, 0x3C00, 0x2800, 0xE401,
        0xA001, 0x6C00, 0x7800, 0xB401, 0x5000, 0x9C01, 0x8801, 0x4400,
    };
    RTS_UI32 crc = 0xFFFF;

    for (RTS_UI32 i = 0; i < size; i++) {
        crc ^= data[i];
        crc = crc >> 4 ^ of_nibble[crc & 15];
        crc = crc >> 4 ^ of_nibble[crc & 15];
    }
    return (RTS_UI16)crc;
}

const MODBUS_LINK_TYPE ModbusRtuType = {ModbusRtuReady,  ModbusRtuReceive, ModbusRtuSend,
                                        ModbusRtuGiveUp, ModbusRtuClose,   true};

void ModbusRtuBegin(MODBUS_LINK *link, RTS_UI32 line, const SYSCOM_SETTINGS *settings)
{
    RTS_UI32 bits = 1 + 8 + (settings->parity != SYSCOM_PARITY_NONE) + settings->stop_bits;

    link->type = &ModbusRtuType;
    link->handle = line;
    link->sending = false;
    link->fill = 0;
    link->char_ns = NS_PER_S / settings->baud * bits;
    link->silence_ns = settings->baud > FAST_BAUD ? FAST_SILENCE_NS : link->char_ns * HALVES_OF_SILENCE / 2;
    link->gap_ns = link->silence_ns + SYSCOM_HELD_CHARS * link->char_ns + SYSCOM_HELD_MS * NS_PER_MS;
    link->moved_ns = 0;
}

void ModbusRtuClose(MODBUS_LINK *link)
{
    SysComClose(link->handle);
}

/* ---- sending ---- */

void ModbusRtuGiveUp(MODBUS_LINK *link)
{
    SysComDiscard(link->handle);
    if (!link->sending)
        return;
    link->sending = false;
    link->fill = 0;
}

/* The line is busy until the last byte has left, which is later than that the port took it. */
static void transmit(MODBUS_LINK *link, RTS_I64 now_ns)
{
    link->sent = (RTS_UI16)(link->sent + SysComWrite(link->handle, link->frame + MODBUS_AT_UNIT + link->sent,
                                                     (RTS_UI32)link->fill - link->sent));
    if (link->sent < link->fill)
        return;
    link->sending = false;
    link->fill = 0;
    if (link->moved_ns < now_ns)
        link->moved_ns = now_ns;
}

/* What has come since all was read, just before, belongs to nothing. */
static void forget_received(MODBUS_LINK *link)
{
    RTS_UI8 chunk[16];

    (void)SysComRead(link->handle, chunk, sizeof(chunk));
}

void ModbusRtuBeginFrame(MODBUS_LINK *link, RTS_UI32 pdu_size)
{
    RTS_UI8 *unit = link->frame + MODBUS_AT_UNIT;
    RTS_UI16 crc = ModbusCrc(unit, 1 + pdu_size);

    unit[1 + pdu_size] = (RTS_UI8)crc;
    unit[2 + pdu_size] = (RTS_UI8)(crc >> 8);
    link->fill = (RTS_UI16)(pdu_size + AROUND_PDU);
    link->unit = unit[0];
    link->function = unit[1];
    link->sent = 0;
    link->sending = true;
}

void ModbusRtuSend(MODBUS_LINK *link, RTS_UI32 pdu_size, RTS_I64 now_ns)
{
    ModbusRtuBeginFrame(link, pdu_size);
    link->moved_ns = now_ns + (RTS_I64)link->fill * link->char_ns;
    forget_received(link);
    transmit(link, now_ns);
}

/* ---- frames in what has come ---- */

static const RTS_UI8 *first_byte(const MODBUS_LINK *link)
{
    return link->frame + MODBUS_AT_UNIT;
}

static bool is_right(const RTS_UI8 *frame, RTS_UI32 size)
{
    return size >= FRAME_MIN && size <= FRAME_MAX && ModbusCrc(frame, size) == 0;
}

/* Drops the bytes before `at`. */
static void move_to_front(MODBUS_LINK *link, RTS_UI32 at)
{
    link->fill = (RTS_UI16)(link->fill - at);
    memmove(link->frame + MODBUS_AT_UNIT, first_byte(link) + at, link->fill);
}

/* As the functions of ModbusPdu.h that say where a PDU ends, for its frame. */
static RTS_UI32 frame_size(RTS_UI32 (*pdu_size)(const RTS_UI8 *, RTS_UI32), const RTS_UI8 *frame, RTS_UI32 fill)
{
    RTS_UI32 size = pdu_size(frame + 1, fill - 1);

    return size != 0 ? size + AROUND_PDU : 0;
}

/* ---- a server: requests, between those to others and their replies ---- */

/* The size of the frame with a right CRC that is first; more than `fill` if one may become it; 0: it is none. */
static RTS_UI32 size_of_first(const MODBUS_LINK *link)
{
    const RTS_UI8 *frame = first_byte(link);
    RTS_UI32 request;
    RTS_UI32 reply;

    if (frame[0] > MODBUS_MAX_UNIT)
        return 0;
    if (link->fill < 2)
        return FRAME_MIN;
    request = frame_size(ModbusGetRequestSize, frame, link->fill);
    reply = frame[0] != link->unit ? frame_size(ModbusGetReplySize, frame, link->fill) : 0;
    if (request <= link->fill && is_right(frame, request))
        return request;
    if (reply <= link->fill && is_right(frame, reply))
        return reply;
    if (request < reply)
        request = reply;
    return request > link->fill && request <= FRAME_MAX ? request : 0;
}

/* What is before the last frame is for others, or is not waited for any more. */
static void drop_all_but_last(MODBUS_LINK *link)
{
    RTS_UI32 size;

    while ((size = size_of_first(link)) != 0 && size < link->fill)
        move_to_front(link, size);
}

/* Whether it is the whole of a request to this server that comes last, after something else. */
static bool is_request_at(const MODBUS_LINK *link, RTS_UI32 at)
{
    const RTS_UI8 *frame = first_byte(link) + at;
    RTS_UI32 left = link->fill - at;

    return frame[0] == link->unit && frame_size(ModbusGetRequestSize, frame, left) == left && is_right(frame, left);
}

static bool find_request(MODBUS_LINK *link)
{
    for (RTS_UI32 at = 1; at + FRAME_MIN <= link->fill; at++) {
        if (is_request_at(link, at)) {
            link->bad_frames++;
            move_to_front(link, at);
            return true;
        }
    }
    return false;
}

/* After silence: whether a frame has come. What may go on is waited for; within it nothing is looked for, because its
 * data may be anything. */
static bool has_request(MODBUS_LINK *link, bool over)
{
    RTS_UI32 size = size_of_first(link);

    if (size == link->fill)
        return true;
    if (link->fill < ROOM && (size == 0 || over))
        return is_right(first_byte(link), link->fill) || find_request(link);
    return false;
}

/* ---- a client: the reply ---- */

static bool is_reply_at(const MODBUS_LINK *link, RTS_UI32 at)
{
    const RTS_UI8 *frame = first_byte(link) + at;

    return frame[0] == link->unit && (frame[1] & ~MODBUS_EXCEPTION) == link->function;
}

/* Finds it wherever it is: what is before and after it is noise. */
static bool find_reply(MODBUS_LINK *link)
{
    for (RTS_UI32 at = 0; at + FRAME_MIN <= link->fill; at++) {
        RTS_UI32 left = link->fill - at;
        RTS_UI32 size = is_reply_at(link, at) ? frame_size(ModbusGetReplySize, first_byte(link) + at, left) : 0;
        if (size <= left && is_right(first_byte(link) + at, size)) {
            move_to_front(link, at);
            link->fill = (RTS_UI16)size;
            return true;
        }
    }
    return false;
}

/* After silence: whether a frame has come that is another, or a reply of a function that does not say its length. */
static bool has_other(const MODBUS_LINK *link, bool over)
{
    bool may_go_on = link->fill >= 2 && is_reply_at(link, 0) &&
                     frame_size(ModbusGetReplySize, first_byte(link), link->fill) > link->fill;

    return (over || !may_go_on) && is_right(first_byte(link), link->fill);
}

#if MODBUS_MAX_CONNECTIONS > 0
RTS_UI32 ModbusRtuFindFrame(MODBUS_LINK *link)
{
    if (link->fill != 0 && (find_reply(link) || has_other(link, false)))
        return (RTS_UI32)link->fill - AROUND_PDU;
    return 0;
}
#endif

/* ---- receiving ---- */

static bool is_quiet(const MODBUS_LINK *link, RTS_UI32 silence_ns, RTS_I64 now_ns)
{
    return now_ns - SysComGetByteNs(link->handle) >= silence_ns;
}

/* True when all that has come was read. What is too long for a frame stays so: its bytes are written over. */
static bool take_bytes(MODBUS_LINK *link)
{
    RTS_UI8 *frame = link->frame + MODBUS_AT_UNIT;

    for (RTS_UI32 left = READS_MAX; left > 0; left--) {
        RTS_UI32 at = link->fill < ROOM ? link->fill : 0;
        RTS_UI32 size = SysComRead(link->handle, frame + at, ROOM - at);
        if (size == 0)
            return true;
        if (link->fill == ROOM)
            continue;
        link->fill = (RTS_UI16)(at + size);
        if (IN_PIECES && link->looks_for == MODBUS_LOOKS_FOR_REQUESTS)
            drop_all_but_last(link);
    }
    return false;
}

static bool has_frame(MODBUS_LINK *link, bool over)
{
    if (!IN_PIECES || link->looks_for == MODBUS_LOOKS_FOR_NOTHING)
        return is_right(first_byte(link), link->fill);
    return link->looks_for == MODBUS_LOOKS_FOR_REQUESTS ? has_request(link, over) : has_other(link, over);
}

/* A reply may come as long as it is waited for. */
static bool is_given_up(const MODBUS_LINK *link, bool over)
{
    return !IN_PIECES || link->fill >= ROOM || (over && link->looks_for != MODBUS_LOOKS_FOR_REPLY);
}

/* After silence: whether what has come ends with a frame. */
static bool end_frame(MODBUS_LINK *link, RTS_I64 now_ns)
{
    bool over = link->looks_for == MODBUS_LOOKS_FOR_NOTHING || is_quiet(link, link->gap_ns, now_ns);

    if (has_frame(link, over))
        return true;
    if (is_given_up(link, over)) {
        link->bad_frames++;
        ModbusLinkDrop(link);
    }
    return false;
}

RTS_UI32 ModbusRtuReceive(MODBUS_LINK *link, RTS_I64 now_ns)
{
    if (link->sending) {
        transmit(link, now_ns);
        return 0;
    }
    if (!take_bytes(link) || link->fill == 0)
        return 0;
    if (IN_PIECES && link->looks_for == MODBUS_LOOKS_FOR_REPLY && find_reply(link))
        return (RTS_UI32)link->fill - AROUND_PDU;
    return is_quiet(link, link->silence_ns, now_ns) && end_frame(link, now_ns) ? (RTS_UI32)link->fill - AROUND_PDU : 0;
}

bool ModbusRtuReady(MODBUS_LINK *link, RTS_I64 now_ns)
{
    return !link->sending && link->fill == 0 && now_ns - link->moved_ns >= link->silence_ns &&
           is_quiet(link, link->silence_ns, now_ns);
}
