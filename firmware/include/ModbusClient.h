/*
 * ModbusClient.h - this device as a Modbus client (master): asks the devices of one line for their data.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A line is a serial line or a TCP connection, which may lead to a gateway with several devices. One request at a time
 * is on its way; of those that are due the one that has been due longest comes next, so that all get their turn on a
 * line that is too slow: calls of once among them. All from main. Data are exchanged with the lock of the process image
 * (SysLock.h): those of one job are of one moment.
 */
#ifndef MODBUSCLIENT_H
#define MODBUSCLIENT_H

#include "ModbusLink.h"
#include "ModbusPdu.h"

/* A job and its data. Registers are in the order of MODBUS_JOB_REVERSE_2 .., of whose groups there are whole ones; bits
 * from the lowest of the first byte on. */
typedef struct {
    const MODBUS_JOB *job;
    RTS_UI8 *in;      /* what was read last */
    RTS_UI8 *out;     /* what is to be written */
    RTS_UI8 *written; /* what the device has of it; as much room as `out`, which the driver uses before `has_out` */
    bool has_out;     /* `out` was filled, nothing is written before */
    bool is_written;  /* `written` is valid */
    bool good;        /* its last try was */
    RTS_I64 due_ns;   /* when it is to be done next */
    RTS_I64 done_ns;  /* when it was tried last */
} MODBUS_JOB_STATE;

typedef struct {
    RTS_UI32 requests;
    RTS_UI32 timeouts;   /* no reply, or none that was one */
    RTS_UI32 exceptions; /* the device refused */
    RTS_UI32 others;     /* frames that were not a reply to the request */
    RTS_UI32 unverified; /* read back as something else */
    RTS_UI8 last_exception;
} MODBUS_DEVICE_COUNTERS;

typedef struct {
    RTS_UI8 unit; /* 0: all devices of the line, writes only */
    RTS_UI32 timeout_ms;
    RTS_UI32 job_count;
    MODBUS_JOB_STATE *jobs;
    bool asked;       /* it was tried at all */
    RTS_UI8 failures; /* tries in a row that it was silent for; from MODBUS_TRIES on it is lost */
    RTS_I64 retry_ns; /* when a lost device is asked again */
    RTS_I64 good_ns;  /* when it replied last; 0: never */
    MODBUS_DEVICE_COUNTERS counters;
} MODBUS_DEVICE;

enum { MODBUS_TRIES = 2 };

/* A request of once, besides the jobs, by which a device says what it is: function 17 or 43. All from main. */
enum { MODBUS_CALL_FREE, MODBUS_CALL_WAITS, MODBUS_CALL_ENDED };

typedef struct {
    RTS_UI32 state;        /* MODBUS_CALL_* */
    MODBUS_DEVICE *device; /* need not be one of the client's */
    const MODBUS_FUNCTION *function;
    RTS_I64 due_ns;                   /* since when it waits */
    RTS_RESULT result;                /* ERR_OK; ERR_TIMEOUT: no reply; ERR_FAILED: an exception */
    RTS_UI8 size;                     /* bytes of a reply */
    RTS_UI8 data[MODBUS_MAX_PDU - 1]; /* what follows the function in the request, then in the reply */
} MODBUS_CALL;

typedef struct {
    MODBUS_LINK link;
    RTS_UI32 device_count;
    MODBUS_DEVICE *devices;
    /* what is on its way */
    MODBUS_DEVICE *device; /* NULL: nothing */
    MODBUS_JOB_STATE *job; /* NULL: a call is */
    MODBUS_CALL *call;     /* that waits or is on its way; NULL: none */
    MODBUS_REQUEST request;
    bool sent;  /* else it waits for the link */
    bool waits; /* the last byte has left */
    bool verifies;
    RTS_I64 since_ns; /* from when it waits for the link, or for the reply: the time-out runs */
    RTS_UI16 transaction;
    RTS_UI8 head[MODBUS_HEAD_SIZE];
} MODBUS_CLIENT;

/* Devices and jobs are zero but for what the configuration says. */
void ModbusClientBegin(MODBUS_CLIENT *client, MODBUS_DEVICE *devices, RTS_UI32 count);
/* Asks in turn with the jobs. `call` has device, function and data, and stays until it has ended; one at a time. */
void ModbusClientCall(MODBUS_CLIENT *client, MODBUS_CALL *call, RTS_I64 now_ns);

void ModbusClientPoll(MODBUS_CLIENT *client, RTS_I64 now_ns);

/* Whether the device replies. */
bool ModbusDeviceIsLost(const MODBUS_DEVICE *device);
/* Whether it replies, and all its jobs were good. */
bool ModbusDeviceIsGood(const MODBUS_DEVICE *device);

#endif
