/*
 * ModbusClient.c - this device as a Modbus client: asks the devices of one line for their data.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusClient.h"

#include <string.h>

#include "SysAtomic.h"
#include "SysLock.h"
#include "rts_config.h"

#define NS_PER_MS ((RTS_I64)1000000)
#define NEVER INT64_MAX

enum { REFUSED_MS = 1000 /* what a device refuses is not tried more often */ };

bool ModbusDeviceIsLost(const MODBUS_DEVICE *device)
{
    return device->failures > device->retries;
}

RTS_NOINLINE bool ModbusDeviceIsGood(const MODBUS_DEVICE *device)
{
    bool good = device->good_ns != 0 && !ModbusDeviceIsLost(device);

    for (RTS_UI32 i = 0; good && i < device->job_count; i++)
        good = device->jobs[i].good || device->jobs[i].done_ns == 0;
    return good;
}

void ModbusClientBegin(MODBUS_CLIENT *client, MODBUS_DEVICE *devices, RTS_UI32 count)
{
    client->devices = devices;
    client->device_count = count;
    client->device = NULL;
    client->call_count = 0;
    client->late_ns = 0;
    client->free_ns = 0;
    client->asked = NULL;
    client->transaction = 0;
    client->breaks = client->link.breaks;
}

void ModbusClientSetCalls(MODBUS_CLIENT *client, MODBUS_CALL *calls, RTS_UI32 count)
{
    client->calls = calls;
    client->call_count = count;
}

/* ---- which job is next ---- */

static RTS_UI32 write_size(const MODBUS_JOB_STATE *state)
{
    return ModbusDataSize(ModbusFindFunction(state->job->function), state->job->write_count);
}

/* A task may be writing it: then it is another value now or in the next pass. */
static bool has_changed(const MODBUS_JOB_STATE *state)
{
    return !state->is_written || memcmp(state->out, state->written, write_size(state)) != 0;
}

/* When the job is due. One that has changed comes after those that are due since before it was done last. */
static RTS_I64 due_ns(const MODBUS_JOB_STATE *state)
{
    const MODBUS_JOB *job = state->job;

    if (job->write_count != 0 && !state->has_out)
        return NEVER;
    if (state->put_off != 0)
        return state->due_ns;
    if ((job->flags & MODBUS_JOB_ON_CHANGE) == 0 || (!state->good && state->done_ns != 0))
        return state->due_ns;
    if (has_changed(state))
        return state->done_ns;
    return job->interval_ms != 0 ? state->due_ns : NEVER;
}

static MODBUS_JOB_STATE *find_due(const MODBUS_DEVICE *device, RTS_I64 *earliest_ns)
{
    MODBUS_JOB_STATE *found = NULL;

    for (RTS_UI32 i = 0; i < device->job_count; i++) {
        RTS_I64 due = due_ns(&device->jobs[i]);
        if (due <= *earliest_ns) {
            *earliest_ns = due;
            found = &device->jobs[i];
        }
    }
    return found;
}

static void end_call(MODBUS_CALL *call, RTS_RESULT result)
{
    call->result = result;
    SysAtomicStore(&call->state, MODBUS_CALL_ENDED);
}

/* A lost device costs its line no more for those who call it: they need not wait. */
static bool is_wanted(MODBUS_CALL *call, RTS_I64 now_ns)
{
    if (!ModbusDeviceIsLost(call->device) || now_ns >= call->device->retry_ns)
        return true;
    end_call(call, ERR_TIMEOUT);
    return false;
}

/* Of the calls one that has been due longer than the job that was found. */
static void choose_call(MODBUS_CLIENT *client, RTS_I64 earliest_ns, RTS_I64 now_ns)
{
    for (MODBUS_CALL *call = client->calls; call < client->calls + client->call_count; call++) {
        if (SysAtomicLoad(&call->state) != MODBUS_CALL_WAITS || call->client != client || call->due_ns > earliest_ns ||
            !is_wanted(call, now_ns))
            continue;
        earliest_ns = call->due_ns;
        client->device = call->device;
        client->call = call;
        client->job = NULL;
    }
}

