/*
 * ModbusServer.c - this device as a Modbus server: memory that others read and write.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A reply is made in the buffer of its request. Registers and bits are moved by one function, which counts bits from the
 * lowest of the first register on: byte n of them is at n ^ flip.
 */
#include "ModbusServer.h"

#include <string.h>

#include "CMUtils.h"
#include "ModbusPdu.h"
#include "ModbusTunnel.h"
#include "SysLock.h"

enum { TEXT_MAX = 100, REGISTER_SIZE = 2, ANY_UNIT = 255, NS_PER_MS = 1000000, LATE_MS = 100, UNREAD_MS = 5000 };

static bool is_tcp(const MODBUS_SERVER *server)
{
    return MODBUS_MAX_CONNECTIONS > 0 && server->tcp;
}

/* ---- memory ---- */

/* Bits in memory, or in a PDU. */
typedef struct {
    RTS_UI8 *data;
    RTS_UI32 at; /* bit */
    RTS_UI32 flip;
} BITS;

/* Up to 8 bits within one byte. */
static RTS_UI8 *byte_of(const BITS *bits)
{
    return bits->data + (bits->at / 8 ^ bits->flip);
}

static RTS_UI32 left_in_byte(const BITS *bits)
{
    return 8 - bits->at % 8;
}

static RTS_UI32 least(RTS_UI32 a, RTS_UI32 b)
{
    return a < b ? a : b;
}

static void move(BITS *to, BITS *from, RTS_UI32 count)
{
    while (count != 0) {
        RTS_UI32 step = least(count, least(left_in_byte(to), left_in_byte(from)));
        RTS_UI32 mask = (1u << step) - 1;
        RTS_UI32 value = *byte_of(from) >> from->at % 8 & mask;
        RTS_UI8 *byte = byte_of(to);
        *byte = (RTS_UI8)((*byte & ~(mask << to->at % 8)) | value << to->at % 8);
        to->at += step;
        from->at += step;
        count -= step;
    }
}

static bool is_of_registers(RTS_UI8 table)
{
    return (table & (MODBUS_HOLDING_REGISTERS | MODBUS_INPUT_REGISTERS)) != 0;
}

static RTS_UI32 unit_of(RTS_UI8 table)
{
    return is_of_registers(table) ? MODBUS_REGISTER_BITS : 1;
}

/* Where the address is in a range; how many there are from it on is returned, 0: it is not there. */
static RTS_UI32 find_in(const MODBUS_MEMORY *memory, RTS_UI8 table, RTS_UI32 address, BITS *found)
{
    const MODBUS_RANGE *range = memory->range;
    RTS_UI32 first = is_of_registers(table) ? range->first_register : range->first_bit;
    RTS_UI32 count = range->bits / unit_of(table);

    if ((range->tables & table) == 0 || address < first || address - first >= count)
        return 0;
    found->data = memory->data;
    found->at = (address - first) * unit_of(table);
    found->flip = 1u ^ (range->reverse - 1u);
    return count - (address - first);
}

/* Whether registers that are written are whole numbers. */
static bool is_whole(const MODBUS_RANGE *range, RTS_UI8 table, RTS_UI32 at, RTS_UI32 count)
{
    RTS_UI32 others = range->flags >> MODBUS_RANGE_NUMBER_SHIFT;

    return !is_of_registers(table) || (((at / MODBUS_REGISTER_BITS) | count) & others) == 0;
}

/* How many of `count` from the address on are in one range, 0: they are not there, or cannot be written. */
static RTS_UI32 find(const MODBUS_SERVER *server, RTS_UI8 table, RTS_UI32 address, RTS_UI32 count, bool to_write,
                     BITS *found)
{
    for (RTS_UI32 i = 0; i < server->range_count; i++) {
        const MODBUS_RANGE *range = server->memory[i].range;
        RTS_UI32 there = least(count, find_in(&server->memory[i], table, address, found));
        if (there != 0)
            return to_write &&
                           ((range->flags & MODBUS_RANGE_WRITABLE) == 0 || !is_whole(range, table, found->at, there))
                       ? 0
                       : there;
    }
    return 0;
}

