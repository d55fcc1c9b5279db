/*
 * modbus_fakes.c - a serial line and a network on a virtual clock, for the tests of Modbus.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "modbus_fakes.h"

#include <string.h>

#include "ModbusPdu.h"
#include "ModbusRtu.h"
#include "SysLock.h"
#include "SysTime.h"

MODBUS_FAKES fakes;

enum { NS_PER_S = 1000000000, BITS_PER_CHAR = 11, BAUD = 19200 };

void fakes_begin(void)
{
    memset(&fakes, 0, sizeof(fakes));
    fakes.now_ns = NS_PER_S;
    fakes.char_ns = (RTS_I64)NS_PER_S * BITS_PER_CHAR / BAUD;
    fakes.write_limit = fakes.read_limit = FAKE_LINE_ROOM;
    fakes.send_limit = fakes.window = FAKE_SOCKET_ROOM;
    fakes.connect_result = ERR_OK;
}

RTS_UI32 SysLockEnter(void)
{
    fakes.locks++;
    fakes.locked = true;
    return 0;
}

void SysLockLeave(RTS_UI32 before)
{
    RTS_UNUSED(before);
    fakes.locked = false;
}

RTS_I64 SysTimeGetNs(void)
{
    return fakes.now_ns;
}

/* ---- the serial line ---- */

static void add(FAKE_BYTES *bytes, RTS_UI8 byte, RTS_I64 time_ns)
{
    if (bytes->size < FAKE_LINE_ROOM) {
        bytes->data[bytes->size] = byte;
        bytes->time_ns[bytes->size++] = time_ns;
    }
}

void line_send(const RTS_UI8 *data, RTS_UI32 size)
{
    FAKE_BYTES *to = &fakes.to_device;
    RTS_I64 time_ns = fakes.now_ns;

    if (to->size != 0 && to->time_ns[to->size - 1] > time_ns)
        time_ns = to->time_ns[to->size - 1];
    for (RTS_UI32 i = 0; i < size && !fakes.pulled; i++)
        add(to, data[i], time_ns += fakes.char_ns);
}

void line_send_frame(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI16 crc = ModbusCrc(data, size);
    RTS_UI8 bytes[] = {(RTS_UI8)crc, (RTS_UI8)(crc >> 8)};

    line_send(data, size);
    line_send(bytes, sizeof(bytes));
}

RTS_UI32 line_take(RTS_UI8 *data, RTS_UI32 capacity)
{
    FAKE_BYTES *from = &fakes.from_device;
    RTS_UI32 size = 0;

    while (from->read < from->size && size < capacity && from->time_ns[from->read] <= fakes.now_ns)
        data[size++] = from->data[from->read++];
    if (from->read == from->size)
        from->read = from->size = 0;
    return size;
}

/* Bytes that are there at this time and have not been read. */
static RTS_UI32 count_until(const FAKE_BYTES *bytes, RTS_I64 time_ns)
{
    RTS_UI32 end = bytes->read;

    while (end < bytes->size && bytes->time_ns[end] <= time_ns)
        end++;
    return end - bytes->read;
}

/* Of those that are there, how many the hardware hands over now. */
static RTS_UI32 count_handed_over(const FAKE_BYTES *bytes)
{
    enum { TRIGGER = 8, CHARS_AFTER = 4, PACKET = 62 };
    const RTS_I64 latency_ns = 16000000;
    RTS_UI32 count = count_until(bytes, fakes.now_ns);

    if (count == 0 || fakes.hardware == FAKE_EACH)
        return count;
    if (fakes.hardware == FAKE_USB)
        return count >= PACKET ? count : count_until(bytes, fakes.now_ns / latency_ns * latency_ns);
    if (fakes.now_ns - bytes->time_ns[bytes->read + count - 1] >= CHARS_AFTER * fakes.char_ns)
        return count;
    return count / TRIGGER * TRIGGER;
}

RTS_UI32 SysComRead(RTS_UI32 index, RTS_UI8 *data, RTS_UI32 size)
{
    FAKE_BYTES *to = &fakes.to_device;
    RTS_UI32 count = 0;

    RTS_UNUSED(index);
    size = size < fakes.read_limit ? size : fakes.read_limit;
    fakes.reads++;
    if (fakes.babbles && fakes.reads < FAKE_READS) {
        memset(data, 0x55, size);
        fakes.last_byte_ns = fakes.now_ns;
        return size;
    }
    for (RTS_UI32 left = count_handed_over(to); left != 0 && count < size; left--) {
        fakes.last_byte_ns = fakes.hardware == FAKE_EACH ? to->time_ns[to->read] : fakes.now_ns;
        data[count++] = to->data[to->read++];
    }
    if (to->read == to->size)
        to->read = to->size = 0;
    return count;
}