/* The job that is due, and longest. */
static void choose(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    RTS_I64 earliest_ns = now_ns;

    for (RTS_UI32 i = 0; i < client->device_count; i++) {
        MODBUS_DEVICE *device = &client->devices[i];
        MODBUS_JOB_STATE *job;
        if (ModbusDeviceIsLost(device) && now_ns < device->retry_ns)
            continue;
        job = find_due(device, &earliest_ns);
        if (job != NULL) {
            client->device = device;
            client->job = job;
        }
    }
    choose_call(client, earliest_ns, now_ns);
}

/* ---- the last writes ---- */

static bool is_unwritten(const MODBUS_DEVICE *device, const MODBUS_JOB_STATE *state)
{
    bool refused = device->failures == 0 && !state->good && state->done_ns != 0;

    return state->job->write_count != 0 && state->has_out && has_changed(state) && !refused;
}

static bool hurry_device(const MODBUS_DEVICE *device)
{
    bool found = false;

    for (RTS_UI32 i = 0; i < device->job_count; i++) {
        MODBUS_JOB_STATE *state = &device->jobs[i];
        if (!is_unwritten(device, state))
            continue;
        state->due_ns = 0;
        state->done_ns = 0;
        found = true;
    }
    return found;
}

bool ModbusClientHurryWrites(MODBUS_CLIENT *client)
{
    bool found = client->device != NULL && client->job != NULL && client->job->job->write_count != 0;

    for (RTS_UI32 i = 0; i < client->device_count; i++) {
        if (!ModbusDeviceIsLost(&client->devices[i]) && hurry_device(&client->devices[i]))
            found = true;
    }
    return found;
}

/* ---- requests ---- */

/* From the order of the wire to that of memory, or back. */
static void reorder(const MODBUS_JOB_STATE *state, const MODBUS_FUNCTION *function, RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 reverse = ModbusJobGetReverse(state->job, function);

    for (RTS_UI32 i = 0; reverse != 0 && i < size; i++) {
        RTS_UI32 other = i ^ (reverse - 1);
        RTS_UI8 byte = data[i];
        if (other > i) {
            data[i] = data[other];
            data[other] = byte;
        }
    }
}

static void put_mask(const MODBUS_JOB_STATE *state, RTS_UI8 *data)
{
    RTS_UI16 mask = state->job->mask;

    ModbusPut16(data + 2, ModbusGet16(data) & mask);
    ModbusPut16(data, (RTS_UI16)~mask);
}

/* What is to be written, as it is now. */
static void put_data(MODBUS_CLIENT *client)
{
    MODBUS_JOB_STATE *state = client->job;
    const MODBUS_FUNCTION *function = client->request.function;
    RTS_UI32 size = write_size(state);
    RTS_UI8 *data = client->request.data;
    RTS_UI32 lock = SysLockEnter();

    memcpy(state->written, state->out, size);
    SysLockLeave(lock);
    memcpy(data, state->written, size);
    reorder(state, function, data, size);
    if (function->function == MODBUS_WRITE_COIL)
        ModbusPut16(data, (data[0] & 1) != 0 ? 0xFF00 : 0);
    else if (function->function == MODBUS_MASK_WRITE_REGISTER)
        put_mask(state, data);
}

static RTS_UI8 function_to_verify(const MODBUS_FUNCTION *function)
{
    return function->table == MODBUS_COILS ? MODBUS_READ_COILS : MODBUS_READ_HOLDING_REGISTERS;
}

static void put_call(const MODBUS_CALL *call, const MODBUS_REQUEST *request, RTS_UI32 size, const RTS_UI8 *pdu)
{
    RTS_UI32 head = (RTS_UI32)(request->data - pdu);

    memcpy(request->data, call->data, size - head);
}