/* One register or bit that is in no range. */
static RTS_UI32 find_gap(const MODBUS_SERVER *server, BITS *found)
{
    *found = (BITS){(RTS_UI8 *)server->gap, 0, 0};
    return 1;
}

/* Moves what a request reads or writes between memory and a PDU, locked; `data` NULL: nothing yet. False: it is not all
 * there. */
static bool exchange(const MODBUS_SERVER *server, const MODBUS_REQUEST *request, bool to_write, RTS_UI8 *data)
{
    RTS_UI8 table = request->function->table;
    RTS_UI32 address = to_write ? request->write_address : request->read_address;
    RTS_UI32 count = to_write ? request->write_count : request->read_count;
    BITS pdu = {data, 0, is_of_registers(table)};
    BITS found = {NULL, 0, 0};

    while (count != 0) {
        RTS_UI32 there = find(server, table, address, count, to_write, &found);
        if (there == 0 && server->has_gaps && !to_write)
            there = find_gap(server, &found);
        if (there == 0)
            return false;
        if (data != NULL)
            move(to_write ? &found : &pdu, to_write ? &pdu : &found, there * unit_of(table));
        address += there;
        count -= there;
    }
    return true;
}

/* ---- reading and writing ---- */

/* Of function 22 the data are two masks: the register is read, and written. */
static void mask_register(const MODBUS_SERVER *server, MODBUS_REQUEST *request)
{
    RTS_UI8 value[REGISTER_SIZE];

    request->read_address = request->write_address;
    request->read_count = 1;
    (void)exchange(server, request, false, value);
    request->read_count = 0;
    for (RTS_UI32 i = 0; i < REGISTER_SIZE; i++) {
        RTS_UI8 and_mask = request->data[i];
        RTS_UI8 or_mask = request->data[REGISTER_SIZE + i];
        value[i] = (RTS_UI8)((value[i] & and_mask) | (or_mask & ~and_mask));
    }
    (void)exchange(server, request, true, value);
}

static RTS_UI8 access(MODBUS_SERVER *server, MODBUS_REQUEST *request, RTS_UI8 *pdu)
{
    RTS_UI32 lock;

    if (!exchange(server, request, false, NULL) || !exchange(server, request, true, NULL))
        return MODBUS_ILLEGAL_ADDRESS;
    lock = SysLockEnter();
    if (request->write_count != 0 && ++server->written == 0)
        server->written = 1;
    if (request->function->function == MODBUS_MASK_WRITE_REGISTER)
        mask_register(server, request);
    else
        (void)exchange(server, request, true, request->data);
    (void)exchange(server, request, false, pdu + 2);
    SysLockLeave(lock);
    return 0;
}

/* Size of the reply after `access`: the data, or the beginning of the request. */
static RTS_UI32 end_reply(const MODBUS_REQUEST *request, RTS_UI8 *pdu)
{
    RTS_UI32 bytes = ModbusDataSize(request->function, request->read_count);

    if (request->function->most_read == 0)
        return request->function->function == MODBUS_MASK_WRITE_REGISTER ? MODBUS_HEAD_SIZE : 5;
    pdu[1] = (RTS_UI8)bytes;
    return 2 + bytes;
}

/* The last byte of bits may have some that the request does not ask for. */
static void clear_last(const MODBUS_REQUEST *request, RTS_UI8 *pdu)
{
    pdu[1 + ModbusDataSize(request->function, request->read_count)] = 0;
}

static RTS_UI32 reply_access(MODBUS_SERVER *server, MODBUS_REQUEST *request, RTS_UI8 *pdu, RTS_UI8 *exception)
{
    if (request->function->most_read != 0 && request->function->most_written == 0)
        clear_last(request, pdu);
    *exception = access(server, request, pdu);
    return end_reply(request, pdu);
}

/* ---- what the device is ---- */

