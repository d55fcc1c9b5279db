/*
 * SimBuses.c - the simulated field buses as one component: serial lines and TCP with Modbus, CAN with CANopen.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "../../src/io/CanopenDeviceDriver.h"
#include "AppState.h"
#include "CmpEventMgr.h"
#include "CmpIoMgrEmbedded.h"
#include "SimCanBus.h"
#include "SimCanopen.h"
#include "SimModbus.h"
#include "SimWire.h"
#include "SysTime.h"
#include "sim_port.h"

/* ---- what a program exchanges with them ---- */

static RTS_RESULT set(const IoConfigConnector *connector, const SIM_IO_PLACE *place, const RTS_UI8 *data)
{
    RTS_RESULT result = SimModbusSetPlace(connector, place, data);

    if (result == ERR_NOT_SUPPORTED)
        result = IoDrvCanopenDeviceSet(connector, place->parameter, place->bit, place->bits, data);
    return result == ERR_NOT_SUPPORTED ? SimCanopenSet(connector, place, data) : result;
}

static RTS_RESULT get(const IoConfigConnector *connector, const SIM_IO_PLACE *place, RTS_UI8 *data)
{
    RTS_RESULT result = SimModbusGetPlace(connector, place, data);

    if (result == ERR_NOT_SUPPORTED)
        result = IoDrvCanopenDeviceGet(connector, place->parameter, place->bit, place->bits, data);
    return result == ERR_NOT_SUPPORTED ? SimCanopenGet(connector, place, data) : result;
}

static RTS_RESULT fail(const IoConfigConnector *connector, RTS_UI32 fault, RTS_UI32 value)
{
    RTS_RESULT result = SimModbusFail(connector, fault, value);

    return result == ERR_NOT_SUPPORTED ? SimCanopenFail(connector, fault, value) : result;
}

/* ---- time ---- */

static RTS_I64 earlier(RTS_I64 a, RTS_I64 b)
{
    return a < b ? a : b;
}

static RTS_I64 due_ns(RTS_I64 now_ns)
{
    return earlier(earlier(SimWireGetDueNs(now_ns), SimModbusGetDueNs(now_ns)), SimCanBusGetDueNs(now_ns));
}

/* ---- configurations ---- */

static void forget(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    SimModbusForget();
    SimCanopenForget();
}

static void make_devices(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    SimCanopenMake(SysTimeGetNs());
    SimModbusMake();
}

static void cancel(EVENT_PARAM *event)
{
    RTS_UNUSED(event);
    SimModbusCancel();
}

RTS_RESULT SimBuses_Hook(CMP_HOOK hook)
{
    static const SIM_BUS buses = {
        SimWireOpen, SimWireClose, SimWireRead, SimWireWrite, SimWireDiscard,     SimWireGetByteNs,
        set,         get,          fail,        due_ns,       SimCanBusGetNextNs, SimCanBusRun,
    };

    if (hook == CH_INIT)
        SimBus = &buses;
    if (hook == CH_INIT2) {
        (void)EventRegisterCallback(CMPID_CmpIoMgrEmbedded, EVT_PrepareUpdateConfiguration, forget, NULL);
        (void)EventRegisterCallback(CMPID_CmpIoMgrEmbedded, EVT_DoneUpdateConfiguration, make_devices, NULL);
        (void)EventRegisterCallback(CMPID_CmpAppEmbedded, EVT_StopDone, cancel, NULL);
    }
    return ERR_OK;
}
