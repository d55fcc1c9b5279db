/*
 * ModbusRtu.c - frames of Modbus on a serial line.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusRtu.h"

enum {
    NS_PER_S = 1000000000,
    FAST_BAUD = 19200, /* above, silence does not get shorter */
    FAST_SILENCE_NS = 1750000,
    HALVES_OF_SILENCE = 7, /* 3.5 characters */
    FRAME_MIN = 1 + 1 + MODBUS_CRC_SIZE,
    ROOM = MODBUS_FRAME_SIZE - MODBUS_AT_UNIT,
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

void ModbusRtuSend(MODBUS_LINK *link, RTS_UI32 pdu_size, RTS_I64 now_ns)
{
    RTS_UI8 *unit = link->frame + MODBUS_AT_UNIT;
    RTS_UI16 crc = ModbusCrc(unit, 1 + pdu_size);

    unit[1 + pdu_size] = (RTS_UI8)crc;
    unit[2 + pdu_size] = (RTS_UI8)(crc >> 8);
    link->fill = (RTS_UI16)(1 + pdu_size + MODBUS_CRC_SIZE);
    link->sent = 0;
    link->sending = true;
    link->moved_ns = now_ns + (RTS_I64)link->fill * link->char_ns;
    forget_received(link);
    transmit(link, now_ns);
}

/* ---- receiving ---- */

static bool is_quiet(const MODBUS_LINK *link, RTS_I64 now_ns)
{
    return now_ns - SysComGetByteNs(link->handle) >= link->silence_ns;
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
        if (link->fill < ROOM)
            link->fill = (RTS_UI16)(at + size);
    }
    return false;
}

/* The size of the PDU, 0 if the frame is not good. */
static RTS_UI32 end_frame(MODBUS_LINK *link)
{
    const RTS_UI8 *frame = link->frame + MODBUS_AT_UNIT;
    RTS_UI32 size = link->fill;

    if (size >= FRAME_MIN && size < ROOM &&
        ModbusCrc(frame, size - MODBUS_CRC_SIZE) == (frame[size - 2] | frame[size - 1] << 8))
        return size - 1 - MODBUS_CRC_SIZE;
    link->bad_frames++;
    ModbusLinkDrop(link);
    return 0;
}

RTS_UI32 ModbusRtuReceive(MODBUS_LINK *link, RTS_I64 now_ns)
{
    if (link->sending) {
        transmit(link, now_ns);
        return 0;
    }
    return take_bytes(link) && link->fill != 0 && is_quiet(link, now_ns) ? end_frame(link) : 0;
}

bool ModbusRtuReady(MODBUS_LINK *link, RTS_I64 now_ns)
{
    return !link->sending && link->fill == 0 && now_ns - link->moved_ns >= link->silence_ns && is_quiet(link, now_ns);
}