MODBUS_REQUEST ModbusJobGetRequest(const MODBUS_JOB *job)
{
    return (MODBUS_REQUEST){ModbusFindFunction(job->function),
                            job->read_address,
                            job->read_count,
                            job->write_address,
                            job->write_count,
                            NULL};
}

static void describe_job(MODBUS_CLIENT *client)
{
    const MODBUS_JOB *job = client->job->job;
    MODBUS_REQUEST *request = &client->request;

    *request = ModbusJobGetRequest(job);
    if (!client->verifies)
        return;
    request->function = ModbusFindFunction(function_to_verify(request->function));
    request->read_address = job->write_address;
    request->read_count = job->write_count;
    request->write_count = 0;
}

/* From when the last byte has left, or should have. */
static RTS_NOINLINE void begin_to_wait(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    client->waits = !client->link.sending;
    client->since_ns = client->link.moved_ns > now_ns ? client->link.moved_ns : now_ns;
}

static void send(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    MODBUS_LINK *link = &client->link;
    RTS_UI8 *pdu = link->frame + MODBUS_AT_PDU;
    RTS_UI32 size;

    if (client->job != NULL)
        describe_job(client);
    else
        client->request = client->call->request;
    size = ModbusBeginRequest(&client->request, pdu);
    if (client->job == NULL)
        put_call(client->call, &client->request, size, pdu);
    else if (client->request.write_count != 0)
        put_data(client);
    memcpy(client->head, pdu, MODBUS_HEAD_SIZE);
    link->frame[MODBUS_AT_UNIT] = client->device->unit;
    ModbusPut16(link->frame + MODBUS_AT_TRANSACTION, ++client->transaction);
    client->device->counters.requests++;
    client->device->asked = true;
    client->asked = client->device;
    client->bad_frames = link->bad_frames;
    client->miss = MODBUS_MISS_SILENT;
    client->sent = true;
    ModbusLinkType(link)->send(link, size, now_ns);
    begin_to_wait(client, now_ns);
}

/* ---- results ---- */

static void next_due(MODBUS_JOB_STATE *state, RTS_I64 interval_ns, RTS_I64 now_ns)
{
    state->done_ns = now_ns;
    state->due_ns += interval_ns;
    if (state->due_ns <= now_ns - interval_ns) /* more than one was missed: they are not made up for */
        state->due_ns = now_ns;
}

RTS_NOINLINE bool ModbusDeviceIsOne(const MODBUS_CLIENT *client, const MODBUS_DEVICE *device)
{
    return device->unit != MODBUS_BROADCAST || !ModbusLinkType(&client->link)->broadcasts;
}

static bool others_reply(const MODBUS_CLIENT *client)
{
    for (RTS_UI32 i = 0; i < client->device_count; i++) {
        const MODBUS_DEVICE *device = &client->devices[i];
        if (device != client->device && device->asked && ModbusDeviceIsOne(client, device) &&
            !ModbusDeviceIsLost(device))
            return true;
    }
    return false;
}

/* Has what a device may have forgotten written again. */
static void write_all_again(const MODBUS_DEVICE *device, const MODBUS_JOB_STATE *but)
{
    for (RTS_UI32 i = 0; i < device->job_count; i++) {
        if (&device->jobs[i] != but)
            device->jobs[i].is_written = false;
    }
}

static RTS_I64 timeout_ns(const MODBUS_DEVICE *device)
{
    return device->timeout_ms * NS_PER_MS;
}

/* The whole line was away: the others need not wait until it is their turn, but for the late reply to the last try. */
static void ask_all(const MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    for (RTS_UI32 i = 0; i < client->device_count; i++) {
        MODBUS_DEVICE *device = &client->devices[i];
        if (device->retry_ns > now_ns + timeout_ns(device))
            device->retry_ns = now_ns + timeout_ns(device);
    }
}

