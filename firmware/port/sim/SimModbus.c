/*
 * SimModbus.c - what simulated Modbus devices reply to the requests of a program (ModbusCalls.h).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * A device has the coils and registers that were written to it, by the program or by SimModbusSet, and refuses to read
 * others (MODBUS_ILLEGAL_ADDRESS). What the description reads and writes again and again is IoDrvSim's.
 */
#include <string.h>

#include "../../src/io/ModbusCalls.h"
#include "AppState.h"
#include "CmpEventMgr.h"
#include "CmpIoMgrEmbedded.h"
#include "IoDrvSim.h"
#include "Sim.h"
#include "SysAtomic.h"
#include "SysTime.h"
#include "sim_port.h"

enum { VALUES = 4096 };

#define REQUEST_NS ((RTS_I64)20000000) /* that one takes: some registers at 19200 baud */

typedef struct {
    RTS_UI8 device; /* its number + 1; 0: the entry is free */
    RTS_UI8 table;  /* MODBUS_COILS, ... */
    RTS_UI16 address;
    RTS_UI16 value;
} SIM_VALUE;

static MODBUS_SETUP setup;
static SIM_VALUE values[VALUES];

/* ---- what devices hold ---- */

/* The entry of a coil or register, or the one that is free for it; NULL: there are VALUES others. */
static SIM_VALUE *find_value(RTS_UI32 device, RTS_UI8 table, RTS_UI32 address)
{
    RTS_UI32 at = (device * 31u + table) * 997u + address;

    for (RTS_UI32 i = 0; i < VALUES; i++) {
        SIM_VALUE *value = &values[(at + i) % VALUES];
        if (value->device == 0 || (value->device == device + 1 && value->table == table && value->address == address))
            return value;
    }
    return NULL;
}

static bool set_value(RTS_UI32 device, RTS_UI8 table, RTS_UI32 address, RTS_UI16 number)
{
    SIM_VALUE *value = find_value(device, table, address);

    if (value == NULL)
        return false;
    *value = (SIM_VALUE){(RTS_UI8)(device + 1), table, (RTS_UI16)address, number};
    return true;
}

static bool get_value(RTS_UI32 device, RTS_UI8 table, RTS_UI32 address, RTS_UI16 *number)
{
    const SIM_VALUE *value = find_value(device, table, address);

    if (value == NULL || value->device == 0)
        return false;
    *number = value->value;
    return true;
}

RTS_RESULT SimModbusSet(const char *device, RTS_UI32 table, RTS_UI32 address, RTS_UI32 number)
{
    for (RTS_UI32 i = 0; i < setup.device_count; i++) {
        if (strcmp(IoMgrConfigGetName(setup.noted[i].connector), device) != 0)
            continue;
        return set_value(i, (RTS_UI8)table, address, (RTS_UI16)number) ? ERR_OK : ERR_NOMEMORY;
    }
    return ERR_NO_OBJECT;
}

/* ---- requests ---- */

static bool is_one(const MODBUS_CALL *call)
{
    return call->request.function->function == MODBUS_WRITE_COIL;
}

static RTS_UI16 written(const MODBUS_CALL *call, RTS_UI32 i)
{
    if (is_one(call))
        return ModbusGet16(call->data) != 0;
    if (call->request.function->count_of_bits == 1)
        return call->data[i / 8] >> i % 8 & 1;
    return ModbusGet16(call->data + 2 * i);
}

static RTS_UI8 write_all(const MODBUS_CALL *call, RTS_UI32 device)
{
    const MODBUS_REQUEST *request = &call->request;

    for (RTS_UI32 i = 0; i < request->write_count; i++) {
        if (!set_value(device, request->function->table, request->write_address + i, written(call, i)))
            return MODBUS_DEVICE_FAILURE;
    }
    return 0;
}

