/*
 * ModbusToolLine.c - the serial line on which tools reach this device through Modbus, when no server has it.
 *
 * SPDX-License-Identifier: Apache-2.0
 */
#include "ModbusToolLine.h"

#include "CmpItf.h"
#include "CmpLog.h"
#include "ModbusRtu.h"
#include "ModbusServer.h"
#include "SysTarget.h"

#if MODBUS_TUNNEL
static MODBUS_TOOL_LINE line = MODBUS_TOOL_LINE_DEFAULT;
static MODBUS_LINK link;
static MODBUS_SERVER server;
static bool is_open;

void ModbusToolLineSet(const MODBUS_TOOL_LINE *wanted)
{
    line = *wanted;
}

/* It has no memory, so there is nothing to read or write; but it says what the device is. */
static void begin_server(void)
{
    server.unit = line.unit;
    server.tunnel = true;
    server.object[0] = SysTargetGet()->vendor_name;
    server.object[1] = server.object[MODBUS_PRODUCT_NAME] = SysTargetGet()->device_name;
}

void ModbusToolLineOpen(void)
{
    RTS_UI32 index;
    RTS_RESULT result;

    if (is_open || line.name == NULL)
        return;
    result = SysComOpenPort(line.name, &line.settings, &index);
    is_open = result == ERR_OK;
    if (!is_open) {
        LogAdd(CMPID_IoDrvModbus, LOG_ERROR, result, "Tools cannot have the serial line %s", line.name);
        return;
    }
    ModbusRtuBegin(&link, index, &line.settings);
    begin_server();
}

bool ModbusToolLineClose(void)
{
    bool was_open = is_open;

    if (is_open)
        ModbusRtuClose(&link);
    is_open = false;
    return was_open;
}

bool ModbusToolLinePoll(RTS_I64 now_ns)
{
    if (!is_open)
        return false;
    (void)ModbusServerPoll(&server, &link, now_ns);
    return link.fill != 0;
}
#endif
