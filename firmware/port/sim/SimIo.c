/*
 * SimIo.c - simulated inputs and outputs, by the names of the description.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include <string.h>

#include "CmpIoMgrEmbedded.h"
#include "Sim.h"
#include "sim_port.h"

/* Not one that is there, when none has the name. */
static RTS_UI32 find(const char *name)
{
    const IoConfigConnector *connector;
    RTS_UI32 i = 0;

    while (SimIsOn() && (connector = IoMgrConfigGetConnector(i)) != NULL) {
        if (strcmp(IoMgrConfigGetName(connector), name) == 0)
            return i;
        i++;
    }
    return IO_CONFIG_NONE;
}

RTS_RESULT SimIoWrite(const char *connector, const SIM_IO_PLACE *place, const RTS_UI8 *data)
{
    RTS_UI32 index = find(connector);
    RTS_RESULT result = ERR_NOT_SUPPORTED;

    if (index == IO_CONFIG_NONE)
        return ERR_NO_OBJECT;
    if (SimBus != NULL)
        result = SimBus->set(IoMgrConfigGetConnector(index), place, data);
    return result == ERR_NOT_SUPPORTED ? IoMgrWriteParameter(index, place->parameter, data, place->bits, place->bit)
                                       : result;
}

RTS_RESULT SimIoRead(const char *connector, const SIM_IO_PLACE *place, RTS_UI8 *data)
{
    RTS_UI32 index = find(connector);
    RTS_RESULT result = ERR_NOT_SUPPORTED;

    if (index == IO_CONFIG_NONE)
        return ERR_NO_OBJECT;
    if (SimBus != NULL)
        result = SimBus->get(IoMgrConfigGetConnector(index), place, data);
    return result == ERR_NOT_SUPPORTED ? IoMgrReadParameter(index, place->parameter, data, place->bits, place->bit)
                                       : result;
}

RTS_RESULT SimIoFault(const char *connector, RTS_UI32 fault, RTS_UI32 value)
{
    RTS_UI32 index = find(connector);
    RTS_RESULT result = ERR_NOT_SUPPORTED;

    if (index == IO_CONFIG_NONE)
        return ERR_NO_OBJECT;
    if (SimBus != NULL)
        result = SimBus->fail(IoMgrConfigGetConnector(index), fault, value);
    return result == ERR_NOT_SUPPORTED ? IoMgrWriteParameter(index, fault, &value, 8 * sizeof value, 0) : result;
}

RTS_RESULT SimIoGetState(const char *connector, IO_DEVICE_STATE *state)
{
    RTS_UI32 index = find(connector);

    return index != IO_CONFIG_NONE ? IoMgrGetState(index, state) : (RTS_RESULT)ERR_NO_OBJECT;
}