static void note_reply(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    MODBUS_DEVICE *device = client->device;

    if (ModbusDeviceIsLost(device) && !others_reply(client))
        ask_all(client, now_ns);
    device->failures = 0;
    device->good_ns = now_ns;
}

/* After a missed reply, or an exception that is new, the device may have restarted, however short that was. */
static void write_forgotten(MODBUS_CLIENT *client)
{
    if (client->device->forgot)
        write_all_again(client->device, client->job);
    client->device->forgot = false;
}

/* A new connection may lead to a device that has restarted, or to a gateway: each device of the line may have. */
static void note_breaks(MODBUS_CLIENT *client)
{
    if (client->breaks == client->link.breaks)
        return;
    client->breaks = client->link.breaks;
    for (RTS_UI32 i = 0; i < client->device_count; i++)
        write_all_again(&client->devices[i], NULL);
}

static RTS_I64 usual_pause_of(const MODBUS_CLIENT *client)
{
    const MODBUS_DEVICE *device = client->device;
    RTS_UI32 usual_ms = device->ask_again_ms;

    if (usual_ms > MODBUS_RETRY_SOON_MS && device->failures == device->retries + 1)
        usual_ms = MODBUS_RETRY_SOON_MS;
    if (usual_ms > MODBUS_RETRY_ALONE_MS && !others_reply(client))
        usual_ms = MODBUS_RETRY_ALONE_MS;
    return usual_ms * NS_PER_MS;
}

/* Before a lost device is asked again: for so long its late reply may come. */
static RTS_I64 pause_of(const MODBUS_CLIENT *client)
{
    RTS_I64 least_ns = timeout_ns(client->device);
    RTS_I64 usual_ns = usual_pause_of(client);

    return usual_ns > least_ns ? usual_ns : least_ns;
}

static bool has_other_name(const MODBUS_CLIENT *client)
{
    for (RTS_UI32 i = 0; i < client->device_count; i++) {
        if (&client->devices[i] != client->device && client->devices[i].unit == client->device->unit)
            return true;
    }
    return false;
}

/* On a serial line a reply does not say to which request it is. So nothing is asked before that to a request which is
 * given up has come, or has had as much time again. A device that is lost by that is not asked again so soon anyway,
 * unless by another name, and what a search asks (no table) is not what jobs ask. */
static void await_late_reply(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    if (!client->waits || !ModbusLinkType(&client->link)->broadcasts || client->request.function->table == 0 ||
        (client->device->failures >= client->device->retries && !has_other_name(client)))
        return;
    client->late_ns = now_ns + timeout_ns(client->device);
}

/* Many devices need a moment after a reply, before they hear again. */
static void begin_pause(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    client->free_ns = now_ns + client->device->pause_ms * NS_PER_MS;
}

static void fail_job(MODBUS_JOB_STATE *job, bool lost, RTS_I64 now_ns)
{
    job->good = false;
    job->is_written = false;
    job->put_off = 0;
    job->done_ns = now_ns;
    if (!lost)
        job->due_ns = now_ns;
}

/* No reply: a job is tried once more, or the device is lost. */
static void fail(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    MODBUS_DEVICE *device = client->device;

    device->counters.timeouts++;
    device->forgot = true;
    device->miss = client->miss;
    device->missed_unit = client->missed_unit;
    if (device->failures < UINT8_MAX)
        device->failures++;
    if (ModbusDeviceIsLost(device))
        device->retry_ns = now_ns + pause_of(client);
    if (client->job != NULL)
        fail_job(client->job, ModbusDeviceIsLost(device), now_ns);
    else
        end_call(client->call, ERR_TIMEOUT);
    client->verifies = false;
    begin_pause(client, now_ns);
    client->device = NULL;
}