static RTS_UI8 read_all(MODBUS_CALL *call, RTS_UI32 device)
{
    const MODBUS_REQUEST *request = &call->request;
    RTS_UI16 number;

    memset(call->data, 0, sizeof(call->data));
    call->size = (RTS_UI8)ModbusDataSize(request->function, request->read_count);
    for (RTS_UI32 i = 0; i < request->read_count; i++) {
        if (!get_value(device, request->function->table, request->read_address + i, &number))
            return MODBUS_ILLEGAL_ADDRESS;
        if (request->function->count_of_bits == 1)
            call->data[i / 8] |= (RTS_UI8)((number & 1) << i % 8);
        else
            ModbusPut16(call->data + 2 * i, number);
    }
    return 0;
}

static bool is_absent(RTS_UI32 device)
{
    RTS_UI32 absent = 0;

    (void)IoMgrReadParameter(IoMgrConfigGetIndex(setup.noted[device].connector), IO_SIM_ABSENT, &absent, 32, 0);
    return absent != 0;
}

static void reply(MODBUS_CALL *call)
{
    RTS_UI32 device = (RTS_UI32)(call->device - setup.devices);

    call->result = ERR_TIMEOUT;
    if (!is_absent(device)) {
        call->exception = call->request.write_count != 0 ? write_all(call, device) : read_all(call, device);
        call->result = call->exception == 0 ? ERR_OK : ERR_FAILED;
    }
    SysAtomicStore(&call->state, MODBUS_CALL_ENDED);
}

static void reply_soon(void)
{
    SimWantPass(REQUEST_NS);
}

static void cycle(void)
{
    RTS_I64 now_ns = SysTimeGetNs();

    ModbusCallsPoll(AppGetState() == AS_RUN, now_ns);
    for (RTS_UI32 i = 0; i < RTS_COUNT(setup.calls); i++) {
        MODBUS_CALL *call = &setup.calls[i];
        if (SysAtomicLoad(&call->state) != MODBUS_CALL_WAITS)
            continue;
        if (now_ns - call->due_ns >= REQUEST_NS)
            reply(call);
        else
            reply_soon();
    }
}

/* ---- devices ---- */

/* Whether a connector is a Modbus device that is simulated. */
static bool is_device(const IoConfigConnector *connector)
{
    RTS_UI32 fault;

    return connector->parent != IO_CONFIG_NONE && strcmp(IoMgrConfigGetDriverName(connector), "IoDrvModbus") == 0 &&
           IoMgrReadParameter(IoMgrConfigGetIndex(connector), IO_SIM_ABSENT, &fault, 32, 0) == ERR_OK;
}

static void give_back(const EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    if (setup.device_count != 0)
        ModbusCallsBegin(NULL, NULL);
    memset(&setup, 0, sizeof(setup));
    memset(values, 0, sizeof(values));
}

static void set_up(const EVENT_PARAM *event)
{
    const IoConfigConnector *connector;

    RTS_UNUSED(event);
    for (RTS_UI32 i = 0; (connector = IoMgrConfigGetConnector(i)) != NULL && setup.device_count < MODBUS_MAX_DEVICES;
         i++) {
        if (!is_device(connector))
            continue;
        setup.devices[setup.device_count].unit = 1;
        setup.noted[setup.device_count++].connector = connector;
    }
    setup.client_count = 1;
    setup.clients[0].client.devices = setup.devices;
    setup.clients[0].client.device_count = setup.device_count;
    if (setup.device_count != 0)
        ModbusCallsBegin(&setup, reply_soon);
}

/* Elsewhere a pass comes before the next request of a tool; here virtual time may stand still. */
static void cancel(const EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    if (setup.device_count != 0)
        ModbusCallsPoll(false, SysTimeGetNs());
}

RTS_RESULT SimModbus_Hook(CMP_HOOK hook)
{
    if (hook == CH_INIT2) {
        (void)EventRegisterCallback(CMPID_CmpIoMgrEmbedded, EVT_PrepareUpdateConfiguration, give_back, NULL);
        (void)EventRegisterCallback(CMPID_CmpIoMgrEmbedded, EVT_DoneUpdateConfiguration, set_up, NULL);
        (void)EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_StopDone, cancel, NULL);
    }
    if (hook == CH_INIT3)
        return ModbusCallsRegister();
    if (hook == CH_COMM_CYCLE && setup.device_count != 0)
        cycle();
    return ERR_OK;
}
