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
    RTS_UI8 *out;     /* what is to be written; bits that are not are 0 */
    RTS_UI8 *written; /* what the device has of it; as much room as `out`, which the driver uses before `has_out` */
    bool has_out;     /* `out` was filled, nothing is written before */
    bool is_written;  /* `written` is valid */
    bool good;        /* its last try was */
    RTS_UI8 put_off;  /* times in a row that the device was busy (MODBUS_ACKNOWLEDGE, MODBUS_DEVICE_BUSY) */
    RTS_I64 due_ns;   /* when it is to be done next */
    RTS_I64 done_ns;  /* when it was tried last */
} MODBUS_JOB_STATE;

/* In the order of MODBUS_PARAM_REQUESTS .. MODBUS_PARAM_LAST_EXCEPTION. */
typedef struct {
    RTS_UI32 requests;
    RTS_UI32 timeouts;   /* no reply, or none that was one */
    RTS_UI32 exceptions; /* the device refused */
    RTS_UI32 others;     /* frames that were not a reply to the request */
    RTS_UI32 unverified; /* read back as something else */
    RTS_UI32 last_exception;
} MODBUS_DEVICE_COUNTERS;

/* Why a request has got no reply. */
typedef enum {
    MODBUS_MISS_SILENT,
    MODBUS_MISS_LATE,        /* the reply came after the time-out */
    MODBUS_MISS_UNIT,        /* another unit replied */
    MODBUS_MISS_OTHER,       /* a reply of another function, length, address or transaction */
    MODBUS_MISS_CUT,         /* only the first part of a frame came */
    MODBUS_MISS_DAMAGED,     /* what came is not a frame */
    MODBUS_MISS_CLOSED,      /* TCP: the device closed or reset the connection */
    MODBUS_MISS_NO_ENTRANCE, /* TCP: no connection; a serial line: it was never quiet, or takes no bytes */
    MODBUS_MISS_GATEWAY,     /* a gateway says that the device does not reply */
} MODBUS_MISS;

typedef struct {
    RTS_UI8 unit;        /* 0: all devices of the line, writes only */
    RTS_UI8 retries;     /* after a request without reply, before the device is lost */
    RTS_UI8 miss;        /* MODBUS_MISS_* of the last request without reply */
    RTS_UI8 missed_unit; /* that has replied, of MODBUS_MISS_UNIT */
    RTS_UI16 pause_ms;   /* of the line after each request to it */
    RTS_UI32 timeout_ms;
    RTS_UI32 ask_again_ms; /* a lost device, while others on the line reply */
    RTS_UI32 job_count;
    MODBUS_JOB_STATE *jobs;
    bool asked;       /* it was tried at all */
    bool forgot;      /* it may have lost its outputs: they are written again after its next good reply */
    RTS_UI8 failures; /* tries in a row that it was silent for; with more than `retries` it is lost */
    RTS_I64 retry_ns; /* when a lost device is asked again */
    RTS_I64 good_ns;  /* when it replied last; 0: never */
    RTS_UI32 busy;    /* replies MODBUS_ACKNOWLEDGE or MODBUS_DEVICE_BUSY, after which it was asked again */
    MODBUS_DEVICE_COUNTERS counters;
} MODBUS_DEVICE;

/* A device that is busy is asked again after MODBUS_BUSY_MS, so often; then that is a refusal. */
enum { MODBUS_BUSY_TRIES = 5, MODBUS_BUSY_MS = 100 };

/* A request of once, besides the jobs. Main sends one that waits, and ends it; it belongs to who has taken it before and
 * after that. */
enum { MODBUS_CALL_FREE, MODBUS_CALL_TAKEN, MODBUS_CALL_WAITS, MODBUS_CALL_ENDED };