static void end_job(MODBUS_JOB_STATE *job, bool good, RTS_I64 now_ns)
{
    RTS_I64 interval_ns = job->job->interval_ms * NS_PER_MS;

    if (!good && job->job->interval_ms < REFUSED_MS && job->job->write_count != 0)
        job->due_ns = now_ns + REFUSED_MS * NS_PER_MS;
    else
        next_due(job, interval_ns, now_ns);
    job->put_off = 0;
    job->done_ns = now_ns;
    job->good = good;
    job->is_written = good && job->job->write_count != 0;
}

static void end(MODBUS_CLIENT *client, bool good, RTS_I64 now_ns)
{
    if (client->job != NULL)
        end_job(client->job, good, now_ns);
    else
        end_call(client->call, good ? ERR_OK : ERR_FAILED);
    client->verifies = false;
    begin_pause(client, now_ns);
    client->device = NULL;
}

/* Of what was read back all that was not written is 0, as it is in `written`. */
static void clear_others(const MODBUS_JOB *job, RTS_UI32 bits, RTS_UI8 *data)
{
    if (job->function == MODBUS_MASK_WRITE_REGISTER)
        ModbusPut16(data, ModbusGet16(data) & job->mask);
    else if (bits % 8 != 0)
        data[bits / 8] &= (RTS_UI8)((1u << bits % 8) - 1);
}

/* Data of the job, or what the device has of those that were written to it; false: it has others. */
static bool take_data(const MODBUS_CLIENT *client, RTS_UI8 *data)
{
    MODBUS_JOB_STATE *state = client->job;
    const MODBUS_FUNCTION *function = client->request.function;
    RTS_UI32 size = ModbusDataSize(function, client->request.read_count);
    RTS_UI32 lock;

    if (client->verifies)
        clear_others(state->job, client->request.read_count * (RTS_UI32)function->count_of_bits, data);
    reorder(state, function, data, size);
    if (client->verifies)
        return memcmp(data, state->written, size) == 0;
    lock = SysLockEnter();
    memcpy(state->in, data, size);
    SysLockLeave(lock);
    return true;
}

/* What follows the function, and of what was read the number of bytes; of a write nothing. */
static void take_call(const MODBUS_CLIENT *client, const RTS_UI8 *pdu, RTS_UI32 size)
{
    MODBUS_CALL *call = client->call;
    RTS_UI32 head = call->request.function->table == 0 ? 1 : 2;

    call->size =
        call->request.function->most_written != 0 && call->request.read_count == 0 ? 0 : (RTS_UI8)(size - head);
    memcpy(call->data, pdu + head, call->size);
}

static void take_good(MODBUS_CLIENT *client, RTS_UI8 *pdu, RTS_UI32 size, RTS_I64 now_ns)
{
    bool good;

    note_reply(client, now_ns);
    write_forgotten(client);
    if (client->job == NULL) {
        take_call(client, pdu, size);
        end(client, true, now_ns);
        return;
    }
    good = client->request.read_count == 0 || take_data(client, pdu + 2);
    client->device->counters.unverified += !good;
    if (!client->verifies && (client->job->job->flags & MODBUS_JOB_VERIFY) != 0) {
        client->verifies = true;
        client->sent = false;
        begin_pause(client, now_ns);
        client->since_ns = client->free_ns;
        return;
    }
    end(client, good, now_ns);
}

/* A job that is not good is asked for at its own pace. */
static bool may_put_off(const MODBUS_CLIENT *client, RTS_UI8 code)
{
    const MODBUS_JOB_STATE *job = client->job;

    return (code == MODBUS_ACKNOWLEDGE || code == MODBUS_DEVICE_BUSY) && job != NULL &&
           (job->good || job->done_ns == 0) && job->put_off < MODBUS_BUSY_TRIES;
}

/* Its data stay as good as they were, and as old. */
static void put_off(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    RTS_I64 good_ns = client->device->good_ns;

    note_reply(client, now_ns);
    client->device->good_ns = good_ns;
    client->device->busy++;
    client->job->put_off++;
    client->job->due_ns = now_ns + MODBUS_BUSY_MS * NS_PER_MS;
    client->verifies = false;
    begin_pause(client, now_ns);
    client->device = NULL;
}

