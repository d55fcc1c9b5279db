/*
 * SimWire.c - the wires of simulated field buses.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "SimWire.h"

#include <string.h>

#include "ModbusLink.h"
#include "ModbusPdu.h"
#include "ModbusRtu.h"
#include "SimModbus.h"
#include "SimTimes.h"
#include "SysSocket.h"
#include "SysTime.h"
#include "rts_config.h"

enum {
    WIRES = MODBUS_MAX_CLIENTS + MODBUS_MAX_SERVERS,
    FIRST_LINE = 1, /* 0 is that of tools */
    FIRST_SOCKET = 0x1000,
    LISTENER = 0x2000, /* no client connects to it */
    LEAST_FRAME = MODBUS_AT_PDU + 1,
};

#define LONG_AGO_NS (-(RTS_I64)1000000000)
#define NS_PER_S ((RTS_I64)1000000000)
#define LEAST_SILENCE_NS ((RTS_I64)1750000)

/* One frame at a time is on it: a request, and then its reply, both with the header of TCP, of which the frames of a serial
 * line show the unit only. */
typedef struct {
    bool is_open;
    char name[32];    /* of a serial line; "" of a connection */
    RTS_I64 char_ns;  /* 0: a connection */
    bool is_rtu;      /* frames of a serial line, on a connection too */
    RTS_I64 quiet_ns; /* from when on the line is silent */
    RTS_I64 byte_ns;  /* when the last byte came that was read */
    RTS_I64 due_ns;   /* when the reply begins */
    bool replies;     /* it has begun */
    RTS_UI32 fill;    /* from MODBUS_AT_UNIT on, of a connection from 0 on; 0: nothing is on its way */
    RTS_UI32 taken;
    RTS_UI8 frame[MODBUS_FRAME_SIZE];
} WIRE;

static WIRE wires[WIRES];

static RTS_HANDLE handle_of(const WIRE *wire)
{
    return (RTS_HANDLE)(wire - wires) + (wire->char_ns != 0 ? FIRST_LINE : FIRST_SOCKET);
}

static WIRE *find(RTS_HANDLE handle)
{
    RTS_UI32 index = handle >= FIRST_SOCKET ? handle - FIRST_SOCKET : handle - FIRST_LINE;

    return index < WIRES && wires[index].is_open && handle_of(&wires[index]) == handle ? &wires[index] : NULL;
}

static WIRE *make(const char *name, RTS_I64 char_ns)
{
    for (WIRE *wire = wires; wire < wires + WIRES; wire++) {
        if (wire->is_open)
            continue;
        memset(wire, 0, sizeof(*wire));
        wire->is_open = true;
        strncpy(wire->name, name, sizeof(wire->name) - 1);
        wire->char_ns = char_ns;
        wire->quiet_ns = wire->byte_ns = LONG_AGO_NS;
        return wire;
    }
    return NULL;
}

static RTS_I64 silence_of(const WIRE *wire)
{
    RTS_I64 silence_ns = wire->char_ns * 7 / 2;

    return wire->char_ns == 0 || silence_ns > LEAST_SILENCE_NS ? silence_ns : LEAST_SILENCE_NS;
}

/* Where the frame begins on this wire. */
static RTS_UI32 start_of(const WIRE *wire)
{
    return wire->is_rtu ? MODBUS_AT_UNIT : 0;
}

/* ---- frames ---- */

static void forget(WIRE *wire)
{
    wire->fill = wire->taken = 0;
    wire->replies = false;
}

/* A client sends a frame as a whole. */
static RTS_UI32 put(WIRE *wire, const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 start;
    RTS_I64 delay_ns;

    forget(wire);
    wire->is_rtu = wire->char_ns != 0 || SimModbusIsRtu(handle_of(wire));
    start = start_of(wire);
    if (start + size < LEAST_FRAME || size > sizeof(wire->frame) - start || !SimModbusIsPlugged(handle_of(wire)))
        return size;
    memcpy(wire->frame + start, data, size);
    delay_ns = SimModbusGetDelayNs(handle_of(wire), wire->frame[MODBUS_AT_UNIT]);
    if (delay_ns < 0)
        return size;
    wire->fill = size;
    wire->due_ns = SysTimeGetNs() + size * wire->char_ns + silence_of(wire) + delay_ns;
    return size;
}

static void end_serial(WIRE *wire, RTS_UI32 size, SIM_ARRIVAL arrival)
{
    RTS_UI8 *unit = wire->frame + MODBUS_AT_UNIT;
    RTS_UI16 crc = ModbusCrc(unit, 1 + size);

    unit[1 + size] = (RTS_UI8)(arrival == SIM_DAMAGED ? crc ^ 0x10 : crc);
    unit[2 + size] = (RTS_UI8)(crc >> 8);
    wire->fill = (1 + size + MODBUS_CRC_SIZE) / (arrival == SIM_CUT ? 2 : 1);
    wire->quiet_ns = wire->due_ns + wire->fill * wire->char_ns + silence_of(wire);
}

static void end_tcp(WIRE *wire, RTS_UI32 size, SIM_ARRIVAL arrival)
{
    ModbusPut16(wire->frame + MODBUS_AT_LENGTH, 1 + size);
    wire->fill = MODBUS_AT_PDU + (arrival == SIM_WHOLE ? size : size / 2);
    wire->quiet_ns = wire->due_ns;
}

