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

RTS_RESULT SimIoWrite(const char *connector, RTS_UI32 parameter, RTS_UI32 bit, RTS_UI32 bits, const RTS_UI8 *data)
{
    RTS_UI32 index = find(connector);

    return index != IO_CONFIG_NONE ? IoMgrWriteParameter(index, parameter, data, bits, bit) : (RTS_RESULT)ERR_NO_OBJECT;
}

RTS_RESULT SimIoRead(const char *connector, RTS_UI32 parameter, RTS_UI32 bit, RTS_UI32 bits, RTS_UI8 *data)
{
    RTS_UI32 index = find(connector);

    return index != IO_CONFIG_NONE ? IoMgrReadParameter(index, parameter, data, bits, bit) : (RTS_RESULT)ERR_NO_OBJECT;
}

RTS_RESULT SimIoFault(const char *connector, RTS_UI32 fault, RTS_UI32 value)
{
    return SimIoWrite(connector, fault, 0, 8 * sizeof value, (const RTS_UI8 *)&value);
}

RTS_RESULT SimIoGetState(const char *connector, IO_DEVICE_STATE *state)
{
    RTS_UI32 index = find(connector);

    return index != IO_CONFIG_NONE ? IoMgrGetState(index, state) : (RTS_RESULT)ERR_NO_OBJECT;
}
