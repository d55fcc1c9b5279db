/*
 * ModbusCalls.c - requests that a program makes once, by the blocks MODBUS_READ and MODBUS_WRITE of the library.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusCalls.h"

#include <string.h>

#include "CmpItf.h"
#include "IoMgrConfig.h"
#include "SysAtomic.h"
#include "SysTime.h"

#if MODBUS_MAX_CALLS > 0
enum {
    VERSION = 0x00010000,
    FIRST = 1,   /* slot: the previous one is that of scans */
    SLOTS = 256, /* in the number of a request: its slot, and how often there was one */
    COIL_ON = 0xFF00,
};

#define ABANDONED_NS ((RTS_I64)60000000000)

static MODBUS_SETUP *setup;
static void (*wake)(void);
static RTS_UI32 taken; /* requests ever */

/* ---- slots ---- */

static MODBUS_CALL *find_free(void)
{
    for (RTS_UI32 i = FIRST; i < RTS_COUNT(setup->calls); i++) {
        if (SysAtomicReplace(&setup->calls[i].state, MODBUS_CALL_FREE, MODBUS_CALL_TAKEN))
            return &setup->calls[i];
    }
    return NULL;
}

/* The request of a number, if it is in that state. */
static MODBUS_CALL *find(RTS_I32 number, RTS_UI32 state)
{
    RTS_UI32 slot = (RTS_UI32)number % SLOTS;
    MODBUS_CALL *call;

    if (setup == NULL || slot < FIRST || slot >= RTS_COUNT(setup->calls))
        return NULL;
    call = &setup->calls[slot];
    return call->number == number && SysAtomicLoad(&call->state) == state ? call : NULL;
}

static RTS_I32 new_number(const MODBUS_CALL *call)
{
    RTS_UI32 generation = SysAtomicAdd(&taken, 1) & (INT32_MAX / SLOTS);

    return (RTS_I32)(generation * SLOTS + (RTS_UI32)(call - setup->calls));
}

/* ---- devices ---- */

static MODBUS_CLIENT *client_of(const MODBUS_DEVICE *device)
{
    for (RTS_UI32 i = 0; i < setup->client_count; i++) {
        MODBUS_CLIENT *client = &setup->clients[i].client;
        if (device >= client->devices && device < client->devices + client->device_count)
            return client;
    }
    return NULL;
}

static MODBUS_DEVICE *find_device(const char *name)
{
    for (RTS_UI32 i = 0; setup != NULL && i < setup->device_count; i++) {
        if (strcmp(IoMgrConfigGetName(setup->noted[i].connector), name) == 0)
            return &setup->devices[i];
    }
    return NULL;
}

/* ---- requests ---- */

/* False: there is no such request. Nothing is read from all devices at once. */
static bool describe(MODBUS_REQUEST *request, const MODBUS_DEVICE *device, RTS_UI8 function, RTS_UI16 address,
                     RTS_UI16 count)
{
    const MODBUS_FUNCTION *kind = ModbusFindFunction(function);
    RTS_UI32 most = kind == NULL ? 0 : (RTS_UI32)kind->most_read + kind->most_written;

    if (kind == NULL || (kind->most_read != 0 && kind->most_written != 0) || function == MODBUS_MASK_WRITE_REGISTER ||
        count == 0 || count > most || (RTS_UI32)address + count > UINT16_MAX + 1u)
        return false;
    *request = (MODBUS_REQUEST){.function = kind};
    if (kind->most_written != 0) {
        request->write_address = address;
        request->write_count = count;
    } else {
        request->read_address = address;
        request->read_count = count;
    }
    return kind->most_written != 0 || ModbusDeviceIsOne(client_of(device), device);
}

/* What is past the last coil is 0. */
static void clear_rest(MODBUS_CALL *call)
{
    RTS_UI32 bits = call->request.write_count;

    if (call->request.function->function == MODBUS_WRITE_COILS && bits % 8 != 0)
        call->data[bits / 8] &= (RTS_UI8)((1u << bits % 8) - 1);
}

/* ---- what the library calls, from tasks ---- */

/* The number of a new request, or the negative of a MODBUS_ERROR. `device`: its name, with NUL. */
static RTS_I32 modbus_take(RTS_UI8 *device, RTS_UI8 function, RTS_UI16 address, RTS_UI16 count)
{
    MODBUS_DEVICE *found = find_device((const char *)device);
    MODBUS_REQUEST request;
    MODBUS_CALL *call;

    if (found == NULL)
        return -MODBUS_ERROR_NO_DEVICE;
    if (!describe(&request, found, function, address, count))
        return -MODBUS_ERROR_INVALID;
    call = find_free();
    if (call == NULL)
        return -MODBUS_ERROR_NO_ROOM;
    call->request = request;
    call->device = found;
    call->client = client_of(found);
    call->exception = 0;
    call->number = new_number(call);
    memset(call->data, 0, sizeof(call->data));
    return call->number;
}