static RTS_NOINLINE RTS_UI32 put_text(const MODBUS_SERVER *server, RTS_UI32 object, RTS_UI8 *place)
{
    const char *text = server->object[object];
    RTS_UI32 length = text != NULL ? CMUtlStrNLen(text, TEXT_MAX) : 0;

    memcpy(place, text != NULL ? text : "", length);
    return length;
}

static RTS_UI32 reply_server_id(const MODBUS_SERVER *server, RTS_UI8 *pdu)
{
    RTS_UI32 length = put_text(server, MODBUS_PRODUCT_NAME, pdu + 4);

    pdu[1] = (RTS_UI8)(2 + length);
    pdu[2] = server->unit;
    pdu[3] = server->running ? 0xFF : 0;
    return 4 + length;
}

enum { ID_BASIC = 1, ID_REGULAR = 2, ID_EXTENDED = 3, ID_INDIVIDUAL = 4, ID_CONFORMITY = 0x82 };

static RTS_NOINLINE bool has_object(const MODBUS_SERVER *server, RTS_UI32 object)
{
    return object < MODBUS_BASIC_OBJECTS || (server->object[object] != NULL && server->object[object][0] != '\0');
}

/* Appends objects from `object` to before `end`, as many as there is room for. Returns the size of the reply. */
static RTS_UI32 put_objects(const MODBUS_SERVER *server, RTS_UI32 object, RTS_UI32 end, RTS_UI8 *pdu)
{
    RTS_UI32 size = MODBUS_ID_HEAD;

    for (; object < end; object++) {
        if (!has_object(server, object))
            continue;
        if (size + 2 + TEXT_MAX > MODBUS_MAX_PDU) {
            pdu[4] = 0xFF; /* more follows, */
            pdu[5] = (RTS_UI8)object;
            return size;
        }
        RTS_UI32 length = put_text(server, object, pdu + size + 2);
        pdu[size] = (RTS_UI8)object;
        pdu[size + 1] = (RTS_UI8)length;
        pdu[6]++;
        size += 2 + length;
    }
    return size;
}

/* A stream begins with the first object if the one it is to begin with is none. */
static RTS_UI32 reply_identification(const MODBUS_SERVER *server, RTS_UI8 *pdu, RTS_UI8 *exception)
{
    RTS_UI8 code = pdu[2];
    RTS_UI32 object = pdu[3];
    RTS_UI32 end = code == ID_BASIC ? MODBUS_BASIC_OBJECTS : MODBUS_OBJECTS;

    if (pdu[1] != MODBUS_DEVICE_IDENTIFICATION)
        *exception = MODBUS_ILLEGAL_FUNCTION;
    else if (code < ID_BASIC || code > ID_INDIVIDUAL)
        *exception = MODBUS_ILLEGAL_VALUE;
    else if (code == ID_INDIVIDUAL && (object >= MODBUS_OBJECTS || !has_object(server, object)))
        *exception = MODBUS_ILLEGAL_ADDRESS;
    if (*exception != 0)
        return 0;
    if (code == ID_INDIVIDUAL)
        end = object + 1;
    else if (object >= end)
        object = 0;
    pdu[3] = ID_CONFORMITY;
    memset(pdu + 4, 0, 3);
    return put_objects(server, object, end, pdu);
}

/* ---- requests ---- */

static RTS_UI32 reply(MODBUS_SERVER *server, MODBUS_REQUEST *request, RTS_UI8 *pdu, RTS_UI8 *exception)
{
    switch (request->function->function) {
    case MODBUS_DIAGNOSTICS:
        *exception = ModbusGet16(pdu + 1) == MODBUS_LOOPBACK ? 0 : MODBUS_ILLEGAL_FUNCTION;
        return request->function->size; /* what came */
    case MODBUS_REPORT_SERVER_ID:
        return reply_server_id(server, pdu);
    case MODBUS_ENCAPSULATED:
        return reply_identification(server, pdu, exception);
    default:
        return reply_access(server, request, pdu, exception);
    }
}