/* A gateway replies for a device that is silent. */
static void take_exception(MODBUS_CLIENT *client, RTS_UI8 code, RTS_I64 now_ns)
{
    client->device->counters.last_exception = code;
    if (code == MODBUS_NO_PATH || code == MODBUS_NO_TARGET) {
        client->miss = MODBUS_MISS_GATEWAY;
        fail(client, now_ns);
        return;
    }
    if (may_put_off(client, code)) {
        put_off(client, now_ns);
        return;
    }
    client->device->counters.exceptions++;
    note_reply(client, now_ns);
    if (client->job == NULL)
        client->call->exception = code;
    else if (client->job->good && code != MODBUS_ILLEGAL_VALUE)
        client->device->forgot = true; /* it has done this before: it may have restarted */
    end(client, false, now_ns);
}

/* ---- the reply ---- */

/* The transaction is where RTU has none: there it is that of the request. */
static MODBUS_REPLY check(const MODBUS_CLIENT *client, RTS_UI32 size)
{
    const RTS_UI8 *frame = client->link.frame;

    if (frame[MODBUS_AT_UNIT] != client->device->unit ||
        ModbusGet16(frame + MODBUS_AT_TRANSACTION) != client->transaction)
        return MODBUS_REPLY_OTHER;
    return ModbusCheckReply(&client->request, client->head, frame + MODBUS_AT_PDU, size);
}

static void take_other(MODBUS_CLIENT *client)
{
    client->device->counters.others++;
    client->missed_unit = client->link.frame[MODBUS_AT_UNIT];
    client->miss = client->missed_unit != client->device->unit ? MODBUS_MISS_UNIT : MODBUS_MISS_OTHER;
}

static void take_frame(MODBUS_CLIENT *client, RTS_UI32 size, RTS_I64 now_ns)
{
    RTS_UI8 *pdu = client->link.frame + MODBUS_AT_PDU;
    MODBUS_REPLY reply = check(client, size);

    if (reply == MODBUS_REPLY_GOOD)
        take_good(client, pdu, size, now_ns);
    else if (reply == MODBUS_REPLY_EXCEPTION)
        take_exception(client, pdu[1], now_ns);
    else
        take_other(client);
    ModbusLinkDrop(&client->link);
}

static bool is_too_late(const MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    return now_ns - client->since_ns >= timeout_ns(client->device);
}

/* Nothing that is a frame has come: what else has. */
static void note_remains(MODBUS_CLIENT *client)
{
    if (client->miss != MODBUS_MISS_SILENT)
        return;
    if (client->link.bad_frames != client->bad_frames)
        client->miss = MODBUS_MISS_DAMAGED;
    else if (!client->waits)
        client->miss = MODBUS_MISS_NO_ENTRANCE;
    else if (client->link.handle == RTS_INVALID_HANDLE)
        client->miss = MODBUS_MISS_CLOSED;
    else if (client->link.fill != 0)
        client->miss = MODBUS_MISS_CUT;
}

static void end_late(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    if (client->waits && !ModbusDeviceIsOne(client, client->device)) {
        note_reply(client, now_ns); /* all that can be known: it was sent */
        end(client, true, now_ns);
        return;
    }
    note_remains(client);
    if (!ModbusDeviceIsLost(client->device) && !ModbusLinkType(&client->link)->broadcasts)
        client->link.breaks++;
    ModbusLinkType(&client->link)->give_up(&client->link);
    await_late_reply(client, now_ns);
    fail(client, now_ns);
}

/* Many devices close a connection after a reply: what was sent at that moment has not arrived. */
static bool may_resend(const MODBUS_CLIENT *client)
{
    return client->link.replied && !client->resent && (client->job != NULL || client->request.write_count == 0);
}

