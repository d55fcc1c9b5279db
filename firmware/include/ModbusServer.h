/*
 * ModbusServer.h - this device as a Modbus server (slave): memory that others read and write.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * All from main. What a request reads or writes is of one moment, also of several registers: the memory is used with the
 * lock of the process image (SysLock.h), for no longer than copying MODBUS_MAX_PDU bytes takes. So do tasks that use it.
 */
#ifndef MODBUSSERVER_H
#define MODBUSSERVER_H

#include "ModbusLink.h"

/* A range and its memory: (bits + 7) / 8 bytes; bits of a range without registers from the lowest bit of its first byte
 * on. */
typedef struct {
    const MODBUS_RANGE *range;
    RTS_UI8 *data;
} MODBUS_MEMORY;

/* Objects of the device identification: vendor, product code, version, URL, product name, model, application. */
enum { MODBUS_OBJECTS = 7, MODBUS_BASIC_OBJECTS = 3, MODBUS_PRODUCT_NAME = 4 };

typedef struct {
    RTS_UI8 unit;        /* 1..247; TCP: 0: replies to every unit, else to its own, 0 and 255 */
    RTS_UI8 range_count; /* ranges of one table do not overlap */
    bool tcp;
    bool tunnel;       /* tools reach this device through it (ModbusTunnel.h); MODBUS_TUNNEL 1 */
    bool running;      /* the application, for MODBUS_REPORT_SERVER_ID */
    bool has_gaps;     /* registers and bits that are in no range can be read: as `gap` */
    RTS_UI8 gap[2];    /* its low byte first; bits have its lowest one */
    RTS_UI32 requests; /* that were for this unit */
    RTS_UI32 errors;   /* replied to with an exception */
    RTS_UI32 written;  /* requests that wrote, after the first one never 0; counted with the lock of the memory */
    const MODBUS_MEMORY *memory;
    const char *object[MODBUS_OBJECTS]; /* "" or NULL: none; longer ones are cut at 100 characters */
} MODBUS_SERVER;

/* Replaces the request in `pdu` (MODBUS_MAX_PDU bytes) by its reply; returns the size of that. */
RTS_UI32 ModbusServerReply(MODBUS_SERVER *server, RTS_UI8 *pdu, RTS_UI32 size);

/* Receives, replies and sends, one request at most; true when there was one. */
bool ModbusServerPoll(MODBUS_SERVER *server, MODBUS_LINK *link, RTS_I64 now_ns);

#endif