static RTS_UI32 reply_request(MODBUS_SERVER *server, RTS_UI8 *pdu, RTS_UI32 size, RTS_UI8 *exception)
{
    MODBUS_REQUEST request;

    *exception = ModbusReadRequest(pdu, size, &request);
    if (request.function != NULL && request.function->table != 0 && server->range_count == 0)
        *exception = MODBUS_ILLEGAL_FUNCTION; /* it has no memory at all */
    return *exception == 0 ? reply(server, &request, pdu, exception) : 0;
}

static RTS_UI32 reply_tunnel(const MODBUS_SERVER *server, RTS_UI8 *pdu, RTS_UI32 size, RTS_UI8 *exception)
{
    if (MODBUS_TUNNEL && server->tunnel)
        return ModbusTunnelReply(pdu, size, exception);
    *exception = MODBUS_ILLEGAL_FUNCTION;
    return 0;
}

RTS_UI32 ModbusServerReply(MODBUS_SERVER *server, RTS_UI8 *pdu, RTS_UI32 size)
{
    RTS_UI8 function = pdu[0];
    RTS_UI8 exception = 0;

    server->requests++;
    size = ModbusTunnelIsRequest(pdu, size) ? reply_tunnel(server, pdu, size, &exception)
                                            : reply_request(server, pdu, size, &exception);
    if (exception == 0)
        return size;
    server->errors++;
    pdu[0] = function | MODBUS_EXCEPTION;
    pdu[1] = exception;
    return 2;
}

/* What tools say is for one device: its reply is a part of it. */
static bool is_for(const MODBUS_SERVER *server, RTS_UI8 unit, bool of_tool)
{
    if (!is_tcp(server))
        return unit == server->unit || (unit == MODBUS_BROADCAST && !of_tool);
    return server->unit == 0 || unit == server->unit || unit == 0 || unit == ANY_UNIT;
}

/* On TCP 0 is not all devices, but the one that is connected. */
static bool wants_reply(const MODBUS_SERVER *server, RTS_UI8 unit)
{
    return is_tcp(server) || unit != MODBUS_BROADCAST;
}

/* A client of TCP need not wait until it gives up: there is no such device here. */
static RTS_UI32 reply_no_target(RTS_UI8 *pdu)
{
    pdu[0] |= MODBUS_EXCEPTION;
    pdu[1] = MODBUS_NO_TARGET;
    return 2;
}

/* A reply on a serial line does not say to which request it is: one that the port does not take in time would be that
 * to a later one. A client of TCP that reads nothing for so long is gone, or will not read any more. */
static void give_up_late(const MODBUS_SERVER *server, MODBUS_LINK *link, RTS_I64 now_ns)
{
    RTS_I64 most_ns = (RTS_I64)(is_tcp(server) ? UNREAD_MS : LATE_MS) * NS_PER_MS;

    if (link->sending && now_ns - link->moved_ns >= most_ns)
        ModbusLinkType(link)->give_up(link);
}

bool ModbusServerPoll(MODBUS_SERVER *server, MODBUS_LINK *link, RTS_I64 now_ns)
{
    RTS_UI8 *pdu = link->frame + MODBUS_AT_PDU;
    RTS_UI8 unit;
    RTS_UI32 size;

    link->looks_for = MODBUS_LOOKS_FOR_REQUESTS;
    link->unit = server->unit;
    size = ModbusLinkType(link)->receive(link, now_ns);
    unit = link->frame[MODBUS_AT_UNIT];
    if (size == 0) {
        give_up_late(server, link, now_ns);
        return false;
    }
    if (is_for(server, unit, ModbusTunnelIsRequest(pdu, size)))
        size = ModbusServerReply(server, pdu, size);
    else
        size = is_tcp(server) ? reply_no_target(pdu) : 0;
    if (size != 0 && wants_reply(server, unit))
        ModbusLinkType(link)->send(link, size, now_ns);
    else
        ModbusLinkDrop(link);
    return true;
}
