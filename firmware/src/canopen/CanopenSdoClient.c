/*
 * CanopenSdoClient.c - reads and writes objects of one node at a time.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "CanopenSdoClient.h"

#include <string.h>

#include "CmpBytes.h"

enum { EXPEDITED = 4, SEGMENT = 7, FRAME = 8, HAS_SIZE = 1, IS_EXPEDITED = 2, IS_LAST = 1 };

static RTS_UI8 *begin_request(SDO_CLIENT *client, RTS_UI8 command)
{
    CAN_FRAME *request = &client->request;

    memset(request, 0, sizeof(*request));
    request->id = CANOPEN_SDO_REQUEST + (RTS_UI32)client->node;
    request->size = FRAME;
    request->data[0] = command;
    client->has_request = true;
    return request->data;
}

static RTS_UI8 *begin_of_object(SDO_CLIENT *client, RTS_UI8 command)
{
    RTS_UI8 *data = begin_request(client, command);

    BytesPut16(data + 1, client->index);
    data[3] = client->sub;
    return data + 4;
}

static void begin(SDO_CLIENT *client, RTS_UI8 node, RTS_UI16 index, RTS_UI8 sub, RTS_UI32 now_ms)
{
    client->state = SDO_BUSY;
    client->node = node;
    client->index = index;
    client->sub = sub;
    client->segmented = false;
    client->toggle = 0;
    client->done = 0;
    client->abort = 0;
    client->since_ms = now_ms;
}

void SdoClientRead(SDO_CLIENT *client, RTS_UI8 node, RTS_UI16 index, RTS_UI8 sub, RTS_UI32 now_ms)
{
    begin(client, node, index, sub, now_ms);
    client->writes = false;
    client->size = 0;
    (void)begin_of_object(client, SDO_READ);
}

void SdoClientWrite(SDO_CLIENT *client, RTS_UI8 node, RTS_UI16 index, RTS_UI8 sub, const RTS_UI8 *data, RTS_UI32 size,
                    RTS_UI32 now_ms)
{
    begin(client, node, index, sub, now_ms);
    client->writes = true;
    client->out = data;
    client->size = size;
    if (size != 0 && size <= EXPEDITED) {
        memcpy(begin_of_object(client, (RTS_UI8)(SDO_WRITE_EXPEDITED | (EXPEDITED - size) << 2)), data, size);
        client->done = size;
        return;
    }
    BytesPut32(begin_of_object(client, SDO_WRITE_BEGIN), size);
    client->segmented = true;
}

static void end(SDO_CLIENT *client, SDO_STATE state, RTS_UI32 abort)
{
    client->state = state;
    client->abort = abort;
}

/* Ends the transfer in the node, too. */
static void give_up(SDO_CLIENT *client, SDO_STATE state, RTS_UI32 abort)
{
    BytesPut32(begin_of_object(client, SDO_ABORT), abort);
    end(client, state, abort);
}

/* ---- writing ---- */

static void send_segment(SDO_CLIENT *client)
{
    RTS_UI32 left = client->size - client->done;
    RTS_UI32 size = left < SEGMENT ? left : SEGMENT;
    RTS_UI8 *data = begin_request(
        client, (RTS_UI8)(SDO_WRITE_SEGMENT | client->toggle | (SEGMENT - size) << 1 | (size == left ? IS_LAST : 0)));

    memcpy(data + 1, client->out + client->done, size);
    client->done += size;
}

static void take_of_write(SDO_CLIENT *client, const RTS_UI8 *data, bool is_of_object)
{
    if (data[0] == SDO_WRITE_DONE && is_of_object && client->toggle == 0 && client->segmented && client->done == 0) {
        if (client->size == 0)
            end(client, SDO_DONE, 0);
        else
            send_segment(client);
    } else if (data[0] == SDO_WRITE_DONE && is_of_object && !client->segmented) {
        end(client, SDO_DONE, 0);
    } else if (client->segmented && client->done != 0 && (data[0] & SDO_KIND) == SDO_SEGMENT_DONE) {
        if ((data[0] & SDO_TOGGLE) != client->toggle)
            return; /* a reply that came twice */
        client->toggle ^= SDO_TOGGLE;
        if (client->done == client->size)
            end(client, SDO_DONE, 0);
        else
            send_segment(client);
    }
}

