/*
 * ModbusScan.c - who is on a line of a Modbus client.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * Each unit is asked for its device identification (43/14), and if it has none for its server ID (17). On TCP unit 255
 * comes first: if the one that is connected replies to it, it is a device, else a gateway, whose units are asked.
 */
#include "ModbusScan.h"

#include <string.h>

#include "SysAtomic.h"

enum {
    TIMEOUT_MS = 200,
    GATEWAY_TIMEOUT_MS = 1500, /* it waits for its device */
    CONNECTED = 255,           /* unit */
    BASIC = 1,                 /* category: vendor, product, version */
    AT_CODE = 1,               /* in a reply, after the function */
    AT_OBJECTS = MODBUS_ID_HEAD - 1,
    AT_SERVER_ID = 3, /* after size, ID and state */
};

#define ABANDONED_NS ((RTS_I64)10000000000) /* the PC has not asked for so long */

static struct {
    MODBUS_CLIENT *client; /* NULL: there is no scan */
    RTS_UI32 found;        /* devices, `last` among them */
    bool over;
    bool wanted; /* the PC asks for the next one */
    bool taken;  /* it has got `last` */
    RTS_I64 asked_ns;
    MODBUS_DEVICE guest;
    MODBUS_CALL *call;
    IoDrvModule last;
} scan;

static bool is_tcp(void)
{
    return !ModbusLinkType(&scan.client->link)->broadcasts;
}

/* ---- asking ---- */

static void ask(RTS_UI8 function, RTS_I64 now_ns)
{
    MODBUS_CALL *call = scan.call;

    memset(&call->request, 0, sizeof(call->request));
    call->request.function = ModbusFindFunction(function);
    call->client = scan.client;
    call->device = &scan.guest;
    call->due_ns = now_ns;
    call->data[0] = MODBUS_DEVICE_IDENTIFICATION;
    call->data[AT_CODE] = BASIC;
    call->data[AT_CODE + 1] = 0;
    SysAtomicStore(&call->state, MODBUS_CALL_WAITS);
}

static void ask_unit(RTS_UI32 unit, RTS_I64 now_ns)
{
    scan.guest.unit = (RTS_UI8)unit;
    scan.guest.failures = 0;
    scan.guest.pause_ms = scan.client->device_count != 0 ? scan.client->devices[0].pause_ms : 0;
    scan.guest.timeout_ms = is_tcp() ? GATEWAY_TIMEOUT_MS : TIMEOUT_MS;
    ask(MODBUS_ENCAPSULATED, now_ns);
}

static void begin(MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    ModbusScanEnd();
    scan.client = client;
    scan.call = client->calls;
    ask_unit(is_tcp() ? CONNECTED : 1, now_ns);
}

static void ask_next(RTS_I64 now_ns)
{
    bool was_connected = scan.guest.unit == CONNECTED;

    scan.over = scan.guest.unit == MODBUS_MAX_UNIT || (was_connected && scan.found != 0);
    if (!scan.over)
        ask_unit(was_connected ? 1 : scan.guest.unit + 1u, now_ns);
}

/* ---- replies ---- */

static void add_text(const RTS_UI8 *text, RTS_UI32 size)
{
    char *name = scan.last.name;
    RTS_UI32 length = (RTS_UI32)strlen(name);

    if (length != 0 && length + 1 < IO_MODULE_NAME_SIZE)
        name[length++] = ' ';
    for (; size > 0 && length + 1 < IO_MODULE_NAME_SIZE; size--, text++) {
        if (*text >= ' ' && *text <= '~')
            name[length++] = (char)*text;
    }
    name[length] = '\0';
}

/* Each object is its number, its length and a text. */
static void add_objects(const RTS_UI8 *data, RTS_UI32 size)
{
    RTS_UI32 at = AT_OBJECTS;

    while (at + 2 <= size && data[at + 1] <= size - at - 2) {
        add_text(data + at + 2, data[at + 1]);
        at += 2u + data[at + 1];
    }
}

static void describe(const MODBUS_CALL *call)
{
    memset(&scan.last, 0, sizeof(scan.last));
    scan.last.slot = scan.guest.unit;
    if (call->result != ERR_OK)
        return;
    if (call->request.function->function == MODBUS_ENCAPSULATED)
        add_objects(call->data, call->size);
    else if (call->size > AT_SERVER_ID)
        add_text(call->data + AT_SERVER_ID, call->size - AT_SERVER_ID);
}

static void take_reply(RTS_I64 now_ns)
{
    const MODBUS_CALL *call = scan.call;

    if (call->result == ERR_TIMEOUT) {
        ask_next(now_ns);
    } else if (call->result != ERR_OK && call->request.function->function == MODBUS_ENCAPSULATED) {
        ask(MODBUS_REPORT_SERVER_ID, now_ns);
    } else {
        describe(call);
        scan.found++;
        scan.wanted = false;
        scan.taken = false;
        scan.call->state = MODBUS_CALL_FREE;
    }
}

/* ---- the scan ---- */

void ModbusScanPoll(const MODBUS_CLIENT *client, RTS_I64 now_ns)
{
    if (scan.client != client || scan.over || !scan.wanted || SysAtomicLoad(&scan.call->state) == MODBUS_CALL_WAITS)
        return;
    if (now_ns - scan.asked_ns >= ABANDONED_NS)
        ModbusScanEnd();
    else if (scan.call->state == MODBUS_CALL_ENDED)
        take_reply(now_ns);
    else
        ask_next(now_ns);
}

/* Whether the PC begins again: it has got the first one, or another line is scanned. */
static bool begins(const MODBUS_CLIENT *client, RTS_UI32 index)
{
    return index == 0 && (scan.client != client || scan.found > 1 || scan.taken);
}

/* Its call is on its way, and cannot be another one before it has ended. */
static bool is_asking(void)
{
    return scan.call != NULL && SysAtomicLoad(&scan.call->state) == MODBUS_CALL_WAITS;
}

static RTS_RESULT go_on(RTS_I64 now_ns)
{
    if (scan.over) {
        ModbusScanEnd();
        return ERR_NO_OBJECT;
    }
    scan.asked_ns = now_ns;
    scan.wanted = true;
    return ERR_PENDING;
}

RTS_RESULT ModbusScan(MODBUS_CLIENT *client, RTS_UI32 index, IoDrvModule *module, RTS_I64 now_ns)
{
    if (client->call_count == 0)
        return ERR_NOT_SUPPORTED;
    if (begins(client, index)) {
        if (is_asking()) {
            scan.wanted = false;
            return ERR_PENDING;
        }
        begin(client, now_ns);
    }
    if (scan.client == client && index == scan.found)
        return go_on(now_ns);
    if (scan.client != client || index + 1 != scan.found)
        return ERR_NO_OBJECT;
    scan.taken = true;
    *module = scan.last;
    return ERR_OK;
}

void ModbusScanEnd(void)
{
    if (scan.call != NULL)
        SysAtomicStore(&scan.call->state, MODBUS_CALL_FREE);
    memset(&scan, 0, sizeof(scan));
}
