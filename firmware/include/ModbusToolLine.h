/*
 * ModbusToolLine.h - the serial line on which tools reach this device through Modbus (ModbusTunnel.h).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * The application's server has it if it has one there; else it is open with the firmware's own settings. All from main.
 */
#ifndef MODBUSTOOLLINE_H
#define MODBUSTOOLLINE_H

#include "SysCom.h"
#include "rts_config.h"

/* ---- for a port ---- */

typedef struct {
    const char *name; /* as SysComOpenPort; NULL: there is no tunnel */
    SYSCOM_SETTINGS settings;
    RTS_UI8 unit;
} MODBUS_TOOL_LINE;

/* Instead of MODBUS_TOOL_LINE_DEFAULT. The name stays. Before CMInit; MODBUS_TUNNEL 1. */
void ModbusToolLineSet(const MODBUS_TOOL_LINE *line);

/* ---- for the driver ---- */

#if MODBUS_TUNNEL
/* Opens it, if the port names one and it is not open. */
void ModbusToolLineOpen(void);

/* Closes it; whether it was open. */
bool ModbusToolLineClose(void);

/* Receives and replies; whether it is soon to be called again. */
bool ModbusToolLinePoll(RTS_I64 now_ns);
#else
static inline void ModbusToolLineOpen(void)
{
}

static inline bool ModbusToolLineClose(void)
{
    return false;
}

static inline bool ModbusToolLinePoll(RTS_I64 now_ns)
{
    RTS_UNUSED(now_ns);
    return false;
}
#endif

#endif