/* ---- reading ---- */

static void ask_segment(SDO_CLIENT *client)
{
    (void)begin_request(client, (RTS_UI8)(SDO_READ_SEGMENT | client->toggle));
}

static void take_begin(SDO_CLIENT *client, const RTS_UI8 *data)
{
    if ((data[0] & IS_EXPEDITED) != 0) {
        client->done = (data[0] & HAS_SIZE) != 0 ? EXPEDITED - (data[0] >> 2 & 3u) : EXPEDITED;
        memcpy(client->in, data + 4, client->done); /* every room has as many */
        end(client, SDO_DONE, 0);
    } else {
        client->segmented = true;
        ask_segment(client);
    }
}

static void take_segment(SDO_CLIENT *client, const RTS_UI8 *data)
{
    RTS_UI32 size = SEGMENT - (data[0] >> 1 & 7u);

    if ((data[0] & SDO_TOGGLE) != client->toggle)
        return;
    if (size > client->room - client->done) {
        memcpy(client->in + client->done, data + 1, client->room - client->done);
        client->done = client->room;
        give_up(client, SDO_ABORTED, SDO_ABORT_MEMORY);
        return;
    }
    if (size == 0 && (data[0] & IS_LAST) == 0) { /* a transfer without end */
        give_up(client, SDO_ABORTED, SDO_ABORT_COMMAND);
        return;
    }
    memcpy(client->in + client->done, data + 1, size);
    client->done += size;
    client->toggle ^= SDO_TOGGLE;
    if ((data[0] & IS_LAST) != 0)
        end(client, SDO_DONE, 0);
    else
        ask_segment(client);
}

static void take_of_read(SDO_CLIENT *client, const RTS_UI8 *data, bool is_of_object)
{
    if ((data[0] & SDO_KIND) == SDO_READ && is_of_object && !client->segmented)
        take_begin(client, data);
    else if ((data[0] & SDO_KIND) == 0 && client->segmented)
        take_segment(client, data);
}

/* ---- both ---- */

/* True if the node has replied to the beginning of a transfer in segments, which it may abort at any time. */
static bool has_begun(const SDO_CLIENT *client)
{
    return client->segmented && (!client->writes || client->done != 0);
}

/* Only a reply that moves the transfer on begins a new wait. */
void SdoClientTake(SDO_CLIENT *client, const CAN_FRAME *frame, RTS_UI32 now_ms)
{
    const RTS_UI8 *data = frame->data;

    if (client->state != SDO_BUSY || frame->size != FRAME || frame->id != CANOPEN_SDO_REPLY + (RTS_UI32)client->node)
        return;
    bool is_of_object = BytesGet16(data + 1) == client->index && data[3] == client->sub;
    bool is_abort = data[0] == SDO_ABORT && is_of_object;
    if (client->has_request && !(is_abort && has_begun(client)))
        return;
    client->has_request = false;
    if (is_abort)
        end(client, SDO_ABORTED, BytesGet32(data + 4));
    else if (client->writes)
        take_of_write(client, data, is_of_object);
    else
        take_of_read(client, data, is_of_object);
    if (client->has_request)
        client->since_ms = now_ms;
}

void SdoClientPoll(SDO_CLIENT *client, RTS_UI32 now_ms)
{
    if (client->state == SDO_BUSY && now_ms - client->since_ms >= client->timeout_ms)
        give_up(client, SDO_SILENT, SDO_ABORT_TIMEOUT);
}

bool SdoClientCancel(SDO_CLIENT *client)
{
    bool is_busy = client->state == SDO_BUSY;

    if (is_busy)
        give_up(client, SDO_ABORTED, SDO_ABORT_GENERAL);
    return is_busy;
}

RTS_UI32 SdoClientGetNumber(const SDO_CLIENT *client)
{
    RTS_UI32 number = 0;

    for (RTS_UI32 i = 0; i < client->done && i < EXPEDITED; i++)
        number |= (RTS_UI32)client->in[i] << 8 * i;
    return number;
}
