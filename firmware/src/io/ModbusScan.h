/*
 * ModbusScan.h - who is on a line of a Modbus client: asks each unit for its identification.
 *
 * SPDX-License-Identifier: Apache-2.0
 *
 * One line at a time, all from main. Its requests are calls of the client, so the exchange of data goes on between them.
 */
#ifndef MODBUSSCAN_H
#define MODBUSSCAN_H

#include "IoDrv.h"
#include "ModbusClient.h"

/* Device number `index` on a line, as IoDrvScanModules has it; 0 begins a scan. */
RTS_RESULT ModbusScan(MODBUS_CLIENT *client, RTS_UI32 index, IoDrvModule *module, RTS_I64 now_ns);

/* Goes on; for every client after ModbusClientPoll. */
void ModbusScanPoll(const MODBUS_CLIENT *client, RTS_I64 now_ns);

/* Before the clients are set up again. */
void ModbusScanEnd(void);

#endif
