/*
 * IoMgrRequests.c - what the PC asks of a device: parameters, identify, scan.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "IoMgrRequests.h"

#include <string.h>

#include "IoDevices.h"
#include "IoMgrConfig.h"
#include "IoTables.h"
#include "SysAtomic.h"

/* The driver of a connector; NULL with the reason in *result. */
static const ICmpIoDrv *find_functions(RTS_UI32 index, RTS_RESULT *result)
{
    IO_DRIVER *driver = index < IoTablesCountConnectors() ? IoDeviceGetDriver(index) : NULL;

    *result = index < IoTablesCountConnectors() ? ERR_NO_OBJECT : ERR_INVALIDID;
    return driver != NULL ? driver->functions : NULL;
}

/* What the configuration says. */
static RTS_RESULT read_configured(const IoConfigParameter *parameter, void *data, RTS_UI32 bits, RTS_UI32 bit_offset)
{
    const void *value = IoMgrConfigGetParameterValuePointer(parameter, NULL);
    RTS_UI32 i;

    if (parameter == NULL)
        return ERR_NO_OBJECT;
    if (bits > parameter->bits || bit_offset > parameter->bits - bits)
        return ERR_OUT_OF_LIMITS;
    if (value == NULL)
        value = &parameter->value;
    memset(data, 0, (bits + 7) / 8);
    for (i = 0; i < bits; i++) {
        RTS_UI32 from = bit_offset + i;
        if ((((const RTS_UI8 *)value)[from / 8] >> (from & 7) & 1) != 0)
            ((RTS_UI8 *)data)[i / 8] |= (RTS_UI8)(1u << (i & 7));
    }
    return ERR_OK;
}

RTS_RESULT IoMgrReadParameter(RTS_UI32 connector, RTS_UI32 id, void *data, RTS_UI32 bits, RTS_UI32 bit_offset)
{
    const IoConfigConnector *place = IoMgrConfigGetConnector(connector);
    RTS_RESULT result;
    const ICmpIoDrv *functions = find_functions(connector, &result);

    if (functions != NULL && functions->IoDrvReadParameter != NULL)
        result = functions->IoDrvReadParameter(place, id, data, bits, bit_offset);
    else if (place != NULL)
        result = ERR_NO_OBJECT;
    return result == ERR_NO_OBJECT ? read_configured(IoMgrConfigGetParameter(place, id), data, bits, bit_offset)
                                   : result;
}

RTS_RESULT IoMgrWriteParameter(RTS_UI32 connector, RTS_UI32 id, const void *data, RTS_UI32 bits, RTS_UI32 bit_offset)
{
    RTS_RESULT result;
    const ICmpIoDrv *functions = find_functions(connector, &result);

    if (functions == NULL)
        return result;
    if (functions->IoDrvWriteParameter == NULL)
        return ERR_NOT_SUPPORTED;
    return functions->IoDrvWriteParameter(IoMgrConfigGetConnector(connector), id, data, bits, bit_offset);
}

RTS_RESULT IoMgrIdentify(RTS_UI32 connector)
{
    RTS_RESULT result;
    const ICmpIoDrv *functions = find_functions(connector, &result);

    if (functions == NULL)
        return result;
    return functions->IoDrvIdentify != NULL ? functions->IoDrvIdentify(IoMgrConfigGetConnector(connector))
                                            : (RTS_RESULT)ERR_NOT_SUPPORTED;
}

RTS_RESULT IoMgrScanModules(RTS_UI32 connector, RTS_UI32 index, IoDrvModule *module)
{
    RTS_RESULT result;
    const ICmpIoDrv *functions = find_functions(connector, &result);

    if (functions == NULL)
        return result;
    memset(module, 0, sizeof *module);
    return functions->IoDrvScanModules != NULL
               ? functions->IoDrvScanModules(IoMgrConfigGetConnector(connector), index, module)
               : (RTS_RESULT)ERR_NOT_SUPPORTED;
}

RTS_UI32 IoMgrGetSkipped(RTS_UI32 connector)
{
    IO_DRIVER *driver = connector < IoTablesCountConnectors() ? IoDeviceGetDriver(connector) : NULL;

    return driver != NULL ? SysAtomicLoad(&driver->skipped) : 0;
}
