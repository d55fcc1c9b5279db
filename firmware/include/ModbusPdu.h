/*
 * ModbusPdu.h - requests and replies of Modbus, as bytes: what servers and clients share.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A PDU is what RTU and TCP frame: a function code and its data, numbers with the high byte first. From any context.
 */
#ifndef MODBUSPDU_H
#define MODBUSPDU_H

#include "Modbus.h"

/* What a function code is. */
typedef struct {
    RTS_UI8 function;
    RTS_UI8 table;         /* MODBUS_COILS, ...; 0: it is about none */
    RTS_UI8 size;          /* of its request, without the bytes that a count in it announces */
    RTS_UI8 count_of_bits; /* 1: of one, 16: of registers */
    RTS_UI16 most_read;    /* bits or registers; 0: it reads none */
    RTS_UI16 most_written;
} MODBUS_FUNCTION;

/* NULL: none of those that there are here. */
const MODBUS_FUNCTION *ModbusFindFunction(RTS_UI8 function);

/* What a request asks for. */
typedef struct {
    const MODBUS_FUNCTION *function;
    RTS_UI16 read_address;
    RTS_UI16 read_count;
    RTS_UI16 write_address;
    RTS_UI16 write_count;
    RTS_UI8 *data; /* written: bits from the lowest bit on, registers with the high byte first; in the PDU */
} MODBUS_REQUEST;

/* Bytes that so many bits or registers of a function take. */
RTS_UI32 ModbusDataSize(const MODBUS_FUNCTION *function, RTS_UI32 count);

/* Reads a request. 0, or the exception it deserves: MODBUS_ILLEGAL_FUNCTION, MODBUS_ILLEGAL_VALUE (it has another
 * length than it should, or asks for too much), MODBUS_ILLEGAL_ADDRESS (beyond 65535). */
RTS_UI8 ModbusReadRequest(RTS_UI8 *pdu, RTS_UI32 size, MODBUS_REQUEST *request);

/* Whether a request asks for as much as there may be of its function. 0, or the exception it deserves. */
RTS_UI8 ModbusCheckCounts(const MODBUS_REQUEST *request);

/* Begins a request: all but the data (of functions 17 and 43: what follows the function), for which `request->data` gets a place in `pdu` (MODBUS_MAX_PDU bytes). The counts
 * are within the limits. Returns its size, with the data. */
RTS_UI32 ModbusBeginRequest(MODBUS_REQUEST *request, RTS_UI8 *pdu);

/* How long the request, or the reply, is that begins with these bytes, as far as they say: more than `size` (1 at least)
 * while it is not all there. 0: its function does not say it. */
RTS_UI32 ModbusGetRequestSize(const RTS_UI8 *pdu, RTS_UI32 size);
RTS_UI32 ModbusGetReplySize(const RTS_UI8 *pdu, RTS_UI32 size);

/* What a reply is to a request. */
typedef enum {
    MODBUS_REPLY_GOOD,      /* data that were read begin at pdu + 2; of functions 17 and 43 none are looked at */
    MODBUS_REPLY_EXCEPTION, /* its code is pdu[1] */
    MODBUS_REPLY_OTHER,     /* of another length, function or address: not a reply to this request */
} MODBUS_REPLY;

/* `head`: the first bytes of the request, MODBUS_HEAD_SIZE. */
enum { MODBUS_HEAD_SIZE = 7 };
MODBUS_REPLY ModbusCheckReply(const MODBUS_REQUEST *request, const RTS_UI8 *head, const RTS_UI8 *pdu, RTS_UI32 size);

/* Numbers of a PDU. */
static inline RTS_UI16 ModbusGet16(const RTS_UI8 *data)
{
    return (RTS_UI16)(data[0] << 8 | data[1]);
}

void ModbusPut16(RTS_UI8 *data, RTS_UI32 value);

#endif
