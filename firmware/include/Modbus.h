/*
 * Modbus.h - numbers of the Modbus application protocol V1.1b3 (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#ifndef MODBUS_H
#define MODBUS_H

#include "CmpStd.h"

enum {
    MODBUS_READ_COILS = 1,
    MODBUS_READ_DISCRETE_INPUTS = 2,
    MODBUS_READ_HOLDING_REGISTERS = 3,
    MODBUS_READ_INPUT_REGISTERS = 4,
    MODBUS_WRITE_COIL = 5,
    MODBUS_WRITE_REGISTER = 6,
    MODBUS_DIAGNOSTICS = 8, /* of it only MODBUS_LOOPBACK */
    MODBUS_LOOPBACK = 0,
    MODBUS_WRITE_COILS = 15,
    MODBUS_WRITE_REGISTERS = 16,
    MODBUS_REPORT_SERVER_ID = 17,
    MODBUS_MASK_WRITE_REGISTER = 22,
    MODBUS_READ_WRITE_REGISTERS = 23,
    MODBUS_ENCAPSULATED = 43,
    MODBUS_DEVICE_IDENTIFICATION = 14, /* MEI type of MODBUS_ENCAPSULATED */
    MODBUS_ID_HEAD = 7,                /* bytes of its reply before the first object */
    MODBUS_TUNNEL_MEI = 128,           /* another: bytes of a tool (ModbusTunnel.h) */
    MODBUS_TUNNEL_BEGIN = 0,           /* its first sequence number */
    MODBUS_EXCEPTION = 0x80,           /* set in the function code of a reply: an exception code follows */
};

enum {
    MODBUS_ILLEGAL_FUNCTION = 1,
    MODBUS_ILLEGAL_ADDRESS = 2,
    MODBUS_ILLEGAL_VALUE = 3,
    MODBUS_DEVICE_FAILURE = 4,
    MODBUS_ACKNOWLEDGE = 5,
    MODBUS_DEVICE_BUSY = 6,
    MODBUS_NO_PATH = 10,   /* of a gateway: it does not know the device */
    MODBUS_NO_TARGET = 11, /* of a gateway: the device does not reply */
};

/* Limits of one request. */
enum {
    MODBUS_MAX_READ_BITS = 2000,
    MODBUS_MAX_READ_REGISTERS = 125,
    MODBUS_MAX_WRITE_BITS = 1968,
    MODBUS_MAX_WRITE_REGISTERS = 123,
    MODBUS_MAX_READ_WRITE_REGISTERS = 121, /* written by MODBUS_READ_WRITE_REGISTERS */
    MODBUS_MAX_PDU = 253,
    MODBUS_MAX_UNIT = 247,
    MODBUS_BROADCAST = 0, /* unit: all devices of a serial line; no reply */
    MODBUS_REGISTER_BITS = 16,
    MODBUS_PORT = 502, /* TCP */
};

/* What a client does for a device if the configuration does not say otherwise. */
enum { MODBUS_TIMEOUT_MS = 1000, MODBUS_RETRIES = 1 };

/* The four tables of a server. */
enum {
    MODBUS_COILS = 0x01,
    MODBUS_DISCRETE_INPUTS = 0x02,
    MODBUS_HOLDING_REGISTERS = 0x04,
    MODBUS_INPUT_REGISTERS = 0x08,
};

/*
 * The order of bytes. On the wire a register has its high byte first; the devices of most vendors have the high register
 * of a longer number first, some the low one. Memory has the bytes of the wire, those of each group of `reverse` in
 * reverse order: 1: as on the wire; 2: each register with its low byte first, so that numbers whose low register
 * comes first have all their bytes so; 4 and 8: numbers of two and four registers, whose high register comes first.
 */
enum {
    MODBUS_RANGE_WRITABLE = 0x01, /* from the network */
    MODBUS_RANGE_NUMBER_SHIFT =
        4, /* flags >> 4: the registers of a number (1, 2 or 4) - 1; a part of one is not written */
};

/* Memory of a server: it is in one table, or in several at a time: a coil and a bit of a register are the same memory
 * then, bit n of the range is bit n % 16 of its register n / 16. */
typedef struct {
    RTS_UI8 tables;          /* MODBUS_COILS | ... */
    RTS_UI8 flags;           /* MODBUS_RANGE_* */
    RTS_UI16 first_register; /* as on the wire, from 0 */
    RTS_UI16 first_bit;
    RTS_UI16 reverse; /* 1, 2, 4 or 8; 2 for a range without registers */
    RTS_UI32 bits;    /* size; with registers a multiple of 16 and of 8 * reverse */
} MODBUS_RANGE;

enum {
    MODBUS_JOB_ON_CHANGE = 0x01, /* writes when the value is another one, besides every interval */
    MODBUS_JOB_VERIFY = 0x02,    /* reads back what it wrote */
    MODBUS_JOB_REVERSE_2 = 0x10, /* `reverse` of its registers, in both directions; none: 1 */
    MODBUS_JOB_REVERSE_4 = 0x20,
    MODBUS_JOB_REVERSE_8 = 0x40,
    MODBUS_JOB_REVERSE_SHIFT = 3, /* flags >> 3 & 14: reverse, but 0 for 1 */
};

/* What a client asks a device for, again and again. */
typedef struct {
    RTS_UI8 function;
    RTS_UI8 flags;         /* MODBUS_JOB_* */
    RTS_UI16 read_address; /* as on the wire, from 0 */
    RTS_UI16 read_count;   /* bits or registers; 0: it reads none */
    RTS_UI16 write_address;
    RTS_UI16 write_count; /* 0: it writes none */
    RTS_UI16 mask;        /* of MODBUS_MASK_WRITE_REGISTER: the bits that it writes */
    RTS_UI32 interval_ms; /* 0: on change only */
} MODBUS_JOB;

#ifndef RTS_CFFI
RTS_STATIC_ASSERT(sizeof(MODBUS_RANGE) == 12, modbus_range_is_12_bytes);
RTS_STATIC_ASSERT(sizeof(MODBUS_JOB) == 16, modbus_job_is_16_bytes);
#endif

#endif