typedef struct {
    RTS_UI32 state; /* MODBUS_CALL_*, by SysAtomic.h */
    RTS_I32 number; /* of a request of a program */
    struct MODBUS_CLIENT *client;
    MODBUS_DEVICE *device;  /* one of the client's, or one that is not described */
    MODBUS_REQUEST request; /* without `data` */
    RTS_I64 due_ns;         /* since when it waits */
    RTS_RESULT result;      /* ERR_OK; ERR_TIMEOUT: no reply, or the device is lost; ERR_FAILED: `exception` */
    RTS_UI8 exception;
    RTS_UI8 size;                     /* bytes of a reply */
    RTS_UI8 data[MODBUS_MAX_PDU - 1]; /* as in a PDU: to be written; then those that were read, or, of functions 17 and
                                         43, all after the function */
} MODBUS_CALL;

typedef struct MODBUS_CLIENT {
    MODBUS_LINK link;
    RTS_UI32 device_count;
    MODBUS_DEVICE *devices;
    RTS_UI32 call_count; /* of all lines */
    MODBUS_CALL *calls;
    /* what is on its way */
    MODBUS_DEVICE *device; /* NULL: nothing */
    MODBUS_JOB_STATE *job; /* NULL: a call is */
    MODBUS_CALL *call;
    MODBUS_REQUEST request;
    bool sent;  /* else it waits for the link */
    bool waits; /* the last byte has left */
    bool verifies;
    bool resent;          /* it was sent on a connection that the device had closed before it came */
    RTS_UI16 breaks;      /* of the link, that are known */
    RTS_I64 since_ns;     /* from when it waits for the link, or for the reply: the time-out runs */
    RTS_I64 late_ns;      /* until then the reply to a request that was given up may come, and nothing is sent */
    RTS_I64 free_ns;      /* until then the pause after a request lasts, and nothing is sent */
    MODBUS_DEVICE *asked; /* last; NULL: none */
    RTS_UI8 miss;         /* MODBUS_MISS_* of this request, so far */
    RTS_UI8 missed_unit;
    RTS_UI32 bad_frames; /* of the link, when it was sent */
    RTS_UI16 transaction;
    RTS_UI8 head[MODBUS_HEAD_SIZE];
} MODBUS_CLIENT;

/* Devices and jobs are zero but for what the configuration says. */
void ModbusClientBegin(MODBUS_CLIENT *client, MODBUS_DEVICE *devices, RTS_UI32 count);
/* Where the calls of all clients are, the first one for scans. None unless it is called. */
void ModbusClientSetCalls(MODBUS_CLIENT *client, MODBUS_CALL *calls, RTS_UI32 count);
/* Whether a call is on its way, so that it stays as it is. */
static inline bool ModbusClientIsAsking(const MODBUS_CALL *call)
{
    const MODBUS_CLIENT *client = call->client;

    return client != NULL && client->device != NULL && client->job == NULL && client->call == call;
}

void ModbusClientPoll(MODBUS_CLIENT *client, RTS_I64 now_ns);

/* Has what its devices were not yet written come first, before the client is given up. False when there is no more of it:
 * devices that are lost, and jobs that were refused, do not count. */
bool ModbusClientHurryWrites(MODBUS_CLIENT *client);

/* When the client has to be polled next if nothing arrives before, INT64_MAX: not at all. One that waits for its link:
 * now. For ports that need not poll all the time. */
RTS_I64 ModbusClientGetDueNs(const MODBUS_CLIENT *client, RTS_I64 now_ns);

/* What a job asks for. */
MODBUS_REQUEST ModbusJobGetRequest(const MODBUS_JOB *job);

/* Bytes of a group that a job has in reverse order; 0: none are. */
static inline RTS_UI32 ModbusJobGetReverse(const MODBUS_JOB *job, const MODBUS_FUNCTION *function)
{
    return function->count_of_bits == 1 ? 0 : job->flags >> MODBUS_JOB_REVERSE_SHIFT & 14;
}

/* Whether the device replies. */
bool ModbusDeviceIsLost(const MODBUS_DEVICE *device);
/* Whether it is one device; not all of a line, which do not reply (MODBUS_BROADCAST). */
bool ModbusDeviceIsOne(const MODBUS_CLIENT *client, const MODBUS_DEVICE *device);
/* Whether it replies, and all its jobs were good; of all devices at once, whether it was sent what there was. */
bool ModbusDeviceIsGood(const MODBUS_DEVICE *device);

#endif
