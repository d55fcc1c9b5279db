/*
 * modbus_remotes.c - a Modbus client, and the devices at the other end of its serial line.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "modbus_remotes.h"

#include "test.h"

static const MODBUS_RANGE range = {MODBUS_HOLDING_REGISTERS | MODBUS_COILS | MODBUS_INPUT_REGISTERS |
                                       MODBUS_DISCRETE_INPUTS,
                                   MODBUS_RANGE_WRITABLE,
                                   0,
                                   0,
                                   1,
                                   REGISTERS * 16};

REMOTE remotes[DEVICES];
MODBUS_CLIENT client;
MODBUS_DEVICE devices[DEVICES];
MODBUS_JOB jobs[DEVICES][JOBS];
MODBUS_JOB_STATE states[DEVICES][JOBS];
RTS_UI8 in[DEVICES][JOBS][2 * REGISTERS];
RTS_UI8 out[DEVICES][JOBS][2 * REGISTERS];
static RTS_UI8 written[DEVICES][JOBS][2 * REGISTERS];

/* what the devices have received, and what one of them is about to reply */
static RTS_UI8 request[300];
static RTS_UI32 request_size;
static RTS_I64 request_ns; /* of its last byte */
static RTS_UI8 reply[300];
RTS_UI32 reply_size;
static RTS_I64 reply_ns;
static RTS_I64 deaf_ns; /* until then none hears */

/* replies that wait until that one was sent */
enum { QUEUE = 8 };
static struct {
    RTS_UI8 data[300];
    RTS_UI32 size;
    RTS_I64 due_ns;
} queue[QUEUE];
static RTS_UI32 queued;

void begin(RTS_UI32 count)
{
    const SYSCOM_SETTINGS settings = {19200, SYSCOM_PARITY_EVEN, 1, false};

    fakes_begin();
    memset(remotes, 0, sizeof(remotes));
    memset(&client, 0, sizeof(client));
    memset(devices, 0, sizeof(devices));
    memset(jobs, 0, sizeof(jobs));
    memset(states, 0, sizeof(states));
    memset(in, 0, sizeof(in));
    memset(out, 0, sizeof(out));
    request_size = reply_size = queued = 0;
    deaf_ns = 0;
    for (RTS_UI32 i = 0; i < DEVICES; i++) {
        remotes[i].exception = MODBUS_DEVICE_FAILURE;
        remotes[i].server.unit = (RTS_UI8)(i + 1);
        remotes[i].server.memory = &remotes[i].memory;
        remotes[i].server.range_count = 1;
        remotes[i].memory = (MODBUS_MEMORY){&range, remotes[i].data};
        remotes[i].delay_ms = 2;
        devices[i].unit = (RTS_UI8)(i + 1);
        devices[i].timeout_ms = TIMEOUT_MS;
        devices[i].retries = MODBUS_RETRIES;
        devices[i].ask_again_ms = MODBUS_RETRY_MS;
        devices[i].jobs = states[i];
    }
    ModbusRtuBegin(&client.link, 0, &settings);
    ModbusClientBegin(&client, devices, count);
}

void add(RTS_UI32 device, MODBUS_JOB job)
{
    RTS_UI32 i = devices[device].job_count++;

    jobs[device][i] = job;
    states[device][i].job = &jobs[device][i];
    states[device][i].in = in[device][i];
    states[device][i].out = out[device][i];
    states[device][i].written = written[device][i];
}

MODBUS_JOB read_job(RTS_UI32 interval_ms)
{
    return (MODBUS_JOB){MODBUS_READ_HOLDING_REGISTERS, 0, 0, 2, 0, 0, 0, interval_ms};
}

MODBUS_JOB write_job(RTS_UI8 flags, RTS_UI32 interval_ms)
{
    return (MODBUS_JOB){MODBUS_WRITE_REGISTERS, flags, 0, 0, 4, 2, 0, interval_ms};
}

/* ---- the other end of the line ---- */