/* The device has heard the request, and begins to reply. */
static void begin_reply(WIRE *wire)
{
    RTS_UI32 size = wire->fill + start_of(wire) - MODBUS_AT_PDU - (wire->is_rtu ? MODBUS_CRC_SIZE : 0);
    SIM_ARRIVAL arrival = SIM_WHOLE;

    size = SimModbusReply(handle_of(wire), wire->frame[MODBUS_AT_UNIT], wire->frame + MODBUS_AT_PDU, size, &arrival);
    forget(wire);
    if (size == 0 || !SimModbusIsPlugged(handle_of(wire)))
        return;
    wire->replies = true;
    if (wire->is_rtu)
        end_serial(wire, size, arrival);
    else
        end_tcp(wire, size, arrival);
}

static RTS_UI32 arrived(const WIRE *wire, RTS_I64 now_ns)
{
    RTS_I64 bytes;

    if (!wire->replies || wire->char_ns == 0)
        return wire->replies ? wire->fill : 0;
    bytes = (now_ns - wire->due_ns) / wire->char_ns;
    return bytes < wire->fill ? (RTS_UI32)bytes : wire->fill;
}

static RTS_UI32 get(WIRE *wire, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_I64 now_ns = SysTimeGetNs();
    RTS_UI32 ready;

    if (wire->fill != 0 && !wire->replies && now_ns >= wire->due_ns)
        begin_reply(wire);
    ready = arrived(wire, now_ns) - wire->taken;
    if (ready > size)
        ready = size;
    if (ready == 0)
        return 0;
    memcpy(data, wire->frame + start_of(wire) + wire->taken, ready);
    wire->taken += ready;
    wire->byte_ns = wire->due_ns + wire->taken * wire->char_ns;
    if (wire->taken == wire->fill)
        forget(wire);
    return ready;
}

RTS_I64 SimWireGetDueNs(RTS_I64 now_ns)
{
    RTS_I64 due_ns = NEVER;

    for (const WIRE *wire = wires; wire < wires + WIRES; wire++) {
        if (!wire->is_open)
            continue;
        if (wire->fill != 0 && !wire->replies && wire->due_ns < due_ns)
            due_ns = wire->due_ns;
        if (wire->quiet_ns > now_ns && wire->quiet_ns < due_ns)
            due_ns = wire->quiet_ns;
    }
    return due_ns;
}

/* ---- serial lines ---- */

static bool is_in_use(const char *name)
{
    for (const WIRE *wire = wires; wire < wires + WIRES; wire++) {
        if (wire->is_open && wire->char_ns != 0 && strncmp(wire->name, name, sizeof(wire->name) - 1) == 0)
            return true;
    }
    return false;
}

RTS_RESULT SimWireOpen(const char *name, const SYSCOM_SETTINGS *settings, RTS_UI32 *line)
{
    RTS_UI32 bits = 1 + 8 + (settings->parity != SYSCOM_PARITY_NONE) + settings->stop_bits;
    WIRE *wire = is_in_use(name) ? NULL : make(name, NS_PER_S * bits / settings->baud);

    if (wire == NULL)
        return ERR_DUPLICATE;
    *line = handle_of(wire);
    return ERR_OK;
}

void SimWireClose(RTS_UI32 line)
{
    WIRE *wire = find(line);

    if (wire != NULL)
        wire->is_open = false;
}

RTS_UI32 SimWireRead(RTS_UI32 line, RTS_UI8 *data, RTS_UI32 size)
{
    WIRE *wire = find(line);

    return wire != NULL ? get(wire, data, size) : 0;
}

RTS_UI32 SimWireWrite(RTS_UI32 line, const RTS_UI8 *data, RTS_UI32 size)
{
    WIRE *wire = find(line);

    return wire != NULL ? put(wire, data, size) : 0;
}

void SimWireDiscard(RTS_UI32 line)
{
    WIRE *wire = find(line);

    if (wire != NULL && !wire->replies)
        forget(wire);
}

RTS_I64 SimWireGetByteNs(RTS_UI32 line)
{
    const WIRE *wire = find(line);

    return wire != NULL ? wire->byte_ns : LONG_AGO_NS;
}

/* ---- connections ---- */

RTS_HANDLE SysSockConnect(const SOCKADDRESS *peer)
{
    WIRE *wire = make("", 0);

    RTS_UNUSED(peer);
    return wire != NULL ? handle_of(wire) : RTS_INVALID_HANDLE;
}

/* Each name is one of a host. */
RTS_HANDLE SysSockConnectName(const char *host, RTS_UI16 port)
{
    RTS_UNUSED(host);
    return SysSockConnect(&(SOCKADDRESS){0, port});
}

RTS_RESULT SysSockGetConnected(RTS_HANDLE socket)
{
    return SimModbusIsPlugged(socket) ? ERR_OK : ERR_PENDING;
}

RTS_RESULT SysSockSend(RTS_HANDLE socket, const RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *taken)
{
    WIRE *wire = find(socket);

    *taken = wire != NULL ? put(wire, data, size) : 0;
    return wire != NULL ? ERR_OK : ERR_NET_NOTCONNECTED;
}

RTS_RESULT SysSockRecv(RTS_HANDLE socket, RTS_UI8 *data, RTS_UI32 size, RTS_UI32 *received)
{
    WIRE *wire = find(socket);

    *received = wire != NULL ? get(wire, data, size) : 0;
    return wire != NULL ? ERR_OK : ERR_NET_NOTCONNECTED;
}

void SysSockReset(RTS_HANDLE socket)
{
    SimWireClose(socket);
}

void SysSockClose(RTS_HANDLE socket)
{
    SimWireClose(socket);
}

RTS_RESULT SysSockListen(const SOCKADDRESS *own, RTS_HANDLE *listener)
{
    RTS_UNUSED(own);
    *listener = LISTENER;
    return ERR_OK;
}

RTS_HANDLE SysSockAccept(RTS_HANDLE listener, SOCKADDRESS *peer)
{
    RTS_UNUSED(listener);
    RTS_UNUSED(peer);
    return RTS_INVALID_HANDLE;
}
