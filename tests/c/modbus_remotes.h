/*
 * modbus_remotes.h - a Modbus client, and the devices at the other end of its serial line, for the tests of both.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The devices are servers of this runtime, with faults that the tests give them.
 */
#ifndef MODBUS_REMOTES_H
#define MODBUS_REMOTES_H

#include "ModbusClient.h"
#include "ModbusPdu.h"
#include "ModbusRtu.h"
#include "ModbusServer.h"
#include "modbus_fakes.h"

enum { STEP_NS = 250000, MS = 1000000, DEVICES = 3, JOBS = 3, REGISTERS = 8, TIMEOUT_MS = 100 };

typedef enum {
    WELL,
    SILENT,
    LATE,
    WRONG_UNIT,
    TOO_SHORT,
    TOO_LONG,
    HALF,
    BAD_CRC,
    WRONG_FUNCTION,
    EXCEPTION,
    BUSY
} FAULT;

typedef struct {
    MODBUS_SERVER server;
    MODBUS_MEMORY memory;
    RTS_UI8 data[2 * REGISTERS];
    FAULT fault;
    RTS_UI8 exception; /* of the fault EXCEPTION: MODBUS_DEVICE_FAILURE */
    RTS_UI32 delay_ms; /* before it replies; 2 */
    RTS_UI32 deaf_ms;  /* after it has replied: it loses what comes */
    bool loses;        /* requests that come before it has replied; else it replies to all, one after the other */
    RTS_UI32 asked;
    RTS_I64 asked_ns;
    RTS_UI8 function; /* of the last request */
} REMOTE;

extern REMOTE remotes[DEVICES];
extern MODBUS_CLIENT client;
extern MODBUS_DEVICE devices[DEVICES];
extern MODBUS_JOB jobs[DEVICES][JOBS];
extern MODBUS_JOB_STATE states[DEVICES][JOBS];
extern RTS_UI8 in[DEVICES][JOBS][2 * REGISTERS];
extern RTS_UI8 out[DEVICES][JOBS][2 * REGISTERS];

extern RTS_UI32 reply_size; /* of what a device is about to send; 0: nothing */

/* A client of the first `count` devices, without jobs. */
void begin(RTS_UI32 count);
void add(RTS_UI32 device, MODBUS_JOB job);

/* Of two registers, from 0 and from 4 on. */
MODBUS_JOB read_job(RTS_UI32 interval_ms);
MODBUS_JOB write_job(RTS_UI8 flags, RTS_UI32 interval_ms);

/* Lets time pass for the client and its devices. */
void run_ms(RTS_UI32 ms);

#endif
