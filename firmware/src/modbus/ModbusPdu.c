/*
 * ModbusPdu.c - requests and replies of Modbus, as bytes.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusPdu.h"

#include <string.h>

enum { ONE = 1, REG = MODBUS_REGISTER_BITS, COIL_ON = 0xFF00, LAST_ADDRESS = 0xFFFF };

static const MODBUS_FUNCTION functions[] = {
    {MODBUS_READ_COILS, MODBUS_COILS, 5, ONE, MODBUS_MAX_READ_BITS, 0},
    {MODBUS_READ_DISCRETE_INPUTS, MODBUS_DISCRETE_INPUTS, 5, ONE, MODBUS_MAX_READ_BITS, 0},
    {MODBUS_READ_HOLDING_REGISTERS, MODBUS_HOLDING_REGISTERS, 5, REG, MODBUS_MAX_READ_REGISTERS, 0},
    {MODBUS_READ_INPUT_REGISTERS, MODBUS_INPUT_REGISTERS, 5, REG, MODBUS_MAX_READ_REGISTERS, 0},
    {MODBUS_WRITE_COIL, MODBUS_COILS, 5, ONE, 0, 1},
    {MODBUS_WRITE_REGISTER, MODBUS_HOLDING_REGISTERS, 5, REG, 0, 1},
    {MODBUS_DIAGNOSTICS, 0, 5, REG, 0, 0},
    {MODBUS_WRITE_COILS, MODBUS_COILS, 6, ONE, 0, MODBUS_MAX_WRITE_BITS},
    {MODBUS_WRITE_REGISTERS, MODBUS_HOLDING_REGISTERS, 6, REG, 0, MODBUS_MAX_WRITE_REGISTERS},
    {MODBUS_REPORT_SERVER_ID, 0, 1, REG, 0, 0},
    {MODBUS_MASK_WRITE_REGISTER, MODBUS_HOLDING_REGISTERS, 7, REG, 0, 1},
    {MODBUS_READ_WRITE_REGISTERS, MODBUS_HOLDING_REGISTERS, 10, REG, MODBUS_MAX_READ_REGISTERS,
     MODBUS_MAX_READ_WRITE_REGISTERS},
    {MODBUS_ENCAPSULATED, 0, 4, REG, 0, 0},
};

const MODBUS_FUNCTION *ModbusFindFunction(RTS_UI8 function)
{
    for (RTS_UI32 i = 0; i < RTS_COUNT(functions); i++) {
        if (functions[i].function == function)
            return &functions[i];
    }
    return NULL;
}

RTS_NOINLINE RTS_UI32 ModbusDataSize(const MODBUS_FUNCTION *function, RTS_UI32 count)
{
    return (count * function->count_of_bits + 7) / 8;
}

RTS_NOINLINE void ModbusPut16(RTS_UI8 *data, RTS_UI32 value)
{
    data[0] = (RTS_UI8)(value >> 8);
    data[1] = (RTS_UI8)value;
}

/* Of a reply that repeats its request. */
static RTS_UI32 size_of_repeated(const MODBUS_FUNCTION *function)
{
    return function->function == MODBUS_MASK_WRITE_REGISTER ? 7 : 5;
}

/* Whether the data of its request are as long as a count says that is before them. */
static bool has_byte_count(const MODBUS_FUNCTION *function)
{
    return function->most_written > 1;
}

/* ---- where they end ---- */

RTS_UI32 ModbusGetRequestSize(const RTS_UI8 *pdu, RTS_UI32 size)
{
    const MODBUS_FUNCTION *function = ModbusFindFunction(pdu[0]);

    if (function == NULL || (pdu[0] == MODBUS_ENCAPSULATED && size >= 2 && pdu[1] != MODBUS_DEVICE_IDENTIFICATION))
        return 0;
    if (!has_byte_count(function) || size < function->size)
        return function->size;
    return (RTS_UI32)function->size + pdu[function->size - 1];
}

RTS_UI32 ModbusGetReplySize(const RTS_UI8 *pdu, RTS_UI32 size)
{
    const MODBUS_FUNCTION *function = ModbusFindFunction(pdu[0]);

    if ((pdu[0] & MODBUS_EXCEPTION) != 0)
        return 2;
    if (function == NULL || pdu[0] == MODBUS_ENCAPSULATED)
        return 0;
    if ((function->most_written != 0 && function->most_read == 0) || pdu[0] == MODBUS_DIAGNOSTICS)
        return size_of_repeated(function);
    return size < 2 ? 2 : 2u + pdu[1];
}

/* ---- requests that come ---- */

static bool is_beyond(RTS_UI16 address, RTS_UI16 count)
{
    return (RTS_UI32)address + count > LAST_ADDRESS + 1u;
}

RTS_UI8 ModbusCheckCounts(const MODBUS_REQUEST *request)
{
    const MODBUS_FUNCTION *function = request->function;
    bool reads = function->most_read != 0;
    bool writes = function->most_written != 0;

    if ((reads && request->read_count == 0) || request->read_count > function->most_read ||
        (writes && request->write_count == 0) || request->write_count > function->most_written)
        return MODBUS_ILLEGAL_VALUE;
    if (is_beyond(request->read_address, request->read_count) ||
        is_beyond(request->write_address, request->write_count))
        return MODBUS_ILLEGAL_ADDRESS;
    return 0;
}