static RTS_UI8 modbus_put(RTS_I32 number, RTS_UI16 index, RTS_UI16 value)
{
    MODBUS_CALL *call = find(number, MODBUS_CALL_TAKEN);
    RTS_UI8 *data;

    if (call == NULL || 2u * index + 2 > sizeof(call->data))
        return 0;
    data = call->data + 2u * index;
    if (call->request.function->function == MODBUS_WRITE_COIL) {
        ModbusPut16(data, (value & 1) != 0 ? COIL_ON : 0);
    } else if (call->request.function->count_of_bits == 1) {
        data[0] = (RTS_UI8)value;
        data[1] = (RTS_UI8)(value >> 8);
    } else {
        ModbusPut16(data, value);
    }
    return 1;
}

static RTS_UI8 modbus_send(RTS_I32 number)
{
    MODBUS_CALL *call = find(number, MODBUS_CALL_TAKEN);

    if (call == NULL)
        return 0;
    clear_rest(call);
    call->due_ns = SysTimeGetNs();
    SysAtomicStore(&call->state, MODBUS_CALL_WAITS);
    if (wake != NULL)
        wake();
    return 1;
}

static RTS_I32 result_of(const MODBUS_CALL *call)
{
    if (call->result == ERR_OK)
        return 1;
    return call->exception != 0 ? -call->exception : -MODBUS_ERROR_NO_REPLY;
}

/* 0: it waits or is on its way; 1: it has ended well; else the negative of an ErrorID. */
static RTS_I32 modbus_state(RTS_I32 number)
{
    MODBUS_CALL *call = find(number, MODBUS_CALL_ENDED);

    if (call != NULL && SysAtomicReplace(&call->state, MODBUS_CALL_ENDED, MODBUS_CALL_TAKEN)) {
        if (call->number == number)
            return result_of(call);
        SysAtomicStore(&call->state, MODBUS_CALL_ENDED); /* it became that of another block meanwhile */
    }
    return find(number, MODBUS_CALL_WAITS) != NULL ? 0 : -MODBUS_ERROR_CANCELLED;
}

static RTS_UI16 modbus_get(RTS_I32 number, RTS_UI16 index)
{
    const MODBUS_CALL *call = find(number, MODBUS_CALL_TAKEN);
    RTS_UI8 bytes[2] = {0, 0};

    for (RTS_UI32 i = 0; call != NULL && i < sizeof(bytes) && 2u * index + i < call->size; i++)
        bytes[i] = call->data[2u * index + i];
    if (call != NULL && call->request.function->count_of_bits == 1)
        return (RTS_UI16)(bytes[0] | bytes[1] << 8);
    return ModbusGet16(bytes);
}

static RTS_UI8 modbus_free(RTS_I32 number)
{
    MODBUS_CALL *call = find(number, MODBUS_CALL_TAKEN);

    if (call != NULL)
        SysAtomicStore(&call->state, MODBUS_CALL_FREE);
    return call != NULL;
}

APP_GATE(modbus_take);
APP_GATE(modbus_put);
APP_GATE(modbus_send);
APP_GATE(modbus_state);
APP_GATE(modbus_get);
APP_GATE(modbus_free);

RTS_RESULT ModbusCallsRegister(void)
{
    /* The signatures are those of stdlib/modbus.st. */
    static const CMP_EXT_FUNCTION functions[] = {
        {"modbus_take", 0xC068EA73, VERSION, (RTS_PFN)APP_GATED(modbus_take)},
        {"modbus_put", 0x8A6E0D26, VERSION, (RTS_PFN)APP_GATED(modbus_put)},
        {"modbus_send", 0x6E1E3F28, VERSION, (RTS_PFN)APP_GATED(modbus_send)},
        {"modbus_state", 0x3CD610B4, VERSION, (RTS_PFN)APP_GATED(modbus_state)},
        {"modbus_get", 0x470B09DD, VERSION, (RTS_PFN)APP_GATED(modbus_get)},
        {"modbus_free", 0x66E87B8C, VERSION, (RTS_PFN)APP_GATED(modbus_free)},
    };

    return CMRegisterExternal(functions, RTS_COUNT(functions));
}

/* ---- main ---- */

void ModbusCallsBegin(MODBUS_SETUP *of, void (*waking)(void))
{
    setup = of;
    wake = waking;
}

/* One that is on its way when the program stops is given back when it has ended. */
void ModbusCallsPoll(bool is_running, RTS_I64 now_ns)
{
    for (RTS_UI32 i = FIRST; i < RTS_COUNT(setup->calls); i++) {
        MODBUS_CALL *call = &setup->calls[i];
        bool is_asking = ModbusClientIsAsking(call);
        if (!is_running)
            call->number = 0;
        if (!is_running && !is_asking)
            SysAtomicStore(&call->state, MODBUS_CALL_FREE);
        else if (call->number == 0 || now_ns - call->due_ns > ABANDONED_NS)
            (void)SysAtomicReplace(&call->state, MODBUS_CALL_ENDED, MODBUS_CALL_FREE);
    }
}
#else
RTS_RESULT ModbusCallsRegister(void)
{
    return ERR_OK;
}

void ModbusCallsBegin(MODBUS_SETUP *setup, void (*wake)(void))
{
    RTS_UNUSED(setup);
    RTS_UNUSED(wake);
}

void ModbusCallsPoll(bool is_running, RTS_I64 now_ns)
{
    RTS_UNUSED(is_running);
    RTS_UNUSED(now_ns);
}
#endif