RTS_UI32 SysComWrite(RTS_UI32 index, const RTS_UI8 *data, RTS_UI32 size)
{
    FAKE_BYTES *from = &fakes.from_device;
    RTS_I64 time_ns = fakes.now_ns;

    RTS_UNUSED(index);
    if (from->size != 0 && from->time_ns[from->size - 1] > time_ns)
        time_ns = from->time_ns[from->size - 1];
    size = size < fakes.write_limit ? size : fakes.write_limit;
    for (RTS_UI32 i = 0; i < size && !fakes.pulled; i++)
        add(from, data[i], time_ns += fakes.char_ns);
    return size;
}

/* What has left is at the other end, or on its way. */
void SysComDiscard(RTS_UI32 index)
{
    RTS_UNUSED(index);
    fakes.discards++;
}

RTS_I64 SysComGetByteNs(RTS_UI32 index)
{
    RTS_UNUSED(index);
    return fakes.last_byte_ns;
}

void SysComClose(RTS_UI32 index)
{
    RTS_UNUSED(index);
}

/* ---- the network ---- */

FAKE_SOCKET *net_dial(void)
{
    FAKE_SOCKET *socket = &fakes.sockets[fakes.used++];

    socket->connected = true;
    fakes.pending++;
    return socket;
}

void net_put(FAKE_SOCKET *socket, const RTS_UI8 *data, RTS_UI32 size)
{
    memcpy(socket->in + socket->in_size, data, size);
    socket->in_size += size;
}

void net_put_pdu(FAKE_SOCKET *socket, RTS_UI16 transaction, RTS_UI8 unit, const RTS_UI8 *pdu, RTS_UI32 size)
{
    RTS_UI8 header[MODBUS_AT_PDU] = {0};

    ModbusPut16(header + MODBUS_AT_TRANSACTION, transaction);
    ModbusPut16(header + MODBUS_AT_LENGTH, 1 + size);
    header[MODBUS_AT_UNIT] = unit;
    net_put(socket, header, sizeof(header));
    net_put(socket, pdu, size);
}

RTS_RESULT SysSockListen(const SOCKADDRESS *own, RTS_HANDLE *listener)
{
    RTS_UNUSED(own);
    *listener = FAKE_LISTENER;
    fakes.listeners += fakes.listen_result == ERR_OK;
    return fakes.listen_result;
}

RTS_HANDLE SysSockAccept(RTS_HANDLE listener, SOCKADDRESS *peer)
{
    RTS_UNUSED(listener);
    *peer = (SOCKADDRESS){0x7F000001, 50000};
    if (fakes.pending == 0)
        return (RTS_HANDLE)RTS_INVALID_HANDLE;
    fakes.pending--;
    fakes.sockets[fakes.accepted].open = true;
    return fakes.accepted++;
}

RTS_HANDLE SysSockConnect(const SOCKADDRESS *peer)
{
    FAKE_SOCKET *socket = &fakes.sockets[fakes.used];

    fakes.connects++;
    memset(socket, 0, sizeof(*socket));
    socket->open = true;
    socket->peer = *peer;
    return fakes.used++;
}

RTS_HANDLE SysSockConnectName(const char *host, RTS_UI16 port)
{
    RTS_HANDLE socket = SysSockConnect(&(SOCKADDRESS){0, port});

    fakes.sockets[socket].host = host;
    return socket;
}

RTS_RESULT SysSockGetConnected(RTS_HANDLE socket)
{
    if (fakes.sockets[socket].host != NULL && fakes.lookup_result != ERR_OK)
        return fakes.lookup_result;
    fakes.sockets[socket].connected = fakes.connect_result == ERR_OK;
    return fakes.connect_result;
}

RTS_RESULT SysSockRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received)
{
    FAKE_SOCKET *from = &fakes.sockets[socket];

    *received = size < from->in_size ? size : from->in_size;
    memcpy(data, from->in, *received);
    from->in_size -= *received;
    memmove(from->in, from->in + *received, from->in_size);
    return from->peer_gone && *received == 0 ? ERR_NET_NOTCONNECTED : ERR_OK;
}

RTS_RESULT SysSockSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken)
{
    FAKE_SOCKET *to = &fakes.sockets[socket];
    RTS_UI32 room = fakes.window > to->out_size ? fakes.window - to->out_size : 0;

    *taken = size < room ? size : room;
    *taken = *taken < fakes.send_limit ? *taken : fakes.send_limit;
    memcpy(to->out + to->out_size, data, *taken);
    to->out_size += *taken;
    return to->peer_gone ? ERR_NET_NOTCONNECTED : ERR_OK;
}

/* What it sent and the peer has not read is lost. */
void SysSockReset(RTS_HANDLE socket)
{
    fakes.sockets[socket].out_size = 0;
    fakes.sockets[socket].open = false;
}

void SysSockClose(RTS_HANDLE socket)
{
    if (socket == FAKE_LISTENER)
        fakes.listeners--;
    else
        fakes.sockets[socket].open = false;
}