static void send_reply(void)
{
    line_send(reply, reply_size);
    reply_size = 0;
    if (queued == 0)
        return;
    memcpy(reply, queue[0].data, queue[0].size);
    reply_size = queue[0].size;
    reply_ns = queue[0].due_ns;
    memmove(queue, queue + 1, --queued * sizeof(queue[0]));
}

/* What is in `reply` comes after the replies before; `size` bytes of `first` are the one that is due before all. */
static void queue_reply(const RTS_UI8 *first, RTS_UI32 size, RTS_I64 due_ns)
{
    CHECK(queued < QUEUE);
    memcpy(queue[queued].data, reply, reply_size);
    queue[queued].size = reply_size;
    queue[queued++].due_ns = reply_ns;
    memcpy(reply, first, size);
    reply_size = size;
    reply_ns = due_ns;
}

/* The reply with its fault. */
static void spoil(FAULT fault)
{
    RTS_UI16 crc;

    if (fault == WRONG_UNIT)
        reply[0] ^= 0x40;
    else if (fault == WRONG_FUNCTION)
        reply[1] ^= 1;
    else if (fault == TOO_SHORT)
        reply_size -= 1;
    else if (fault == TOO_LONG)
        reply[reply_size++] = 0;
    crc = ModbusCrc(reply, reply_size);
    reply[reply_size++] = (RTS_UI8)crc;
    reply[reply_size++] = (RTS_UI8)(crc >> 8);
    if (fault == HALF)
        reply_size /= 2;
    else if (fault == BAD_CRC)
        reply[reply_size - 1] ^= 0x10;
}

static void serve(REMOTE *remote)
{
    RTS_UI8 first[300];
    RTS_UI32 first_size = reply_size;
    RTS_I64 first_ns = reply_ns;

    if (fakes.now_ns < deaf_ns)
        return;
    remote->asked++;
    remote->asked_ns = fakes.now_ns;
    remote->function = request[1];
    if (remote->fault == SILENT || (reply_size != 0 && remote->loses))
        return;
    memcpy(first, reply, sizeof(first));
    memcpy(reply, request, request_size);
    reply_size = 1 + ModbusServerReply(&remote->server, reply + 1, request_size - 3);
    if (remote->fault == EXCEPTION || remote->fault == BUSY) {
        reply[1] = request[1] | MODBUS_EXCEPTION;
        reply[2] = remote->fault == BUSY ? MODBUS_DEVICE_BUSY : remote->exception;
        reply_size = 3;
    }
    spoil(remote->fault);
    deaf_ns = remote->deaf_ms == 0 ? 0 : fakes.now_ns + (RTS_I64)(remote->delay_ms + remote->deaf_ms) * MS;
    reply_ns = fakes.now_ns + (RTS_I64)(remote->fault == LATE ? TIMEOUT_MS + 50 : remote->delay_ms) * MS;
    if (first_size != 0 && request[0] != MODBUS_BROADCAST)
        queue_reply(first, first_size, first_ns);
}

static void run_remotes(void)
{
    RTS_UI32 size = line_take(request + request_size, sizeof(request) - request_size);

    request_size += size;
    if (size != 0)
        request_ns = fakes.now_ns;
    if (request_size != 0 && fakes.now_ns - request_ns > 2 * fakes.char_ns) {
        CHECK_EQUAL(ModbusCrc(request, request_size), 0);
        for (RTS_UI32 i = 0; i < DEVICES; i++) {
            if (request[0] == i + 1 || request[0] == MODBUS_BROADCAST)
                serve(&remotes[i]);
        }
        if (request[0] == MODBUS_BROADCAST)
            reply_size = 0;
        request_size = 0;
    }
    if (reply_size != 0 && fakes.now_ns >= reply_ns)
        send_reply();
}

void run_ms(RTS_UI32 ms)
{
    RTS_I64 end = fakes.now_ns + (RTS_I64)ms * MS;

    for (; fakes.now_ns < end; fakes.now_ns += STEP_NS) {
        ModbusClientPoll(&client, fakes.now_ns);
        run_remotes();
    }
}
