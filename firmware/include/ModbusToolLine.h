/*
 * ModbusToolLine.h - the serial line on which tools reach this device through Modbus (ModbusTunnel.h).
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * It is open, with the firmware's own settings, whenever no server of the application has it. All from main.
 */
#ifndef MODBUSTOOLLINE_H
#define MODBUSTOOLLINE_H

#include "ModbusTunnel.h"

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
