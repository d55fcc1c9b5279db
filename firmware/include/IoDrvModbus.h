/*
 * IoDrvModbus.h - driver of Modbus devices, and of this device as a Modbus server: its parameters (shared with the host).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Driver "IoDrvModbus". A line is a connector CT_MASTER with MODBUS_PARAM_ROLE: a client, whose devices are its children
 * (CT_SLAVE), or a server. Jobs of a device, and ranges of a server, are numbered from 0 without gaps. A channel is in the
 * data of a job, or the memory of a range; its parameter is that of the job or range, for inputs and outputs.
 */
#ifndef IODRVMODBUS_H
#define IODRVMODBUS_H

#include "Modbus.h"

enum {
    MODBUS_ROLE_SERIAL_CLIENT = 1,
    MODBUS_ROLE_TCP_CLIENT = 2,
    MODBUS_ROLE_SERIAL_SERVER = 3,
    MODBUS_ROLE_TCP_SERVER = 4,
    MODBUS_ROLE_RTU_TCP_CLIENT = 5, /* frames of a serial line on a TCP connection */
    /* The same two with MODBUS_PARAM_HOST in place of an address. A firmware that does not know them refuses the line. */
    MODBUS_ROLE_NAMED_TCP_CLIENT = 6,
    MODBUS_ROLE_NAMED_RTU_TCP_CLIENT = 7,
};

enum { MODBUS_MAX_HOST = 253 };

enum {
    MODBUS_PARAM_ROLE = 1,
    MODBUS_PARAM_LINE = 2,      /* serial: its name, a text */
    MODBUS_PARAM_BAUD = 3,      /* 19200 if missing */
    MODBUS_PARAM_PARITY = 4,    /* SYSCOM_PARITY_*: 0 none, 1 even, 2 odd; even if missing */
    MODBUS_PARAM_STOP_BITS = 5, /* 1 if missing */
    MODBUS_PARAM_RS485 = 6,     /* 1: the port drives the bus while it sends */
    MODBUS_PARAM_ADDRESS =
        7,                 /* TCP: IPv4, 127.0.0.1 is 0x7F000001; of a client its server, of a server its own, 0: all */
    MODBUS_PARAM_PORT = 8, /* TCP: MODBUS_PORT if missing */
    MODBUS_PARAM_UNIT = 9, /* of a device, or a server; 1 if missing, of a TCP server 0: every unit */
    MODBUS_PARAM_TIMEOUT = 10, /* of a device [ms], from the last byte of the request; 1000 if missing */
    MODBUS_PARAM_PAUSE = 11,   /* of a device [ms]: of its line after each request to it; 0 if missing */
    MODBUS_PARAM_RETRIES = 12, /* of a device, before it is lost; 1 if missing */
    MODBUS_PARAM_ASK_AGAIN =
        13,                 /* of a device [ms]: how often it is asked while it is lost; MODBUS_RETRY_MS if missing */
    MODBUS_PARAM_GAPS = 14, /* of a server: the value of registers that are in no range; if missing they are refused */
    MODBUS_PARAM_HOST = 15, /* of a client on TCP: the name of its server, or its IPv6 address, a text */
    MODBUS_PARAM_OBJECT = 0x100, /* + n: object n of the identification of a server, a text */
    MODBUS_PARAM_JOB = 0x1000,   /* + n: a MODBUS_JOB */
    MODBUS_PARAM_RANGE = 0x2000, /* + n: a MODBUS_RANGE */
    /* To be read only, u32 each. Of a device: */
    MODBUS_PARAM_REQUESTS = 0x8000, /* also of a server: that were for it */
    MODBUS_PARAM_TIMEOUTS = 0x8001,
    MODBUS_PARAM_EXCEPTIONS = 0x8002, /* also of a server: its replies that were one */
    MODBUS_PARAM_OTHERS = 0x8003,     /* frames that were not the reply */
    MODBUS_PARAM_UNVERIFIED = 0x8004, /* written, and read back as something else */
    MODBUS_PARAM_LAST_EXCEPTION = 0x8005,
    MODBUS_PARAM_WRITTEN = 0x8006,    /* of a server: requests that wrote */
    MODBUS_PARAM_BAD_FRAMES = 0x8007, /* of a line: of a wrong CRC or length */
    MODBUS_PARAM_ACCEPTED = 0x8008,   /* of all TCP servers: connections, */
    MODBUS_PARAM_DISPLACED = 0x8009,  /* and those closed for a newer one */
    MODBUS_PARAM_BUSY = 0x800A,       /* of a device: exceptions 5 and 6, after which it was asked again */
};

#ifndef RTS_CFFI
#include "CmpItf.h"
RTS_RESULT IoDrvModbus_Hook(CMP_HOOK hook);
#endif

#endif