/* The bytes of the data are those that the count of bits or registers needs, and all there are. */
static RTS_UI8 check_data(const MODBUS_REQUEST *request, RTS_UI32 size)
{
    RTS_UI32 bytes = ModbusDataSize(request->function, request->write_count);

    if (!has_byte_count(request->function))
        return 0;
    return request->data[-1] == bytes && size == request->function->size + bytes ? 0 : MODBUS_ILLEGAL_VALUE;
}

/* The lowest bit of both values of a coil is its state. */
static RTS_UI8 check_coil(const MODBUS_REQUEST *request)
{
    bool known = ModbusGet16(request->data) == COIL_ON || ModbusGet16(request->data) == 0;

    return known || request->function->function != MODBUS_WRITE_COIL ? 0 : MODBUS_ILLEGAL_VALUE;
}

static void read_numbers(RTS_UI8 *pdu, MODBUS_REQUEST *request)
{
    const MODBUS_FUNCTION *function = request->function;
    const RTS_UI8 *at = pdu + 1;

    if (function->most_read != 0) {
        request->read_address = ModbusGet16(at);
        request->read_count = ModbusGet16(at + 2);
        at += 4;
    }
    if (function->most_written != 0) {
        request->write_address = ModbusGet16(at);
        request->write_count = function->most_written > 1 ? ModbusGet16(at + 2) : 1;
    }
    request->data = pdu + (has_byte_count(function) ? function->size : 3);
}

RTS_UI8 ModbusReadRequest(RTS_UI8 *pdu, RTS_UI32 size, MODBUS_REQUEST *request)
{
    RTS_UI8 exception;

    memset(request, 0, sizeof(*request));
    request->function = size != 0 ? ModbusFindFunction(pdu[0]) : NULL;
    if (request->function == NULL)
        return MODBUS_ILLEGAL_FUNCTION;
    if (has_byte_count(request->function) ? size < request->function->size : size != request->function->size)
        return MODBUS_ILLEGAL_VALUE;
    read_numbers(pdu, request);
    exception = ModbusCheckCounts(request);
    if (exception == 0)
        exception = check_data(request, size);
    return exception != 0 ? exception : check_coil(request);
}

/* ---- requests that are made ---- */

RTS_UI32 ModbusBeginRequest(MODBUS_REQUEST *request, RTS_UI8 *pdu)
{
    const MODBUS_FUNCTION *function = request->function;
    RTS_UI8 *at = pdu + 1;
    RTS_UI32 bytes = 0;

    pdu[0] = function->function;
    if (function->most_read != 0) {
        ModbusPut16(at, request->read_address);
        ModbusPut16(at + 2, request->read_count);
        at += 4;
    }
    if (function->most_written != 0) {
        ModbusPut16(at, request->write_address);
        at += 2;
    }
    if (has_byte_count(function)) {
        bytes = ModbusDataSize(function, request->write_count);
        ModbusPut16(at, request->write_count);
        at[2] = (RTS_UI8)bytes;
        at += 3;
    }
    request->data = at;
    return function->size + bytes;
}

/* ---- replies ---- */

static MODBUS_REPLY check_data_reply(const MODBUS_REQUEST *request, const RTS_UI8 *pdu, RTS_UI32 size)
{
    RTS_UI32 bytes = ModbusDataSize(request->function, request->read_count);

    return size == 2 + bytes && pdu[1] == bytes ? MODBUS_REPLY_GOOD : MODBUS_REPLY_OTHER;
}

/* Repeats address and value, or address and count. */
static MODBUS_REPLY check_repeated(const MODBUS_REQUEST *request, const RTS_UI8 *head, const RTS_UI8 *pdu,
                                   RTS_UI32 size)
{
    return size == size_of_repeated(request->function) && memcmp(head, pdu, size) == 0 ? MODBUS_REPLY_GOOD
                                                                                       : MODBUS_REPLY_OTHER;
}

/* What a device says of itself: its own length is in the one, and the category that was asked for in the other. */
static MODBUS_REPLY check_description(const RTS_UI8 *head, const RTS_UI8 *pdu, RTS_UI32 size)
{
    bool good =
        pdu[0] == MODBUS_REPORT_SERVER_ID ? size == 2u + pdu[1] : size >= MODBUS_ID_HEAD && memcmp(head, pdu, 3) == 0;

    return good ? MODBUS_REPLY_GOOD : MODBUS_REPLY_OTHER;
}

MODBUS_REPLY ModbusCheckReply(const MODBUS_REQUEST *request, const RTS_UI8 *head, const RTS_UI8 *pdu, RTS_UI32 size)
{
    if (size == 2 && pdu[0] == (request->function->function | MODBUS_EXCEPTION))
        return MODBUS_REPLY_EXCEPTION;
    if (size < 2 || pdu[0] != request->function->function)
        return MODBUS_REPLY_OTHER;
    if (request->function->table == 0)
        return check_description(head, pdu, size);
    if (request->function->most_read != 0)
        return check_data_reply(request, pdu, size);
    return check_repeated(request, head, pdu, size);
}