static void lose_connection(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    if (!may_resend(client)) {
        note_remains(client);
        fail(client, now_ns);
        return;
    }
    client->resent = true;
    client->sent = false;
    client->since_ns = now_ns;
}

static void wait_for_reply(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    MODBUS_LINK *link = &client->link;
    RTS_UI32 size = ModbusLinkType(link)->receive(link, now_ns);

    if (link->handle == RTS_INVALID_HANDLE) {
        lose_connection(client, now_ns);
        return;
    }
    if (!client->waits && !link->sending)
        begin_to_wait(client, now_ns);
    if (size != 0)
        take_frame(client, size, now_ns);
    if (client->device != NULL && client->sent && is_too_late(client, now_ns)) /* it was not the reply */
        end_late(client, now_ns);
}

/* ---- passes ---- */

static void begin(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    choose(client, now_ns);
    client->sent = false;
    client->resent = false;
    client->since_ns = now_ns;
}

static bool may_be_late(const MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    return now_ns < client->late_ns;
}

static bool is_paused(const MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    return may_be_late(client, now_ns) || now_ns < client->free_ns;
}

/* The device is there, and slower than its time-out. */
static void note_late(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    if (client->asked == NULL || client->asked->unit != client->link.unit || client->asked->failures == 0)
        return;
    client->asked->miss = MODBUS_MISS_LATE;
    client->free_ns = now_ns + client->asked->pause_ms * NS_PER_MS;
}

/* Frames that come while nothing was asked belong to nothing: at most one of them is the reply that is late. */
static void drop_frames(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    MODBUS_LINK *link = &client->link;

    if (link->handle == RTS_INVALID_HANDLE || ModbusLinkType(link)->receive(link, now_ns) == 0)
        return;
    if (ModbusLinkIsReply(link)) {
        note_late(client, now_ns);
        client->late_ns = now_ns;
    }
    ModbusLinkDrop(link);
}

static void try_to_send(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    if (ModbusLinkType(&client->link)->ready(&client->link, now_ns))
        send(client, now_ns);
    else if (is_too_late(client, now_ns)) {
        client->miss = client->link.accepted ? MODBUS_MISS_CLOSED : MODBUS_MISS_NO_ENTRANCE;
        fail(client, now_ns);
    }
}

void ModbusClientPoll(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    bool asked = client->device != NULL && client->sent;
    bool expects = asked || may_be_late(client, now_ns);

    client->link.looks_for = expects ? MODBUS_LOOKS_FOR_REPLY : MODBUS_LOOKS_FOR_NOTHING;
    if (asked) {
        wait_for_reply(client, now_ns);
        return;
    }
    drop_frames(client, now_ns);
    note_breaks(client);
    if (is_paused(client, now_ns))
        return;
    if (client->device == NULL)
        begin(client, now_ns);
    if (client->device != NULL)
        try_to_send(client, now_ns);
}

/* ---- when it is needed ---- */

static RTS_I64 due_of_device(const MODBUS_DEVICE *device)
{
    RTS_I64 due = NEVER;

    (void)find_due(device, &due);
    return ModbusDeviceIsLost(device) && due < device->retry_ns ? device->retry_ns : due;
}

RTS_I64 ModbusClientGetDueNs(const MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    RTS_I64 due = NEVER;

    if (client->device != NULL && client->sent)
        return client->since_ns + timeout_ns(client->device);
    if (is_paused(client, now_ns))
        return client->late_ns > client->free_ns ? client->late_ns : client->free_ns;
    if (client->device != NULL)
        return now_ns;
    for (const MODBUS_CALL *call = client->calls; call < client->calls + client->call_count; call++) {
        if (SysAtomicLoad(&call->state) == MODBUS_CALL_WAITS && call->client == client)
            return now_ns;
    }
    for (RTS_UI32 i = 0; i < client->device_count; i++) {
        RTS_I64 of_device = due_of_device(&client->devices[i]);
        if (of_device < due)
            due = of_device;
    }
    return due;
}
